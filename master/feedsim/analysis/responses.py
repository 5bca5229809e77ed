"""A machine's frequency responses side by side: closed form, measured, laid over, and how they agree.

Names of responses are output/input: "Z.n_a/Z.M_a" speed-controlled system, "Z.x_a/Z.M_a" linear scale over motor
torque, "Z.n_a/Z.n_s" speed reference, "Z.x_a/Z.x_s" position reference (without feedforward), "tool.x_X/tool.F_X"
compliance at the tool; "Z.speed_loop" and "Z.position_loop" are open-loop gains. Definitions: docs/figures.md.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from feedsim.analysis import linear
from feedsim.analysis.campaign import Campaign
from feedsim.analysis.figures import Figure
from feedsim.analysis.truncation import Truncation
from feedsim.errors import InputError
from feedsim.scenario import Machine
from feedsim.structure import Modes
from feedsim.trace.response import FrequencyResponse
from feedsim.trace.response_files import read_overlay

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

TOOL_DIRECTIONS = ("X", "Y", "Z")
# Measured responses are held against the closed form where they are known.
COHERENT, COMPARED = 0.99, (5.0, 500.0)
# The closed form is drawn up to this multiple of the band: gain margins lie above it.
BEYOND = 2.0
BELOW_MIRROR = 0.999  # of half the sampling rate

QUANTITIES = {  # of an axis: response, what it is
    "n_M": ("{0}.n_a/{0}.M_a", "n/M"),
    "x_M": ("{0}.x_a/{0}.M_a", "x/M"),
    "n_n": ("{0}.n_a/{0}.n_s", "n_a/n_s"),
    "x_x": ("{0}.x_a/{0}.x_s", "x_a/x_s"),
}
COMPLIANCE = "tool.x_{0}/tool.F_{0}"
LOOPS = ("speed_loop", "position_loop")
UNITS = {"n_M": "(rad/s)/(N.m)", "x_M": "m/(N.m)", "n_n": "1", "x_x": "1"}


@dataclass(frozen=True, eq=False)
class Overlay:
    """A curve from elsewhere: which response it is of, its file, and its values in that response's unit."""

    name: str
    file: Path
    response: FrequencyResponse


@dataclass(frozen=True, eq=False)
class Responses:
    """Everything that a report on frequency responses shows.

    Attributes:
        axes: that are shown.
        band: lowest and highest frequency [Hz].
        result: what the closed form says.
        closed: closed-form responses.
        campaign: what was measured, and how; None where nothing was.
        overlays: curves from elsewhere.
        truncation: the full finite-element model beside what was kept of it; None where it is not known.
        figures: all numbers derived, by name.
        warnings: what a user should know before believing the curves, a sentence each.
    """

    machine: Machine
    modes: Modes
    axes: tuple[str, ...]
    band: tuple[float, float]
    result: linear.LinearResult
    closed: FrequencyResponse
    campaign: Campaign | None = None
    overlays: tuple[Overlay, ...] = ()
    truncation: Truncation | None = None
    figures: Mapping[str, Figure] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()


def names(axes: Sequence[str], *, tool: bool) -> tuple[str, ...]:
    """Responses of these axes that have a closed form, and those at the tool."""
    own = [response.format(axis) for axis in axes for response, _ in QUANTITIES.values()]
    gains = [f"{axis}.{loop}" for axis in axes for loop in LOOPS]
    return (*own, *gains, *((COMPLIANCE.format(d) for d in TOOL_DIRECTIONS) if tool else ()))


def unit_of(name: str) -> str:
    """Unit of a response, by its name."""
    for key, (response, _) in QUANTITIES.items():
        if name == response.format(name.partition(".")[0]):
            return UNITS[key]
    return "m/N" if name.startswith("tool.") else "1"


def frequencies(machine: Machine, modes: Modes, band: tuple[float, float]) -> Floats:
    """Frequencies of the closed form [Hz]: fine enough for every resonance, up to BEYOND times the band."""
    highest = 0.5 / machine.cycles.T_c * BELOW_MIRROR
    if not 0 < band[0] < band[1] <= highest:
        raise InputError(
            f"band {band[0]:.6g} to {band[1]:.6g} Hz: above 0, the first below the second, and up to {highest:.6g} Hz "
            "(half the sampling rate of the control cycle)"
        )
    return linear.grid(modes, band[0], min(BEYOND * band[1], highest))


def closed_form(system: linear.LinearSystem, wanted: Sequence[str], frequency: Floats) -> FrequencyResponse:
    """The named responses in closed form at `frequency` (F,) [Hz]."""
    return FrequencyResponse(
        frequency, {name: one(system, name, frequency) for name in wanted}, {name: unit_of(name) for name in wanted}
    )


def one(system: linear.LinearSystem, name: str, frequency: Floats) -> Complexes:
    """A response in closed form, by its name. InputError: no such response."""
    axis, _, rest = name.partition(".")
    if name in (COMPLIANCE.format(direction) for direction in TOOL_DIRECTIONS):
        return linear.compliance(system, name[-1], frequency)
    if axis in system.axes:
        s = np.asarray(2j * np.pi * frequency, dtype=np.complex128)
        if rest == "speed_loop":
            return linear.speed_gain(system, axis, s)
        if rest == "position_loop":
            return linear.position_gain(system, axis, s)
        functions = {
            "n_M": linear.speed_controlled_system,
            "x_M": linear.scale_response,
            "n_n": linear.speed_reference,
            "x_x": linear.position_reference,
        }
        for key, function in functions.items():
            if name == QUANTITIES[key][0].format(axis):
                return function(system, axis, frequency)
    known = ", ".join(names(system.axes, tool=True))
    raise InputError(f"no frequency response '{name}'; there are {known}")


def read_overlays(text: str, known: Sequence[str]) -> tuple[list[Overlay], list[str]]:
    """Curves of a file that are to be laid over, and warnings.

    text: as feedsim.trace.response_files.read_overlay takes it. known: responses that are shown; a file read as a whole
    may hold more.

    Raises:
        InputError: what the reader refuses, a file without any of the known responses, a unit of another dimension.
    """
    response = read_overlay(text)
    at = text.find(":", 2)  # a drive's colon is none of ours
    mine = [name for name in response if name in known]
    if not mine:
        raise InputError(
            f"--overlay {text}: holds none of the responses shown, but {', '.join(response.names)}. Say which it is: "
            f"FILE:NAME, such as {text[: at if at > 0 else None]}:{known[0]}; shown are {', '.join(known)}"
        )
    overlays, warnings = [], []
    for name in mine:
        alone = response.select([name])
        wanted = unit_of(name)
        if alone.unit(name):
            alone = alone.converted({name: wanted})
        elif wanted != "1":
            warnings.append(f"--overlay {text}: {name} has no unit in the file; it is taken to be in {wanted}")
        overlays.append(Overlay(name, Path(text[: at if at > 0 else None]), alone))
    return overlays, warnings


def agreement(system: linear.LinearSystem, campaign: Campaign) -> dict[str, Figure]:
    """How far measured responses are from the closed form, where they are known.

    The closed form is taken at the very frequencies of the measurement, so that nothing is interpolated, and at the
    speed of the axis that was excited.
    """
    low, high = COMPARED
    found: dict[str, Figure] = {}
    measured, speed = campaign.response, campaign.plan.offset_speed
    at_rest = system
    for name in measured:
        axis = name.partition(".")[0]
        if speed and axis in system.axes:
            system = replace(at_rest, operating={axis: linear.OperatingPoint(n=speed)})
        near = (measured.frequency >= low) & (measured.frequency <= high)
        sure = near & (measured.coherence[name] > COHERENT) if name in measured.coherence else near
        where = f"where the coherence exceeds {COHERENT:g}, {low:g} to {high:g} Hz"
        decibel = degrees = np.nan
        if sure.any():
            quotient = measured[name][sure] / one(system, name, measured.frequency[sure])
            decibel = float(np.max(np.abs(20 * np.log10(np.abs(quotient)))))
            degrees = float(np.max(np.abs(np.degrees(np.angle(quotient)))))
        key = _key(name)
        found |= {
            f"{key}.measured_magnitude": Figure(
                decibel, "dB", f"largest deviation of measured {name} from the closed form, {where}"
            ),
            f"{key}.measured_phase": Figure(
                degrees, "deg", f"largest deviation of the phase of measured {name} from the closed form, {where}"
            ),
            f"{key}.measured_share": Figure(
                100 * float(np.mean(sure[near])) if near.any() else np.nan,
                "%",
                f"share of the measured lines of {name}, {low:g} to {high:g} Hz, with a coherence above {COHERENT:g}",
            ),
        }
    return found


def _key(name: str) -> str:
    """First part of a figure's name for a response: "Z.n_M", "tool.compliance_X"."""
    axis = name.partition(".")[0]
    for key, (response, _) in QUANTITIES.items():
        if name == response.format(axis):
            return f"{axis}.{key}"
    return f"tool.compliance_{name[-1]}" if axis == "tool" else name
