"""The Z move and the units alone, made once per session."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

from importers import loops, z_move
from importers.registry import IMPORTERS, Importer
from importers.system import Result, System


def _name(importer: Importer) -> str:
    return importer.label.replace("`", "").replace(" ", "-")


@pytest.fixture(scope="session", params=IMPORTERS, ids=_name)
def importer(request: pytest.FixtureRequest) -> Importer:
    """Every importer that is installed."""
    chosen: Importer = request.param
    if reason := chosen.missing():
        pytest.skip(reason)
    return chosen


@pytest.fixture(scope="session")
def move() -> z_move.Move:
    return z_move.load()


@pytest.fixture(scope="session")
def system(move: z_move.Move, fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> System:
    return z_move.hand_wired(move, fmus, tmp_path_factory.mktemp("z_move"))


@pytest.fixture(scope="session")
def parallel(move: z_move.Move, fmus: Path) -> Result:
    """The Z move by this project's own master, all units in parallel."""
    return z_move.as_result(z_move.own(move, "parallel", fmus), move)


@pytest.fixture(scope="session")
def imitation(move: z_move.Move, system: System) -> Callable[[loops.Master], Result]:
    """The Z move as a master algorithm steps it: of equal algorithms one run serves all tests."""
    return cache(lambda master: loops.run(system, move.experiment, master))
