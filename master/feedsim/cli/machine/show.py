"""``feedsim machine show``: pictures of a machine's structure and of its modes."""

from __future__ import annotations

import math
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from feedsim.cli.machine.figures import QUIET, SOURCE, STEP, figures
from feedsim.cli.options import Command, Option
from feedsim.cli.terminal import finish, results_in
from feedsim.errors import InputError

if TYPE_CHECKING:
    from feedsim.structure.modes import Modes

# A frequency that is asked for belongs to the nearest mode if that is not farther away than this share.
NEAR = 0.1


def show(options: Namespace) -> None:
    """feedsim machine show: compute, draw, write."""
    from feedsim.report import machine as report
    from feedsim.scenario.described import load_described

    scale = _scale(options.scale)
    if options.animate and not options.mode:
        raise InputError("--animate: which mode? Give --mode too, e.g. --mode 21Hz")
    described = load_described(options.machine)
    if described.structure is None:
        raise InputError(
            f"{options.machine}: has a table of modes alone, and no table says where things are; a picture needs a "
            "structure file (key structure, docs/structure.md)"
        )
    with results_in(options.out, report.check_writable, [file for _, file in described.files]):
        found = figures(options, described, quiet=options.quiet)
        chosen = list(dict.fromkeys(_mode(text, found.modes) for text in options.mode))
        report.write(
            described.structure, found, described.files, options.out, modes=chosen, scale=scale, animate=options.animate
        )
    shown = [f"mode {k}: {found.modes.frequency[k]:.2f} Hz, {found.moving[k]}" for k in chosen]
    finish(options.quiet, (), f"{found.title} -> {options.out / 'report.html'}", *shown)


def _mode(text: str, modes: Modes) -> int:
    """Number of the mode that --mode means."""
    import numpy as np

    from feedsim import units

    count = len(modes.frequency)
    if text.isdecimal():
        if int(text) >= count:
            raise InputError(
                f"--mode {text}: there are {count} modes, 0 to {count - 1}, up to {modes.frequency.max():.1f} Hz; "
                "--cutoff gives more"
            )
        return int(text)
    try:
        f = units.parse(text, "Hz", "21 Hz")
    except InputError as error:
        raise InputError(f"--mode {text}: the number of a mode or a frequency is needed; {error}") from None
    if not (math.isfinite(f) and f > 0):
        raise InputError(f"--mode {text}: a frequency above 0 Hz is needed; rigid modes are chosen by their number")
    k = int(np.argmin(np.abs(modes.frequency - f)))
    if abs(modes.frequency[k] - f) > NEAR * f:
        listed = ", ".join(f"{value:.4g}" for value in modes.frequency[modes.frequency > 0][:8])
        raise InputError(
            f"--mode {text}: no mode near; the nearest is {modes.frequency[k]:.4g} Hz (the first elastic ones: "
            f"{listed or 'none'} Hz)"
        )
    return k


def _scale(text: str) -> float:
    if text == "auto":
        return 1.0
    try:
        scale = float(text)
    except ValueError:
        scale = math.nan
    if not (math.isfinite(scale) and 0 < scale <= 100):
        raise InputError(f"--scale {text}: auto, or a factor above 0 and up to 100, is needed")
    return scale


SHOW = Command(
    "show",
    "draw the machine's structure and its modes; write pictures and report.html",
    show,
    (
        *SOURCE,
        STEP,
        Option("--mode", "MODE",
               "mode to draw: its number, or a frequency such as 21Hz for the nearest one; may be given several times",
               many=True),
        Option("--animate", "", "write an animated GIF of every --mode, too"),
        Option("--scale", "FACTOR",
               "deflections are drawn this many times as large as usual, e.g. 2 (default: auto, a tenth of the "
               "machine)", default="auto"),
        Option("--out", "DIR", "where the pictures go", type=Path, required=True),
        QUIET,
    ),
    "Draw the structure of a machine and its first modes, or chosen ones: PNG and SVG in DIR/figures, with "
    "report.html around them. MACHINE may be a scenario too.",
    needs=("figures",),
)  # fmt: skip
