"""A scenario, or a machine, as one file for other programs: a unit, an SSP file, a page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

from feedsim.arguments import Value, spelt
from feedsim.errors import InputError
from feedsim.jobs.made import Made
from feedsim.jobs.parameters import Archives, Argument, File, Force, Option, Settings, job, out_file
from feedsim.jobs.watch import NO_WATCH, Watch

# Ending of the file -> the options that it has besides those of all.
ENDINGS = {".fmu": ("inputs", "plant", "base", "terminals"), ".ssp": ("one",), ".html": ("knobs",)}
OF_PLANT = ("at", "poses", "name", "note")


@job("write a unit (.fmu), an SSP file (.ssp) or a page (.html)")
def export(
    subject: Annotated[File, Argument("SCENARIO-or-MACHINE", "scenario file, machine file or machine folder")],
    out: Annotated[
        File | None, out_file("FILE", "file to write; its ending, .fmu, .ssp or .html, says what it is")
    ] = None,
    *,
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
        raise InputError(f"{spelt('out')} {out}: the name must end in {', '.join(ENDINGS)}, which says what is written")
    given: dict[str, Any] = {
        "inputs": inputs, "plant": plant, "base": base, "at": at, "poses": poses, "name": name, "note": note,
        "one": one, "knobs": knobs, "terminals": not terminals,
    }  # fmt: skip
    asked = {key: value for key, value in given.items() if value}
    known = (*ENDINGS[ending], *(OF_PLANT if plant else ()))
    if wrong := next((key for key in asked if key not in known), ""):
        needs = (
            f"{spelt('plant')}" if wrong in OF_PLANT else next(end for end, keys in ENDINGS.items() if wrong in keys)
        )
        raise InputError(f"{spelt(wrong)}: is for {needs}, not for {ending}")
    if ending == ".ssp":
        from feedsim.jobs.write_ssp import write_ssp

        return write_ssp(subject, out, one=one, fmus=fmus, set=set, force=force, watch=watch)
    if ending == ".html":
        from feedsim.jobs.write_page import write_page

        return write_page(subject, out, knobs=knobs, fmus=fmus, set=set, force=force, watch=watch)
    if plant:
        from feedsim.jobs.machine_pack import machine_pack

        if set:
            raise InputError(
                f"{spelt('set')}: changes are for a scenario; {spelt('plant')} takes the machine file as it is"
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
            force=force,
            watch=watch,
        )
    from feedsim.jobs.pack import pack

    return pack(
        subject, out, inputs=inputs, base=base, terminals=terminals, fmus=fmus, set=set, force=force, watch=watch
    )
