"""A drive tuned within stability margins on a simulated machine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

from feedsim import scenario as scenarios
from feedsim.analysis import Figure
from feedsim.arguments import Value, amount, given, quantity, settings, spelt
from feedsim.errors import InputError
from feedsim.jobs.parameters import (
    Archives,
    Argument,
    ControlName,
    Draws,
    FigureKinds,
    File,
    Force,
    Option,
    Settings,
    job,
    out,
)
from feedsim.jobs.result import Result, in_words_of, kept
from feedsim.jobs.watch import NO_WATCH, Watch, announce
from feedsim.report.content import Report
from feedsim.report.provenance import input_paths
from feedsim.report.results import Content
from feedsim.report.tune import drive as drive_files
from feedsim.report.tune import drive as page
from feedsim.scenario import Machine
from feedsim.scenario.structure.load import load_structure
from feedsim.structure import Modes
from feedsim.structure.build import build
from feedsim.tune.drive import EVALUATIONS
from feedsim.tune.drive import tune_drive as tune
from feedsim.tune.drive_program import check_axis
from feedsim.tune.drive_result import Changed, Limits, Tuned
from feedsim.uncertainty import check_count, cloud_of

LEAST_EVALUATIONS = 10


@dataclass(frozen=True, eq=False, repr=False)
class TuneDriveResult(Result):
    """A tuned drive.

    tuned: its values, margins and motions. control: in whose names values are shown, too. asked: name -> text of what
    was asked for. folder: that it was written to first, as the caller spelt it; "": none.
    """

    tuned: Tuned
    control: str = ""
    asked: Mapping[str, str] = field(default_factory=dict)
    folder: str = ""

    kind = page.KIND

    @property
    def inputs(self) -> Sequence[Path]:
        """Files of the scenario."""
        return input_paths(self.tuned.scenario)

    @property
    def changes(self) -> Sequence[Changed]:
        """Every value to type: axis, parameter, old and new."""
        return self.tuned.changes

    @cached_property
    def figures(self) -> Mapping[str, Figure]:
        """ "Z.peak_reduction", "Z.overshoot_before", "Z.gain_margin_after" ..."""
        return page.figures_of(self.tuned)

    @property
    def findings(self) -> Sequence[str]:
        """Motions that get worse, and what the values rest on."""
        return page.findings(self.tuned)

    @property
    def answers(self) -> Sequence[str]:
        """What the tuned drive does, or why there is none."""
        return page.answers(self.tuned)

    @property
    def lines(self) -> Sequence[str]:
        """The answer, and the values to type."""
        return [*self.answers, *drive_files.lines_of(drive_files.rows(self.tuned, self.control))]

    def files(self) -> Mapping[str, Content]:
        """Values to load, values to type, and a drive file for the tuned axis and for every other that changes."""
        result = {
            drive_files.SETTINGS: drive_files.settings(self.tuned),
            drive_files.SHEET: drive_files.sheet(self.tuned, self.control),
        }
        return {**result, **drive_files.drives(self.tuned)}

    def report(self) -> Report:
        """Content of report.html."""
        return page.report_of(self.tuned, self.control, self.folder)

    def summary(self, names: Sequence[str]) -> Mapping[str, Any]:
        """Content of summary.json."""
        return page.summary(self.tuned, names, self.asked)

    def check_writable(self, folder: Path, inputs: Sequence[Path] = ()) -> None:
        """Raise OutputError unless the result can be written to `folder`."""
        page.check_writable(folder, list(self.tuned.scenario.machine.axes), inputs)


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
    out: Annotated[File | None, out("tune_drive_{scenario}_{axes}")] = None,
    figures: FigureKinds = (),
    force: Force = False,
    control: ControlName = "",
    watch: Watch = NO_WATCH,
) -> TuneDriveResult:
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
        raise InputError(f"{spelt('evaluations')} {evaluations}: at least {LEAST_EVALUATIONS} are needed")
    changes = settings(set)
    plan = scenarios.load(scenario, changes)
    try:
        check_axis(plan, axes)
    except InputError as error:
        raise InputError(f"{spelt('axes')} {axes}: {error}") from None
    cloud = None
    if uncertain:
        check_count(uncertain)
        cloud = cloud_of(plan.machine)
    archives = None if fmus is None else Path(fmus)
    machine_axes = list(plan.machine.axes)
    places = _places(plan.machine, at)
    asked = _asked(axes, limits, at, evaluations, uncertain)

    def check(folder: Path, inputs: Sequence[Path]) -> None:
        page.check_writable(folder, machine_axes, inputs)

    with in_words_of(control), kept(
        out, check, watch, input_paths(plan), [*changes, *(f"{name}={text}" for name, text in asked.items())],
        force=force,
    ):  # fmt: skip
        announce(watch, plan.machine, archives, plan.coupling)
        poses = _poses(plan.machine, places, watch)
        tuned = tune(
            plan, axes, limits, poses, fmus=archives, progress=watch.progress, evaluations=evaluations, cloud=cloud,
            count=uncertain,
        )  # fmt: skip
        result = TuneDriveResult(tuned, control, asked, "" if out is None else str(out))
        if out is not None:
            result.save(out, figures=figures, force=force, control=control)
    return result


def _positive(name: str, value: Value, unit: str, example: str, *, zero: bool = False) -> float:
    result = _decibels(value, name) if unit == "dB" else quantity(name, value, unit, example)
    if result < 0 or (result == 0 and not zero):
        raise InputError(f"{spelt(name)} {value}: more than zero is needed, e.g. {example}")
    return result


def _decibels(value: Value, name: str) -> float:
    if not isinstance(value, str):
        return float(value)
    number = value.strip().removesuffix("dB").strip()
    try:
        return float(number)
    except ValueError:
        raise InputError(f"{spelt(name)} {value}: a number of dB is needed, e.g. 8 dB") from None


def _asked(axis: str, limits: Limits, at: Sequence[str], evaluations: int, uncertain: int) -> dict[str, str]:
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
            f"leave {spelt('at')} out"
        )
    return {text: _place(machine, text) for text in texts}


def _place(machine: Machine, text: str) -> dict[str, float]:
    pose: dict[str, float] = {}
    for part in text.split(","):
        axis, equals, position = (name.strip() for name in part.partition("="))
        if not equals or axis not in machine.axes:
            raise InputError(
                f"{spelt('at')} {text}: AXIS=POSITION is needed, e.g. Z=600mm; axes are {', '.join(machine.axes)}"
            )
        if axis in pose:
            raise InputError(f"{spelt('at')} {text}: {axis} is given twice")
        with given("at", text):
            pose[axis] = amount(position, "m", "600 mm")
        low, high = machine.axes[axis].travel
        if not low <= pose[axis] <= high:
            raise InputError(
                f"{spelt('at')} {text}: {axis} is outside of its travel, {low * 1e3:.6g} to {high * 1e3:.6g} mm"
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
