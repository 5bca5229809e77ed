"""``feedsim pack``: a scenario, or a machine, as one unit for other people's simulators."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from feedsim.cli.options import FMUS, TERMINALS, Command, Option, settings
from feedsim.cli.terminal import call, finish

TEXT = """Pack structure, drives and friction of all axes, coupled at the control cycle, into one FMI 2.0 co-simulation
unit; no compiler is needed. Of a scenario the motion is inside, so that the unit needs no inputs; of a machine, and
with --inputs, setpoints are inputs. Any importer gets at steps of any length what feedsim run gets
(docs/importing.md)."""
EXAMPLES = """examples:
  feedsim example xz_circle z_positioning
  feedsim pack xz_circle.yaml --out machine.fmu
  feedsim pack machines/test_centre --out machine.fmu
  feedsim pack z_positioning.yaml --set "machine.axes.Z.friction.W=0 rad" --out lugre.fmu
"""


def pack(options: Namespace) -> None:
    """feedsim pack."""
    from feedsim.jobs.pack import pack

    made = call(pack, options)
    finish(False, made.findings, f"{options.out}: {made.answers[0]}")


COMMAND = Command(
    "pack",
    "pack a scenario, or a machine, as one unit for any simulator",
    pack,
    (
        Option("subject", "SCENARIO-or-MACHINE", "scenario file, machine file, or a folder with a machine.yaml",
               type=Path),
        Option("--out", "MACHINE.fmu", "archive to write", type=Path, required=True),
        Option("--inputs", "", "leave the scenario's motion out: setpoints are inputs"),
        TERMINALS,
        Option("--base", "MACHINE.fmu", "archive whose binaries are taken (default: machine.fmu in the folder of the "
               "archives)", type=Path),
        FMUS,
        settings(),
    ),
    description=TEXT,
    epilog=EXAMPLES,
    job="pack",
)  # fmt: skip
