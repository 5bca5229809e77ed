"""The many runs of a study, in one table, with what moves its figures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from numpy.typing import NDArray

from feedsim.analysis import Figure, FigureTable
from feedsim.design.sweep.design import design
from feedsim.design.sweep.study import AllFailed, Progress
from feedsim.design.sweep.study import run as run_study
from feedsim.design.sweep.table import RECORD, Format, Table
from feedsim.foundation.arguments import settings
from feedsim.foundation.outputs import TemporaryFolder
from feedsim.jobs.parameters import (
    NO_WATCH,
    Archives,
    Argument,
    FigureKinds,
    File,
    Force,
    Option,
    Settings,
    Watch,
    job,
    output_option,
)
from feedsim.jobs.result import Kind, Result, announce_programs, claim_result_folder
from feedsim.report.results import Content, discard
from feedsim.report.sweep import report as page
from feedsim.report.sweep.account import Account, details
from feedsim.scenario.study import Study, load_study

if TYPE_CHECKING:
    import pandas


KIND = Kind("sweep")


@dataclass(frozen=True, eq=False)
class Swept:
    """A study with its runs: ``result["Z.overshoot"]`` is a column of its table.

    account: table, study, design and what they come to. folder: where table, journal and record of the study are.
    resumed: runs that the folder had before.
    """

    account: Account
    folder: Path
    resumed: int = 0
    _kept: TemporaryFolder | None = None  # which lives as long as this

    @property
    def study(self) -> Study:
        """The study, checked."""
        return self.account.study

    @property
    def table(self) -> Table:
        """A row per run: parameters, figures, messages."""
        return self.account.table

    @property
    def ok(self) -> NDArray[np.bool_]:
        """Which runs have come to their end."""
        return self.table.ok

    def __getitem__(self, name: str) -> NDArray[Any]:
        return self.table[name]

    def __len__(self) -> int:
        return len(self.table)

    def to_pandas(self) -> pandas.DataFrame:
        """The table. Needs the package pandas."""
        return self.table.to_pandas()


def result_of(swept: Swept) -> Result[Swept]:
    """A study with its runs: how far figures scatter, what moves them; each figure is a median. nan: no run has it."""
    table, failed = swept.table, int((~swept.ok).sum())
    wrong = [findings[0] for findings in table.findings.values() if findings[0].severity == "wrong"]
    words = f", {swept.resumed} of them before" if swept.resumed else ""
    words += f", {failed} of them failed (their messages are in the table)" if failed else ""

    def files() -> Mapping[str, Content]:
        """Table and record of the study; in its own folder they stay as they are."""
        paths = [swept.folder / RECORD, *swept.folder.glob("table.*")]
        return {path.name: path.read_bytes() for path in paths if path.is_file()}

    return Result(
        KIND,
        swept,
        partial(page.drawn_report, swept.account),
        figures=lambda: FigureTable(
            (name, Figure(_median(table[name]), table.unit(name), f"median of {len(table)} runs"))
            for name in table.figures
        ),
        details=partial(details, swept.account),
        files=files,
        inputs=inputs_of(swept.study),
        answers=partial(page.answers, swept.account),
        findings=tuple(
            replace(first, text=f"{len(wrong)} of {len(table)} runs, the first: {' '.join(first.text.split())}")
            for first in wrong[:1]
        ),
        lines=lambda: [*page.goal_words(swept.account), f"{swept.study.name}: {len(table)} runs{words}"],
    )


@job("make the runs of a study; table, sensitivities, report", needs=("sweep",))
def sweep(
    study: Annotated[File, Argument("STUDY.yaml", "study file (docs/sweeps.md)")],
    out: Annotated[File | None, output_option("{study}")] = None,
    *,
    set: Settings = None,
    runs: Annotated[int | None, Option("N", "in place of the study's sampling.runs")] = None,
    workers: Annotated[int | None, Option("N", "processes (default: the cores; 0: this one alone)")] = None,
    scheduler: Annotated[
        str | None, Option("ADDRESS", "make the runs on the Dask cluster with this scheduler, tcp://host:8786")
    ] = None,
    format: Annotated[Format, Option("", "of the table (default: csv)", choices=("csv", "parquet"))] = "csv",
    restart: Annotated[bool, Option("", "begin anew; discards the runs that DIR has")] = False,
    fmus: Archives = None,
    figures: FigureKinds = (),
    force: Force = False,
    watch: Watch = NO_WATCH,
) -> Result[Swept]:
    """Make the runs of a study; those that `out` has are not made again.

    A study varies parameters of a scenario over a grid, a Latin hypercube or a Sobol sequence (docs/sweeps.md). Leaves
    table.csv or table.parquet with a row per run, study.json and a report. A run that fails is a row with its message.
    A study that was interrupted continues when the same command is given again. Exit code 3: all runs failed, or all
    workers were lost.

    Command line:
        feedsim example friction_wear z_stop
        feedsim sweep studies/friction_wear.yaml
        feedsim sweep studies/z_stop.yaml --runs 20 --out results/try
        feedsim sweep studies/z_stop.yaml --set "machine.axes.Z.friction.W=0 rad" --format parquet
        feedsim sweep studies/friction_wear.yaml --scheduler tcp://node1:8786
        feedsim check studies/z_stop.yaml

    Raises:
        InputError: a faulty file, or a folder that belongs to another state of the study.
        AllFailed: all runs failed; table and report are written.
        SimulationError: the workers are lost.
        OutputError: `out` cannot be written.

    >>> import feedsim as fs
    >>> result = fs.sweep("studies/z_stop.yaml", "study", runs=2, workers=1)
    >>> len(result), int(result.ok.sum())
    (2, 2)
    """
    texts = settings(set)
    loaded = load_study(study, texts, runs=runs)
    watch.warn(loaded.warnings)
    planned = design(loaded)
    archives = None if fmus is None else Path(fmus)
    scenario = loaded.base.scenario
    announce_programs(watch, scenario.machine, archives, scenario.coupling)
    temporary = TemporaryFolder() if out is None else None
    folder = temporary.path if temporary is not None else Path(out or "")

    resumed = 0

    def progress(now: Progress) -> None:
        nonlocal resumed
        resumed = now.resumed
        watch.progress(loaded.name, now.done, now.total, now.resumed, f"{now.failed} failed" if now.failed else "")

    with claim_result_folder(folder, KIND, watch, inputs_of(loaded), texts, force=force):
        try:
            table = run_study(
                loaded,
                folder,
                workers=workers,
                scheduler=scheduler,
                fmus=archives,
                progress=progress,
                restart=restart,
                format=format,
                command=watch.command,
                say=watch.say,
                discard=lambda: discard(folder),
            )
        except KeyboardInterrupt:
            watch.announce(f"what is done stays in {folder}; the same command continues")
            raise
        except AllFailed as error:
            # The report groups failures by what they have in common.
            page.write(error.table, loaded, planned, folder, drawn=figures)
            raise
        if out is not None:
            page.write(table, loaded, planned, folder, drawn=figures)
        return result_of(Swept(page.account_of(table, loaded, planned, folder), folder, resumed, temporary))


def inputs_of(study: Study) -> list[Path]:
    """Files that a study reads."""
    return [study.file, study.scenario, *study.files]


def _median(values: NDArray[Any]) -> float:
    known = np.asarray(values, dtype=np.float64)
    known = known[np.isfinite(known)]
    return float(np.median(known)) if known.size else float("nan")
