"""Whether the exchange between plant and friction is stable: ahead by their parameters, afterwards by the energy."""

from __future__ import annotations

from collections.abc import Sequence

from feedsim.cosim import Run
from feedsim.linear.judgement import Loop
from feedsim.scenario import ForeignUnit, Scenario
from feedsim.scenario.coupling import SCHEMES
from feedsim.structure import Modes

# Of the friction work, and J (an axis at rest has no work to speak of). On the default machine the first-order schemes
# lose up to 5e-5 of it, the second-order ones 2e-7; chatter loses 1e-3 and more.
TRUSTED_SHARE, TRUSTED_ENERGY = 3e-4, 1e-3


def exchange_stability(scenario: Scenario, modes: Modes) -> list[str]:
    """Explicit exchange needs a friction slope well below 2 J_inf/h."""
    scheme = SCHEMES[scenario.coupling.scheme]
    step = scenario.machine.cycles.T_c / scenario.coupling.substeps
    warnings: list[str] = []
    unknown = [name for name, axis in scenario.machine.axes.items() if isinstance(axis.friction, ForeignUnit)]
    if unknown:
        warnings.append(
            f"axis {', '.join(unknown)}: how steeply another maker's friction rises with the speed is not known: "
            f"nothing shows ahead whether scheme {scheme.name} is stable with it, the energy residual of the run does"
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


def energy(run: Run, loops: Sequence[Loop]) -> list[str]:
    """The coupling is blamed where nothing else is known to make an axis chatter."""
    coupling = run.scenario.coupling
    step = run.scenario.machine.cycles.T_c / coupling.substeps
    if any(loop.growing for loop in loops):
        why = "that is a consequence of the unstable control loop, and says nothing of the coupling"
    else:
        why = (
            "it is unstable or too coarse, and the result is not to be trusted; try coupling.substeps above "
            f"{coupling.substeps}"
        )
    return [
        f"axis {axis}: the exchange between plant and friction has lost {residual:.3g} J against {work:.3g} J of "
        f"friction work (scheme {coupling.scheme}, exchange step {step * 1e6:.6g} us): {why}"
        for axis in run.scenario.machine.axes
        for residual, work in [(run.coupling[f"{axis}.residual_peak"], abs(run.coupling[f"{axis}.friction_work"]))]
        if residual > max(TRUSTED_SHARE * work, TRUSTED_ENERGY)
    ]
