"""The machine as one unit in every importer, at any step: what `feedsim run` gives, to the last bit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from importers import whole
from importers.registry import SINGLE, Importer

pytestmark = pytest.mark.extensive

# At the control cycle, and at steps that meet its instants now and then. All steps, and random ones, in FMPy:
# tests/cosim/test_one_unit.py.
CASES = [("z_positioning", 125e-6), ("z_positioning", 7.3e-3), ("xz_circle", 1e-3), ("xz_circle", 7.3e-3)]
# Of those that step one unit: the steps that one takes first.
PLAIN = [("z_positioning", 125e-6), ("xz_circle", 1e-3), ("xz_circle", 10e-3), ("z_positioning", 10e-3)]
SLOW = {"Maestro": CASES[1:3]}  # a start of Java for each


@pytest.fixture(scope="session")
def motions(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, whole.Whole]:
    return {name: whole.load(name, fmus, tmp_path_factory.mktemp("whole")) for name in whole.MOTIONS}


@pytest.mark.parametrize("case", CASES, ids=str)
def test_every_importer_gets_the_run(
    motions: dict[str, whole.Whole], importer: Importer, case: tuple[str, float], fmus: Path, tmp_path: Path
) -> None:
    if case not in SLOW.get(importer.name, CASES):
        pytest.skip(f"{importer.name} starts slowly: with other motions and steps")
    motion, step = motions[case[0]], case[1]
    do = motion.experiment(step)
    system = motion.connected(fmus) if importer.name == "Maestro" else motion.system
    result = importer.run(system, do, tmp_path)
    worst, compared = whole.difference(result, motion, step)
    assert worst == 0.0
    assert compared >= len(motion.common(step, do.steps)[0]) - 1  # not each tells of the first or the last


@pytest.mark.parametrize("single", SINGLE, ids=lambda single: single.name)
@pytest.mark.parametrize("case", PLAIN, ids=str)
def test_importers_of_one_unit_get_the_run(
    motions: dict[str, whole.Whole], single: Importer, case: tuple[str, float], tmp_path: Path
) -> None:
    if reason := single.missing():
        pytest.skip(reason)
    motion, step = motions[case[0]], case[1]
    do = motion.experiment(step)
    worst, compared = whole.difference(single.run(motion.system, do, tmp_path), motion, step)
    assert worst == 0.0
    assert compared == len(motion.common(step, do.steps)[0])


def test_another_step_or_motion_would_be_seen(motions: dict[str, whole.Whole], tmp_path: Path) -> None:
    """A control cycle late is not the same."""
    motion = motions["z_positioning"]
    do = motion.experiment(125e-6)
    late = {key: np.concatenate([[np.nan], motion.trace[key[1]][: do.steps]]) for key in do.record}
    assert whole.difference(late, motion, do.step)[0] > 1e-5
