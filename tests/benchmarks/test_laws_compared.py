"""The comparison of friction laws: what is fitted, what is judged, and a record whose law is known."""

from __future__ import annotations

import re
import sys
from math import pi
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "benchmarks"))
from friction_laws import Row, halves, main, summary, table  # noqa: E402

from feedsim.estimation.identify.read import Provenance, RecordedAxis  # noqa: E402
from feedsim.estimation.identify.record import Record  # noqa: E402

I_P, J, F_C, SIGMA_2 = 0.02 / (2 * pi), 0.0164, 1.5, 0.01


def coulomb_record() -> Record:
    """Sines of an axis that has Coulomb and viscous friction and nothing else; 1 % noise."""
    t = np.arange(2000) * 2e-3
    w = 2 * pi * 1.25
    speed, acceleration = 20 * np.sin(w * t), 20 * w * np.cos(w * t)
    torque = J * acceleration + F_C * np.sign(speed) + SIGMA_2 * speed
    torque += 0.01 * np.std(torque) * np.random.default_rng(1).standard_normal(len(t))
    return Record("sine.csv", t, torque, speed=speed, angle=20 / w * (1 - np.cos(w * t)))


def test_a_record_is_cut_in_the_middle_of_its_motion() -> None:
    record = coulomb_record()
    rest = np.zeros(3000)
    longer = Record(
        "late.csv", np.arange(5000) * 2e-3, np.append(rest, record.torque), speed=np.append(rest, record.speed)
    )
    source = Provenance(Path("late.csv"), "", "Z", {}, pitch=0.02)
    case = halves("late", [RecordedAxis((longer,), source)], None, "Z")
    assert len(case.fitted[0]) == pytest.approx(4000, abs=20)
    assert len(case.fitted[0]) + len(case.judged[0]) == 5000
    assert case.options("gms").law == "gms"


def test_the_least_out_of_sample_is_in_bold() -> None:
    rows = [Row("a", "LuGre", 5, 0.02, 0.03, 0.05), Row("a", "GMS", 5, 0.01, 0.02, 0.06), Row("b", "GMS", 1, 1, 1, 1)]
    lines = table(rows).splitlines()[2:]
    assert lines[0] == "| a | LuGre | 5 | 2.00 % | 3.00 % | 5.00 % |"
    assert "**2.00 %**" in lines[1]
    assert "**100.00 %**" in lines[2]
    assert summary(rows[:2]).splitlines() == [
        "| record | LuGre | GMS |", "|---|---|---|", "| a | 3.00, 5.00 | **2.00, 6.00** |"
    ]  # fmt: skip


def test_a_record_of_ones_own(fmus: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Of Coulomb friction the laws without memory leave the noise, 1 %."""
    record = coulomb_record()
    columns = {"time [s]": record.time, "position [m]": record.angle * I_P, "speed [rad/s]": record.speed,
               "torque [N.m]": record.torque}  # fmt: skip
    file = tmp_path / "sine.csv"
    np.savetxt(
        file, np.column_stack([*columns.values()]), delimiter=",", header=",".join(columns), comments="", fmt="%.10g"
    )
    (tmp_path / "columns.yaml").write_text(
        "pitch: 20 mm\ninertia: 0.0164 kg.m^2\ndelay: {torque: 0 ms}\ntime: {column: time}\n"
        "position: {column: position}\nspeed: {column: speed}\ntorque: {column: torque}\n"
    )
    words = [str(file), "--axes", "Z", "--columns", str(tmp_path / "columns.yaml"), "--fmus", str(fmus)]
    assert main(words) == 0
    rows = re.findall(r"^\| sine.csv \| (\w+) \| \d+ \| ([\d.]+) % \| \**([\d.]+) %", capsys.readouterr().out, re.M)
    assert [name for name, *_ in rows] == ["Coulomb", "Stribeck", "LuGre", "GMS"]
    for name, inside, outside in rows:
        # bristles cannot jump: a few rows about each of the reversals are theirs
        most = 1.1 if name in ("Coulomb", "Stribeck") else 10
        assert 0.9 < float(inside) < most, name
        assert 0.9 < float(outside) < most, name
