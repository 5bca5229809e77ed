"""Accuracy and repeatability of positioning: letter by letter, over a cycle on the units, and what is refused."""

from __future__ import annotations

import statistics
from pathlib import Path

import numpy as np
import pytest

from feedsim.analysis import Accuracy, evaluate, tasks
from feedsim.foundation.errors import InputError
from feedsim.motions.positioning_cycle import Visits
from feedsim.report.run.report import draw, report_of
from feedsim.scenario import Scenario, load
from feedsim.scenario.loads import TorqueNoise
from feedsim.simulation.cosim import run
from feedsim.simulation.cosim.loads import _random
from feedsim.simulation.judge import judge_run
from feedsim.simulation.nc import plan

ROOT = Path(__file__).resolve().parents[2]
SHIPPED = ROOT / "scenarios" / "z_iso230_2.yaml"
CYCLE = (
    "{kind: positioning_cycle, axis: Z, targets: [101 mm, 99 mm], runs: 3, overrun: 1 mm, feed: 1 m/min, rest: 0.2 s}"
)


def scenario(
    folder: Path, *, motion: str = CYCLE, evaluation: str = "kind: positioning_accuracy", more: str = ""
) -> Scenario:
    text = f"""
name: cycle
machine: {ROOT / "scenarios" / "machines" / "test_centre"}
motions: [{motion}]
recording: {{interval: 2 ms, variables: [Z.x_a, tcp.x_Z]}}
evaluate: [{{{evaluation}}}]
{more}
"""
    file = folder / "cycle.yaml"
    file.write_text(text)
    return load(file)


def sheet(readings: list[tuple[list[float], list[float]]]) -> dict[str, float]:
    """The letters by the standard's formulas, target by target, without arrays: (upwards, downwards) [um]."""
    mean = [(statistics.mean(up), statistics.mean(down)) for up, down in readings]
    s = [(statistics.stdev(up), statistics.stdev(down)) for up, down in readings]
    B = [m[0] - m[1] for m in mean]
    R = [max(2 * d[0] + 2 * d[1] + abs(b), 4 * d[0], 4 * d[1]) for d, b in zip(s, B, strict=True)]
    above = [[m[k] + 2 * d[k] for m, d in zip(mean, s, strict=True)] for k in (0, 1)]
    below = [[m[k] - 2 * d[k] for m, d in zip(mean, s, strict=True)] for k in (0, 1)]
    middle = [(m[0] + m[1]) / 2 for m in mean]
    found = {
        "A": max(above[0] + above[1]) - min(below[0] + below[1]),
        "R": max(R),
        "B": max(map(abs, B)),
        "B_mean": statistics.mean(B),
        "M": max(middle) - min(middle),
        "E": max(map(max, mean)) - min(map(min, mean)),
    }
    for k, side in enumerate(("up", "down")):
        one = [m[k] for m in mean]
        found |= {f"A_{side}": max(above[k]) - min(below[k]), f"R_{side}": 4 * max(d[k] for d in s)}
        found |= {f"E_{side}": max(one) - min(one)}
    return found


@pytest.mark.parametrize("seed", range(5))
def test_letters_are_those_of_the_formulas(seed: int) -> None:
    rng = np.random.default_rng(seed)
    deviations = rng.normal(0, 1e-6, (2, 1, 1)) + rng.normal(0, 1e-6, (2, 6, 1)) + rng.normal(0, 0.5e-6, (2, 6, 5))
    found = Accuracy(tuple(0.1 * k for k in range(6)), deviations).figures
    um = 1e6 * deviations
    expected = sheet([(um[0, i].tolist(), um[1, i].tolist()) for i in range(6)])
    assert {name: figure.value for name, figure in found.items()} == pytest.approx(expected, rel=1e-12)


def test_a_cycle_meets_every_target_from_both_sides(tmp_path: Path) -> None:
    """From where the axis is to below the first target; up, beyond, down, beyond; at rest where it is measured."""
    found = scenario(tmp_path)
    program = plan(found)
    (task,) = tasks(found, program)
    visits = task.visits  # type: ignore[union-attr]
    assert isinstance(visits, Visits)
    assert visits.targets == (0.099, 0.101)
    order = [(each.target, each.sense, each.run) for each in visits.visits]
    one = [(0.099, 1), (0.101, 1), (0.101, -1), (0.099, -1)]
    assert order == [(*each, run) for run in range(3) for each in one]
    time, x_s = np.asarray(program.time), np.asarray(program.x_s["Z"])
    for visit in visits.visits:
        rests = (time >= visit.begin + 0.05) & (time <= visit.end)
        assert visit.end - visit.begin == pytest.approx(0.2)
        assert np.max(np.abs(x_s[rests] - visit.target)) < 1e-9
        # The setpoint has come from that side.
        before = x_s[np.searchsorted(time, visit.begin - 0.05)]
        assert np.sign(visit.target - before) == visit.sense
    assert x_s[-1] == pytest.approx(0.098, abs=1e-9)
    assert (np.min(x_s), np.max(x_s)) == pytest.approx((0.098, 0.102), abs=1e-7)


def test_without_noise_an_axis_repeats_itself(tmp_path: Path, fmus: Path) -> None:
    """The first run has another past than the others, no more; friction leaves little after 0.2 s.
    Noise of the measuring system is what makes R, then, and it is the same again with the same seed."""
    still = judge_run(run(scenario(tmp_path), fmus=fmus))
    figures = evaluate(still)
    assert figures["Z.R_up"].value < 0.05
    assert figures["Z.R_down"].value < 0.05
    assert figures["Z.A"].value < 2.0
    assert {"Z.tool.A", "Z.tool.R", "Z.tool.B"} <= set(figures)
    noisy = scenario(tmp_path, evaluation="kind: positioning_accuracy, noise: 2 um, seed: 3")
    (task,) = tasks(noisy, still.program)
    once, again = (task.figures(still.trace)["R_up"].value for _ in range(2))
    assert once == again
    # 4 s of three readings: between 4 and 20 um in 99 %.
    assert 2.0 < once < 24.0


def test_the_shipped_cycle_is_one() -> None:
    found = load(SHIPPED)
    (task,) = tasks(found, plan(found))
    assert len(task.visits.visits) == 50  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("motion", "told"),
    [
        (CYCLE.replace("101 mm, 99 mm", "99 mm, 99 mm"), "the target 99 mm is given twice"),
        (CYCLE.replace("runs: 3", "runs: 1"), "runs"),
        (CYCLE.replace("axis: Z", "axis: Q"), "no axis 'Q'"),
        (CYCLE.replace("101 mm, 99 mm", "101 mm, 99 m"), "travel"),
        (
            "{kind: dwell, duration: 1 s}",
            "is asked for, but no motion is of kind positioning_cycle",
        ),
    ],
)
def test_what_cannot_be_driven_is_told(motion: str, told: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=told):
        plan(scenario(tmp_path, motion=motion))


def test_a_load_at_random_has_its_size_and_its_corner() -> None:
    """Over an hour: the standard deviation on average over time, the correlation exp(-2 pi f_c t); by its seed."""
    noise = TorqueNoise.model_validate({"rms": "0.3 N.m", "bandwidth": "5 Hz", "seed": 2})
    time, values = _random(noise, 3600.0)
    fine = np.interp(np.arange(0, 3600, 1e-3), time, values)
    assert np.std(fine) == pytest.approx(0.3, rel=0.02)
    later = 30  # ms
    correlation = np.mean(fine[:-later] * fine[later:]) / np.var(fine)
    assert correlation == pytest.approx(np.exp(-2 * np.pi * 5 * 0.03), abs=0.03)
    other = _random(noise.model_copy(update={"seed": 3}), 3600.0)[1]
    assert abs(np.corrcoef(values, other)[0, 1]) < 0.02


def test_the_report_has_the_sheet(tmp_path: Path, fmus: Path) -> None:
    """Every target has its row, the picture every reading, within what is shown at first."""
    found = judge_run(run(scenario(tmp_path), fmus=fmus))
    figures = evaluate(found)
    report = report_of(found, figures, draw(found, figures), {}, [])
    (sheet_of_scale, sheet_of_tool) = (
        part for part in report.main if getattr(part, "anchor", "").startswith("accuracy-Z")
    )
    for section in (sheet_of_scale, sheet_of_tool):
        (table,) = section.parts  # type: ignore[union-attr]
        assert [row[0] for row in table.rows] == ["99", "101"]  # type: ignore[union-attr]
    picture = next(part for part in report.main if getattr(part, "stem", "") == "accuracy-Z")
    (panel,) = picture.chart.panels  # type: ignore[union-attr]
    readings = [curve for curve in panel.curves if curve.dots]
    assert [len(curve.x) for curve in readings] == [6, 6]
    low, high = panel.y.span
    assert all(low <= value <= high for curve in readings for value in curve.y)
