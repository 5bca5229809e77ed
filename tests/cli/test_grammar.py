"""What a person types who does not know the command line yet: nothing, misspelt names, files of another kind."""

from __future__ import annotations

import contextlib
import io
import json
import os
import shutil
import subprocess
import sys
import traceback
from pathlib import Path

import numpy as np
import pytest

from command_helpers import feedsim, feedsim_process
from feedsim.cli.commands import COMMANDS, PaintedText, paint_text, shown_streams
from feedsim.cli.kinds import INPUT_KINDS, kind

ROOT = Path(__file__).resolve().parents[2]
CENTRE = ROOT / "scenarios" / "machines" / "test_centre"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("typed") / "scenarios"
    shutil.copytree(ROOT / "scenarios", place)
    (place / "results").mkdir()
    (place / "results" / "result.csv").write_text("time [s],x [mm]\n0,0\n")
    (place / "tuned").mkdir()
    (place / "tuned" / "summary.json").write_text('{"scenario": {}}')
    for name, of in (("drive", "tune-drive"), ("odd", "A; B"), ("modes", "identify-modes")):
        (place / name).mkdir()
        (place / name / "summary.json").write_text(f'{{"kind": "{of}", "files": []}}')
    (place / "drive" / "report.html").write_text("<html>")
    (place / "values.yaml").write_text("set:\n  machine.axes.Z.drive.K_v: 60 1/s\n")
    (place / "model.fmu").write_bytes(b"PK")
    return place


def test_alone_it_shows_what_a_person_may_want(fmus: Path, tmp_path: Path) -> None:
    done = feedsim_process(fmus=fmus, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    typed = [line.split() for line in done.stdout.splitlines() if line.startswith("  feedsim ")]
    names = {name.split()[0] for name in COMMANDS}
    assert {words[1] for words in typed} <= names
    wants = [line for line in done.stdout.splitlines()[1:] if line and not line.startswith((" ", "feedsim"))]
    assert len(wants) == 4


@pytest.mark.parametrize(
    ("typed", "said"),
    [
        ("rnu xz_circle.yaml", "no command 'rnu'; did you mean run?"),
        ("machine infoo machines/test_centre", "no command 'infoo'; did you mean info?"),
        ("tools schema scenaro", "no kind 'scenaro'; did you mean scenario?"),
        ("run xz_circle.yaml --ou x", "no option --ou; did you mean --out?"),
        ("run xz_circle.yaml --o=x", "no option --o; did you mean --out? feedsim run --help"),
        ("run xz_circle.yaml --quite", "no option --quite; did you mean --quiet?"),
        ("export xz_circle.yaml --ouut c.ssp", "no option --ouut; did you mean --out?"),
        ("run xz_circle.yaml z_positioning.yaml", "not understood: z_positioning.yaml"),
        ("run xz_circel.yaml", "no such file: xz_circel.yaml; did you mean xz_circle.yaml?"),
        ("frf machines/test_center", "no such file: machines/test_center; did you mean machines/test_centre?"),
        ("run nothing_of_the_kind", "no such file: nothing_of_the_kind"),
    ],
)
def test_nearest_names(typed: str, said: str, fmus: Path, folder: Path) -> None:
    done = feedsim(*typed.split(), fmus=fmus, cwd=folder)
    assert (done.returncode, done.stdout) == (2, "")
    assert said in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert not (folder / "x").exists()


@pytest.mark.parametrize(
    ("typed", "said"),
    [
        ("sweep xz_circle.yaml", "xz_circle.yaml is a scenario, which feedsim run takes; feedsim sweep takes a study"),
        ("run studies/z_stop.yaml", "studies/z_stop.yaml is a study, which feedsim sweep takes"),
        ("circle xz_circle.yaml", "xz_circle.yaml is a scenario, which feedsim run takes; feedsim circle takes a"),
        (
            "identify friction machines/test_centre",
            "machines/test_centre is the folder of a machine, which feedsim machine",
        ),
        ("run machines/test_centre/machine.yaml", "machine.yaml is a machine file, which feedsim machine info takes"),
        ("frf machines/test_centre/structure.yaml", "structure.yaml is a structure file, which"),
        ("run machines/test_centre/modes.csv", "modes.csv is a table of modes, which a machine file names; feedsim"),
        ("diff tuned", "tuned is a folder of results without a record (result.csv); feedsim diff takes results of"),
        ("frf tuned", "tuned is a folder of results without a record (result.csv); feedsim frf takes a scenario"),
        (
            "diff drive",
            "drive has results of feedsim tune drive, without a record (result.csv), its page is drive/report"
            ".html; feedsim diff takes results of a study",
        ),
        ("diff modes", "modes has results of feedsim identify modes, without a record (result.csv); feedsim diff"),
        ("diff odd", "odd is a folder of results without a record (result.csv); feedsim diff takes results of"),
        ("run values.yaml", "values.yaml is a file of values for the option --set; feedsim run takes a scenario"),
        (
            "tune feedforward results",
            "results is a folder of results, which feedsim diff takes; feedsim tune feedforward takes",
        ),
        ("run model.fmu", "model.fmu is a unit for simulators (FMU); feedsim run takes a scenario or an SSP file"),
        ("run recordings/z_setpoint.csv", "z_setpoint.csv is a record, which feedsim identify friction takes"),
    ],
)
def test_files_of_another_kind(typed: str, said: str, fmus: Path, folder: Path) -> None:
    done = feedsim(*typed.split(), fmus=fmus, cwd=folder)
    assert (done.returncode, done.stdout) == (2, "")
    assert said in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_every_shipped_file_is_of_the_kind_that_it_is() -> None:
    scenarios = ROOT / "scenarios"
    for path, name in [
        *((path, "a study") for path in (scenarios / "studies").glob("*.yaml")),
        *((path, "a scenario") for path in scenarios.glob("*.yaml")),
        *((path, "a machine file") for path in scenarios.glob("machines/*/machine.yaml")),
        *((path, "a structure file") for path in scenarios.glob("machines/*/structure.yaml")),
    ]:
        found = kind(path)
        assert found is not None, path
        assert found.name == name, path


def test_kinds_name_commands_that_there_are() -> None:
    for each in INPUT_KINDS:
        assert {command.partition(" --")[0] for command in each.commands} <= set(COMMANDS)  # of an option: its command


def test_a_circle_of_axes_that_rest_names_those_that_move(fmus: Path, tmp_path: Path) -> None:
    t = np.linspace(0, 4, 4001)
    table = np.column_stack([t, 50 * np.cos(np.pi * t), 0 * t + 20, 50 * np.sin(np.pi * t)])
    np.savetxt(tmp_path / "r.csv", table, "%.9g", ",", header="time [s],X.x_a [mm],Y.x_a [mm],Z.x_a [mm]", comments="")
    done = feedsim("circle", "r.csv", fmus=fmus, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr == "feedsim: r.csv: axis Y rests; X and Z move: --axes X,Z\n"
    assert feedsim("circle", "r.csv", "--axes", "X,Z", fmus=fmus, cwd=tmp_path).returncode == 0


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_colours_are_for_terminals_that_show_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm")
    assert paint_text("wrong", "red", Terminal()) == "\x1b[31mwrong\x1b[0m"
    assert paint_text("wrong", "red", io.StringIO()) == paint_text("wrong", "", Terminal()) == "wrong"
    monkeypatch.setenv("TERM", "dumb")
    assert paint_text("wrong", "red", Terminal()) == "wrong"
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("NO_COLOR", "1")
    assert paint_text("wrong", "red", Terminal()) == "wrong"


# What stands on the command line, the last word of it unfinished -> what is offered, and something that is not.
COMPLETED = [
    ("ru", "run", "frf"),
    ("machine ", "build", "run"),
    ("export a.yaml --po", "--poses", "--inputs"),
    ("run a.yaml --fo", "--force", "--runs"),
    ("tools schema st", "structure", "scenario"),
    ("example xz", "xz_circle", "one_axis"),
]


@pytest.mark.parametrize(("line", "there", "absent"), COMPLETED)
def test_completion(line: str, there: str, absent: str, tmp_path: Path) -> None:
    """What a shell is answered that asks as argcomplete's script does."""
    offered = tmp_path / "offered"
    asked = {"_ARGCOMPLETE": "1", "_ARGCOMPLETE_IFS": "\n", "COMP_LINE": f"feedsim {line}", "COMP_TYPE": "9",
             "COMP_POINT": str(len(f"feedsim {line}")), "_ARGCOMPLETE_STDOUT_FILENAME": str(offered)}  # fmt: skip
    command = [sys.executable, "-c", "from feedsim.cli import entry; entry()"]
    subprocess.run(command, env={**os.environ, **asked}, cwd=tmp_path, check=True)
    words = {word.strip() for word in offered.read_text().splitlines()}
    assert there in words
    assert absent not in words


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_script_of_a_shell_is_one(shell: str, fmus: Path, tmp_path: Path) -> None:
    if shutil.which(shell) is None:
        pytest.skip(f"no {shell} on this machine")
    done = feedsim("tools", "completion", shell, fmus=fmus, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    (tmp_path / "completion").write_text(done.stdout)
    subprocess.run([shell, "-n", tmp_path / "completion"], check=True)


HOSTILE = "a\x1b]0;pwned\x07\x1b[31mred\x9b2J\u202eb\rc"


def test_no_text_of_a_file_moves_the_terminal(fmus: Path, tmp_path: Path) -> None:
    """Of a scenario's name, of a file's name, in output and in errors."""
    (tmp_path / "esc.yaml").write_text(f"name: {json.dumps(HOSTILE)}\nmachine: {CENTRE}\n"
                                       "motions:\n  - {kind: dwell, duration: 0.05 s}\n")  # fmt: skip
    done = [
        feedsim("run", "esc.yaml", "--out", "o", fmus=fmus, cwd=tmp_path),
        feedsim("run", f"{HOSTILE}.yaml", fmus=fmus, cwd=tmp_path),
        feedsim("run", "esc.yaml", f"--{HOSTILE}", fmus=fmus, cwd=tmp_path),
    ]
    assert [each.returncode for each in done] == [0, 2, 2]
    for each in done:
        assert "\\x1b" in each.stdout + each.stderr
        assert not any(c in each.stdout + each.stderr for c in "\x1b\x07\x9b\u202e\r")


def test_a_traceback_and_colours_of_our_own() -> None:
    stream = Terminal()
    with contextlib.redirect_stderr(stream), shown_streams():
        try:
            raise ValueError(HOSTILE)
        except ValueError:
            traceback.print_exc()
        print(PaintedText("\x1b[31mwrong\x1b[0m"), file=sys.stderr)
    assert "\x1b]" not in stream.getvalue()
    assert "\\u202e" in stream.getvalue()
    assert "\x1b[31mwrong\x1b[0m" in stream.getvalue()
