"""A circle without and with friction compensation by torque feedforward."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated

from feedsim import analysis
from feedsim import scenario as scenarios
from feedsim.analysis import compensation
from feedsim.analysis.compensation import Compensation, check_moves, lags_of, moving_axes
from feedsim.design.uncertainty import (
    Cloud,
    KnownValues,
    Uncertainty,
    check_count,
    cloud_of,
    known_of,
    known_values,
    of_compensation,
)
from feedsim.files.trace import write_csv
from feedsim.foundation.arguments import Pairs, Value, amount, by_name, pairs, settings, spell_argument
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
from feedsim.report import compensate as page
from feedsim.report import uncertainty as intervals
from feedsim.report.content import Report
from feedsim.report.provenance import input_paths
from feedsim.report.results import Content
from feedsim.scenario.load import read_friction
from feedsim.simulation import nc

KIND = Kind("compensate", page.FILES)


@dataclass(frozen=True, eq=False)
class CompensatedCircle:
    """A circle without and with compensation.

    compensation: both runs, the feedforward, what errors cost. frictions: axis -> file that the friction of its
    compensation comes from. uncertainty: intervals by draws of identified values, where they were asked for.
    """

    compensation: Compensation
    frictions: Mapping[str, Path]
    uncertainty: Uncertainty | None = None


def result_of(value: CompensatedCircle) -> Result[CompensatedCircle]:
    """A circle without and with compensation: G and glitches before and after, and what errors cost."""
    done, uncertainty = value.compensation, value.uncertainty
    figures = analysis.FigureTable(done.figures).with_intervals({} if uncertainty is None else uncertainty.figures)
    keys = ["G", *(f"glitch_{axis}" for axis in done.turn.axes)]
    leading = [f"{which}.{key}" for which in ("before", "after") for key in keys]

    def report() -> Report:
        content = page.report_of(done, value.frictions)
        return content if uncertainty is None else intervals.with_intervals(content, uncertainty, figures, leading)

    def files() -> Mapping[str, Content]:
        return {
            page.RESULT: partial(write_csv, trace=done.after.trace),
            page.UNCOMPENSATED: partial(write_csv, trace=done.before.trace),
            page.FEEDFORWARD: partial(write_csv, trace=done.feedforward),
            **({intervals.BANDS: intervals.bands_csv(uncertainty)} if uncertainty is not None else {}),
            **({page.TABLE: page.table_csv(done)} if done.table else {}),
        }

    said = [] if uncertainty is None else intervals.answers(uncertainty, figures, leading)
    return Result(
        KIND,
        value,
        report,
        figures=figures,
        details=lambda: page.details(done, value.frictions, uncertainty),
        files=files,
        inputs=[*input_paths(done.scenario), *value.frictions.values()],
        lines=[f"  {line}" for line in (page.summary_line(done), *said)],
    )


@job("a circle without and with torque feedforward of friction")
def tune_feedforward(
    scenario: Annotated[File, Argument("SCENARIO.yaml", "scenario with a circle")],
    *,
    friction: Annotated[
        Pairs[File],
        Option(
            "AXIS=FILE.yaml",
            "friction parameters that the compensation of an axis uses (default: the machine's own, which the machine "
            "keeps in any case); may be given several times",
            many=True,
        ),
    ] = None,
    delay: Annotated[
        Value | Pairs[Value],
        Option(
            "[AXIS=]VALUE",
            "delay of the feedforward behind the speed setpoint, e.g. '4.2 ms' (default: from the parameters of the "
            "drive); may be given several times",
            many=True,
        ),
    ] = None,
    table: Annotated[
        bool, Option("", "with the runs that show what errors of the delay and of the parameters cost (default: yes)")
    ] = True,
    uncertain: Draws = 0,
    set: Settings = None,
    fmus: Archives = None,
    out: Annotated[File | None, output_option("feedforward_{scenario}")] = None,
    figures: FigureKinds = (),
    force: Force = False,
    watch: Watch = NO_WATCH,
) -> Result[CompensatedCircle]:
    """Run a circle without and with friction compensation of every axis that moves.

    A friction model, driven by the speed setpoint with the lag of the axis, gives a torque that is added to the torque
    setpoint. Without --friction the model has the machine's own parameters: what is possible at best. With the file of
    an identified set it shows how well that set compensates.

    Command line:
        feedsim example xz_circle
        feedsim tune feedforward xz_circle.yaml
        feedsim tune feedforward xz_circle.yaml --friction X=friction_x.yaml --friction Z=friction_z.yaml
        feedsim tune feedforward xz_circle.yaml --delay "4.2 ms" --no-table

    Raises:
        InputError: a faulty file, no circle, an axis that rests, a drive whose lag is not known, no identified values
            to draw.
        SimulationError: a unit failed.
        OutputError: `out` cannot be written.

    >>> import feedsim as fs
    >>> result = fs.tune_feedforward("xz_circle.yaml", table=False)
    >>> float(result.figures["before.G"]) > 5 * float(result.figures["after.G"])
    True
    """
    changes = settings(set)
    plan = scenarios.load(scenario, changes)
    program = nc.plan(plan)
    compensation.circle_task(plan, program)
    named = pairs("friction", friction, "AXIS=FILE.yaml is needed, such as Z=friction_z.yaml")
    files = by_name("friction", named, lambda axis, file: _file(axis, file, program))
    sets = {axis: read_friction(file) for axis, file in files.items()}
    delays = _delays(delay, program)
    _check_lags(plan, [axis for axis in moving_axes(program) if axis not in delays])
    known, cloud = _open_of(plan, sets, uncertain)
    archives = None if fmus is None else Path(fmus)
    with claim_result_folder(out, KIND, watch, [*input_paths(plan), *files.values()], changes, force=force):
        announce_programs(watch, plan.machine, archives, plan.coupling)
        done = compensation.compensate(
            plan, program, frictions=sets, delays=delays, table=table,
            machines=_changed_machines(plan, program) if table else {}, fmus=archives, progress=watch.progress,
        )  # fmt: skip
        uncertainty = None
        if uncertain:
            uncertainty = of_compensation(done, known, cloud, uncertain, fmus=archives, progress=watch.progress)
        result = result_of(CompensatedCircle(done, files, uncertainty))
        if out is not None:
            result.save(out, figures=figures, force=force)
    return result


def _open_of(
    plan: scenarios.Scenario, sets: Mapping[str, scenarios.FrictionParameters], count: int
) -> tuple[dict[str, KnownValues], Cloud | None]:
    """What is known of sets that compensate, by axis, and of the machine. InputError: of neither anything.

    Of an axis whose machine values vary, the set stays as the file has it: it is what the control has, and only what it
    stands for is uncertain. Drawn as well, one error would count twice.
    """
    if not count:
        return {}, None
    check_count(count)
    result = {axis: known_of(friction, axis, friction.parameters()) for axis, friction in sets.items()}
    of_machine = known_values(plan.machine)
    known = {axis: value for axis, value in result.items() if value.names and axis not in of_machine}
    return known, None if known and not of_machine else cloud_of(plan.machine)


def _changed_machines(plan: scenarios.Scenario, program: nc.Program) -> dict[str, scenarios.Machine]:
    """Words -> machine with another effect, that the compensation is tried on, too."""
    from feedsim.design.tune.knobs import effects_of  # without the table nobody needs it

    return {effect.words: machine for effect, machine in effects_of(plan.machine, moving_axes(program))}


def _file(axis: str, file: File, program: nc.Program) -> Path:
    check_moves(axis, program)
    return Path(file)


def _delays(delay: Value | Pairs[Value], program: nc.Program) -> dict[str, float]:
    """Axis -> delay [s]; one without an axis is that of all, and one with it counts more."""

    def read(axis: str, value: Value) -> float:
        if axis:
            check_moves(axis, program)
        return amount(value, "s", "4.2 ms")

    needed = "[AXIS=]VALUE is needed, such as Z='4.2 ms'"
    values = {"": delay} if isinstance(delay, int | float) else pairs("delay", delay, needed, common=True)
    read_ones = by_name("delay", values, read)
    common = dict.fromkeys(moving_axes(program), read_ones.pop("")) if "" in read_ones else {}
    return common | read_ones


def _check_lags(plan: scenarios.Scenario, axes: Sequence[str]) -> None:
    """Raise InputError, with the argument that helps, where the drive does not give the delay."""
    try:
        lags_of(plan, axes)
    except InputError as error:
        option = spell_argument("delay")
        helps = f"{option} AXIS=VALUE" if option.startswith("--") else f"{option}={{axis: value}}"
        raise InputError(f"{error} ({helps})", error.problems) from None
