"""feedsim compensate: friction compensation by torque feedforward, judged by a circle."""

from __future__ import annotations

from argparse import BooleanOptionalAction, Namespace
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from feedsim.cli.options import FIGURES, FMUS, QUIET, Command, Option, amount, by_name, out, settings
from feedsim.cli.terminal import announce, finish, progress_bar, results_in

if TYPE_CHECKING:
    from feedsim.nc import Program
    from feedsim.scenario import Friction, Scenario

DESCRIPTION = """Run a circle without and with friction compensation. A friction model, driven by the speed setpoint
with the lag of the axis, gives a torque that is added to the torque setpoint of every axis that moves. Without
--friction the model has the machine's own parameters: what is possible at best. With the file of an identified set it
shows what that set is worth."""
EPILOG = """examples:
  feedsim example xz_circle
  feedsim compensate xz_circle.yaml --out results/compensate
  feedsim compensate xz_circle.yaml --friction X=friction_x.yaml --friction Z=friction_z.yaml
  feedsim compensate xz_circle.yaml --delay "4.2 ms" --no-table
"""


def compensate(options: Namespace) -> None:
    """Read, run, write."""
    from feedsim import nc, scenario
    from feedsim.analysis import compensation as analysis
    from feedsim.report import compensate as report
    from feedsim.report.provenance import input_paths

    plan = scenario.load(options.scenario, options.overrides)
    directory: Path = options.out or Path("results") / f"compensate_{options.scenario.stem}"
    program = nc.plan(plan)
    analysis.circle_task(plan, program)
    files, frictions = _frictions(options.frictions, program)
    delays = _delays(options.delays, program)
    _check_lags(plan, [axis for axis in analysis.moving_axes(program) if axis not in delays])
    with (
        results_in(directory, report.check_writable, [*input_paths(plan), *files.values()], options.overrides),
        progress_bar(options.quiet, "it", shortened=True) as progress,
    ):
        announce(plan.machine, options.fmus, coupling=plan.coupling)
        result = analysis.compensate(
            plan, program, frictions=frictions, delays=delays, table=options.table, fmus=options.fmus,
            progress=progress,
        )  # fmt: skip
        report.write(result, files, directory, drawn=options.figures)
    head = f"{plan.name}: friction compensation -> {directory / 'report.html'}"
    finish(options.quiet, result.warnings, head, f"  {report.summary_line(result)}")


def _frictions(texts: Sequence[str], program: Program) -> tuple[Mapping[str, Path], Mapping[str, Friction]]:
    """Axis -> file, and axis -> what is in it."""
    from feedsim.analysis.compensation import check_moves
    from feedsim.scenario.load import read_friction

    def file_of(axis: str, text: str) -> Path:
        check_moves(axis, program)
        return Path(text)

    files = by_name("friction", texts, "AXIS=FILE.yaml is needed, such as Z=friction_z.yaml", file_of)
    return files, {axis: read_friction(file) for axis, file in files.items()}


def _delays(texts: Sequence[str], program: Program) -> Mapping[str, float]:
    """Axis -> delay [s]; one without an axis is that of all, and one with it counts more."""
    from feedsim.analysis.compensation import check_moves, moving_axes

    def delay_of(axis: str, text: str) -> float:
        if axis:
            check_moves(axis, program)
        return amount(text, "s", "4.2 ms")

    told = by_name("delay", texts, "[AXIS=]VALUE is needed, such as Z='4.2 ms'", delay_of, common=True)
    common = dict.fromkeys(moving_axes(program), told.pop("")) if "" in told else {}
    return common | told


def _check_lags(scenario: Scenario, axes: Sequence[str]) -> None:
    """Raise InputError, with the option that helps, where the drive does not tell the delay."""
    from feedsim.analysis.compensation import lags_of
    from feedsim.errors import InputError

    try:
        lags_of(scenario, axes)
    except InputError as error:
        raise InputError(f"{error} (--delay AXIS=VALUE)", error.problems) from None


COMMAND = Command(
    "compensate",
    "friction compensation by torque feedforward: a circle without and with it",
    compensate,
    (
        Option("scenario", "SCENARIO.yaml", "scenario with a circle", type=Path),
        out("compensate_<name of the file>"), FIGURES,
        Option("--friction", "AXIS=FILE.yaml",
               "friction parameters that the compensation of an axis uses (default: the machine's own, which the "
               "machine keeps in any case); may be given several times", many=True, dest="frictions"),
        Option("--delay", "[AXIS=]VALUE",
               "delay of the feedforward behind the speed setpoint, e.g. '4.2 ms' (default: from the parameters of the "
               "drive); may be given several times", many=True, dest="delays"),
        Option("--table", "",
               "with the runs that show what errors of the delay and of the parameters cost (default: yes)",
               action=BooleanOptionalAction, default=True),
        settings(), FMUS, QUIET,
    ),
    DESCRIPTION,
    EPILOG,
)  # fmt: skip
