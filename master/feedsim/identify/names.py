"""Names of traces that tell them apart: two logs of a control are often both called log.csv."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from feedsim.errors import InputError
from feedsim.identify.read import Recorded
from feedsim.identify.record import Record


def distinct(files: Sequence[Path]) -> tuple[str, ...]:
    """The file names, with as many folders ahead as it takes to tell them apart. InputError: a file stands twice."""
    whole = [file.resolve().parts for file in files]
    names = []
    for parts in whole:
        if whole.count(parts) > 1:
            raise InputError(f"{Path(*parts).name} is given twice; every trace counts once")
        count = 1
        while sum(other[-count:] == parts[-count:] for other in whole) > 1:
            count += 1
        names.append("/".join(parts[-count:]))
    return tuple(names)


def named_apart(recorded: Sequence[Recorded]) -> tuple[Record, ...]:
    """The records of all files, under names that tell the files apart."""
    names = distinct([each.provenance.file for each in recorded])
    return tuple(
        replace(record, name=name + record.name.removeprefix(each.provenance.file.name))
        for each, name in zip(recorded, names, strict=True)
        for record in each.records
    )
