"""``feedsim page``: a scenario's machine as one page that computes, with knobs."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from feedsim.cli.options import FMUS, Command, Option, names, settings
from feedsim.cli.terminal import warn
from feedsim.errors import OutputError
from feedsim.outputs import begins_with, check_file

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
    from feedsim import cosim, nc, scenario
    from feedsim import page as room
    from feedsim.analysis import check
    from feedsim.page.content import content
    from feedsim.page.html import MARK
    from feedsim.report.provenance import input_paths

    if not options.out.absolute().parent.is_dir():
        raise OutputError(f"{options.out} cannot be written: no such folder: {options.out.parent}")
    asked = scenario.load(options.scenario, options.overrides)
    check_file(options.out, [options.scenario, *input_paths(asked)], ours=begins_with(MARK), what="page")
    program = nc.plan(asked)
    content(asked, program, options.knobs or (), options.fmus)  # what cannot be shown should not be run
    check(asked, program)
    run = cosim.run(asked, program=program, fmus=options.fmus)
    warn(run.warnings)
    size = room.write(run, options.out, options.knobs or (), options.fmus)
    print(f"{options.out}: {size / 1000:.0f} kB; axes {', '.join(asked.machine.axes)}; open it in a browser")


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
)  # fmt: skip
