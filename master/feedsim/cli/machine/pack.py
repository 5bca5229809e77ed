"""``feedsim machine pack``: a machine at a pose, or over a grid of poses, in a plant archive."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from feedsim.cli.machine.figures import AT, POSITION
from feedsim.cli.options import TERMINALS, Command, Option, pairs
from feedsim.cli.terminal import call, finish


def pack(options: Namespace) -> None:
    """feedsim machine pack."""
    from feedsim.jobs.machine_pack import POSITIONS_EXAMPLE, machine_pack

    poses = pairs("poses", options.poses, f"{POSITIONS_EXAMPLE} is the form")
    made = call(machine_pack, options, " poses", at=pairs("at", options.at, POSITION), poses=poses)
    finish(False, made.findings, f"{options.out}: {made.answers[0]}")


PACK = Command(
    "pack",
    "pack the machine into a plant archive; needs no compiler",
    pack,
    (
        Option("machine", "MACHINE", "machine file, or a folder with a machine.yaml", type=Path),
        AT,
        Option("--poses", "AXIS=CELL",
               "let the plant follow the pose: modes of a grid of poses, by the size of its cells, over the whole "
               "travel (Z=20mm) or a part of it (Z=0mm..400mm/20mm), along one axis or several "
               "(docs/position-dependence.md)", nargs="+", default=[]),
        Option("--out", "PLANT.fmu", "archive to write", type=Path, required=True),
        Option("--name", "NAME", "name of the machine in the archive (default: the machine's)"),
        Option("--note", "NOTE", "a remark that goes with the name (default: the machine's)"),
        TERMINALS,
        Option("--base", "PLANT.fmu",
               "archive whose binaries are taken (default: plant.fmu in $FEEDSIM_FMUS, else in fmus/)", type=Path),
    ),
    "Pack the machine's axes, pose and table of modes into a plant archive. The binaries are those of the base "
    "archive, for all its platforms.",
    job="machine_pack",
)  # fmt: skip
