"""What the report of an identification shows: error of the curve, values at the slide, units, files read."""

from __future__ import annotations

import numpy as np

from feedsim.estimation.interval import NORMAL_95
from feedsim.identify import Identified
from feedsim.identify.result import Estimate, Stationary
from feedsim.report.provenance import InputFile, hashed

MM_PER_MIN = 60e3  # per m/s
LEAST_SPEEDS = 3  # that make a curve
SAME_SPEED = 1.05  # ratio up to which two speeds are one: that of a direction and of the other, or of a repetition


def remark(identified: Identified) -> str:
    """For the pictures, in one line: axis and traces, and what the numbers are worth."""
    traces = identified.traces
    listed = ", ".join(traces[:4]) + (f" and {len(traces) - 4} more" if len(traces) > 4 else "")
    sentences = (f"Axis {identified.found.axis} from {listed}", *identified.notes)
    return " ".join(f"{text.rstrip('.')}." for text in sentences)


def input_files(identified: Identified) -> list[InputFile]:
    """Traces and mappings (hashed when they were read), and the machine's files."""
    subject, pairs = identified.subject, zip(identified.traces, identified.sources, strict=True)
    files = [InputFile("trace", name, source.sha256) for name, source in pairs]
    named = [("mapping", source.mapping) for source in identified.sources if source.mapping is not None]
    return files + hashed([*named, *(subject.files if subject is not None else ())])


def curve_error(stage: Stationary) -> float:
    """Half width of the curve's 95 % band, relative, where it is widest within the speeds of the plateaus [1]."""
    inside = (stage.speeds >= stage.range[0] * (1 - 1e-9)) & (stage.speeds <= stage.range[1] * (1 + 1e-9))
    if not np.any(inside):
        inside[:] = True
    return float(NORMAL_95 * np.max(stage.sigma[inside] / np.abs(stage.torque[inside])))


def speeds_of(stage: Stationary) -> int:
    """Number of distinct speeds of the plateaus, whatever their direction."""
    sizes = np.sort([abs(plateau.speed) for plateau in stage.plateaus])
    return int(1 + np.count_nonzero(sizes[1:] > SAME_SPEED * sizes[:-1])) if len(sizes) else 0


def is_curve(stage: Stationary) -> bool:
    """Whether there are enough speeds to speak of a curve and of its error."""
    return speeds_of(stage) >= LEAST_SPEEDS


def at_slide(name: str, I_P: float) -> tuple[float, str] | None:
    """Factor from the motor's side (SI) to the slide, and the unit there; None where it is the same at both.

    With x = I_P angle, F = M / I_P.
    """
    if name in ("F_C", "F_S", "F_log", "M_0"):
        return 1 / I_P, "N"
    if name == "dM_0/dt":
        return 1 / I_P, "N/s"
    if name == "sigma_0":
        return 1e-6 / I_P**2, "N/um"
    if name in ("sigma_1", "sigma_2"):
        return 1e-3 / I_P**2, "N.s/mm"
    if name in ("v_s", "v_log"):
        return MM_PER_MIN * I_P, "mm/min"
    if name == "W":
        return 1e6 * I_P, "um"
    return (1 / I_P**2, "kg") if name == "J" else None


def shown_unit(estimate: Estimate) -> tuple[float, str]:
    """Factor and unit in which a value is shown on the motor's side: SI, times in ms."""
    return (1e3, "ms") if estimate.unit == "s" else (1.0, estimate.unit)
