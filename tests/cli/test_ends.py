"""A request to end that comes at any instant ends a command, and leaves nothing behind (`make ends`: a thousand)."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest
from ends import COMMANDS, Place

pytestmark = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="signals of POSIX, and /proc")
TRIALS = {"run": 10, "identify": 6, "sweep": 4, "tune drive": 4, "tune compensation": 2}


@pytest.fixture(scope="module")
def place(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Place:
    return Place(tmp_path_factory.mktemp("place"), fmus, seed=os.getpid())


@pytest.mark.extensive
@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_ends_at_any_instant(command: str, place: Place) -> None:
    for _ in range(TRIALS[command]):
        place.trial(command)


@pytest.mark.parametrize("name", ["SIGINT", "SIGHUP"])
def test_by_other_signals_too(name: str, place: Place) -> None:
    for _ in range(2):
        place.trial("run", getattr(signal, name))
