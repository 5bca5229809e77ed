"""report.html of a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from feedsim.analysis import Figure
from feedsim.report.frame import Tile, frame, picture_section, tile_value
from feedsim.report.pose_section import pose_section
from feedsim.report.run_tables import motions_table, provenance
from feedsim.report.style import Picture
from feedsim.report.summary import HEADER, Run, is_leading, real_time_factor
from feedsim.report.tables import figures_table
from feedsim.report.words import typeset

TILES = {
    "overshoot": "overshoot",
    "settling_time": "settling time",
    "duration": "duration of the motion",
    "peak_torque": "largest motor torque",
    "plateau_torque": "motor torque at constant speed",
    "rest_torque": "friction torque at rest",
    "ringing_frequency": "ringing frequency",
    "G": "circular deviation G",
    "F_max": "largest radial deviation F max",
    "F_min": "smallest radial deviation F min",
    "mean": "mean radius deviation",
}


def page(run: Run, figures: Mapping[str, Figure], pictures: Sequence[Picture]) -> str:
    """HTML text of the report."""
    scenario, machine = run.scenario, run.scenario.machine
    return frame(
        scenario.name,
        f"{machine.name} · {len(scenario.motions)} motion(s), {run.program.duration:.4g} s",
        warnings=run.warnings,
        notes=(machine.note, scenario.note),
        tiles=[
            Tile(*tile(name, figure), typeset(figure.meaning))
            for name, figure in figures.items()
            if is_leading(name, HEADER)
        ],
        main=[
            *(picture_section(picture) for picture in pictures),
            figures_table(figures),
            motions_table(run),
            pose_section(run.pose),
            provenance(run),
        ],
        footer=_footer(run, figures),
    )


def tile(name: str, figure: Figure) -> tuple[str, str]:
    """Value with unit, and name in words, of a figure's tile."""
    prefix, _, key = name.partition(".")
    label = f"quadrant glitch, {key[7:]} reverses" if key.startswith("glitch_") else TILES.get(key, key)
    return tile_value(figure), f"{prefix.replace('#', ' no. ')}: {label}"


def _footer(run: Run, figures: Mapping[str, Figure]) -> str:
    factor = real_time_factor(run)
    speed = f" ({factor:.2g} times real time)" if factor is not None else ""
    defined = (
        'What each figure means stands beside it in the table <a href="#figures">Derived figures</a>; the full '
        "definitions come with the software (docs/figures.md). "
    )
    return (
        f"{defined if figures else ''}Values in full precision: summary.json; time series: result.csv. "
        f"{run.program.duration:.4g} s simulated in {run.wall_time:.3g} s{speed}."
    )
