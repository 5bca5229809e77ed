"""What the terminal shows of comparisons, line by line. Start reading at lines_of()."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from feedsim.compare.files import beside, csv_files, tolerances_of
from feedsim.compare.verdict import Comparison, Variable, seconds

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
        *_default(comparisons),
        *_unused(comparisons, tolerances),
        *_unreferenced(comparisons, asked),
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


def _default(comparisons: Sequence[Comparison]) -> list[str]:
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


def _unused(comparisons: Sequence[Comparison], tolerances: Path | None) -> list[str]:
    """Patterns of a tolerance file that match in no reference.

    Of the file that was asked for, each; one that lies beside references serves those too that are not compared, so
    that there a note is made only where none of its patterns matches.
    """
    by_file: dict[Path, list[set[str]]] = {}
    for comparison in comparisons:
        if (file := tolerances or beside(Path(comparison.reference))) is not None and comparison.variables:
            by_file.setdefault(file, []).append(set(comparison.unused))
    result = []
    for file, unused in by_file.items():
        own = [pattern for pattern, _ in tolerances_of(file, file, ()).rules if pattern != "*"]
        nowhere = [pattern for pattern in own if all(pattern in entry for entry in unused)]
        if nowhere and (tolerances is not None or nowhere == own):
            result.append(f"note: {file}: matches no column: {', '.join(map(repr, nowhere))}")
    return result


def _unreferenced(comparisons: Sequence[Comparison], asked: Sequence[Path]) -> list[str]:
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
