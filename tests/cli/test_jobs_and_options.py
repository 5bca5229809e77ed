"""A command and the function of Python that it calls take the same words."""

from __future__ import annotations

import inspect
from collections.abc import Iterator

import pytest

import feedsim as fs
from feedsim.cli import COMMANDS
from feedsim.cli.options import WRITES, Command, flat

# What only a terminal needs: no progress bar and no summary, a text in place of the runs, a second run beside it.
OF_THE_TERMINAL = {"quiet", "dry_run", "row", "try", "all"}
IN_PYTHON = {"--from": "start", "--to": "end"}  # of a time: "from" is a keyword
OF_PYTHON = {"watch", "named"}  # who is told, and results under names of their own


def commands_with_jobs(commands: tuple[Command, ...] = COMMANDS) -> Iterator[Command]:
    for command in commands:
        if command.job:
            yield command
        yield from commands_with_jobs(tuple(command.commands))


def leaves(commands: tuple[Command, ...] = COMMANDS) -> Iterator[Command]:
    for command in commands:
        yield from leaves(tuple(command.commands)) if command.commands else [command]


def test_every_command_has_a_function() -> None:
    """But for what belongs to a terminal alone: the documentation on its screen, completion of its words."""
    assert {command.name for command in leaves() if not command.job} == {"docs", "completion"}


@pytest.mark.parametrize("command", list(commands_with_jobs()), ids=lambda command: command.job)
def test_options_and_parameters_are_the_same(command: Command) -> None:
    job = fs
    for name in command.job.split("."):
        job = getattr(job, name)
    in_python = IN_PYTHON if any(option.typed == "--from" for option in flat(command.options)) else {}
    typed = {
        in_python.get(option.typed, option.typed).removeprefix("--").replace("-", "_")
        for option in flat(command.options)
        if not (option.typed == "--json" and "metavar" not in option.words)  # prints what Python has at hand
    }
    if any(option.typed in WRITES for option in flat(command.options)):
        typed.add("force")
    parameters = inspect.signature(job).parameters
    assert typed - OF_THE_TERMINAL == set(parameters) - OF_PYTHON
    assert all(each.kind is not each.VAR_KEYWORD for name, each in parameters.items() if name not in OF_PYTHON)
