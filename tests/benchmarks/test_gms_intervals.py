"""The count of intervals of Maxwell slip that hold: its records, what is counted, and that a stopped one goes on."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from math import pi
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "benchmarks"), str(ROOT / "tests" / "physics")]
from friction_laws import main  # noqa: E402
from friction_reference import sine  # noqa: E402
from gms_intervals import I_P, INTERVAL, M_0, NAMES, NOISES, SINES, J, Outcome, friction, records, table  # noqa: E402
from gms_reference import solved  # noqa: E402

from feedsim.simulation.cosim.friction_law import FrictionLaw  # noqa: E402


def test_a_record_is_that_of_its_axis(fmus: Path) -> None:
    """Torque, without noise: the law as scipy solves it, inertia and load; noise has its share of the rms."""
    values = friction(np.random.default_rng(5))
    with FrictionLaw(fmus, "friction_gms") as law:
        clean, noisy = (records(law, values, noise, np.random.default_rng(6))[1] for noise in (0.0, 0.05))
    amplitude, frequency, stop = SINES[1]
    w, peak = 2 * pi * frequency, amplitude / I_P
    t = clean.time
    rubbing = np.append(0.0, solved(values, sine(peak * w, frequency, 0.0, stop), t[1:]))
    torque = rubbing + J * peak * w**2 * np.cos(w * t) + M_0
    assert clean.torque == pytest.approx(torque, abs=2e-3 * np.ptp(torque))
    assert np.diff(t) == pytest.approx(INTERVAL)
    assert np.gradient(clean.angle, t)[1:-1] == pytest.approx(clean.speed[1:-1], abs=2e-3 * np.max(clean.speed))
    share = np.std(noisy.torque - clean.torque) / np.sqrt(np.mean(clean.torque**2))
    assert share == pytest.approx(0.05, rel=0.1)


def test_the_table_counts_what_is_estimated() -> None:
    done = [
        Outcome(0.05, 1, 0, off={"sigma_0": 1.95, "C": -3.1}, undetermined=["skew"]),
        Outcome(0.05, 1, 1, off={"sigma_0": -1.97}),
        Outcome(0.05, 1, 2, refused="no motion"),
    ]
    title, _, row = table(done).splitlines()
    assert title == f"| noise | axes | {' | '.join(NAMES)} | all | beyond 3 sigmas |"
    assert row == "| 5 % | 3, 1 refused | 1 of 2 | 0 of 0 | 0 of 0 | 0 of 0 | 0 of 1 | 0 of 0 | 1 of 3 | 1 |"


def test_what_is_there_is_not_drawn_again(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """And a draw of another seed is no draw of this one."""
    done = [Outcome(noise, seed, 0, off={"C": 5.0 * (seed == 2)}) for noise in NOISES for seed in (1, 2)]
    (tmp_path / "intervals.jsonl").write_text("".join(f"{json.dumps(asdict(each))}\n" for each in done))
    assert main(["--intervals", "1", "--jobs", "1", "--out", str(tmp_path)]) == 0
    assert capsys.readouterr().out.count("| 1 of 1 | 0 of 0 | 1 of 1 | 0 |") == len(NOISES)
    assert len((tmp_path / "intervals.jsonl").read_text().splitlines()) == len(done)
