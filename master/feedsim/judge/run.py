"""A run with what it shows a user to doubt, and a scenario judged before its first step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path

from feedsim import cosim
from feedsim.cosim import Run
from feedsim.cosim.loads import Acting
from feedsim.judge import exchange, loads
from feedsim.judge.loops import control, loops_of
from feedsim.judge.pose import PoseUse, pose_use
from feedsim.linear.judgement import Loop, judge
from feedsim.nc import Program
from feedsim.scenario import Scenario
from feedsim.structure import Modes, checked_modes


@dataclass(frozen=True, repr=False, kw_only=True)
class JudgedRun(Run):
    """A run, and what a user should know before believing it.

    Attributes:
        pose: how far the motion leaves the plant's pose, or how the plant followed it.
        warnings: a sentence each.

    >>> import feedsim as fs
    >>> run: fs.Run = fs.run("z_positioning.yaml")  # what that returns is one, with figures
    >>> run.trace.unit("Z.M_fr"), run.log
    ('N.m', None)
    """

    pose: PoseUse
    warnings: tuple[str, ...]


def judged(run: Run, *, keep: bool = True) -> JudgedRun:
    """The run with its doubts: those of its units, of the parameters, of the pose, and what the run itself shows.

    keep: whether the judged loops are kept on disk for the next process; a study has thousands of machines.

    Raises:
        InputError: the machine's table of modes or its structure cannot be read.
    """
    scenario, program = run.scenario, run.program
    modes = checked_modes(scenario.machine)
    loops = loops_of(scenario.machine, modes) if keep else judge(scenario.machine, modes)
    pose = pose_use(scenario.machine, program, run.grid, run.crossings)
    warnings = (
        *run.notes,
        *_foreseen(scenario, modes, program, loops, run.acting),
        *pose.warnings,
        *exchange.energy(run, loops),
        *_limits(run),
        *loads.driving(run),
        *loads.contradicted(run),
        *run.executor_notes,
    )
    return JudgedRun(**{field.name: getattr(run, field.name) for field in fields(Run)}, pose=pose, warnings=warnings)


def check(scenario: Scenario, program: Program, *, fmus: Path | None = None) -> tuple[str, ...]:
    """Judge a scenario without a step; return the warnings that can be given before a run.

    The shipped units judge their parameters. No other program is executed: of another maker's unit counts what its
    archive says of itself, and a warning says what is not checked.

    Raises:
        InputError: what :func:`feedsim.cosim.run` would refuse before its first step.
    """
    ready = cosim.check(scenario, program, fmus=fmus)
    modes = checked_modes(scenario.machine)
    loops = loops_of(scenario.machine, modes)
    pose = pose_use(scenario.machine, program, ready.grid)
    return (*ready.notes, *_foreseen(scenario, modes, program, loops, ready.acting), *pose.warnings)


def _foreseen(
    scenario: Scenario, modes: Modes, program: Program, loops: Sequence[Loop], acting: Sequence[Acting]
) -> tuple[str, ...]:
    """What the parameters and the loads alone show a user to doubt, a sentence each."""
    return (
        *control(scenario.machine, loops, program), *exchange.exchange_stability(scenario, modes),
        *loads.unbalanced(scenario, acting), *loads.sizes(scenario.machine, program, acting),
    )  # fmt: skip


def _limits(run: Run) -> list[str]:
    """Limits at which a drive was while it was recorded."""
    return [
        f"axis {axis}: {limit.replace('_', ' ')} in {100 * share:.2g} % of the recorded instants"
        for (axis, _, limit), share in ((name.partition("."), share) for name, share in run.limited.items())
        if share > 0
    ]
