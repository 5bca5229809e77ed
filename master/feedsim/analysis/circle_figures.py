"""Figures that need more of a circle than its radii: why it is not round, and both directions together.

Definitions: docs/figures.md. Here recorded turns meet feedsim.analysis.circle, which takes them apart.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from feedsim.analysis.circle import CircleUnderTest, Diagnosis, Term, TurnedPath, diagnose, name
from feedsim.analysis.circularity import Turn, axis_letters, contour, fitted_centre
from feedsim.analysis.figures import Array, Figure
from feedsim.trace import Trace

# Samples of a turn below which there is no telling its parts apart: three per degree would show a peak's shape.
MIN_PEAK_TURN_SAMPLES = 180
# A glitch by its old definition is misleading where it differs from the peak by this share of it, and this much [m].
MISLEADING, LEAST_MISLEADING = 0.2, 1e-6
FIGURE_UNITS = {"s": (1e3, "ms"), "m": (1e6, "um"), "1": (1e6, "um/m"), "rad": (1e6, "um/m"), "N.m": (1.0, "N.m")}
FIGURE_ORDER = (
    "peaks", "servo", "squareness", "squareness_or_servo", "scale", "lost_motion", "pitch", "cogging", "straightness",
    "third", "drift", "centres", "radii", "radius", "offset", "rest",
)  # fmt: skip
COMPARED_ANGLES = 720  # at which two directions are compared: every half degree


def diagnosed(
    trace: Trace,
    turns: Sequence[Turn],
    pitch: Mapping[str, float],
    gain: Mapping[str, complex] | None = None,
    drag: Mapping[str, NDArray[np.complex128]] | None = None,
    columns: tuple[str, str] | None = None,
    recorded: bool = False,
    response: Callable[[str, Array], NDArray[np.complex128]] | None = None,
    following: Mapping[str, NDArray[np.complex128]] | None = None,
) -> Diagnosis | None:
    """Turns of one circle taken apart; None where they have too few samples for that.

    pitch: axis -> [m]. gain: axis -> x_a/x_s at the circle's frequency [1]. drag: axis -> x_a over a torque at the
    motor at the odd multiples of that frequency [m/(N.m)]. columns: of the positions; default: those of the scales.
    recorded: they are looked at as those of an instrument are. response: of an axis at frequencies (F,) [Hz], x_a over
    a torque on the rotor (F,) [m/(N.m)].
    """
    turn = turns[0]
    paths = []
    for entry in turns:
        measured = contour(trace, entry, columns)
        if len(measured.angle) < MIN_PEAK_TURN_SAMPLES:
            return None
        phase = (measured.time - measured.time[0]) * (2 * math.pi / (entry.end - entry.begin))
        paths.append(TurnedPath(measured.angle, measured.deviation, entry.sense, phase))
    speed = 2 * math.pi * turn.radius / (turn.end - turn.begin)
    circle = CircleUnderTest(
        turn.axes, turn.radius, speed, pitch, gain or {}, drag or {}, following or {}, recorded, response
    )
    return diagnose(circle, paths)


def cause_figures(diagnosis: Diagnosis) -> dict[str, Figure]:
    """Figures of what makes the circle not round."""
    figures = {}
    first, second = diagnosis.circle.axes
    meanings = {
        "offset": "distance of the centre from the programmed one",
        "radius": "mean radius deviation without peaks",
        "scale": f"scale mismatch: how much further {first} travels than {second}",
        "squareness": f"squareness: how much the angle between {first}+ and {second}+ is below 90 deg",
        "servo": f"servo mismatch: how much later {first} answers than {second}",
        "squareness_or_servo": "amplitude of the ellipse along 45 deg, of squareness or servo mismatch: one direction "
        "cannot tell",
        "lost_motion": "lost motion: step where {axis} reverses",
        "peaks": "reversal peak where {axis} reverses, the largest one over the fitted rest",
        "pitch": "amplitude of the error of {axis} that repeats with its pitch",
        "cogging": "amplitude of the torque of {axis} that comes {order} times in a turn of its motor",
        "straightness": "straightness of second order of the guide of {axis}, at the edge of the circle",
        "third": f"straightness of third order at the edge of the circle, that of {first} less that of {second}",
        "drift": "way of the centre in a turn",
        "centres": "distance of the centres of both directions",
        "radii": "mean radius of counterclockwise turns less that of clockwise ones, or that of the second turn less "
        "that of the first",
        "rest": "what no cause explains, from peak to valley",
    }  # fmt: skip
    for term in sorted(diagnosis.terms, key=lambda term: (FIGURE_ORDER.index(term.key), term.axis, term.order)):
        factor, unit = FIGURE_UNITS[term.unit]
        figures[figure_name(term)] = Figure(
            factor * term.value, unit, meanings[term.key].format(axis=term.axis, order=term.order)
        )
    if diagnosis.lag is not None:
        meaning = "part of the mean radius deviation that path lag makes, by the response of the position loops"
        figures["radius_lag"] = Figure(1e6 * diagnosis.lag, "um", meaning)
    vibration = diagnosis.vibration
    amplitude, frequency = (vibration.amplitude * 1e6, vibration.frequency) if vibration else (0.0, math.nan)
    figures["vibration"] = Figure(amplitude, "um", "amplitude of the strongest vibration; 0 where none stands out")
    figures["vibration_frequency"] = Figure(frequency, "Hz", "frequency of that vibration")
    for entry in diagnosis.vibrations:
        if entry.axis:
            figures[f"vibration_{entry.axis}"] = Figure(
                1e6 * entry.amplitude, "um", f"amplitude of what {entry.axis} swings"
            )
            meaning = f"frequency of what {entry.axis} swings"
            figures[f"vibration_frequency_{entry.axis}"] = Figure(entry.frequency, "Hz", meaning)
    return figures


def figure_name(term: Term) -> str:
    """Name of a term's figure, without the plane's."""
    names = {"servo": "servo_mismatch", "scale": "scale_mismatch", "peaks": "peak", "radius": "radius_change"}
    names |= {"third": "straightness_third", "drift": "centre_drift", "centres": "centres_apart"}
    names |= {"radii": "radii_apart"}
    order = f"_{term.order}" if term.order else ""
    return f"{names.get(term.key, term.key)}{'_' if term.axis else ''}{term.axis}{order}"


def misleading(diagnosis: Diagnosis, glitches: Mapping[str, Figure]) -> list[str]:
    """A sentence for every axis whose quadrant glitch, largest deviation in the quadrant, is not friction's peak."""
    result = []
    for axis in diagnosis.circle.axes:
        peak, old = diagnosis[f"peaks {axis}"], glitches[f"glitch_{axis}"]
        off = abs(old.value * 1e-6 - peak.value)
        if off > max(MISLEADING * abs(peak.value), LEAST_MISLEADING):
            largest = max(
                (term for term in diagnosis.terms if term.key not in ("peaks", "rest")), key=lambda term: term.size
            )
            result.append(
                f"glitch_{axis}, {old}, is the largest deviation in the quadrant whatever its cause; what stands out "
                f"where {axis} reverses is peak_{axis}, {peak.value * 1e6:.3g} um. The rest is form, most of it "
                f"{name(largest)}"
            )
    return result


def bidirectional(trace: Trace, turn: Turn, back: Turn) -> dict[str, Figure]:
    """ISO 230-4's figures of two turns in opposite senses, about the centre of the circle fitted to both."""
    measured = [contour(trace, entry) for entry in (turn, back)]
    return both_directions([(m.angle, m.deviation) for m in measured], turn.radius, turn.axes)


def both_directions(turns: Sequence[tuple[Array, Array]], radius: float, axes: tuple[str, str]) -> dict[str, Figure]:
    """The same of two turns by their angles [rad] and deviations of the radius [m]."""
    centre = fitted_centre(np.concatenate([a for a, _ in turns]), np.concatenate([e for _, e in turns]), radius)
    around = [about(angle, deviation, radius, centre) for angle, deviation in turns]
    even: Array = np.arange(COMPARED_ANGLES, dtype=np.float64) * (2 * math.pi / COMPARED_ANGLES) - math.pi
    there, again = (_at(even, angle, deviation) for angle, deviation in around)
    letters = axis_letters(axes)
    both = np.concatenate([deviation for _, deviation in around])

    def um(value: float, meaning: str) -> Figure:
        return Figure(value * 1e6, "um", f"{meaning}, by the linear scales")

    apart = np.abs(there - again)
    return {
        "G_b": um(
            float(np.ptp(both)),
            f"ISO 230-4 bidirectional circular deviation G(b)_{letters}, about the centre of the least-squares circle "
            "of both turns",
        ),
        "D": um(float(there.mean() + again.mean()) / 2, f"ISO 230-4 mean bidirectional radial deviation D_{letters}"),
        "H": um(
            float(apart.max()),
            f"ISO 230-4 circular hysteresis H_{letters}: largest distance of the two turns at an angle",
        ),
    }


def about(angle: Array, deviation: Array, radius: float, centre: Array) -> tuple[Array, Array]:
    """Angle [rad] and deviation of the radius [m] about another centre (2,) [m]."""
    x, y = (radius + deviation) * np.cos(angle) - centre[0], (radius + deviation) * np.sin(angle) - centre[1]
    return np.arctan2(y, x), np.hypot(x, y) - radius


def _at(wanted: Array, angle: Array, deviation: Array) -> Array:
    order = np.argsort(angle)
    return np.asarray(np.interp(wanted, angle[order], deviation[order], period=2 * math.pi))
