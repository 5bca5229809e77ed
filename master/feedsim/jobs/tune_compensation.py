"""A friction compensation as a control has it, found on a simulated machine."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Annotated

from feedsim import scenario as scenarios
from feedsim.analysis import FigureTable
from feedsim.analysis.proposals import check_controlled
from feedsim.design.tune.compensators import COMPENSATOR_KINDS, OBJECTIVES, JudgedCompensation, tune
from feedsim.design.uncertainty import check_count, cloud_of
from feedsim.files.fields import no_axis
from feedsim.foundation.arguments import settings, spell_argument, split_names
from feedsim.foundation.errors import InputError
from feedsim.jobs.parameters import (
    NO_WATCH,
    Archives,
    Argument,
    Draws,
    FigureKinds,
    File,
    Force,
    Option,
    Settings,
    Watch,
    job,
    output_option,
)
from feedsim.jobs.result import Kind, Result, announce_programs, claim_result_folder
from feedsim.report import tune as page
from feedsim.report.provenance import input_paths
from feedsim.report.tune.drive import lines_of
from feedsim.report.tune.report import SETTINGS, SHEET

KIND = Kind("tune", page.FILES)


def result_of(judged: JudgedCompensation) -> Result[JudgedCompensation]:
    """A friction compensation: its values, and errors of circles without and with it."""
    return Result(
        KIND,
        judged,
        partial(page.report_of, judged),
        figures=FigureTable(page.figures_of(judged)),
        details=partial(page.details, judged),
        files=lambda: {SETTINGS: page.settings(judged), SHEET: page.sheet(judged)},
        inputs=input_paths(judged.scenario),
        rows=lambda: lines_of(row.split(",") for row in page.sheet(judged).splitlines()[1:]),
    )


@job("values of a friction compensation, judged on other circles")
def tune_compensation(
    scenario: Annotated[File, Argument("SCENARIO.yaml", "scenario with a circle")],
    *,
    kind: Annotated[
        str, Option("KIND", "pulse, pulse_characteristic, table or model (default: pulse_characteristic)")
    ] = "pulse_characteristic",
    axes: Annotated[
        str | Sequence[str] | None, Option("NAMES", "axes of the plane that are compensated (default: both)")
    ] = None,
    objective: Annotated[str, Option("NAME", "what is minimised: ratio, worst or largest (default: ratio)")] = "ratio",
    uncertain: Draws = 0,
    set: Settings = None,
    fmus: Archives = None,
    out: Annotated[File | None, output_option("tune_{scenario}")] = None,
    figures: FigureKinds = (),
    force: Force = False,
    watch: Watch = NO_WATCH,
) -> Result[JudgedCompensation]:
    """Find the values of a friction compensation on short circles, and judge them on other radii and feeds.

    A pulse on the speed setpoint, constant or with a characteristic over the acceleration (SINUMERIK), a torque over
    the commanded speed (TwinCAT CNC), or the friction model as torque feedforward.

    Command line:
        feedsim example xz_circle
        feedsim tune compensation xz_circle.yaml --kind pulse
        feedsim tune compensation xz_circle.yaml --kind table --axes Z --out results/table

    Raises:
        InputError: a faulty file, no circle, units of other makers, an unknown kind or objective, no identified
            values to draw.
        SimulationError: a unit failed.
        OutputError: `out` cannot be written.

    >>> import feedsim as fs
    >>> slow = {"machine.axes.Z.max_speed": "1 m/min"}  # a few circles only
    >>> result = fs.tune_compensation("xz_circle.yaml", kind="model", axes="Z", set=slow)
    >>> float(result.figures["held_out.median"]) > 95
    True
    """
    for name, value, known in (("kind", kind, COMPENSATOR_KINDS), ("objective", objective, OBJECTIVES)):
        if value not in known:
            raise InputError(f"{spell_argument(name)} {value}: of {', '.join(known)}")
    changes = settings(set)
    plan = scenarios.load(scenario, changes)
    planes = [motion.plane for motion in plan.motions if motion.kind == "circle"]
    if not planes:
        raise InputError(f"{plan.file}: has no circle, whose plane would be that of the circles to tune on")
    plane = planes[0]
    wanted = plane if axes is None else split_names(axes)
    for axis in wanted:
        if axis not in plane:
            raise InputError(f"{spell_argument('axes')} {','.join(wanted)}: {no_axis(axis, plane)}")
        plan.machine.friction_of(axis, "tuning")
        check_controlled(plan.machine, axis)
    if not wanted or len(dict.fromkeys(wanted)) < len(wanted):
        raise InputError(
            f"{spell_argument('axes')} {','.join(wanted)}: names of axes are needed, each once, such as X,Z"
        )
    cloud = None
    if uncertain:
        check_count(uncertain)
        cloud = cloud_of(plan.machine)
    archives = None if fmus is None else Path(fmus)
    with claim_result_folder(out, KIND, watch, input_paths(plan), changes, force=force):
        announce_programs(watch, plan.machine, archives, plan.coupling)
        judged = tune(
            plan,
            kind,
            plane,
            tuple(wanted),
            objective,
            fmus=archives,
            progress=watch.progress,
            cloud=cloud,
            count=uncertain,
        )
        result = result_of(judged)
        if out is not None:
            result.save(out, figures=figures, force=force)
    return result
