"""What the terminal shows of comparisons, line by line. Start reading at lines_of()."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from feedsim.compare.files import beside, tolerances_of
from feedsim.compare.verdict import Comparison, Variable, seconds

if TYPE_CHECKING:
    pass

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
    found = [line for pair in comparisons for line in _lines(pair, everything, full)]
    return [
        *found,
        *_default(comparisons),
        *_unused(comparisons, tolerances),
        *_unreferenced(comparisons, asked),
        *_sum(comparisons),
    ]


def _lines(comparison: Comparison, everything: bool, notes: bool) -> list[str]:
    """What the terminal shows of a pair; notes: although it is the same."""
    found = [f"{comparison.result} against {comparison.reference}: {comparison.line}"]
    if comparison.shift:
        found.append(f"  shifted by {seconds(comparison.shift)}")
    ranked = sorted(comparison.variables, key=lambda each: (-each.ratio, each.verdict == "same"))
    shown = [each for each in ranked if everything or each.verdict != "same"]
    cut = shown if everything else shown[:MOST_LINES]
    width = max((len(each.name) for each in cut), default=0)
    found += [f"  {each.name:<{width}}  {_variable_line(each)}" for each in cut]
    if len(shown) > len(cut):
        found.append(f"  and {len(shown) - len(cut)} more; --all lists them")
    found += [f"  looks like: {each.text}" for each in comparison.looks_like]
    return found + [f"  note: {note}" for note in comparison.notes if notes or not comparison.same]


def _variable_line(variable: Variable) -> str:
    outside = f"; outside in {variable.outside} of {variable.rows} rows" if variable.outside else ""
    return f"{variable.verdict}: {variable.line}{outside}"


def _default(comparisons: Sequence[Comparison]) -> list[str]:
    """Of several pairs, whose notes are not shown where they are the same: that no tolerance is given for some."""
    if len(comparisons) == 1:
        return []
    hidden = [
        (each, note) for each in comparisons if each.same for note in each.notes if note.startswith("no tolerance")
    ]
    more = f" (as in {len(hidden) - 1} more)" if len(hidden) > 1 else ""
    return [f"note: {hidden[0][0].result}: {hidden[0][1]}{more}"] if hidden else []


def _unused(comparisons: Sequence[Comparison], tolerances: Path | None) -> list[str]:
    """Patterns of a tolerance file that match in no reference.

    Of the file that was asked for, each; one that lies beside references serves those too that are not compared, so
    that there a note is made only where none of its patterns matches.
    """
    by_file: dict[Path, list[set[str]]] = {}
    for each in comparisons:
        if (file := tolerances or beside(Path(each.reference))) is not None and each.variables:
            by_file.setdefault(file, []).append(set(each.unused))
    found = []
    for file, unused in by_file.items():
        own = [pattern for pattern, _ in tolerances_of(file, file, ()).rules if pattern != "*"]
        nowhere = [pattern for pattern in own if all(pattern in each for each in unused)]
        if nowhere and (tolerances is not None or nowhere == own):
            found.append(f"note: {file}: matches no column: {', '.join(map(repr, nowhere))}")
    return found


def _unreferenced(comparisons: Sequence[Comparison], asked: Sequence[Path]) -> list[str]:
    """That files of a folder of results have no reference."""
    compared = {Path(each.result) for each in comparisons}
    found = []
    for folder, reference in zip(asked[::2], asked[1::2], strict=False):
        if folder.is_dir() and reference.is_dir():
            more = sorted({path for path in folder.rglob("*.csv") if path.is_file()} - compared)
            named = ", ".join(str(path.relative_to(folder)) for path in more[:3]) + (", ..." if len(more) > 3 else "")
            found += [f"note: {folder}: {len(more)} CSV files have no reference: {named}"] if more else []
    return found


def _sum(comparisons: Sequence[Comparison]) -> list[str]:
    if len(comparisons) == 1:
        return []
    counts = [(sum(each.verdict == kind for each in comparisons), kind) for kind in ("same", "different", "unusable")]
    counted = ", ".join(f"{number} {kind}" for number, kind in counts if number)
    partly = sum(each.coverage is not None and each.same and each.coverage.share < 1 for each in comparisons)
    counted += f"; in {partly} of them not all rows are compared" if partly else ""
    return [f"{len(comparisons)} comparisons: {counted}"]
