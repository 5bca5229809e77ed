"""summary.json of a report on frequency responses, and the same in one line."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from feedsim.analysis import Figure
from feedsim.analysis.campaign import Campaign
from feedsim.analysis.responses import Responses
from feedsim.report.provenance import InputFile, hashed, software
from feedsim.report.summary import figures_part, inputs_part, machine_part, quantity
from feedsim.scenario import Subject

FORMAT = 1


def input_files(subject: Subject, responses: Responses) -> list[InputFile]:
    """Files of the scenario or machine, and the curves laid over."""
    return hashed([*subject.files, *(("overlay", overlay.file) for overlay in responses.overlays)])


def summary(subject: Subject, responses: Responses, files: Sequence[str]) -> dict[str, Any]:
    """Content of summary.json; a figure that could not be determined has the value null."""
    return {
        "format": FORMAT,
        "warnings": list(responses.warnings),
        "figures": figures_part(responses.figures),
        "subject": {
            "kind": subject.kind,
            "name": subject.name,
            "file": subject.file.name,
            "notes": list(subject.notes),
            "set": list(subject.settings),
            "overrides": list(subject.overrides),
        },
        "closed_form": {
            "band": quantity(list(responses.band), "Hz"),
            "frequencies": len(responses.closed),
            "responses": {name: {"unit": responses.closed.unit(name)} for name in responses.closed},
        },
        "measurement": _measurement(responses.campaign) if responses.campaign is not None else None,
        "overlays": [
            {"response": each.name, "file": each.file.name, "unit": each.response.unit(each.name)}
            for each in responses.overlays
        ],
        "machine": machine_part(responses.machine),
        "inputs": inputs_part(input_files(subject, responses)),
        "units": {name: dict(unit) for name, unit in responses.campaign.units.items()} if responses.campaign else {},
        "software": software(),
        "files": list(files),
    }


def summary_line(responses: Responses) -> str:
    """Bandwidths and margins of every axis shown, in one line per axis."""
    return "\n".join(f"  {axis}: {_of_axis(responses.figures, axis)}" for axis in responses.axes)


def _of_axis(figures: Mapping[str, Figure], axis: str) -> str:
    def number(name: str, digits: int = 3) -> str:
        figure = figures.get(f"{axis}.{name}")
        return f"{figure.value:.{digits}g}" if figure is not None and math.isfinite(figure.value) else "-"

    def gain(loop: str) -> str:
        figure = figures.get(f"{axis}.{loop}.gain_margin")
        known = figure is not None and math.isfinite(figure.value)
        return f"{20 * math.log10(figure.value):.1f} dB" if known and figure is not None else "-"

    parts = []
    if f"{axis}.speed.bandwidth_first" in figures:
        parts.append(
            f"speed loop -3 dB first {number('speed.bandwidth_first')} Hz, last {number('speed.bandwidth_last')} Hz, "
            f"margins {number('speed.phase_margin', 2)} deg, {gain('speed')}"
        )
    if f"{axis}.position.bandwidth_first" in figures:
        parts.append(
            f"position loop -3 dB {number('position.bandwidth_first')} Hz, "
            f"margins {number('position.phase_margin', 2)} deg, {gain('position')}"
        )
    if f"{axis}.n_M.measured_magnitude" in figures:
        parts.append(
            f"measured n/M within {number('n_M.measured_magnitude', 2)} dB, {number('n_M.measured_phase', 2)} deg"
        )
    unstable = "unstable_poles" in figures and figures["unstable_poles"].value > 0
    return ("the closed loops are UNSTABLE; " if unstable else "") + ("; ".join(parts) or "no loop closed")


def _measurement(campaign: Campaign) -> dict[str, Any]:
    plan = campaign.plan
    return {
        "signal": plan.signal,
        "inject": plan.inject,
        "band": quantity(list(plan.band), "Hz"),
        "periods": plan.periods,
        "periods_to_settle": plan.settle,
        "realisations": plan.realisations,
        "seed": plan.seed,
        "friction": plan.friction,
        "offset_speed": quantity(plan.offset_speed, "rad/s"),
        "frequencies": len(campaign.response),
        "responses": {name: {"unit": campaign.response.unit(name)} for name in campaign.response},
        "excited": {
            each.reference: {
                "rms": quantity(each.rms, each.unit),
                "peak": quantity(each.peak, each.unit),
                "lines": each.lines,
                "period": quantity(each.period, "s"),
            }
            for each in campaign.excited
        },
        "simulated": quantity(campaign.simulated, "s"),
        "wall_time": quantity(campaign.wall_time, "s"),
    }
