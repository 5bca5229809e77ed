"""What a stop and a positioning cycle come to, in a sentence or two: the answer, its meaning, what to do next."""

from __future__ import annotations

import math

from feedsim.analysis import Figures

# Of A, what repeats is worth compensating from this share of it on.
SYSTEMATIC = 0.5


def stop_words(figures: Figures, band: float) -> str:
    """Of a motion that ends at rest. figures: without prefix; band: about the target [m]."""
    overshoot, settled = figures["overshoot"], figures["settling_time"]
    within = f"+-{band * 1e6:g} um"
    if not math.isfinite(overshoot.value) or not math.isfinite(settled.value):
        return f"whether it stays within {within} is not known, too little of the rest is recorded: add a dwell."
    said = f"{overshoot.value:.2f} um past its target"
    said += f", within {within} for good {settled.value:.1f} ms after the end of the NC motion"
    ringing = figures.get("ringing_frequency")
    if settled.value > 0 and ringing is not None and math.isfinite(ringing.value):
        said += f"; what it waits for rings at {ringing.value:.1f} Hz"
    return f"{said}."


def accuracy_words(figures: Figures) -> str:
    """Of a positioning cycle after ISO 230-2."""
    A, R, E, B = (figures[name].value for name in "AREB")
    if not math.isfinite(A):
        return "accuracy of positioning not determined."
    first = f"accuracy of positioning A {A:.2f} um, repeatability R {R:.2f} um, systematic deviation E {E:.2f} um"
    if E < SYSTEMATIC * A:
        return f"{first}: most of it scatters from approach to approach, which no table of compensation takes away."
    if B > SYSTEMATIC * E:
        return f"{first}: most of it repeats and changes with the direction: backlash, reversal value B {B:.2f} um."
    return f"{first}: most of it repeats at each target: compensation of the pitch can take it away."
