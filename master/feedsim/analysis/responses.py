"""A machine's frequency responses side by side: closed form, measured, laid over, and how they agree.

Names of responses: linear/loops.py. Definitions: docs/figures.md.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from feedsim.analysis import linear
from feedsim.analysis.campaign import Campaign
from feedsim.analysis.figures import Figure
from feedsim.analysis.truncation import Truncation
from feedsim.files.trace.response import FrequencyResponse
from feedsim.files.trace.response_files import read_overlay
from feedsim.foundation.errors import Finding, InputError
from feedsim.linear.loops import figure_key, response, unit_of
from feedsim.linear.plant import Floats
from feedsim.scenario import Machine
from feedsim.structure import Modes

# Measured responses are held against the closed form where they are known.
COHERENT, COMPARED = 0.99, (5.0, 500.0)
# The closed form of a report is drawn up to this multiple of the band: gain margins lie above it.
BAND_RATIO = 2.0
BELOW_MIRROR = 0.999  # of half the sampling rate


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
        warnings: what a user should know before believing the curves.
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
    warnings: tuple[Finding, ...] = ()


def highest_frequency(machine: Machine) -> float:
    """The highest frequency [Hz] at which a response of the sampled drives is defined: below half their rate."""
    return 0.5 / machine.cycles.T_c * BELOW_MIRROR


def frequencies(machine: Machine, modes: Modes, band: tuple[float, float], beyond: float = 1.0) -> Floats:
    """Frequencies of the closed form [Hz]: fine enough for every resonance, up to `beyond` times the band's end."""
    highest = highest_frequency(machine)
    if not 0 < band[0] < band[1] <= highest:
        raise InputError(
            f"band {band[0]:.6g} to {band[1]:.6g} Hz: above 0, the first below the second, and up to {highest:.6g} Hz "
            "(half the sampling rate of the control cycle)"
        )
    return linear.grid(modes, band[0], min(beyond * band[1], highest))


def closed_form(system: linear.LinearSystem, wanted: Sequence[str], frequency: Floats) -> FrequencyResponse:
    """The named responses in closed form at `frequency` (F,) [Hz]."""
    return FrequencyResponse(
        frequency,
        {name: response(system, name, frequency) for name in wanted},
        {name: unit_of(name) for name in wanted},
    )


def zero_notes(closed: FrequencyResponse) -> list[Finding]:
    """Which responses are zero at all frequencies: a machine of rigid axes, for one, has no compliance at the tool."""
    zero = ", ".join(name for name in closed.names if not np.any(closed[name]))
    text = f"{zero}: zero at all frequencies in this machine; there is nothing to draw"
    return [Finding("response-zero", "note", text, zero)] if zero else []


def read_overlays(text: str, known: Sequence[str]) -> tuple[list[Overlay], list[Finding]]:
    """Curves of a file that are to be laid over, and warnings.

    text: as feedsim.files.trace.response_files.read_overlay takes it. known: responses that are shown; a file read as a
    whole may hold more.

    Raises:
        InputError: what the reader refuses, a file without any of the known responses, a unit of another dimension.
    """
    read = read_overlay(text)
    at = text.find(":", 2)  # a drive's colon is none of ours
    mine = [name for name in read if name in known]
    if not mine:
        raise InputError(
            f"--overlay {text}: holds none of the responses shown, but {', '.join(read.names)}. Say which it is: "
            f"FILE:NAME, such as {text[: at if at > 0 else None]}:{known[0]}; shown are {', '.join(known)}"
        )
    overlays: list[Overlay] = []
    warnings: list[Finding] = []
    for name in mine:
        alone = read.select([name])
        wanted = unit_of(name)
        if alone.unit(name):
            alone = alone.converted({name: wanted})
            warnings += alone.notes
        elif wanted != "1":
            said = f"--overlay {text}: {name} has no unit in the file; it is taken to be in {wanted}"
            warnings.append(Finding("unit-assumed", "doubt", said, name))
        overlays.append(Overlay(name, Path(text[: at if at > 0 else None]), alone))
    return overlays, list(dict.fromkeys([*read.notes, *warnings]))


def agreement(system: linear.LinearSystem, campaign: Campaign) -> dict[str, Figure]:
    """How far measured responses are from the closed form, where they are known.

    The closed form is taken at the very frequencies of the measurement, so that nothing is interpolated, and at the
    speed of the axis that was excited.
    """
    low, high = COMPARED
    figures: dict[str, Figure] = {}
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
        closed = response(system, name, measured.frequency[sure])
        if (there := closed != 0).any():  # the tool of a rigid machine does not yield
            quotient = measured[name][sure][there] / closed[there]
            decibel = float(np.max(np.abs(20 * np.log10(np.abs(quotient)))))
            degrees = float(np.max(np.abs(np.degrees(np.angle(quotient)))))
        key = figure_key(name)
        figures |= {
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
    return figures
