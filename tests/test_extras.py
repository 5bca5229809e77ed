"""Packages that only some commands need: a comparison does without, other commands say what to install."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from feedsim import extras

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
# Runs the command line with packages missing, those that argv[1] names.
WITHOUT = """
import sys
class Missing:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in sys.argv[1].split(","):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Missing())
import feedsim.cli
sys.exit(feedsim.cli.main(sys.argv[2:]))
"""


def without(packages: str, *command: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", WITHOUT, packages, *command], cwd=cwd, capture_output=True, text=True, check=False
    )


def test_every_module_is_brought_by_its_extra() -> None:
    brought = {"dask": "distributed"}  # by which package, where the name is another one
    for module, extra in extras.EXTRAS.items():
        names = [re.split(r"[\[>=]", each)[0] for each in PROJECT["optional-dependencies"][extra]]
        assert brought.get(module, module) in names


def test_all_brings_what_runs_studies_and_universal_files_need() -> None:
    assert PROJECT["optional-dependencies"]["all"] == ["feedsim[run,sweep,uff]"]
    assert {"fmpy", "scipy", "ruckig", "matplotlib", "distributed", "pyuff"} <= set(extras.packages("all"))


def test_a_comparison_needs_none_of_them(tmp_path: Path) -> None:
    for name, last in (("a.csv", "2.0"), ("b.csv", "2.5")):
        (tmp_path / name).write_text(f"time [s],x [m]\n0,1.0\n1,{last}\n")
    every = ",".join(extras.EXTRAS)
    same = without(every, "compare", "a.csv", "a.csv", cwd=tmp_path)
    assert (same.returncode, same.stderr) == (0, "")
    different = without(every, "compare", "a.csv", "b.csv", "--junit", "j.xml", cwd=tmp_path)
    assert different.returncode == 1, different.stderr
    assert "<failure" in (tmp_path / "j.xml").read_text()


@pytest.mark.parametrize("missing", ["ruckig", "fmpy", "scipy", "ruckig,fmpy,scipy,matplotlib,jinja2"])
def test_a_run_says_what_installs_what_it_lacks(missing: str, tmp_path: Path) -> None:
    done = without(missing, "run", str(ROOT / "scenarios" / "z_positioning.yaml"), cwd=tmp_path)
    assert done.returncode == 2
    line = (
        r"feedsim: feedsim run needs the package \w+, which is not installed: pip install fmpy scipy ruckig matplotlib"
    )
    assert re.match(line, done.stderr), done.stderr
    assert "Traceback" not in done.stderr
    assert not list(tmp_path.rglob("*.csv")), "nothing is half-written"


@pytest.mark.parametrize("module", ["scipy", "distributed"])
@pytest.mark.parametrize("what", ["feedsim sweep", "feedsim.sweep"])
def test_a_study_asks_for_all_at_once(module: str, what: str) -> None:
    told = extras.missing(ModuleNotFoundError("x", name=module), what)
    asked = str(told).partition("pip install ")[2].split()
    extra = PROJECT["optional-dependencies"]["run"] + PROJECT["optional-dependencies"]["sweep"][1:]
    assert asked == [re.split(r"[\[>=]", each)[0] for each in extra]
    run = str(extras.missing(ModuleNotFoundError("x", name="scipy"), "feedsim run"))
    assert "distributed" not in run
    assert "distributed" not in str(extras.missing(ModuleNotFoundError("x", name="pyarrow"), what))


def test_the_command_of_studies_asks_for_all_at_once(tmp_path: Path) -> None:
    done = without("scipy,distributed", "sweep", str(ROOT / "scenarios" / "studies" / "z_stop.yaml"), cwd=tmp_path)
    assert done.returncode == 2
    assert re.search(
        r"^feedsim: feedsim sweep needs the package \w+, .* pip install fmpy .* distributed$", done.stderr, re.M
    )


def test_what_is_no_extra_is_an_error_of_its_own() -> None:
    assert extras.missing(ModuleNotFoundError("x", name="feedsim.unknown")) is None
    assert extras.missing(ImportError("cannot import name", name="scipy")) is None


def test_the_front_door_says_it_too(tmp_path: Path) -> None:
    code = WITHOUT.replace(
        "import feedsim.cli\nsys.exit(feedsim.cli.main(sys.argv[2:]))", "import feedsim as fs\nfs.run"
    )
    done = subprocess.run([sys.executable, "-c", code, "ruckig"], capture_output=True, text=True, check=False)
    assert "MissingPackage: feedsim.run needs the package ruckig, which is not installed: pip install" in done.stderr
