"""``feedsim machine show``: pictures of a machine's structure and of its modes."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from feedsim.cli.machine.figures import POSITION, QUIET_OPTION, SOURCE, STEP_OPTION
from feedsim.cli.options import Command, Option, pairs
from feedsim.cli.terminal import call, finish


def show(options: Namespace) -> None:
    """feedsim machine show: compute, draw, write."""
    from feedsim.jobs.machine import machine_show

    result = call(machine_show, options, at=pairs("at", options.at, POSITION))
    info = result.info
    drawn = [f"mode {k}: {info.modes.frequency[k]:.2f} Hz, {info.moving[k]}" for k in result.modes]
    finish(options.quiet, result.findings, f"{info.title} -> {options.out / 'report.html'}", *drawn)


SHOW = Command(
    "show",
    "draw the machine's structure and its modes; write pictures and report.html",
    show,
    (
        *SOURCE,
        STEP_OPTION,
        Option("--mode", "MODE",
               "mode to draw: its number, or a frequency such as 21Hz for the nearest one; may be given several times",
               many=True),
        Option("--animate", "", "write an animated GIF of every --mode, too"),
        Option("--scale", "FACTOR",
               "deflections are drawn this many times as large as usual, e.g. 2 (default: auto, a tenth of the "
               "machine)", default="auto"),
        Option("--out", "DIR", "where the pictures go", type=Path, required=True),
        QUIET_OPTION,
    ),
    "Draw the structure of a machine and its first modes, or chosen ones: PNG and SVG in DIR/figures, with "
    "report.html around them. MACHINE may be a scenario too.",
    needs=("figures",),
    job="machine_show",
)  # fmt: skip
