"""feedsim compare: results against references, for people and for CI."""

from __future__ import annotations

import sys
import traceback
from argparse import Namespace
from pathlib import Path

from feedsim.cli.options import Command, Group, Option, arguments
from feedsim.cli.terminal import visible

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


def compare(options: Namespace) -> int:
    """feedsim compare; the exit code. Whatever goes wrong is 2: 1 says that results differ."""
    from feedsim.errors import FeedsimError
    from feedsim.jobs.compare import compare

    try:
        result = compare(*options.files, **arguments(compare, options))
        lines = [] if options.quiet else result.listed(everything=options.all)
    except FeedsimError as error:
        print(*(visible(line) for line in f"feedsim: {error}".split("\n")), sep="\n", file=sys.stderr)
        return 2
    except Exception:  # a fault of our own must not look like a difference
        traceback.print_exc()
        return 2
    try:
        for line in lines:
            print(visible(line))
        if sys.stdout is not None:
            sys.stdout.flush()
    except OSError:
        sys.stdout = None  # who read has gone, or the disk is full; the code still counts
    for pair in result.comparisons:
        if pair.verdict == "unusable" and options.quiet:
            print(visible(f"feedsim: {pair.result}: {pair.line}"), file=sys.stderr)
    return result.exit_code


def _side(side: str, whose: str) -> tuple[Option, ...]:
    """What can be said of the columns of either side."""
    return (
        Option(f"--{whose}unit", "PATTERN=UNIT", f"unit of the {side}'s columns whose header gives none", many=True),
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
                   "least share of the result's rows that must be compared, such as '90 %%' (default: any; reported)",
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
    job="compare",
)  # fmt: skip
