"""feedsim schema and convert: what files must look like, and traces from files of other kinds."""

from __future__ import annotations

import json
import sys
from argparse import Namespace
from pathlib import Path

from feedsim.cli.options import Command, Option, arguments
from feedsim.cli.terminal import finish


def schema(options: Namespace) -> None:
    """feedsim schema."""
    from feedsim.jobs.schema import schema

    json.dump(schema(options.kind), sys.stdout, indent=2)
    print()


def convert(options: Namespace) -> None:
    """feedsim convert."""
    from feedsim.jobs.convert import convert

    made = convert(**arguments(convert, options))
    finish(False, made.findings, f"{options.out}: {made.answers[0]}")


FILE_KINDS = ("scenario", "machine", "structure", "columns", "tolerances", "study")
SCHEMA = Command(
    "schema",
    "print the JSON Schema of scenario, machine, structure, mapping, tolerance or study files, for editors",
    schema,
    [Option("kind", "", "", nargs="?", choices=FILE_KINDS, default="scenario")],
    needs=(),
    job="schema",
)
CONVERT = Command(
    "convert",
    "turn a record into a CSV trace",
    convert,
    (
        Option("file", "FILE", "CSV, MAT, or another record (docs/traces.md)", type=Path),
        Option("--column", "VARIABLE=NAME:UNIT", "one column; the first must be time; none: all", many=True),
        Option("--out", "FILE.csv", "", type=Path, required=True),
    ),
    needs=(),
    job="convert",
    description="Turn a recording into a CSV trace with units in its header: all of its signals, or some, "
    "e.g. the recorded position reference of an axis: "
    "feedsim convert record.mat --column t=time:s --column qg=Z.x_s:m --out reference.csv",
)
