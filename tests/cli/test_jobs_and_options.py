"""Every command follows from the signature of its job: its options, its help, its words in Python."""

from __future__ import annotations

import inspect
import re
import shlex
from pathlib import Path

import pytest

import feedsim as fs
from feedsim.cli import main, parser
from feedsim.cli.commands import COMMANDS, COMMON, GROUPS, OLD_COMMANDS, Command, commands, rename_words
from feedsim.jobs.parameters import read_annotation

OF_THE_TERMINAL = ("docs", "tools completion")  # what Python has no function for


@pytest.mark.parametrize("command", commands(), ids=lambda command: command.name)
def test_python_and_the_command_line_have_the_same_words(command: Command) -> None:
    """The signature as Python reads it is the declaration that the command line read from the source."""
    if command.name not in OF_THE_TERMINAL:
        assert command.job().__name__ in fs.__all__
    signature = inspect.signature(inspect.unwrap(command.job())).parameters.values()
    options = {entry.name: read_annotation(str(entry.annotation))[1] for entry in signature}
    assert {p.name: p.option for p in command.options} == {k: v for k, v in options.items() if v is not None}
    assert not {p.name for p in command.options} & set(COMMON)
    documented = inspect.getdoc(command.job()) or ""
    assert all(f"\n    {parameter.name}: " in documented for parameter in command.options)


def test_there_are_few_commands_and_options() -> None:
    assert len({name.split()[0] for name in COMMANDS}) <= 16
    typed = {p.typed for command in commands() for p in command.options if p.typed}
    assert len(typed) + len(COMMON) <= 120
    assert set(GROUPS) == {name.split()[0] for name in COMMANDS if " " in name}


@pytest.mark.parametrize("command", commands(), ids=lambda command: command.name)
def test_help_says_in_a_few_words_what_a_command_does(command: Command) -> None:
    assert len(command.declared.help) <= 60
    examples = command.declared.examples.replace("\\\n", "").replace(" && ", "\n").splitlines()
    for line in examples:
        if line.startswith("feedsim "):
            words, notes = rename_words(shlex.split(line)[1:])
            assert notes == [], "an example has an old name"
            parser(words[0]).parse_args(words)


@pytest.mark.parametrize("old", OLD_COMMANDS)
def test_old_names_are_commands_of_today(old: str) -> None:
    words, (note,) = rename_words([*old.split(), "a.yaml"])
    assert words == [*OLD_COMMANDS[old].split(), "a.yaml"]
    assert note == f"feedsim {old} is called feedsim {OLD_COMMANDS[old]} now; the old name goes with the next version"
    assert any(" ".join(words).startswith(name) for name in COMMANDS)


def test_identify_alone_is_of_friction() -> None:
    words, notes = rename_words(["identify", "log.csv", "--axis=Z"])
    assert words == ["identify", "friction", "log.csv", "--axes=Z"]
    assert len(notes) == 2
    assert rename_words(["identify", "drive", "x.csv"]) == (["identify", "drive", "x.csv"], [])
    assert rename_words(["identify", "--help"]) == (["identify", "--help"], [])


@pytest.mark.parametrize(
    ("old", "today"),
    [
        ("sweep a.yaml --dry-run", "check a.yaml --trial"),
        ("sweep a.yaml --row=3 --set x=1", "check a.yaml --row=3 --set x=1"),
        ("-q sweep a.yaml --out x --row 3", "-q check a.yaml --row 3"),
        ("sweep -o x --workers 2 --scheduler=tcp://h:1 --format csv --restart a.yaml --dry-run -v",
         "check a.yaml --trial -v"),
        ("sweep a.yaml --out x", "sweep a.yaml --out x"),
    ],
)  # fmt: skip
def test_dry_runs_of_studies_are_checks_without_the_options_that_these_lack(old: str, today: str) -> None:
    words, notes = rename_words(old.split())
    assert words == today.split()
    assert len(notes) == (old != today)


@pytest.mark.parametrize("typed", ["--json verdict.json", "--json=verdict.json"])
def test_the_file_of_a_comparison_is_refused_with_what_to_type(typed: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main(["compare", "a", "b", *typed.split()])
    assert end.value.code == 2
    assert "--json > verdict.json" in capsys.readouterr().err
    assert rename_words(["compare", "a", "b", "--json"]) == (["compare", "a", "b", "--json"], [])


def test_defaults_in_the_help_name_the_arguments_in_capitals() -> None:
    option = next(p.option for c in commands() if c.name == "circle" for p in c.options if p.name == "out")
    assert option is not None
    assert option.help.endswith("results/circle_RECORDS)")


@pytest.mark.parametrize("old", ["identify", "validate", "show", "compensate", "pack", "machine_show"])
def test_old_functions_say_how_they_are_called(old: str, tmp_path: Path) -> None:
    with pytest.warns(DeprecationWarning, match=rf"feedsim\.{old} is called feedsim\.\w+ now"), pytest.raises(
        (fs.InputError, TypeError), match=r"no such file|missing"
    ):  # fmt: skip
        getattr(fs, old)(str(tmp_path / "nothing.yaml"))


def test_a_missing_file_is_named_before_a_library_is_loaded(capsys: pytest.CaptureFixture[str]) -> None:
    from feedsim.cli import main

    assert main(["circle", "scenarios/xz_circel.yaml"]) == 2
    assert re.match(r"feedsim: no such file: scenarios/xz_circel\.yaml", capsys.readouterr().err)
