"""Patterns of figures that cannot match anything, told before the first run: the beginnings of names are known."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence

from feedsim.errors import InputError
from feedsim.fields import did_you_mean
from feedsim.files.problems import describe
from feedsim.files.source import Source
from feedsim.motions import Circle, MeasuredSetpoints
from feedsim.scenario.base import Base
from feedsim.scenario.model import Positioning, Scenario
from feedsim.scenario.study.changes import changes_of
from feedsim.scenario.study.file import StudyFile
from feedsim.scenario.study.study import Parameter

# Keys that decide which figures there are: of a motion or an evaluation as a whole, or what it is of.
_DECIDES = re.compile(r"machine|(motions|evaluate)(\.(\d+|\*))?(\.(plane|axis|kind|motion)(\..*)?)?")
MOST = 50  # choices that are looked at


def pattern_faults(source: Source, entry: StudyFile, base: Base, parameters: Mapping[str, Parameter]) -> list[str]:
    """What is wrong with the study's `figures`, as far as the beginnings of names tell; no word where they do not.

    parameters: those that could be read.
    """
    if entry.figures is None:
        return []
    unread = {*entry.parameters} - {*parameters}
    if any(_decides(entry.parameters[name].keys) for name in unread):
        return []
    known = _all_beginnings(base, parameters.values())
    if known is None:
        return []
    names = [f"{beginning}.*" for beginning in sorted(known)]
    return [
        describe(source, ("figures", i), f"{pattern!r} is none of the figures{did_you_mean(pattern, names)}")
        for i, pattern in enumerate(entry.figures)
        if not any(_may_match(pattern, beginning) for beginning in known)
    ]


def _all_beginnings(base: Base, parameters: Iterable[Parameter]) -> set[str] | None:
    """What comes before the first dot of the figures, with all choices of the parameters; None: not known."""
    found = _beginnings(base.scenario)
    for parameter in parameters:
        if not parameter.worded or not _decides(parameter.keys):
            continue
        if len(parameter.choices) > MOST:
            return None
        for i in range(len(parameter.choices)):
            try:
                changed = _beginnings(base.with_changes(changes_of((parameter,), (float(i),))))
            except InputError:
                return None
            found = None if found is None or changed is None else found | changed
    return found


def _decides(keys: Iterable[str]) -> bool:
    """Whether keys may decide which figures there are."""
    return any(_DECIDES.fullmatch(key) for key in keys)


def _beginnings(scenario: Scenario) -> set[str] | None:
    planes: list[Sequence[str]] = [motion.plane for motion in scenario.motions if isinstance(motion, Circle)]
    recorded = any(isinstance(motion, MeasuredSetpoints) for motion in scenario.motions)
    found = set[str]()
    for item in scenario.evaluate:
        if isinstance(item, Positioning):
            found.add(item.axis)
        elif recorded:
            return None
        else:
            found |= {("" if all(len(axis) == 1 for axis in plane) else "-").join(plane) for plane in planes}
    return found


def _may_match(pattern: str, beginning: str) -> bool:
    """Whether a pattern may stand for a name that begins so; a second one of its kind is called XZ#2."""
    fixed = re.split(r"[*?]", pattern)[0]
    return any(fixed.startswith(head) or (fixed != pattern and head.startswith(fixed))
               for head in (f"{beginning}.", f"{beginning}#"))  # fmt: skip
