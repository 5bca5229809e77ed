"""The table of docs/trust.md, and its picture: causes put into the machine, and what the diagnosis says.

May use: the package. Start reading at main(). `make causes` runs it; every figure follows from the units in fmus/.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from feedsim import scenario
from feedsim.analysis import Diagnosis
from feedsim.analysis.circle import term_name
from feedsim.analysis.circle.words import actionable_causes
from feedsim.analysis.circularity import contour
from feedsim.analysis.evaluate import FIGURE_UNITS, CircleTask, diagnose_turns, tasks
from feedsim.report.formatting import SIMULATED_COLOUR
from feedsim.simulation import cosim

HERE = Path(__file__).resolve().parent
CIRCLE = HERE.parent / "scenarios" / "xz_circle.yaml"
FEEDS, FAST, RADII = (1000, 3000, 10000), (3000, 10000), (30, 60, 100)  # mm/min, mm
BEGIN, END = "<!-- causes: begin -->", "<!-- causes: end -->"
SHOWN, ACROSS, POINTS = (3000, 60), 4, 800  # of the picture; circles beside each other; points of a turn, or more
INDIRECT = tuple(f"machine.axes.{axis}.drive.measuring.indirect=true" for axis in "XZ")


@dataclass(frozen=True)
class Cause:
    """What it is called, the settings that put it in, the term that is expected; whether the tool is looked at, as an
    instrument does; feeds [mm/min].

    Settings may have {bend}, the bend of a guide [1/m] that is 8 um at the circle's edges, and {slope}, what that is in
    the middle [um/m]: errors are zero where an axis starts, here at an edge.
    """

    title: str
    settings: tuple[str, ...]
    term: str = ""
    at_tool: bool = False
    recorded: bool = False
    feeds: tuple[float, ...] = FEEDS


CAUSES = (
    Cause("none", ()),
    Cause("play of X, 8 um (measured at the motors)", ("machine.axes.X.play=8 um", *INDIRECT), "lost_motion X"),
    Cause("too much backlash compensation of X, 8 um",
          ("machine.axes.X.drive.backlash_compensation.value=8 um",), "lost_motion X"),
    Cause("scale of X, 50 um/m", ("machine.axes.X.drive.measuring.linear=50 um/m",), "scale"),
    Cause("squareness X-Z, 50 um/m (at the tool)",
          ("machine.geometry.squareness_XZ=50 um/m",), "squareness", True),
    Cause("K_v of X 1 % low, no feedforward", (
        "machine.axes.X.drive.k_ffw=0", "machine.axes.Z.drive.k_ffw=0",
        "machine.axes.X.drive.K_v=3.96 (m/min)/mm", "machine.axes.Z.drive.K_v=4 (m/min)/mm",
    ), "servo"),
    Cause("both scales 50 um/m too long (temperature)",
          tuple(f"machine.axes.{axis}.drive.measuring.linear=50 um/m" for axis in "XZ"), "radius", feeds=FAST),
    Cause("error of X with its pitch, 2 um", tuple(
        f"machine.axes.X.drive.periodic_error_1.{each}" for each in ("period=20 mm", "amplitude=2 um")
    ), "pitch X", feeds=FAST),
    Cause("eccentric motor encoder of X, 0.6 mrad: 1.91 um with its pitch",
          ("machine.axes.X.drive.encoder.eccentricity=0.6 mrad", *INDIRECT), "pitch X", feeds=FAST),
    Cause("guide of X bent by 8 um at the edges (at the tool)",
          ("machine.geometry.E_ZX_second={bend} 1/m", "machine.geometry.squareness_XZ={slope} um/m"),
          "straightness X", True, True, FAST),
    Cause("elastic hysteresis of X, 4 um",
          ("machine.axes.X.hysteresis.value=4 um", "machine.axes.X.hysteresis.way=50 um", *INDIRECT), "lost_motion X",
          feeds=FAST),
    Cause("cogging of X, 0.4 N.m, six per turn", tuple(
        f"machine.axes.X.drive.cogging_1.{each}" for each in ("order=6", "amplitude=0.4 N.m")
    ), "cogging X"),
    Cause("60 % of the friction of X at its guide", ("machine.axes.X.guide.share=60 %",), "peaks X", feeds=FAST),
)  # fmt: skip


def main() -> None:
    """Write table and picture anew; all feeds and radii are printed, the page has those of the picture."""
    rows, shown = [], {}
    for cause in CAUSES:
        for feed in cause.feeds:
            for radius in RADII:
                found, paths = diagnosis(cause, feed, radius)
                said = words(found, cause)
                if (feed, radius) == SHOWN:
                    rows.append((cause.title, said))
                    shown[cause.title] = paths
                print(cause.title, feed, radius, said, flush=True)
    write(rows, shown)


def write(rows: Sequence[tuple[str, str]], shown: dict[str, list[tuple[np.ndarray, np.ndarray]]]) -> None:
    """Table into the page, and the picture."""
    picture(shown, HERE / "images" / "causes.svg")
    page = HERE / "trust.md"
    text = page.read_text(encoding="utf-8")
    head, rest = text.split(BEGIN)
    page.write_text(f"{head}{BEGIN}\n{table(rows)}{END}{rest.split(END)[1]}", encoding="utf-8")


def diagnosis(cause: Cause, feed: float, radius: float) -> tuple[Diagnosis, list[tuple[np.ndarray, np.ndarray]]]:
    """What is found, and angle [rad] and deviation [m] of the turns."""
    R = radius / 1e3
    own = [each.format(bend=8e-6 / R**2, slope=2 * 8 / R) for each in cause.settings]
    settings = (f"motions.0.radius={radius} mm", f"motions.0.feed={feed} mm/min", *own)
    run = cosim.run(scenario.load(CIRCLE, list(settings)), fmus=HERE.parent / "fmus")
    (task,) = (each for each in tasks(run.scenario, run.program) if isinstance(each, CircleTask))
    columns = ("tcp.x_X", "tcp.x_Z") if cause.at_tool else None
    response = None if cause.at_tool else task.response  # of the scales
    found = diagnose_turns(
        run.trace, task.turns, task.pitch, task.gain, task.drag, columns, cause.recorded, response, task.following
    )
    assert found is not None
    turns = [contour(run.trace, turn, columns) for turn in task.turns]
    return found, [(turn.angle, turn.deviation) for turn in turns]


def words(found: Diagnosis, cause: Cause) -> str:
    """The causes that a report names, the first first; friction's peaks, which this machine always has, and the mean
    radius only where they are asked for; cogging that was put in also where it is a small part of G. Of unlike
    amplitudes what the response of the axes makes of them."""
    named = []
    names = {cause.term} & {"radius", "cogging X"}
    told = actionable_causes(found)
    asked = [
        term for term in found.terms
        if f"{term.key} {term.axis}".strip() in names and term.shows and term not in told
    ]  # fmt: skip
    for term in [*told, *asked]:
        if term.key == "offset" or (term.key == "peaks" and not cause.term.startswith("peaks")):
            continue
        factor, unit = FIGURE_UNITS[term.unit]
        text = f"{term_name(term)} {factor * term.value:.3g} +- {factor * term.half:.2g} {unit}"
        if term.key == "scale" and found.unlike is not None and abs(found.unlike) > term.half:
            text += f" (by the response of the axes {1e6 * found.unlike:.3g})"
        named.append(f"**{text}**" if f"{term.key} {term.axis}".strip() == cause.term else text)
    for each in found.vibrations:
        text = f"vibration of {each.axis} {1e6 * each.amplitude:.2g} um at {each.frequency:.3g} Hz"
        named.append(f"**{text}**" if cause.term == f"vibration {each.axis}" else text)
    return "; ".join(named) or "none"


def table(rows: Sequence[tuple[str, str]]) -> str:
    return "| cause | what a report names |\n|---|---|\n" + "".join(f"| {title} | {said} |\n" for title, said in rows)


def picture(shown: dict[str, list[tuple[np.ndarray, np.ndarray]]], file: Path) -> None:
    """A small circle for each, deviation from the programmed one magnified to the same share of the radius."""
    import matplotlib

    matplotlib.use("svg")
    matplotlib.rcParams.update({"svg.hashsalt": "causes", "svg.fonttype": "path", "font.size": 8})
    from matplotlib import pyplot

    rows = -(-len(shown) // ACROSS)
    figure, places = pyplot.subplots(rows, ACROSS, figsize=(3 * ACROSS, 3.1 * rows))
    for place in places.flat:
        place.axis("off")
    for place, (title, turns) in zip(places.flat, shown.items(), strict=False):
        largest = max(float(np.abs(deviation).max()) for _, deviation in turns)
        circle = np.linspace(0, 2 * np.pi, 400)
        place.plot(np.cos(circle), np.sin(circle), color="#b0b0b0", linewidth=0.7)
        for (angle, deviation), line in zip(turns, ("-", "--"), strict=True):  # directions, as in reports
            r = 1 + 0.35 * deviation / largest
            order = np.argsort(angle)[:: max(1, len(angle) // POINTS)]
            place.plot(
                (r * np.cos(angle))[order], (r * np.sin(angle))[order], line, color=SIMULATED_COLOUR, linewidth=1
            )
        place.set_title(f"{textwrap.fill(title, 34)}\nlargest deviation {1e6 * largest:.3g} um")
        place.set_aspect("equal")
    figure.tight_layout()
    figure.savefig(file, metadata={"Date": None, "Creator": None})


if __name__ == "__main__":
    main()
