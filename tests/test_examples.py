"""Copies of what comes along: with all that a file names, never over what is there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from feedsim import cli, scenario
from feedsim.cli.commands import commands
from feedsim.foundation.errors import InputError, OutputError
from feedsim.jobs import examples
from feedsim.scenario.study import load_study

ROOT = Path(__file__).resolve().parents[1]
SCENARIOS = ROOT / "scenarios"
# The setpoints of EMPS are of a record that is not part of the product.
LOADABLE = sorted({each.name for each in examples.examples() if each.kind in ("scenario", "study")} - {"emps"})


def test_all_that_the_folder_has_is_there() -> None:
    found = {(each.kind, each.name) for each in examples.examples()}
    assert {("scenario", "xz_circle"), ("study", "z_stop"), ("machine", "emps"), ("structure", "calculix")} <= found
    assert {file.stem for file in SCENARIOS.glob("*.yaml")} == {name for kind, name in found if kind == "scenario"}
    assert all(each.about.endswith((".", "?")) for each in examples.examples())


@pytest.mark.parametrize("name", LOADABLE)
def test_a_copy_can_be_read_by_itself(name: str, tmp_path: Path) -> None:
    examples.copy([name], tmp_path)
    files = [file for file in tmp_path.rglob(f"{name}.yaml")]
    if name == "one_axis":  # a scenario, and a machine of that name
        assert (tmp_path / "machines" / "one_axis" / "structure.yaml").is_file()
    (file,) = files
    if file.parent.name == "studies":
        study = load_study(file)
        read = [study.scenario, *study.files]
    else:
        loaded = scenario.load(file)
        read = [path for _, path in loaded.files] + [loaded.machine.modes.file]
    assert all(path.resolve().is_relative_to(tmp_path.resolve()) for path in read)


def test_copies_are_the_files(tmp_path: Path) -> None:
    written = examples.copy(["matrix_market", "z_measured.yaml"], tmp_path)
    assert tmp_path / "recordings" / "z_setpoint.csv" in written
    for path in written:
        assert path.read_bytes() == (SCENARIOS / path.relative_to(tmp_path)).read_bytes()
    assert examples.copy(["z_measured"], tmp_path) == [], "the same are left alone"


def test_nothing_is_overwritten_and_nothing_half_copied(tmp_path: Path) -> None:
    mine = tmp_path / "machines" / "test_centre" / "machine.yaml"
    mine.parent.mkdir(parents=True)
    mine.write_text("mine")
    with pytest.raises(OutputError, match=r"machine\.yaml: there already, with another content"):
        examples.copy(["xz_circle"], tmp_path)
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == [mine]
    assert mine.read_text() == "mine"


def test_what_cannot_be_written_leaves_nothing(tmp_path: Path) -> None:
    (tmp_path / "machines").write_text("a file where a folder is needed")
    with pytest.raises(OutputError, match="cannot be written"):
        examples.copy(["xz_circle", "z_stop"], tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["machines"]


def test_unknown_name_is_told_with_those_that_there_are(tmp_path: Path) -> None:
    with pytest.raises(
        InputError, match=r"xz_cirle: no such example, did you mean xz_circle\? \(there are: a_study, airfoil, ball"
    ):
        examples.copy(["xz_cirle"], tmp_path)


def test_command(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert cli.main(["example"]) == 0
    assert "xz_circle" in capsys.readouterr().out
    assert cli.main(["example", "xz_circle", "--to", "there"]) == 0
    assert str(Path("there") / "xz_circle.yaml") in capsys.readouterr().out.splitlines()
    assert cli.main(["example", "xz_circle", "--to", "there"]) == 0
    assert capsys.readouterr().out == "all there already\n"
    (tmp_path / "there" / "xz_circle.yaml").write_text("")
    assert cli.main(["example", "xz_circle", "--to", "there"]) == 4


def test_without_a_name_all_are_copied_to_where_the_documents_have_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where a document names a file that its command writes or that is written by hand, such as a recording."""
    monkeypatch.chdir(tmp_path)
    assert cli.main(["example", "--to", "scenarios"]) == 0
    documents = [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]
    named = {name for each in documents for name in re.findall(r"scenarios/[\w./]*\w", each.read_text("utf-8"))}
    shipped = {name for name in named if (ROOT / name).exists()}
    assert {"scenarios/xz_circle.yaml", "scenarios/machines/test_centre"} < shipped
    assert not {name for name in shipped if not Path(name).exists()}


def test_the_list_has_one_column_of_texts(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["example"]) == 0
    printed = capsys.readouterr().out
    rows = [next(row for row in printed.splitlines() if each.about in row) for each in examples.examples()]
    assert len({row.index(each.about) for row, each in zip(rows, examples.examples(), strict=True)}) == 1


def test_what_a_help_names_can_be_copied_as_it_says(tmp_path: Path) -> None:
    """Who has installed a wheel has no folder scenarios/: the examples of a help begin with what brings their files."""
    seen = set()
    for number, told in enumerate([command.declared.examples for command in commands()]):
        folder = tmp_path / str(number)
        for names in re.findall(r"feedsim example ((?:\w+ ?)+)", told):
            examples.copy(names.split(), folder)
        words = {word for word in re.findall(r"[\w./]+", told) if "/" in word or word.endswith(".yaml")}
        named = {word for word in words if (SCENARIOS / word).exists()}
        assert "scenarios/" not in told
        assert {word for word in named if not (folder / word).exists()} == set(), told
        seen |= named
    assert {"xz_circle.yaml", "machines/test_centre", "studies/z_stop.yaml"} <= seen
