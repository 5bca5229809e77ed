"""Moves of a real control, of which axis limits as round numbers and the start on the grid are known.

Y runs 460 mm at 400 mm/s, 1.2 m/s^2, 20 m/s^3; X 62 mm at 1.5 m/s^2, 20 m/s^3. A corner of continuous-path mode is a
parabola with legs of 0.25 mm.
"""

from __future__ import annotations

import json
import os
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from feedsim.motions.part_program import Blending
from feedsim.motions.planner import plan_moves
from path_helpers import Draft, limits_of

pytestmark = pytest.mark.skipif("FEEDSIM_CAPTURE" not in os.environ, reason="FEEDSIM_CAPTURE names no capture")

Floats = NDArray[np.float64]
CYCLE = 2e-3


@cache
def setpoints() -> dict[int, Floats]:
    """Number of an axis -> its DES_POS [m]."""
    capture = json.loads(Path(os.environ["FEEDSIM_CAPTURE"]).read_text())
    names = [signal["Address"] for signal in capture["Header"]["SignalListHFData"]]
    rows = np.array([row for part in capture["Payload"] if "HFData" in part for row in part["HFData"]], dtype=float)
    return {axis: rows[:, names.index(f"DES_POS|{axis}")] * 1e-3 for axis in (1, 2, 6)}


@pytest.mark.parametrize(
    ("axis", "limits", "begin", "end", "start", "within"),
    [(2, (0.4, 1.2, 20), 330, 1130, 347, 2e-6), (1, (1, 1.5, 20), 1410, 1700, 1423, 10e-6)],
    ids=["Y 460 mm", "X 62 mm"],
)
def test_rapids(axis: int, limits: tuple[float, float, float], begin: int, end: int, start: int, within: float) -> None:
    recorded = setpoints()[axis]
    draft = Draft(("X",), np.array([recorded[begin]]))
    draft.rapid(float(recorded[end]))
    planned = plan_moves(draft.moves, limits_of("X", *limits, T_ipo=CYCLE))
    rows = np.arange(begin, end)
    off = planned.sample((rows - start) * CYCLE).position[:, 0] - recorded[rows]
    assert np.abs(off).max() <= within
    last = rows[np.abs(recorded[rows] - recorded[end]) > 1e-9][-1] + 1
    assert planned.duration == pytest.approx((last - start) * CYCLE, abs=2e-3)


def test_corner() -> None:
    recorded = np.stack([setpoints()[axis] for axis in (1, 2, 6)], axis=1)
    # The vertex is where the line that it comes on meets the plane in which Y then stays.
    first, second, end = recorded[0], recorded[155], recorded[300]
    vertex = first + (second - first) * (end[1] - first[1]) / (second[1] - first[1])
    draft = Draft(("X", "Y", "Z"), first, 0.35 / 60, Blending.DISTANCE, 0.25e-3)
    draft.line(*vertex)
    draft.line(*end)
    planned = plan_moves(draft.moves, limits_of("XYZ", 0.4, [1.5, 1.2, 0.9], [20, 20, 30], step_time=4e-3))
    x = planned.sample(np.arange(0, planned.duration, 1e-4)).position
    a, d = x[:-1], np.diff(x, axis=0)
    at = recorded[161:204]
    along = np.clip(np.einsum("kni,ni->kn", at[:, None] - a, d) / np.maximum((d**2).sum(axis=1), 1e-30), 0, 1)
    off = np.linalg.norm(at[:, None] - a - along[..., None] * d, axis=2).min(axis=1)
    # The first row inside lies 2.5 nm beside, 2.2 nm beside any parabola through the others.
    assert np.delete(off, 1).max() <= 2e-9
    assert off[1] <= 3e-9
    # and at the same speed
    middle = planned.derivatives([planned.end_time[0]]).acceleration[0]
    assert middle == pytest.approx(np.diff(recorded[178:186], 2, axis=0).mean(axis=0) / CYCLE**2, abs=5e-4)
