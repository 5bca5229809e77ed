"""A drive tuned within stability margins on a simulated machine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated

from feedsim import scenario as scenarios
from feedsim.analysis import FigureTable
from feedsim.analysis.proposals import Proposal, of_run
from feedsim.design.tune.drive import EVALUATIONS, Limits, TunedDrive
from feedsim.design.tune.drive import tune_drive as tune
from feedsim.design.tune.drive_program import check_axis
from feedsim.design.uncertainty import check_count, cloud_of
from feedsim.estimation.replay.machine_files import drive_file
from feedsim.files.source import is_ssp
from feedsim.foundation.arguments import Value, amount, prefix_argument_errors, quantity, settings, spell_argument
from feedsim.foundation.errors import InputError
from feedsim.jobs.diff import KIND as KIND_OF_OVERLAYS
from feedsim.jobs.diff import Overlay, diff
from feedsim.jobs.diff import result_of as result_of_overlay
from feedsim.jobs.parameters import (
    NO_WATCH,
    Archives,
    Argument,
    ControlName,
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
from feedsim.jobs.result import Kind, Result, announce_programs, claim_result_folder, in_words_of
from feedsim.jobs.run import KIND as KIND_OF_RUNS
from feedsim.jobs.run import EvaluatedRun, run
from feedsim.jobs.run import result_of as result_of_run
from feedsim.report.changes import change_lines
from feedsim.report.provenance import input_paths
from feedsim.report.tune import drive as page
from feedsim.scenario import Machine, load
from feedsim.scenario.structure_checks import load_structure
from feedsim.simulation import cosim
from feedsim.simulation.judge import judge_run
from feedsim.structure import Modes
from feedsim.structure.build import build

LEAST_EVALUATIONS = 10


KIND = Kind("tune-drive", (page.SETTINGS, page.SHEET))


def result_of(tuned: TunedDrive, control: str, asked: Mapping[str, str], folder: str) -> Result[TunedDrive]:
    """A tuned drive: values to load and to type, margins and motions before and after.

    control: in whose names values are shown, too. asked: name -> text of what was asked for. folder: that it is written
    to first, as the caller spelt it; "": none.
    """
    return Result(
        KIND,
        tuned,
        lambda: page.report_of(tuned, control, folder),
        figures=FigureTable(page.figures_of(tuned)),
        details=lambda: page.details(tuned, asked),
        files=lambda: {
            page.SETTINGS: page.settings(tuned),
            page.SHEET: page.sheet(tuned, control),
            **page.drives(tuned),
        },
        inputs=input_paths(tuned.scenario),
        rows=lambda: page.lines_of(page.rows(tuned, control)),
    )


@job("values of a drive within stability margins")
def tune_drive(
    scenario: Annotated[File, Argument("SCENARIO.yaml", "scenario whose machine is meant")],
    axes: Annotated[str, Option("NAME", "axis whose drive is tuned")],
    *,
    gain_margin: Annotated[Value, Option("DB", "least gain margin (default: 8 dB)")] = 8.0,
    phase_margin: Annotated[Value, Option("DEG", "least phase margin (default: 40 deg)")] = 40.0,
    encoder_noise: Annotated[
        Value,
        Option(
            "ANGLE",
            "standard deviation of the motor encoder's angle per control cycle; it bounds the gains (default: 10 urad)",
        ),
    ] = 1e-05,
    at: Annotated[
        Sequence[str],
        Option(
            "POSE",
            "a further pose at which the margins hold, such as X=100mm,Z=600mm; may be given several times",
            many=True,
        ),
    ] = (),
    evaluations: Annotated[int, Option("N", "candidates per start of the search (default: 130)")] = EVALUATIONS,
    uncertain: Draws = 0,
    set: Settings = None,
    fmus: Archives = None,
    out: Annotated[File | None, output_option("tune_drive_{scenario}_{axes}")] = None,
    figures: FigureKinds = (),
    force: Force = False,
    control: ControlName = "",
    watch: Watch = NO_WATCH,
) -> Result[TunedDrive]:
    """Tune the drive of an axis within margins: K_p, T_n, K_v, T_sym, T_dyn, reference model, current filters.

    Margins hold at the pose of the machine file and at further ones, for elastic modes 10 % lower and higher. Moves and
    circles of the axis are run; the result is judged on others.

    Command line:
        feedsim example z_positioning
        feedsim tune drive z_positioning.yaml --axes Z
        feedsim tune drive z_positioning.yaml --axes Z --control sinumerik --at Z=600mm --at X=100mm,Z=600mm
        feedsim run z_positioning.yaml --set machine.axes.Z.drive=results/tune_drive_z_positioning_Z/drive_Z.yaml

    Raises:
        InputError: a faulty file, no such axis, units of other makers, a pose that cannot be had, no
            identified values to draw.
        SimulationError: a unit failed.
        OutputError: `out` cannot be written.

    >>> import feedsim as fs
    >>> result = fs.tune_drive("z_positioning.yaml", "Z", evaluations=20)
    >>> [change.parameter for change in result.changes][:1], float(result.figures["Z.gain_margin_after"]) > 8
    (['drive.K_v'], True)
    """
    limits = Limits(
        _positive("gain_margin", gain_margin, "dB", "8 dB"),
        _positive("phase_margin", phase_margin, "deg", "40 deg"),
        _positive("encoder_noise", encoder_noise, "rad", "10 urad", zero=True),
    )
    if evaluations < LEAST_EVALUATIONS:
        raise InputError(f"{spell_argument('evaluations')} {evaluations}: at least {LEAST_EVALUATIONS} are needed")
    changes = settings(set)
    plan = scenarios.load(scenario, changes)
    try:
        check_axis(plan, axes)
    except InputError as error:
        raise InputError(f"{spell_argument('axes')} {axes}: {error}") from None
    cloud = None
    if uncertain:
        check_count(uncertain)
        cloud = cloud_of(plan.machine)
    archives = None if fmus is None else Path(fmus)
    places = _places(plan.machine, at)
    asked = _settings_texts(axes, limits, at, evaluations, uncertain)
    kind = replace(KIND, may_write=(*KIND.may_write, *map(drive_file, plan.machine.axes)))

    with in_words_of(control), claim_result_folder(
        out, kind, watch, input_paths(plan), [*changes, *(f"{name}={text}" for name, text in asked.items())],
        force=force,
    ):  # fmt: skip
        announce_programs(watch, plan.machine, archives, plan.coupling)
        poses = _poses(plan.machine, places, watch)
        tuned = tune(
            plan, axes, limits, poses, fmus=archives, progress=watch.progress, evaluations=evaluations, cloud=cloud,
            count=uncertain,
        )  # fmt: skip
        result = result_of(tuned, control, asked, "" if out is None else str(out))
        if out is not None:
            result.save(out, figures=figures, force=force, control=control)
    return result


def _positive(name: str, value: Value, unit: str, example: str, *, zero: bool = False) -> float:
    result = _decibels(value, name) if unit == "dB" else quantity(name, value, unit, example)
    if result < 0 or (result == 0 and not zero):
        raise InputError(f"{spell_argument(name)} {value}: more than zero is needed, e.g. {example}")
    return result


def _decibels(value: Value, name: str) -> float:
    if not isinstance(value, str):
        return float(value)
    number = value.strip().removesuffix("dB").strip()
    try:
        return float(number)
    except ValueError:
        raise InputError(f"{spell_argument(name)} {value}: a number of dB is needed, e.g. 8 dB") from None


def _settings_texts(axis: str, limits: Limits, at: Sequence[str], evaluations: int, uncertain: int) -> dict[str, str]:
    """What was asked for besides changes of the scenario, the same text for the same value."""
    result = {
        "axes": axis,
        "gain_margin": f"{limits.gain_margin:g} dB",
        "phase_margin": f"{limits.phase_margin:g} deg",
        "encoder_noise": f"{1e6 * limits.encoder_noise:g} urad",
        "evaluations": str(evaluations),
    }
    result |= {"at": "; ".join(at)} if at else {}
    return result | ({"uncertain": str(uncertain)} if uncertain else {})


def _places(machine: Machine, texts: Sequence[str]) -> dict[str, dict[str, float]]:
    """Text of a further pose -> axis -> position [m]."""
    if texts and machine.structure is None:
        raise InputError(
            f"{machine.name}: has no structure to compute modes from at another pose; give it the key structure, or "
            f"leave {spell_argument('at')} out"
        )
    return {text: _place(machine, text) for text in texts}


def _place(machine: Machine, text: str) -> dict[str, float]:
    pose: dict[str, float] = {}
    for part in text.split(","):
        axis, equals, position = (name.strip() for name in part.partition("="))
        if not equals or axis not in machine.axes:
            raise InputError(
                f"{spell_argument('at')} {text}: AXIS=POSITION is needed, e.g. Z=600mm; axes are "
                f"{', '.join(machine.axes)}"
            )
        if axis in pose:
            raise InputError(f"{spell_argument('at')} {text}: {axis} is given twice")
        with prefix_argument_errors("at", text):
            pose[axis] = amount(position, "m", "600 mm")
        low, high = machine.axes[axis].travel
        if not low <= pose[axis] <= high:
            raise InputError(
                f"{spell_argument('at')} {text}: {axis} is outside of its travel, {low * 1e3:.6g} to "
                f"{high * 1e3:.6g} mm"
            )
    return {axis: machine.pose[axis] for axis in machine.axes} | pose


def _poses(machine: Machine, places: Mapping[str, Mapping[str, float]], watch: Watch) -> dict[str, Modes]:
    """Name -> modes of further poses, computed from the structure."""
    result: dict[str, Modes] = {}
    for k, (text, pose) in enumerate(places.items()):
        watch.progress("poses", k, len(places))
        assert machine.structure is not None
        result[text] = build(load_structure(machine.structure), pose).solution.modes
    if places:
        watch.progress("poses", len(places), len(places))
    return result


# --- The values that the report of a run proposes, tried in a second run that is laid over the first ------------------


# Figures whose change is shown, by what stands behind the last dot.
TRIED_FIGURES = ("G", "overshoot", "settling_time")
SHOWN_OF_AXES = ("peak_", "servo_mismatch")


class TriedProposals(Overlay):
    """A run as it is, and with all proposals that have a value; one run alone where none has.

    Attributes:
        runs: the run as it is, and the one with the proposals.
        proposals: all of them. settings: those with a value, as behind ``--set``.
    """

    def __init__(self, runs: Sequence[Result[EvaluatedRun]], proposals: Sequence[Proposal]) -> None:
        super().__init__(dict(zip(("as it is", "with the proposals"), runs, strict=False)))
        self.runs, self.proposals = tuple(runs), tuple(proposals)
        self.settings = settings_of(proposals)


def _lines_of(tried: TriedProposals) -> list[str]:
    """What the run is, what was changed, and the leading figures before and after."""
    first, *second = tried.runs
    if not second:
        return [*first.lines, "nothing to try: no proposal has a value"]
    changed = [
        f"tried: {name} {first.figures[name]} -> {figure}"
        for name, figure in second[0].figures.items()
        if name in first.figures and _is_leading_figure(name)
    ]
    return [*first.lines, *change_lines(tried.proposals), *changed]


def settings_of(proposals: Sequence[Proposal]) -> tuple[str, ...]:
    """Those that have a value, as behind ``--set``."""
    return tuple(proposal.setting for proposal in proposals if proposal.setting)


@job("a run with the values that its report proposes")
def tune_proposals(
    scenario: Annotated[File, Argument("SCENARIO.yaml", "scenario file (docs/scenarios.md)")],
    *,
    set: Settings = None,
    fmus: Archives = None,
    out: Annotated[File | None, output_option("{scenario}")] = None,
    figures: FigureKinds = (),
    force: Force = False,
    control: ControlName = "",
    watch: Watch = NO_WATCH,
) -> Result[TriedProposals]:
    """Run a scenario, and again with all values that the report of that run proposes.

    Writes the run as it is to the folder, the second one beside it to NAME_tried, and both over each other to
    NAME_overlay.

    Command line:
        feedsim example xz_circle
        feedsim tune proposals xz_circle.yaml --set machine.axes.Z.drive.T_sym="2.9 ms"

    Raises:
        InputError: as of :func:`feedsim.run`; an SSP file, whose values cannot be changed.
        SimulationError: a unit failed.
        OutputError: `out`, or a folder beside it, cannot be written.

    >>> import feedsim as fs
    >>> result = fs.tune_proposals("xz_circle.yaml", set={"machine.axes.Z.drive.T_sym": "2.9 ms"})
    >>> len(result.runs), result.settings[0].partition("=")[0]
    (2, 'machine.axes.Z.drive.T_sym')
    """
    if is_ssp(Path(scenario)):
        raise InputError(f"{scenario}: is an SSP file; values are changed in scenario files")
    folders = _folders(out)
    if folders is not None:
        KIND_OF_RUNS.check_place(folders["tried"])
        KIND_OF_OVERLAYS.check_place(folders["overlay"])
    first = run(scenario, set=set, fmus=fmus, out=out, figures=figures, force=force, control=control, watch=watch)
    proposals = of_run(first.value, first.causes, first.figures, searched=True)
    runs = [first]
    if settings := settings_of(proposals):
        plan = first.scenario
        changed = load(plan.file, [*plan.overrides, *settings])
        progress = watch.of(f"{plan.name}, tried")
        archives = None if fmus is None else Path(fmus)
        runs.append(result_of_run(EvaluatedRun.of(judge_run(cosim.run(changed, fmus=archives, progress=progress)))))
    place = folders["overlay"] if folders is not None and settings else None
    if folders is not None and settings:
        runs[1].save(folders["tried"], figures=figures, force=force, control=control)
        diff(str(out), folders["tried"]).save(folders["overlay"], figures=figures, force=force, control=control)
    tried = TriedProposals(runs, proposals)
    return result_of_overlay(tried, first.findings, partial(_lines_of, tried), place)


def _folders(out: File | None) -> Mapping[str, Path] | None:
    """The folders beside that of the first run."""
    if out is None:
        return None
    return {name: Path(out).with_name(f"{Path(out).name}_{name}") for name in ("tried", "overlay")}


def _is_leading_figure(name: str) -> bool:
    prefix, _, key = name.partition(".")
    return key in TRIED_FIGURES or (key.startswith(SHOWN_OF_AXES) and "." not in key and bool(prefix))
