"""Heidenhain's conversational language against positions computed by hand. All in mm."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from program_helpers import read

from feedsim.foundation.errors import InputError
from feedsim.motions.part_program import Blending, Moves, conversational


def heidenhain(blocks: str, unit: str = "MM") -> Moves:
    """Of a program with numbered blocks; before them the feed is 600, and the tool along Z."""
    lines = [f"BEGIN PGM TEST {unit}", "TOOL CALL 1 Z S3000 F600", *blocks.splitlines(), f"END PGM TEST {unit}"]
    return read("".join(f"{number} {line}\n" for number, line in enumerate(lines)), dialect="heidenhain")


POINTS = {
    "lines": ("L X+10 Y-5 R0 FMAX M3\nL IX+1 IY-1 F300\nL Z+3", [(10, -5, 0), (11, -6, 0), (11, -6, 3)]),
    "arc about a centre": ("CC X+5 Y+0\nC X+10 Y+0 DR-\nCC IX+5 IY+0\nC X+15 Y+5 DR-", [(10, 0, 0), (15, 5, 0)]),
    "polar line": ("CC X+10 Y+10\nLP PR+5 PA+90\nLP IPA-90\nLP IPR+1", [(10, 15, 0), (15, 10, 0), (16, 10, 0)]),
    "polar arc": ("CC X+0 Y+0\nL X+5\nCP PA+90 DR+\nCP IPA+90 IZ-2 DR+", [(5, 0, 0), (0, 5, 0), (-5, 0, -2)]),
    "tangent arcs": ("L X+10\nCT X+15 Y+5\nCC X+15 Y+0\nCTP PR+15 PA+90", [(10, 0, 0), (15, 5, 0), (15, 15, 0)]),
    "rounding": ("L X+10\nRND R2 F60\nL Y+10", [(8, 0, 0), (10, 2, 0), (10, 10, 0)]),
    "chamfer": ("L X+10\nCHF 2\nL Y+10", [(8, 0, 0), (10, 2, 0), (10, 10, 0)]),
    "subprogram": ("CALL LBL 1\nL X+5\nCALL LBL 1\nM30\nLBL 1\nL IY+1\nLBL 0", [(0, 1, 0), (5, 1, 0), (5, 2, 0)]),
    "repetition": ("LBL 2\nL IX+1\nCALL LBL 2 REP 2/2\nL Y+1", [(1, 0, 0), (2, 0, 0), (3, 0, 0), (3, 1, 0)]),
    "named label": ('CALL LBL "A"\nL X+5\nM2\nLBL "A"\nL Y+1\nLBL 0', [(0, 1, 0), (5, 1, 0)]),
    "Q parameters": ("Q1 = 2 + 3 * 4\nFN 0: Q2 = +5\nFN 2: Q3 = +Q1 - +Q2\nFN 4: Q4 = +Q3 DIV +2\nL X+Q1 Y-Q2\nL IX-Q4",
                     [(14, -5, 0), (9.5, -5, 0)]),
    "jump": ("LBL 1\nQ1 = Q1 + 1\nL X+Q1\nFN 12: IF +Q1 LT +3 GOTO LBL 1", [(1, 0, 0), (2, 0, 0), (3, 0, 0)]),
    "comments": ("* - heading\n; nothing\nL X+1 ; X+9\nSTOP M6", [(1, 0, 0)]),
}  # fmt: skip


@pytest.mark.parametrize("name", POINTS)
def test_positions(name: str) -> None:
    program, expected = POINTS[name]
    assert heidenhain(program).end * 1e3 == pytest.approx(np.array(expected, dtype=float), abs=1e-9)


@pytest.mark.parametrize(
    ("block", "centre", "sense", "angle"),
    [
        ("CC X+5 Y+0\nC X+10 Y+0 DR-", (5, 0), -1, 180),
        ("CC X+5 Y+0\nC X+0 Y+0 DR+", (5, 0), 1, 360),
        ("CR X+10 Y+10 R+10 DR+", (0, 10), 1, 90),
        ("CR X+10 Y+10 R-10 DR+", (10, 0), 1, 270),
        ("CC X+5 Y+0\nCP IPA-720 IZ-4 DR-", (5, 0), -1, 720),
    ],
)
def test_arcs(block: str, centre: tuple[float, ...], sense: int, angle: float) -> None:
    moves = heidenhain(block)
    assert moves.centre[0, :2] * 1e3 == pytest.approx(centre, abs=1e-9)
    assert moves.normal[0] == pytest.approx([0, 0, sense])
    assert math.degrees(moves.angle[0]) == pytest.approx(angle)


def test_plane_of_the_tool() -> None:
    moves = read("BEGIN PGM A MM\nTOOL CALL 1 Y F60\nCC Z+5 X+0\nC Z+10 X+0 DR+\n", dialect="heidenhain")
    assert moves.normal[0] == pytest.approx([0, 1, 0])


def test_feeds_and_tolerance() -> None:
    moves = heidenhain(
        "L X+1\nL X+2 F300\nL X+3 FMAX\nL X+4\nCYCL DEF 32.0 TOLERANCE\nCYCL DEF 32.1 T0.02\nL X+5 F AUTO"
    )
    assert moves.feed * 6e4 == pytest.approx([600, 300, math.nan, 300, 600], nan_ok=True)
    assert moves.blending.tolist() == [Blending.CONTINUOUS] * 4 + [Blending.TOLERANCE]
    assert moves.tolerance[-1] == pytest.approx(20e-6)


def test_inches() -> None:
    """F of an inch program is in 0.1 inch/min."""
    moves = heidenhain("L X+1 F100", "INCH")
    assert moves.end[0, 0] == pytest.approx(0.0254)
    assert moves.feed[0] == pytest.approx(10 * 0.0254 / 60)


@pytest.mark.parametrize(
    ("block", "word", "reason"),
    [
        ("L X+1 RL", "R", "radius compensation"),
        ("L X+1 X+2", "X", "twice"),
        ("L A+1", "A", "rotary"),
        ("L X+1 F0", "F", "above 0"),
        ("L X", "X", "not understood"),
        ("L X+", "X", "value is missing"),
        ("C X+10 Y+0 DR-", "C", "CC is missing"),
        ("CC X+5 Y+0\nC X+10 Y+0", "C", "DR"),
        ("CC X+3 Y+0\nC X+10 Y+0 DR+", "C", "radius 3 mm at the start and 7 mm at the end"),
        ("CC X+3", "CC", "both coordinates"),
        ("CR X+10 R+2 DR+", "CR", "below half the chord"),
        ("CP PA+90 DR+", "CP", "no pole"),
        ("CC X+5 Y+0\nCP IPA-90 DR+", "IPA", "do not agree"),
        ("CT X+1", "CT", "no movement"),
        ("RND R2\nL X+1", "RND", "no way in the plane"),
        ("L X+1\nRND R2", "RND", "no movement follows"),
        ("APPR LT X+1", "APPR", "approach"),
        ("CYCL DEF 200", "CYCL", "cycles"),
        ("L X+1 M128", "M128", "not supported"),
        ("CALL LBL 5", "LBL 5", "no such label"),
        ("CALL PGM OTHER", "OTHER", "not found"),
        ("LBL 1\nCALL LBL 1\nLBL 0", "CALL", "levels"),
        ("LBL 1\nFN 9: IF +0 EQU +0 GOTO LBL 1", "LBL", "endless"),
        ("FN 4: Q1 = +1 DIV +0", "/", "division by zero"),
        ("FN 5: Q1 = SQRT -4", "SQRT", "0 or more"),
        ("LBL 1\nLBL 1\nCALL LBL 1", "LBL 1", "line 3 too"),
        ("WHAT", "WHAT", "not understood"),
    ],
)  # fmt: skip
def test_refused_by_word(block: str, word: str, reason: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(conversational, "MAX_REPEATED", 2000)
    with pytest.raises(InputError) as error:
        heidenhain(block)
    assert f": {word}: " in str(error.value), error.value
    assert reason in str(error.value)
