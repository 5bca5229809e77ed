"""Mutated programs are read or refused in words: nothing but InputError leaves the reader, and no program takes long.

``python tests/part_program/test_fuzz.py 1000000`` tries as many.
"""

from __future__ import annotations

import random
import re
import sys
import time
import warnings
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
import program_helpers

from feedsim.foundation.errors import InputError
from feedsim.motions.part_program import conversational, interpreter, recorder, words

# Programs of a dialect, parted by lines of ===.
SEEDS = {
    "sinumerik": """
N10 G17 G90 G71 G94 G54
N20 G0 X0 Y0 Z5
N30 G1 Z-1 F200
N40 G2 X10 Y0 I5 J0
N50 G3 X0 Y0 CR=8
N60 M30
===
G641 ADIS=0.5 ADISPOS=1
G1 X10 F500 RND=2
Y10 CHF=1
X0 CHR=1
G642 CTOL=0.01
G2 X5 Y5 AR=90
CT X9 Y3
G60 X0
===
R1=10 R2=R1*2+1 R[3]=SQRT(ABS(-4))
G1 X=R1 Y=IC(R2) F=R1*100
X=SIN(30)*R1 Y=AC(ATAN2(1,2)) Z=POT(2)
===
DEF REAL A=1.5,B
DEF INT NR,C[3]
FOR NR=0 TO 2
C[NR]=NR*2
G1 X=C[NR] F100
ENDFOR
IF (A>1) AND (B==0)
B=TRUNC(A)
ELSE
MSG("a;b")
ENDIF
G0 Z=B
===
R1=0
LA1: R1=R1+1
G1 X=R1 F500
IF R1<3 GOTOB LA1
CASE(R1) OF 3 GOTOF E3 4 GOTOF E4 DEFAULT GOTOF E5
E3: G0 X1
E4: G0 X2
E5: G0 X3
REPEAT E3 E4 P=2
REPEATB E5 P=2
===
TRANS X10 Y5
AROT RPL=30
ASCALE X2 Y2 Z2
AMIRROR X0
G0 X1 Y1
G3 X2 Y2 CR=3 F100
TRANS
G0 X0
===
G111 X10 Y10
G1 RP=5 AP=30 F100
AP=IC(20)
G2 AP=-90
G110 X1 Y1
G112 AP=10 RP=3
G0 RP=1
G4 F1.5
S100
G4 S10
===
S1000 M3 T1 D1
G95 F0.1
G1 X10
G93
G1 X0 F2
G94
SOFT FFWON COMPCAD
G1 X1 F9
COMPOF BRISK FFWOF
X2 ANG=30
G1 ANG=45
X20 Y5 ANG=-45
===
G0 X0 Y0 Z0
CIP X10 Y0 Z0 I1=5 J1=5 K1=1 F100 TURN=1
SUB1 P2
L100 P3
SUBP(1,R1)
G53 X1
/G0 X5 (comment)
===
WHILE R1<5
R1=R1+1
LOOP
IF R2>3 GOTOF OUT
R2=R2+1
ENDLOOP
OUT:
ENDWHILE
REPEAT
R3=R3+1
UNTIL R3>=2
G0 X=R3
""",
    "iso": """
%
O1000 (part)
N10 G21 G17 G90 G40 G49 G80
G0 X0 Y0 Z5
G1 Z-1 F200
G2 X10 Y0 R6
G3 X0 Y0 I-5 J0 P2
M30
%
===
#1=5 #2=[#1*2+1]
G0 X#1 Y[SIN[30]*10]
X[ATAN[1]/[2]] Y[2**3]
G64 P0.01
G4 P1
M98 P100 L2
M2
O100
G91 X1
M99
""",
    "heidenhain": """
0 BEGIN PGM A MM
1 TOOL CALL 1 Z S3000 F500
2 L X+10 Y+0 R0 FMAX M3
3 L IX+5 F200
4 RND R2
5 L Y+20
6 CHF 1
7 L X+0
8 CC X+0 Y+0
9 C X+20 Y+0 DR-
10 CR X+0 Y+0 R+15 DR+
11 LP PR+10 PA+30
12 CP IPA+90 IZ-2 DR+
13 CT X+1 Y+2
14 LBL 1
15 Q1 = Q1 + 1
16 L X+Q1 FMAX
17 CALL LBL 1 REP 2
18 FN 12: IF +Q1 LT +9 GOTO LBL 1
19 CALL LBL 2
20 M30
21 LBL 2
22 L IY-1
23 LBL 0
24 END PGM A MM
""",
}
FILES = {
    "SUB1": "G1 X1 Y1 F500\nM17\n",
    "L100": "G91 G0 X1\nG90\nRET\n",
    "SUBP": "PROC SUBP(REAL A, VAR REAL B) SAVE\nG1 X=A Y=B F500\nB=B+1\nM17\n",
}
PIECES = [
    "=", "(", ")", "[", "]", "\n", " ", ";", "\"", ".", "-", "+", "E5", "EX9", "1e9", "99999999999", "0", "G2 ",
    "G1 ", "F0 ", "X", "IC(", "R1", "SIN(", "/", "*", "%", ":", "N10", "ENDIF\n", "ENDWHILE\n", "GOTO ", "P=3", "#",
    "'H", "<<", "TURN=9", "RND=1 ", "SCALE X0\n", "ASCALE X1000\n", "G18 ", "G41 ", "RPL=", "é", "ß", "\x0b", "Q1",
    "DR+", "IX", "CALL LBL 1", "AND", "==",
]  # fmt: skip

MESSAGE = re.compile(r"[^:]+\.(?:mpf|SPF):[1-9]\d*: \S.*?: \S.*", re.DOTALL)


def mutate(text: str, other: str, dice: random.Random) -> str:
    """A few changes: letters and pieces put in or taken out; lines doubled, removed, taken from another program."""
    for _ in range(dice.choice((1, 1, 1, 1, 2, 3))):
        at = dice.randrange(len(text) + 1)
        to = min(len(text), at + dice.choice((1, 1, 2, 5)))
        way = dice.randrange(7)
        if way == 0:
            text = text[:at] + text[to:]
        elif way == 1:
            text = text[:at] + dice.choice(PIECES) + text[at:]
        elif way == 2:
            text = text[:at] + dice.choice(PIECES) + text[to:]
        elif way == 3:
            text = text[:at] + chr(dice.randrange(32, 127)) + text[to:]
        else:
            lines, others = text.split("\n"), other.split("\n")
            line = dice.randrange(len(lines))
            if way == 4:
                lines.insert(dice.randrange(len(lines) + 1), lines[line])
            elif way == 5:
                lines.insert(line, dice.choice(others))
            else:
                del lines[line]
            text = "\n".join(lines)
    return text


def try_programs(count: int, seed: int) -> tuple[int, int, float]:
    """Programs read, programs refused, the longest time [s]. Anything but InputError passes, with its program."""
    dice = random.Random(seed)
    read = refused = 0
    longest = 0.0
    for _ in range(count):
        dialect = dice.choice(("sinumerik", "sinumerik", "sinumerik", "iso", "heidenhain"))
        every = [seed.lstrip() for seed in SEEDS[dialect].split("===\n")]
        text = mutate(dice.choice(every), dice.choice(every), dice)
        begun = time.perf_counter()
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                moves = program_helpers.read(text, dialect=dialect, files=FILES)
            read += 1
            assert all(map(bool, moves.files))
        except InputError as refusal:
            refused += 1
            if not MESSAGE.fullmatch(str(refusal)):
                raise
        except BaseException:
            print(repr(text))
            raise
        longest = max(longest, time.perf_counter() - begun)
    return read, refused, longest


@pytest.mark.parametrize("seed", range(3))
def test_mutated_programs_are_read_or_refused(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Few repeated blocks are allowed, so that endless loops end soon."""
    for module in (interpreter, conversational):
        monkeypatch.setattr(module, "MAX_REPEATED", 2000)
    read, refused, _ = try_programs(1000, seed)
    assert read > 100
    assert refused > 300


VALUE_KINDS = [
    "", "=1", "=-3", "=0", "=IC(1)", "=AC(2)", "=DC(1)", '="T"', "=TRUE", "[1]=2", "[0]", "(1)", "()", "=", "=1/0",
    "=R1", "=AA", "1", "-2", "0", "3.5", "=(", "=)", "[", "]", " TO 3", " P=2", "=9EX99", "=1==1", "=NOT 1",
    "=-TRUE", " X1", "=1 I5 X10",
]  # fmt: skip


def test_every_word_with_every_kind_of_value() -> None:
    """In a block of its own, after a movement: read, or refused in its line or at the end."""
    names = sorted(
        {
            *words.VALUES,
            *words.NOTED_WORDS,
            *words.NOTED_VALUES,
            *words.NAMES_REFUSED,
            *words.NAMED_CODES,
            *words.FRAMES,
            *map(chr, range(ord("A"), ord("Z") + 1)),
            "R1",
            "X1",
            "I1",
            "AA",
            "SUB1",
            "SUBP",
            "L100",
            "SIN",
            "NOT",
            "TRUE",
            *interpreter.Interpreter(
                recorder.Recorder("XYZ", (0, 0, 0)), lambda name: None, iso=False, skip=False, tolerance=1, offsets={}
            ).control,
        }
    )
    count = 0
    for name in names:
        for value in VALUE_KINDS:
            try:
                program_helpers.read(f"DEF REAL AA=1\nF600 S100 G1 X1\n{name}{value}\nX5\n", files=FILES)
                count += 1
            except InputError as refusal:
                if not MESSAGE.fullmatch(str(refusal)):
                    raise
    assert count > 500


if __name__ == "__main__":
    interpreter.MAX_REPEATED = conversational.MAX_REPEATED = 2000
    total, done, begin = int(sys.argv[1]), [0, 0, 0.0], time.perf_counter()
    for chunk in range(total // 10_000):
        result = try_programs(10_000, 1000 + chunk)
        done = [done[0] + result[0], done[1] + result[1], max(done[2], result[2])]
        print(f"{(chunk + 1) * 10_000:,} programs: {done[0]:,} read, {done[1]:,} refused, longest {done[2]:.2f} s, "
              f"{time.perf_counter() - begin:.0f} s", flush=True)  # fmt: skip
