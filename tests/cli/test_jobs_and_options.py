"""A command and the function of Python that it calls take the same words."""

from __future__ import annotations

import inspect
from collections.abc import Iterator

import pytest

import feedsim as fs
from feedsim.cli import COMMANDS
from feedsim.cli.options import WRITES, Command, flat

OF_THE_TERMINAL = {"quiet"}  # what only a terminal needs: no progress bar and no summary
OF_PYTHON = {"watch"}


def commands_with_jobs(commands: tuple[Command, ...] = COMMANDS) -> Iterator[Command]:
    for command in commands:
        if command.job:
            yield command
        yield from commands_with_jobs(tuple(command.commands))


@pytest.mark.parametrize("command", list(commands_with_jobs()), ids=lambda command: command.job)
def test_options_and_parameters_are_the_same(command: Command) -> None:
    job = fs
    for name in command.job.split("."):
        job = getattr(job, name)
    typed = {option.typed.removeprefix("--").replace("-", "_") for option in flat(command.options)}
    if any(option.typed in WRITES for option in flat(command.options)):
        typed.add("force")
    parameters = inspect.signature(job).parameters
    assert typed - OF_THE_TERMINAL == set(parameters) - OF_PYTHON
    assert all(each.kind is not each.VAR_KEYWORD for each in parameters.values()), "every word is a parameter"
