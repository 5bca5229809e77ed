"""How steep friction may be before explicit exchange with the plant chatters: the bound that the master warns of.

2 J_inf/h is the slope at which a held torque overturns the speed that it answers to within one step; each scheme
reaches a share of it. Here the shares are held to the exchange of a mass and a damper, worked out apart, and to trial.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from feedsim import scenario
from feedsim.scenario.model import SCHEMES
from feedsim.simulation import cosim
from feedsim.simulation.judge import judge_run
from feedsim.structure import checked_modes

MACHINE = Path(__file__).resolve().parents[2] / "scenarios" / "machines" / "test_centre"
THERE_AND_BACK = f"""
name: there and back
machine: {MACHINE}
motions:
  - {{kind: move, by: {{Z: 2 mm}}, feed: 3000 mm/min}}
  - {{kind: move, by: {{Z: -2 mm}}, feed: 3000 mm/min}}
  - {{kind: dwell, duration: 0.1 s}}
recording: {{interval: 125 us, variables: [Z.M_fr]}}
"""


# A step of a mass under a damper's torque m that its speed n answers to, scaled so that m = n without the exchange:
# a = slope h / inertia, d = change of m over the last step, e = change of n over it.


def _extrapolated(a: float, n: float, d: float) -> list[float]:
    reached = n - a * (n + d / 2)
    return [reached, reached - n]


def _iterated(a: float, n: float, d: float) -> list[float]:
    return _extrapolated(a, n, _extrapolated(a, n, d)[1])


def _gauss_seidel(a: float, n: float) -> list[float]:
    return [n - a * n]


def _jacobi(a: float, n: float, m: float) -> list[float]:
    return [n - a * m, n]


def _jacobi_extrapolated(a: float, n: float, m: float, d: float, e: float) -> list[float]:
    reached = n - a * (m + d / 2)
    return [reached, n + e, n + e - m, reached - n]


STEPS: dict[str, tuple[Callable[..., list[float]], int]] = {
    "extrapolated": (_extrapolated, 2),
    "iterated": (_iterated, 2),
    "gauss_seidel": (_gauss_seidel, 1),
    "gauss_seidel_friction_first": (_gauss_seidel, 1),  # who steps first, the mass moves under the torque of its n
    "jacobi": (_jacobi, 2),
    "jacobi_extrapolated": (_jacobi_extrapolated, 4),
    "parallel": (_jacobi, 2),  # the motor torque, which it holds, is not part of the bond
}


@pytest.mark.parametrize("scheme", sorted(SCHEMES))
def test_bound_of_mass_and_damper(scheme: str) -> None:
    """At a reversal the bristle is still bent to the other side, z = -g sgn(n): dz/dt = 2 n, and the slope is
    2 sigma_1. So a = 2 sigma_1 h/J_inf, which is 4 times the share of 2 J_inf/h that sigma_1 has."""
    step, states = STEPS[scheme]
    for of_bound, stable in ((0.999, True), (1.001, False)):
        a = 4 * of_bound * SCHEMES[scheme].stable_share
        matrix = np.array([step(a, *unit) for unit in np.eye(states)]).T
        assert (np.abs(np.linalg.eigvals(matrix)).max() < 1) == stable


# The structure gives way a little where a step is long for its highest modes: what is derived for a mass holds to 20 %.
@pytest.mark.parametrize("scheme", sorted(SCHEMES))
@pytest.mark.parametrize(("of_bound", "chatters"), [(0.95, False), (1.2, True)])
def test_bound_of_the_friction_slope(scheme: str, of_bound: float, chatters: bool, fmus: Path, tmp_path: Path) -> None:
    file = tmp_path / "scenario.yaml"
    file.write_text(THERE_AND_BACK, encoding="utf-8")
    machine = scenario.load(file).machine
    friction = machine.axes["Z"].friction
    bound = SCHEMES[scheme].stable_share * 2 * checked_modes(machine).J_inf("Z") / machine.cycles.T_c
    sigma_1 = of_bound * bound - friction.sigma_2
    overrides = [f"coupling.scheme={scheme}", f"machine.axes.Z.friction.sigma_1={sigma_1!r} N.m.s/rad"]
    result = judge_run(cosim.run(scenario.load(file, overrides), fmus=fmus))
    # A torque that goes from -F_S to F_S and back from cycle to cycle has this second difference: more is chatter. Two
    # passes drift apart without it, and the energy tells.
    largest = 4 * friction.F_S
    chattered = np.abs(np.diff(result.trace["Z.M_fr"], 2)).max() > largest
    told = [finding.code for finding in result.warnings]
    lost = "exchange-loses-energy" in told
    assert (lost if scheme == "iterated" else chattered) == chatters
    assert ("exchange-unstable" in told) == chatters


def test_residual_over_time(fmus: Path, tmp_path: Path) -> None:
    """Recorded where asked for; its end is the summary's. It tells when an exchange went wrong."""
    file = tmp_path / "scenario.yaml"
    file.write_text(THERE_AND_BACK, encoding="utf-8")
    asked = ["recording.variables=[Z.n_ffw, '*.residual']"]
    sound = judge_run(cosim.run(scenario.load(file, asked), fmus=fmus))
    assert [name for name in sound.trace if name.endswith("residual")] == ["X.residual", "Y.residual", "Z.residual"]
    residual = sound.trace["Z.residual"]
    assert sound.trace.unit("Z.residual") == "J"
    assert residual[0] == 0
    for axis in "XYZ":
        assert sound.trace[f"{axis}.residual"][-1] == sound.coupling[f"{axis}.residual"]
    assert np.abs(residual).max() == sound.coupling["Z.residual_peak"]  # recorded at every cycle
    assert "Z.residual" not in cosim.run(scenario.load(file, ["recording={}"]), fmus=fmus).trace

    # Half as much contact damping again as the exchange bears: it goes wrong where the axis turns about, not before.
    steep = judge_run(
        cosim.run(scenario.load(file, [*asked, "machine.axes.Z.friction.sigma_1=45 N.m.s/rad"]), fmus=fmus)
    )
    wrong = np.flatnonzero(np.abs(steep.trace["Z.residual"]) > 1e-2)[0]
    turned = np.flatnonzero(steep.trace["Z.n_ffw"] < -1e-3)[0]
    settled = 0.02  # s, of the position loop behind its setpoint
    assert abs(steep.trace.time[wrong] - steep.trace.time[turned]) < settled
