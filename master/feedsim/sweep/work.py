"""The runs of a study, one by one: what a worker makes of a task.

A :class:`Workplace` is a bundle laid out in a folder, its scenario ready to be changed. A run leaves nothing behind but
its outcome: no file, and a failure as words.
"""

from __future__ import annotations

import os
import re
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

from feedsim import analysis, cosim, units
from feedsim.errors import FeedsimError
from feedsim.scenario import Base
from feedsim.sweep.memo import Planner
from feedsim.sweep.task import Outcome, Task

# Figures come in units for people; tables hold these instead, where the dimension is the same.
_TABLE_UNITS = ("m", "s")


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
        self._folder = tempfile.TemporaryDirectory(prefix="feedsim-", dir=within, ignore_cleanup_errors=True)
        folder = Path(self._folder.name)
        try:
            moved = {}
            for i, (name, content) in enumerate(files.items()):
                # A folder for each, so that no two names collide, and the file's own name, which messages tell.
                file = folder / "files" / f"{i}" / re.split(r"[/\\]", name)[-1]
                file.parent.mkdir(parents=True)
                file.write_bytes(content)
                moved[name] = str(file)
            self._fmus = folder / "fmus"
            self._fmus.mkdir()
            for name, content in fmus.items():
                (self._fmus / name).write_bytes(content)
            self._base = base.relocated(moved)
        except BaseException:
            self.close()
            raise
        self._planner = Planner()
        # Messages name the user's files, and are the same in every process.
        self._names = {str(file): name for name, file in moved.items()} | {f"{folder}{os.sep}": ""}
        self._unpacked = re.compile(rf"{re.escape(str(Path(tempfile.gettempdir()) / 'feedsim-'))}\w+[/\\]?")

    def run(self, task: Task) -> Outcome:
        """Make a run. Whatever goes wrong is told in the outcome, but for MemoryError: the machine's fault."""
        begun = time.perf_counter()
        try:
            figures, warnings = self._figures(task)
        except MemoryError:
            raise
        except Exception as error:
            said = str(error) if isinstance(error, FeedsimError) else f"{type(error).__name__}: {error}"
            return Outcome(task.run, None, self._told(said), time.perf_counter() - begun)
        return Outcome(task.run, figures, None, time.perf_counter() - begun, tuple(map(self._told, warnings)))

    def _figures(self, task: Task) -> tuple[dict[str, tuple[float, str]], Sequence[str]]:
        scenario = self._base.with_changes(task.changes)
        program = self._planner.plan(scenario)
        result = cosim.run(scenario, program=program, fmus=self._fmus)
        found = {name: _si(figure) for name, figure in analysis.evaluate(result).items()}
        return found, result.warnings

    def _told(self, message: str) -> str:
        for there, name in self._names.items():
            message = message.replace(there, name)
        return self._unpacked.sub("", message)

    def close(self) -> None:
        self._folder.cleanup()


def _si(figure: analysis.Figure) -> tuple[float, str]:
    dimension = units.unit(figure.unit).dimension
    unit = next((unit for unit in _TABLE_UNITS if units.unit(unit).dimension == dimension), figure.unit)
    return units.convert(float(figure.value), figure.unit, unit), unit
