"""Results against references: of any simulator, and measured records."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np

from feedsim.comparison.between import bounds_of
from feedsim.comparison.compare import compare as compared
from feedsim.comparison.files import compare_series, lines_of, pairs_of, tolerances_of, unusable
from feedsim.comparison.likeness import Comparison, Variable, Verdict
from feedsim.comparison.options import Options, no_match
from feedsim.comparison.shift import estimated_shift
from feedsim.comparison.tolerance import Tolerances
from feedsim.files.trace import Series, Trace, as_series, read_series
from feedsim.foundation import units
from feedsim.foundation.arguments import Value, amount, spell_argument
from feedsim.foundation.errors import Finding, InputError
from feedsim.foundation.outputs import allow_replacement, is_replacement_allowed
from feedsim.jobs.parameters import Argument, Force, Option, job
from feedsim.jobs.result import Kind, Result
from feedsim.report import compare as page

if TYPE_CHECKING:
    from feedsim.analysis import Figures
    from feedsim.files.trace import Array
    from feedsim.jobs.run import EvaluatedRun
    from feedsim.simulation.cosim import Run

File = str | Path
# What a record's signals are called here, and their units.
RECORD_UNITS = {"x_a": "m", "x_s": "m", "n_a": "rad/s", "M_a": "N.m"}
JSON, XML = "compare.json", "compare.xml"
Pairs = Mapping[str, str] | Sequence[str]  # name -> text, or texts NAME=TEXT


KIND = Kind("compare", (JSON, XML))


@dataclass(frozen=True, eq=False)
class Comparisons:
    """Comparisons, one for each pair of files.

    asked: files and folders that were given, in turn. tolerances: the tolerance file that was asked for.
    durations: of the comparisons [s].
    """

    comparisons: Sequence[Comparison]
    asked: Sequence[Path] = ()
    tolerances: Path | None = None
    durations: Sequence[float] = ()

    @property
    def verdict(self) -> Verdict:
        """Of all: "same", "different" or "unusable", whichever is worst."""
        return max(self.comparisons, key=lambda pair: pair.exit_code).verdict

    @property
    def exit_code(self) -> int:
        """0 same, 1 different, 2 unusable."""
        return max(pair.exit_code for pair in self.comparisons)

    @property
    def same(self) -> bool:
        """Whether all are the same."""
        return self.exit_code == 0

    @property
    def worst(self) -> Variable | None:
        """The compared variable of all pairs that is nearest to its limit, or farthest beyond it."""
        variables = [pair.worst for pair in self.comparisons if pair.worst is not None]
        return max(variables, key=lambda variable: (variable.ratio, variable.deviation), default=None)

    @property
    def json(self) -> str:
        """All figures, for programs."""
        return page.to_json(self.comparisons)

    def listed(self, *, everything: bool) -> list[str]:
        """What differs: of every pair its worst variables, and what is to be known; everything: every variable."""
        return lines_of(self.comparisons, self.asked, self.tolerances, everything=everything)


def result_of(value: Comparisons) -> Result[Comparisons]:
    """Comparisons: figures are the largest deviations by variable, of several pairs by "result: variable"."""
    pairs = value.comparisons

    def figures() -> Figures:
        from feedsim.analysis import Figure, FigureTable

        return FigureTable(
            (
                variable.name if len(pairs) == 1 else f"{pair.result}: {variable.name}",
                Figure(variable.deviation, variable.unit, f"largest deviation; allowed {variable.allowed:.4g}"),
            )
            for pair in pairs
            for variable in pair.those("same", "different")
        )

    unusable = (pair for pair in pairs if pair.verdict == "unusable")
    findings = (
        *(Finding("comparison-unusable", "doubt", f"{pair.result}: {pair.line}", pair.result) for pair in unusable),
        *page.not_seen(pairs),
    )
    answers = [f"{pair.result} against {pair.reference}: {pair.line}" for pair in pairs]
    return Result(
        KIND,
        value,
        partial(page.report_of, pairs),
        figures=figures,
        details={"verdict": value.verdict, "answer": answers},
        files=lambda: {JSON: page.to_json(pairs), XML: page.junit(pairs, value.durations)},
        inputs=[Path(name) for pair in pairs for name in (pair.result, pair.reference)],
        answers=answers,
        findings=findings,
        lines=partial(value.listed, everything=False),
        all_lines=partial(value.listed, everything=True),
        in_lines=findings,
    )


@job("compare results with references, for CI: 0 same, 1 different", needs=())
def compare(
    *files: Annotated[
        File | Trace | Run | Result[EvaluatedRun],
        Argument("RESULT REFERENCE", "CSV files in turn, or two folders", many=True),
    ],
    tol: Annotated[
        str | Sequence[str],
        Option(
            "[PATTERN=]VALUE[,TIME]",
            "1e-6 (of the range of the reference), '2 nm', '1 ms' (in time) or both, for all "
            "variables or those of a pattern: 'plant.*=1e-3 N.m,1 ms'; several times, later ones "
            "count more (default: 1e-3)",
            many=True,
            group="tolerances",
        ),
    ] = (),
    tolerances: Annotated[
        File | None,
        Option(
            "FILE.yaml",
            "tolerance file (default: the reference's own beside it, docs/comparing.md)",
            group="tolerances",
        ),
    ] = None,
    column: Annotated[
        Pairs,
        Option(
            "RESULT=REFERENCE",
            "column of the result that is called otherwise; with * on both sides all such: 'plant.*=*'",
            many=True,
            group="columns",
        ),
    ] = (),
    only: Annotated[
        str | Sequence[str], Option("PATTERN", "compare these variables only", many=True, group="columns")
    ] = (),
    ignore: Annotated[str | Sequence[str], Option("PATTERN", "do not compare these", many=True, group="columns")] = (),
    common: Annotated[
        bool, Option("", "columns that the result lacks are left out, not missing", group="columns")
    ] = False,
    hold: Annotated[
        str | Sequence[str],
        Option(
            "PATTERN", "hold their values between rows, without ramps (flags of 0 and 1 do)", many=True, group="columns"
        ),
    ] = (),
    unit: Annotated[
        Pairs,
        Option("PATTERN=UNIT", "unit of the result's columns whose header gives none", many=True, group="columns"),
    ] = (),
    time: Annotated[str | None, Option("NAME[:UNIT]", "time column of the result", group="columns")] = None,
    columns: Annotated[
        File | None, Option("MAPPING.yaml", "mapping, where the result is a drive's record", group="columns")
    ] = None,
    reference_unit: Annotated[
        Pairs,
        Option("PATTERN=UNIT", "unit of the reference's columns whose header gives none", many=True, group="columns"),
    ] = (),
    reference_time: Annotated[
        str | None, Option("NAME[:UNIT]", "time column of the reference", group="columns")
    ] = None,
    reference_columns: Annotated[
        File | None, Option("MAPPING.yaml", "mapping, where the reference is a drive's record", group="columns")
    ] = None,
    axes: Annotated[str | None, Option("NAME", "axis of a drive's record", group="columns")] = None,
    machine: Annotated[
        File | None, Option("MACHINE-or-SCENARIO", "gives pitch and torque constant", group="columns")
    ] = None,
    start: Annotated[
        Value | None, Option("TIME", "compare from this instant on, such as '0.1 s'", group="time", typed="--from")
    ] = None,
    end: Annotated[Value | None, Option("TIME", "compare up to this instant", group="time", typed="--to")] = None,
    shift: Annotated[
        Value, Option("TIME", "added to the result's time, such as '0.5 ms', or 'estimate'", group="time")
    ] = 0.0,
    max_shift: Annotated[Value, Option("TIME", "largest estimated shift (default: 50 ms)", group="time")] = "50 ms",
    cover: Annotated[
        Value,
        Option(
            "SHARE",
            "least share of the result's rows that must be compared, such as '90 %' (default: any; reported)",
            group="time",
        ),
    ] = 0.0,
    max_gap: Annotated[
        Value | None, Option("TIME", "longest step between rows of the result (default: any)", group="time")
    ] = None,
    at: Annotated[
        Literal["auto", "result", "reference"],
        Option(
            "",
            "whose instants are looked at (auto: the result's, unless the reference has clearly "
            "fewer rows and no bounds between them)",
            choices=("auto", "result", "reference"),
            group="time",
        ),
    ] = "auto",
    report: Annotated[
        File | None, Option("FILE.html", "report with the violated bands", group="output", writes=True)
    ] = None,
    junit: Annotated[File | None, Option("FILE.xml", "JUnit XML for CI servers", group="output", writes=True)] = None,
    force: Force = False,
) -> Result[Comparisons]:
    r"""Compare results with references: every row must lie in a tube of value and time around the reference.

    Columns of the reference that the result lacks count as different; further columns of the result do not matter. Exit
    codes: 0 same, 1 different, 2 unusable: a file, a column, a unit or an option is wrong, or nothing can be compared.

    Command line:
        feedsim compare result.csv reference.csv --tol 1e-6
        feedsim compare result.csv reference.csv --tol 1e-6 --tol "*.x_a=2 nm" --tol "*.M_a=1e-3 N.m,1 ms"
        feedsim compare result.csv reference.csv --report out.html
        feedsim compare results/ references/ --junit compare.xml
        feedsim compare ecos.csv reference.csv --column "plant::*=*" --column "controller_*::M_a=*.M_a" --common
        feedsim example emps
        feedsim compare results/emps/result.csv DATA_EMPS.mat --reference-columns machines/emps/columns.yaml --axes X \
            --shift estimate --max-shift "2 s" --tol "X.x_a=20 um" --tol "X.M_a=ignore"

    Raises:
        InputError: wrong arguments. What cannot be compared is "unusable" in what is returned.
        OutputError: a file cannot be written.

    >>> import feedsim as fs
    >>> result = fs.run("z_positioning.yaml")
    >>> fs.compare(result, result).verdict
    'same'
    """
    texts = _texts(tol)
    for option, given in (("axes", axes), ("machine", machine)):
        if given is not None and columns is None and reference_columns is None:
            raise InputError(
                f"{spell_argument(option)} {given}: is for the record of a drive; {spell_argument('columns')} or "
                f"{spell_argument('reference_columns')} says which"
            )
    choice = Options(
        columns=_pairs("column", column, "RESULT=REFERENCE"),
        only=_texts(only),
        ignore=_texts(ignore),
        units=_units("unit", unit),
        reference_units=_units("reference_unit", reference_unit),
        hold=_texts(hold),
        start=_instant(start),
        end=_instant(end),
        shift=0.0 if shift == "estimate" else _instant(shift) or 0.0,
        common=common,
        max_gap=_instant(max_gap),
        at=at,
        cover=_share(cover),
    )
    asked = _ShiftOptions(
        texts,
        None if tolerances is None else Path(tolerances),
        choice,
        _Side(time, None if columns is None else Path(columns)),
        _Side(reference_time, None if reference_columns is None else Path(reference_columns)),
        axes,
        None if machine is None else Path(machine),
        amount(max_shift, "s") if shift == "estimate" else None,
    )
    Tolerances.parse(texts)  # a typing error is reported before anything is read
    paths = [Path(file) for file in files if isinstance(file, str | Path)]
    outputs = {name: None if file is None else Path(file) for name, file in
               (("html", report), ("xml", junit))}  # fmt: skip
    with allow_replacement(force or is_replacement_allowed()):
        if len(paths) < len(files):
            comparisons, durations = asked.in_memory(files)
            page.check_writable(outputs, paths)
        else:
            pairs = pairs_of(paths)
            own = [asked.tolerances, asked.ours.mapping, asked.theirs.mapping]
            page.check_writable(outputs, [*(path for pair in pairs for path in pair), *filter(None, own)])
            comparisons, durations = asked.of_files(pairs)
        result = result_of(Comparisons(comparisons, paths, asked.tolerances, durations))
        page.write(comparisons, **outputs, durations=durations)
    return result


@dataclass(frozen=True)
class _Side:
    """How a file of one side is read. time: NAME[:UNIT] of its time column; mapping: for a drive's record."""

    time: str | None
    mapping: Path | None


@dataclass(frozen=True)
class _ShiftOptions:
    """How pairs are compared. most: the largest shift that is estimated [s]; None: none is."""

    tol: Sequence[str]
    tolerances: Path | None
    choice: Options
    ours: _Side
    theirs: _Side
    axis: str | None
    machine: Path | None
    most: float | None

    def of_files(self, pairs: Sequence[tuple[Path, Path]]) -> tuple[list[Comparison], list[float]]:
        """Comparisons of pairs of files, and how long they took [s]."""
        comparisons, durations = [], []
        for result, reference in pairs:
            begin = perf_counter()
            try:
                comparison = self._pair(result, reference)
            except InputError as error:
                comparison = unusable(result, reference, "; ".join(str(error).splitlines()))
            comparisons.append(comparison)
            durations.append(perf_counter() - begin)
        if problem := _matched_nowhere(comparisons, self.tol):
            comparisons = [
                unusable(comparison.result, comparison.reference, problem) if comparison.variables else comparison
                for comparison in comparisons
            ]
        return comparisons, durations

    def in_memory(self, given: Sequence[Any]) -> tuple[list[Comparison], list[float]]:
        """The same of traces and runs, and of CSV files beside them."""
        if len(given) % 2:
            raise InputError(f"{len(given)} results given; result and reference are needed in turn")
        comparisons, durations = [], []
        for result, reference in zip(given[::2], given[1::2], strict=True):
            begin = perf_counter()
            ours, theirs = _series(result, self.ours), _series(reference, self.theirs)
            names = tuple(str(value) if isinstance(value, str | Path) else what
                          for value, what in ((result, "result"), (reference, "reference")))  # fmt: skip
            limits = tolerances_of(Path("reference"), self.tolerances, self.tol)
            choice, notes = self._estimate_shift(ours, theirs, limits)
            comparison = compared(ours, theirs, limits, choice, names=(names[0], names[1]))
            comparisons.append(replace(comparison, notes=(*notes, *comparison.notes)))
            durations.append(perf_counter() - begin)
        return comparisons, durations

    def _pair(self, result: Path, reference: Path) -> Comparison:
        limits = tolerances_of(reference, self.tolerances, self.tol)
        ours = self._read(result, self.ours)
        theirs = self._read(reference, self.theirs)
        choice, notes = self._estimate_shift(ours, theirs, limits)
        between = bounds_of(reference) if self.theirs.mapping is None else None
        comparison = compare_series(ours, theirs, limits, choice, between=between, names=(str(result), str(reference)))
        if result.exists() and result.samefile(reference):
            notes.append("result and reference are the same file")
        return replace(comparison, notes=(*notes, *comparison.notes))

    def _estimate_shift(self, ours: Series, theirs: Series, limits: Tolerances) -> tuple[Options, list[str]]:
        """The choice with the shift that is estimated, and a note on it."""
        if self.most is None:
            return self.choice, []
        shift = estimated_shift(ours, theirs, self.most, self.choice, limits)
        return replace(self.choice, shift=shift.seconds), [shift.note]

    def _read(self, path: Path, side: _Side) -> Series:
        if side.mapping is not None:
            return _read_record(path, side.mapping, self.axis, self.machine)
        return read_series(path, time=side.time)


def _series(given: Any, side: _Side) -> Series:
    if isinstance(given, str | Path):
        return read_series(Path(given), time=side.time)
    return as_series(given if isinstance(given, Trace) else given.trace)


def _texts(given: str | Sequence[str]) -> list[str]:
    return [given] if isinstance(given, str) else list(given)


def _pairs(option: str, given: Pairs, form: str) -> list[tuple[str, str]]:
    """(name, text) of a mapping, or of texts NAME=TEXT. Raises InputError: no such form."""
    if isinstance(given, Mapping):
        return [*given.items()]
    result = []
    for text in given:
        name, equals, value = (part.strip() for part in text.partition("="))
        if not (name and equals and value):
            raise InputError(f"{spell_argument(option)} {text}: {form} is needed")
        result.append((name, value))
    return result


def _units(option: str, given: Pairs) -> dict[str, str]:
    pairs = dict(_pairs(option, given, "PATTERN=UNIT"))
    for unit in pairs.values():
        units.unit(unit)
    return pairs


def _instant(value: Value | None) -> float | None:
    return None if value is None else amount(value, "s", "0.1 s")


def _share(value: Value) -> float:
    """Of 0.9, "90 %" or "0.9". InputError."""
    share = amount(value, "1", "90 %")
    if not 0 <= share <= 1:
        raise InputError(f"{spell_argument('cover')} {value}: is outside the allowed range: 0 to 100 %")
    return share


def _matched_nowhere(comparisons: Sequence[Comparison], texts: Sequence[str]) -> str:
    """That a pattern of --tol matches in no reference, where it is so."""
    compared = [comparison for comparison in comparisons if comparison.variables]
    for pattern, _ in Tolerances.parse(texts).rules:
        if compared and all(pattern in comparison.unused for comparison in compared):
            names = dict.fromkeys(variable.name for comparison in compared for variable in comparison.variables)
            return f"{spell_argument('tol')} given for {no_match(pattern, tuple(names))}"
    return ""


def _read_record(path: Path, mapping: Path, axis: str | None, machine: Path | None) -> Series:
    """The record of an axis A as A.x_a, A.n_a, A.M_a and A.x_s, as far as it holds them.

    Between the pieces of a record with gaps stands a row without numbers, so that nothing is compared there.
    """
    from feedsim.estimation.identify.read import read_records
    from feedsim.files.columns import load_columns
    from feedsim.scenario import load_subject

    subject = load_subject(machine) if machine is not None else None
    recorded = read_records(path, load_columns(mapping), axis, subject.machine if subject else None)
    source = recorded.provenance
    named = source.axis or axis
    if not named:
        raise InputError(
            f"{path}: the record does not say which axis it is of; give {spell_argument('axes')}, for example "
            f"{spell_argument('axes')} Z"
        )
    lead = None if source.pitch is None else source.pitch / (2 * np.pi)
    pieces: dict[str, list[Array]] = {"time": []}
    for i, record in enumerate(recorded.records):
        columns = {"time": record.time, "n_a": record.speed, "M_a": record.torque}
        if lead is not None:
            columns["x_a"] = None if record.angle is None else record.angle * lead
            columns["x_s"] = None if record.setpoint is None else record.setpoint * lead
        for name, values in columns.items():
            if values is None:
                continue
            parts = pieces.setdefault(name, [])
            if i:
                gap = 0.5 * (recorded.records[i - 1].time[-1] + record.time[0])
                parts.append(np.array([gap if name == "time" else np.nan]))
            parts.append(values)
    joined = {name: np.concatenate(parts) for name, parts in pieces.items()}
    time = joined.pop("time")
    return Series(
        time,
        {f"{named}.{name}": values for name, values in joined.items()},
        {f"{named}.{name}": RECORD_UNITS[name] for name in joined},
    )
