"""Files that are compared: pairs of them, or two folders with files of the same names."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from feedsim.compare.between import BOUNDS, bounds_of
from feedsim.compare.compare import compare
from feedsim.compare.options import Options
from feedsim.compare.tolerance import Tolerances
from feedsim.compare.verdict import Comparison
from feedsim.errors import InputError
from feedsim.files.tolerances import load_tolerances
from feedsim.trace import Series, read_series

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


def beside(reference: Path) -> Path | None:
    """Tolerance file of a reference: case.tolerances.yaml for case.csv or case_ref.csv, else tolerances.yaml beside."""
    stems = (reference.stem, reference.name.removesuffix(REFERENCE_ENDING))
    candidates = [reference.with_name(f"{stem}.{TOLERANCES}") for stem in stems]
    return next((path for path in (*candidates, reference.with_name(TOLERANCES)) if path.is_file()), None)


def tolerances_of(reference: Path, file: Path | None, texts: Sequence[str]) -> Tolerances:
    """Of a tolerance file (default: the one beside the reference), then of texts as behind --tol. InputError.

    They may serve several references: a pattern that matches nothing is reported in Comparison.unused.
    """
    path = file or beside(reference)
    written = Tolerances.of_file(load_tolerances(path)) if path is not None else Tolerances()
    return written + Tolerances.parse(texts).for_several()


def _counterpart(folder: Path, name: Path) -> Path:
    path = folder / name
    if not path.is_file() and name.name.endswith(REFERENCE_ENDING):
        shorter = path.with_name(name.name.removesuffix(REFERENCE_ENDING) + ".csv")
        return shorter if shorter.is_file() else path
    return path
