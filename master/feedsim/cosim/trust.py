"""Whether a run's result can be trusted: the energy the coupling lost, the stability of the exchange, active limits."""

from __future__ import annotations

import numpy as np

from feedsim.cosim import wiring
from feedsim.cosim.recording import Recording
from feedsim.cosim.schedule import Cycle
from feedsim.cosim.system import System
from feedsim.scenario import Scenario
from feedsim.structure import Modes

# Of the friction work, and J (an axis at rest has no work to speak of). On the default machine the first-order schemes
# lose up to 4e-5 of it, the second-order ones 2e-7; chatter loses 1e-3 and more.
TRUSTED_SHARE, TRUSTED_ENERGY = 3e-4, 1e-3


def energies(system: System, cycle: Cycle) -> dict[str, float]:
    """Per axis "A.residual", "A.residual_peak" and "A.friction_work" [J]; see :class:`Cycle`."""
    coupling: dict[str, float] = {}
    for i, axis in enumerate(system.axes):
        coupling[f"{axis}.residual"] = float(cycle.residual[i])
        coupling[f"{axis}.residual_peak"] = float(cycle.residual_peak[i])
        coupling[f"{axis}.friction_work"] = float(cycle.dissipated[i])
    return coupling


def warnings(scenario: Scenario, modes: Modes, cycle: Cycle, recording: Recording) -> tuple[str, ...]:
    """What a user should know before believing the result, a sentence each."""
    return (
        *_stability(scenario, modes, cycle),
        *_energy(scenario, recording.system, cycle),
        *_limits(recording),
    )


def _stability(scenario: Scenario, modes: Modes, cycle: Cycle) -> list[str]:
    """Explicit exchange needs a friction slope well below 2 J_inf/h."""
    warnings = []
    for name, axis in scenario.machine.axes.items():
        slope, bound = axis.friction.sigma_1 + axis.friction.sigma_2, 2 * modes.J_inf(name) / cycle.step
        if slope > cycle.scheme.stable_share * bound:
            warnings.append(
                f"axis {name}: sigma_1 + sigma_2 = {slope:.4g} N.m.s/rad is above "
                f"{cycle.scheme.stable_share * bound:.4g}, where scheme {cycle.scheme.name} was found to become "
                f"unstable ({cycle.scheme.stable_share:g} of 2 J_inf/h); use more coupling.substeps"
            )
    return warnings


def _energy(scenario: Scenario, system: System, cycle: Cycle) -> list[str]:
    return [
        f"axis {axis}: the exchange between plant and friction has lost {residual:.3g} J against {work:.3g} J of "
        f"friction work (scheme {cycle.scheme.name}, exchange step {cycle.step * 1e6:.6g} us): it is unstable or too "
        f"coarse, and the result is not to be trusted; try coupling.substeps above {scenario.coupling.substeps}"
        for axis, residual, work in zip(system.axes, cycle.residual_peak, np.abs(cycle.dissipated), strict=True)
        if residual > max(TRUSTED_SHARE * work, TRUSTED_ENERGY)
    ]


def _limits(recording: Recording) -> list[str]:
    return [
        f"axis {axis}: {flag.replace('_', ' ')} in {100 * share:.2g} % of the recorded instants"
        for axis in recording.system.axes
        for flag in ("torque_limited", "voltage_limited")
        if (share := float(np.mean(recording.logs[wiring.controller(axis)].columns()[flag]))) > 0
    ]
