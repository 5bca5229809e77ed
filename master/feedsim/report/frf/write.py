"""Write the results of a look at frequency responses into a directory, whole or not at all."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path

from feedsim.analysis.responses import Responses
from feedsim.analysis.truncation import Truncation
from feedsim.report.frf.page import page
from feedsim.report.frf.plots import pictures_of
from feedsim.report.frf.summary import summary
from feedsim.report.parts import to_json
from feedsim.report.results import REPORT, SUMMARY, check_place, write_results, write_text
from feedsim.report.style import Picture, remarked
from feedsim.report.truncation_plots import truncation_pictures
from feedsim.scenario import Subject
from feedsim.trace.response_files import write_response

CURVES, MEASURED = "frf.csv", "frf_measured.csv"


def check_frf_writable(directory: Path | str, inputs: Sequence[Path] = ()) -> None:
    """Raise OutputError unless the results can be written to ``directory`` without one of ``inputs`` being lost.

    inputs: files that are read. Leaves nothing behind.
    """
    check_place(directory, (CURVES, MEASURED, REPORT, SUMMARY), inputs)


def write_frf(subject: Subject, responses: Responses, directory: Path | str) -> tuple[Path, ...]:
    """Write frf.csv (closed form), frf_measured.csv where there is a measurement, summary.json, report.html, figures.

    Returns the paths. Files of an earlier run are replaced. Raises OutputError.
    """
    with remarked(_remark(responses)):
        pictures = pictures_of(responses)
        if responses.truncation is not None:
            pictures += _truncation_pictures(responses, responses.truncation)
    campaign = responses.campaign

    def fill(fresh: Path, names: Sequence[str]) -> None:
        write_response(fresh / CURVES, responses.closed)
        if campaign is not None:
            write_response(fresh / MEASURED, campaign.response)
        write_text(fresh / REPORT, page(subject, responses, pictures))
        write_text(fresh / SUMMARY, to_json(summary(subject, responses, names)))

    files = (CURVES, *((MEASURED,) if campaign is not None else ()), REPORT, SUMMARY)
    return write_results(directory, files, pictures, fill)


def _truncation_pictures(responses: Responses, truncation: Truncation) -> list[Picture]:
    low, high = responses.band
    frequency = responses.closed.frequency
    within = frequency[(frequency >= low) & (frequency <= max(high, 1.2 * truncation.cutoff))]
    axes = tuple(responses.machine.axes)
    tool = any(name.startswith("tool.") for name in responses.closed)
    return truncation_pictures(truncation.tables, axes, within, truncation.cutoff, shown=responses.axes, tool=tool)


def _remark(responses: Responses) -> str:
    """Machine, pose, and what its numbers are worth."""
    machine = responses.machine
    pose = ", ".join(f"{axis} {position * 1e3:.6g} mm" for axis, position in machine.pose.items())
    return "\n".join(textwrap.wrap(f"{machine.name} at {pose}. {machine.note}".strip(), 150)[:2])
