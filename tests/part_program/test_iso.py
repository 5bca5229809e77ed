"""The ISO dialect against another interpreter: what LinuxCNC's rs274 makes of the same programs (linuxcnc.json)."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from program_helpers import ends, read

from feedsim.foundation.errors import InputError
from feedsim.motions.part_program import Blending, Motion

ORACLE = json.loads((Path(__file__).parent / "linuxcnc.json").read_text(encoding="utf-8"))
DIGITS = 6e-5  # [mm]: it prints four decimals
INCH_DIGITS = 25.4 * DIGITS
# Centres of arcs whose radii differ by the rounding of the program (5 decimals): both move them, differently.
CENTRE = 2e-3
PLANES = {"XY": (0, 1, 2), "XZ": (2, 0, 1), "YZ": (1, 2, 0)}


@pytest.mark.parametrize("case", ORACLE["moves"], ids=lambda case: case["program"][:30].replace("\n", " "))
def test_movements_are_those_of_linuxcnc(case: dict[str, Any]) -> None:
    moves = read(case["program"], dialect="iso")
    digits = INCH_DIGITS if "G20" in case["program"] else DIGITS
    assert moves.motion.tolist() == [row[0] for row in case["moves"]]
    for i, (kind, *row) in enumerate(case["moves"]):
        if kind == Motion.DWELL:
            assert moves.dwell[i] == row[0]
            continue
        assert moves.end[i] * 1e3 == pytest.approx(row[:3], abs=digits)
        if kind != Motion.RAPID and "G93" not in case["program"]:
            assert moves.feed[i] * 60e3 == pytest.approx(row[3], abs=1e-3)
        if kind == Motion.ARC:
            first, second, normal = PLANES[row[4]]
            assert moves.centre[i, [first, second]] * 1e3 == pytest.approx(row[5:7], abs=CENTRE)
            assert math.copysign(1, moves.normal[i, normal]) == math.copysign(1, row[7])
            assert math.ceil(moves.angle[i] / (2 * math.pi) - 1e-9) == abs(row[7])


@pytest.mark.parametrize("case", ORACLE["faulty"], ids=lambda case: case["program"][:30].replace("\n", " "))
def test_what_linuxcnc_refuses_is_refused_in_its_line(case: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=rf"^main\.mpf:{case['line']}: "):
        read(case["program"], dialect="iso")


def test_inverse_time_feed_is_length_over_time() -> None:
    moves = read("G21 G90 G93\nG1 X10 F2\nG2 X30 I10 J0 F3\nM2\n", dialect="iso")
    assert moves.feed == pytest.approx([0.010 * 2 / 60, 0.010 * math.pi * 3 / 60], rel=1e-12)


def test_path_modes() -> None:
    moves = read("G0 X0\nG64 P0.01 G1 X1 F9\nG61 X2\nG64 X3\n", dialect="iso")
    assert moves.blending.tolist() == [
        Blending.CONTINUOUS, Blending.TOLERANCE, Blending.EXACT_STOP, Blending.CONTINUOUS,
    ]  # fmt: skip
    assert moves.tolerance[1] == pytest.approx(10e-6)
    assert np.isnan(moves.tolerance[[0, 2, 3]]).all()


def test_a_subprogram_in_a_file_of_its_own() -> None:
    assert ends("M98 P12 L2\nM30\n", dialect="iso", files={"O12": "G91 G0 X1\nM99\n"}) == [[1, 0, 0], [2, 0, 0]]


@pytest.mark.parametrize(
    ("block", "word"),
    [
        ("G28 X0", "G28"), ("G81 X1 Z-1 R1 F1", "G81"), ("G41 D1", "G41"), ("G92 X0", "G92"), ("G0 A90", "A"),
        ("#<name>=1", "#"), ("O100 SUB", "SUB"), ("M98 P7", "P7"), ("M99", "M99"), ("G0 X1 (a", "("), ("IF[1]", "IF"),
    ],
)  # fmt: skip
def test_refused_by_word(block: str, word: str) -> None:
    with pytest.raises(InputError) as error:
        read(f"G21\n{block}\n", dialect="iso")
    assert str(error.value).startswith(f"main.mpf:2: {word}: ")
