"""A scenario, or a machine, as one file for other programs: a unit, an SSP file, a page."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

from feedsim import scenario
from feedsim.analysis import check
from feedsim.files.fields import FileContent
from feedsim.files.source import is_ssp
from feedsim.foundation import units
from feedsim.foundation.arguments import Changes, Pairs, Value, by_name, pairs, settings, spell_argument, split_names
from feedsim.foundation.errors import Finding, InputError
from feedsim.foundation.outputs import TemporaryFolder, archive_with, begins_with, is_same_file
from feedsim.jobs.machine import positions
from feedsim.jobs.parameters import (
    NO_WATCH,
    Archives,
    File,
    Force,
    MachineChoice,
    Option,
    Positions,
    Settings,
    SubjectArgument,
    Watch,
    job,
    out_file,
)
from feedsim.jobs.result import Made, MadeKind, announce_archive
from feedsim.jobs.run import on_machine
from feedsim.report.live_page.content import content
from feedsim.report.live_page.html import MARK, page
from feedsim.report.provenance import input_paths
from feedsim.scenario import Machine, Scenario
from feedsim.scenario.load import load, load_described
from feedsim.scenario.structure_checks import load_structure
from feedsim.simulation import cosim, judge, nc, ssp
from feedsim.simulation.cosim.whole import UNIT, pack_whole
from feedsim.simulation.judge import judge_run
from feedsim.simulation.ssp import ExportedSystem
from feedsim.simulation.ssp.archive import STRUCTURE
from feedsim.structure import checked_modes
from feedsim.structure import pack as archive
from feedsim.structure.build import build
from feedsim.structure.geometry.assemble import movable
from feedsim.structure.modes import parse_modes, table_of_modes
from feedsim.structure.mounts import MOUNTS_FILE, table_of, write_mounts
from feedsim.structure.pose_change import table_mismatch
from feedsim.structure.poses import GridAxis, grid_axis, pose_grid, write_poses

# Ending of the file -> the options that it has besides those of all.
ENDINGS = {".fmu": ("inputs", "plant", "base", "terminals"), ".ssp": ("one",), ".html": ("knobs",)}
OF_PLANT = ("at", "poses", "name", "note")


@job("write a unit (.fmu), an SSP file (.ssp) or a page (.html)")
def export(
    subject: SubjectArgument,
    out: Annotated[
        File | None, out_file("FILE", "file to write; its ending, .fmu, .ssp or .html, says what it is")
    ] = None,
    *,
    machine: MachineChoice = None,
    kind: Annotated[str, Option("", "what it is, where no name says so", choices=("fmu", "ssp", "html"))] = "fmu",
    set: Settings = None,
    inputs: Annotated[
        bool, Option("", "leave the scenario's motion out: setpoints are inputs", group="unit (.fmu)")
    ] = False,
    terminals: Annotated[
        bool,
        Option(
            "",
            "with terminals and icons (default: yes; FMI Library 3 refuses units that have them)",
            group="unit (.fmu)",
        ),
    ] = True,
    plant: Annotated[bool, Option("", "the structure alone, without drives and friction", group="unit (.fmu)")] = False,
    base: Annotated[
        File | None,
        Option("UNIT.fmu", "archive whose binaries are taken (default: of the archives)", group="unit (.fmu)"),
    ] = None,
    at: Annotated[
        Mapping[str, Value] | Sequence[str] | None,
        Option(
            "AXIS=POSITION",
            "with --plant: positions of axes, X=800mm Z=100mm; other axes stay at the machine's pose",
            several=True,
            group="unit (.fmu)",
        ),
    ] = None,
    poses: Annotated[
        Mapping[str, Value] | Sequence[str] | None,
        Option(
            "AXIS=CELL",
            "with --plant: follow the pose, by modes of a grid of poses with cells of this size, Z=20mm, or over "
            "a part of the travel, Z=0mm..400mm/20mm (docs/position-dependence.md)",
            several=True,
            group="unit (.fmu)",
        ),
    ] = None,
    name: Annotated[
        str | None, Option("NAME", "with --plant: of the machine in the archive", group="unit (.fmu)")
    ] = None,
    note: Annotated[
        str | None, Option("NOTE", "with --plant: a remark that goes with the name", group="unit (.fmu)")
    ] = None,
    one: Annotated[
        bool,
        Option(
            "",
            "one component, the machine as one unit with its motion inside, for any step size",
            group="SSP file (.ssp)",
        ),
    ] = False,
    knobs: Annotated[
        str | Sequence[str],
        Option(
            "KEYS",
            "what can be turned, keys of the scenario or their ends, with * and ?, separated by commas (default: the "
            "usual ones of the axes that move, and the motions)",
            group="page (.html)",
        ),
    ] = (),
    fmus: Archives = None,
    force: Force = False,
    watch: Watch = NO_WATCH,
) -> Made:
    """Write a scenario, or a machine, as one file for other programs; no compiler is needed.

    An FMI 2.0 co-simulation unit holds structure, drives and friction of all axes; of a scenario the motion, too. Any
    importer gets at steps of any length what feedsim run gets (docs/importing.md). An SSP file (System Structure and
    Parameterization 1.0) holds the units of a scenario, their parameters, wiring and motion; feedsim run runs it
    (docs/ssp.md). A page holds the machine compiled as WebAssembly, and knobs; it opens from disk (docs/page.md).

    Command line:
        feedsim example xz_circle z_positioning
        feedsim export xz_circle.yaml -o machine.fmu
        feedsim export machines/test_centre -o machine.fmu
        feedsim export machines/test_centre --plant --poses Z=20mm -o plant.fmu
        feedsim export z_positioning.yaml --set "machine.axes.Z.friction.W=0 rad" -o lugre.ssp
        feedsim export xz_circle.yaml --knobs "motions.*,Z.drive.*,friction.F_?" -o z.html

    Raises:
        InputError: a faulty file, a machine that no run would take, an option that the file does not have.
        SimulationError: a unit failed.
        OutputError: `out` cannot be written.

    >>> import feedsim as fs
    >>> made = fs.export("z_positioning.yaml", kind="ssp")
    >>> made.content[:2], made.name
    (b'PK', 'z_positioning.ssp')
    """
    ending = f".{kind}" if out is None else Path(out).suffix.lower()
    if ending not in ENDINGS:
        raise InputError(
            f"{spell_argument('out')} {out}: the name must end in {', '.join(ENDINGS)}, which says what is written"
        )
    given: dict[str, Any] = {
        "inputs": inputs, "plant": plant, "base": base, "at": at, "poses": poses, "name": name, "note": note,
        "one": one, "knobs": knobs, "terminals": not terminals,
    }  # fmt: skip
    asked = {key: value for key, value in given.items() if value}
    known = (*ENDINGS[ending], *(OF_PLANT if plant else ()))
    if plant and inputs:
        raise InputError(f"{spell_argument('inputs')}: {spell_argument('plant')} has no motion to leave out")
    if wrong := next((key for key in asked if key not in known), ""):
        needs = (
            f"{spell_argument('plant')}"
            if wrong in OF_PLANT
            else next(end for end, keys in ENDINGS.items() if wrong in keys)
        )
        raise InputError(f"{spell_argument(wrong)}: is for {needs}, not for {ending}")
    set = on_machine(machine, set)
    if ending == ".ssp":
        return write_ssp(subject, out, one=one, fmus=fmus, set=set, force=force)
    if ending == ".html":
        return write_page(subject, out, knobs=knobs, fmus=fmus, set=set, force=force, watch=watch)
    if plant:
        if set:
            raise InputError(
                f"{spell_argument('set')}: changes are for a scenario; {spell_argument('plant')} takes the "
                f"machine file as it is"
            )
        return machine_pack(
            subject,
            out,
            at=at,
            poses=poses,
            name=name,
            note=note,
            base=base,
            terminals=terminals,
            fmus=fmus,
            force=force,
            watch=watch,
        )
    return pack(
        subject, out, inputs=inputs, base=base, terminals=terminals, fmus=fmus, set=set, force=force, watch=watch
    )


# --- A scenario, or a machine, as one unit for other people's simulators ----------------------------------------------


IS_PACKED_UNIT = archive_with("modelDescription.xml", b'generationTool="feedsim')
UNIT_KIND = MadeKind("pack", "unit", IS_PACKED_UNIT)


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
    UNIT_KIND.check_folder(out)
    loaded = scenario.load_subject(subject, settings(set))
    own = None if base is None else Path(base)
    read = [Path(subject), *(file for _, file in loaded.files), *([own] if own is not None else [])]
    with UNIT_KIND.checked(out, read, force=force) as path:
        plan, machine = loaded.scenario, loaded.machine
        announce_archive(watch, own, "the packed unit's trial")
        archives = Path(fmus) if fmus is not None else cosim.fmus_directory()
        program = nc.plan(plan) if plan is not None and not inputs else None
        if plan is not None:
            _check_loads(plan)
        findings: tuple[Finding, ...] = ()
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
        made = Made(UNIT_KIND, "machine.fmu", content, [line], findings, inputs=read)
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


# --- A scenario's machine as one page that computes, with knobs -------------------------------------------------------


PAGE_KIND = MadeKind("page", "page", begins_with(MARK))


def write_page(
    scenario: File,
    out: File | None = None,
    *,
    knobs: str | Sequence[str] = (),
    fmus: File | None = None,
    set: Changes = None,
    force: bool = False,
    watch: Watch = NO_WATCH,
) -> Made:
    """Write one HTML file that holds the scenario's machine, compiled as WebAssembly, and knobs.

    Args:
        scenario: scenario file.
        out: page to write; None: :meth:`Made.save` does it.
        knobs: what can be turned: keys of the scenario or their ends, with * and ?; none: the usual ones.
        fmus: folder of archives and module.
        set: changes of the file, as behind ``--set``.
        force: `out` may be a file that feedsim did not write.
        watch: who hears how far the job is.

    Raises:
        InputError: a faulty file, a machine that a page cannot hold, no such knob.
        SimulationError: a unit failed.
        OutputError: `out` cannot be written.

    >>> import feedsim as fs
    >>> fs.export("z_positioning.yaml", kind="html").name
    'z_positioning.html'
    """
    PAGE_KIND.check_folder(out)
    file, archives = Path(scenario), None if fmus is None else Path(fmus)
    wanted = split_names(knobs)
    asked = load(file, settings(set))
    read = [file, *input_paths(asked)]
    with PAGE_KIND.checked(out, read, force=force) as path:
        program = nc.plan(asked)
        content(asked, program, wanted, archives)  # what cannot be shown should not be run
        check(asked, program)
        run = judge_run(cosim.run(asked, program=program, fmus=archives, progress=watch.of("simulation")))
        page_of_run = page(run, wanted, archives)
        line = f"{len(page_of_run) / 1000:.0f} kB; axes {', '.join(asked.machine.axes)}; open it in a browser"
        made = Made(PAGE_KIND, f"{file.stem}.html", page_of_run, [line], run.warnings, inputs=read)
        if path is not None:
            made.save(path, force=force)
    return made


# --- A scenario as one SSP file, for other people's simulators --------------------------------------------------------


SSP_KIND = MadeKind("ssp", "SSP file", archive_with(STRUCTURE, b'generationTool="feedsim'))


def write_ssp(
    scenario: File,
    out: File | None = None,
    *,
    one: bool = False,
    fmus: File | None = None,
    set: Changes = None,
    force: bool = False,
) -> Made:
    """Write a scenario as one SSP file (System Structure and Parameterization 1.0): units, parameters, wiring, motion.

    Args:
        scenario: scenario file.
        out: the SSP file to write, which ends in .ssp; None: :meth:`Made.save` does it.
        one: one component, the machine as one unit with its motion inside, for any step size.
        fmus: folder of the archives.
        set: changes of the file, as behind ``--set``.
        force: `out` may be a file that feedsim did not write.

    Raises:
        InputError: a faulty file, a motion that violates a limit, loads over time, a name that does not end in .ssp.
        OutputError: `out` cannot be written.

    >>> import feedsim as fs
    >>> made = fs.export("z_positioning.yaml", kind="ssp")
    >>> made.content[:2]
    b'PK'
    """
    if out is not None and not is_ssp(Path(out)):
        raise InputError(f"{spell_argument('out')} {out}: an SSP file ends in .ssp; simulators recognise it by that")
    file = Path(scenario)
    if is_ssp(file):
        raise InputError(f"{file}: is an SSP file already; a scenario is expected")
    SSP_KIND.check_folder(out)
    plan = load(file, [*settings(set), *(["coupling.units=one"] if one else [])])
    read = [file, *input_paths(plan)]
    with SSP_KIND.checked(out, read, force=force) as path:
        with TemporaryFolder() as folder:
            done = ssp.export(plan, folder / "machine.ssp", fmus=None if fmus is None else Path(fmus))
            content = done.path.read_bytes()
        line = (
            f"{done.size / 1024:.0f} KiB, {_describe_system(done, plan.machine.cycles.T_c)}; "
            f"runs on {', '.join(done.platforms) or 'no platform'}"
        )
        made = Made(SSP_KIND, f"{file.stem}.ssp", content, [line], done.warnings, inputs=read)
        if path is not None:
            made.save(path, force=force)
    return made


def _describe_system(done: ExportedSystem, T_c: float) -> str:
    if len(done.instances) == 1:
        return f"one instance, {done.duration:.4g} s at any step; parameters in its archive"
    return (
        f"{len(done.instances)} instances, {done.duration:.4g} s at {T_c * 1e6:.6g} us; parameters in resources/*.ssv"
    )


# --- A machine at a pose, or over a grid of poses, in a plant archive -------------------------------------------------


PLANT_KIND = MadeKind("machine pack", "unit", IS_PACKED_UNIT, makes_folder=True)
# A cell takes a tenth of a second and, with two axes and a hundred modes, 0.2 MB in the archive and in the plant.
MOST_CELLS = 3000
# Positions that are typed twice are the same where they differ by less [m].
START_TOLERANCE = 1e-9
POSITIONS_EXAMPLE = "Z=20mm or Z=0mm..400mm/20mm"


def machine_pack(
    machine: File,
    out: File | None = None,
    *,
    at: Positions = None,
    poses: Pairs[Value] = None,
    name: str | None = None,
    note: str | None = None,
    terminals: bool = True,
    base: File | None = None,
    fmus: File | None = None,
    force: bool = False,
    watch: Watch = NO_WATCH,
) -> Made:
    """Pack the machine's axes, pose and table of modes into a plant archive; needs no compiler.

    Args:
        machine: machine file, or a folder with a machine.yaml.
        out: archive to write; None: :meth:`Made.save` does it.
        at: axis -> position [m], or a text with a unit; other axes stay at the machine's pose.
        poses: axis -> size of the cells of a grid of poses [m], or a text "20mm" or "0mm..400mm/20mm".
        name, note: of the machine in the archive; None: the machine's own.
        terminals: with terminals and icons, which FMI Library 3 refuses in units of FMI 2.0.
        base: archive whose binaries are taken; None: plant.fmu in `fmus`.
        fmus: folder of the archives; None: those that come along.
        force: `out` may be a file that feedsim did not write.
        watch: who hears how far the job is.

    Raises:
        InputError: a faulty file, no such axis or position, no structure to compute modes from.
        OutputError: `out` cannot be written.

    >>> import feedsim as fs
    >>> fs.export("machines/test_centre", at={"Z": "100 mm"}, plant=True).name
    'plant.fmu'
    """
    described = load_described(machine)
    loaded = scenario.load_machine(machine)
    own = None if base is None else Path(base)
    # The archive that the machine file names as its plant, and one that is packed in place, are made anew here.
    made = [path for path in (loaded.plant, own) if path is not None]
    files = [file for _, file in described.files if not any(is_same_file(file, path) for path in made)]
    read = [Path(machine), loaded.modes.file, *files]
    with PLANT_KIND.checked(out, read, force=force) as path:
        announce_archive(watch, own, "the packed plant's trial")
        pose = _pose_of(loaded, at)
        with TemporaryFolder() as folder:
            modes = _modes_at(loaded, pose, folder) if at else loaded.modes
            # what a run would refuse should not be packed
            checked_modes(loaded.model_copy(update={"modes": modes} | ({"mounts": None} if at else {})))
            if not at and (doubt := table_mismatch(loaded)) is not None:
                raise InputError(f"{doubt}, or let the modes be computed: {spell_argument('at')}")
            mounts = folder / MOUNTS_FILE if at and loaded.mounts_table is not None else loaded.mounts_table
            grid, follows = None, ""
            if poses and mounts is not None:
                raise InputError(
                    f"{spell_argument('poses')}: {loaded.name} has mounts that are not linear "
                    f"({loaded.mounts_table}), which "
                    "belong to one pose; leave one of the two out"
                )
            if poses:
                grid = folder / "poses.bin"
                follows = f"; {_write_grid(loaded, pose, modes, poses, watch, grid)}"
            packed = archive.pack(
                own or (cosim.fmus_directory() if fmus is None else Path(fmus)) / "plant.fmu",
                folder / "plant.fmu",
                modes=modes,
                pose=pose,
                poses=grid,
                mounts=mounts,
                name=loaded.name if name is None else name,
                note=loaded.note if note is None else note,
                terminals=terminals,
            )
            content = packed.path.read_bytes()
        where = ", ".join(f"{axis} at {position * 1e3:.9g} mm" for axis, position in pose.items())
        line = (
            f"{where}{follows}; {packed.size / 1024:.0f} KiB, {', '.join(packed.platforms) or 'no binaries'}, "
            f"guid {packed.guid}"
        )
        result = Made(PLANT_KIND, "plant.fmu", content, [line], inputs=read)
        if path is not None:
            result.save(path, force=force)
    return result


def _pose_of(machine: Machine, at: Positions) -> dict[str, float]:
    """The machine's pose [m], axes in its order, with the positions `at` in place of its own.

    Raises:
        InputError: no such axis, no length, or outside of the axis' travel.
    """
    pose = {axis: machine.pose[axis] for axis in machine.axes}
    for axis, position in positions(at).items():
        if axis not in pose:
            raise InputError(f"{spell_argument('at')}: the machine has no axis {axis}; axes are {', '.join(pose)}")
        low, high = machine.axes[axis].travel
        if not low <= position <= high:
            raise InputError(
                f"{spell_argument('at')} {axis}: {units.show(position, 'm')} is outside of the travel, "
                f"{units.show(low, 'm')} to {units.show(high, 'm')}"
            )
        pose[axis] = position
    return pose


def _modes_at(machine: Machine, pose: Mapping[str, float], folder: Path) -> FileContent:
    """Table of the machine's modes at `pose` [m], computed from its structure; that of its mounts is written to
    `folder`, where the machine has some that are not linear.

    Raises:
        InputError: the machine has no structure, its kind is known at one pose only, or it is faulty.
    """
    if machine.structure is None:
        raise InputError(
            f"{machine.name}: has no structure to compute modes from at another pose; give it the key structure, or "
            f"leave {spell_argument('at')} out"
        )
    built = build(load_structure(machine.structure), pose)
    if machine.mounts is not None:
        if (mounts := table_of(built.assembly, built.solution.shapes)) is None:
            raise InputError(
                f"{machine.structure}: all of its mounts are linear; the machine file names a table of others"
            )
        write_mounts(folder / MOUNTS_FILE, mounts)
    return table_of_modes(built.solution.modes, folder / "modes.csv")


def _write_grid(
    machine: Machine, pose: Mapping[str, float], modes: FileContent, asked: Pairs[Value], watch: Watch, out: Path
) -> str:
    """Compute the grid that is asked for, about `pose` [m], and write it to `out`; returns what was made, in words.

    modes: table at `pose`, which says how large the grid will be.

    Raises:
        InputError: no such axis, no such cells, or a machine whose structure is known at one pose only.
    """
    if machine.structure is None:
        raise InputError(
            f"{machine.name}: has no structure to compute the modes of other poses from; give the machine file the key "
            f"structure, or leave {spell_argument('poses')} out"
        )
    structure = load_structure(machine.structure)
    movable(structure)
    grid = grid_axes(machine, asked)
    axes = list(machine.axes)
    watch.say(_size(machine, pose, grid, len(parse_modes(modes, tuple(axes)).frequency)))
    poses = pose_grid(structure, pose, grid, axes=axes, progress=watch.of(machine.name))
    size = write_poses(out, poses)
    cells = " x ".join(f"{len(axis.centres)} in {axis.axis}" for axis in grid)
    return f"follows the pose, {len(poses.cells)} cells ({cells}), {size / 2**20:.1f} MiB of modes"


def _size(machine: Machine, pose: Mapping[str, float], grid: Sequence[GridAxis], count: int) -> str:
    """How much is about to be computed, of `count` modes per cell, in words.

    Raises:
        InputError: too much, or the plant would start outside of the grid.
    """
    for axis in grid:
        low, high = axis.reach
        if not low - START_TOLERANCE <= pose[axis.axis] <= high + START_TOLERANCE:
            raise InputError(
                f"{spell_argument('poses')}: the machine stands at {axis.axis} {pose[axis.axis] * 1e3:.6g} mm, "
                f"outside of the "
                f"grid, {low * 1e3:.6g} mm to {high * 1e3:.6g} mm; choose a range that holds it, or another pose with "
                f"{spell_argument('at')}"
            )
    cells = math.prod(len(axis.centres) for axis in grid)
    numbers = cells * (1 + count * (5 + 2 * len(machine.axes)) + len(grid) * count**2)
    size = f"{cells} cells of about {count} modes, about {8 * numbers / 2**20:.3g} MiB"
    if cells > MOST_CELLS:
        raise InputError(
            f"{spell_argument('poses')}: {size}; at most {MOST_CELLS} cells are allowed: larger cells, or fewer axes"
        )
    return size


def grid_axes(machine: Machine, poses: Pairs[Value]) -> list[GridAxis]:
    """Grid axes of axis -> size of the cells [m], or a text CELL or LOW..HIGH/CELL.

    Raises:
        InputError: no such form, no such axis, or a range outside of its travel.
    """

    def axis_of(name: str, given: Value) -> GridAxis:
        if name not in machine.axes:
            raise InputError(f"the machine has no axis {name!r}; axes are {', '.join(machine.axes)}")
        low, high = travel = machine.axes[name].travel
        rest = given if isinstance(given, str) else f"{given} m"
        limits, slash, cell = rest.rpartition("/") if ".." in rest else ("", "", rest)
        if ".." in rest and not slash:
            raise InputError(f"the size of the cells is missing; {POSITIONS_EXAMPLE} is the form")
        width = units.parse(cell, "m", "20 mm")
        if slash:
            first, _, last = limits.partition("..")
            low, high = units.parse(first, "m", "0 mm"), units.parse(last, "m", "400 mm")
        if not travel[0] <= low <= travel[1] or not travel[0] <= high <= travel[1]:
            raise InputError(
                f"outside of the travel of {name}, {units.show(travel[0], 'm')} to {units.show(travel[1], 'm')}"
            )
        axis = grid_axis(name, low, high, width)
        if len(axis.centres) == 1:
            raise InputError(
                f"as wide as the {'range' if slash else 'travel'}, {units.show(high - low, 'm')}, or wider: 1 cell "
                "does not follow; leave the axis out, or give smaller cells"
            )
        return axis

    given = pairs("poses", poses, f"{POSITIONS_EXAMPLE} is the form")
    return [*by_name("poses", given, axis_of).values()]
