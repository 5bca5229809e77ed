"""From records to drives and a machine: each axis on its own, on the machine that is known, or on a rigid one."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from math import hypot, pi
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from feedsim.estimation.identify import AxisLimits, RecordedAxis, identify_axis_limits
from feedsim.estimation.identify.clipping import tied_at_limit
from feedsim.estimation.identify.inertia import inertia
from feedsim.estimation.identify.parameters import EXCESS
from feedsim.estimation.identify.position_loop import rms
from feedsim.estimation.least_squares import (
    Covariance,
    between_groups,
    correlated_middle,
    correlation_length,
    half_width,
    is_significant,
)
from feedsim.estimation.replay.closed_loop import (
    AxisRecord,
    FitStart,
    Replay,
    limits,
    mark_clipped_rows,
    of_cycle,
    same_time,
    start_values,
)
from feedsim.estimation.replay.compare import Comparison, replay_records
from feedsim.estimation.replay.drive import DriveFound, identify_drive, implausible
from feedsim.estimation.replay.machine_files import (
    RINGS,
    CoupledShape,
    ElasticMode,
    RigidAxis,
    control_cycle,
    drive_file,
    drive_text,
    friction_axis_text,
    friction_file,
    machine_files,
    simple_drive,
)
from feedsim.estimation.replay.moving_lines import DIES_AWAY, Line, remove_parabola, without_outside
from feedsim.estimation.replay.tuning import decision, with_either
from feedsim.files.trace.trace import Array
from feedsim.foundation.errors import Finding, InputError
from feedsim.foundation.outputs import TemporaryFolder
from feedsim.foundation.parallel import in_parallel
from feedsim.scenario import Drive, Friction, Machine, load_machine
from feedsim.structure import checked_modes
from feedsim.structure.modes import table_of_modes

# --- Axes that move one another: a mode of one axis that is seen at the scale of another one, out of records ----------
# An axis that stands still while another one moves shows it: what its position does there follows the mode, whose
# frequency and damping the moving axis has determined. The units are run with a trial shape b of mode k at the scale
# of
# the axis at rest, and without. The difference d_k is what that shape does, its own drive included, and is linear in
# b:
#     x_recorded - x_simulated = sum_k b_k d_k                              rows in which B stands still and A moves
# A shape is kept where the first half of these rows predicts the second one, the second the first, and where its
# interval
# excludes 0. The mode itself is known to intervals only: a mode that turns its motor less is driven less, and needs a
# larger shape. So the interval includes what the shape would be with every value of the mode off by its own
# deviation.


Rows = NDArray[np.int64]

TRIAL_SHAPE = 0.05  # shape of the trial, of the rigid motion of the axis that the mode is of
FEWEST_ROWS = 50  # at rest while another axis moves
PREDICTED_VARIANCE_SHARE = 0.8  # share of the variance of one half that a fit to the other half may leave
STRETCHES = 8  # of these rows, each of which is left out once


def fit_coupled_shapes(
    machine: Machine,
    records: Mapping[str, AxisRecord],
    fmus: Path | None = None,
    spread: Mapping[int, Sequence[float]] | None = None,
) -> dict[tuple[int, str], CoupledShape]:
    """Shapes that modes of one axis have at the scale of another one.

    Args:
        machine: with the modes of its axes; each of them moves one axis. records: axis -> its record, all over the same
            time.
        spread: row of the table -> standard deviations of frequency [Hz], damping, and shapes at motor and scale over
            the rigid motion; None: modes are known.

    Returns: (row of the table of modes, axis at rest) -> the shape over the rigid motion of the axis that the mode is
        of, where the record shows one.
    """
    table = checked_modes(machine)
    modes = {axis: np.flatnonzero(~table.rigid & (table.ports[f"n_{axis}"] != 0)) for axis in records}
    result: dict[tuple[int, str], CoupledShape] = {}
    plain = None
    with Replay(machine, records, fmus=fmus) as replay:
        for mover, own in modes.items():
            for still, axis_record in records.items():
                stretches = _at_rest(axis_record, records[mover]) if still != mover and len(own) else []
                if sum(map(len, stretches)) < FEWEST_ROWS:
                    continue
                if plain is None:
                    plain = replay.follow(machine, ("x_a",))
                plain_x = plain[still]["x_a"]
                remaining = axis_record.position - plain_x
                D, e = (
                    np.concatenate([remove_parabola(signal, rows) for rows in stretches])
                    for signal in (
                        np.column_stack([_shape_response(replay, machine, int(k), mover, still, plain_x) for k in own]),
                        remaining,
                    )
                )
                for column, (k, shape) in enumerate(zip(own, _shapes(D, e), strict=True)):
                    if shape is None:
                        continue
                    moved = []
                    for changed in _vary_mode(machine, int(k), mover, (spread or {}).get(int(k), ())):
                        alone = _shape_response(replay, changed, int(k), mover, still, plain_x)[:, None]
                        other = np.concatenate([remove_parabola(alone, rows) for rows in stretches])
                        anew = np.column_stack([D[:, :column], other, D[:, column + 1 :]])
                        moved.append(float(np.linalg.lstsq(anew, e, rcond=1e-9)[0][column]) - shape[0])
                    result[int(k), still] = CoupledShape(still, shape[0], hypot(shape[1], *moved))
    return result


def _at_rest(axis_record: AxisRecord, mover: AxisRecord) -> list[Rows]:
    """Stretches of rows in which an axis stands still and has died away, while another one moves or swings."""
    h = axis_record.record.interval
    own, other = (replace(one, rows=np.ones_like(one.rows)).moving for one in (axis_record, mover))
    count = len(own)
    own = np.convolve(own, np.ones(round(DIES_AWAY / h) + 1))[:count] > 0.5
    other = np.convolve(other, np.ones(round(RINGS / h) + 1))[:count] > 0.5
    rows = np.flatnonzero(~own & other)
    parts = np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1)
    return [part for part in parts if len(part) >= FEWEST_ROWS]


def _shape_response(replay: Replay, machine: Machine, k: int, mover: str, still: str, plain: Array) -> Array:
    """(N,) position of `still` [m] that a shape of 1 of the k-th mode of `mover` makes. plain: (N,) without one [m]."""
    tried = replay.follow(_with_trial(machine, k, mover, still), ("x_a",))[still]["x_a"]
    return np.asarray((tried - plain) / TRIAL_SHAPE)


def _with_trial(machine: Machine, k: int, mover: str, still: str) -> Machine:
    """The machine whose k-th mode moves the scale of `still` by TRIAL of the rigid motion of `mover`."""
    table = checked_modes(machine)
    size = TRIAL_SHAPE * float(np.max(np.abs(table.ports[f"x_{mover}"][table.rigid])))
    ports = {port: np.array(column) for port, column in table.ports.items()}
    ports[f"x_{still}"][k] += size
    return machine.model_copy(update={"modes": table_of_modes(replace(table, ports=ports), machine.modes.file)})


def _vary_mode(machine: Machine, k: int, mover: str, spread: Sequence[float]) -> Iterator[Machine]:
    """The machine with each value of its k-th mode off by a standard deviation, in the order of `spread`."""
    table = checked_modes(machine)
    for which, sigma in enumerate(spread):
        frequency, damping = np.array(table.frequency), np.array(table.damping)
        ports = {port: np.array(column) for port, column in table.ports.items()}
        if which == 0:
            frequency[k] += sigma
        elif which == 1:
            damping[k] += sigma
        else:
            port = ports[f"{'nx'[which - 2]}_{mover}"]
            port[k] += sigma * np.max(np.abs(port[table.rigid]))
        off = replace(table, frequency=frequency, damping=damping, ports=ports)
        yield machine.model_copy(update={"modes": table_of_modes(off, machine.modes.file)})


def _shapes(D: Array, e: Array) -> list[tuple[float, float] | None]:
    """Shape and standard deviation of every column; None where the record does not show it.

    D: (N, K) what a shape of 1 does [m]. e: (N,) what is there [m].
    """
    nothing: list[tuple[float, float] | None] = [None] * D.shape[1]
    scale = np.linalg.norm(D, axis=0)
    if not np.all(scale > 0):
        return nothing
    half = len(e) // 2
    for own, other in ((slice(0, half), slice(half, None)), (slice(half, None), slice(0, half))):
        b = np.linalg.lstsq(D[own], e[own], rcond=1e-9)[0]
        if not rms(e[other] - D[other] @ b) ** 2 < PREDICTED_VARIANCE_SHARE * rms(e[other]) ** 2:
            return nothing
    b = np.linalg.lstsq(D, e, rcond=1e-9)[0]
    remaining = e - D @ b
    covariance = Covariance.of(D.T @ D).by(correlated_middle(D, remaining, 0.0, correlation_length))
    stretches = np.array_split(np.arange(len(e)), STRETCHES)
    sigma = np.sqrt(np.maximum(np.diag(covariance), between_groups(D, e, stretches)))
    return [
        (float(value), float(own)) if is_significant(float(value), half_width(float(own))) else None
        for value, own in zip(b, sigma, strict=True)
    ]


OF_MACHINE = "of the machine"


def _find_clipped_torque(axis: str, limit: float, share: float) -> Finding:
    """That the torque of so many rows [1] is the largest one [N.m] to the last digit."""
    remedy = "Record with a wider range, or drive more gently"
    return Finding(
        "record-clipped", "doubt",
        f"axis {axis}: the torque lies at {limit:.4g} N.m to the last digit in {100 * share:.2g} % of the rows, where "
        f"the range of the record or the drive ends; these rows are left out of the fit. {remedy}",
        axis, remedy,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class DrivesFound:
    """Drives of the axes of a record.

    drives: axis -> what was found. comparisons: each axis with it, beside its record. files: name -> text: a whole
    machine folder where none was known, else drive_A.yaml and friction_A.yaml of every axis. outside: axis -> lines
    from outside the axis, which were taken out of what was fitted. clipped: findings on torque that is cut off.
    limits: axis -> acceleration, jerk and speed of its setpoints, where they have moves from rest to rest.
    undecided_cycle: whether the record speaks for no cycle of the position loop, and nobody has given one. refused:
    axis -> why it has no drive.
    """

    drives: Mapping[str, DriveFound]
    comparisons: Sequence[Comparison]
    files: Mapping[str, str]
    outside: Mapping[str, Sequence[Line]] = field(default_factory=dict)
    clipped: Sequence[Finding] = ()
    undecided_cycle: bool = False
    refused: Mapping[str, str] = field(default_factory=dict)
    limits: Mapping[str, AxisLimits] = field(default_factory=dict)


def identify_drives(
    read: Mapping[str, RecordedAxis],
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
    begins: dict[str, FitStart | None] = {}
    limits_of_setpoints: dict[str, AxisLimits] = {}
    clipped: list[Finding] = []
    refusals = dict(refused or {})
    for axis, each in records.items():
        with _catch_refusal(axis, refusals):
            _refuse_implausible(each)
            J = _rigid_inertia(each, machine)
            whole, said = mark_clipped_rows(each, "the torque of these rows is left out of the fit", J)
            if whole.record.driven:
                marked, share = tied_at_limit(whole.record)
                whole = replace(whole, record=marked)
                if share and not said:
                    said = (_find_clipped_torque(axis, float(np.max(np.abs(marked.torque))), share),)
            own, lines = without_outside(whole, J)
            begins[axis] = _find_fit_start(own) if machine is None else None
            fitted[axis], outside[axis] = own, lines
            clipped += said
            with suppress(InputError):
                limits_of_setpoints[axis] = identify_axis_limits(
                    each.record.interval * np.arange(len(each.setpoint)), each.setpoint
                )
    interval = next(iter(records.values())).record.interval

    def drives(cycle: float) -> tuple[dict[str, DriveFound], dict[str, str]]:
        def drive(axis: str, say: Callable[..., None]) -> DriveFound | str:
            """Of one axis; or why it has none."""
            each, begin = fitted[axis], begins[axis]
            try:
                if machine is not None:
                    own = machine
                else:
                    assert begin is not None
                    begin = replace(begin, starts=[of_cycle(start, cycle, interval) for start in begin.starts])
                    axes = {axis: _starting_axis(each, begin.starts[0])}
                    own = _read_machine(machine_files(name, note, axes, interval, cycle))
                with Replay(own, {axis: each}, fmus=fmus, only_motion=modes == 0) as replay:
                    return identify_drive(
                        own, each, read[axis].records, replay, structure_known=machine is not None, begin=begin,
                        beside_cycle=_other_cycle(cycle, interval) if machine is None else None, modes=modes,
                        progress=lambda what, done, total: say(f"{axis}: {what}", done, total),
                    )  # fmt: skip
            except InputError as error:
                return str(error)

        done = dict(zip(fitted, in_parallel([partial(drive, axis) for axis in fitted], progress), strict=True))
        found = {axis: one for axis, one in done.items() if not isinstance(one, str)}
        return found, dict(refusals) | {axis: one for axis, one in done.items() if isinstance(one, str)}

    # A drive that closes the position loop itself (DSC) does so in its own cycle; a control, in that of its rows.
    cycle = position_cycle or control_cycle(interval)
    (found, failed), undecided = drives(cycle), False
    if not found:
        raise InputError.of("no drive is identified", dict.fromkeys(failed.values()))
    if position_cycle is None and machine is None and (speaks := _speaks_for_other(found)) >= 0:
        # Fits that begin with either cycle must agree on it.
        if speaks > 0 and _speaks_for_other((anew := drives(_other_cycle(cycle, interval)))[0]) < 0:
            cycle, (found, failed) = _other_cycle(cycle, interval), anew
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
                _rigid_axis(each, drive, values), estimates=one.estimates, head=head, modes=one.modes,
                correlation=one.correlation, setpoints=limits_of_setpoints.get(axis),
            )  # fmt: skip
    if rigid:
        files = machine_files(name, note, rigid, interval, cycle, control)
        own_modes = {axis: one.modes for axis, one in found.items()}
        beside = _couple_modes(files, own_modes, {axis: fitted[axis] for axis in found}, fmus)
        if any(modes != found[axis].modes for axis, modes in beside.items()):
            found = {axis: replace(one, modes=beside[axis]) for axis, one in found.items()}
            rigid = {axis: replace(each, modes=beside[axis]) for axis, each in rigid.items()}
            files = machine_files(name, note, rigid, interval, cycle, control)
    made = dict.fromkeys(found, _read_machine(files)) if rigid else {axis: one.machine for axis, one in found.items()}

    def comparison(axis: str, _: object) -> Comparison:
        return replace(replay_records(made[axis], {axis: records[axis]}, fmus, records)[axis], clipped=())

    comparisons = in_parallel([partial(comparison, axis) for axis in records if axis in found])
    return DrivesFound(found, comparisons, files, outside, clipped, undecided, failed, limits_of_setpoints)


@contextmanager
def _catch_refusal(axis: str, refused: dict[str, str]) -> Iterator[None]:
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


def _couple_modes(
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
        spread = {first + i: mode.sigma for i, mode in enumerate(every) if np.all(np.isfinite(mode.sigma))}
        shapes = fit_coupled_shapes(_read_machine(files), records, fmus, spread)
    found, k = {}, first
    for axis, own in modes.items():
        found[axis] = tuple(
            replace(mode, beside=tuple(shape for (row, _), shape in shapes.items() if row == k + i))
            for i, mode in enumerate(own)
        )
        k += len(own)
    return found


def _find_fit_start(each: AxisRecord) -> FitStart:
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


def _other_cycle(position_cycle: float, interval: float) -> float:
    """The other usual cycle of a position loop: of the interpolator in place of the drive's."""
    return interval if position_cycle < interval else control_cycle(interval)


def _read_machine(files: Mapping[str, str]) -> Machine:
    """The machine of these files, read as a user's would be. A message names them as what the record gives."""
    with TemporaryFolder() as folder:
        for file, text in files.items():
            (folder / file).write_text(text, encoding="utf-8")
        try:
            return load_machine(folder)
        except InputError as error:
            here = re.compile(rf"{re.escape(str(folder))}{re.escape(os.sep)}([\w.]+)(:\d+)?")
            raise InputError(here.sub(r"\1, as the record gives it", str(error))) from None


def _rigid_axis(each: AxisRecord, drive: Drive, values: Mapping[str, float]) -> RigidAxis:
    """An axis that has moved as the record has it. values: of the friction, J and M_0, SI."""
    return RigidAxis(2 * pi * each.I_P, float(each.setpoint[0]), limits(each), drive, values, {})


def _starting_axis(each: AxisRecord, begin: Mapping[str, float]) -> RigidAxis:
    """An axis to begin on. begin: as start_values gives them."""
    drive = simple_drive(begin, limits(each)["torque"])
    return _rigid_axis(each, drive, {**begin, "F_S": begin["F_C"] + begin[EXCESS]})


def friction_of(found: DriveFound, axis: str) -> dict[str, float]:
    """The parameters of an axis's friction."""
    friction = found.machine.shipped_friction(axis, "a friction file")
    return {name: float(getattr(friction, name)) for name in Friction.model_fields if name != "identified"}
