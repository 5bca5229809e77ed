"""``feedsim machine show``: pictures of a machine's structure and of its modes."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from feedsim.cli.machine.figures import POSITION, QUIET_OPTION, SOURCE, STEP_OPTION
from feedsim.cli.options import Command, Option, pairs
from feedsim.cli.terminal import finish, watching


def show(options: Namespace) -> None:
    """feedsim machine show: compute, draw, write."""
    from feedsim.jobs.machine import machine_show

    with watching(options.quiet) as watch:
        result = machine_show(
            options.machine,
            options.out,
            at=pairs("at", options.at, POSITION),
            cutoff=options.cutoff,
            static_correction=options.static_correction,
            step=options.step,
            mode=options.mode,
            animate=options.animate,
            scale=options.scale,
            watch=watch,
        )
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
