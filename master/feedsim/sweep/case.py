"""Runs of a study that is done, by their number or by what stands out: made once more, since a table has no curves."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from feedsim.cosim import fmus_directory
from feedsim.errors import InputError
from feedsim.fields import did_you_mean
from feedsim.scenario import Scenario, load
from feedsim.scenario.study import load_study
from feedsim.sweep import provenance
from feedsim.sweep.design import design
from feedsim.sweep.table import RECORD, read_table, record_of

_CASE = re.compile(r"(?P<folder>.+):(?:(?P<run>\d+)|(?P<which>min|max)=(?P<figure>.+))")


@dataclass(frozen=True)
class Case:
    """A run of a study: folder of the study, number of the run, and why it was chosen."""

    folder: Path
    run: int
    why: str

    @property
    def name(self) -> str:
        """For people."""
        return f"{self.folder.name} run {self.run}{f', {self.why}' if self.why else ''}"


def case(text: str) -> Case | None:
    """The case that such a text names; None where it is of no such form, or names a file that there is.

    InputError: no study there, no such run or figure.
    """
    match = _CASE.fullmatch(text)
    if match is None or Path(text).exists():
        return None
    table = read_table(match["folder"])
    if match["run"]:
        run, why = int(match["run"]), ""
        if run not in table["run"]:
            raise InputError(f"{text}: run {run} is not done; the table has {len(table)} of {table.runs} runs")
        if not table.ok[table["run"] == run][0]:
            raise InputError(f"{text}: run {run} has failed: {table['message'][table['run'] == run][0]}")
    else:
        figure = match["figure"]
        if figure not in table.figures:
            raise InputError(
                f"{text}: {figure!r} is none of the study's figures{did_you_mean(figure, [*table.figures])}"
            )
        values = np.where(table.ok, table[figure], np.nan)
        if not np.isfinite(values).any():
            raise InputError(f"{text}: no run has a value of {figure}")
        at = int(np.nanargmin(values) if match["which"] == "min" else np.nanargmax(values))
        run, why = int(table["run"][at]), f"{'least' if match['which'] == 'min' else 'largest'} {figure}"
    return Case(Path(match["folder"]), run, why)


def scenario_of(chosen: Case) -> tuple[Scenario, Path]:
    """What a case runs, and the folder of its units' archives.

    InputError: the study's files, units or version are no more those of its runs.
    """
    again = f"`feedsim check STUDY --row {chosen.run}` prints the command that makes the run alone"
    try:
        record = record_of(chosen.folder)
        parts, place = dict(record["parts"]), dict(record["place"])
    except (ValueError, KeyError, TypeError):
        raise InputError(f"{chosen.folder / RECORD}: does not say where its study file is; {again}") from None
    study = load_study(chosen.folder / place["file"], place["overrides"], runs=place["runs"])
    planned = design(study)
    fmus = fmus_directory() if place["fmus"] is None else chosen.folder / place["fmus"]
    now = provenance.parts(study, planned, fmus)
    if changed := [name for name, value in parts.items() if now.get(name) != value]:
        raise InputError(
            f"{chosen.folder}: since its runs were made {', '.join(changed)} changed; make the study again. {again}"
        )
    return load(study.scenario, [*study.settings, *study.overrides, *planned.options(chosen.run)]), fmus
