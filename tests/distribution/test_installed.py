"""The wheel, made from the source archive, in an empty environment, used from a folder that knows no checkout."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

from feedsim.foundation.installation import library_name
from feedsim_distribution import backend

pytestmark = pytest.mark.extensive

LOOP, PLANNER = library_name("exchange"), library_name("planner")
ROOT = Path(__file__).resolve().parents[2]
PIP = (sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet", "--no-input")


@pytest.fixture(scope="module")
def sdist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sdist")
    return folder / backend.build_sdist(str(folder))


@pytest.fixture(scope="module")
def wheel(sdist: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Made by pip from the source archive, unpacked where there is no git."""
    folder = tmp_path_factory.mktemp("wheel")
    wanted = ["wheel", "--no-index", "--no-build-isolation", "--no-deps", "-w", str(folder), str(sdist)]
    subprocess.run([*PIP, *wanted], check=True, cwd=folder)
    (made,) = folder.glob("*.whl")
    return made


class Installation:
    """An environment that has the wheel and, borrowed, the packages that it needs; a folder to work in."""

    def __init__(self, wheel: Path, folder: Path) -> None:
        self.home, self.folder = folder / "environment", folder / "work"
        self.folder.mkdir()
        subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(self.home)], check=True)
        self.python = self.home / ("Scripts" if os.name == "nt" else "bin") / Path(sys.executable).name
        into = ["--python", str(self.python), "install", "--no-index", "--no-deps", str(wheel)]
        subprocess.run([*PIP, *into], check=True)
        (packages,) = {path.parents[1] for path in self.home.rglob("feedsim/__init__.py")}
        # A .pth file in a folder that a .pth file names counts for nothing: the checkout's own is not followed.
        borrowed = [path for path in sys.path if path.endswith("site-packages")]
        (packages / "borrowed.pth").write_text("\n".join(borrowed))
        kept = ("PYTHONPATH", "FEEDSIM_FMUS", "CC")
        self.environment = {name: value for name, value in os.environ.items() if name not in kept}

    def run(self, *command: str) -> str:
        done = subprocess.run(
            [str(self.python), "-m", "feedsim", *command],
            cwd=self.folder, env=self.environment, capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        return done.stdout + done.stderr


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Installation:
    return Installation(wheel, tmp_path_factory.mktemp("installed"))


def test_wheel_of_the_checkout_is_that_of_the_source_archive(wheel: Path, tmp_path: Path) -> None:
    assert backend.build_wheel(str(tmp_path)) == wheel.name
    assert (tmp_path / wheel.name).read_bytes() == wheel.read_bytes()


def test_source_archive_is_the_same_again(sdist: Path, tmp_path: Path) -> None:
    backend.build_sdist(str(tmp_path))
    assert (tmp_path / sdist.name).read_bytes() == sdist.read_bytes()


def test_source_archive_has_sources_and_no_tests(sdist: Path) -> None:
    with tarfile.open(sdist) as opened:
        names = {name.partition("/")[2] for name in opened.getnames()}
    assert {"src/fmi2/functions.c", "src/exchange/exchange.c", "scenarios/xz_circle.yaml", "PKG-INFO"} <= names
    assert not [name for name in names if Path(name).name.startswith("test_") and name.startswith("tests/reference/")]
    assert not [name for name in names if "__pycache__" in name or name.endswith((".so", ".fmu"))]


def test_wheel_holds_what_runs_need_and_no_path_of_this_machine(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as opened:
        names = opened.namelist()
        held = {Path(name).name for name in names if name.startswith("feedsim/shipped/fmus/")}
        held.discard("machine.wasm")  # where a compiler for WebAssembly is
        units = ("plant", "controller", "friction", "friction_gms", "setpoint", "machine")
        assert held == {*(f"{unit}.fmu" for unit in units), LOOP, PLANNER}
        assert "feedsim/shipped/scenarios/machines/test_centre/modes.csv" in names
        assert "feedsim/foundation/variables.json" in names
        for name in names:
            content = opened.read(name)
            assert str(ROOT).encode() not in content, name
            assert b"/tmp/" not in content or name.endswith((".py", ".md", "METADATA")), name


def test_runs_natively_with_the_results_of_the_checkout(installed: Installation, tmp_path: Path) -> None:
    installed.run("example", "xz_circle")
    said = installed.run("run", "xz_circle.yaml", "--out", "circle")
    assert "in Python" not in said
    summary = json.loads((installed.folder / "circle" / "summary.json").read_text())
    assert summary["performance"]["cycle_loop"] == "native"
    here = tmp_path / "here"
    command = ["run", str(ROOT / "scenarios" / "xz_circle.yaml"), "--out", str(here)]
    subprocess.run([sys.executable, "-m", "feedsim", *command], check=True, capture_output=True)
    assert (here / "result.csv").read_bytes() == (installed.folder / "circle" / "result.csv").read_bytes()


def test_every_way_of_use(installed: Installation) -> None:
    """The other commands that need units, machine or packager, on copies of what comes along."""
    run, folder = installed.run, installed.folder
    run("example", "z_positioning", "z_stop", "identify_z_constant", "test_centre")
    run("export", "z_positioning.yaml", "--out", "z.ssp")
    run("run", "z.ssp", "--out", "from_ssp")
    run("export", "--plant", "machines/test_centre", "--out", "my_plant.fmu")
    run("check", "z_positioning.yaml")
    fewer = ("--set=motions.2.speeds.count=5", "--set=motions.1.duration=1 s", "--set=motions.2.duration=1 s")
    run("run", "identify_z_constant.yaml", *fewer, "--out", "constant")
    run(
        "identify",
        "friction",
        "constant/log.csv",
        "--axes",
        "Z",
        "--machine",
        "machines/test_centre",
        "--out",
        "friction",
    )
    run("sweep", "studies/z_stop.yaml", "--runs", "2", "--workers", "1", "--out", "study")
    run("frf", "machines/test_centre", "--axes", "Z", "--no-tool", "--out", "response")
    run("compare", "from_ssp/result.csv", "from_ssp/result.csv")
    said = json.loads((folder / "from_ssp" / "summary.json").read_text())["performance"]["cycle_loop"]
    assert said == "native"


@pytest.mark.parametrize(
    ("content", "reason"),
    [(None, f"{LOOP}: no such file beside the archives"), (b"\x7fELF, cut off", f"{LOOP}: cannot be used: ")],
    ids=["absent, as on other platforms", "damaged"],
)
def test_without_the_native_loop_a_run_says_so_and_gives_the_same(
    installed: Installation, content: bytes | None, reason: str
) -> None:
    (loop,) = installed.home.rglob(LOOP)
    kept, name = loop.read_bytes(), "absent" if content is None else "damaged"
    short = ("run", "z_positioning.yaml", "--set=motions=[{kind: dwell, duration: 20 ms}]", "--set=evaluate=[]")
    installed.run("example", "z_positioning")
    installed.run(*short, "--out", "native")
    loop.unlink()
    try:
        if content is not None:
            loop.write_bytes(content)
        said = installed.run(*short, "--out", name)
    finally:
        loop.unlink(missing_ok=True)
        loop.write_bytes(kept)
        loop.chmod(0o755)
    summary = json.loads((installed.folder / name / "summary.json").read_text())
    notes = [each["text"] for each in summary["findings"] if each["code"] == "native-loop-missing"]
    assert summary["performance"]["cycle_loop"] == "Python"
    for told in (said, " ".join(notes)):
        assert "the cycle loop ran in Python, some 30 times slower than the native one, same bits: " + reason in told
        assert "installing feedsim anew brings the native loop along" in told
    results = [(installed.folder / each / "result.csv").read_bytes() for each in (name, "native")]
    assert results[0] == results[1]


def test_programs_around_it_are_checked_by_its_types(installed: Installation, tmp_path: Path) -> None:
    """By mypy, which looks into the environment as it does into a user's, and knows no checkout."""
    code = tmp_path / "use.py"
    code.write_text(
        "import feedsim as fs\n"
        'result = fs.run("xz_circle.yaml", set={"motions.0.radius": "20 mm"})\n'
        "reveal_type(result)\nreveal_type(fs.compare(result, result).value.same)\nreveal_type(fs.load('a.yaml'))\n"
        "fs.run(3)\n"
    )
    command = [sys.executable, "-m", "mypy", "--strict", "--config-file=", "--python-executable", str(installed.python)]
    environment = {name: value for name, value in installed.environment.items() if name != "MYPYPATH"}
    done = subprocess.run(
        [*command, str(code)], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    revealed = [line.partition('"')[2].rstrip('"') for line in done.stdout.splitlines() if "Revealed type" in line]
    expected = ["feedsim.jobs.result.Result[feedsim.jobs.run.EvaluatedRun]", "bool", "feedsim.scenario.model.Scenario"]
    assert [each.removeprefix("builtins.") for each in revealed] == expected, done.stdout + done.stderr
    errors = [line for line in done.stdout.splitlines() if ": error: " in line]
    assert len(errors) == 1
    assert 'has incompatible type "int"' in errors[0]


@pytest.mark.parametrize(
    "command",
    [["build", "plant"], ["exchange", "--out", "."], ["planner", "--out", "."], ["variables", "--out", "v.json"]],
)
def test_what_needs_c_sources_says_so(command: list[str], installed: Installation) -> None:
    done = subprocess.run(
        [str(installed.python), "-m", "feedsim_packager", *command],
        cwd=installed.folder, env=installed.environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    line = "which an installed feedsim does not have; a checkout or the source archive has them"
    assert done.stderr.startswith(f"error: {command[0]} is of C sources, {line}")
    assert not (installed.folder / "v.json").exists()


def test_results_say_nothing_of_where_it_is_installed(installed: Installation) -> None:
    places = [str(path).encode() for path in (installed.home, ROOT)]
    results = [path for path in installed.folder.rglob("*") if path.is_file()]
    assert len(results) > 20
    told = [path for path in results if any(place in path.read_bytes() for place in places)]
    assert not told


def test_nothing_is_written_into_the_installation(wheel: Path, installed: Installation) -> None:
    with zipfile.ZipFile(wheel) as opened:
        names = {name for name in opened.namelist() if name.startswith("feedsim/shipped/")}
    (package,) = (path.parent for path in installed.home.rglob("feedsim/__init__.py"))
    there = {path.relative_to(package.parent).as_posix() for path in (package / "shipped").rglob("*") if path.is_file()}
    assert there == names
