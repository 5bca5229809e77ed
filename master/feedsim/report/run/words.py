"""What a stop and a positioning cycle come to, in a sentence or two: the answer, its meaning, what to do next."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from feedsim.analysis import Diagnosis, Figures, PositioningTask, tasks
from feedsim.analysis.circle import worth_telling
from feedsim.cosim import Run
from feedsim.report.content import FOLDER, Text, code, typed
from feedsim.scenario import Drive
from feedsim.trace import Trace

# Of A, what repeats is worth compensating from this share of it on.
SYSTEMATIC = 0.5
STIRRED = 0.02  # share of the largest travel, up to which an axis has been stirred rather than moved


def stop_words(figures: Figures, band: float) -> str:
    """Of a motion that ends at rest. figures: without prefix; band: about the target [m]."""
    overshoot, settled = figures["overshoot"], figures["settling_time"]
    within = f"+-{band * 1e6:g} um"
    ringing = figures.get("ringing_frequency")
    rings = ringing is not None and math.isfinite(ringing.value)
    if math.isfinite(overshoot.value) and not math.isfinite(settled.value) and ringing is not None and rings:
        return (
            f"not yet at rest within {within} at the end: it oscillates at {ringing.value:.1f} Hz, up to "
            f"{overshoot.value:.2f} um past its target."
        )
    if not math.isfinite(overshoot.value) or not math.isfinite(settled.value):
        return f"whether it stays within {within} is not known, too little of the rest is recorded: add a dwell."
    said = f"{overshoot.value:.2f} um past its target, "
    said += (
        f"within {within} for good {settled.value:.1f} ms after the end of the NC motion"
        if settled.value > 0
        else f"within {within} from the end of the NC motion on"
    )
    if settled.value > 0 and ringing is not None and rings:
        said += f"; until then it rings at {ringing.value:.1f} Hz, which less jerk would excite less"
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


def next_step(run: Run, causes: Mapping[str, Diagnosis], change: str = "") -> Text:
    """What to do with a run, by what it has shown first: a command to copy. change: that is proposed, in words."""
    file = typed(run.scenario.file)
    if change:
        return f"Try {change}:\n", code(f"feedsim tune proposals {file}")
    first_causes = [term.key for diagnosis in causes.values() for term in worth_telling(diagnosis)[:1]]
    if first_causes[:1] == ["peaks"]:
        return "See what friction compensation takes away:\n", code(f"feedsim tune feedforward {file}")
    if first_causes[:1] == ["servo"]:
        return "See how each axis answers:\n", code(f"feedsim frf {file}")
    for task in tasks(run.scenario, run.program):
        axis = task.approach.axis if isinstance(task, PositioningTask) else ""
        if axis and isinstance(run.scenario.machine.axes[axis].drive, Drive):
            return "Find drive values with which it stops better:\n", code(f"feedsim tune drive {file} --axes {axis}")
    return "Lay another run or a record over it:\n", code(f"feedsim diff {FOLDER} OTHER_FOLDER")


def moved_words(trace: Trace) -> list[str]:
    """Of a run without figures: how far each axis has moved and was behind, and that nothing is evaluated."""
    result = []
    travels = {name.partition(".")[0]: float(np.ptp(y)) for name, y in trace.columns.items() if name.endswith(".x_a")}
    for axis, travel in travels.items():
        if travel > STIRRED * max(travels.values()):
            lag = trace.columns.get(f"{axis}.x_e")
            behind = "" if lag is None else f", following error up to {1e6 * float(np.abs(lag).max()):.3g} um"
            result.append(f"{axis} moves within {1e3 * travel:.4g} mm{behind}.")
    return [*result, "The scenario has nothing that is evaluated (a stop, a circle, a positioning cycle): no figures."]
