"""Structure and drives of all axes as one linear sampled system, friction off: its frequency responses in closed form.

Two rates. At the control cycle T_c everything but the position controllers is linear and time-invariant; eliminating
the motor torques leaves a matrix of the size of the axes. The position controllers see every m-th sample and answer
with a sequence of m ticks: a periodic system, whose response to exp(s t) has components at s_l = s + 2 pi i l/T_pos,
l = 0 ... m - 1. What a position controller samples is the sum of the components; what it gives has the component
ramp(s_l) times its answer at s_l. Both together are a second elimination of the size of the axes. This is the response
of the system lifted over one position cycle, without forming its states; reported is the component at s itself, which
is what a spectral estimate at the excitation's frequency finds. At whole multiples of 1/(2 T_pos) components of a real
sinusoid and of its mirror image meet; what is measured there depends on the phase against the position cycle.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Literal, Self

import numpy as np
from numpy.typing import NDArray

from feedsim.files.trace.response import FrequencyResponse, quotient_unit
from feedsim.foundation.errors import InputError
from feedsim.linear.plant import TOOL_DIRECTIONS, Complexes, Floats, InputHold, LinearDrive, ModalPlant, OperatingPoint
from feedsim.scenario import Machine
from feedsim.structure import Modes

# Which loops of an axis are closed: position and speed; speed alone (K_v = k_ffw = 0); none (the torque is an input).
ClosedLoop = Literal["position", "speed", "none"]

PORT_UNITS = {"M_add": "N.m", "M_a": "N.m", "n_add": "rad/s", "n_a": "rad/s", "n_s": "rad/s", "n_ffw": "rad/s"}
PORT_UNITS |= (
    {"x_s": "m", "x_a": "m"} | {f"F_{d}": "N" for d in TOOL_DIRECTIONS} | {f"x_{d}": "m" for d in TOOL_DIRECTIONS}
)

FAST_INPUTS = ("n_add", "M_add", "M_a")  # per axis, sampled every T_c
SLOW_INPUTS = ("x_s", "n_ffw")  # per axis, sampled every T_pos
OUTPUTS = ("n_a", "x_a", "M_a", "n_s")  # per axis
# Integrators and rigid modes are infinite where a component lies at 0 Hz: such frequencies are moved by this share.
SINGULAR_SHIFT = 1e-9
# Points of a grid; the fewer at which crossings are searched are asked for once.
KEPT_FROM = 500


class ResultCache:
    """The last results at grids of `least` values or more, by what they are of."""

    def __init__(self, most: int, least: int) -> None:
        self._most, self._min_size = most, least
        self._results: dict[tuple[Hashable, bytes], Complexes] = {}

    def __call__(self, of: Hashable, s: Complexes, compute: Callable[[Complexes], Complexes]) -> Complexes:
        """What ``compute`` gives at s (F,), read-only where it is kept."""
        if len(s) < self._min_size:
            return compute(s)
        key = (of, s.tobytes())
        values = self._results.pop(key, None)
        if values is None:
            values = compute(s)
            values.flags.writeable = False
        self._results[key] = values  # the last one used stands last
        if len(self._results) > self._most:
            del self._results[next(iter(self._results))]
        return values


@dataclass(frozen=True, eq=False)
class LinearSystem:
    """The coupled drives and structure of a machine, linear.

    Attributes:
        machine: drives, leads and cycles.
        modes: the structure.
        closed: which loops are closed, for all axes or per axis.
        tool_force: how the force on the tool runs: "linear" between control instants (as a unit with an input slope
            has it), "held" over the control cycle, or "continuous".
        operating: steady motion per axis about which the motor equations are linearised; at rest where not named.
        kept_from: frequencies of a grid from which on its responses are kept for the next one who asks.

    Inputs: "A.n_add", "A.M_add" (every T_c), "A.x_s", "A.n_ffw" (every T_pos), "A.M_a" (the motor torque itself, of an
    axis with closed "none"), "tool.F_d". Outputs, all at the control instants t_k: "A.n_a", "A.x_a", "A.M_a",
    "A.n_s" (excitation included), "tool.x_d". The torque of a drive with the ideal current loop jumps at t_k and is
    held: M_a is then the torque that begins at t_k.
    """

    machine: Machine
    modes: Modes
    closed: ClosedLoop | Mapping[str, ClosedLoop] = "position"
    tool_force: InputHold = "linear"
    operating: Mapping[str, OperatingPoint] | None = None
    kept_from: int = KEPT_FROM

    def closing(self, closed: ClosedLoop | Mapping[str, ClosedLoop]) -> Self:
        """The same system with other loops closed; axes that a mapping does not name stay as they are."""
        if isinstance(closed, str):
            loops = dict.fromkeys(self.axes, closed)
        else:
            loops = {axis: closed.get(axis, self.loops[axis]) for axis in self.axes}
        key = tuple(loops.values())
        if key not in self._closings:
            other = replace(self, closed=loops)
            # what does not depend on the loops is worked out once
            shared = ("plant", "drives", "_closings", "_responses", "_structure", "_levels", "_blocks")
            other.__dict__.update({name: getattr(self, name) for name in shared})
            self._closings[key] = other
        return self._closings[key]

    @cached_property
    def _closings(self) -> dict[tuple[ClosedLoop, ...], Self]:
        return {}

    # Many responses are asked for at the same few grids, axis after axis. Those of the structure and of the position
    # level are the dear ones, and small.
    @cached_property
    def _responses(self) -> ResultCache:
        return ResultCache(8, self.kept_from)

    @cached_property
    def _structure(self) -> ResultCache:
        return ResultCache(12, self.kept_from)

    @cached_property
    def _levels(self) -> ResultCache:
        return ResultCache(12, self.kept_from)

    @cached_property
    def _blocks(self) -> ResultCache:
        return ResultCache(16, self.kept_from * self.drives[0].ticks)  # of the components of such a grid

    @cached_property
    def axes(self) -> tuple[str, ...]:
        return tuple(self.machine.axes)

    @cached_property
    def loops(self) -> dict[str, ClosedLoop]:
        """What is closed, per axis."""
        if isinstance(self.closed, str):
            return dict.fromkeys(self.axes, self.closed)
        return {axis: self.closed.get(axis, "position") for axis in self.axes}

    @cached_property
    def plant(self) -> ModalPlant:
        return ModalPlant.of(self.modes, self.axes)

    @cached_property
    def drives(self) -> tuple[LinearDrive, ...]:
        operating = self.operating or {}
        return tuple(
            LinearDrive(
                self.machine.shipped_drive(name, "the linear model"),
                self.machine.cycles,
                axis.I_P,
                operating.get(name, OperatingPoint()),
            )
            for name, axis in self.machine.axes.items()
        )

    @cached_property
    def inputs(self) -> tuple[str, ...]:
        fast = [f"{axis}.{name}" for name in FAST_INPUTS for axis in self.axes]
        slow = [f"{axis}.{name}" for name in SLOW_INPUTS for axis in self.axes]
        return (*fast, *(f"tool.F_{d}" for d in TOOL_DIRECTIONS), *slow)

    @cached_property
    def outputs(self) -> tuple[str, ...]:
        n, x, M, n_s = ([f"{axis}.{name}" for axis in self.axes] for name in OUTPUTS)
        return (*n, *x, *(f"tool.x_{d}" for d in TOOL_DIRECTIONS), *M, *n_s)

    # --- responses ---------------------------------------------------------------------------------------------------

    def response(self, frequency: Floats, inputs: Sequence[str], outputs: Sequence[str]) -> FrequencyResponse:
        """Response of every output to every input alone, named "output/input".

        Args:
            frequency: (F,) [Hz], above 0 and up to 1/(2 T_c).

        Raises:
            InputError: an unknown name, a frequency out of range, the torque of an axis whose drive gives it as input.
        """
        matrix = self.at(self._s(frequency))
        columns, units = {}, {}
        for output in outputs:
            i = self._index(output, self.outputs, "output")
            for name in inputs:
                columns[f"{output}/{name}"] = matrix[:, i, self._input(name)]
                units[f"{output}/{name}"] = unit_of(output, name)
        return FrequencyResponse(np.asarray(frequency, dtype=np.float64), columns, units)

    def transfer(self, frequency: Floats, output: str, name: str) -> Complexes:
        """(F,) response of one output to one input alone, at frequencies in any order. Raises as :meth:`response`."""
        return self.transfers(frequency, output, (name,))[0]

    def transfers(self, frequency: Floats, output: str, names: Sequence[str]) -> list[Complexes]:
        """The same to each of several inputs alone."""
        rows = self.at(self._s(frequency))[:, self._index(output, self.outputs, "output")]
        return [np.asarray(rows[:, self._input(name)]) for name in names]

    def ratio(self, frequency: Floats, numerator: str, denominator: str, excitation: str) -> Complexes:
        """(F,) response of an output over that of another, both to one excitation: what H1 finds.

        Raises as :meth:`response`.
        """
        matrix = self.at(self._s(frequency))[:, :, self._input(excitation)]
        above, below = (self._index(name, self.outputs, "output") for name in (numerator, denominator))
        return np.asarray(matrix[:, above] / matrix[:, below])

    def at(self, s: Complexes) -> Complexes:
        """(F, outputs, inputs) response matrix at s (F,) [rad/s], rows and columns as in `outputs`, `inputs`."""
        return self._responses(("at", *self.loops.values()), s, self._at)

    def _at(self, s: Complexes) -> Complexes:
        axes = len(self.axes)
        fast = self.speed_level(s, self.tool_force)
        result = np.zeros((len(s), len(self.outputs), len(self.inputs)), dtype=np.complex128)
        result[:, :, : fast.shape[2]] = fast
        if all(loop != "position" for loop in self.loops.values()):
            return result
        slow = self.position_level(s)
        # what the position controllers compute at their instants, per input
        gains = self.position_gains
        answers = np.zeros((len(s), axes, len(self.inputs)), dtype=np.complex128)
        answers[:, :, : fast.shape[2]] = -gains[:, None] * self._measured(s, fast)
        for i, drive in enumerate(self.drives):
            column = fast.shape[2] + i
            answers[:, i, column] = gains[i] * drive.setpoint_delay(s)
            if self.loops[self.axes[i]] == "position":
                answers[:, i, column + axes] = drive.feedforward(s)
        solved = np.linalg.solve(np.eye(axes) + gains[:, None] * slow, answers)
        result += fast[:, :, :axes] @ (self._ramps(s)[:, :, None] * solved)
        return result

    # --- the two eliminations ----------------------------------------------------------------------------------------

    def speed_level(self, s: Complexes, tool_force: InputHold = "linear") -> Complexes:
        """(F, outputs, 3 A + 3): responses with every position loop open, to n_add, M_add, M_a and tool forces."""
        key = ("speed level", tool_force, *self._controlled_axes)
        return self._responses(key, s, partial(self._speed_level, tool_force))

    def _speed_level(self, tool_force: InputHold, s: Complexes) -> Complexes:
        axes = len(self.axes)
        ports = self.ports(s, tool_force)
        torques = self._torques(s, ports)
        result = np.zeros((len(s), len(self.outputs), torques.shape[2]), dtype=np.complex128)
        mechanical = ports.shape[1]
        result[:, :mechanical] = ports[:, :, :axes] @ torques
        result[:, :mechanical, 3 * axes :] += ports[:, :, axes:]
        result[:, mechanical : mechanical + axes] = torques
        values = np.arange(axes)
        result[:, mechanical + axes + values, values] = 1.0
        return result

    def _torques(self, s: Complexes, ports: Complexes, *, setpoints_alone: bool = False) -> Complexes:
        """(F, A, 3 A + 3): motor torques with every position loop open, to what speed_level() answers to; or (F, A, A),
        to n_add alone."""
        axes, values = len(self.axes), np.arange(len(self.axes))
        E, S, loop = self._loop(s, ports)
        inputs = axes if setpoints_alone else 3 * axes + len(TOOL_DIRECTIONS)
        given = np.zeros((len(s), axes, inputs), dtype=np.complex128)
        given[:, values, values] = E * S
        if not setpoints_alone:
            given[:, values, axes + values] = E
            given[:, values, 2 * axes + values] = ~self._controlled_axes
            given[:, :, 3 * axes :] = -loop[:, :, axes:]
        return np.asarray(np.linalg.solve(np.eye(axes) + loop[:, :, :axes], given))

    def torque_loop(self, s: Complexes, ports: Complexes) -> Complexes:
        """(F, A, A + 3): what the speed loops take off the motor torques per motor torque [1] and per tool force [m],
        with the structure's `ports`: E C n + G_n n_a; 0 for axes without control."""
        return self._loop(s, ports)[2]

    def _loop(self, s: Complexes, ports: Complexes) -> tuple[Complexes, Complexes, Complexes]:
        """E and S of the drives (F, A), 0 for axes without control, and the torque loop."""
        axes = len(self.axes)
        E, S = (np.zeros((len(s), axes), dtype=np.complex128) for _ in range(2))
        loop = np.zeros((len(s), axes, ports.shape[2]), dtype=np.complex128)
        for i in np.flatnonzero(self._controlled_axes):
            drive = self.drives[i]
            E[:, i], G_n, C, S[:, i] = self._blocks(("drive", int(i)), s, drive.blocks)
            V, n_a = drive.speed_of_position(s), ports[:, i]
            n = n_a if V is None else V[:, None] * drive.measured_position(s, n_a, ports[:, axes + i])
            loop[:, i] = (E[:, i] * C)[:, None] * n + G_n[:, None] * n_a
        return E, S, loop

    def position_level(self, s: Complexes) -> Complexes:
        """(F, A, A): what the position controllers sample of x_m per setpoint that they give, position loops open.

        The sum over all components that one answer of a controller has within the ticks of its cycle.
        """
        return self._levels(tuple(self._controlled_axes), s, self._position_level)

    def _position_level(self, s: Complexes) -> Complexes:
        axes, ticks = len(self.axes), self.drives[0].ticks
        components = (s[:, None] + 2j * np.pi * np.arange(ticks) / self.machine.cycles.T_pos).ravel()
        ports = self._structure("components", s, lambda _: self._ports(components, "linear", tool=False))
        torques = self._torques(components, ports, setpoints_alone=True)
        x_m = self._measured(components, ports) @ torques
        return np.asarray((x_m * self._ramps(components)[:, None, :]).reshape(len(s), ticks, axes, axes).sum(axis=1))

    def _measured(self, s: Complexes, rows: Complexes) -> Complexes:
        """(F, A, ...): measured positions, of rows n_a of all axes, x_a of all axes."""
        axes = len(self.axes)
        if not any(drive.drive.indirect for drive in self.drives):
            return rows[:, axes : 2 * axes]
        entry = [drive.measured_position(s, rows[:, i], rows[:, axes + i]) for i, drive in enumerate(self.drives)]
        return np.stack(entry, axis=1)

    def _ramps(self, s: Complexes) -> Complexes:
        """(F, A): the ramps of the axes' setpoints."""
        return self._blocks("ramps", s, self._ramps_at)

    def _ramps_at(self, s: Complexes) -> Complexes:
        """Of which there are two kinds."""
        kinds = {drive.drive.ramp_speed_setpoint: drive for drive in self.drives}
        ramps = {kind: drive.ramp(s) for kind, drive in kinds.items()}
        return np.stack([ramps[drive.drive.ramp_speed_setpoint] for drive in self.drives], axis=1)

    def ports(self, s: Complexes, tool_force: InputHold = "linear") -> Complexes:
        """(F, 2 A + 3, A + 3): port matrix of the structure with every input running as it does."""
        return self._structure(tool_force, s, partial(self._ports, tool_force=tool_force))

    def _ports(self, s: Complexes, tool_force: InputHold, *, tool: bool = True) -> Complexes:
        axes, T_c = len(self.axes), self.machine.cycles.T_c
        ports = self.plant.ports(s, T_c, "linear", tool=tool)
        if self._ideal.any():
            fixed = self.plant.ports(s, T_c, "held", tool=tool)
            ports[:, :, :axes][:, :, self._ideal] = fixed[:, :, :axes][:, :, self._ideal]
        if tool_force != "linear":
            ports[:, :, axes:] = self.plant.ports(s, T_c, tool_force)[:, :, axes:]
        return ports

    @cached_property
    def _ideal(self) -> NDArray[np.bool_]:
        """(A,) whose torque is held: drives with the ideal current loop."""
        return np.array([drive.drive.ideal_current_loop for drive in self.drives])

    @cached_property
    def _controlled_axes(self) -> NDArray[np.bool_]:
        return np.array([loop != "none" for loop in self.loops.values()])

    @cached_property
    def position_gains(self) -> Floats:
        """(A,) K_v/I_P [rad/(s.m)] of the position loops, 0 where they are open."""
        closed = np.array([loop == "position" for loop in self.loops.values()])
        return np.where(closed, [drive.position_gain for drive in self.drives], 0.0)

    # --- names -------------------------------------------------------------------------------------------------------

    def _index(self, name: str, known: Sequence[str], kind: str) -> int:
        if name not in known:
            raise InputError(f"linear system: no {kind} '{name}'; there are {', '.join(known)}")
        return known.index(name)

    def _input(self, name: str) -> int:
        index = self._index(name, self.inputs, "input")
        axis, _, quantity = name.partition(".")
        if axis in self.loops:
            loop = self.loops[axis]
            if (quantity == "M_a") != (loop == "none"):
                what = "is given by its drive" if quantity == "M_a" else "belongs to a drive that is switched off"
                raise InputError(f"linear system: '{name}' {what}: closed is '{loop}' for axis {axis}")
        return index

    def _s(self, frequency: Floats) -> Complexes:
        f = np.asarray(frequency, dtype=np.float64)
        cycles = self.machine.cycles
        highest = 0.5 / cycles.T_c
        wrong = f[~((f > 0) & (f <= highest * (1 + SINGULAR_SHIFT)))]
        if f.ndim != 1 or wrong.size:
            text = f"{wrong[0]:.6g} Hz" if f.ndim == 1 else f"an array of shape {f.shape}"
            raise InputError(f"linear system: frequency {text}; allowed are values above 0 up to {highest:.6g} Hz")
        turns = f * cycles.T_pos
        meets = np.abs(turns - np.round(turns)) < SINGULAR_SHIFT * np.round(turns)
        return np.asarray(2j * np.pi * np.where(meets, f * (1 - SINGULAR_SHIFT), f))


def unit_of(output: str, name: str) -> str:
    """Unit of the response of `output` to `name`, such as "(rad/s)/(N.m)"; "1" where both have the same."""
    return quotient_unit(*(PORT_UNITS[entry.partition(".")[2]] for entry in (output, name)))
