"""Whether a run's result can be trusted: the energy the coupling lost, the stability of the exchange, active limits."""

from __future__ import annotations

import numpy as np

from feedsim.cosim.recording import Recording
from feedsim.cosim.schedule import SCHEMES, Cycle
from feedsim.cosim.system import System
from feedsim.scenario import ForeignUnit, Scenario
from feedsim.structure import Modes

# Of the friction work, and J (an axis at rest has no work to speak of). On the default machine the first-order schemes
# lose up to 5e-5 of it, the second-order ones 2e-7; chatter loses 1e-3 and more.
TRUSTED_SHARE, TRUSTED_ENERGY = 3e-4, 1e-3
LOAD_TAKEN_UP = 1.0  # s; position and speed controller together settle in some tenths of it


def energies(system: System, cycle: Cycle) -> dict[str, float]:
    """Per axis "A.residual", "A.residual_peak" and "A.friction_work" [J]; see feedsim.cosim.operations.Bond."""
    coupling: dict[str, float] = {}
    for i, axis in enumerate(system.axes):
        coupling[f"{axis}.residual"] = float(cycle.bond.residual[i])
        coupling[f"{axis}.residual_peak"] = float(cycle.bond.residual_peak[i])
        coupling[f"{axis}.friction_work"] = float(cycle.bond.dissipated[i])
    return coupling


def foreseen(scenario: Scenario, modes: Modes) -> tuple[str, ...]:
    """What the parameters alone tell a user to doubt, a sentence each."""
    return (*_stability(scenario, modes), *_unbalanced_loads(scenario))


def found(scenario: Scenario, cycle: Cycle, recording: Recording) -> tuple[str, ...]:
    """What the run itself tells a user to doubt, a sentence each."""
    return (*_energy(scenario, cycle.system, cycle), *_limits(recording))


def _stability(scenario: Scenario, modes: Modes) -> list[str]:
    """Explicit exchange needs a friction slope well below 2 J_inf/h."""
    scheme = SCHEMES[scenario.coupling.scheme]
    step = scenario.machine.cycles.T_c / scenario.coupling.substeps
    warnings: list[str] = []
    unknown = [name for name, axis in scenario.machine.axes.items() if isinstance(axis.friction, ForeignUnit)]
    if unknown:
        warnings.append(
            f"axis {', '.join(unknown)}: how steeply another maker's friction rises with the speed is not known: "
            f"nothing tells ahead whether scheme {scheme.name} is stable with it, the energy residual of the run does"
        )
    for name, axis in scenario.machine.axes.items():
        friction = axis.friction
        if isinstance(friction, ForeignUnit):
            continue
        slope, bound = friction.sigma_1 + friction.sigma_2, 2 * modes.J_inf(name) / step
        if slope > scheme.stable_share * bound:
            warnings.append(
                f"axis {name}: sigma_1 + sigma_2 = {slope:.4g} N.m.s/rad is above "
                f"{scheme.stable_share * bound:.4g}, where scheme {scheme.name} becomes unstable at a reversal "
                f"({scheme.stable_share:g} of 2 J_inf/h); use more coupling.substeps"
            )
    return warnings


def _unbalanced_loads(scenario: Scenario) -> list[str]:
    """The drive's integrators start empty: an axis under load sags before it holds."""
    if scenario.motions[0].held >= LOAD_TAKEN_UP:
        return []
    return [
        f"axis {name}: the constant load of {axis.M_0:g} N.m is not carried at the start, the axis sags while the "
        f"drive takes it up; put a dwell of {LOAD_TAKEN_UP:g} s ahead of the first motion"
        for name, axis in scenario.machine.axes.items()
        if axis.M_0 != 0
    ]


def _energy(scenario: Scenario, system: System, cycle: Cycle) -> list[str]:
    bond = cycle.bond
    return [
        f"axis {axis}: the exchange between plant and friction has lost {residual:.3g} J against {work:.3g} J of "
        f"friction work (scheme {cycle.scheme.name}, exchange step {cycle.step * 1e6:.6g} us): it is unstable or too "
        f"coarse, and the result is not to be trusted; try coupling.substeps above {scenario.coupling.substeps}"
        for axis, residual, work in zip(system.axes, bond.residual_peak, np.abs(bond.dissipated), strict=True)
        if residual > max(TRUSTED_SHARE * work, TRUSTED_ENERGY)
    ]


def _limits(recording: Recording) -> list[str]:
    return [
        f"axis {axis}: {flag.replace('_', ' ')} in {100 * share:.2g} % of the recorded instants"
        for axis, _, flag in (limit.partition(".") for limit in recording.limited)
        if (share := recording.share(f"{axis}.{flag}")) > 0
    ]
