"""Which moves are missing for which parameter, in words.

Which moves determine what (the reasoning behind the recommended sets):

- sigma_0 acts right after every reversal; any move of a few micrometres shows it.
- W and gamma act while the drive train engages anew after a reversal: the travel must cover a good part of W for W,
  nearly all of it for gamma, which else looks like a smaller sigma_0.
- sigma_1 acts on the rate of deflection, sigma_1 dz/dt: it needs speed while the bristles still stick, which is a high
  frequency at a small amplitude.
- A torque channel that is late by tau shifts the torque by -tau dM/dt. In pre-sliding M = k sigma_0 z, so it looks like
  a damping of -tau k sigma_0: for small moves the delay and sigma_1 are one and the same. They part in what makes the
  torque change without deflecting bristles: the inertia of a move that slides. J dn/dt of amplitude J A omega^2 / I_P
  shows the delay as a torque of tau J A omega^3 / I_P, so the frequency counts in the third power. Two things limit it:
  noise is a share of the torque, so that a loud move in the record of the quiet ones drowns those (a record of its own
  does not); and the first mode of the structure, below whose frequency omega_1 alone the axis is an inertia. The mode
  adds a share (omega/omega_1)^2 to J and, by its damping D, a lag of about 2 D (omega/omega_1)^3 of that share, which
  passes for a delay of 2 D omega^2/omega_1^3 times the share of mass that it carries.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from feedsim.identify.result import Estimate, Stretch

# Amplitudes at the slide [m] from which on a parameter shows, and the frequency [Hz] for the damping.
LEAST_W = 20e-6
LEAST_GAMMA = 50e-6
LEAST_FREQUENCY = 5.0
# The same without a lead: over the deflection F_S/sigma_0 at which the bristles give way (20 um of some 22 um).
DEFLECTIONS_W = 0.9
DEFLECTIONS_GAMMA = 2.25
# Standard deviations, of the value, up to which nothing needs to be said.
GOOD_RELATIVE_SIGMA = {"sigma_0": 0.02, "W": 0.03, "gamma": 0.03, "sigma_1": 0.06}
EXCELLENT = 1 / 3  # of those: better than that, nothing is said at all
TOLERANCE = 0.75  # the axis follows small sines only in part: 20 um that are commanded are some 19, 5 um are 4


def advice(
    stretches: Sequence[Stretch],
    estimates: Mapping[str, Estimate],
    without_delay: Mapping[str, float],
    deflection: float,
    I_P: float | None = None,
) -> tuple[str, ...]:
    """A sentence for each parameter that the moves do not show well.

    Args:
        deflection: F_S/sigma_0 [rad].
        I_P: lead [m/rad]; without it amplitudes are given at the motor.
    """
    reversing = [s for s in stretches if s.kind == "sine"]
    sentences = []
    for name, least, share in (("W", LEAST_W, DEFLECTIONS_W), ("gamma", LEAST_GAMMA, DEFLECTIONS_GAMMA)):
        needed = least / I_P if I_P else share * deflection
        estimate = estimates.get(name)
        if estimate is None or not (verb := _wanted(estimate)):
            continue
        largest = max((s.amplitude for s in reversing), default=0.0)
        if largest < TOLERANCE * needed:
            sentences.append(
                f"{name} {verb} a sine with an amplitude of at least {_length(needed, I_P)}; "
                + (f"the largest has {_length(largest, I_P)}" if reversing else "there is none")
                + _bound(estimate)
            )
    sigma_1 = estimates.get("sigma_1")
    if sigma_1 is not None and (verb := _wanted(sigma_1)):
        small = [s.frequency for s in reversing if s.amplitude < 4 * deflection]
        highest = max(small, default=0.0)
        if highest < TOLERANCE * LEAST_FREQUENCY:
            sentences.append(
                f"sigma_1 {verb} a small sine (up to some {_length(deflection, I_P)}) of at least {LEAST_FREQUENCY:g} "
                "Hz; " + (f"the fastest has {highest:.3g} Hz" if small else "there is none") + _bound(sigma_1)
            )
    for name, good in GOOD_RELATIVE_SIGMA.items():
        estimate = estimates.get(name)
        if estimate is None or estimate.status != "estimated" or any(s.startswith(name + " ") for s in sentences):
            continue
        relative = estimate.sigma / abs(estimate.value)
        known = without_delay.get(name, estimate.sigma) / abs(estimate.value)
        if relative <= good:
            continue
        if known <= good and relative > 1.5 * known:
            sentences.append(
                f"{name} is known within {100 * relative:.1f} %, with a known delay within {100 * known:.1f} %: give "
                "the delay, or add a sliding sine whose inertia marks it (500 um at 5 Hz)"
            )
        else:
            sentences.append(
                f"{name} is known within {100 * relative:.1f} % only: more periods, or less noise (the deviation falls "
                "with the square root of the number of periods)"
            )
    return tuple(sentences)


def _wanted(estimate: Estimate) -> str:
    """How much a parameter asks for moves that show it; empty: not at all, it is determined well or not sought."""
    if estimate.status in ("held", "given"):
        return ""
    if estimate.status == "undetermined" or not np.isfinite(estimate.sigma):
        return "needs"
    good = GOOD_RELATIVE_SIGMA[estimate.name] * abs(estimate.value)
    return "needs" if estimate.sigma > good else "is best determined by" if estimate.sigma > EXCELLENT * good else ""


def _length(angle: float, I_P: float | None) -> str:
    return f"{1e6 * angle * I_P:.3g} um" if I_P else f"{1e3 * angle:.3g} mrad at the motor"


def _bound(estimate: Estimate) -> str:
    if estimate.status == "undetermined":
        return " (these records do not determine it)"
    return f" (known within {100 * estimate.sigma / abs(estimate.value):.0f} %)"
