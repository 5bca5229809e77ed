"""Words of SINUMERIK against positions computed by hand from the programming manual's rules. All in mm."""

from __future__ import annotations

import math
import random
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

sys.path.insert(0, str(Path(__file__).parent))
from program_helpers import ends, read

from feedsim.foundation.errors import InputError
from feedsim.motions.part_program import Blending, Motion
from feedsim.motions.part_program.movements import Movements

HALF = 0.5
ROOT3 = math.sqrt(3) / 2
ROOT2 = math.sqrt(2)


# Program after "G0 X0 Y0 Z0 F600" -> ends of its rows.
POINTS = {
    "modal words": ("G1 X1\nY2\nG0 Z3", [(1, 0, 0), (1, 2, 0), (1, 2, 3)]),
    "no spaces, signs, points": ("N5G1X+1.Y-.5\nN6X0Y+.25", [(1, -0.5, 0), (0, 0.25, 0)]),
    "exponent": ("G1 X=1.5EX1 Y1EX-1", [(15, 0.1, 0)]),
    "comments": ("G1 X1 ; X9\nX2 (X9) Y1\n;\n(all)\nMSG(\"a;b\")\nX3", [(1, 0, 0), (2, 1, 0), (3, 1, 0)]),
    "lower case": ("g1 x1 y2\nr1=3 x=r1", [(1, 2, 0), (3, 2, 0)]),
    "AC, IC": ("G91 G1 X1\nX=AC(5) Y1\nG90 X=IC(-2) Y3", [(1, 0, 0), (5, 1, 0), (3, 3, 0)]),
    "G70, G71": ("G70 G1 X1\nG71 X2", [(25.4, 0, 0), (2, 0, 0)]),
    "I in inches": ("G70 G2 X2 I1 J0", [(50.8, 0, 0)]),
    "TRANS replaces, ATRANS adds": (
        "TRANS X10 Y1\nG1 X1\nATRANS X5\nX1\nTRANS Y2\nX1 Y1\nTRANS\nX0 Y0",
        [(11, 0, 0), (16, 0, 0), (1, 3, 0), (0, 0, 0)],
    ),
    "an axis that is not programmed stays": ("TRANS X10 Y10\nG1 X0\nY0", [(10, 0, 0), (10, 10, 0)]),
    "ROT RPL about the normal": ("ROT RPL=30\nG1 X10", [(10 * ROOT3, 5, 0)]),
    "ROT RPL in G18 turns Z to X": ("G18\nROT RPL=90\nG1 Z10 X0", [(10, 0, 0)]),
    "ROT RPL in G19 turns Y to Z": ("G19\nROT RPL=90\nG1 Y10 Z0", [(0, 0, 10)]),
    "ROT Z Y X in this order": ("ROT X90 Z90\nG1 X1 Y2 Z3", [(3, 1, 2)]),
    "AROT turns the frame that is there": ("TRANS X10\nAROT RPL=90\nG1 X5 Y0", [(10, 5, 0)]),
    "TRANS after ROT is not turned": ("ROT RPL=90\nTRANS X10\nG1 X5 Y0", [(15, 0, 0)]),
    "ATRANS after ROT is turned": ("ROT RPL=90\nATRANS X10\nG1 X5 Y0", [(0, 15, 0)]),
    "ATRANS after SCALE is scaled": ("SCALE X2 Y2\nATRANS X10\nG1 X5 Y1", [(30, 2, 0)]),
    "MIRROR": ("MIRROR X0\nG1 X5 Y1\nMIRROR\nX5", [(-5, 1, 0), (5, 1, 0)]),
    "AMIRROR within a shift": ("TRANS X10\nAMIRROR X0\nG1 X5", [(5, 0, 0)]),
    "an incremental word traverses a new shift": ("TRANS X10\nG91 G1 X1\nX1\nY1", [(11, 0, 0), (12, 0, 0), (12, 1, 0)]),
    "an incremental word after ROT": ("G1 X10\nROT RPL=90\nG91 X5", [(10, 0, 0), (10, 5, 0)]),
    "G53, SUPA": ("TRANS X10\nG1 X0\nG53 X3\nX1\nSUPA X4", [(10, 0, 0), (3, 0, 0), (11, 0, 0), (4, 0, 0)]),
    "polar": ("G111 X10 Y10\nG1 RP=4 AP=90\nAP=180\nRP=5", [(10, 14, 0), (6, 10, 0), (5, 10, 0)]),
    "polar increments": ("G1 RP=4 AP=30\nAP=IC(60)", [(4 * ROOT3, 2, 0), (0, 4, 0)]),
    "poles": (
        "G1 X10\nG110 X1 Y2\nRP=3 AP=0\nG112 X10\nRP=3 AP=0\nG111 RP=5 AP=90\nRP=1 AP=0",
        [(10, 0, 0), (14, 2, 0), (24, 2, 0), (1, 5, 0)],
    ),
    "a pole is absolute under G91 too": ("G91 G111 X5 Y5\nG90 G1 RP=1 AP=0", [(6, 5, 0)]),
    "polar in G18": ("G18\nG1 RP=2 AP=90", [(2, 0, 0)]),
    "polar arc about the pole": ("G1 X5\nG3 RP=5 AP=90\nG2 AP=0", [(5, 0, 0), (0, 5, 0), (5, 0, 0)]),
    "ANG and a coordinate": ("G1 X10 ANG=30\nY0 ANG=-90", [(10, 10 * math.tan(math.pi / 6), 0), (10, 0 + 1e-30, 0)]),
    "ANG of two lines": ("G1 ANG=45\nX10 Y0 ANG=-45", [(5, 5, 0), (10, 0, 0)]),
    "opening angle and centre": ("G1 X5\nG3 I-5 J0 AR=90", [(5, 0, 0), (0, 5, 0)]),
    "CIP": ("CIP X10 Y0 Z0 I1=5 J1=0 K1=5", [(10, 0, 0)]),
    "CT after an arc": ("G2 X10 Y10 I10 J0\nCT X20 Y20", [(10, 10, 0), (20, 20, 0)]),
    "CT straight on": ("G1 X5\nCT X9", [(5, 0, 0), (9, 0, 0)]),
    "/ is executed": ("/G1 X5\n/3 N10 X6", [(5, 0, 0), (6, 0, 0)]),
    "variables": (
        "DEF REAL A=1.5,B[2]\nDEF INT C=2.5\nDEF BOOL ON1=TRUE\nB[1]=A*2\nG1 X=B[1] Y=C Z=ON1*1",
        [(3, 3, 1)],
    ),
    "R parameters": ("R1=2 R[R1]=7 R3=R1/R2\nG1 X=R2 Y=R[2]-R1 Z=R99", [(7, 5, 0)]),
    "for includes both ends": ("FOR R1=1 TO 3\nG1 X=R1\nENDFOR\nY=R1", [(1, 0, 0), (2, 0, 0), (3, 0, 0), (3, 4, 0)]),
    "for that does not begin": ("FOR R1=3 TO 1\nG1 X9\nENDFOR\nG1 X1", [(1, 0, 0)]),
    "loop and goto": ("LOOP\nR1=R1+1\nIF R1==3 GOTOF OUT\nENDLOOP\nOUT: G1 X=R1", [(3, 0, 0)]),
    "nested if": ("IF R1==0\nIF R1>0\nG1 X9\nELSE\nG1 X1\nENDIF\nELSE\nG1 X8\nENDIF", [(1, 0, 0)]),
    "goto a block number": ("GOTOF N30\nG1 X9\nN030 G1 X1\nIF R1>0 GOTOF E\nR1=1\nGOTO N30\nE:", [(1, 0, 0)] * 2),
    "goto: forwards first": ("G1 X1\nA1:\nGOTO A1\nG1 X9\nA1:\nG1 X2", [(1, 0, 0), (2, 0, 0)]),
    "gotob: the nearest one": ("A1: R1=R1+1\nA1: R1=R1+1\nIF R1<5 GOTOB A1\nG1 X=R1", [(5, 0, 0)]),
    "gotoc without a target": ("GOTOC NOWHERE\nG1 X1", [(1, 0, 0)]),
    "case": ("R1=4\nCASE(R1) OF 3 GOTOF A3 4 GOTOF A4 DEFAULT GOTOF A5\nA3: G1 X3\nA4: G1 X4\nA5: G1 Y5",
             [(4, 0, 0), (4, 5, 0)]),
    "repeat of a section": ("AA: G91 G1 X1\nY1\nREPEAT AA P=2\nX5",
                            [(1, 0, 0), (1, 1, 0), (2, 1, 0), (2, 2, 0), (3, 2, 0), (3, 3, 0), (8, 3, 0)]),
    "repeat between labels": ("G91\nBEG: G1 X1\nFIN: Y1\nX1\nREPEAT BEG FIN",
                              [(1, 0, 0), (1, 1, 0), (2, 1, 0), (3, 1, 0), (3, 2, 0)]),
    "repeat to ENDLABEL": ("G91\nBEG: G1 X1\nENDLABEL: Y1\nX1\nREPEAT BEG", [(1, 0, 0), (1, 1, 0), (2, 1, 0), (3, 1, 0),
                                                                           (3, 2, 0)]),
    "repeat of a block": ("G91\nBB: G1 X1\nY1\nREPEATB BB P=2", [(1, 0, 0), (1, 1, 0), (2, 1, 0), (3, 1, 0)]),
    "repeat until": ("REPEAT\nR1=R1+1\nUNTIL R1>=3\nG1 X=R1", [(3, 0, 0)]),
    "M30 ends": ("G1 X1 M30\nX2", [(1, 0, 0)]),
}  # fmt: skip


@pytest.mark.parametrize("name", POINTS)
def test_positions(name: str) -> None:
    program, expected = POINTS[name]
    found = ends(f"G0 X0 Y0 Z0 F600\n{program}\n")[1:]
    assert np.array(found) == pytest.approx(np.array(expected, dtype=float), abs=1e-9)


# Expression -> value.
VALUES = {
    "1+2*3": 7, "(1+2)*3": 9, "-2+1": -1, "2*-3": -6, "7/2": 3.5, "7 DIV 2": 3, "-7 DIV 2": -3, "7 MOD 3": 1,
    "3 MOD 4": 3,
    "10-4-3": 3, "8/4/2": 1, "SIN(30)": 0.5, "COS(60)": 0.5, "TAN(45)": 1, "ASIN(0.5)": 30, "ACOS(0.5)": 60,
    "ATAN2(30.5,80.1)": 20.8455, "ATAN2(1,-1)": 135, "SQRT(2)": ROOT2, "POT(-3)": 9, "ABS(-2.5)": 2.5,
    "TRUNC(-2.7)": -2,
    "ROUND(2.5)": 3, "ROUND(-2.5)": -3, "ROUNDUP(2.1)": 3, "EXP(1)": math.e, "LN(EXP(2))": 2, "MINVAL(3,2)": 2,
    "MAXVAL(3,2)": 3, "BOUND(0,5,9)": 5, "'H1F'": 31, "'B101'": 5, "12 B_AND 10": 8, "12 B_OR 10": 14, "12 B_XOR 10": 6,
    "(1==1)*3": 3, "(1<>1)*3": 0, "(2>1)*1": 1, "(2<=1)*1": 0, "((1<2) AND (2<3))*1": 1, "(1<2 AND 3<2)*1": 0,
    "((1<2) OR (3<2))*1": 1, "((1<2) XOR (2<3))*1": 0, "(NOT (1<2))*1": 0, "(0.1*3==0.3)*1": 1, "(0.1*3>0.3)*1": 0,
    "TRUE*2": 2, "$PI": math.pi, "COS(90)": 0, "SIN(180)": 0, "1EX2+1": 101,
}  # fmt: skip


@pytest.mark.parametrize("expression", VALUES)
def test_expressions(expression: str) -> None:
    found = ends(f"R1={expression}\nG0 X=R1\n")[0][0]
    assert found == pytest.approx(VALUES[expression], abs=5e-5 if "80.1" in expression else 1e-9)


@pytest.mark.parametrize("seed", range(20))
def test_chains_of_frames_are_products_of_matrices(seed: int) -> None:
    """Homogeneous matrices, with rotations by scipy: intrinsic, about Z, then Y, then X."""
    dice = np.random.default_rng(seed)
    matrix, blocks = np.eye(4), ["F600"]
    expected = []
    for _ in range(8):
        kind, a = dice.choice(["TRANS", "ROT", "SCALE", "MIRROR"]), np.round(dice.uniform(-50, 50, 3), 2)
        added = np.eye(4)
        if kind == "TRANS":
            added[:3, 3] = a
        elif kind == "ROT":
            added[:3, :3] = Rotation.from_euler("ZYX", a[::-1], degrees=True).as_matrix()
        elif kind == "SCALE":
            a = np.abs(a) / 40 + 0.5
            added[:3, :3] = np.diag(a)
        else:
            added[0, 0], a = -1, a[:1]
        additive = bool(dice.random() < 0.8)
        matrix = matrix @ added if additive else added
        words = " ".join(f"{axis}={float(value)!r}" for axis, value in zip("XYZ", a, strict=False))
        point = np.round(dice.uniform(-20, 20, 3), 3)
        blocks += [f"{'A' * additive}{kind} {words}", f"G1 X{point[0]} Y{point[1]} Z{point[2]}"]
        expected.append((matrix @ [*point, 1])[:3])
    assert read("\n".join(blocks)).end * 1e3 == pytest.approx(np.array(expected), rel=1e-12, abs=1e-9)


@pytest.mark.parametrize(
    ("program", "centre", "normal", "angle"),
    [
        ("G2 X10 Y0 I5 J0", (5, 0, 0), (0, 0, -1), 180),
        ("G3 X10 Y0 I5 J0", (5, 0, 0), (0, 0, 1), 180),
        ("G91 G2 X10 Y0 I5 J0", (5, 0, 0), (0, 0, -1), 180),
        ("G2 X10 Y10 I=AC(10) J=AC(0)", (10, 0, 0), (0, 0, -1), 90),
        ("G3 X10 Y10 CR=10", (0, 10, 0), (0, 0, 1), 90),
        ("G3 X10 Y10 CR=-10", (10, 0, 0), (0, 0, 1), 270),
        ("G2 I5", (5, 0, 0), (0, 0, -1), 360),
        ("G2 I5 Z-3 TURN=2", (5, 0, 0), (0, 0, -1), 1080),
        ("G2 X10 Y0 I5 J0 TURN=1", (5, 0, 0), (0, 0, -1), 540),
        ("G18 G2 X10 Z10 I0 K10", (0, 0, 10), (0, -1, 0), 90),
        ("G18 G3 X10 Z10 I0 K10", (0, 0, 10), (0, 1, 0), 270),
        ("G19 G3 Y10 Z10 J0 K10", (0, 0, 10), (1, 0, 0), 90),
        ("G3 X10 Y10 AR=90", (0, 10, 0), (0, 0, 1), 90),
        ("G2 X10 Y10 AR=270", (0, 10, 0), (0, 0, -1), 270),
        ("MIRROR X0\nG2 X-10 Y0 I-5 J0", (5, 0, 0), (0, 0, 1), 180),
        ("SCALE X2 Y2\nG2 X10 Y0 I5 J0", (10, 0, 0), (0, 0, -1), 180),
        ("ROT X90\nG3 X10 Y10 CR=10", (0, 0, 10), (0, -1, 0), 90),
        ("TRANS X5\nG3 X5 Y0 I5 J0", (5, 0, 0), (0, 0, 1), 180),
        ("CIP X10 Y0 Z0 I1=5 J1=0 K1=5", (5, 0, 0), (0, 1, 0), 180),
        ("CIP X0 Y20 Z0 I1=10 J1=10 K1=0", (0, 10, 0), (0, 0, 1), 180),
        ("G91 CIP X10 Y10 Z0 I1=10 J1=0 K1=0", (5, 5, 0), (0, 0, 1), 180),
    ],
)  # fmt: skip
def test_arcs(program: str, centre: tuple[float, ...], normal: tuple[float, ...], angle: float) -> None:
    moves = read(f"F600\n{program}\n")
    assert moves.motion.tolist() == [Motion.ARC]
    assert moves.centre[0] * 1e3 == pytest.approx(centre, abs=1e-9)
    assert moves.normal[0] == pytest.approx(normal, abs=1e-12)
    assert math.degrees(moves.angle[0]) == pytest.approx(angle, abs=1e-9)
    # The arc from the start, turned about the normal by the angle, ends where the row does (Rodrigues).
    radius = moves.start - moves.centre[0]
    radius -= moves.normal[0] * (moves.normal[0] @ radius)
    turned = math.cos(moves.angle[0]) * radius + math.sin(moves.angle[0]) * np.cross(moves.normal[0], radius)
    flat = moves.end[0] - moves.centre[0]
    assert turned * 1e3 == pytest.approx((flat - moves.normal[0] * (moves.normal[0] @ flat)) * 1e3, abs=1e-9)


def test_an_inexact_centre_moves_along_the_chord() -> None:
    moves = read("F600\nG2 X10 Y0 I5.004 J1\n")
    assert moves.centre[0] * 1e3 == pytest.approx([5, 1, 0], abs=1e-12)


# --- Corners ---------------------------------------------------------------------------------------------------------


def test_rounding_between_lines() -> None:
    moves = read("F600\nG1 X10 RND=2\nY10\n")
    assert moves.end * 1e3 == pytest.approx(np.array([[8, 0, 0], [10, 2, 0], [10, 10, 0]]), abs=1e-9)
    assert moves.centre[1] * 1e3 == pytest.approx([8, 2, 0], abs=1e-9)
    assert moves.angle[1] == pytest.approx(math.pi / 2)
    assert moves.line.tolist() == [2, 2, 3]


@pytest.mark.parametrize("word", ["CHR=2", f"CHF={2 * ROOT2!r}"])
def test_chamfer_by_leg_and_by_length(word: str) -> None:
    moves = read(f"F600\nG1 X10 {word}\nY10\n")
    assert moves.motion.tolist() == [Motion.LINE] * 3
    assert moves.end * 1e3 == pytest.approx(np.array([[8, 0, 0], [10, 2, 0], [10, 10, 0]]), abs=1e-9)


def test_modal_rounding_and_its_feed() -> None:
    moves = read("F600\nG1 X10 RNDM=2 FRCM=60\nY10\nX0 RNDM=0\nY0\n")
    assert moves.motion.tolist() == [1, 2, 1, 2, 1, 1]
    assert moves.feed * 6e4 == pytest.approx([600, 60, 600, 60, 600, 600])


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("G1 X20", "G3 X30 Y10 CR=8"),
        ("G1 X20", "G2 X20 Y-18 CR=10"),
        ("G1 X20", "G3 X10 Y10 CR=10"),
        ("G3 X20 Y0 CR=12", "G1 X30 Y20"),
        ("G2 X20 Y0 CR=12", "G3 X40 Y0 CR=11"),
        ("G2 X20 Y0 CR=12", "G2 X40 Y0 CR=11"),
        ("G3 X20 Y0 CR=12", "G3 X40 Y0 CR=11"),
    ],
)
def test_roundings_are_tangent_to_both_sides(first: str, second: str) -> None:
    """Whatever the sides: the radius is kept, and directions agree at both ends of the rounding."""
    moves = read(f"F600\nG1 X0.0001\n{first} RND=1.5\n{second}\n")
    assert len(moves) == 4
    points = np.vstack([moves.start, moves.end]) * 1e3

    def direction(row: int, at: int) -> np.ndarray:
        if moves.motion[row] == Motion.LINE:
            way = points[row + 1] - points[row]
        else:
            way = np.cross(moves.normal[row], points[at] - moves.centre[row] * 1e3)
        return way / np.linalg.norm(way)

    assert moves.motion[2] == Motion.ARC
    for point in points[2:4]:
        assert np.linalg.norm(point - moves.centre[2] * 1e3) == pytest.approx(1.5, abs=1e-9)
    assert direction(1, 2) == pytest.approx(direction(2, 2), abs=1e-9)
    assert direction(2, 3) == pytest.approx(direction(3, 3), abs=1e-9)
    assert moves.angle[2] < math.pi
    # What is left of the sides is as long as their angles say.
    for row in (1, 3):
        if moves.motion[row] == Motion.ARC:
            a, b = (points[k] - moves.centre[row] * 1e3 for k in (row, row + 1))
            swept = math.atan2(np.cross(a, b) @ moves.normal[row], a @ b) % (2 * math.pi)
            assert moves.angle[row] == pytest.approx(swept, abs=1e-9)


def test_chamfer_between_line_and_arc_is_equally_far_from_the_corner() -> None:
    moves = read("F600\nG1 X20 CHR=2\nG3 X30 Y-10 CR=10\n")
    corner = np.array([20, 0, 0])
    assert np.linalg.norm(moves.end[:2] * 1e3 - corner, axis=1) == pytest.approx([2, 2], abs=1e-9)
    assert np.linalg.norm(moves.end[1] * 1e3 - [30, 0, 0]) == pytest.approx(10, abs=1e-9)


# --- What rows have besides ------------------------------------------------------------------------------------------


def test_feeds() -> None:
    program = (
        "G1 X10 F600\nG700 X1 F10\nG71 S120 G95 F0.5\nX0\nG93 X10 F2\nG2 X20 I5 J0 F4\nG94 G1 X0 F60 FB=30\nX1\nG0 X0\n"
    )
    expected = [600, 254, 60, 20, 5 * math.pi * 4, 30, 60, math.nan]
    assert read(program).feed * 6e4 == pytest.approx(expected, rel=1e-12, nan_ok=True)


@pytest.mark.parametrize("dialect", ["sinumerik", "iso"])
def test_the_fast_way_of_lines_is_that_of_all_blocks(dialect: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Random blocks of G0 and G1, faults among them: the same rows, or the same refusal, without the fast way."""
    dice = random.Random(3)

    def block() -> str:
        words = [f"{axis}{dice.uniform(-9, 9):.3f}" for axis in dice.sample("XYZ", dice.randrange(4))]
        words += dice.choice(
            ([], ["G0"], ["G1"], ["G1"], ["X1"], ["G91"], ["G90"], ["G95"], ["G94 F5"], ["S0"], ["S9"])
        )
        words += dice.choice(([], [], ["F100"], ["F50.5"], ["F0"] if dice.random() < 0.05 else []))
        return f"N{dice.randrange(99)} {' '.join(dice.sample(words, len(words)))}"

    programs = ["F60 G1 X0\n" + "\n".join(block() for _ in range(dice.randrange(1, 12))) for _ in range(400)]

    def results() -> list[object]:
        found: list[object] = []
        for program in programs:
            try:
                moves = read(program, dialect=dialect)
            except InputError as refusal:
                found.append(str(refusal))
            else:
                found.append([getattr(moves, name).tobytes() for name in ("motion", "end", "feed", "line", "blending")])
        return found

    fast = results()
    monkeypatch.setattr(Movements, "execute_line", lambda self, words: False)
    assert results() == fast
    assert 50 < sum(isinstance(result, list) for result in fast) < 400


def test_dwells() -> None:
    moves = read("G0 X1\nG4 F1.5\nS120\nG4 S3\nG1 X2 F60\n")
    assert moves.motion.tolist() == [0, 3, 3, 1]
    assert moves.dwell.tolist() == [0, 1.5, 1.5, 0]
    assert moves.end[:3, 0].tolist() == [1e-3] * 3


def test_blending() -> None:
    program = (
        "G0 X1\nG64 X2\nG641 ADIS=0.5 ADISPOS=1 X3\nG1 X4 F60\nG9 X5\nG642 X6\nCTOL=0.02 X7\nG645 X8\nG60 X9\n"
        "CTOL=-1 G642 X10\nG641 ADIS=0 X11\n"
    )
    moves = read(program)
    none = math.nan
    assert moves.blending.tolist() == [0, 1, 2, 2, 0, 3, 3, 3, 0, 3, 1]
    assert moves.tolerance * 1e3 == pytest.approx(
        [none, none, 1, 0.5, none, 0.1, 0.02, 0.02, none, 0.1, none], nan_ok=True
    )
    assert Blending(moves.blending[-1]) is Blending.CONTINUOUS


def test_switches() -> None:
    moves = read("G0 X1\nBRISK FFWON COMPCAD G64 G1 X2 F60\nSOFT FFWOF COMPOF X3\n")
    assert moves.jerk_limited.tolist() == [True, False, True]
    assert moves.feedforward.tolist() == [False, True, False]
    assert moves.compressed.tolist() == [False, True, False]
    assert moves.tolerance[1] == pytest.approx(1e-4)


def test_offsets_are_those_given() -> None:
    offsets = {"G54": {"X": 100.0, "Z": 5.0}, "G505": {"X": 7.0}}
    program = "G54 G0 X1 Z0\nTRANS X10\nX1\nG53 X1\nG505 X1\nG500 TRANS\nX1\nG55 X2\n"
    found = ends(program.replace("G500 TRANS", "G500\nTRANS"), offsets=offsets)
    assert [row[0] for row in found] == [101, 111, 1, 18, 1, 2]
    assert found[0][2] == 5


def test_blocks_can_be_skipped() -> None:
    assert ends("G0 X1\n/X2\nX3\n", skip=True) == [[1, 0, 0], [3, 0, 0]]


def test_places_and_notes() -> None:
    moves = read(";\nT1 D1 M6\nN20 G0 X1 M8\nSUB\nM8\n", files={"SUB": "\n G0 Y1 ; move\n"})
    assert moves.files == ("main.mpf", "SUB.SPF")
    assert moves.file.tolist() == [0, 1]
    assert moves.line.tolist() == [3, 2]
    assert [moves.text(row) for row in (0, 1)] == ["N20 G0 X1 M8", "G0 Y1 ; move"]
    assert {note.word: (note.count, note.line) for note in moves.notes} == {
        "T": (1, 2), "D": (1, 2), "M6": (1, 2), "M8": (2, 3),
    }  # fmt: skip


def test_axes_come_geometry_first() -> None:
    moves = read("G0 Z1 U2\nG1 U=IC(1) X5 F60\nTRANS U10\nG0 U0\n", axes=("U", "Z", "X"), start=(1, 2, 3))
    assert moves.axes == ("X", "Z", "U")
    assert moves.start * 1e3 == pytest.approx([3, 2, 1])
    assert moves.end * 1e3 == pytest.approx(np.array([[3, 1, 2], [5, 1, 3], [5, 1, 10]]))


def test_two_axes_have_arcs_in_their_plane() -> None:
    moves = read("G18 G3 X10 Z10 CR=10 F60\n", axes=("X", "Z"))
    assert moves.end[0] * 1e3 == pytest.approx([10, 10])
    assert moves.centre[0] * 1e3 == pytest.approx([10, 0, 0], abs=1e-9)


# --- Subprograms -----------------------------------------------------------------------------------------------------


def test_arguments_and_variables_of_a_subprogram() -> None:
    files = {
        "ADD": "PROC ADD(REAL A, INT B=2, VAR REAL C) SAVE DISPLOF\nDEF REAL X1\nC=A+B\nG91 G0 X=A\nRET\n",
        "L10": "G0 Y=IC(1)\nM17\n",
        "OUTER": "L10\nINNER(R1)\n",
        "INNER": "PROC INNER(REAL Q1)\nG0 Z=Q1\nM30\n",
    }
    program = "DEF REAL SUM\nADD(1.5,,SUM)\nG0 X=SUM\nADD(2,3.6,R1)\nL10 P2\nOUTER\nG0 X0\n"
    assert ends(program, files=files) == [
        [1.5, 0, 0], [3.5, 0, 0], [5.5, 0, 0], [5.5, 1, 0], [5.5, 2, 0], [5.5, 3, 0], [5.5, 3, 6], [0, 3, 6],
    ]  # fmt: skip


def test_modal_words_of_a_subprogram_stay_without_save() -> None:
    assert ends("G0 X1\nINC\nX5\n", files={"INC": "G91 X1\n"})[-1][0] == 7


def test_call_by_text() -> None:
    assert ends('CALL "SUB"\nEXTCALL("DIR/SUB.SPF")\n', files={"SUB": "G0 X=IC(1)\n"}) == [[1, 0, 0], [2, 0, 0]]
