"""feedsim schema and convert: what files must look like, and traces from files of other kinds."""

from __future__ import annotations

import json
import sys
from argparse import Namespace
from pathlib import Path

from feedsim.cli.options import Command, Option
from feedsim.errors import InputError


def schema(options: Namespace) -> None:
    """feedsim schema."""
    from feedsim.scenario.schema import json_schema

    json.dump(json_schema(options.kind), sys.stdout, indent=2)
    print()


def convert(options: Namespace) -> None:
    """feedsim convert."""
    from feedsim.trace import convert_mat

    columns = []
    for text in options.column:
        variable, equals, rest = text.partition("=")
        name, colon, unit = rest.rpartition(":")
        if not (equals and colon and variable and name and unit):
            raise InputError(f"--column {text}: VARIABLE=NAME:UNIT is needed, e.g. qg=Z.x_s:m")
        columns.append((variable, name, unit))
    convert_mat(options.file, columns, options.out)
    print(f"{options.out}: {len(columns)} columns from {options.file}")


KINDS = ("scenario", "machine", "structure", "columns", "tolerances", "study")
SCHEMA = Command(
    "schema",
    "print the JSON Schema of scenario, machine, structure, mapping, tolerance or study files, for editors",
    schema,
    [Option("kind", "", "", nargs="?", choices=KINDS, default="scenario")],
)
CONVERT = Command(
    "convert",
    "turn variables of a MAT file into a CSV trace",
    convert,
    (
        Option("file", "FILE.mat", "", type=Path),
        Option("--column", "VARIABLE=NAME:UNIT", "one column; the first must be time", many=True, required=True),
        Option("--out", "FILE.csv", "", type=Path, required=True),
    ),
    description="Turn variables of a MAT file into a CSV trace with units in its header, e.g. the recorded position "
    "reference of an axis: feedsim convert record.mat --column t=time:s --column qg=Z.x_s:m --out reference.csv",
)
