"""A scenario that is read once and checked again and again, each time with other changes: for studies of many runs.

Reading YAML takes several times as long as checking what it says. A base holds the trees of the files as plain values,
with the file and line of each; no scenario file is read any more. What stays outside are files of data: tables of
modes, archives, recordings.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from feedsim.files.checked import expected_annotation, fetch, names_file
from feedsim.files.source import Mark, Place, Source, places, value_at
from feedsim.scenario.load import Draft, Setting, draft_scenario
from feedsim.scenario.model import Scenario


@dataclass(frozen=True)
class Change:
    """A value to be set, as `--set KEY=VALUE` does.

    Attributes:
        key: dotted, * allowed.
        text: the value as it stands behind KEY= on the command line.
        data: the plain value, with the YAML files that it names in place of their names.
    """

    key: str
    text: str
    data: Any

    @property
    def option(self) -> str:
        """KEY=VALUE."""
        return f"{self.key}={self.text}"


@dataclass(frozen=True, eq=False)
class Base:
    """A scenario that is read; see :meth:`read`. It can be sent to other processes."""

    draft: Draft  # not settled: a machine that is changed meets all settings
    moved: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def read(cls, path: Path, overrides: Sequence[str] = (), settings: Sequence[Setting] = ()) -> Base:
        """Read a scenario file, changed by `settings`, then by `overrides` (KEY=VALUE), as load() does.

        Raises InputError like load(), also for what only checking finds.
        """
        base = cls(draft_scenario(path, overrides, settings))
        _ = base.scenario  # checks it
        return base

    @cached_property
    def scenario(self) -> Scenario:
        """Without changes."""
        return self.settled.scenario()

    @cached_property
    def settled(self) -> Draft:
        """The tree with all settings; to be copied, not changed."""
        draft = self.draft.copy()
        draft.settle()
        _relocate(draft.source, (), self.moved)
        return draft

    def with_changes(self, changes: Sequence[Change]) -> Scenario:
        """The scenario that load() makes of the file with the changes as further overrides.

        Raises InputError like load().
        """
        settings = [(change.key, _source(change)) for change in changes]
        machines = [value for key, value in settings if key == "machine"]
        if machines:
            draft = self.draft.copy()
            draft.source.put(("machine",), machines[-1])
            fetch(draft.source, Scenario, ("machine",), draft.faults)
            draft.settle()
        else:
            draft = self.settled.copy()
        draft.apply((key, value) for key, value in settings if key != "machine")
        if self.moved:
            for place in [("machine",)] * bool(machines) + [place for place, _ in draft.changed]:
                _relocate(draft.source, place, self.moved)
        draft.overrides = (*draft.overrides, *(change.option for change in changes))
        return draft.scenario()

    @property
    def files(self) -> tuple[Path, ...]:
        """Files of data that a run of the scenario without changes may read, each once."""
        return data_files(self.settled.source)

    def relocate(self, moved: Mapping[str, str]) -> Base:
        """One that finds its files of data elsewhere: path as text -> the new one."""
        return Base(self.draft, {**self.moved, **moved})

    def to_json(self) -> str:
        """Everything as text; the same base gives the same text."""
        draft = self.draft
        content = {
            "path": str(draft.path),
            "source": _serialise_source(draft.source),
            "own": [[key, _serialise_source(value)] for key, value in draft.own],
            "outside": [[key, _serialise_source(value)] for key, value in draft.outside],
            "overrides": draft.overrides,
            "moved": dict(self.moved),
        }
        # The order of keys is that of the files: axes and columns come in it.
        return json.dumps(content, ensure_ascii=False, separators=(",", ":"))

    def content(self, named: Mapping[str, str]) -> str:
        """What decides a run, as text, without where it comes from; `named`: what stands for each file of data."""
        raw, settled = (draft.source.copy() for draft in (self.draft, self.settled))
        _relocate(raw, (), self.moved)
        for source in (raw, settled):
            _relocate(source, (), named)
        own, outside = ([[key, value.data] for key, value in part] for part in (self.draft.own, self.draft.outside))
        content = {"raw": raw.data, "settled": settled.data, "own": own, "outside": outside}
        return json.dumps(content, ensure_ascii=False, separators=(",", ":"))

    @classmethod
    def from_json(cls, text: str) -> Base:
        """The base of which `text` was made."""
        content = json.loads(text)
        own, outside = (
            tuple((key, _deserialise_source(value)) for key, value in content[name]) for name in ("own", "outside")
        )
        source = _deserialise_source(content["source"])
        draft = Draft(Path(content["path"]), source, own, outside, tuple(content["overrides"]), [])
        return cls(draft, content["moved"])


def data_files(source: Source, place: Place = ()) -> tuple[Path, ...]:
    """The files of data that a tree of a scenario names at or inside `place`, each once."""
    return tuple(dict.fromkeys(Path(text) for _, text in _named_files(source, place)))


def _named_files(source: Source, place: Place) -> Iterator[tuple[Place, str]]:
    data = value_at(source.data, place)
    if isinstance(data, dict):
        for key in data:
            yield from _named_files(source, (*place, key))
    elif isinstance(data, list):
        for i in range(len(data)):
            yield from _named_files(source, (*place, i))
    elif isinstance(data, str) and names_file(expected_annotation(Scenario, source.data, place)):
        yield place, data


def _relocate(source: Source, place: Place, moved: Mapping[str, str]) -> None:
    for value, text in list(_named_files(source, place)) if moved else ():
        if text in moved:
            value_at(source.data, value[:-1])[value[-1]] = moved[text]


def _source(change: Change) -> Source:
    # What files it names are in it already, or relative to the working folder.
    mark = Mark(f"--set {change.option}", Path())
    return Source(change.data, {place: mark for place in places(change.data)})


def _serialise_source(source: Source) -> dict[str, Any]:
    marks = [[list(place), mark.where, str(mark.folder)] for place, mark in source.marks.items()]
    return {"data": source.data, "marks": marks}


def _deserialise_source(content: Mapping[str, Any]) -> Source:
    marks = {tuple(place): Mark(where, Path(folder)) for place, where, folder in content["marks"]}
    return Source(content["data"], marks)
