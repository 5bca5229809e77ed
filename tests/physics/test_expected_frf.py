"""Frequency responses of the default machine against figures known from elsewhere, and measured against closed form.

The figures were made by prototypes that share no code with this one; they are given to four digits, the tolerances are
those that were asked for. All numbers are of the synthetic default machine.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from feedsim.analysis import Figure, linear
from feedsim.analysis.campaign import Plan, run_campaign
from feedsim.analysis.linear import LinearResult, LinearSystem, Pair
from feedsim.analysis.responses import agreement
from feedsim.structure import checked_modes
from scenario_helpers import default_machine

AXES = ("X", "Y", "Z")


@pytest.fixture(scope="module")
def system() -> LinearSystem:
    machine = default_machine()
    return LinearSystem(machine, checked_modes(machine))


@pytest.fixture(scope="module")
def result(system: LinearSystem) -> LinearResult:
    return linear.evaluate(system)


def near(pairs: tuple[Pair, ...], resonance: float) -> Pair:
    return min(pairs, key=lambda pair: abs(pair.resonance.frequency - resonance))


@pytest.mark.parametrize(
    ("axis", "antiresonance", "resonance"), [("Z", 119.3, 131.8), ("Z", 175.3, 188.0), ("X", 85.2, 94.8)]
)
def test_pairs_of_anti_resonance_and_resonance(
    result: LinearResult, axis: str, antiresonance: float, resonance: float
) -> None:
    of_axis = result.axes[axis]
    # of the structure alone, and as the speed-controlled system shows them with the other axes under control
    for pairs in (of_axis.structure_pairs, of_axis.pairs):
        pair = near(pairs, resonance)
        assert pair.antiresonance.frequency == pytest.approx(antiresonance, rel=0.005)
        assert pair.resonance.frequency == pytest.approx(resonance, rel=0.005)


def test_the_bed_rocks_under_the_z_drive(result: LinearResult) -> None:
    for pairs in (result.axes["Z"].structure_pairs, result.axes["Z"].pairs):
        assert near(pairs, 22.3).resonance.frequency == pytest.approx(22.3, rel=0.005)


@pytest.mark.parametrize("axis", AXES)
def test_at_low_frequencies_an_axis_is_its_inertia(result: LinearResult, axis: str) -> None:
    assert result.axes[axis].low_deviation < 0.01


@pytest.mark.parametrize(("axis", "bandwidth"), [("X", 21.5), ("Y", 31.0), ("Z", 72.0)])
def test_bandwidth_of_the_speed_loop(result: LinearResult, axis: str, bandwidth: float) -> None:
    speed = result.axes[axis].speed
    assert speed is not None
    assert speed.bandwidth.first == pytest.approx(bandwidth, rel=0.02)
    assert speed.bandwidth.last > speed.bandwidth.first


@pytest.mark.parametrize("axis", AXES)
def test_delay_of_the_speed_loop_is_that_of_its_reference_model(
    result: LinearResult, system: LinearSystem, axis: str
) -> None:
    drive, speed = system.machine.axes[axis].drive, result.axes[axis].speed
    assert speed is not None
    assert drive.D is not None
    assert drive.omega_0 is not None
    # the delay is read from the phase at 0.1 Hz, where a term of third order, (0.1/20)^2, is left of the curvature
    assert speed.delay == pytest.approx(2 * drive.D / drive.omega_0, rel=1e-4)


def test_all_loops_are_stable(result: LinearResult) -> None:
    assert result.unstable_poles == 0


@pytest.mark.parametrize(("signal", "inject"), [("multisine", "n_add"), ("prbs", "M_add")])
def test_measured_on_the_units_is_the_closed_form(system: LinearSystem, fmus: Path, signal: str, inject: str) -> None:
    plan = Plan(signal=signal, inject=inject, tool=signal == "multisine", settle=1)  # type: ignore[arg-type]
    axes = AXES if signal == "multisine" else ("Z",)
    figures: dict[str, Figure] = agreement(system, run_campaign(system.machine, axes, plan, fmus=fmus))
    assert {name.rpartition(".")[0] for name in figures} >= {f"{axis}.{q}" for axis in axes for q in ("n_M", "x_M")}
    assert ("tool.compliance_X.measured_magnitude" in figures) == plan.tool
    for name, figure in figures.items():
        limit = {"dB": 0.1, "deg": 1.0}.get(figure.unit)
        if limit is None:
            assert figure.value > 99, f"{name}: {figure.value} % of the lines count"
        else:
            assert figure.value < limit, f"{name}: {figure}"
