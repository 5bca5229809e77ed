"""RunResults and records over each other, at a prompt and in a notebook."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

from feedsim.analysis import Figure, Named
from feedsim.analysis.side_by_side import Source, aligned, differing, named_apart, read_sources
from feedsim.design.sweep.bundle import case, scenario_of
from feedsim.files.columns import Columns, load_columns
from feedsim.foundation.errors import InputError
from feedsim.foundation.owned import TemporaryFolder
from feedsim.jobs.parameters import NO_WATCH, Argument, ControlName, FigureKinds, File, Force, Option, Watch, job, out
from feedsim.jobs.result import Result, kept
from feedsim.jobs.run import RunResult
from feedsim.report import show as page
from feedsim.report.content import Report
from feedsim.simulation import cosim
from feedsim.simulation.judge import judged

Shown = str | Path | RunResult


class Overlay(Result):
    """Results and records over each other: what :func:`feedsim.diff` returns.

    Attributes:
        names: of the results, in their order.

    >>> import feedsim as fs
    >>> over: fs.Overlay = fs.diff(fs.run("z_positioning.yaml"))
    >>> over.names
    ('Z positioning',)
    """

    kind = "diff"

    def __init__(self, results: Mapping[str, Shown], mappings: Sequence[Columns] = ()) -> None:
        """results: name -> a result, its folder, or a CSV file. mappings: which columns of records are what.

        Raises InputError: nothing, or what is no result.
        """
        if not results:
            raise InputError("nothing can be shown: no result is given")
        self.place: Path | None = None  # where it was written
        self.names = tuple(results)
        # The report reads results from where they are written; those of a prompt are written for as long as this lives.
        self._folder = TemporaryFolder()
        paths = [_at(value, self._folder.path / str(k)) for k, value in enumerate(results.values())]
        result = zip(self.names, read_sources(paths, mappings), strict=True)
        self._sources = aligned([replace(source, name=name) for name, source in result])

    @cached_property
    def figures(self) -> Mapping[str, Figure]:
        """Name -> figure, of the first result that has it."""
        own = [(name, source) for source in reversed(self._sources) for name in source.figures]
        return Named((name, Figure(*source.figures[name], "")) for name, source in own)

    @property
    def side_by_side(self) -> dict[str, tuple[Figure | None, ...]]:
        """Name -> the figure of every result; None where it has none of that name."""
        names = dict.fromkeys(name for source in self._sources for name in source.figures)
        return {name: tuple(_figure(source, name) for source in self._sources) for name in names}

    @property
    def parameters(self) -> dict[str, tuple[str, ...]]:
        """Parameters in which the results differ: name -> the value of every result, "" of records."""
        return {name: tuple(values) for name, values in differing(self._sources)}

    @property
    def findings(self) -> Sequence[str]:
        """What a reader of the records should know; results of feedsim have their own."""
        return [note for source in self._sources for note in source.recording.notes]

    @property
    def answers(self) -> Sequence[str]:
        """What differs, and how far the leading figures are from the first result's."""
        return page.answers(self._sources)

    @property
    def lines(self) -> list[str]:
        """Parameters that differ, leading figures, how all was aligned."""
        return page.lines(self._sources)

    @property
    def inputs(self) -> list[Path]:
        """The files that the results are read from."""
        return page.files_of(self._sources)

    def report(self) -> Report:
        """Content of report.html."""
        return page.report_of(self._sources)

    def summary(self, names: Sequence[str]) -> Mapping[str, Any]:
        """Content of summary.json."""
        return page.summary(self._sources, names)

    def __repr__(self) -> str:
        return "\n".join([f"Overlay of {', '.join(self.names)}", *self.lines])


@job("what differs between results and records, for people")
def diff(
    *results: Annotated[
        Shown, Argument("RESULT", "folder of feedsim run, CSV file with a column of time, or run of a study", many=True)
    ],
    columns: Annotated[
        File | Sequence[File],
        Option("MAPPING.yaml", "which columns of the records are what; one for each axis (docs/traces.md)", many=True),
    ] = (),
    out: Annotated[File | None, out("diff")] = None,
    figures: FigureKinds = (),
    force: Force = False,
    control: ControlName = "",
    watch: Watch = NO_WATCH,
    **named: Shown,
) -> Overlay:
    """Lay results over each other.

    Contours of circles, stops, following error, torque, speed, position and spectra, a table of figures with their
    differences, and the parameters that differ. Sources are aligned by their setpoints, circles by the angle; the page
    says how. A run of a study is FOLDER:17, FOLDER:min=FIGURE or FOLDER:max=FIGURE; it is made again.

    Command line:
        feedsim example xz_circle z_stop
        feedsim run xz_circle.yaml --out results/as_is
        feedsim run xz_circle.yaml --set machine.axes.Z.drive.K_v="5 (m/min)/mm" --out results/faster
        feedsim diff results/as_is results/faster
        feedsim diff results/as_is/result.csv record.csv --out results/against_record
        feedsim sweep studies/z_stop.yaml
        feedsim diff results/z_stop:min=Z.overshoot results/z_stop:max=Z.overshoot results/z_stop:17

    Raises:
        InputError: nothing, or what is no result.
        OutputError: `out` cannot be written.

    >>> import feedsim as fs
    >>> now = fs.run("z_positioning.yaml")
    >>> stiff = fs.run("z_positioning.yaml", set={"machine.axes.Z.drive.K_v": "5 (m/min)/mm"})
    >>> over = fs.diff(now=now, stiff=stiff)
    >>> over.parameters["machine.axes.Z.drive.K_v"]
    ('66.6666667 1/s', '83.3333333 1/s')
    """
    given: dict[str, Shown] = {}
    files = list(dict.fromkeys(str(result) for result in results if not isinstance(result, RunResult)))
    names = dict(zip(files, named_apart([Path(file) for file in files]), strict=True))
    for run_result in results:
        plain = (
            run_result.scenario.name
            if isinstance(run_result, RunResult)
            else _called(str(run_result), names[str(run_result)])
        )
        same = sum(re.fullmatch(rf"{re.escape(plain)}( \(\d+\))?", name) is not None for name in given)
        given[f"{plain} ({same + 1})" if same else plain] = run_result
    for name, run_result in named.items():
        if name in given:
            raise InputError(f"two results are called {name!r}; give one of them another name")
        given[name] = run_result
    mappings = [columns] if isinstance(columns, str | Path) else columns
    over = Overlay(given, [load_columns(file) for file in mappings])
    if out is not None:
        with kept(out, Overlay.check_place, watch, over.inputs, force=force):
            over.save(out, figures=figures, force=force, control=control)
    return over


def _called(text: str, name: str) -> str:
    chosen = case(text)
    return name if chosen is None else chosen.name


def _at(entry: Shown, folder: Path) -> Path:
    """Where a result stands; one of the prompt, and a run of a study, is written there."""
    if not isinstance(entry, RunResult):
        chosen = case(str(entry))
        if chosen is None:
            return Path(entry)
        scenario, fmus = scenario_of(chosen)
        entry = RunResult.of(judged(cosim.run(scenario, fmus=fmus)))
    entry.save(folder)
    return folder


def _figure(source: Source, name: str) -> Figure | None:
    return Figure(*source.figures[name], "") if name in source.figures else None
