"""feedsim schema and convert: what files must look like, and traces from files of other kinds."""

from __future__ import annotations

import json
import sys
from argparse import Namespace
from pathlib import Path

from feedsim.cli.options import Command, Option
from feedsim.errors import InputError
from feedsim.outputs import check_file, unchanged
from feedsim.owned import TemporaryFolder


def schema(options: Namespace) -> None:
    """feedsim schema."""
    from feedsim.scenario.schema import json_schema

    json.dump(json_schema(options.kind), sys.stdout, indent=2)
    print()


def convert(options: Namespace) -> None:
    """feedsim convert."""
    from feedsim import trace

    columns = []
    for text in options.column:
        variable, equals, rest = text.partition("=")
        name, colon, unit = rest.rpartition(":")
        if not (equals and colon and variable and name and unit):
            raise InputError(f"--column {text}: VARIABLE=NAME:UNIT is needed, e.g. qg=Z.x_s:m")
        columns.append((variable, name, unit))
    check_file(options.out, [options.file], ours=lambda path: True)  # an input is refused before it is read
    with TemporaryFolder() as folder:
        written = trace.convert(options.file, columns, folder / "converted.csv")
        content = (folder / "converted.csv").read_bytes()
    check_file(options.out, [options.file], ours=unchanged(content), what="table")
    with trace.written_whole(options.out) as file:
        file.write(content)
    print(f"{options.out}: {len(written.columns) + 1} columns from {options.file}")


FILE_KINDS = ("scenario", "machine", "structure", "columns", "tolerances", "study")
SCHEMA = Command(
    "schema",
    "print the JSON Schema of scenario, machine, structure, mapping, tolerance or study files, for editors",
    schema,
    [Option("kind", "", "", nargs="?", choices=FILE_KINDS, default="scenario")],
    needs=(),
)
CONVERT = Command(
    "convert",
    "turn a MAT file or a control's capture into a CSV trace",
    convert,
    (
        Option("file", "FILE", "MAT, CSV, or a capture of a SINUMERIK (.json)", type=Path),
        Option(
            "--column", "VARIABLE=NAME:UNIT", "one column; the first must be time; none: all of a capture", many=True
        ),
        Option("--out", "FILE.csv", "", type=Path, required=True),
    ),
    needs=(),
    description="Turn a recording into a CSV trace with units in its header: all signals of a control's capture, or "
    "variables of a MAT file, e.g. the recorded position reference of an axis: "
    "feedsim convert record.mat --column t=time:s --column qg=Z.x_s:m --out reference.csv",
)
