"""Inputs are never outputs, and what feedsim did not write stays, whatever the command and however a path is spelt."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from command_helpers import feedsim
from feedsim.foundation.errors import OutputError
from feedsim.foundation.outputs import allow_replacement, archive_with, begins_with, check_file, content_check

ROOT = Path(__file__).resolve().parents[1]


def spelt(path: Path) -> list[Path]:
    """The same file by other names."""
    (path.parent / "inner").mkdir()
    link, hard = path.with_name("link"), path.with_name("hard")
    link.symlink_to(path)
    os.link(path, hard)
    return [path, path.parent / "inner" / ".." / path.name, link, hard]


def test_an_input_is_refused_by_every_name_and_by_force(tmp_path: Path) -> None:
    file = tmp_path / "record.csv"
    file.write_text("a")
    for name in spelt(file):
        for force in (False, True):
            with allow_replacement(force), pytest.raises(OutputError, match="is an input and would be replaced"):
                check_file(name, [file], ours=lambda path: True)


def test_a_file_of_others_stays_unless_forced(tmp_path: Path) -> None:
    file = tmp_path / "page.html"
    file.write_text("mine")
    with pytest.raises(OutputError, match=r"is no report that feedsim wrote; .* --force"):
        check_file(file, what="report")
    with allow_replacement():
        check_file(file)
    check_file(file, ours=content_check(b"mine"))
    check_file(file, ours=begins_with(b"mi"))
    check_file(tmp_path / "new.html")
    with pytest.raises(OutputError, match="is a directory"):
        check_file(tmp_path)
    assert not archive_with("a", b"b")(file)


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """A folder with what comes along, and a result of a run."""
    shutil.copytree(ROOT / "scenarios", tmp_path / "s")
    (tmp_path / "table.csv").write_text("time [s],X.x_a [m]\n" + "".join(f"{k * 1e-3},{k * 1e-6}\n" for k in range(50)))
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "result.csv").write_text("of another program")
    (tmp_path / "mine" / "other.fmu").write_text("of another program")
    return tmp_path


CASES = [
    ("tools convert table.csv --out table.csv", "is an input"),
    ("tools convert table.csv --column time=time:s --out mine/result.csv", "--force"),
    ("export s/z_positioning.yaml --out s/z_positioning.yaml", "must end in .fmu, .ssp, .html"),
    ("export s/z_positioning.yaml --out s/machines/test_centre/modes.csv", "must end in .fmu, .ssp, .html"),
    ("export s/z_positioning.yaml --out table.csv", "must end in .fmu, .ssp, .html"),
    (
        "export --plant s/machines/test_centre --out s/machines/test_centre/machine.yaml",
        "must end in .fmu, .ssp, .html",
    ),
    (
        "export --plant s/machines/test_centre --out s/machines/test_centre/modes.csv --force",
        "must end in .fmu, .ssp, .html",
    ),
    ("export s/z_positioning.yaml --out mine/other.fmu", "--force"),
    ("machine build s/machines/one_axis --out s/machines/one_axis", "modes.csv: exists already"),
    ("export s/z_positioning.yaml --out mine/result.csv", "must end in .fmu, .ssp, .html"),
    ("run s/z_positioning.yaml --out mine", "mine/result.csv: exists already"),
    ("frf s/machines/one_axis --no-measure --out s/machines/one_axis", ""),
    ("compare table.csv table.csv --report table.csv", "is an input"),
    ("compare table.csv table.csv --report mine/result.csv", "--force"),
    ("compare table.csv table.csv --junit mine/result.csv", "--force"),
]


@pytest.mark.parametrize(("line", "words"), CASES, ids=lambda value: value if " " in value[:12] else None)
def test_commands_leave_files_of_others_alone(place: Path, fmus: Path, line: str, words: str) -> None:
    before = contents(place)
    done = feedsim(*line.split(), fmus=fmus, cwd=place)
    assert (done.returncode != 0) is bool(words), done.stderr
    assert words in done.stderr
    assert {name: data for name, data in contents(place).items() if name in before} == before


def test_a_result_of_another_kind_stays(place: Path, fmus: Path) -> None:
    """The same command may write again; another one not, unless it is forced."""
    run: Callable[..., int] = lambda line: feedsim(*line.split(), fmus=fmus, cwd=place).returncode  # noqa: E731
    assert run("run s/z_positioning.yaml --out r --quiet") == 0
    assert run("run s/z_positioning.yaml --out r --quiet") == 0
    assert run("frf s/machines/one_axis --no-measure --out r --quiet") == 4
    assert (place / "r" / "result.csv").is_file()
    assert run("compare r/result.csv r/result.csv --report r/report.html") == 2
    assert run("frf s/machines/one_axis --no-measure --out r --quiet --force") == 0
    assert not (place / "r" / "result.csv").exists()


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
