"""Files that a reader could take hours for: each in a process with 5 s of computing, which a megabyte does not need."""

from __future__ import annotations

import platform
from pathlib import Path

import pytest

if platform.system() != "Linux":
    pytest.skip("cases are processes that are forked and limited as Linux has it", allow_module_level=True)

from fuzz.kinds import read_control
from fuzz.readers import outcome

SIZE = 1_000_000
DATUM = "N32200 $MA_POSCTRL_GAIN[0,AX1]=4\n"
XTI = "<TcSmItem><AxisPara/>"
JOINT = "[JOINT_0]\nMAX_VELOCITY=1\n"


def repeated(text: str) -> str:
    return text * (SIZE // len(text))


def counted(text: str) -> str:
    return "".join(text.format(k) for k in range(SIZE // len(text.format(12345))))


TEXTS = {
    "comments without an end": XTI + repeated("<!--"),
    "a tag without an end": f"{XTI}<{'a' * SIZE}",
    "tags within tags": XTI + repeated("<a>"),
    "brackets": XTI + "<" * SIZE,
    "quotes in tags": XTI + repeated('<a "'),
    "an attribute of one word": f"<TcSmItem><Axis {'a' * SIZE}></Axis>",
    "many axes": "<TcSmItem>" + repeated('<Axis><Name>a</Name><Velo Maximum="250"/></Axis>'),
    "ends of tags that are not open": "<TcSmItem>" + "".join(f"<a{k}>" for k in range(490)) + repeated("</x>"),
    "entities": '<!DOCTYPE a [<!ENTITY a "lol"><!ENTITY b "&a;&a;">]>' + XTI,
    "blanks in an axis list": f"kenngr.achs_typ 1\nachse[0].kv x{' ' * SIZE}x",
    "an index of many digits": f"kenngr.achs_typ 1\ngetriebe[{'9' * SIZE}].kv 5\n",
    "many drives": DATUM + counted("PS{0:06d}.TEA\np199[0]=65\n"),
    "blanks behind a name": DATUM + repeated("$MA_X" + " " * 3980 + "\n"),
    "blanks behind a number": DATUM + repeated("p1460" + " " * 3980 + "\n"),
    "blanks behind a value": DATUM + repeated("N32200 $MA_X=5" + " " * 3980 + "x\n"),
    "blanks behind a drive's parameter": "p1460" + " " * SIZE,
    "one name": "$MA_" + "A" * SIZE,
    "heads of records": DATUM + "\x01" + repeated("_N_"),
    "a path": DATUM + ";$PATH=" + "/" * SIZE,
    "blanks behind a percent sign": DATUM + "%" + " " * SIZE,
    "programs": DATUM + repeated("%_N_A_SPF\n$MA_POSCTRL_GAIN[0,AX1]=5\n"),
    "a value of many digits": "p1460='H" + "F" * 3000 + "'\np1656=1e999\np1658=5\n",
    "columns and rows of a table": "value;" + "a;" * (SIZE // 4) + "\n" + "p1;5\n" * (SIZE // 10),
    "cells of a table": "p1460;5\n" + repeated("5;"),
    "backlashes": JOINT + repeated("BACKLASH=1\n"),
    "coordinates": "[TRAJ]\nCOORDINATES=" + repeated("XY") + "\n" + JOINT,
    "parameters of kinematics": "[KINS]\nKINEMATICS=trivkins " + repeated("coordinates=X ") + "\n" + JOINT,
    "limits of all axes": "[TRAJ]\n" + repeated("MAX_LINEAR_VELOCITY=1\n")
    + "".join(f"[JOINT_{k}]\nMAX_VELOCITY=1\n" for k in range(100)),
    "a line that goes on": JOINT + "A=" + repeated("\\\n"),
}  # fmt: skip


@pytest.mark.parametrize("name", TEXTS)
def test_a_megabyte_of_anything_is_answered(name: str, tmp_path: Path) -> None:
    path = tmp_path / "case.arc"
    path.write_text(TEXTS[name], encoding="latin-1")
    assert outcome(read_control, path) in ("read", "refused")
