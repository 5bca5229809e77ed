"""Files that are compared: pairs of them, or two folders with files of the same names."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from feedsim.comparison.between import BOUNDS, bounds_of
from feedsim.comparison.compare import compare
from feedsim.comparison.likeness import Comparison, Variable, seconds
from feedsim.comparison.options import Options
from feedsim.comparison.tolerance import Tolerances
from feedsim.files.columns import load_tolerances
from feedsim.files.trace import Series, read_series
from feedsim.foundation.errors import InputError

TOLERANCES = "tolerances.yaml"
# reference data in the layout of the FMI cross-check
REFERENCE_ENDING = "_ref.csv"


def pairs_of(paths: Sequence[Path]) -> list[tuple[Path, Path]]:
    """(result, reference) of RESULT REFERENCE [RESULT REFERENCE ...]; a pair of folders is compared by file names.

    Every CSV file of the reference folder and of those below, or every *_ref.csv where there are any, has its result at
    the same place in the result folder, whether there is one or not; case_ref.csv takes case.csv where there is no
    case_ref.csv. A file beside a folder is that file of the folder. InputError.
    """
    if len(paths) % 2 or not paths:
        raise InputError(f"{len(paths)} files given; RESULT and REFERENCE are needed in turn")
    results: list[tuple[Path, Path]] = []
    for result, reference in zip(paths[::2], paths[1::2], strict=True):
        if reference.is_dir() and result.is_dir():
            files = csv_files(reference)
            # Beside references of the FMI cross-check lie inputs, parameters and others.
            files = [path for path in files if path.name.endswith(REFERENCE_ENDING)] or files
            files = [path for path in files if not path.name.endswith(BOUNDS)]
            if not files:
                raise InputError(f"{reference}: there is no CSV file in the folder of references")
            results += [(_counterpart(result, path.relative_to(reference)), path) for path in files]
        elif reference.is_dir() and not result.is_file():
            raise InputError(f"{result}: no such folder of results")
        elif reference.is_dir():
            results.append((result, reference / result.name))
        else:
            results.append((result / reference.name if result.is_dir() else result, reference))
    return results


def csv_files(folder: Path) -> list[Path]:
    """CSV files of a folder and of those below, in order, without what vanishes meanwhile or may not be read."""
    paths = (Path(place, name) for place, _, names in os.walk(folder) for name in names)
    return sorted(path for path in paths if path.suffix.lower() == ".csv" and path.is_file())


def compare_files(
    result: Path, reference: Path, tolerances: Tolerances | None = None, options: Options | None = None
) -> Comparison:
    """Read and compare two files, the reference with the bounds beside it.

    What cannot be read or compared is reported in what is returned.
    """
    read: list[Series] = []
    for path, what in ((result, "result"), (reference, "reference")):
        try:
            read.append(read_series(path))
        except InputError as error:
            return unusable(result, reference, f"the {what} cannot be read: {error}")
    try:
        between = bounds_of(reference)
    except InputError as error:
        return unusable(result, reference, f"the reference's bounds cannot be read: {error}")
    names = (str(result), str(reference))
    return compare_series(read[0], read[1], tolerances, options, between=between, names=names)


@np.errstate(all="ignore")  # values of any magnitude are compared
def compare_series(
    result: Series,
    reference: Series,
    tolerances: Tolerances | None = None,
    options: Options | None = None,
    *,
    between: Series | None = None,
    names: tuple[str, str],
) -> Comparison:
    """compare(), with options that are wrong reported in what is returned."""
    try:
        return compare(result, reference, tolerances, options, between=between, names=names)
    except InputError as error:
        return unusable(*names, str(error))


def unusable(result: str | Path, reference: str | Path, problem: str) -> Comparison:
    """A pair that cannot be compared."""
    return Comparison(str(result), str(reference), "unusable", problem=problem)


def find_tolerance_file(reference: Path) -> Path | None:
    """Tolerance file of a reference: case.tolerances.yaml for case.csv or case_ref.csv, else tolerances.yaml beside."""
    stems = (reference.stem, reference.name.removesuffix(REFERENCE_ENDING))
    candidates = [reference.with_name(f"{stem}.{TOLERANCES}") for stem in stems]
    return next((path for path in (*candidates, reference.with_name(TOLERANCES)) if path.is_file()), None)


def tolerances_of(reference: Path, file: Path | None, texts: Sequence[str]) -> Tolerances:
    """Of a tolerance file (default: the one beside the reference), then of texts as behind --tol. InputError.

    They may serve several references: a pattern that matches nothing is reported in Comparison.unused.
    """
    path = file or find_tolerance_file(reference)
    written = Tolerances.of_file(load_tolerances(path)) if path is not None else Tolerances()
    return written + Tolerances.parse(texts).for_several()


def _counterpart(folder: Path, name: Path) -> Path:
    path = folder / name
    if not path.is_file() and name.name.endswith(REFERENCE_ENDING):
        shorter = path.with_name(name.name.removesuffix(REFERENCE_ENDING) + ".csv")
        return shorter if shorter.is_file() else path
    return path


# --- What the terminal shows of comparisons, line by line. Start reading at lines_of() --------------------------------


MOST_LINES = 10


def lines_of(
    comparisons: Sequence[Comparison], asked: Sequence[Path], tolerances: Path | None, *, everything: bool
) -> list[str]:
    """Lines of all pairs, and what is to be known of them together.

    asked: files and folders that were given, in turn. tolerances: the tolerance file that was asked for. everything:
    every variable, not the worst alone.
    """
    # Of many pairs those that are the same take one line.
    full = everything or len(comparisons) == 1
    result = [line for pair in comparisons for line in _lines(pair, everything, full)]
    return [
        *result,
        *_note_default_tolerance(comparisons),
        *_note_unused_patterns(comparisons, tolerances),
        *_note_unreferenced_files(comparisons, asked),
        *_sum(comparisons),
    ]


def _lines(comparison: Comparison, everything: bool, notes: bool) -> list[str]:
    """What the terminal shows of a pair; notes: although it is the same."""
    results = [f"{comparison.result} against {comparison.reference}: {comparison.line}"]
    if comparison.shift:
        results.append(f"  shifted by {seconds(comparison.shift)}")
    ranked = sorted(comparison.variables, key=lambda variable: (-variable.ratio, variable.verdict == "same"))
    shown = [variable for variable in ranked if everything or variable.verdict != "same"]
    cut = shown if everything else shown[:MOST_LINES]
    width = max((len(variable.name) for variable in cut), default=0)
    results += [f"  {variable.name:<{width}}  {_variable_line(variable)}" for variable in cut]
    if len(shown) > len(cut):
        results.append(f"  and {len(shown) - len(cut)} more; --all lists them")
    results += [f"  looks like: {proposal.text}" for proposal in comparison.looks_like]
    return results + [f"  note: {note}" for note in comparison.notes if notes or not comparison.same]


def _variable_line(variable: Variable) -> str:
    outside = f"; outside in {variable.outside} of {variable.rows} rows" if variable.outside else ""
    return f"{variable.verdict}: {variable.line}{outside}"


def _note_default_tolerance(comparisons: Sequence[Comparison]) -> list[str]:
    """Of several pairs, whose notes are not shown where they are the same: that no tolerance is given for some."""
    if len(comparisons) == 1:
        return []
    hidden = [
        (comparison, note)
        for comparison in comparisons
        if comparison.same
        for note in comparison.notes
        if note.startswith("no tolerance")
    ]
    more = f" (as in {len(hidden) - 1} more)" if len(hidden) > 1 else ""
    return [f"note: {hidden[0][0].result}: {hidden[0][1]}{more}"] if hidden else []


def _note_unused_patterns(comparisons: Sequence[Comparison], tolerances: Path | None) -> list[str]:
    """Patterns of a tolerance file that match in no reference.

    Of the file that was asked for, each; one that lies beside references serves those too that are not compared, so
    that there a note is made only where none of its patterns matches.
    """
    by_file: dict[Path, list[set[str]]] = {}
    for comparison in comparisons:
        if (file := tolerances or find_tolerance_file(Path(comparison.reference))) is not None and comparison.variables:
            by_file.setdefault(file, []).append(set(comparison.unused))
    result = []
    for file, unused in by_file.items():
        own = [pattern for pattern, _ in tolerances_of(file, file, ()).rules if pattern != "*"]
        nowhere = [pattern for pattern in own if all(pattern in entry for entry in unused)]
        if nowhere and (tolerances is not None or nowhere == own):
            result.append(f"note: {file}: matches no column: {', '.join(map(repr, nowhere))}")
    return result


def _note_unreferenced_files(comparisons: Sequence[Comparison], asked: Sequence[Path]) -> list[str]:
    """That files of a folder of results have no reference."""
    compared = {Path(comparison.result) for comparison in comparisons}
    results = []
    for folder, reference in zip(asked[::2], asked[1::2], strict=False):
        if folder.is_dir() and reference.is_dir():
            more = [path for path in csv_files(folder) if path not in compared]
            named = ", ".join(str(path.relative_to(folder)) for path in more[:3]) + (", ..." if len(more) > 3 else "")
            results += [f"note: {folder}: {len(more)} CSV files have no reference: {named}"] if more else []
    return results


def _sum(comparisons: Sequence[Comparison]) -> list[str]:
    if len(comparisons) == 1:
        return []
    counts = [
        (sum(comparison.verdict == kind for comparison in comparisons), kind)
        for kind in ("same", "different", "unusable")
    ]
    counted = ", ".join(f"{number} {kind}" for number, kind in counts if number)
    partly = sum(
        comparison.coverage is not None and comparison.same and comparison.coverage.share < 1
        for comparison in comparisons
    )
    counted += f"; in {partly} of them not all rows are compared" if partly else ""
    return [f"{len(comparisons)} comparisons: {counted}"]
