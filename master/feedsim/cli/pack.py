"""``feedsim pack``: a scenario, or a machine, as one unit for other people's simulators."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from feedsim.cli.options import FMUS, Command, Option, settings
from feedsim.cli.terminal import announce_archive, warn
from feedsim.errors import InputError, OutputError
from feedsim.outputs import archive_with, check_file
from feedsim.owned import TemporaryFolder

PACKED = archive_with("modelDescription.xml", b'generationTool="feedsim')
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
    from feedsim import cosim, nc, scenario
    from feedsim.cosim.one_unit import UNIT, pack_whole
    from feedsim.structure import checked_modes
    from feedsim.trace.files import written_whole

    if not options.out.absolute().parent.is_dir():
        raise OutputError(f"{options.out} cannot be written: no such folder: {options.out.parent}")
    subject = scenario.load_subject(options.subject, options.overrides)
    inputs = [options.subject, *(file for _, file in subject.files), *filter(None, [options.base])]
    check_file(options.out, inputs, ours=PACKED, what="unit")
    plan, machine = subject.scenario, subject.machine
    announce_archive(options.base, "the packed unit's trial")
    fmus = options.fmus or cosim.fmus_directory()
    base = options.base or fmus / f"{UNIT}.fmu"
    program = nc.plan(plan) if plan is not None and not options.inputs else None
    if plan is not None and plan.loads:
        raise InputError.of(
            f"{plan.file}: the unit holds no loads over time",
            [
                f"{plan.at('loads', i)}: the load {load.words} does not go into the unit, which holds none over time: "
                f"--set loads=[] packs it without, and its importer drives {load.input}"
                for i, load in enumerate(plan.loads)
            ],
        )
    if plan is not None and program is not None:
        warn(cosim.check(plan, program, fmus=fmus))  # what a run would refuse should not be packed
    else:
        checked_modes(machine)
    with TemporaryFolder() as folder:
        # Packed apart: the file takes its name when it is whole.
        packed = pack_whole(
            base, folder / "machine.fmu", machine, coupling=plan.coupling if plan else None, program=program,
            name=machine.name if plan is None or program is None else f"{machine.name}; motion: {plan.name}",
            note=machine.note if program is None else " ".join(subject.notes),
            model=machine.name if plan is None or program is None else plan.name,
        )  # fmt: skip
        with written_whole(options.out) as file:
            file.write(packed.path.read_bytes())
    motion = f"motion of {program.duration:.4g} s inside" if program else "setpoints are inputs"
    platforms = ", ".join(packed.platforms) or "no binaries"
    print(
        f"{options.out}: axes {', '.join(machine.axes)}; {motion}; control cycle "
        f"{machine.cycles.T_c * 1e6:.6g} us; {packed.size / 1024:.0f} KiB, {platforms}, guid {packed.guid}"
    )


COMMAND = Command(
    "pack",
    "pack a scenario, or a machine, as one unit for any simulator",
    pack,
    (
        Option("subject", "SCENARIO-or-MACHINE", "scenario file, machine file, or a folder with a machine.yaml",
               type=Path),
        Option("--out", "MACHINE.fmu", "archive to write", type=Path, required=True),
        Option("--inputs", "", "leave the scenario's motion out: setpoints are inputs"),
        Option("--base", "MACHINE.fmu", "archive whose binaries are taken (default: machine.fmu in the folder of the "
               "archives)", type=Path),
        FMUS,
        settings(),
    ),
    description=TEXT,
    epilog=EXAMPLES,
)  # fmt: skip
