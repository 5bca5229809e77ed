"""Frequency responses as the report sees them, of the default machine, closed form and as if measured."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from feedsim.analysis import linear
from feedsim.analysis.campaign import Campaign, ExcitedInput, Plan
from feedsim.analysis.responses import Overlay, Responses, closed_form
from feedsim.files.trace.response import FrequencyResponse
from feedsim.linear.loops import names
from feedsim.scenario import Subject, load_subject
from feedsim.structure import checked_modes
from scenario_helpers import MACHINE

AXES = ("X", "Z")
BAND = (10.0, 300.0)


def subject() -> Subject:
    return load_subject(MACHINE)


@cache
def _evaluated() -> tuple[linear.LinearSystem, linear.LinearResult]:
    machine = subject().machine
    system = linear.LinearSystem(machine, checked_modes(machine))
    return system, linear.evaluate(system, AXES)


@cache
def _closed(axes: tuple[str, ...], tool: bool) -> tuple[linear.LinearResult, FrequencyResponse]:
    system, result = _evaluated()
    own = replace(result, axes={axis: result.axes[axis] for axis in axes})
    return own, closed_form(system, names(axes, tool=tool), np.geomspace(*BAND, 160))


def campaign_of(closed: FrequencyResponse, coherence: float = 1.0) -> Campaign:
    """A measurement that finds the closed form at every eighth frequency, the lower half with this coherence."""
    rows = slice(None, None, 8)
    f = closed.frequency[rows]
    measured = [name for name in closed if "loop" not in name and "x_s" not in name]
    known = np.where(f < np.median(f), coherence, 1.0)
    response = FrequencyResponse(
        f,
        {name: closed[name][rows] for name in measured},
        {name: closed.unit(name) for name in measured},
        dict.fromkeys(measured, known),
    )
    excited = (ExcitedInput("Z.n_add", "rad/s", 0.5, 1.1, len(f), 2.0),)
    units = {"plant": {"guid": "0011223344556677-8899aabbccddeeff", "version": "0.1.0"}}
    return Campaign(Plan(band=BAND), response, excited, 1.5, 8.0, units, ())


def responses(
    axes: tuple[str, ...] = ("Z",),
    *,
    tool: bool = False,
    measured: bool = True,
    coherence: float = 1.0,
    overlays: tuple[Overlay, ...] = (),
    **changes: Any,
) -> Responses:
    machine = subject().machine
    result, closed = _closed(axes, tool)
    given: dict[str, Any] = {
        "machine": machine,
        "modes": checked_modes(machine),
        "axes": axes,
        "band": BAND,
        "result": result,
        "closed": closed,
        "campaign": campaign_of(closed, coherence) if measured else None,
        "overlays": overlays,
        "figures": linear.figures(result),
    }
    return Responses(**(given | changes))
