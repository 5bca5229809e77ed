"""Whatever surrounds a command: no traceback, the right exit code, nothing half-written, nothing left behind."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from capture_helpers import axis_signals, content
from command_helpers import PATIENCE, feedsim
from ssp_helpers import short_scenario

ROOT = Path(__file__).resolve().parents[2]
pytestmark = pytest.mark.skipif(shutil.which("bash") is None, reason="needs bash")
COMMANDS = {
    "run": ["run", "Länge.yaml", "--out", "out", "--set", "name=Länge"],
    "validate": ["check", "Länge.yaml", "--set", "name=Länge"],
    "schema": ["tools", "schema", "study"],
    "ssp": ["export", "Länge.yaml", "--out", "out/x.ssp"],
    "pack": ["export", "Länge.yaml", "--out", "out/x.fmu"],
    "compare": ["compare", "a.csv", "a.csv", "--report", "out/a.html", "--junit", "out/a.xml"],
}


@dataclass(frozen=True)
class Row:
    """Surroundings: how the shell calls the command "$@", the environment, and exit codes other than 0.

    Runs take seconds: they are made where one can fail otherwise than the rest.
    """

    shell: str = '"$@"'
    environment: Mapping[str, str] = field(default_factory=dict)
    codes: Mapping[str, int] = field(default_factory=dict)
    without: str = ""  # a variable that is not set
    told: str = ""  # what messages of faults hold
    commands: str = "run schema compare"


# In a name space of its own a folder can be made tiny or read-only also for those who may write everywhere.
# What is in there in the end is written down, as nobody outside can see it.
APART = (
    "unshare -rm bash -c 'mount -t tmpfs -o {0} none {1} || exit 9; "
    '"$@"; code=$?; ls -A {1} >listed.txt; exit $code\' - "$@"'
)
ROWS = {
    "ascii": Row(environment={"PYTHONIOENCODING": "ascii"}, commands="run"),
    "C locale": Row(environment={"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}, commands="run compare"),
    "comma": Row(commands="run"),
    "stdout closed": Row('"$@" >&-', commands="schema compare"),
    "stderr closed": Row('"$@" 2>&-', commands="schema validate"),
    "all closed": Row('"$@" <&- >&- 2>&-', commands="run schema"),
    "broken pipe": Row('"$@" | true; exit ${PIPESTATUS[0]}', commands="schema compare"),
    "stdout full": Row('"$@" >/dev/full', codes={"run": 4, "schema": 4}, told="standard output"),
    "stderr full": Row('"$@" 2>/dev/full', commands="schema validate"),
    "tiny TMPDIR": Row(
        APART.format("size=300k", "temporary"), codes={"run": 4, "validate": 4}, commands="run validate",
        told="a temporary file cannot be written: No space left on device; TMPDIR",
    ),
    "file sizes": Row(
        'ulimit -f 8; "$@"', codes={"run": 4, "compare": 2}, told="cannot be written: File too large",
        commands="run compare",
    ),
    "full disk": Row(
        APART.format("size=160k", "out"), codes=dict.fromkeys(("run", "ssp", "pack"), 4),
        told="No space left on device", commands="run ssp pack",
    ),
    "read-only": Row(
        APART.format("ro", "out"), codes={"run": 4, "compare": 2}, told="cannot be written: Read-only file system",
        commands="run compare",
    ),
    "no HOME": Row(without="HOME", commands="run"),
}  # fmt: skip


@pytest.fixture(scope="module")
def comma(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Environment of a locale whose decimal mark is a comma, made and installed for the test."""
    folder, name = tmp_path_factory.mktemp("locales"), "de_DE.UTF-8"
    words = ["localedef", "-c", "-i", "de_DE", "-f", "UTF-8", str(folder / name)]
    with contextlib.suppress(OSError):
        subprocess.run(words, capture_output=True, check=False)
    environment = {"LOCPATH": str(folder), "LC_ALL": name}
    text = "import locale; locale.setlocale(locale.LC_ALL, ''); print(locale.localeconv()['decimal_point'])"
    done = subprocess.run(
        [sys.executable, "-c", text], capture_output=True, text=True, check=False, env={**os.environ, **environment}
    )
    if done.stdout.strip() != ",":
        pytest.skip("no locale with a decimal comma can be made here: localedef or its sources are missing")
    return environment


def whole_or_nothing(out: Path) -> None:
    """Of a run all files of its summary, or the rows so far at most; nothing that is hidden."""
    found = {path.name for path in out.iterdir()} if out.is_dir() else set()
    assert not [name for name in found if name.startswith(".")]
    if "summary.json" in found:
        files = json.loads((out / "summary.json").read_text(encoding="utf-8"))["files"]
        assert all((out / name).is_file() for name in files)
        found -= {"figures", *files}
    assert found <= {"result.partial.csv"}


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("place")
    short_scenario(folder).rename(folder / "Länge.yaml")
    (folder / "a.csv").write_text("time [s],x [m]\n0,1\n1,2\n")
    return folder


@pytest.mark.extensive
@pytest.mark.parametrize(("name", "command"), [(name, each) for name in ROWS for each in ROWS[name].commands.split()])
def test_surroundings(name: str, command: str, place: Path, fmus: Path, request: pytest.FixtureRequest) -> None:
    row, environment = ROWS[name], {**os.environ, **ROWS[name].environment}
    if name == "comma":
        environment |= request.getfixturevalue("comma")
    if "unshare" in row.shell:
        trial = ["bash", "-c", APART.format("size=300k", "/mnt"), "-", "true"]
        tried = subprocess.run(trial, capture_output=True, cwd=place)
        if tried.returncode:
            pytest.skip("no name spaces of its own here")
    environment.pop(row.without, None)
    out, temporary = place / "out", place / "temporary"
    for folder in (out, temporary):
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
    environment |= {"FEEDSIM_FMUS": str(fmus), "PYTHONPATH": str(ROOT / "master"), "TMPDIR": str(temporary)}
    words = [sys.executable, "-c", "from feedsim.cli import entry; entry()", *COMMANDS[command]]
    # Standard error goes into a file, so that a row may do with it what it likes.
    done = subprocess.run(
        ["bash", "-c", f"{{ {row.shell}; }} 2>>told.txt", "-", *words], cwd=place, env=environment,
        stdout=subprocess.PIPE, encoding="utf-8", errors="replace", timeout=PATIENCE, check=False,
    )  # fmt: skip
    told = (place / "told.txt").read_text(encoding="utf-8", errors="replace")
    (place / "told.txt").unlink()
    assert "Traceback" not in told
    assert done.returncode == row.codes.get(command, 0), told
    assert command not in row.codes or row.told in told
    assert list(temporary.iterdir()) == []
    if "unshare" in row.shell:
        assert set((place / "listed.txt").read_text().split()) <= {"result.partial.csv"}
        (place / "listed.txt").unlink()
    if command in ("ssp", "pack"):
        assert not list(out.iterdir())
    elif command == "compare":
        assert {path.name for path in out.iterdir()} == (set() if command in row.codes else {"a.html", "a.xml"})
    else:
        whole_or_nothing(out)
        written = command == "run" and (row.codes.get("run", 0) == 0 or name == "stdout full")
        assert (out / "summary.json").exists() == written


@pytest.mark.parametrize(
    ("setting", "told"),
    [
        ("machine=/dev/zero", "/dev/zero is a device, not a file"),
        ("machine=pipe", "pipe is a pipe, not a file"),
        ("machine=long.yaml", "long.yaml has 300 MB; a file of this kind may have 4 MB at most"),
        ("machine.modes=pipe", "no such file: pipe (it is a pipe or a device)"),
        ("machine.modes=/dev/zero", "no such file: /dev/zero (it is a pipe or a device)"),
    ],
)
def test_what_is_no_file_of_people_is_not_read(setting: str, told: str, tmp_path: Path, fmus: Path) -> None:
    short_scenario(tmp_path)
    os.mkfifo(tmp_path / "pipe")
    with (tmp_path / "long.yaml").open("wb") as file:
        file.write(b"name: ")
        file.truncate(300_000_000)
    done = subprocess.run(
        [sys.executable, "-m", "feedsim", "validate", "short.yaml", "--set", setting], cwd=tmp_path, timeout=PATIENCE,
        env={**os.environ, "FEEDSIM_FMUS": str(fmus), "PYTHONPATH": str(ROOT / "master")}, capture_output=True,
        text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert told in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("words", [["compare", "pipe", "pipe"], ["identify", "pipe"], ["identify", "/dev/zero"]])
def test_a_trace_that_is_none_keeps_nobody_waiting(words: list[str], tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    done = subprocess.run(
        [sys.executable, "-m", "feedsim", *words], cwd=tmp_path, timeout=PATIENCE, capture_output=True, check=False,
        env={**os.environ, "PYTHONPATH": str(ROOT / "master")},
    )  # fmt: skip
    assert done.returncode == 2


def test_control_characters_of_a_file_do_not_reach_the_terminal(tmp_path: Path) -> None:
    """A name in a capture that would colour the screen, or move the cursor."""
    data = content({"X1|1": axis_signals(10.0, 1)})
    for signal in data["Header"]["SignalListHFData"][1:]:
        signal["Axis"] = "X1\x1b[31m\x07"
    (tmp_path / "capture.json").write_text(json.dumps(data))
    done = feedsim("identify", "friction", "capture.json", "--axes", "Q", fmus=tmp_path, cwd=tmp_path)
    assert done.returncode == 2
    assert "there is X1\\x1b[31m\\x07" in done.stderr
    assert "\x1b" not in done.stderr
