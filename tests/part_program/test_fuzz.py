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

from feedsim.errors import InputError
from feedsim.part_program import conversational, interpreter

SEEDS = {
    "sinumerik": [
        "N10 G17 G90 G71 G94 G54\nN20 G0 X0 Y0 Z5\nN30 G1 Z-1 F200\nN40 G2 X10 Y0 I5 J0\nN50 G3 X0 Y0 CR=8\nN60 M30\n",
        "G641 ADIS=0.5 ADISPOS=1\nG1 X10 F500 RND=2\nY10 CHF=1\nX0 CHR=1\nG642 CTOL=0.01\nG2 X5 Y5 AR=90\nCT X9 Y3\nG60 X0\n",
        "R1=10 R2=R1*2+1 R[3]=SQRT(ABS(-4))\nG1 X=R1 Y=IC(R2) F=R1*100\nX=SIN(30)*R1 Y=AC(ATAN2(1,2)) Z=POT(2)\n",
        "DEF REAL A=1.5,B\nDEF INT NR,C[3]\nFOR NR=0 TO 2\nC[NR]=NR*2\nG1 X=C[NR] F100\nENDFOR\n"
        'IF (A>1) AND (B==0)\nB=TRUNC(A)\nELSE\nMSG("a;b")\nENDIF\nG0 Z=B\n',
        "R1=0\nLA1: R1=R1+1\nG1 X=R1 F500\nIF R1<3 GOTOB LA1\nCASE(R1) OF 3 GOTOF E3 4 GOTOF E4 DEFAULT GOTOF E5\n"
        "E3: G0 X1\nE4: G0 X2\nE5: G0 X3\nREPEAT E3 E4 P=2\nREPEATB E5 P=2\n",
        "TRANS X10 Y5\nAROT RPL=30\nASCALE X2 Y2 Z2\nAMIRROR X0\nG0 X1 Y1\nG3 X2 Y2 CR=3 F100\nTRANS\nG0 X0\n",
        "G111 X10 Y10\nG1 RP=5 AP=30 F100\nAP=IC(20)\nG2 AP=-90\nG110 X1 Y1\nG112 AP=10 RP=3\nG0 RP=1\nG4 F1.5\nS100\nG4 S10\n",
        "S1000 M3 T1 D1\nG95 F0.1\nG1 X10\nG93\nG1 X0 F2\nG94\nSOFT FFWON COMPCAD\nG1 X1 F9\nCOMPOF BRISK FFWOF\nX2 ANG=30\n"
        "G1 ANG=45\nX20 Y5 ANG=-45\n",
        "G0 X0 Y0 Z0\nCIP X10 Y0 Z0 I1=5 J1=5 K1=1 F100 TURN=1\nSUB1 P2\nL100 P3\nSUBP(1,R1)\nG53 X1\n/G0 X5 (comment)\n",
        "WHILE R1<5\nR1=R1+1\nLOOP\nIF R2>3 GOTOF OUT\nR2=R2+1\nENDLOOP\nOUT:\nENDWHILE\nREPEAT\nR3=R3+1\nUNTIL R3>=2\nG0 X=R3\n",
    ],
    "iso": [
        "%\nO1000 (part)\nN10 G21 G17 G90 G40 G49 G80\nG0 X0 Y0 Z5\nG1 Z-1 F200\nG2 X10 Y0 R6\nG3 X0 Y0 I-5 J0 P2\nM30\n%\n",
        "#1=5 #2=[#1*2+1]\nG0 X#1 Y[SIN[30]*10]\nX[ATAN[1]/[2]] Y[2**3]\nG64 P0.01\nG4 P1\nM98 P100 L2\nM2\nO100\nG91 X1\nM99\n",
    ],
    "heidenhain": [
        "0 BEGIN PGM A MM\n1 TOOL CALL 1 Z S3000 F500\n2 L X+10 Y+0 R0 FMAX M3\n3 L IX+5 F200\n4 RND R2\n5 L Y+20\n6 CHF 1\n7 L X+0\n"
        "8 CC X+0 Y+0\n9 C X+20 Y+0 DR-\n10 CR X+0 Y+0 R+15 DR+\n11 LP PR+10 PA+30\n12 CP IPA+90 IZ-2 DR+\n13 CT X+1 Y+2\n"
        "14 LBL 1\n15 Q1 = Q1 + 1\n16 L X+Q1 FMAX\n17 CALL LBL 1 REP 2\n18 FN 12: IF +Q1 LT +9 GOTO LBL 1\n19 CALL LBL 2\n20 M30\n"
        "21 LBL 2\n22 L IY-1\n23 LBL 0\n24 END PGM A MM\n",
    ],
}  # fmt: skip
FILES = {
    "SUB1": "G1 X1 Y1 F500\nM17\n",
    "L100": "G91 G0 X1\nG90\nRET\n",
    "SUBP": "PROC SUBP(REAL A, VAR REAL B) SAVE\nG1 X=A Y=B F500\nB=B+1\nM17\n",
}
PIECES = [
    "=", "(", ")", "[", "]", "\n", " ", ";", '"', ".", "-", "+", "E5", "EX9", "1e9", "99999999999", "0", "G2 ", "G1 ", "F0 ",
    "X", "IC(", "R1", "SIN(", "/", "*", "%", ":", "N10", "ENDIF\n", "ENDWHILE\n", "GOTO ", "P=3", "#", "'H", "<<", "TURN=9",
    "RND=1 ", "SCALE X0\n", "ASCALE X1000\n", "G18 ", "G41 ", "RPL=", "é", "ß", "\x0b", "Q1", "DR+", "IX", "CALL LBL 1", "AND", "==",
]  # fmt: skip


def mutate(text: str, other: str, dice: random.Random) -> str:
    """A few changes: letters and pieces put in, taken out, moved; lines swapped, doubled, taken from another program."""
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
    """Programs read, programs refused, the longest time [s]. Anything but InputError passes through, with its program."""
    dice = random.Random(seed)
    read = refused = 0
    longest = 0.0
    for _ in range(count):
        dialect = dice.choice(("sinumerik", "sinumerik", "sinumerik", "iso", "heidenhain"))
        every = SEEDS[dialect]
        text = mutate(dice.choice(every), dice.choice(every), dice)
        begun = time.perf_counter()
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                moves = program_helpers.read(text, dialect=dialect, files=FILES)
            read += 1
            assert all(map(bool, moves.files))
        except InputError as error:
            refused += 1
            assert re.fullmatch(r"[^:]+\.(?:mpf|SPF):[1-9]\d*: \S.*?: \S.*", str(error), re.DOTALL), error
        except BaseException:
            print(repr(text))
            raise
        longest = max(longest, time.perf_counter() - begun)
    return read, refused, longest


@pytest.mark.parametrize("seed", range(4))
def test_mutated_programs_are_read_or_refused(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Few repeated blocks are allowed, so that endless loops end soon."""
    for module in (interpreter, conversational):
        monkeypatch.setattr(module, "MAX_REPEATED", 2000)
    read, refused, _ = try_programs(1500, seed)
    assert read > 100
    assert refused > 500


if __name__ == "__main__":
    interpreter.MAX_REPEATED = conversational.MAX_REPEATED = 2000
    total, done, begin = int(sys.argv[1]), [0, 0, 0.0], time.perf_counter()
    for chunk in range(total // 10_000):
        result = try_programs(10_000, 1000 + chunk)
        done = [done[0] + result[0], done[1] + result[1], max(done[2], result[2])]
        print(f"{(chunk + 1) * 10_000:,} programs: {done[0]:,} read, {done[1]:,} refused, longest {done[2]:.2f} s, "
              f"{time.perf_counter() - begin:.0f} s", flush=True)  # fmt: skip
