"""Options that several commands have in common."""

from __future__ import annotations

from argparse import ArgumentParser
from pathlib import Path


def add_fmus(command: ArgumentParser) -> None:
    """--fmus."""
    command.add_argument(
        "--fmus", type=Path, metavar="DIR", help="folder of the archives (default: $FEEDSIM_FMUS, else fmus/)"
    )


def add_overrides(command: ArgumentParser, example: str) -> None:
    """--set, with an example of KEY=VALUE."""
    command.add_argument(
        "--set",
        action="append",
        default=[],
        dest="overrides",
        metavar="KEY=VALUE",
        help=f"override one entry, e.g. {example}; may be given several times",
    )
