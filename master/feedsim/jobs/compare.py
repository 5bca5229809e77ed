"""A result against a reference; it needs none of what runs need."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from feedsim.compare.compare import compare as compared
from feedsim.compare.files import compare_files, tolerances_of
from feedsim.compare.options import Options
from feedsim.compare.tolerance import Tolerances
from feedsim.compare.verdict import Comparison
from feedsim.trace import Trace, read_csv

if TYPE_CHECKING:
    from feedsim.cosim import Run

File = str | Path


def compare(
    result: File | Trace | Run,
    reference: File | Trace | Run,
    tol: str | Sequence[str] | Tolerances = (),
    options: Options | None = None,
) -> Comparison:
    """A result against a reference, within tolerances such as ``["1e-6", "*.x_a=2 nm"]``; files, traces or runs.

    >>> import feedsim as fs
    >>> result = fs.run("z_positioning.yaml")
    >>> fs.compare(result, result).verdict
    'same'
    """
    texts = [tol] if isinstance(tol, str) else tol
    allowed = texts if isinstance(texts, Tolerances) else Tolerances.parse(texts)
    if isinstance(result, str | Path) and isinstance(reference, str | Path):
        beside = allowed if isinstance(texts, Tolerances) else tolerances_of(Path(reference), None, texts)
        return compare_files(Path(result), Path(reference), beside, options)
    return compared(_trace(result), _trace(reference), allowed, options)


def _trace(given: File | Trace | Run) -> Trace:
    if isinstance(given, Trace):
        return given
    if not isinstance(given, str | Path):
        return given.trace
    return read_csv(Path(given))
