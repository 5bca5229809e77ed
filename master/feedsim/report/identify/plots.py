"""The pictures of a report on an identification, in the order of the page."""

from __future__ import annotations

from feedsim.identify import Identified
from feedsim.report.identify.correlation_plot import correlation_picture
from feedsim.report.identify.loop_plots import loops_picture, residuals_picture
from feedsim.report.identify.open_loop_plot import open_loop_picture
from feedsim.report.identify.stribeck_plots import plateaus_picture, stribeck_picture
from feedsim.report.style import Picture


def pictures_of(identified: Identified) -> list[Picture]:
    """All pictures that the stages give."""
    found = identified.found
    pictures: list[Picture | None] = []
    if (stage := found.stationary) is not None:
        pictures += [stribeck_picture(found, stage), plateaus_picture(found, stage, identified.records)]
    if (dynamic := found.dynamic) is not None:
        pictures += [loops_picture(found, dynamic, "speed"), loops_picture(found, dynamic, "position")]
        pictures.append(residuals_picture(found, dynamic))
    if found.balance is not None:
        pictures.append(open_loop_picture(found, found.balance))
    pictures.append(correlation_picture(found.axis, found.correlation))
    return [picture for picture in pictures if picture is not None]
