"""feedsim compare: results against references, for people and for CI."""

from __future__ import annotations

import sys
import traceback
from argparse import Namespace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

from feedsim.cli.options import Command, Group, Option, halves
from feedsim.cli.terminal import visible

if TYPE_CHECKING:
    from feedsim.compare import Comparison, Options, Tolerances, Variable
    from feedsim.trace import Array, Series

DESCRIPTION = """Compare results of any simulator, or measured records, with references: every row of the result must
lie in a tube of tolerance, in value and in time, around the reference. Columns of the reference that the result lacks
count as different; further columns of the result do not matter."""
EPILOG = """exit codes:
  0 same    1 different    2 unusable: a file, a column, a unit or an option is wrong, or nothing can be compared

examples:
  feedsim compare result.csv reference.csv --tol 1e-6
  feedsim compare result.csv reference.csv --tol 1e-6 --tol "*.x_a=2 nm" --tol "*.M_a=1e-3 N.m,1 ms" --report out.html
  feedsim compare results/ references/ --junit compare.xml
  feedsim compare ecos.csv reference.csv --column "plant::*=*" --column "controller_*::M_a=*.M_a" --common
  feedsim example emps
  feedsim compare results/emps/result.csv DATA_EMPS.mat --reference-columns machines/emps/columns.yaml --axis X \\
      --shift estimate --max-shift "2 s" --tol "X.x_a=20 um" --tol "X.M_a=ignore"
"""
MOST_LINES = 10
# What a record's signals are called here, and their units.
RECORD_UNITS = {"x_a": "m", "x_s": "m", "n_a": "rad/s", "M_a": "N.m"}


def compare(options: Namespace) -> int:
    """Compare, tell, write; the exit code. Whatever goes wrong is 2: 1 says that results differ."""
    from feedsim.errors import FeedsimError

    try:
        comparisons, durations = _compared(options)
        code = max(each.exit_code for each in comparisons)
        from feedsim.report import compare as report

        report.write(comparisons, html=options.report, xml=options.junit, json=options.json, durations=durations)
    except FeedsimError as error:
        print(*(visible(line) for line in f"feedsim: {error}".split("\n")), sep="\n", file=sys.stderr)
        return 2
    except Exception:  # a fault of our own must not look like a difference
        traceback.print_exc()
        return 2
    try:
        if not options.quiet:
            # Of many pairs those that are the same take one line.
            full = options.all or len(comparisons) == 1
            print("\n".join(visible(line) for each in comparisons for line in _lines(each, options.all, full)))
            for line in (
                *_default(comparisons),
                *_unused(comparisons, options),
                *_unreferenced(comparisons, options),
                *_sum(comparisons),
            ):
                print(visible(line))
            sys.stdout.flush()
    except OSError:
        sys.stdout = None  # who read has gone, or the disk is full; the code still counts
    for each in comparisons:
        if each.verdict == "unusable" and options.quiet:
            print(visible(f"feedsim: {each.result}: {each.line}"), file=sys.stderr)
    return code


def _compared(options: Namespace) -> tuple[list[Comparison], list[float]]:
    from feedsim.compare import pairs_of, unusable
    from feedsim.errors import InputError
    from feedsim.report import compare as report

    for option, given in (("--axis", options.axis), ("--machine", options.machine)):
        if given is not None and options.columns is None and options.reference_columns is None:
            raise InputError(
                f"{option} {given}: is for the record of a drive; --columns or --reference-columns says which"
            )
    pairs = pairs_of(options.files)
    inputs = [path for pair in pairs for path in pair]
    inputs += [path for path in (options.tolerances, options.columns, options.reference_columns) if path is not None]
    report.check_writable({"html": options.report, "xml": options.junit, "json": options.json}, inputs)
    choice = _options(options)
    found, durations = [], []
    for result, reference in pairs:
        begin = perf_counter()
        try:
            comparison = _pair(options, choice, result, reference)
        except InputError as error:
            comparison = unusable(result, reference, "; ".join(str(error).splitlines()))
        found.append(comparison)
        durations.append(perf_counter() - begin)
    if problem := _matched_nowhere(found, options.tol):
        found = [unusable(each.result, each.reference, problem) if each.variables else each for each in found]
    return found, durations


def _matched_nowhere(comparisons: list[Comparison], texts: list[str]) -> str:
    """That a pattern of --tol matches in no reference, where it is so."""
    from feedsim.compare import Tolerances
    from feedsim.compare.options import no_match

    compared = [each for each in comparisons if each.variables]
    for pattern, _ in Tolerances.parse(texts).rules:
        if compared and all(pattern in each.unused for each in compared):
            names = dict.fromkeys(variable.name for each in compared for variable in each.variables)
            return f"--tol given for {no_match(pattern, tuple(names))}"
    return ""


def _pair(options: Namespace, choice: Options, result: Path, reference: Path) -> Comparison:
    from dataclasses import replace

    from feedsim import units
    from feedsim.compare import bounds_of, compare_series, estimated_shift, tolerances_of

    tolerances: Tolerances = tolerances_of(reference, options.tolerances, options.tol)
    ours = _read_side(result, options.time, options.columns, options)
    theirs = _read_side(reference, options.reference_time, options.reference_columns, options)
    notes: list[str] = []
    if options.shift == "estimate":
        most = units.parse(options.max_shift, "s")
        shift = estimated_shift(ours, theirs, most, choice, tolerances)
        choice = replace(choice, shift=shift.seconds)
        notes = [shift.note]
    between = bounds_of(reference) if options.reference_columns is None else None
    found = compare_series(ours, theirs, tolerances, choice, between=between, names=(str(result), str(reference)))
    if result.exists() and result.samefile(reference):
        notes.append("result and reference are the same file")
    return replace(found, notes=(*notes, *found.notes))


def _options(options: Namespace) -> Options:
    from feedsim import units
    from feedsim.compare import Options, Tolerances

    Tolerances.parse(options.tol)  # a typing error is told before anything is read
    columns = [halves("column", text, "RESULT=REFERENCE is needed") for text in options.column]

    def instant(text: str | None) -> float | None:
        return None if text is None else units.parse(text, "s", "0.1 s")

    def units_of(texts: list[str], option: str) -> dict[str, str]:
        pairs = dict(halves(option, text, "PATTERN=UNIT is needed") for text in texts)
        for unit in pairs.values():
            units.unit(unit)
        return pairs

    return Options(
        columns=columns,
        only=options.only,
        ignore=options.ignore,
        units=units_of(options.unit, "unit"),
        reference_units=units_of(options.reference_unit, "reference-unit"),
        hold=options.hold,
        start=instant(options.start),
        end=instant(options.end),
        shift=0.0 if options.shift == "estimate" else instant(options.shift) or 0.0,
        common=options.common,
        max_gap=instant(options.max_gap),
        at=options.at,
        cover=_share(options.cover),
    )


def _share(text: str) -> float:
    """Of "90 %" or "0.9". InputError."""
    from feedsim import units
    from feedsim.errors import InputError

    share = units.parse(text, "1", "90 %")
    if not 0 <= share <= 1:
        raise InputError(f"--cover {text}: is outside the allowed range: 0 to 100 %")
    return share


def _read_side(path: Path, time: str | None, mapping: Path | None, options: Namespace) -> Series:
    """Read a file. time: NAME[:UNIT] of its time column; mapping: for a drive's record. InputError."""
    from feedsim.errors import InputError
    from feedsim.trace import read_series

    if mapping is not None:
        return _read_record(path, mapping, options.axis, options.machine)
    if path.suffix.lower() == ".mat":
        raise InputError(f"{path}: a MAT file needs a mapping of its columns: --columns or --reference-columns")
    return read_series(path, time=time)


def _read_record(path: Path, mapping: Path, axis: str | None, machine: Path | None) -> Series:
    """The record of an axis A as A.x_a, A.n_a, A.M_a and A.x_s, as far as it holds them.

    Between the pieces of a record with gaps stands a row without numbers, so that nothing is compared there.
    """
    import numpy as np

    from feedsim.errors import InputError
    from feedsim.files.columns import load_columns
    from feedsim.identify.read import read_records
    from feedsim.scenario import load_subject
    from feedsim.trace import Series

    subject = load_subject(machine) if machine is not None else None
    found = read_records(path, load_columns(mapping), axis, subject.machine if subject else None)
    told = found.provenance
    named = told.axis or axis
    if not named:
        raise InputError(f"{path}: the record does not tell which axis it is of; give --axis, for example --axis Z")
    lead = None if told.pitch is None else told.pitch / (2 * np.pi)
    pieces: dict[str, list[Array]] = {"time": []}
    for i, record in enumerate(found.records):
        columns = {"time": record.time, "n_a": record.speed, "M_a": record.torque}
        if lead is not None:
            columns["x_a"] = None if record.angle is None else record.angle * lead
            columns["x_s"] = None if record.setpoint is None else record.setpoint * lead
        for name, values in columns.items():
            if values is None:
                continue
            parts = pieces.setdefault(name, [])
            if i:
                gap = 0.5 * (found.records[i - 1].time[-1] + record.time[0])
                parts.append(np.array([gap if name == "time" else np.nan]))
            parts.append(values)
    joined = {name: np.concatenate(parts) for name, parts in pieces.items()}
    time = joined.pop("time")
    return Series(
        time,
        {f"{named}.{name}": values for name, values in joined.items()},
        {f"{named}.{name}": RECORD_UNITS[name] for name in joined},
    )


def _lines(comparison: Comparison, everything: bool, notes: bool) -> list[str]:
    """What the terminal shows of a pair; notes: although it is the same."""
    found = [f"{comparison.result} against {comparison.reference}: {comparison.line}"]
    if comparison.shift:
        from feedsim.compare import seconds

        found.append(f"  shifted by {seconds(comparison.shift)}")
    ranked = sorted(comparison.variables, key=lambda each: (-each.ratio, each.verdict == "same"))
    shown = [each for each in ranked if everything or each.verdict != "same"]
    cut = shown if everything else shown[:MOST_LINES]
    width = max((len(visible(each.name)) for each in cut), default=0)
    found += [f"  {visible(each.name):<{width}}  {_variable_line(each)}" for each in cut]
    if len(shown) > len(cut):
        found.append(f"  and {len(shown) - len(cut)} more; --all lists them")
    found += [f"  looks like: {each.text}" for each in comparison.looks_like]
    return found + [f"  note: {note}" for note in comparison.notes if notes or not comparison.same]


def _variable_line(variable: Variable) -> str:
    outside = f"; outside in {variable.outside} of {variable.rows} rows" if variable.outside else ""
    return f"{variable.verdict}: {variable.line}{outside}"


def _default(comparisons: list[Comparison]) -> list[str]:
    """Of several pairs, whose notes are not shown where they are the same: that no tolerance is given for some."""
    if len(comparisons) == 1:
        return []
    hidden = [
        (each, note) for each in comparisons if each.same for note in each.notes if note.startswith("no tolerance")
    ]
    more = f" (as in {len(hidden) - 1} more)" if len(hidden) > 1 else ""
    return [f"note: {hidden[0][0].result}: {hidden[0][1]}{more}"] if hidden else []


def _unused(comparisons: list[Comparison], options: Namespace) -> list[str]:
    """Patterns of a tolerance file that match in no reference.

    Of the file that was asked for, each; one that lies beside references serves those too that are not compared, so
    that there only a word is worth it that none of its patterns matches.
    """
    from feedsim.compare.files import beside, tolerances_of

    by_file: dict[Path, list[set[str]]] = {}
    for each in comparisons:
        if (file := options.tolerances or beside(Path(each.reference))) is not None and each.variables:
            by_file.setdefault(file, []).append(set(each.unused))
    found = []
    for file, unused in by_file.items():
        own = [pattern for pattern, _ in tolerances_of(file, file, ()).rules if pattern != "*"]
        nowhere = [pattern for pattern in own if all(pattern in each for each in unused)]
        if nowhere and (options.tolerances is not None or nowhere == own):
            found.append(f"note: {file}: matches no column: {', '.join(map(repr, nowhere))}")
    return found


def _unreferenced(comparisons: list[Comparison], options: Namespace) -> list[str]:
    """That files of a folder of results have no reference."""
    compared = {Path(each.result) for each in comparisons}
    found = []
    for folder, reference in zip(options.files[::2], options.files[1::2], strict=True):
        if folder.is_dir() and reference.is_dir():
            more = sorted({path for path in folder.rglob("*.csv") if path.is_file()} - compared)
            named = ", ".join(str(path.relative_to(folder)) for path in more[:3]) + (", ..." if len(more) > 3 else "")
            found += [f"note: {folder}: {len(more)} CSV files have no reference: {named}"] if more else []
    return found


def _sum(comparisons: list[Comparison]) -> list[str]:
    if len(comparisons) == 1:
        return []
    counts = [(sum(each.verdict == kind for each in comparisons), kind) for kind in ("same", "different", "unusable")]
    told = ", ".join(f"{number} {kind}" for number, kind in counts if number)
    partly = sum(each.coverage is not None and each.same and each.coverage.share < 1 for each in comparisons)
    told += f"; in {partly} of them not all rows are compared" if partly else ""
    return [f"{len(comparisons)} comparisons: {told}"]


def _side(side: str, whose: str) -> tuple[Option, ...]:
    """What can be said of the columns of either side."""
    return (
        Option(f"--{whose}unit", "PATTERN=UNIT", f"unit of the {side}'s columns whose header tells none", many=True),
        Option(f"--{whose}time", "NAME[:UNIT]", f"time column of the {side}"),
        Option(f"--{whose}columns", "MAPPING.yaml", f"mapping, where the {side} is a drive's record", type=Path),
    )


COMMAND = Command(
    "compare",
    "compare results of any simulator with references; exit code 0 same, 1 different, 2 unusable",
    compare,
    (
        Option("files", "RESULT REFERENCE", "CSV files in turn, or two folders", type=Path, nargs="+"),
        Group(
            "tolerances",
            Option("--tol", "[PATTERN=]VALUE[,TIME]",
                   "1e-6 (of the range of the reference), '2 nm', '1 ms' (in time) or both, for all variables or those "
                   "of a pattern: '*.M_a=1e-3 N.m,1 ms'; several times, later ones count more (default: 1e-3)",
                   many=True),
            Option("--tolerances", "FILE.yaml",
                   "tolerance file (default: the reference's own beside it, docs/comparing.md)", type=Path),
        ),
        Group(
            "columns",
            Option("--column", "RESULT=REFERENCE",
                   "column of the result that is called otherwise; with * on both sides all such: 'plant.*=*'",
                   many=True),
            Option("--only", "PATTERN", "compare these variables only", many=True),
            Option("--ignore", "PATTERN", "do not compare these", many=True),
            Option("--common", "", "columns that the result lacks are left out, not missing"),
            Option("--hold", "PATTERN", "hold their values between rows, without ramps (flags of 0 and 1 do)",
                   many=True),
            *_side("result", ""),
            *_side("reference", "reference-"),
            Option("--axis", "NAME", "axis of a drive's record"),
            Option("--machine", "MACHINE-or-SCENARIO", "gives pitch and torque constant", type=Path),
        ),
        Group(
            "time",
            Option("--from", "TIME", "compare from this instant on, such as '0.1 s'", dest="start"),
            Option("--to", "TIME", "compare up to this instant", dest="end"),
            Option("--shift", "TIME", "added to the result's time, such as '0.5 ms', or 'estimate'", default="0 s"),
            Option("--max-shift", "TIME", "largest estimated shift (default: 50 ms)", default="50 ms"),
            Option("--cover", "SHARE",
                   "least share of the result's rows that must be compared, such as '90 %%' (default: any, and told)",
                   default="0 %"),
            Option("--max-gap", "TIME", "longest step between rows of the result (default: any)"),
            Option("--at", "",
                   "whose instants are looked at (auto: the result's, unless the reference has clearly fewer rows and "
                   "no bounds between them)",
                   choices=("auto", "result", "reference"), default="auto"),
        ),
        Group(
            "output",
            Option("--report", "FILE.html", "report with the violated bands", type=Path),
            Option("--junit", "FILE.xml", "JUnit XML for CI servers", type=Path),
            Option("--json", "FILE.json", "all figures", type=Path),
            Option("--all", "", "list every variable, not only those outside"),
            Option("--quiet", "", "print nothing but errors"),
        ),
    ),
    DESCRIPTION,
    EPILOG,
    needs=(),
)  # fmt: skip
