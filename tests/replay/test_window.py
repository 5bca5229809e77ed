"""Windows of a record by times and by the blocks of its program."""

from __future__ import annotations

import json
import math
import os
from pathlib import Path

import pytest

from feedsim.cli import main
from feedsim.estimation.replay.closed_loop import window
from feedsim.files.trace import Mark
from feedsim.foundation.errors import InputError

MARKS = [
    Mark(0.5, "N1 G0 X10"),
    Mark(1.0, "N10 G1 X20 F500"),
    Mark(2.0, "STOPRE"),
    Mark(3.0, "N20  G1 X0"),
    Mark(4.5, "STOPRE"),
]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("0.5 s..2 s", (0.5, 2.0)),
        ("500 ms..2 s", (0.5, 2.0)),
        ("N10", (1.0, 2.0)),
        ("N1..N20", (0.5, 4.5)),  # N1 is not N10
        ("n1 g0..2.5 s", (0.5, 2.5)),
        ("N20 G1", (3.0, 4.5)),  # one blank or two
        ("0.7 s .. STOPRE #1", (0.7, 3.0)),
        ("STOPRE #2", (4.5, math.inf)),
    ],
)
def test_begin_and_end(text: str, expected: tuple[float, float]) -> None:
    assert window(text, MARKS) == expected


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("1 s", "BEGIN..END is needed"),
        ("1 s..", "BEGIN..END is needed"),
        ("..1 s", "BEGIN..END is needed"),
        ("2 s..1 s", "not ahead of the end"),
        ("N20..N1", "not ahead of the end"),
        ("1 m..2 s", "a length; a time is expected"),
        ("N3", "none begins with 'N3'; there is N1 G0 X10; N10 G1 X20 F500; STOPRE; N20  G1 X0"),
        ("STOPRE", "2 blocks of the record begin with 'STOPRE', at 2 s, 4.5 s; say which, for example STOPRE #2"),
        ("STOPRE #3", "'STOPRE' begins 2 of them"),
    ],
)
def test_what_is_none_is_told(text: str, told: str) -> None:
    with pytest.raises(InputError) as caught:
        window(text, MARKS)
    assert told in str(caught.value)
    with pytest.raises(InputError, match="it has none"):
        window("N1", [])


@pytest.mark.skipif("FEEDSIM_CAPTURE" not in os.environ, reason="FEEDSIM_CAPTURE names no capture")
def test_a_block_of_a_capture(tmp_path: Path) -> None:
    """The rapid that is asked for by its block, on the shipped machine."""
    machine = Path(__file__).resolve().parents[2] / "scenarios" / "machines" / "sinumerik_840d"
    capture = os.environ["FEEDSIM_CAPTURE"]
    words = ["replay", capture, "--machine", str(machine), "--axes", "Y", "--window", "N7 G0", "--quiet"]
    assert main([*words, "--out", str(tmp_path / "out")]) == 0
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert 0 < summary["figures"]["Y.position_rms"]["value"] < 10
    rows = (tmp_path / "out" / "replay.csv").read_text().splitlines()
    assert float(rows[1].split(",")[0]) == pytest.approx(0.408)
    assert float(rows[-1].split(",")[0]) == pytest.approx(0.58)


def test_a_part_without_motion_for_an_inertia_names_its_axis(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Reversals faster than a window of the rigid line: it says which axis, and which options choose others."""
    record = tmp_path / "record.csv"
    angle = [0.1 * math.sin(2 * math.pi * 30 * 0.002 * i) for i in range(500)]
    rows = [f"{0.002 * i:.3f},{q:.6f},{0.99 * q:.6f},{-2 * q:.6f}" for i, q in enumerate(angle)]
    record.write_text("\n".join(["time [s],X.x_s [rad],X.x_a [rad],X.M_a [N.m]", *rows]) + "\n")
    columns = tmp_path / "columns.yaml"
    columns.write_text(
        "time: {column: time, unit: s}\nsetpoint: {column: X.x_s, unit: rad}\nposition: {column: X.x_a, unit: rad}\n"
        "torque: {column: X.M_a, unit: N.m}\npitch: 10 mm\n"
    )
    words = ["identify-drive", str(record), "--axes", "X", "--columns", str(columns)]
    assert main([*words, "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert "feedsim: axis X: " in said, said
    assert "to determine its inertia" in said
    assert "--axes names the axes that move, --window a part of it" in said
    assert not (tmp_path / "out").exists()
