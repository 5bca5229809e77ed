"""``feedsim page``: a scenario's machine as one page that computes, with knobs."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from feedsim.cli.options import FMUS, Command, Option, names, settings
from feedsim.cli.terminal import call, finish

TEXT = """Write one file of HTML that holds the scenario's machine: the compiled unit as WebAssembly, its modes, drives
and frictions, and knobs. It opens from disk, in a mail, on a phone; contour, stop, torque and frequency response follow
while a knob turns. What it shows are the numbers of feedsim run (docs/page.md)."""
EXAMPLES = """examples:
  feedsim example xz_circle
  feedsim page xz_circle.yaml --out machine.html
  feedsim page xz_circle.yaml --knobs "motions.*,Z.drive.*,friction.F_?" --out z.html
"""


def page(options: Namespace) -> None:
    """feedsim page."""
    from feedsim.jobs.write_page import write_page

    made = call(write_page, options, " cycles", shortened=True, knobs=options.knobs or ())
    finish(False, made.findings, f"{options.out}: {made.answers[0]}")


COMMAND = Command(
    "page",
    "write a scenario's machine as one page that computes, with knobs",
    page,
    (
        Option("scenario", "SCENARIO", "scenario file", type=Path),
        Option("--out", "MACHINE.html", "page to write", type=Path, required=True),
        Option("--knobs", "KEYS", "what can be turned, keys of the scenario or their ends, with * and ?, separated by "
               "commas (default: the usual ones of the axes that move, and the motions)", type=names),
        FMUS,
        settings(),
    ),
    needs=("run",),
    description=TEXT,
    epilog=EXAMPLES,
    job="write_page",
)  # fmt: skip
