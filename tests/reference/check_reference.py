"""Run every archive over its reference cases, and both scenarios, wired and as one unit, over theirs; and compare
(`make check-reference`).

The verdict is that of `feedsim compare`, with the tolerances that stand, each with its reason, beside the references.

Exit code: 0 all the same, 1 something differs, 2 an archive is missing or cannot be used.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import system
from reference_files import HELD, HERE, Case, Table, all_cases, read_case
from run_case import Unusable, simulate

from feedsim import scenario
from feedsim.comparison import Comparison, bounds_of, compare_series, tolerances_of, unusable
from feedsim.files.trace import Series
from feedsim.foundation.errors import FeedsimError
from feedsim.report.compare import write as write_comparison
from feedsim.simulation import cosim, nc
from feedsim.simulation.cosim.whole import pack_whole

ARCHIVES = HERE.parents[1] / "fmus"


def _series(table: Table) -> Series:
    return Series(table["time"], {name: values for name, values in table.items() if name != "time"})


def _compared(name: str, result: Table, reference: Table, path: Path) -> Comparison:
    """`path` is the reference's file: its tolerances are beside it."""
    return compare_series(
        _series(result),
        _series(reference),
        tolerances_of(path, None, ()),
        between=bounds_of(path),
        names=(name, str(path)),
    )


def check_case(archive: Path, case: Case, root: Path = HERE) -> Comparison:
    """One case of a unit; an archive that cannot be used is told in what is returned."""
    folder = root / case.unit / (HELD if case.held else "")
    path = folder / f"{case.name}_ref.csv"
    name = "/".join(part for part in (case.unit, HELD if case.held else "", case.name) if part)
    try:
        return _compared(name, simulate(archive, case), case.reference, path)
    except Unusable as error:
        return unusable(name, str(path), str(error))


def check_system(archives: Path, wanted: system.Scenario, root: Path = HERE, *overrides: str) -> Comparison:
    """One scenario as `feedsim run` runs it, at every control cycle."""
    name, path = f"{system.FOLDER}/{wanted.name}", system.path_of(wanted, root)
    try:
        loaded = scenario.load(system.SCENARIOS / f"{wanted.name}.yaml", ["recording.interval=125 us", *overrides])
        trace = cosim.run(loaded, fmus=archives).trace
    except FeedsimError as error:
        return unusable(name, str(path), str(error))
    reference = system.read(wanted, root)
    # the program's last position cycle is the reference's too, the run may go on to the end of its dwell
    count = int(np.searchsorted(trace.time, reference["time"][-1] + 1e-9))
    result = {"time": trace.time[:count]} | {n: trace[n][:count] for n in wanted.variables}
    return _compared(name, result, reference, path)


def check_one_unit(archives: Path, wanted: system.Scenario, root: Path = HERE) -> Comparison:
    """One scenario packed as one unit with its motion inside, run by an importer at the reference's own interval."""
    name, path = f"machine/{wanted.name}", system.path_of(wanted, root)
    try:
        loaded = scenario.load(system.SCENARIOS / f"{wanted.name}.yaml")
        reference = system.read(wanted, root)
        case = Case("machine", wanted.name, float(reference["time"][-1]), wanted.every, 0.0, {}, reference=reference)
        with tempfile.TemporaryDirectory() as folder:
            packed = Path(folder) / "machine.fmu"
            base = archives / "machine.fmu"
            pack_whole(base, packed, loaded.machine, coupling=loaded.coupling, program=nc.plan(loaded), trial=False)
            return _compared(name, simulate(packed, case), reference, path)
    except (FeedsimError, Unusable) as error:
        return unusable(name, str(path), str(error))


def check(archives: Path = ARCHIVES, root: Path = HERE) -> Iterator[Comparison]:
    """All units over all their cases, then the scenarios, wired and as one unit, as far as `root` has references."""
    for unit, name, held in all_cases(root):
        yield check_case(archives / f"{unit}.fmu", read_case(unit, name, root, held=held), root)
    for wanted in system.SYSTEMS:
        if system.path_of(wanted, root).is_file():
            yield check_system(archives, wanted, root)
            yield check_one_unit(archives, wanted, root)


def main(arguments: list[str] | None = None) -> int:
    """Command line; returns the exit code."""
    parser = argparse.ArgumentParser(description="Compare the units and scenarios with the pinned reference results.")
    parser.add_argument("--fmus", type=Path, default=ARCHIVES, metavar="DIR", help="where the archives are")
    parser.add_argument("--cases", type=Path, default=HERE, metavar="DIR", help="where the reference results are")
    parser.add_argument("--junit", type=Path, metavar="FILE", help="write the verdicts as JUnit XML too")
    parser.add_argument("--report", type=Path, metavar="FILE", help="write them as HTML, with what is outside drawn")
    parser.add_argument("--verbose", action="store_true", help="every variable, not the worst alone")
    options = parser.parse_args(arguments)
    found: list[Comparison] = []
    for comparison in check(options.fmus, options.cases):
        found.append(comparison)
        print(f"{comparison.result:32s}{comparison.line}", file=sys.stderr if comparison.exit_code == 2 else sys.stdout)
        for variable in comparison.variables if options.verbose or comparison.exit_code == 1 else ():
            print(f"    {variable.name:12s}{variable.verdict:12s}{variable.line}")
    if not found:
        print(f"check_reference: no reference results in {options.cases}", file=sys.stderr)
        return 2
    try:
        write_comparison(found, html=options.report, xml=options.junit)
    except FeedsimError as error:
        print(f"check_reference: {error}", file=sys.stderr)
        return 2
    code = max(comparison.exit_code for comparison in found)
    different = sum(not comparison.same for comparison in found)
    print(f"{len(found)} comparisons: " + ("all the same" if code == 0 else f"{different} not the same"))
    return code


if __name__ == "__main__":
    sys.exit(main())
