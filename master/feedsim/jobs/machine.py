"""A machine at a pose: its figures, its modes computed from its structure, and pictures of both."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from feedsim.analysis import Figure, FigureTable
from feedsim.foundation.arguments import Value, lengths, pairs, quantity, spell_argument
from feedsim.foundation.errors import Finding, InputError
from feedsim.foundation.outputs import begins_with
from feedsim.jobs.parameters import (
    NO_WATCH,
    AxisPositions,
    CouplingStep,
    Cutoff,
    File,
    Force,
    Option,
    Positions,
    StaticCorrection,
    StructureArgument,
    Watch,
    job,
    output_option,
)
from feedsim.jobs.result import Kind, Result, claim_result_folder
from feedsim.report import machine_record as shown
from feedsim.report.content import PICTURE_FORMATS, Report
from feedsim.report.provenance import to_json
from feedsim.scenario.load import MachineDescription, load_described
from feedsim.scenario.structure import GeometryStructure, Structure
from feedsim.structure.build import build
from feedsim.structure.info import MachineInfo, info_of_model, info_of_table
from feedsim.structure.modes import Modes, checked_modes, damped_twice, read_modes, write_modes
from feedsim.structure.mounts import MOUNTS_FILE, MountTable, table_of, write_mounts
from feedsim.structure.pose_change import describe_stale_table

if TYPE_CHECKING:
    from feedsim.report.machine import Drawings

# Exchange step where no machine file says what the control cycle is [s].
USUAL_STEP = 125e-6
USUAL_MODES = 20  # that are listed
TABLE_FILE, BUILD_FILE = "modes.csv", "build.json"
# A frequency that is asked for belongs to the nearest mode if that is not farther away than this share.
MODE_DISTANCE = 0.1
POSITION_NEEDED = "AXIS=POSITION is needed, e.g. X=800mm"


def _of_build(folder: Path) -> Sequence[str]:
    """Files of an earlier build, which has no summary that lists them."""
    return (TABLE_FILE, MOUNTS_FILE, BUILD_FILE) if begins_with(b'"format"')(folder / BUILD_FILE) else ()


KIND = Kind("machine", drawn=PICTURE_FORMATS)
BUILT = Kind(
    "machine build", (TABLE_FILE, MOUNTS_FILE, BUILD_FILE), own=_of_build, main_file=TABLE_FILE, reported=False
)


@dataclass(frozen=True, eq=False)
class PosedMachine:
    """A machine at a pose. info: masses, inertias, coupling limits, modes. described: what its files say of it."""

    info: MachineInfo
    described: MachineDescription

    @property
    def structure(self) -> Structure:
        """What the modes are computed from. Raises InputError: the machine has a table of modes alone."""
        if self.described.structure is None:
            raise InputError(
                f"{self.described.name}: has a table of modes alone, and no table says where things are; a picture "
                "needs a structure file (key structure, docs/structure.md)"
            )
        return self.described.structure

    @property
    def mounts(self) -> MountTable | None:
        """The mounts that are not linear; None where all are."""
        built = self.info.built
        return table_of(built.assembly, built.solution.shapes) if built is not None else None

    def record(self) -> dict[str, Any]:
        """All figures in full precision, for a JSON file."""
        return shown.record(self.info, self.described.files)

    @property
    def json(self) -> str:
        """The record as text, with the table of modes among the inputs."""
        modes = [("modes", self.described.modes)] if self.described.modes else []
        return to_json(shown.record(self.info, [*self.described.files, *modes]))


def figures_of(info: MachineInfo) -> FigureTable:
    """ "total_mass", "lowest_mode", "X.J_tot", "X.coupling_limit", ...; what is not known is not there."""
    result = {"total_mass": Figure(info.total_mass, "kg", "mass of everything")}
    elastic = info.modes.frequency[info.modes.frequency > 0].tolist()
    if elastic:
        result["lowest_mode"] = Figure(elastic[0], "Hz", "frequency of the first mode that is not rigid")
    for axis in info.axes:
        for key, (unit, meaning) in shown.MEANINGS.items():
            result[f"{axis.name}.{key}"] = Figure(getattr(axis, key), unit, meaning)
    return FigureTable((name, figure) for name, figure in result.items() if math.isfinite(figure.value))


def result_of(
    machine: PosedMachine,
    modes: Sequence[int] = (),
    scale: float = 1.0,
    animate: bool = False,
    listed: int | None = USUAL_MODES,
) -> Result[PosedMachine]:
    """A machine at a pose: its figures, the lowest mode and what moves in it, and pictures.

    modes: numbers of the modes that are drawn; none: the first ones, on a sheet. listed: modes that are printed; None:
    all.
    """
    info, described = machine.info, machine.described

    @cache
    def drawn() -> Drawings:
        from feedsim.report.machine import draw_machine

        return draw_machine(machine.structure, info, modes=modes, scale=scale, animate=animate)

    def report() -> Report:
        from feedsim.report.machine import report_of

        return report_of(info, described.files, drawn().parts)

    def answers() -> list[str]:
        from feedsim.report.machine import answers

        return answers(info)

    def lines() -> list[str]:
        gaps = described.gaps
        more = f" (and {len(gaps) - 1} more)" if len(gaps) > 1 else ""
        missing = [f"The machine file is not complete: {gaps[0]}{more}"] if gaps else []
        return [*shown.text(info, listed).split("\n"), *missing]

    return Result(
        KIND,
        machine,
        report,
        figures=partial(figures_of, info),
        details=machine.record,
        files=lambda: drawn().files,
        inputs=[file for _, file in described.files],
        answers=answers,
        findings=info.warnings,
        lines=lines,
    )


def result_of_build(machine: PosedMachine) -> Result[PosedMachine]:
    """Modes that were computed from a structure: the table that runs read, and how it came about."""
    info, solution, mounts = machine.info, machine.info.solution, machine.mounts
    assert solution is not None
    shown_too = result_of(machine)
    elastic = info.modes.frequency[info.modes.frequency > 0]
    count = len(elastic) - solution.corrections
    lowest = ", ".join(f"{f:.4g}" for f in elastic[: min(5, count)])
    extra = f" and {solution.corrections} pseudo-modes" if solution.corrections else ""
    return Result(
        BUILT,
        machine,
        shown_too.report,
        figures=lambda: shown_too.figures,
        files=lambda: {
            TABLE_FILE: partial(write_modes, modes=info.modes),
            **({} if mounts is None else {MOUNTS_FILE: partial(write_mounts, table=mounts)}),
            BUILD_FILE: to_json(machine.record()),
        },
        inputs=shown_too.inputs,
        answers=lambda: shown_too.answers,
        findings=info.warnings,
        lines=[
            f"{info.title}: {solution.shapes.shape[0]} degrees of freedom, "
            f"{len(info.modes.frequency) - len(elastic)} rigid and {count} elastic modes{extra}"
            f"{f', lowest {lowest} Hz' if lowest else ''}"
        ],
    )


@job("masses, inertias, leads, coupling limits and modes")
def machine_info(
    machine: StructureArgument,
    *,
    at: AxisPositions = None,
    cutoff: Cutoff = None,
    static_correction: StaticCorrection = False,
    step: CouplingStep = None,
    modes: Annotated[int | str | None, Option("N", "modes to list: number or all (default: 20)")] = USUAL_MODES,
    watch: Watch = NO_WATCH,
) -> Result[PosedMachine]:
    """Masses, inertias, leads, coupling limits and modes of a machine.

    They are computed from its structure where it has one, else from its table of modes. MACHINE may be a scenario too.

    Raises InputError: a faulty file or pose, no structure for what was asked, a structure that cannot be solved.

    >>> import feedsim as fs
    >>> fs.machine_info("machines/test_centre").figures["X.lead"].unit
    'm/rad'
    """
    most = _mode_count(modes)
    described = load_described(machine)
    info = _info(machine, described, at, cutoff, static_correction, step, watch)
    return result_of(PosedMachine(info, described), listed=most)


@job("compute a machine's modes from its structure")
def machine_build(
    machine: StructureArgument,
    out: Annotated[File | None, output_option("build_{machine}")] = None,
    *,
    at: AxisPositions = None,
    cutoff: Cutoff = None,
    static_correction: StaticCorrection = False,
    force: Force = False,
    watch: Watch = NO_WATCH,
) -> Result[PosedMachine]:
    """Compute the modes of a machine from its structure.

    The structure is geometry, or matrices of a finite-element program (docs/structure.md).

    Raises:
        InputError: as of :func:`machine_info`; the machine has no structure.
        OutputError: `out` cannot be written.

    >>> import feedsim as fs
    >>> fs.machine_build("machines/test_centre", at={"Z": "100 mm"}).info.pose["Z"]
    0.1
    """
    described = load_described(machine)
    if described.structure is None:
        raise InputError(
            f"{machine}: has no key structure; modes are computed from a structure file (docs/structure.md)"
        )

    with claim_result_folder(out, BUILT, watch, [file for _, file in described.files], force=force):
        info = _info(machine, described, at, cutoff, static_correction, None, watch, fresh=True)
        result = result_of_build(PosedMachine(info, described))
        if out is not None:
            result.save(out, force=force)
    return result


@job("draw a machine's structure and its modes", needs=("figures",))
def machine_view(
    machine: StructureArgument,
    out: Annotated[File | None, output_option("view_{machine}")] = None,
    *,
    at: AxisPositions = None,
    cutoff: Cutoff = None,
    static_correction: StaticCorrection = False,
    step: CouplingStep = None,
    mode: Annotated[
        Sequence[int | str],
        Option(
            "MODE",
            "mode to draw: its number, or a frequency such as 21Hz for the nearest one; may be given several times",
            many=True,
        ),
    ] = (),
    animate: Annotated[bool, Option("", "write an animated GIF of every --mode, too")] = False,
    scale: Annotated[
        float | str,
        Option(
            "FACTOR",
            "deflections are drawn this many times as large as usual, e.g. 2 (default: auto, a tenth of the machine)",
        ),
    ] = "auto",
    force: Force = False,
    watch: Watch = NO_WATCH,
) -> Result[PosedMachine]:
    """Draw the structure of a machine and its modes.

    Writes pictures as PNG and SVG and a report. MACHINE may be a scenario too.

    Raises:
        InputError: as of :func:`machine_info`; no structure or no geometry; no such mode.
        OutputError: `out` cannot be written.

    >>> import feedsim as fs
    >>> fs.machine_view("machines/test_centre", mode=["21Hz"]).kind
    'machine'
    """
    factor = _scale(scale)
    if animate and not mode:
        raise InputError(
            f"{spell_argument('animate')}: which mode? Give {spell_argument('mode')} too, e.g. "
            f"{spell_argument('mode')} 21Hz"
        )
    described = load_described(machine)
    if described.structure is None:
        raise InputError(
            f"{machine}: has a table of modes alone, and no table says where things are; a picture needs a structure "
            "file (key structure, docs/structure.md)"
        )

    with claim_result_folder(out, KIND, watch, [file for _, file in described.files], force=force):
        info = _info(machine, described, at, cutoff, static_correction, step, watch)
        chosen = list(dict.fromkeys(_mode(entry, info.modes) for entry in mode))
        result = result_of(PosedMachine(info, described), chosen, factor, animate)
        if out is not None:
            result.save(out, force=force)
    return result


def _info(
    machine: File,
    described: MachineDescription,
    at: Positions,
    cutoff: Value | None,
    static_correction: bool,
    step: Value | None,
    watch: Watch,
    *,
    fresh: bool = False,
) -> MachineInfo:
    """The figures of a machine, its modes computed where there is a structure. fresh: the table is being made anew."""
    loaded = described.machine
    h = loaded.cycles.T_c if loaded else USUAL_STEP
    if step is not None:
        h = quantity("step", step, "s", "125 us", positive=True)
    friction = loaded.shipped_frictions if loaded else None
    if described.structure is None:
        assert loaded is not None
        for option, given in (("at", at), ("cutoff", cutoff), ("static_correction", static_correction)):
            if given:
                raise InputError(
                    f"{spell_argument(option)}: {machine} has a table of modes alone; other modes need a "
                    f"structure file (key "
                    "structure, docs/structure.md)"
                )
        return info_of_table(described.name, described.note, checked_modes(loaded), described.pose, h, friction)
    limit = None if cutoff is None else quantity("cutoff", cutoff, "rad/s", "1500 Hz", positive=True)
    pose = {**described.pose, **positions(at)}
    _check_complete(described.structure, pose)
    built = build(
        described.structure, pose, cutoff=limit, static_correction=static_correction,
        progress=lambda text: watch.progress(text, 0, 1),
    )  # fmt: skip
    as_it_is = pose == dict(described.pose) and limit is None and not static_correction and not fresh
    warnings = _warn_stale_modes(described, built.solution.modes) if as_it_is else []
    if (mounts := table_of(built.assembly, built.solution.shapes)) is not None:
        warnings += damped_twice(built.solution.modes, mounts, mounts.element)
        if loaded is not None and loaded.mounts is None:
            remedy = f"mounts: {{table: {MOUNTS_FILE}}}"
            warnings.append(Finding(
                "mounts-not-named", "doubt",
                "the structure has mounts that are not linear; runs take their stiffness alone, until the machine file "
                f"names their table: {remedy}",
                str(machine), remedy,
            ))  # fmt: skip
    return info_of_model(described.name, described.note, built, h, friction, warnings)


def _warn_stale_modes(described: MachineDescription, modes: Modes) -> list[Finding]:
    """That the machine's table of modes is another one than its structure gives."""
    machine = described.machine
    if machine is None or described.modes is None:
        return []
    how = describe_stale_table(read_modes(described.modes, list(machine.axes)), modes)
    if not how:
        return []
    remedy = "Build it anew (feedsim machine build --force), or name the structure that it belongs to"
    return [Finding(
        "modes-stale", "doubt",
        f"{described.modes} is not what {machine.structure} gives at the machine's pose: {how}. Shown is the "
        f"structure; runs take the table. {remedy}",
        str(described.modes), remedy,
    )]  # fmt: skip


def _check_complete(structure: Structure, pose: Mapping[str, float]) -> None:
    if not isinstance(structure, GeometryStructure):
        return
    if missing := [axis for axis in structure.axes if axis not in pose]:
        middle = {axis: 5e2 * sum(structure.axes[axis].travel) for axis in missing}
        example = " ".join(f"{axis}={position:.6g}mm" for axis, position in middle.items())
        raise InputError(
            f"{structure.name or 'structure'}: nothing says where axis {', '.join(missing)} stands; the structure can "
            f"be assembled at any position: give one, e.g. {spell_argument('at')} {example}"
        )


def positions(at: Positions) -> dict[str, float]:
    """Axis -> position [m]. Raises InputError."""
    return lengths("at", pairs("at", at, POSITION_NEEDED), "800mm")


def _mode_count(modes: int | str | None) -> int | None:
    """How many modes are listed; None: all."""
    if modes is None or modes == "all":
        return None
    if not str(modes).isdecimal():
        raise InputError(f"{spell_argument('modes')} {modes}: a whole number, or all, is needed")
    return int(modes)


def _mode(asked: int | str, modes: Modes) -> int:
    """Number of the mode that is meant."""
    from feedsim.foundation import units

    count, text = len(modes.frequency), str(asked)
    option = f"{spell_argument('mode')} {text}"
    if text.isdecimal():
        if int(text) >= count:
            raise InputError(
                f"{option}: there are {count} modes, 0 to {count - 1}, up to {modes.frequency.max():.1f} Hz; "
                f"{spell_argument('cutoff')} gives more"
            )
        return int(text)
    try:
        f = units.parse(text, "Hz", "21 Hz")
    except InputError as error:
        raise InputError(f"{option}: the number of a mode or a frequency is needed; {error}") from None
    if not (math.isfinite(f) and f > 0):
        raise InputError(f"{option}: a frequency above 0 Hz is needed; rigid modes are chosen by their number")
    k = int(np.argmin(np.abs(modes.frequency - f)))
    if abs(modes.frequency[k] - f) > MODE_DISTANCE * f:
        first = ", ".join(f"{value:.4g}" for value in modes.frequency[modes.frequency > 0][:8])
        raise InputError(
            f"{option}: no mode near; the nearest is {modes.frequency[k]:.4g} Hz (the first elastic ones: "
            f"{first or 'none'} Hz)"
        )
    return k


def _scale(given: float | str) -> float:
    if given == "auto":
        return 1.0
    try:
        scale = float(given)
    except ValueError:
        scale = math.nan
    if not (math.isfinite(scale) and 0 < scale <= 100):
        raise InputError(f"{spell_argument('scale')} {given}: auto, or a factor above 0 and up to 100, is needed")
    return scale
