"""A scenario, an SSP or a study, checked without a step of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from feedsim import analysis, judge
from feedsim.arguments import Changes, settings
from feedsim.files.source import is_study
from feedsim.findings import severity
from feedsim.jobs.folder import File
from feedsim.jobs.subject import opened
from feedsim.scenario import Scenario


@dataclass(frozen=True)
class Validation:
    """What can be said of a valid scenario or study before it is run. A faulty one raises InputError instead.

    Attributes:
        answers: that it is valid, and what it holds.
        findings: what a user should know before running it, a sentence each.
    """

    answers: Sequence[str]
    findings: Sequence[str] = ()

    def __repr__(self) -> str:
        wrong = [finding for finding in self.findings if severity(finding) != "note"]
        warned = [f"{len(wrong)} warning{'s'[: len(wrong) != 1]}, see .findings"] if wrong else []
        return "; ".join([*self.answers, *warned])


def validate(scenario: File | Scenario, *, set: Changes = None, fmus: File | None = None) -> Validation:
    """Check a scenario, an SSP or a study, its machine and its motion without running it.

    The shipped units judge their parameters. No program of another maker is executed; a finding says what is therefore
    not checked.

    Args:
        scenario: a file, an SSP file, a study, or what :func:`load` has returned.
        set: changes, as behind ``--set``: a mapping, or texts "KEY=VALUE".
        fmus: folder of the archives.

    Raises:
        InputError: lists what is wrong, with file and line.

    >>> import feedsim as fs
    >>> fs.validate("xz_circle.yaml")
    xz_circle.yaml: valid; 2 motions, 11.98 s on Test centre
    """
    if not isinstance(scenario, Scenario) and is_study(Path(scenario)):
        return _study(Path(scenario), settings(set), None if fmus is None else Path(fmus))
    with opened(scenario, set, fmus) as subject:
        plan, program = subject.plan, subject.program
        analysis.check(plan, program)
        warnings = subject.warnings(judge.check(plan, program, fmus=subject.fmus))
    name = plan.name if isinstance(scenario, Scenario) else scenario
    motions = f"{len(plan.motions)} motion{'s'[: len(plan.motions) != 1]}"
    apart = (
        " as far as no other maker's program has a say"
        if any(": not checked: " in warning for warning in warnings)
        else ""
    )
    return Validation([f"{name}: valid{apart}; {motions}, {program.time[-1]:.4g} s on {plan.machine.name}"], warnings)


def _study(file: Path, changes: list[str], fmus: Path | None) -> Validation:
    """A study, its scenario, and a run from the middle."""
    from feedsim.scenario.study import load_study
    from feedsim.sweep import design
    from feedsim.sweep.trial import check

    study = load_study(file, changes)
    planned = design(study)
    run, warnings, failed = check(study, planned, fmus)
    refused = [f"run {other} is refused, run {run} is not: {why}" for other, why in failed.items()]
    return Validation(
        [f"{file}: valid; {planned.runs} runs of {study.scenario}"], (*study.warnings, *refused, *warnings)
    )
