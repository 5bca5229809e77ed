"""What is not understood, or impossible, stops with file, line, word and reason."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
from program_helpers import read

from feedsim.foundation.errors import InputError
from feedsim.motions.part_program import interpreter, read_program, recorder, source

# Program -> line, word, a part of the reason.
FAULTS = {
    # numbers and words
    "G1 X10 Y=": (1, "Y", "missing"),
    "G1 X F1": (1, "X", "missing"),
    "G1 X=R1+ F1": (1, "F1", "not defined"),
    "G1 X=R1+": (1, "X", "missing"),
    "G1 X1..5 F1": (1, "X1..5", "two points"),
    "G1 X1.2.3 F1": (1, "X1.2.3", "two points"),
    "G1 X1e5 F1": (1, "X1E5", "EX"),
    "G1 X=1E5 F1": (1, "X1E5", "EX"),
    "G1 X10,5 F1": (1, "X10,", "decimal point"),
    "G1 X1EX300 F1": (1, "X", "10 km"),
    "R1=1EX200*1EX200": (1, "*", "too large"),
    "R1=EXP(1000)": (1, "EXP", "too large"),
    "G1 X=(1+2 F1": (1, "X", ") is missing"),
    "G1 X=1)": (1, ")", "not understood"),
    "G1 X=SIN(1,2) F1": (1, "SIN", "1 arguments"),
    "G1 X=FOO(1) F1": (1, "FOO", "not defined"),
    "G1 X1 (open": (1, "(", "not closed"),
    "MSG(\"open)": (1, "MSG", "not closed"),
    "G1 X1 ?": (1, "?", "not understood"),
    "G1 X\"A\"": (1, "X", "missing"),
    "G1 X=\"A\"": (1, "X", "number is expected"),
    "G999 X1": (1, "G999", "not known"),
    "G1.5 X1": (1, "G1.5", "not known"),
    "FOO=3": (1, "FOO", "not defined"),
    "UNKNOWNSUB": (1, "UNKNOWNSUB", "not found"),
    "G0 X0\nL99": (2, "L99", "not found"),
    # one block
    "G0 G1 X1 F1": (1, "G1", "one group"),
    "G1 G1 X1 F1": (1, "G1", "one group"),
    "G64 G60 X1": (1, "G60", "one group"),
    "SOFT BRISK": (1, "BRISK", "one group"),
    "G0 X1 X2": (1, "X", "twice"),
    "G0 X1 X=2": (1, "X", "twice"),
    "F1 G1 X1 F2": (1, "F", "twice"),
    "LABEL: LABEL: G1 X1 F1\nN10 N10 G1 X1": (2, "N", "twice"),
    "N10 G1 X1 N20 F1": (1, "N", "twice"),
    "TRANS X1 TRANS": (1, "TRANS", "own"),
    "G0 X1 TRANS X1": (1, "TRANS", "own"),
    "G4 F1 X1": (1, "X", "own"),
    "G4": (1, "G4", "missing"),
    "G4 F-1": (1, "G4", "0 to"),
    "G0 X1 CR=5": (1, "CR", "no meaning"),
    "RND=2": (1, "RND", "with a movement"),
    "G1 X1 P5 F1": (1, "P", "no meaning"),
    # feed
    "G1 X10": (1, "G1", "no feed"),
    "G2 X10 CR=5": (1, "G2", "no feed"),
    "G1 X10 F-5": (1, "F", "above 0"),
    "F0": (1, "F", "above 0"),
    "G1 F100 X1\nG95 X2": (2, "G1", "no feed"),
    "G95 G1 F1 X1": (1, "G1", "spindle speed"),
    "G93 G1 F1 X1\nX2": (2, "G1", "each block"),
    # arcs
    "F1\nG2 X10 Y0": (2, "G2", "without centre or radius"),
    "F1\nG2 X10 Y0 I3 J0": (2, "G2", "radius 3 mm at the start and 7 mm at the end"),
    "F1\nG2 X10 Y0 CR=4": (2, "G2", "below half the chord, 5 mm"),
    "F1\nG2 X0 Y0 CR=4": (2, "G2", "full circle"),
    "F1\nG2 X10 I0 J0": (2, "G2", "radius 0"),
    "F1\nG2 X10 CR=0": (2, "CR", "0 mm"),
    "F1\nG2 X10 CR=6 I5": (2, "CR", "centre or a radius"),
    "F1\nG2 X10 I5 K1": (2, "K", "I and J"),
    "F1\nG2 X10 I5 TURN=-1": (2, "TURN", "0 to 999"),
    "F1\nG2 X10 I5 TURN=1.5": (2, "TURN", "whole"),
    "F1\nG2 X10 AR=0": (2, "AR", "above 0"),
    "F1\nG2 X10 I5 AR=90": (2, "AR", "centre or its end"),
    "F1\nCIP X10 I1=5": (2, "CIP", "on a line"),
    "F1\nCIP X10": (2, "CIP", "intermediate"),
    "F1\nCT X10": (2, "CT", "no movement"),
    "F1\nG1 X1\nCT X0": (3, "CT", "behind"),
    "F1\nSCALE X2\nG2 X10 I5": (3, "G2", "ellipse"),
    "F1\nSCALE X0": (2, "SCALE", "scale of 0"),
    "F1\nG1 RP=-1 AP=0": (2, "RP", "negative"),
    "F1\nG1 RP=1 X1": (2, "X", "polar"),
    "F1\nG2 X10 Y0 R6": (2, "R", "CR="),
    # corners
    "F1\nG1 X1 RND=5\nY1": (2, "RND", "does not fit"),
    "F1\nG1 X1 CHR=5\nY1": (2, "CHR", "does not fit"),
    "F1\nG1 X1 RND=1": (2, "RND", "no movement follows"),
    "F1\nG1 X1 RND=1\nG0 Y1": (2, "RND", "rapid"),
    "F1\nG1 X1 RND=1\nZ1": (2, "RND", "no way in the plane"),
    "F1\nG1 X5 RND=1\nY5 Z5": (2, "RND", "leaves the plane"),
    "F1\nG1 X1 RND=1 CHF=1": (2, "CHF", "RND or CHF"),
    "F1\nG1 X1 RND=-1": (2, "RND", "negative"),
    "F1\nG1 ANG=45": (2, "ANG", "end of the line"),
    "F1\nG1 ANG=45\nX1": (3, "ANG", "end of the line"),
    "F1\nG1 ANG=45\nX1 Y1 ANG=45": (3, "ANG", "parallel"),
    "F1\nG1 X-1 ANG=45": (2, "ANG", "does not lead"),
    "F1\nG1 X1 ANG=90": (2, "ANG", "does not lead"),
    # smoothing
    "G642 CTOL=0": (1, "CTOL", "tolerance is 0"),
    "CTOL=0\nG642 X1": (2, "CTOL", "tolerance is 0"),
    "G641 ADIS=-1": (1, "ADIS", "negative"),
    "CTOL=IC(1)": (1, "CTOL", "no meaning"),
    "G643": (1, "G643", "not supported"),
    # values
    "R1=1/0": (1, "/", "division by zero"),
    "R1=1 MOD R2": (1, "MOD", "division by zero"),
    "R1=SQRT(-4)": (1, "SQRT", "0 or more"),
    "G1 X=ASIN(2) F1": (1, "ASIN", "-1 to 1"),
    "R1=LN(0)": (1, "LN", "above 0"),
    "R1=TAN(90)": (1, "TAN", "infinite"),
    "R1=5.5 B_AND 1": (1, "B_AND", "whole"),
    "IF 1==1 AND R1\nENDIF": (1, "AND", "parentheses"),
    "IF 1<2<3\nENDIF": (1, "<", "parentheses"),
    "R1=\"A\"": (1, "R1", "number"),
    "DEF INT A=\"A\"": (1, "A", "cannot be"),
    "DEF INT A=3EX9": (1, "A", "range"),
    "DEF REAL A,A": (1, "A", "twice"),
    "DEF REAL X": (1, "X", "another meaning"),
    "DEF FRAME A": (1, "DEF", "type"),
    "DEF REAL A[2]\nA[2]=1": (2, "A", "beyond the array"),
    "DEF REAL A[999,999]": (1, "A", "elements"),
    "R[-1]=2": (1, "R", "index"),
    # flow
    "IF R1>2\nG1 X1 F1": (1, "IF", "without ENDIF"),
    "G0 X1\nENDIF": (2, "ENDIF", "without IF"),
    "ELSE": (1, "ELSE", "without IF"),
    "WHILE R1<1\nIF R1\nENDWHILE\nENDIF": (3, "ENDWHILE", "without WHILE; IF of line 2"),
    "FOR R1=1 TO 2": (1, "FOR", "without ENDFOR"),
    "REPEAT": (1, "REPEAT", "without UNTIL"),
    "FOR X=1 TO 2\nENDFOR": (1, "FOR", "variable"),
    "FOR R1=1\nENDFOR": (1, "FOR", "TO is missing"),
    "WHILE 1\nENDWHILE": (2, "loop", "without end"),
    "LOOP\nG0 X1\nENDLOOP": (3, "loop", "without end"),
    "A1: G0 X1\nGOTOB A1": (2, "loop", "without end"),
    "WHILE 1\nR1=R1+1\nENDWHILE": (3, "loop", "2,000 blocks"),
    "GOTOF A1": (1, "A1", "no such label"),
    "A1:\nGOTOF A1": (2, "A1", "after this block; line 1 has it"),
    "GOTO": (1, "GOTO", "missing"),
    "IF 1 G1 X1\nENDIF": (1, "G1", "next block"),
    "REPEAT A1 P=2": (1, "A1", "no such label"),
    "REPEATB A1 P=-2\nA1:": (1, "P", "0 to 9999"),
    "A1: GOTOF A2\nREPEAT A1\nA2: G0 X1\nGOTOB A1": (4, "loop", "without end"),
    # refused
    "G21": (1, "G21", "ISO dialect"),
    "CYCLE832(0.01)": (1, "CYCLE832", "CTOL"),
    "G41": (1, "G41", "radius compensation"),
    "G33 Z1 K1": (1, "G33", "spindle"),
    "G96 S100": (1, "G96", "cutting speed"),
    "G0 A90": (1, "A", "rotary"),
    "G0 A=DC(90)": (1, "A", "rotary"),
    "G0 X=DC(90)": (1, "X", "rotary"),
    "CYCLE81(1,2,3)": (1, "CYCLE81", "cycles"),
    "TRAORI": (1, "TRAORI", "transformations"),
    "G0 X=$AA_IW[X]": (1, "$AA_IW", "variables of the control"),
    "$P_UIFR[1]=CTRANS(X,1)": (1, "$P_UIFR", "variables of the control"),
    "POS[X]=5": (1, "POS", "positioning axes"),
    "ASPLINE X1": (1, "ASPLINE", "splines"),
    "DIAMON": (1, "DIAMON", "diameters"),
    "OVR=50": (1, "OVR", "not supported"),
    "TRANS X=AC(1)": (1, "X", "does not take"),
    "ROT CR=2": (1, "CR", "does not take"),
    "G53 G2 X1 CR=1 F1": (1, "G53", "G0 and G1"),
    "G91 G53 X1": (1, "G53", "absolute"),
    "G0 X1\n%_N_OTHER_MPF\nG0 X2": (2, "%_N_OTHER_MPF", "another program"),
    # nothing
    "": (1, "program", "empty"),
    "\n \n": (2, "program", "empty"),
    ";nothing\nR1=1": (2, "program", "no movement"),
}  # fmt: skip


@pytest.mark.parametrize("program", FAULTS)
def test_line_word_and_reason(program: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(interpreter, "MAX_REPEATED", 2000)
    line, word, reason = FAULTS[program]
    with pytest.raises(InputError) as error:
        read(program)
    assert str(error.value).startswith(f"main.mpf:{line}: {word}: "), error.value
    assert reason in str(error.value)


@pytest.mark.parametrize("dialect", ["sinumerik", "iso"])
@pytest.mark.parametrize(
    ("loop", "word", "control"),
    [
        ("WHILE [#1 LT 5] DO 1\nG1 X#1 F60\n#1=#1+1\nEND 1", "WHILE", "Fanuc"),
        ("N10 WHILE[#1LT5]DO1\nG0X1\nEND1", "WHILE", "Fanuc"),
        ("O100 while [#1 LT 5]\nG0 X1\nO100 endwhile", "WHILE", "LinuxCNC"),
        ("o<wide> repeat [5]\nG0 X1\no<wide> endrepeat", "REPEAT", "LinuxCNC"),
        ("O7 DO\nG0 X1\nO7 WHILE [#1 LT 5]", "DO", "LinuxCNC"),
    ],
)
def test_loops_of_other_controls_are_named(loop: str, word: str, control: str, dialect: str) -> None:
    with pytest.raises(InputError) as error:
        read(f"G0 X0\n{loop}\nM30\n", dialect=dialect)
    assert str(error.value).startswith(f"main.mpf:2: {word}: macro loops of {control} "), error.value


def test_names_like_those_of_other_loops_stay() -> None:
    read("R1=0\nWHILE (R1<2)\nR1=R1+1\nG0 X=R1\nENDWHILE\nEND1: G0 X5\n")
    read("O100\nG0 X1 (O100 WHILE [1])\nM30\n", dialect="iso")


def test_a_fault_of_a_subprogram_has_its_file() -> None:
    with pytest.raises(InputError, match=r"^SUB\.SPF:2: Y: the axis stands twice"):
        read("G0 X1\nSUB\n", files={"SUB": "G0 X2\nY1 Y2\n"})


def test_recursion_is_limited() -> None:
    with pytest.raises(InputError, match=r"^SUB\.SPF:1: SUB: more than 16 levels"):
        read("SUB\n", files={"SUB": "SUB\n"})


def test_arguments_without_proc() -> None:
    with pytest.raises(InputError, match=r"^main\.mpf:1: SUB: the call has arguments"):
        read("SUB(1)\n", files={"SUB": "G0 X1\n"})
    with pytest.raises(InputError, match=r"^SUB\.SPF:1: PROC: the call has 1 arguments more"):
        read("SUB(1,2)\n", files={"SUB": "PROC SUB(REAL A)\nG0 X1\n"})


def test_deep_expressions_are_refused() -> None:
    with pytest.raises(InputError, match="nested more than 40 deep"):
        read(f"R1={'(' * 5000}1{')' * 5000}\n")


def test_missing_axes_are_named() -> None:
    with pytest.raises(InputError, match=r"Y: the machine has no axis Y; it has X, Z"):
        read("G0 X1 Y2\n", axes=("X", "Z"))
    with pytest.raises(InputError, match=r"G2: the plane needs the axis Y"):
        read("G2 X1 CR=2 F1\n", axes=("X", "Z"))


def test_many_rows_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recorder, "MAX_ROWS", 20_000)
    with pytest.raises(InputError, match=r"more than 20,000 movements"):
        read("G0 X1\n" * 40_000)


# --- Files -----------------------------------------------------------------------------------------------------------

PROGRAM = "G0 X1 ; schön\nG1 Y2 F60\n"


@pytest.mark.parametrize(
    "data",
    [
        PROGRAM.encode(), PROGRAM.encode("utf-8-sig"), PROGRAM.encode("latin-1"), PROGRAM.encode("utf-16"),
        PROGRAM.encode("utf-16-le"), PROGRAM.encode("utf-16-be"), PROGRAM.replace("\n", "\r\n").encode(),
        PROGRAM.replace("\n", "\r").encode(), PROGRAM.encode() + b"\x1a", PROGRAM.rstrip().encode(),
    ],
)  # fmt: skip
def test_encodings_and_line_ends(data: bytes, tmp_path: Path) -> None:
    (tmp_path / "a.mpf").write_bytes(data)
    moves = read_program(tmp_path / "a.mpf", axes=("X", "Y"), start=(0, 0))
    assert moves.end.tolist() == [[0.001, 0], [0.001, 0.002]]
    assert moves.line.tolist() == [1, 2]
    assert moves.text(0) == "G0 X1 ; schön"


def test_other_files_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.mpf"

    def refused(match: str) -> None:
        with pytest.raises(InputError, match=match):
            read_program(path, axes=("X",), start=(0,))

    refused("no such file")
    path.write_bytes(b"\x7fELF\x02\x01\x01\x00\x00\x00\x00\x00")
    refused(r"a\.mpf:1: byte 0x02: the file is binary")
    path.write_bytes(b"G0 X1\nG0 X2\x00\n")
    refused(r"a\.mpf:2: byte 0x00")
    path.write_bytes(b"\xff\xfeG\x00\x00\xd8\x01\x00")
    refused("UTF-16")
    path.write_bytes(b"")
    refused("empty")
    monkeypatch.setattr(source, "MAX_FILE_SIZE", 10)
    path.write_bytes(b"G0 X1\nG0 X2\n")
    refused("10 bytes|1e-05 MB")
    path.unlink()
    path.mkdir()
    refused("a folder")


def test_subprograms_lie_beside_the_program_in_any_case(tmp_path: Path) -> None:
    (tmp_path / "main.mpf").write_text("%_N_MAIN_MPF\n;$PATH=/_N_MPF_DIR\nsub1\nSub2\nL3\nM30\n", encoding="utf-8")
    (tmp_path / "SUB1.SPF").write_text("G0 X1\n", encoding="utf-8")
    (tmp_path / "_N_SUB2_SPF").write_text("%_N_SUB2_SPF\nG0 X2\nM17\n", encoding="utf-8")
    (tmp_path / "l3.spf").write_text("G0 X3\n", encoding="utf-8")
    moves = read_program(tmp_path / "main.mpf", axes=("X",), start=(0,))
    assert moves.end[:, 0].tolist() == [0.001, 0.002, 0.003]
    assert [Path(name).name for name in moves.files] == ["main.mpf", "SUB1.SPF", "_N_SUB2_SPF", "l3.spf"]


@pytest.mark.parametrize(
    ("name", "text", "dialect"),
    [
        ("a.mpf", "G20 G2 X1 R5", "sinumerik"), ("a.ngc", "G1 X1", "iso"), ("a.h", "L X+1", "heidenhain"),
        ("a.nc", "0 BEGIN PGM A MM\n", "heidenhain"), ("a.nc", "G2 X1 Y1 R5", "iso"),
        ("a.nc", "G2 X1 Y1 CR=5", "sinumerik"),
        ("a.nc", "%\nO100\nG0 X1", "iso"), ("a.nc", "%_N_A_MPF\nG0 X1", "sinumerik"), ("a.nc", "G21\nG0 X1", "iso"),
        ("a.nc", "G0 X1", "sinumerik"), ("a.nc", "R1=5\nG0 X=R1", "sinumerik"), ("a.nc", "#1=5", "iso"),
        ("a.nc", "N20 G0 X1 (G21)\nN21 X2", "sinumerik"), ("a.nc", "N10G90G21\nG0X1", "iso"),
    ],
)  # fmt: skip
def test_dialects_are_detected(name: str, text: str, dialect: str) -> None:
    assert source.detect_dialect(Path(name), text) == dialect


def test_a_dialect_has_a_name(tmp_path: Path) -> None:
    (tmp_path / "a.nc").write_text("G0 X1\n", encoding="utf-8")
    with pytest.raises(InputError, match="dialect 'fanuc' is none of sinumerik, iso, heidenhain"):
        read_program(tmp_path / "a.nc", axes=("X",), start=(0,), dialect="fanuc")
