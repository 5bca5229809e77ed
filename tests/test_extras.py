"""Packages that only some commands need: each command is begun with what it needs, and says what installs the rest."""

from __future__ import annotations

import math
import re
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from feedsim.cli.commands import commands
from feedsim.foundation import installation

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EVERY = sorted({module for modules in installation.EXTRAS.values() for module in modules})
# Runs the command line with packages missing, those that argv[1] names.
BLOCK = """
import sys
class Missing:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in sys.argv[1].split(","):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Missing())
"""
WITHOUT = f"{BLOCK}import feedsim.cli, feedsim.foundation.installation\nsys.exit(feedsim.cli.main(sys.argv[2:]))\n"
# A stretch of every command's work; {scenarios} is where those that come along are.
EXAMPLES = {
    "example": ["xz_circle", "--to", "copied"],
    "run": ["{scenarios}/z_positioning.yaml", "--set=motions=[{{kind: dwell, duration: 20 ms}}]", "--set=evaluate=[]"],
    "check": ["{scenarios}/xz_circle.yaml"],
    "machine build": ["{scenarios}/machines/test_centre", "--out", "built"],
    "machine info": ["{scenarios}/machines/test_centre"],
    "machine view": ["{scenarios}/machines/test_centre", "--out", "shown"],
    "export": ["{scenarios}/z_positioning.yaml", "--out", "z.ssp"],
    "compare": ["a.csv", "a.csv", "--report", "a.html", "--junit", "a.xml"],
    "tools convert": ["a.csv", "--column", "time=time:s", "--column", "x=Z.x_a:m", "--out", "b.csv"],
    "tools schema": ["scenario"],
    "tools completion": ["bash"],
    "sweep": ["{scenarios}/studies/z_stop.yaml", "--runs", "2", "--workers", "0"],
}


def packages(extra: str) -> Iterator[str]:
    """Those of pyproject.toml, of the extras that an extra names as well."""
    for text in PROJECT["optional-dependencies"][extra]:
        if inner := re.match(r"feedsim\[([\w,]+)\]", text):
            for name in inner[1].split(","):
                yield from packages(name)
        else:
            name = re.split(r"[\[>=]", text)[0]
            yield {"pillow": "PIL"}.get(name, name)


def python(code: str, packages: list[str], *arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", code, ",".join(packages), *arguments]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)


def without(packages: list[str], *command: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return python(WITHOUT, packages, *command, cwd=cwd)


LEAVES = {command.name: command.declared for command in commands()}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "a.csv").write_text("time [s],x [m]\n0,1.0\n1,2.0\n")
    return tmp_path


def example(name: str) -> list[str]:
    return [*name.split(), *(each.format(scenarios=ROOT / "scenarios") for each in EXAMPLES[name])]


@pytest.mark.parametrize("extra", installation.EXTRAS)
def test_every_extra_brings_its_modules(extra: str) -> None:
    assert set(packages(extra)) == set(installation.EXTRAS[extra])


def test_the_wheel_alone_runs_scenarios() -> None:
    plain = {re.split(r"[\[>=]", text)[0] for text in PROJECT["dependencies"]}
    assert set(installation.EXTRAS["run"]) <= plain


def test_all_brings_what_commands_need() -> None:
    needed = {module for command in LEAVES.values() for extra in command.needs for module in installation.EXTRAS[extra]}
    assert needed | {"pyuff", "xlsxwriter", "h5py"} == set(packages("all"))


@pytest.mark.parametrize("name", LEAVES)
def test_without_any_extra_a_command_works_or_says_at_once_what_it_lacks(name: str, folder: Path) -> None:
    """What is said is before the command looks at its arguments, or they are the example's."""
    needs = LEAVES[name].needs
    arguments = {"identify friction": ["a.csv"], "circle": ["a.csv"], "frf": ["a"], "diff": ["a"]}
    record = {
        "tune compensation": ["a"],
        "tune feedforward": ["a"],
        "tune proposals": ["a"],
        "tune drive": ["a", "--axes", "Z"],
        "machine import": ["a"],
        "machine export": ["a", "--like", "b"],
        "replay": ["a", "--machine", "a"],
        "identify drive": ["a"],
        "identify modes": ["a", "--machine", "a"],
        "identify mounts": ["a", "--machine", "a"],
        "history": ["a"],
        "docs": ["--path"],
    }
    given = example(name) if name in EXAMPLES else [*name.split(), *(arguments | record)[name]]
    done = without(EVERY, *given, cwd=folder)
    if not needs:
        assert (done.returncode, done.stderr) == (0, "")
        return
    (extra,) = needs
    *others, last = installation.EXTRAS[extra]
    lacking = f"{', '.join(others)} and {last} are not installed"
    said = f'feedsim: feedsim {name} needs feedsim[{extra}], of which {lacking}: pip install "feedsim[{extra}]"\n'
    assert (done.returncode, done.stdout, done.stderr) == (2, "", said)
    assert [path.name for path in folder.iterdir()] == ["a.csv"], "nothing is half-written"


@pytest.mark.extensive
@pytest.mark.parametrize("name", [name for name in EXAMPLES if LEAVES[name].needs])
def test_a_command_does_with_its_extra(name: str, folder: Path) -> None:
    brought = {module for extra in LEAVES[name].needs for module in installation.EXTRAS[extra]}
    done = without([module for module in EVERY if module not in brought], *example(name), cwd=folder)
    assert done.returncode == 0, done.stderr


# A command has one thread for linear algebra by its environment; Python's functions by threadpoolctl.
@pytest.mark.parametrize("module", [name for name in installation.EXTRAS["run"] if name != "threadpoolctl"])
def test_a_check_does_with_nothing_less(module: str, folder: Path) -> None:
    """Each package of `run` is asked for because a check imports it, not because the command says so."""
    done = python(
        WITHOUT.replace("sys.exit", "feedsim.foundation.installation.EXTRAS['run'] = ()\nsys.exit"),
        [module],
        *example("check"),
        cwd=folder,
    )
    assert done.returncode == 2
    assert f"of which {module} is not installed" in done.stderr


def test_a_shift_is_estimated_without_any(folder: Path) -> None:
    done = without(EVERY, "compare", "a.csv", "a.csv", "--shift", "estimate", "--max-shift", "1 s", cwd=folder)
    assert (done.returncode, done.stderr) == (0, "")
    assert "the shift in time is found from x" in done.stdout


def test_a_difference_is_explained_without_any(folder: Path) -> None:
    """What it looks like: late, in another unit, with fewer digits."""
    time = [0.001 * k for k in range(400)]

    def table(name: str, values: Callable[[float], float], form: str = ".17g") -> None:
        rows = [f"{t:.9g},{values(t):{form}}" for t in time]
        (folder / name).write_text("\n".join(["time [s],x [m]", *rows]) + "\n")

    def course(t: float) -> float:
        return 0.1 * math.sin(7 * t) + 0.02 * math.cos(19 * t)

    table("course.csv", course)
    table("late.csv", lambda t: course(t - 0.003))
    table("mm.csv", lambda t: 1000 * course(t))
    table("digits.csv", course, ".6f")
    for name, words in (
        ("late.csv", "later by 3 ms (3 rows): --shift '-3 ms'"),
        ("mm.csv", "factor 1000: in mm? (its header says m)"),
        ("digits.csv", "rounded to 1e-06 m: more digits, or --tol 'x=1e-06 m'"),
    ):
        done = without(EVERY, "compare", name, "course.csv", "--tol", "1e-9 m", cwd=folder)
        assert (done.returncode, done.stderr) == (1, "")
        assert f"  looks like: x: {words}" in done.stdout


def test_what_is_drawn_is_asked_for_ahead_of_a_run(folder: Path) -> None:
    done = without(["resvg_py"], *example("run"), "--figures", "png", cwd=folder)
    assert done.returncode == 2
    line = "feedsim run needs feedsim[run,figures], of which resvg_py is not installed: pip install"
    assert done.stderr == f'feedsim: {line} "feedsim[run,figures]"\n'
    assert not (folder / "results").exists()


@pytest.mark.parametrize("module", ["scipy", "distributed"])
def test_a_study_asks_for_all_at_once(module: str) -> None:
    told = installation.missing_package_error(ModuleNotFoundError("x", name=module), "feedsim.sweep")
    assert str(told).endswith(f'of which {module} is not installed: pip install "feedsim[sweep]"')
    run = str(installation.missing_package_error(ModuleNotFoundError("x", name="scipy"), "feedsim.frf"))
    assert run.endswith('pip install "feedsim[run]"')


def test_what_is_no_extra_is_an_error_of_its_own() -> None:
    assert installation.missing_package_error(ModuleNotFoundError("x", name="feedsim.unknown")) is None
    assert installation.missing_package_error(ImportError("cannot import name", name="scipy")) is None


def test_the_front_door_says_it_too(tmp_path: Path) -> None:
    scenario = ROOT / "scenarios" / "z_positioning.yaml"
    code = f"{BLOCK}import feedsim as fs\nfs.run({str(scenario)!r})\n"
    for module, what in (("fmpy", "feedsim.run"), ("ruckig", "planning a motion")):
        done = python(code, [module], cwd=tmp_path)
        line = f'{what} needs feedsim[run], of which {module} is not installed: pip install "feedsim[run]"\n'
        assert done.stderr.endswith(line)
    study = ROOT / "scenarios" / "studies" / "z_stop.yaml"
    done = python(f"{BLOCK}import feedsim as fs\nfs.sweep({str(study)!r}, 'study')\n", ["distributed"], cwd=tmp_path)
    assert 'of which distributed is not installed: pip install "feedsim[sweep]"' in done.stderr


def test_the_front_door_compares_without_them(folder: Path) -> None:
    code = f"{BLOCK}import feedsim as fs\nprint(fs.compare('a.csv', 'a.csv').verdict, fs.compare.__name__)\n"
    done = python(code, EVERY, cwd=folder)
    assert done.stdout == "same compare\n", done.stderr
