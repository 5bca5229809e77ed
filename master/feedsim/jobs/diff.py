"""Results and records over each other, at a prompt and in a notebook."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, TypeVar

from feedsim.analysis import Figure, FigureTable
from feedsim.analysis.side_by_side import Source, align_sources, differing_parameters, named_apart, read_sources
from feedsim.design.sweep.bundle import case, scenario_of
from feedsim.files.columns import Columns, load_columns
from feedsim.foundation.errors import Finding, InputError
from feedsim.foundation.outputs import TemporaryFolder
from feedsim.jobs.parameters import (
    NO_WATCH,
    Argument,
    ControlName,
    FigureKinds,
    File,
    Force,
    Option,
    Watch,
    job,
    output_option,
)
from feedsim.jobs.result import Kind, Result, claim_result_folder
from feedsim.jobs.run import EvaluatedRun
from feedsim.jobs.run import result_of as result_of_run
from feedsim.report import show as page
from feedsim.simulation import cosim
from feedsim.simulation.judge import judge_run

ResultSource = str | Path | Result[EvaluatedRun]


KIND = Kind("diff")


class Overlay:
    """Results and records over each other.

    Attributes:
        names: of the results, in their order.
    """

    def __init__(self, results: Mapping[str, ResultSource], mappings: Sequence[Columns] = ()) -> None:
        """results: name -> a result, its folder, or a CSV file. mappings: which columns of records are what.

        Raises InputError: nothing, or what is no result.
        """
        if not results:
            raise InputError("nothing can be shown: no result is given")
        self.names = tuple(results)
        # The report reads results from where they are written; those of a prompt are written for as long as this lives.
        self._folder = TemporaryFolder()
        paths = [_result_path(value, self._folder.path / str(k)) for k, value in enumerate(results.values())]
        result = zip(self.names, read_sources(paths, mappings), strict=True)
        self.sources = align_sources([replace(source, name=name) for name, source in result])

    @property
    def side_by_side(self) -> dict[str, tuple[Figure | None, ...]]:
        """Name -> the figure of every result; None where it has none of that name."""
        names = dict.fromkeys(name for source in self.sources for name in source.figures)
        return {name: tuple(_figure(source, name) for source in self.sources) for name in names}

    @property
    def parameters(self) -> dict[str, tuple[str, ...]]:
        """Parameters in which the results differ: name -> the value of every result, "" of records."""
        return {name: tuple(values) for name, values in differing_parameters(self.sources)}


Laid = TypeVar("Laid", bound=Overlay)


def result_of(
    over: Laid,
    findings: tuple[Finding, ...] | None = None,
    lines: Callable[[], Sequence[str]] | None = None,
    place: Path | None = None,
) -> Result[Laid]:
    """Results over each other; a figure is that of the first result that has it.

    findings: None: those of records; results of feedsim have their own. lines, place: as of `Result`.
    """
    sources = over.sources
    of_records = tuple(note for source in sources for note in source.recording.notes)
    return Result(
        KIND,
        over,
        partial(page.report_of, sources),
        figures=FigureTable(
            (name, Figure(*source.figures[name], "")) for source in reversed(sources) for name in source.figures
        ),
        details=partial(page.details, sources),
        inputs=page.files_of(sources),
        findings=of_records if findings is None else findings,
        lines=partial(page.lines, sources) if lines is None else lines,
        place=place,
    )


@job("what differs between results and records, for people")
def diff(
    *results: Annotated[
        ResultSource,
        Argument("RESULT", "folder of feedsim run, CSV file with a column of time, or run of a study", many=True),
    ],
    columns: Annotated[
        File | Sequence[File],
        Option("MAPPING.yaml", "which columns of the records are what; one for each axis (docs/traces.md)", many=True),
    ] = (),
    out: Annotated[File | None, output_option("diff")] = None,
    figures: FigureKinds = (),
    force: Force = False,
    control: ControlName = "",
    watch: Watch = NO_WATCH,
    **named: ResultSource,
) -> Result[Overlay]:
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
    if other := [one.kind for one in (*results, *named.values()) if isinstance(one, Result) and one.kind != "run"]:
        raise InputError(
            f"a result of kind {other[0]} cannot be laid over others; runs, their folders and CSV files can"
        )
    given: dict[str, ResultSource] = {}
    files = list(dict.fromkeys(str(result) for result in results if not isinstance(result, Result)))
    names = dict(zip(files, named_apart([Path(file) for file in files]), strict=True))
    for run_result in results:
        plain = (
            run_result.scenario.name
            if isinstance(run_result, Result)
            else _display_name(str(run_result), names[str(run_result)])
        )
        same = sum(re.fullmatch(rf"{re.escape(plain)}( \(\d+\))?", name) is not None for name in given)
        given[f"{plain} ({same + 1})" if same else plain] = run_result
    for name, run_result in named.items():
        if name in given:
            raise InputError(f"two results are called {name!r}; give one of them another name")
        given[name] = run_result
    mappings = [columns] if isinstance(columns, str | Path) else columns
    over = result_of(Overlay(given, [load_columns(file) for file in mappings]))
    if out is not None:
        with claim_result_folder(out, KIND, watch, over.inputs, force=force):
            over.save(out, figures=figures, force=force, control=control)
    return over


def _display_name(text: str, name: str) -> str:
    chosen = case(text)
    return name if chosen is None else chosen.name


def _result_path(entry: ResultSource, folder: Path) -> Path:
    """Where a result stands; one of the prompt, and a run of a study, is written there."""
    if not isinstance(entry, Result):
        chosen = case(str(entry))
        if chosen is None:
            return Path(entry)
        scenario, fmus = scenario_of(chosen)
        entry = result_of_run(EvaluatedRun.of(judge_run(cosim.run(scenario, fmus=fmus))))
    entry.save(folder)
    return folder


def _figure(source: Source, name: str) -> Figure | None:
    return Figure(*source.figures[name], "") if name in source.figures else None
