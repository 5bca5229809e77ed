"""Everything that a worker needs for the runs of a study, and what it makes of a task.

A bundle is all of it as bytes, since a worker may have no file system in common with us. It is known by the SHA-256 of
its content, and laid out once per worker process: a workplace, its scenario ready to be changed. A run leaves nothing
behind but its outcome: no file, and a failure as words.
"""

from __future__ import annotations

import hashlib
import os
import platform
import re
import sys
import tempfile
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from feedsim import analysis
from feedsim.design.sweep import provenance
from feedsim.design.sweep.design import Outcome, Task, design
from feedsim.design.sweep.provenance import read_content, units_of
from feedsim.design.sweep.table import RECORD, read_table, record_of
from feedsim.files.fields import did_you_mean
from feedsim.foundation import units
from feedsim.foundation.errors import FeedsimError, Finding, InputError, rank_findings
from feedsim.foundation.outputs import PREFIX, TemporaryFolder
from feedsim.scenario import Base, Scenario, load
from feedsim.scenario.study import Parameter, Study, load_study
from feedsim.simulation import cosim
from feedsim.simulation.cosim import fmus_directory
from feedsim.simulation.cosim.exchange import LIBRARY_NAME as NATIVE
from feedsim.simulation.cosim.unpacked import check_there
from feedsim.simulation.judge import judge_run
from feedsim.simulation.nc import Program, plan

# Figures come in units for people; tables hold these instead, where the dimension is the same.
_TABLE_UNITS = ("m", "s")
# Of an axis, what its motion does not depend on.
_NO_MOTION = {"M_0", "friction", "drive"}


@dataclass(frozen=True)
class Bundle:
    """What all runs of a study share.

    Attributes:
        base: the scenario, as :meth:`feedsim.scenario.Base.to_json` writes it.
        files: the data files that it, or a run's changes, name -> their content.
        fmus: file name -> content of the archives.
        native: content of the native cycle loop, and what it was built for (:func:`this_platform`); None without one.
    """

    base: str
    files: Mapping[str, bytes]
    fmus: Mapping[str, bytes]
    native: tuple[bytes, str] | None = None

    @classmethod
    def of(cls, study: Study, fmus: Path | None = None) -> Bundle:
        """Collect what the runs of `study` need.

        Args:
            fmus: folder of the archives; default :func:`feedsim.simulation.cosim.fmus_directory`.

        Raises:
            InputError: a file is missing.
        """
        return cls.of_base(study.base, study.files, fmus, study.parameters)

    @classmethod
    def of_base(
        cls, base: Base, files: Iterable[Path], fmus: Path | None = None, parameters: Iterable[Parameter] = ()
    ) -> Bundle:
        """The same for runs of a scenario, with the data files that they may read, and what is changed in it."""
        fmus = fmus or cosim.fmus_directory()
        archives = {f"{unit}.fmu": fmus / f"{unit}.fmu" for unit in units_of(base, parameters)}
        for file in archives.values():
            check_there(file)
        native = fmus / NATIVE
        return cls(
            base=base.to_json(),
            files={str(file): read_content(file) for file in sorted(set(files))},
            fmus={name: read_content(file) for name, file in archives.items()},
            native=(read_content(native), this_platform()) if native.is_file() else None,
        )

    @cached_property
    def digest(self) -> str:
        """What it is known by."""
        result = hashlib.sha256()
        parts = [("base", self.base.encode()), *self.files.items(), *self.fmus.items()]
        if self.native is not None:
            parts.append((self.native[1], self.native[0]))
        for name, content in parts:
            result.update(f"{len(name)} {name} {len(content)}\n".encode())
            result.update(content)
        return result.hexdigest()

    def open(self, within: Path | None = None) -> Workplace:
        """Lay it out in a folder of its own in `within`, None: where the system keeps what is temporary."""
        fmus = dict(self.fmus)
        if self.native is not None and self.native[1] == this_platform():
            fmus[NATIVE] = self.native[0]
        return Workplace(Base.from_json(self.base), self.files, fmus, within)


def this_platform() -> str:
    """What a shared library has to be built for to be loaded here."""
    return f"{sys.platform}-{platform.machine().lower()}"


class Workplace:
    """A bundle laid out in a folder of its own, until it is closed."""

    def __init__(
        self, base: Base, files: Mapping[str, bytes], fmus: Mapping[str, bytes], within: Path | None = None
    ) -> None:
        """Lay out.

        Args:
            files: data files of the scenario, by the names that `base` has for them.
            fmus: archives and native cycle loop, by file name.
            within: where the folder is made; None: where the system keeps what is temporary.
        """
        self._folder, self._units = TemporaryFolder(within), cosim.OpenUnits()
        folder = self._folder.path
        try:
            moved = {}
            for i, (name, content) in enumerate(files.items()):
                # A folder for each, so that no two names collide, and the file's own name, which messages show.
                file = folder / "files" / f"{i}" / re.split(r"[/\\]", name)[-1]
                file.parent.mkdir(parents=True)
                file.write_bytes(content)
                moved[name] = str(file)
            self._fmus = folder / "fmus"
            self._fmus.mkdir()
            for name, content in fmus.items():
                (self._fmus / name).write_bytes(content)
            self._base = base.relocate(moved)
        except BaseException:
            self.close()
            raise
        self._planned: tuple[Any, Program] | None = None
        # Messages name the user's files, and are the same in every process.
        self._names = {str(file): name for name, file in moved.items()} | {f"{folder}{os.sep}": ""}
        self._unpacked = re.compile(rf"{re.escape(tempfile.gettempdir() + os.sep)}(?:{PREFIX}\w+[/\\]?)+")

    def run(self, task: Task) -> Outcome:
        """Make a run. Whatever goes wrong is reported in the outcome, but for MemoryError: the machine's fault."""
        begun = time.perf_counter()
        try:
            figures, warnings = self._figures(task)
        except MemoryError:
            raise
        except Exception as error:
            said = str(error) if isinstance(error, FeedsimError) else f"{type(error).__name__}: {error}"
            return Outcome(task.run, None, self._as_named(said), time.perf_counter() - begun)
        named = self._as_named
        reported = tuple(
            replace(finding, text=named(finding.text), place=named(finding.place), remedy=named(finding.remedy))
            for finding in rank_findings(warnings)
        )
        return Outcome(task.run, figures, None, time.perf_counter() - begun, reported)

    def _figures(self, task: Task) -> tuple[dict[str, tuple[float, str]], Sequence[Finding]]:
        scenario = self._base.with_changes(task.changes)
        program = self._program(scenario)
        result = judge_run(cosim.run(scenario, program=program, fmus=self._fmus, units=self._units), keep=False)
        results = {name: _si(figure) for name, figure in analysis.evaluate(result).items()}
        return results, result.warnings

    def _program(self, scenario: Scenario) -> Program:
        """The motion; that of the last run serves again while nothing that it depends on is another."""
        key = _motion_depends_on(scenario)
        if self._planned is None or self._planned[0] != key:
            self._planned = None
            self._planned = key, plan(scenario)
        return self._planned[1]

    def _as_named(self, message: str) -> str:
        for there, name in self._names.items():
            message = message.replace(there, name)
        return self._unpacked.sub("", message)

    def close(self) -> None:
        """Leave nothing behind."""
        self._units.close()
        self._folder.close()


def _si(figure: analysis.Figure) -> tuple[float, str]:
    dimension = units.unit(figure.unit).dimension
    unit = next((unit for unit in _TABLE_UNITS if units.unit(unit).dimension == dimension), figure.unit)
    return units.convert(float(figure.value), figure.unit, unit), unit


def _motion_depends_on(scenario: Scenario) -> Any:
    machine = scenario.machine
    axes = {
        name: {field: getattr(axis, field) for field in type(axis).model_fields if field not in _NO_MOTION}
        for name, axis in machine.axes.items()
    }
    return scenario.motions, [*machine.axes], axes, machine.pose, machine.cycles, machine.path


# --- Runs of a study that is done, by their number or by what stands out: made once more, since a table has no
#     curves


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
