"""From records to drives and a machine: each axis on its own, on the machine that is known, or on a rigid one."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from math import pi
from pathlib import Path

import numpy as np

from feedsim.errors import InputError
from feedsim.identify import Recorded
from feedsim.identify.clipping import tied_at_limit
from feedsim.identify.inertia import inertia
from feedsim.identify.parameters import EXCESS
from feedsim.owned import TemporaryFolder
from feedsim.replay.closed_loop import AxisRecord, Replay, same_time, unclipped
from feedsim.replay.compare import Comparison, replayed
from feedsim.replay.coupling import coupled
from feedsim.replay.cycle import decision, with_either
from feedsim.replay.drive import DriveFound, identify_drive
from feedsim.replay.elastic import ElasticMode
from feedsim.replay.machine_files import (
    RigidAxis,
    control_cycle,
    drive_file,
    drive_text,
    friction_axis_text,
    friction_file,
    machine_files,
    simple_drive,
)
from feedsim.replay.outside import Line, without_outside
from feedsim.replay.plausible import implausible
from feedsim.replay.start import Begin, limits, of_cycle, start_values
from feedsim.scenario import Friction, Machine, load_machine
from feedsim.structure import checked_modes

OF_MACHINE = "of the machine"
TIED = (
    "axis {}: the torque lies at {:.4g} N.m to the last digit in {:.2g} % of the rows, where the range of the record "
    "or the drive ends; these rows are left out of the fit. Record with a wider range, or drive more gently"
)


@dataclass(frozen=True, eq=False)
class DrivesFound:
    """Drives of the axes of a record.

    drives: axis -> what was found. comparisons: each axis with it, beside its record. files: name -> text: a whole
    machine folder where none was known, else drive_A.yaml and friction_A.yaml of every axis. outside: axis -> lines
    from outside the axis, which were taken out of what was fitted. clipped: sentences on torque that is cut off.
    undecided_cycle: whether the record speaks for no cycle of the position loop, and nobody has given one. refused:
    axis -> why it has no drive.
    """

    drives: Mapping[str, DriveFound]
    comparisons: Sequence[Comparison]
    files: Mapping[str, str]
    outside: Mapping[str, Sequence[Line]] = field(default_factory=dict)
    clipped: Sequence[str] = ()
    undecided_cycle: bool = False
    refused: Mapping[str, str] = field(default_factory=dict)


def identify_drives(
    read: Mapping[str, Recorded],
    records: Mapping[str, AxisRecord],
    machine: Machine | None,
    head: Sequence[str],
    name: str,
    note: str,
    progress: Callable[[str, int, int], None] = lambda what, done, total: None,
    fmus: Path | None = None,
    position_cycle: float | None = None,
    modes: int | None = 0,
    control: str = "",
    refused: Mapping[str, str] | None = None,
) -> DrivesFound:
    """Identify the drive of every axis; one that is refused does not take the others along.

    Args:
        read, records: axis -> all of its record, and the stretch that is fitted.
        machine: whose structure and friction are known; None: the axes are taken to be rigid.
        head: comment at the top of the files. name, note: of the machine that is written. fmus: folder of the archives.
        position_cycle: of rigid axes [s]; None: the control cycle, or that of the record's rows where the record speaks
            for it.
        modes: elastic ones of each rigid axis; None: as many as the record asks for.
        control: that the record is of, as machine files name it; empty: not known.
        refused: further axes, and why they have no record.

    Raises InputError: every axis is refused: by :func:`identify_drive`, for its record is implausible, or because there
        is neither a torque nor a machine.
    """
    files: dict[str, str] = {}
    rigid: dict[str, RigidAxis] = {}
    fitted, outside = {}, {}
    begins: dict[str, Begin | None] = {}
    clipped: list[str] = []
    refusals = dict(refused or {})
    for axis, each in records.items():
        with _refusing(axis, refusals):
            _refuse_implausible(each)
            J = _rigid_inertia(each, machine)
            whole, said = unclipped(each, "the torque of these rows is left out of the fit", J)
            if whole.record.driven:
                marked, share = tied_at_limit(whole.record)
                whole = replace(whole, record=marked)
                if share and not said:
                    said = (TIED.format(axis, float(np.max(np.abs(marked.torque))), 100 * share),)
            own, lines = without_outside(whole, J)
            begins[axis] = _begin(own) if machine is None else None
            fitted[axis], outside[axis] = own, lines
            clipped += said
    interval = next(iter(records.values())).record.interval

    def drives(cycle: float) -> tuple[dict[str, DriveFound], dict[str, str]]:
        found, failed = {}, dict(refusals)
        for axis, each in fitted.items():

            def tell(what: str, done: int, total: int, axis: str = axis) -> None:
                progress(f"{axis}: {what}", done, total)

            begin = begins[axis]
            if begin is not None:
                begin = replace(begin, starts=[of_cycle(start, cycle, interval) for start in begin.starts])
            axes = {axis: rigid_axis(each, begin.starts[0])} if begin is not None else {}
            with (
                _refusing(axis, failed),
                _begun(machine, name, note, axes, interval, cycle) as own,
                Replay(own, {axis: each}, fmus=fmus) as replay,
            ):
                found[axis] = identify_drive(
                    own, each, read[axis].records, replay, structure_known=machine is not None, begin=begin,
                    beside_cycle=_other(cycle, interval) if machine is None else None, modes=modes, progress=tell,
                )  # fmt: skip
        return found, failed

    # A drive that closes the position loop itself (DSC) does so in its own cycle; a control, in that of its rows.
    cycle = position_cycle or control_cycle(interval)
    (found, failed), undecided = drives(cycle), False
    if not found:
        raise InputError.of("no drive is identified", dict.fromkeys(failed.values()))
    if position_cycle is None and machine is None and (speaks := _speaks_for_other(found)) >= 0:
        # Fits that begin with either cycle must agree on it.
        if speaks > 0 and _speaks_for_other((anew := drives(_other(cycle, interval)))[0]) < 0:
            cycle, (found, failed) = _other(cycle, interval), anew
        else:
            undecided = True
            found = {
                axis: replace(one, estimates=with_either(one.estimates, one.other)) if one.other is not None else one
                for axis, one in found.items()
            }
    for axis, one in found.items():
        each, begin = records[axis], begins[axis]
        drive, friction = one.machine.shipped_drive(axis, "a drive file"), friction_of(one, axis)
        if begin is None:
            files[drive_file(axis)] = drive_text(drive, one.estimates, OF_MACHINE, head)
            files[friction_file(axis)] = friction_axis_text(axis, friction, one.estimates, head, one.correlation)
        else:
            values = friction | {"J": one.estimates["J"].value, "M_0": one.machine.axes[axis].M_0}
            rigid[axis] = replace(
                rigid_axis(each, begin.starts[0]), drive=drive, values=values, estimates=one.estimates, head=head,
                modes=one.modes, correlation=one.correlation,
            )  # fmt: skip
    if rigid:
        files = machine_files(name, note, rigid, interval, cycle, control)
        own_modes = {axis: one.modes for axis, one in found.items()}
        beside = _beside(files, own_modes, {axis: fitted[axis] for axis in found}, fmus)
        if any(modes != found[axis].modes for axis, modes in beside.items()):
            found = {axis: replace(one, modes=beside[axis]) for axis, one in found.items()}
            rigid = {axis: replace(each, modes=beside[axis]) for axis, each in rigid.items()}
            files = machine_files(name, note, rigid, interval, cycle, control)
    with _folder(files if rigid else {}) as folder:
        made = {axis: load_machine(folder) if rigid else one.machine for axis, one in found.items()}
        comparisons = [
            replace(replayed(made[axis], {axis: each}, fmus, records)[axis], clipped=())
            for axis, each in records.items()
            if axis in found
        ]
    return DrivesFound(found, comparisons, files, outside, clipped, undecided, failed)


@contextmanager
def _refusing(axis: str, refused: dict[str, str]) -> Iterator[None]:
    """A block in which an axis may be refused: then the reason is kept."""
    try:
        yield
    except InputError as error:
        refused[axis] = str(error)


def _rigid_inertia(each: AxisRecord, machine: Machine | None) -> float | None:
    """Inertia [kg.m2] of the machine, or of the rigid line; None where neither gives one.

    Where a torque is cut off, that of the line is too small: what needs more than it, does.
    """
    if machine is not None:
        return checked_modes(machine).J_tot(each.axis)
    with suppress(InputError):
        return inertia([each.record]).J.value if each.record.driven else None
    return None


def _beside(
    files: Mapping[str, str], modes: Mapping[str, Sequence[ElasticMode]], records: Mapping[str, AxisRecord],
    fmus: Path | None,
) -> dict[str, tuple[ElasticMode, ...]]:  # fmt: skip
    """The modes of all axes with what they do at the scales of others. files: of the machine with these modes.

    Of records whose gaps lie elsewhere nothing is said.
    """
    shapes = {}
    first = len(modes)  # the table begins with a rigid mode of every axis
    if len(records) > 1 and any(modes.values()) and same_time(records):
        every = [mode for own in modes.values() for mode in own]
        with _folder(files) as folder:
            spread = {first + i: mode.sigma for i, mode in enumerate(every) if np.all(np.isfinite(mode.sigma))}
            shapes = coupled(load_machine(folder), records, fmus, spread)
    found, k = {}, first
    for axis, own in modes.items():
        found[axis] = tuple(
            replace(mode, beside=tuple(shape for (row, _), shape in shapes.items() if row == k + i))
            for i, mode in enumerate(own)
        )
        k += len(own)
    return found


def _begin(each: AxisRecord) -> Begin:
    """What the record alone says of an axis. InputError: it has no torque, or does not accelerate."""
    if not each.record.driven:
        raise InputError(
            f"{each.record.name}, axis {each.axis}: no torque, current or force is recorded; without it neither "
            "inertia nor friction is known: give a machine that has them (--machine)"
        )
    return start_values(each)


def _refuse_implausible(each: AxisRecord) -> None:
    """Raises InputError: the record is not that of an axis that follows its setpoint."""
    if reasons := implausible(each):
        raise InputError(
            f"{'; '.join(reasons)}. No drive is identified; feedsim identify friction finds inertia and friction "
            "without a setpoint"
        )


def _speaks_for_other(found: Mapping[str, DriveFound]) -> int:
    """1 where the axes of a record together speak for the other cycle of the position loop, -1 against it, else 0."""
    return decision([one.other for one in found.values() if one.other is not None])


def _other(position_cycle: float, interval: float) -> float:
    """The other usual cycle of a position loop: of the interpolator in place of the drive's."""
    return interval if position_cycle < interval else control_cycle(interval)


@contextmanager
def _folder(files: Mapping[str, str]) -> Iterator[Path]:
    """A temporary folder with files. A message names them as what the record gives."""
    with TemporaryFolder() as folder:
        for file, text in files.items():
            (folder / file).write_text(text, encoding="utf-8")
        try:
            yield folder
        except InputError as error:
            here = re.compile(rf"{re.escape(str(folder))}{re.escape(os.sep)}([\w.]+)(:\d+)?")
            raise InputError(here.sub(r"\1, as the record gives it", str(error))) from None


@contextmanager
def _begun(
    known: Machine | None, name: str, note: str, axes: Mapping[str, RigidAxis], interval: float, cycle: float
) -> Iterator[Machine]:
    """The machine that is known, or one of rigid axes, for as long as its files are there."""
    files = machine_files(name, note, axes, interval, cycle) if known is None else {}
    with _folder(files) as folder:
        yield known or load_machine(folder)


def rigid_axis(each: AxisRecord, begin: Mapping[str, float]) -> RigidAxis:
    """An axis to begin on. begin: as start_values gives them."""
    most = limits(each)
    friction = {**begin, "F_S": begin["F_C"] + begin[EXCESS]}
    pitch = 2 * pi * each.I_P
    return RigidAxis(pitch, float(each.setpoint[0]), most, simple_drive(begin, most["torque"]), friction, {})


def friction_of(found: DriveFound, axis: str) -> dict[str, float]:
    """The parameters of an axis's friction."""
    friction = found.machine.shipped_friction(axis, "a friction file")
    return {name: float(getattr(friction, name)) for name in Friction.model_fields if name != "identified"}
