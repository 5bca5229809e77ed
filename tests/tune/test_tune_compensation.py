"""Tuning of friction compensations: pairs, characteristic, the search on a grid with a known answer, the command."""

from __future__ import annotations

import csv
import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
import yaml

from agreement_helpers import assert_numbers_agree
from command_helpers import feedsim
from feedsim.design.tune import circles as circles_module
from feedsim.design.tune import compensators as compensation
from feedsim.design.tune.circles import Circles, Contour, Pair, extremes, practical, size, tuned_on
from feedsim.design.tune.compensators import AMPLITUDE_SHARES, TIME_CONSTANTS, PulseGrid, amplitude, pulse, score, tune
from feedsim.design.tune.knobs import effects_of, frictionless, set_compensation
from feedsim.scenario import Machine, load
from feedsim.structure import checked_modes
from identified_sets import write_set

CIRCLE = Path(__file__).resolve().parents[2] / "scenarios" / "xz_circle.yaml"
PLANE = ("X", "Z")


def test_pairs_of_the_practical_range() -> None:
    pairs = practical(load(CIRCLE).machine, PLANE)
    assert all(0.01 <= pair.feed**2 / pair.radius <= 2.0 for pair in pairs)
    assert [pair.acceleration for pair in pairs] == sorted(pair.acceleration for pair in pairs)
    assert len(pairs) == 19
    tuned = tuned_on(pairs)
    assert not set(tuned) & set(pairs)
    assert sum(pair.duration for pair in tuned) < 0.3 * sum(pair.duration for pair in pairs)


def test_short_circles_keep_within_the_travel() -> None:
    """A slide of 25 mm has room for radii of 5 and 10 mm, not for three times the smallest one."""
    pairs = [Pair(radius, feed / 60) for radius in (0.005, 0.01) for feed in (0.5, 1.0, 2.0, 5.0)]
    pairs.sort(key=lambda pair: pair.acceleration)
    tuned = tuned_on(pairs)
    assert len(tuned) >= 8
    assert max(pair.radius for pair in tuned) <= 0.01
    assert max(pair.feed for pair in tuned) <= 5.0 / 60 * (1 + 1e-9)


def test_a_compensation_that_the_machine_has_is_taken_off_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """No run sees it, neither without nor with what is tried; values and errors are those of a machine without."""
    pairs = [Pair(0.005, feed / 60) for feed in (0.5, 1.0, 2.0, 5.0)]
    monkeypatch.setattr(compensation, "practical", lambda machine, plane: pairs)
    seen = []

    angle = np.linspace(-math.pi, math.pi, 360, endpoint=False)

    def contours(circles: Circles, machine: Machine, **named: object) -> tuple[Contour, ...]:
        pulse = machine.axes["Z"].drive.friction_pulse
        seen.append(0.0 if pulse is None else float(pulse.amplitude))
        level = 0.0 if machine.axes["Z"].friction.F_C < 1e-3 else 1.0 + abs(1.0 - seen[-1] / 1e-4)
        peaks = level * np.maximum(0.0, np.cos(4 * angle)) ** 9
        return tuple(Contour(angle, peaks) for _ in circles.pairs)

    monkeypatch.setattr(Circles, "contours", contours)
    present = ["amplitude=7e-5 m/s", "time=0.05 s"]
    found = []
    for more in ([], [f"machine.axes.Z.drive.friction_pulse.{each}" for each in present]):
        seen.clear()
        judged = tune(load(CIRCLE, more), "pulse", PLANE, ("Z",), "ratio", fmus=None, progress=lambda *_: None)
        assert seen[0] == 0.0
        found.append((judged.found.values, judged.held_errors.before.tolist(), tuple(seen)))
    assert found[0] == found[1]


def test_the_law_is_that_of_the_given_archives(monkeypatch: pytest.MonkeyPatch, fmus: Path) -> None:
    scenario = load(CIRCLE)
    circles = Circles.of(scenario, PLANE, [Pair(0.005, 1.0 / 60)])
    monkeypatch.setattr("feedsim.simulation.cosim.friction_law.fmus_directory", lambda: Path("nowhere"))
    assert set(compensation._feedforward(circles, scenario.machine, ("Z",), fmus)) == {"Z"}


def test_errors_are_those_of_the_contour(fmus: Path) -> None:
    """Against another way from the same trace: extremes about the reversals found from the setpoints' speeds."""
    scenario = load(CIRCLE)
    pair = Pair(0.015, 0.05)
    circles = Circles.of(scenario, PLANE, [pair])
    errors = circles.errors(scenario.machine, fmus=fmus)
    assert errors.shape == (1, 2, 2)
    # The shipped circle of that radius and feed has glitches of 4.84 and 7.90 um in the middle of its three turns.
    assert 1e6 * errors[0, :, 0] == pytest.approx([4.84, 7.90], rel=0.03)
    assert (errors[..., 1] < 0).all()


def test_characteristic_of_the_manual() -> None:
    values = {
        "adaptation": True, "amplitude": 3e-4, "amplitude_min": 8e-4, "acceleration_1": 0.02, "acceleration_2": 0.1,
        "acceleration_3": 0.5,
    }  # fmt: skip
    a = np.array([0.005, 0.02, 0.07, 0.3, 0.5, 9.0])
    assert amplitude(values, a) == pytest.approx([0.75e-4, 3e-4, 3e-4, 5.5e-4, 8e-4, 8e-4], rel=1e-12)
    assert amplitude({"amplitude": 3e-4}, a) == pytest.approx(np.full(6, 3e-4))


def made_grid(best: np.ndarray, time: float) -> PulseGrid:
    """Peaks fall and dips grow with the amplitude, alike at `best` (pairs,), and least at the time constant `time`."""
    share = np.array(AMPLITUDE_SHARES)[:, None, None]
    late = 0.1 * np.abs(np.log(np.array(TIME_CONSTANTS) / time))[None, :, None]
    peak = 1.0 - 0.9 * share / best + late
    dip = -(0.1 * share / best + late)
    errors = np.stack([peak, dip], axis=-1)
    errors[0, :, :, :] = [1.0, 0.0]
    return PulseGrid((1.0, 1.0), np.repeat(errors[:, :, :, None, :], 2, axis=3))


def test_the_search_finds_a_characteristic() -> None:
    a = np.geomspace(0.01, 2.0, 12)
    wanted = {"adaptation": True, "amplitude": 0.3, "amplitude_min": 0.7, "acceleration_1": 0.03}
    wanted |= {"acceleration_2": 0.1, "acceleration_3": 0.6}
    grid = made_grid(amplitude(wanted, a), TIME_CONSTANTS[3])
    found = pulse(grid, 0, a, "ratio", adapted=True)
    assert found["time"] == pytest.approx(TIME_CONSTANTS[3], rel=0.05)
    assert amplitude(found, a) == pytest.approx(amplitude(wanted, a), rel=0.1)
    constant = pulse(grid, 0, a, "ratio", adapted=False)

    def worth(values: dict[str, float | bool]) -> float:
        errors = grid.sizes(0, amplitude(values, a)[None], np.array([values["time"]]))
        return float(score(errors, errors, "ratio")[0])

    assert worth(found) < worth(constant)


def test_interpolation_on_the_grid() -> None:
    grid = made_grid(np.array([0.5, 0.5]), TIME_CONSTANTS[3])
    at = np.array([[0.5 * (AMPLITUDE_SHARES[1] + AMPLITUDE_SHARES[2]), AMPLITUDE_SHARES[4]]])
    time = np.array([math.sqrt(TIME_CONSTANTS[2] * TIME_CONSTANTS[3])])
    by_hand = [
        np.mean([size(grid.errors[i, j, 0, 0]) for i in (1, 2) for j in (2, 3)]),
        np.mean([size(grid.errors[4, j, 1, 0]) for j in (2, 3)]),
    ]
    assert grid.sizes(0, at, time)[0] == pytest.approx(by_hand, rel=1e-12)


def test_objectives() -> None:
    ratios, errors = np.array([[0.2, 0.5]]), np.array([[4e-6, 1e-6]])
    assert score(ratios, errors, "worst")[0] == 0.5
    assert score(ratios, errors, "largest")[0] == 4e-6
    assert 0.35 < score(ratios, errors, "ratio")[0] < 0.5


def test_a_compensation_is_a_part_of_the_drive() -> None:
    machine = load(CIRCLE).machine
    own = set_compensation(machine, "Z", "friction_pulse", {"amplitude": 1e-4, "time": 0.03})
    parameters = own.axes["Z"].drive.parameters()
    assert parameters["friction_pulse.amplitude"] == 1e-4
    assert parameters["friction_pulse.time"] == 0.03
    assert own.axes["X"] is machine.axes["X"]


@pytest.fixture
def few_circles(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(circles_module, "RADII", (0.005, 0.01))
    monkeypatch.setattr(circles_module, "FEEDS", tuple(feed / 60 for feed in (1.0, 2.0, 5.0)))
    monkeypatch.setattr(circles_module, "COUNT", 2)


@pytest.mark.usefixtures("few_circles")
def test_the_command_leaves_values_that_a_scenario_takes(fmus: Path, tmp_path: Path) -> None:
    command = ("tune", "compensation", CIRCLE, "--kind", "pulse", "--out", "r")
    done = feedsim(*command, fmus=fmus, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert re.search(
        r"^  X: MD32520 FRICT_COMP_CONST_MAX\S* \(friction_pulse.amplitude\) 0 -> \d", done.stdout, re.MULTILINE
    )
    assert_numbers_agree(tmp_path / "r")
    summary = json.loads((tmp_path / "r/summary.json").read_text())
    assert summary["figures"]["held_out.median"]["value"] > 35
    rows = list(csv.DictReader((tmp_path / "r/sheet.csv").open(newline="")))
    pulse_x = next(row for row in rows if row["axis"] == "X" and row["number"] == "MD32520")
    changes = yaml.safe_load((tmp_path / "r/settings.yaml").read_text())["set"]
    scenario = load(CIRCLE, [f"{key}={value}" for key, value in changes.items()])
    found = scenario.machine.axes["X"].drive.friction_pulse.amplitude  # type: ignore[attr-defined]
    assert found * 60000 == pytest.approx(float(pulse_x["new"]), rel=1e-5)
    assert summary["values"]["X"]["amplitude"] == pytest.approx(found, rel=1e-12)


@pytest.mark.extensive
@pytest.mark.usefixtures("few_circles")
def test_the_model_takes_nearly_all_off(fmus: Path, tmp_path: Path) -> None:
    done = feedsim("tune", "compensation", CIRCLE, "--kind", "model", "--out", "m", fmus=fmus, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    figures = json.loads((tmp_path / "m/summary.json").read_text())["figures"]
    assert figures["held_out.median"]["value"] > 95
    # On this machine nearly all of the error is friction's.
    for key in ("median", "worst"):
        part = figures[f"held_out.friction_{key}"]["value"]
        assert part == pytest.approx(figures[f"held_out.{key}"]["value"], abs=5)
        assert part > 98
    assert 50 < figures["friction+.worst"]["value"] < 95
    assert 50 < figures["friction-.worst"]["value"] < 95


def test_what_is_not_friction_is_named(fmus: Path) -> None:
    """Unequal T_sym make a servo mismatch that grows with the square of the speed; the run without friction has it."""
    few = [Pair(0.005, 0.5 / 60), Pair(0.005, 5 / 60)]
    scenario = load(CIRCLE, ["machine.axes.Z.drive.T_sym=6 ms"])
    circles = Circles.of(scenario, PLANE, few)
    free = size(circles.errors(frictionless(scenario.machine, PLANE), fmus=fmus))
    # The other axis is at a and this one, late by tau, at b: the radius is off by r omega tau/2 sin(2 angle), which the
    # octant beside a reversal has whole.
    tau = 6e-3 - 3.528e-3
    expected = [pair.feed * tau / 2 for pair in few]
    assert free[:, 0] == pytest.approx(expected, rel=0.1)
    none = frictionless(load(CIRCLE, ["machine.axes.Z.guide={share: 30 %}"]).machine, ["Z"]).axes["Z"]
    assert none.guide is None
    assert none.friction.F_S < 1e-5


def test_the_part_of_friction(fmus: Path) -> None:
    """Of a servo mismatch and friction that act together: what remains without the former is what friction does alone.

    The radius of a path (a cos p, b sin(p + d)) less that of the same path with a small further deviation is that
    deviation's radial part, whatever the ellipse.
    """
    angle = np.linspace(-math.pi, math.pi, 2000, endpoint=False)
    ellipse = 30e-6 * np.sin(2 * angle + 0.3)
    peak = 5e-6 * np.exp(-(((angle - 0.05) / 0.03) ** 2))  # beside the reversal of the first axis
    both, free = Contour(angle, ellipse + peak), Contour(angle, ellipse)
    own = extremes([both], [free])
    assert own[0, 0] == pytest.approx([5e-6, 0.0], rel=1e-3, abs=1e-12)
    assert size(extremes([both]))[0, 0] > 25e-6

    # In the machine: unequal T_sym change the whole error of a fast circle several times, friction's part little.
    pair = [Pair(0.005, 2 / 60)]
    parts, wholes = [], []
    for T_sym in ("3.528 ms", "4.5 ms"):
        scenario = load(CIRCLE, [f"machine.axes.Z.drive.T_sym={T_sym}"])
        circles = Circles.of(scenario, PLANE, pair)
        with_friction = circles.contours(scenario.machine, fmus=fmus)
        without = circles.contours(frictionless(scenario.machine, PLANE), fmus=fmus)
        parts.append(size(extremes(with_friction, without))[0])
        wholes.append(size(extremes(with_friction))[0])
    assert (wholes[1] > 2 * wholes[0]).all()
    assert parts[1] == pytest.approx(parts[0], rel=0.1)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--kind", "neural"), "--kind neural: of pulse, pulse_characteristic, table, model"),
        (("--objective", "mean"), "--objective mean: of ratio, worst, largest"),
        (("--axes", "X,Y"), "no axis 'Y'"),
        (("--set", "motions=[{kind: dwell, duration: 1 s}]", "--set", "evaluate=[]"), "has no circle"),
    ],
)
def test_bad_input(words: tuple[str, ...], message: str, fmus: Path, tmp_path: Path) -> None:
    done = feedsim("tune", "compensation", CIRCLE, *words, "--out", "r", fmus=fmus, cwd=tmp_path)
    assert done.returncode == 2
    assert message in done.stderr
    assert not (tmp_path / "r").exists()


@pytest.mark.parametrize("pair", [Pair(0.005, 5 / 60), Pair(0.2, 10 / 60), Pair(0.005, 0.5 / 60)])
def test_the_turn_that_counts_begins_behind_the_run_in(pair: Pair) -> None:
    """By the setpoints: 0.2 s before it begins, the path has its speed; both axes reverse twice within it."""
    scenario = load(CIRCLE)
    circles = Circles.of(scenario, PLANE, [pair])
    ((begin, end),) = circles.turns
    assert end - begin == pytest.approx(pair.duration, rel=1e-3)
    time = circles.program.time
    speed = np.hypot(*(np.gradient(circles.program.x_s[axis], time) for axis in PLANE))
    steady = (time > begin - 0.2 + 2e-3) & (time < end)
    assert speed[steady] == pytest.approx(np.full(steady.sum(), pair.feed), rel=2e-3)


def test_effects_of_other_machines() -> None:
    """Each changes what its words name, on the axes that are asked for; an axis keeps an effect that it has."""
    machine = load(CIRCLE).machine
    found = {effect.name: changed for effect, changed in effects_of(machine, ["Z"])}
    assert list(found) == ["friction+", "friction-", "worn", "warm", "guide", "cogging", "play"]
    assert all(changed.axes["X"] is machine.axes["X"] for changed in found.values())
    before = machine.axes["Z"]
    assert pytest.approx(1.2 * before.friction.F_S) == found["friction+"].axes["Z"].friction.F_S
    assert pytest.approx(2 * before.friction.W) == found["worn"].axes["Z"].friction.W
    assert found["guide"].axes["Z"].guide.share == 0.5  # type: ignore[union-attr]
    cogging = found["cogging"].axes["Z"].drive.cogging_1  # type: ignore[attr-defined]
    assert (cogging.order, cogging.amplitude) == (10.0, pytest.approx(0.1 * before.friction.F_C))
    contact = found["play"].axes["Z"].transmission  # measured directly
    assert contact is not None
    omega = math.sqrt(contact.stiffness * before.I_P**2 / contact.inertia)
    assert (contact.play, omega) == (2e-6, pytest.approx(2 * math.pi * 300, rel=1e-12))
    assert contact.damping == pytest.approx(2 * 0.1 * contact.stiffness / omega, rel=1e-12)
    modes = checked_modes(machine)
    assert contact.inertia == pytest.approx(0.5 * modes.J_inf("Z"), rel=1e-12)
    assert len(checked_modes(found["play"]).frequency) == len(modes.frequency) + 1
    assert found["play"].axes["Z"].play == 0.0
    indirect = load(CIRCLE, ["machine.axes.Z.drive.measuring={indirect: true}"]).machine
    assert [changed.axes["Z"].play for effect, changed in effects_of(indirect, PLANE) if effect.name == "play"] == [
        2e-6
    ]
    joined = load(
        CIRCLE, ["machine.axes.Z.transmission.stiffness=400 N/um", "machine.axes.Z.transmission.inertia=0.003 kg.m2"]
    )
    assert "play" not in [effect.name for effect, _ in effects_of(joined.machine, ["Z"])]
    own = load(CIRCLE, ["machine.axes.Z.guide={share: 30 %}"]).machine
    assert "guide" not in [effect.name for effect, _ in effects_of(own, ["Z"])]


@pytest.mark.extensive
@pytest.mark.usefixtures("few_circles")
def test_a_compensation_is_judged_on_draws(fmus: Path, tmp_path: Path) -> None:
    """A friction set of 10 % doubt: the model, which takes nearly all off, leaves what the draws differ by."""
    file = write_set(tmp_path, 0.1)
    done = feedsim(
        "tune", "compensation", CIRCLE, "--kind", "model", "--axes", "Z", "--set", f"machine.axes.Z.friction={file}",
        "--uncertain", "19", "--out", "u", fmus=fmus, cwd=tmp_path,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "With what identification leaves open: median " in done.stdout
    figures = json.loads((tmp_path / "u/summary.json").read_text())["figures"]
    low, high = (figures[f"held_out.median_{end}"]["value"] for end in ("from", "to"))
    assert 50 < low < high <= figures["held_out.median"]["value"] + 0.5
    assert low < 92
    page = (tmp_path / "u/report.html").read_text()
    assert "With other effects of the machine" in page
    assert "draws of identified values" in page
