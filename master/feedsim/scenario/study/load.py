"""Study file -> Study: read, open its scenario, find what each key takes, check; every problem with its line."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from fnmatch import fnmatchcase
from itertools import combinations
from math import prod
from pathlib import Path

from feedsim.files import checked
from feedsim.files.checked import check, describe, dotted_key, fetch, in_order, read_group
from feedsim.files.fields import did_you_mean
from feedsim.files.source import Source, value_at
from feedsim.foundation.errors import Finding, InputError
from feedsim.motions import Circle, MeasuredSetpoints
from feedsim.scenario.base import Base
from feedsim.scenario.load import Setting
from feedsim.scenario.model import ContourTest, Positioning, Scenario
from feedsim.scenario.study.file import MOST_RUNS, StudyFile
from feedsim.scenario.study.parameter import Reader
from feedsim.scenario.study.study import Parameter, Sampling, Study, as_text, changes_of

DEFAULT_SEED = 1
# Keys that decide which figures there are: of a motion or an evaluation as a whole, or what it is of.
_DECIDES = re.compile(r"machine|(motions|evaluate)(\.(\d+|\*))?(\.(plane|axis|kind|motion)(\..*)?)?")
MOST_CHOICES = 50  # choices that are looked at


def load_study(path: str | Path, overrides: Sequence[str] = (), *, runs: int | None = None) -> Study:
    """Read and check a study file, its scenario and what it varies.

    `overrides` are KEY=VALUE texts as behind `--set`; they change the scenario after the study's own `set` group.
    `runs` takes the place of the file's.

    Raises InputError that lists every problem with file and line.
    """
    path = Path(path)
    source = read_group(path)
    written = source.copy().data
    faults: list[str] = []
    fetch(source, StudyFile, (), faults)
    entry = check(source, StudyFile, faults)
    base = _base(source, overrides, faults)
    parameters: dict[str, Parameter] = {}
    files: list[Path] = [*base.files] if base is not None else []
    notes: list[Finding] = []
    if base is not None and entry is not None:
        reader = Reader(source, base, entry.sampling.method == "grid")
        for name, given in entry.parameters.items():
            parameter = reader.read(name, given)
            if parameter is not None:
                parameters[name] = parameter
        files += reader.files
        faults += [*reader.faults, *_overlaps(source, reader)]
        faults += _pattern_faults(source, entry, base, parameters)
        notes = reader.warnings
    if entry is not None:
        sampling, wrong, warnings = _sampling(source, entry, parameters, runs)
        faults += wrong
    if faults or entry is None or base is None:
        raise InputError.of(str(path), in_order(faults))
    warnings += [*notes, *_check_middle(base, tuple(parameters.values()))]
    return Study(
        name=entry.name,
        note=entry.note,
        file=path,
        base=base,
        sampling=sampling,
        parameters=tuple(parameters.values()),
        settings=tuple(_setting_texts(base, _settings(source))),
        figures=entry.figures,
        goal=_goal(entry),
        explain=entry.explain or "",
        files=tuple(dict.fromkeys(files)),
        overrides=tuple(checked.spread(overrides)),
        warnings=tuple(warnings),
        written=written,
    )


def _base(source: Source, overrides: Sequence[str], faults: list[str]) -> Base | None:
    file = source.data.get("scenario")
    if not isinstance(file, str) or not Path(file).is_file():
        return None  # reported where it stands
    try:
        return Base.read(Path(file), overrides, _settings(source))
    except InputError as error:
        faults += error.problems
        return None


def _settings(source: Source) -> list[Setting]:
    """The study's `set` group."""
    return [*checked.entries(source, "set")] if isinstance(source.data.get("set"), dict) else []


def _setting_texts(base: Base, settings: Sequence[Setting]) -> list[str]:
    """Settings as KEY=VALUE, with the files that they name relative to the working folder."""
    draft = base.draft.copy()
    draft.apply(draft.own)
    texts = []
    for key, value in settings:
        draft.apply([(key, value)])
        place = draft.changed[-1][0]
        texts.append(f"{key}={as_text(value, value_at(draft.source.data, place))}")
    return texts


def _check_middle(base: Base, parameters: tuple[Parameter, ...]) -> list[Finding]:
    """A warning where the scenario cannot be loaded with a value from the middle of every parameter."""
    try:
        base.with_changes(changes_of(parameters, [parameter.middle for parameter in parameters]))
    except InputError as error:
        text = f"with every parameter at its middle the scenario is refused: {'; '.join(error.problems)}"
        return [Finding("middle-refused", "doubt", text)]
    return []


def _overlaps(source: Source, reader: Reader) -> list[str]:
    """Parameters that set the same place, or a place inside one that another replaces later."""
    result = []
    for (one, first), (two, second) in combinations(reader.targets.items(), 2):
        for a, b in ((a.place, b.place) for a in first for b in second):
            inner, outer = (a, b) if len(a) > len(b) else (b, a)
            if inner[: len(outer)] != outer:
                continue
            who = ("parameters", two, "key")
            if a == b and {one, two} <= reader.factors:
                continue  # they multiply one another
            if a == b:
                message = f"{one} sets {dotted_key(a)} already"
            elif inner == a:
                message = (
                    f"replaces {dotted_key(b)}, and with it {dotted_key(a)}, which {one} sets; put {two} before {one}"
                )
            elif two in reader.factors:
                message = f"{two} multiplies {dotted_key(b)}, which {one} replaces with all of {dotted_key(a)}"
            else:
                continue
            result.append(describe(source, who, message))
            break
    return result


def _sampling(
    source: Source, entry: StudyFile, parameters: dict[str, Parameter], runs: int | None
) -> tuple[Sampling, list[str], list[Finding]]:
    """How the runs are spread; what is wrong with it; what a user should know."""
    given, faults, warnings = entry.sampling, list[str](), list[Finding]()
    grid = given.method == "grid"

    def fault(key: str, message: str) -> None:
        faults.append(describe(source, ("sampling", key), message))

    if grid:
        for key, value in (("runs", given.runs), ("seed", given.seed)):
            if value is not None:
                fault(key, "not for a grid, whose runs are all combinations of the values")
        if runs is not None:
            faults.append(f"--runs {runs}: not for a grid, whose runs are all combinations of the values")
        total = prod(
            len(p.choices) if p.distribution is None else p.distribution.count or 1 for p in parameters.values()
        )
        if total > MOST_RUNS:
            fault("method", f"{total} combinations; at most {MOST_RUNS} runs")
        return Sampling("grid", 0, 0), faults, warnings
    number = runs if runs is not None else given.runs
    if number is None:
        fault("runs", f"missing; how many runs a study by {given.method} makes")
        return Sampling(given.method, 0, 0), faults, warnings
    if number < 1:
        faults.append(f"--runs {number}: at least 1")
    power = number & (number - 1) == 0
    if given.method == "sensitivity":
        total = number * (len(entry.parameters) + 2)
        if not power or number < 2:
            fault("runs", f"{number} is no power of two; a sensitivity study takes 2, 4, 8, ... (then times d + 2)")
        elif total > MOST_RUNS:
            fault("runs", f"{number} x ({len(entry.parameters)} + 2) = {total} runs; at most {MOST_RUNS}")
    elif number > MOST_RUNS:
        faults.append(f"--runs {number}: at most {MOST_RUNS}")
    elif given.method == "sobol" and not power:
        near = 1 << (number.bit_length() - 1)
        text = (
            f"sampling.runs: {number} is no power of two; a Sobol sequence is balanced with {near} or {2 * near} runs"
        )
        warnings.append(Finding("sampling-unbalanced", "doubt", text, "sampling.runs", f"--runs {near}"))
    seed = DEFAULT_SEED if given.seed is None else given.seed
    return Sampling(given.method, number, seed), faults, warnings


def _pattern_faults(source: Source, entry: StudyFile, base: Base, parameters: Mapping[str, Parameter]) -> list[str]:
    """What is wrong with the study's `figures`, reported before the first run: patterns that no figure's name begins
    like. No word where the beginnings of the names do not show.

    parameters: those that could be read.
    """
    asked: list[tuple[tuple[str | int, ...], str]] = [
        (("figures", k), pattern) for k, pattern in enumerate(entry.figures or ())
    ]
    asked += [(("goal",), goal[1])] if (goal := _goal(entry)) else []
    asked += [(("explain",), entry.explain)] if entry.explain else []
    if not asked:
        return []
    unread = {*entry.parameters} - {*parameters}
    if any(_decides(entry.parameters[name].keys) for name in unread):
        return []
    known = _all_beginnings(base, parameters.values())
    if known is None:
        return []
    names = [f"{beginning}.*" for beginning in sorted(known)]
    return [
        describe(source, place, f"{pattern!r} is none of the figures{did_you_mean(pattern, names)}")
        for place, pattern in asked
        if not any(_may_match(pattern, beginning) for beginning in known)
    ] + [
        describe(source, place, f"{name!r} is not among `figures`: {', '.join(entry.figures)}")
        for place, name in asked
        if place[0] != "figures" and entry.figures and not any(fnmatchcase(name, figure) for figure in entry.figures)
    ]


def _goal(entry: StudyFile) -> tuple[str, str] | None:
    """Which end of which figure is looked for."""
    if entry.goal is None:
        return None
    way, _, figure = entry.goal.partition(" ")
    return way, figure


def _all_beginnings(base: Base, parameters: Iterable[Parameter]) -> set[str] | None:
    """What comes before the first dot of the figures, with all choices of the parameters; None: not known."""
    beginnings = _beginnings(base.scenario)
    for parameter in parameters:
        if not parameter.worded or not _decides(parameter.keys):
            continue
        if len(parameter.choices) > MOST_CHOICES:
            return None
        for i in range(len(parameter.choices)):
            try:
                changed = _beginnings(base.with_changes(changes_of((parameter,), (float(i),))))
            except InputError:
                return None
            beginnings = None if beginnings is None or changed is None else beginnings | changed
    return beginnings


def _decides(keys: Iterable[str]) -> bool:
    """Whether keys may decide which figures there are."""
    return any(_DECIDES.fullmatch(key) for key in keys)


def _beginnings(scenario: Scenario) -> set[str] | None:
    planes: list[Sequence[str]] = [motion.plane for motion in scenario.motions if isinstance(motion, Circle)]
    recorded = any(isinstance(motion, MeasuredSetpoints) for motion in scenario.motions)
    result = set[str]()
    for item in scenario.evaluate:
        if isinstance(item, Positioning):
            result.add(item.axis)
        elif isinstance(item, ContourTest):
            result.add("contour")
        elif recorded:
            return None
        else:
            result |= {("" if all(len(axis) == 1 for axis in plane) else "-").join(plane) for plane in planes}
    return result


def _may_match(pattern: str, beginning: str) -> bool:
    """Whether a pattern may stand for a name that begins so; a second one of its kind is called XZ#2."""
    fixed = re.split(r"[*?]", pattern)[0]
    return any(fixed.startswith(head) or (fixed != pattern and head.startswith(fixed))
               for head in (f"{beginning}.", f"{beginning}#"))  # fmt: skip
