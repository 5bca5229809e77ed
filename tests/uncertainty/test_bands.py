"""Bands and intervals of runs: their coverage, what files have of them, what is refused."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from command_helpers import feedsim
from feedsim.analysis import circularity, tasks
from feedsim.design.uncertainty import cloud_of, curves_of, of_run
from feedsim.scenario import load
from feedsim.simulation import cosim
from identified_sets import CIRCLE, write_set

SHORT = ("motions.0.radius=5 mm",)


@pytest.mark.extensive
def test_bands_hold_what_other_draws_give(tmp_path: Path, fmus: Path) -> None:
    """39 draws hold 95 % of further ones on average. If one value moved all of a curve, the share would have a beta
    distribution of 38 and 2, with a deviation of 3.4 %; eight values move different parts."""
    scenario = load(CIRCLE, [f"machine.axes.Z.friction={write_set(tmp_path, 0.05)}", *SHORT])
    nominal = cosim.run(scenario, fmus=fmus)
    cloud = cloud_of(scenario.machine)
    found = of_run(nominal, cloud, 39, fmus=fmus, progress=lambda what, done, total: None)
    (band,), (task,) = found.bands, tasks(scenario, nominal.program)
    inside, of_G = [], []
    for machine in cloud.draws(60, seed=7):
        done = cosim.run(scenario.model_copy(update={"machine": machine}), program=nominal.program, fmus=fmus)
        ((_, curve),) = curves_of(done).values()
        inside.append((band.low <= curve) & (curve <= band.high))
        low, high = found.figures["XZ.G"]
        of_G.append(low <= float(circularity(done.trace, task.turn)["G"]) <= high)  # type: ignore[union-attr]
    assert 0.90 <= np.mean(inside) <= 0.98
    assert 0.85 <= np.mean(of_G) <= 1.0  # 60 draws: 2.8 % standard deviation more
    assert (band.low <= band.nominal).mean() > 0.95
    # The band is no wider than the spread makes it: the glitch of Z moves by about the 5 % of its friction.
    at_Z = np.argmax(band.nominal)
    assert 0.05 < (band.high - band.low)[at_Z] / band.nominal[at_Z] < 0.4


def test_run_with_intervals(tmp_path: Path, fmus: Path) -> None:
    file = write_set(tmp_path)
    words = ("run", CIRCLE, "--set", f"machine.axes.Z.friction={file}", *(w for s in SHORT for w in ("--set", s)))
    done = feedsim(*words, "--uncertain", "19", "--out", "with", fmus=fmus, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "With what identification leaves open: XZ.G " in done.stdout
    assert "(90 %, 19 draws)" in done.stdout
    summary = json.loads((tmp_path / "with" / "summary.json").read_text())
    low, high = summary["uncertain"]["figures"]["XZ.G"]["value"]
    assert low < summary["figures"]["XZ.G"]["value"] < high
    with (tmp_path / "with" / "bands.csv").open() as text:
        rows = list(csv.DictReader(text))
    assert len(rows) == 1440
    assert all(float(row["from [um]"]) <= float(row["to [um]"]) for row in rows)
    assert "What identification leaves open" in (tmp_path / "with" / "report.html").read_text()
    # Without the option nothing differs.
    assert feedsim(*words, "--out", "without", fmus=fmus, cwd=tmp_path).returncode == 0
    assert not (tmp_path / "without" / "bands.csv").exists()
    plain = json.loads((tmp_path / "without" / "summary.json").read_text())
    assert set(summary) - set(plain) == {"uncertain"}
    same = [(tmp_path / name / "result.csv").read_bytes() for name in ("with", "without")]
    assert same[0] == same[1]


@pytest.mark.extensive
def test_compensation_with_an_uncertain_set(tmp_path: Path, fmus: Path) -> None:
    file = write_set(tmp_path, 0.05)
    done = feedsim(
        "tune", "feedforward", CIRCLE, "--friction", f"Z={file}", "--no-table", "--uncertain", "19", "--out", "out",
        fmus=fmus, cwd=tmp_path,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    found = summary["uncertain"]["figures"]
    assert summary["uncertain"]["drawn_compensation"] == ["Z"]
    # The machine is known, the set is not: nothing varies without compensation, Z does with it.
    assert len(set(found["before.glitch_Z"]["value"])) == 1
    low, high = found["after.glitch_Z"]["value"]
    assert high > low + 0.1
    assert (tmp_path / "out" / "bands.csv").read_text().count("\n") == 1 + 2 * 1440


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["run", CIRCLE, "--uncertain", "39"], "no axis has identified values with intervals"),
        (["run", CIRCLE, "--uncertain", "5"], "--uncertain 5: at least 19 draws are needed"),
        (["compensate", CIRCLE, "--uncertain", "39"], "no axis has identified values with intervals"),
    ],
)
def test_what_is_refused(words: list[str], message: str, tmp_path: Path, fmus: Path) -> None:
    done = feedsim(*words, "--out", "none", fmus=fmus, cwd=tmp_path)
    assert done.returncode != 0
    assert message in done.stderr
    assert not (tmp_path / "none").exists()
