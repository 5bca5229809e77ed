"""A scenario, or a machine, as one unit for other people's simulators."""

from __future__ import annotations

from pathlib import Path

from feedsim import cosim, judge, nc, scenario
from feedsim.arguments import Changes, settings
from feedsim.cosim.one_unit import UNIT, pack_whole
from feedsim.errors import InputError
from feedsim.jobs.made import Kind, Made
from feedsim.jobs.parameters import File
from feedsim.jobs.watch import NO_WATCH, Watch, announce_archive
from feedsim.outputs import archive_with
from feedsim.owned import TemporaryFolder
from feedsim.scenario import Scenario
from feedsim.structure import checked_modes

PACKED = archive_with("modelDescription.xml", b'generationTool="feedsim')
KIND = Kind("pack", "unit", PACKED)


def pack(
    subject: File,
    out: File | None = None,
    *,
    inputs: bool = False,
    terminals: bool = True,
    base: File | None = None,
    fmus: File | None = None,
    set: Changes = None,
    force: bool = False,
    watch: Watch = NO_WATCH,
) -> Made:
    """Pack a scenario, or a machine, as one FMI 2.0 co-simulation unit; needs no compiler.

    Args:
        subject: scenario file, machine file or machine folder. Of a scenario the motion is inside.
        out: archive to write; None: :meth:`Made.save` does it.
        inputs: leave the scenario's motion out, so that setpoints are inputs.
        terminals: with terminals and icons, which FMI Library 3 refuses in units of FMI 2.0.
        base: archive whose binaries are taken; None: machine.fmu in `fmus`.
        fmus: folder of the archives.
        set: changes of the file, as behind ``--set``.
        force: `out` may be a file that feedsim did not write.
        watch: who hears whose programs are executed.

    Raises:
        InputError: a faulty file, a machine that no run would take, loads over time.
        OutputError: `out` cannot be written.

    >>> import feedsim as fs
    >>> fs.export("z_positioning.yaml", inputs=True).kind
    'pack'
    """
    KIND.check_folder(out)
    loaded = scenario.load_subject(subject, settings(set))
    own = None if base is None else Path(base)
    read = [Path(subject), *(file for _, file in loaded.files), *([own] if own is not None else [])]
    with KIND.checked(out, read, force=force) as path:
        plan, machine = loaded.scenario, loaded.machine
        announce_archive(watch, own, "the packed unit's trial")
        archives = Path(fmus) if fmus is not None else cosim.fmus_directory()
        program = nc.plan(plan) if plan is not None and not inputs else None
        if plan is not None:
            _check_loads(plan)
        findings: tuple[str, ...] = ()
        if plan is not None and program is not None:
            findings = judge.check(plan, program, fmus=archives)  # what a run would refuse should not be packed
        else:
            checked_modes(machine)
        moving = plan if program is not None else None
        with TemporaryFolder() as folder:
            packed = pack_whole(
                own or archives / f"{UNIT}.fmu",
                folder / "machine.fmu",
                machine,
                coupling=plan.coupling if plan else None,
                program=program,
                name=machine.name if moving is None else f"{machine.name}; motion: {moving.name}",
                note=machine.note if moving is None else " ".join(loaded.notes),
                model=machine.name if moving is None else moving.name,
                terminals=terminals,
            )
            content = packed.path.read_bytes()
        motion = f"motion of {program.duration:.4g} s inside" if program else "setpoints are inputs"
        line = (
            f"axes {', '.join(machine.axes)}; {motion}; control cycle {machine.cycles.T_c * 1e6:.6g} us; "
            f"{packed.size / 1024:.0f} KiB, {', '.join(packed.platforms) or 'no binaries'}, guid {packed.guid}"
        )
        made = Made(KIND, "machine.fmu", content, [line], findings, inputs=read)
        if path is not None:
            made.save(path, force=force)
    return made


def _check_loads(plan: Scenario) -> None:
    if plan.loads:
        raise InputError.of(
            f"{plan.file}: the unit holds no loads over time",
            [
                f"{plan.at('loads', i)}: the load {load.words} does not go into the unit, which holds none over time: "
                f"--set loads=[] packs it without, and its importer drives {load.input}"
                for i, load in enumerate(plan.loads)
            ],
        )
