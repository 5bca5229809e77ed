"""Whether the loops of a machine are stable, with what margins, and at which gains they would be: quickly.

The same closed form as in system.py, on few frequencies. Growing solutions are counted as in stability.py, of the speed
loops with every position loop open and of the position loops over them. With everything else as it is, the determinant
of a level is a straight line in the gain of one loop, D_0 + k (D_1 - D_0): its open-loop gain is L = D_1/D_0 - 1, and
the count for a gain k times the present one follows from how often 1 + k L winds around 0.

Friction makes two linear systems of a machine. Where an axis slides, its friction hardly depends on the speed: it is
left out. Where it sticks, the bristles are a spring and a damper at the motor (Eqs. 1 to 6 linearised about z = 0,
n = 0, c = 0): M_fr = (1 + gamma)/2 sigma_0 (angle) + (sigma_1 + sigma_2) n, the first factor 1 where W = 0.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from feedsim.foundation.errors import InputError
from feedsim.linear.loops import GROWTH, MAX_PHASE_STEP
from feedsim.linear.plant import CHUNK, Complexes, Floats, InputHold, LinearDrive, ModalPlant, modal_sums
from feedsim.scenario import Cycles, Drive, Friction, FrictionParameters, Machine
from feedsim.structure import Modes

# "For satisfactory performance, the phase margin should be between 30 deg and 60 deg, and the gain margin should be
# greater than 6 dB": K. Ogata, Modern Control Engineering, 5th edition, section 7-7.
GAIN_MARGIN = 10 ** (6 / 20)
PHASE_MARGIN = 30.0  # [deg]

Kind = Literal["speed", "position"]
State = Literal["moving", "at rest"]
STATES: tuple[State, State] = ("moving", "at rest")
FREQUENCY_STEP = 0.05  # relative step of the frequencies between resonances; drives and delays are smooth
# Points about a resonance, in its half widths: a circle is a polygon of these.
RESONANCE_POINTS = np.array([-5.0, -2.4, -1.3, -0.7, -0.3, 0.0, 0.3, 0.7, 1.3, 2.4, 5.0])
NOTICEABLE_GAIN = 0.03  # of an open-loop gain: a resonance that adds less at its peak is not looked at closely
# Factors on a gain within which a stable loop has its limits, and those that are tried for one that is not or hardly,
# since a unit left out may be 1000. A step is 1.2 %.
GAIN_FACTOR_RANGE = 1e-2, 1e2
GAINS = np.geomspace(1e-6, 1e6, 2401)
SMALLEST_GAIN = np.finfo(np.float64).tiny  # a loop without gain is no reason to take the logarithm of 0
# Components either side of 0 Hz that a position loop is the sum of. Further ones are (f/(2/T_pos - f))^3 times smaller:
# 1 % of the gain at 0.35/T_pos, where a position loop has none left.
IMAGE_COUNT = 1
# Where an open-loop gain, or one CRITICAL_RATIO times larger or smaller, passes -1 within CRITICAL_SECTOR [rad], it is
# followed in steps of CRITICAL_STEP: limits and margins lie there.
CRITICAL_SECTOR, CRITICAL_RATIO, CRITICAL_STEP = 1.0, 8.0, 0.2
MAX_HALVINGS = 12  # of halving steps at most
PHASE_ROUNDING = 1e-3  # [rad] from -180 degrees: as much of a phase is rounding, at half the sampling rate


@dataclass(frozen=True)
class Loop:
    """A loop of an axis in one state of its friction.

    Attributes:
        gain: K_p [N.m.s/rad] or K_v [1/s].
        growing: solutions that grow with all loops closed; with the position loops open, others may.
        unstable: whether this loop is the cause: with another gain fewer would grow (of a speed loop: with the position
            loops open).
        limit: the gain at which they begin or, of an unstable loop, end, nearest to the present one; None: none does.
        gain_margin: by which factor up or down the gain may change until they begin [1].
        phase_margin: least phase left to -180 degrees where the open-loop gain is 1 [deg]; 180 where it never is.
        advised: the nearest gain with GAIN_MARGIN and PHASE_MARGIN; None where no gain has.
    """

    axis: str
    kind: Kind
    state: State
    gain: float
    growing: int
    unstable: bool
    limit: float | None
    gain_margin: float
    phase_margin: float
    advised: float | None

    @property
    def thin(self) -> bool:
        """Whether it is stable with less than the usual margins."""
        return not self.unstable and (self.gain_margin < GAIN_MARGIN or self.phase_margin < PHASE_MARGIN)


def judge(machine: Machine, modes: Modes) -> tuple[Loop, ...]:
    """Speed and position loops of every axis with the shipped drive, in both states; other motors are without torque.

    The friction of another maker is left out at rest as well: what it does there is not known.
    """
    axes = {name: axis for name, axis in machine.axes.items() if isinstance(axis.drive, Drive)}
    if not axes:
        return ()
    frictions = machine.shipped_frictions
    bristles = tuple(Bristles.of(frictions[name]) if name in frictions else None for name in axes)
    driven = tuple(
        (name, axis.drive.model_copy(update=dict.fromkeys(OUTSIDE_LOOPS)), axis.I_P)
        for name, axis in axes.items()
        if isinstance(axis.drive, Drive)
    )
    return _judged_axes(driven, bristles, machine.cycles, modes)


def locked_modes(machine: Machine, modes: Modes) -> tuple[Floats, Floats, Floats]:
    """Modes of a machine of shipped drives with its motors held: frequency (N,) [rad/s], damping ratio (N,), and the
    peak of each in an open-loop gain (N,) per K_v [s]."""
    drives = tuple(LinearDrive(machine.shipped_drive(name, "a page"), machine.cycles, axis.I_P)
                   for name, axis in machine.axes.items())  # fmt: skip
    axes = tuple(machine.axes)
    return SampledAxes(axes, drives, (None,) * len(axes), _plant(modes, axes)).locked_modes()


class Bristles(NamedTuple):
    """All that the loops know of an axis's friction: stiffness [N.m/rad] and dampings [N.m.s/rad] where it sticks."""

    stiffness: float
    sigma_1: float
    sigma_2: float

    @classmethod
    def of(cls, friction: FrictionParameters) -> Bristles:
        # of generalised Maxwell slip all elements stick
        k = 0.5 * (1 + friction.gamma) if isinstance(friction, Friction) and friction.W > 0 else 1.0
        return cls(k * friction.sigma_0, friction.sigma_1, friction.sigma_2)


# Most of the time of a short run; in a study many runs have the same loops, whatever else differs.
@lru_cache(maxsize=8)
def _judged_axes(
    driven: tuple[tuple[str, Drive, float], ...], bristles: tuple[Bristles | None, ...], cycles: Cycles, modes: Modes
) -> tuple[Loop, ...]:
    """`driven`: name, drive and I_P of the axes judged; `bristles`: what holds each at rest, where that is known."""
    axes = tuple(name for name, _, _ in driven)
    drives = tuple(LinearDrive(drive, cycles, I_P) for _, drive, I_P in driven)
    return SampledAxes(axes, drives, bristles, _plant(modes, axes)).judged()


# --- What machines that differ in a few values have in common: thousands of a study, drives that are tried in turn ----
# Each answer is that of the contour as a whole: to the same bits, whichever machine was the first to need it.


# Of a drive, what its loops do not see, and what each block of them does.
OUTSIDE_LOOPS = (
    "k_ffw", "T_dyn", "T_sym", "symmetry_lag", "setpoint_resolution", "M_max", "u_max", "encoder", "measuring_table",
    "cogging_1", "cogging_2", "cogging_3", "ripple_1", "ripple_2", "ripple_3", "periodic_error_1", "periodic_error_2",
    "periodic_error_3", "backlash_compensation", "leadscrew_compensation", "leadscrew_compensation_minus",
    "friction_pulse", "friction_table",
)  # fmt: skip
FILTERS = ("filter_1", "filter_2", "filter_3", "filter_4")
MOTOR = ("current", "R", "L_d", "L_q", "p", "K_t", "ideal_current_loop")  # what the current loop consists of
SPEED_CONTROLLER = ("K_p", "speed_integrator", "T_n")
SEEN_FIELDS: Mapping[str, tuple[str, ...]] = {
    "torque": (*MOTOR, *FILTERS),
    "ramp": ("ramp_speed_setpoint",),
    "from_speed": SPEED_CONTROLLER,
    "from_setpoint": (*SPEED_CONTROLLER, "reference_model", "omega_0", "D", "T_ref"),
}
# Contours of both levels, in both holds, of a few structures, and the short ones in between that are refined. Longer
# ones are forgotten: of 5000 modes or 12 axes, whose answers would take hundreds of MB.
KNOWN_PORTS, KNOWN_BLOCKS = 16, 256
MAX_KNOWN_VALUES = 1 << 16  # of s, times the squared number of axes


@lru_cache(maxsize=8)
def _plant(modes: Modes, axes: tuple[str, ...]) -> ModalPlant:
    return ModalPlant.of(modes, axes)


@lru_cache(maxsize=KNOWN_PORTS)
def _ports(plant: ModalPlant, T_c: float, hold: InputHold, contour: bytes) -> tuple[Complexes, Complexes]:
    """(C, A, A) speeds and positions of the axes per torque, at the values of s that `contour` holds."""
    s, A = np.frombuffer(contour, dtype=np.complex128), plant.rotor.shape[1]
    speeds = (plant.rotor[:, :, None] * plant.rotor[:, None]).reshape(-1, A * A)
    places = (plant.scale[:, :, None] * plant.rotor[:, None]).reshape(-1, A * A)
    n, x = (np.empty((len(s), A * A), dtype=np.complex128) for _ in range(2))
    for start in range(0, len(s), CHUNK):
        part = slice(start, start + CHUNK)
        q, v = plant.modal(s[part], T_c, hold)
        n[part], x[part] = modal_sums(v, speeds), modal_sums(q, places)
    return n.reshape(-1, A, A), x.reshape(-1, A, A)


@lru_cache(maxsize=KNOWN_BLOCKS)
def _block(name: str, seen: tuple[Any, ...], cycles: Cycles, contour: bytes) -> Any:
    """A block of drives with these values of what it sees (SEEN_FIELDS)."""
    drive = Drive.model_construct(**dict(zip(SEEN_FIELDS[name], seen, strict=True)))
    return getattr(LinearDrive(drive, cycles, math.nan), name)(np.frombuffer(contour, dtype=np.complex128))


@lru_cache(maxsize=8)
def _locked_modes(plant: ModalPlant, leads: tuple[float, ...]) -> tuple[Floats, Floats, Floats]:
    """As :meth:`SampledAxes.locked_modes`, of axes with leads I_P [m/rad]."""
    A = len(leads)
    stiffness = plant.omega_0**2
    null = np.linalg.qr(plant.rotor, mode="complete")[0][:, A:]
    squares, shapes = np.linalg.eigh(null.T @ (stiffness[:, None] * null))
    elastic = squares > (2 * np.pi) ** 2
    shapes, omega = null @ shapes[:, elastic], np.sqrt(squares[elastic])
    damping = (shapes**2).T @ plant.damping
    moved = np.abs(shapes.T @ (stiffness[:, None] * np.linalg.pinv(plant.rotor).T)).max(axis=1)
    seen = (np.abs(shapes.T @ plant.scale) / leads).max(axis=1)
    return omega, damping, seen * moved / np.maximum(2 * damping * omega, GROWTH) / omega**2


def _judge_loop(
    axis: str, kind: Kind, state: State, gain: float, L: Complexes, growing: int, closed: int, inner: int
) -> Loop:
    """What the open-loop gain L (F,) along half the contour shows of a loop.

    growing: solutions that grow with it closed; closed: with all loops closed; inner: in the loops below it alone.
    """
    limits = _limits(L, GAIN_FACTOR_RANGE)
    gain_margin, phase_margin = _gain_margin(limits, 1.0), _phase_margin(L, 1.0)
    if not growing and gain_margin >= GAIN_MARGIN and phase_margin >= PHASE_MARGIN:
        limit = gain * float(min(limits, key=_log_distance)) if limits.size else None
        return Loop(axis, kind, state, gain, closed, False, limit, gain_margin, phase_margin, gain)
    # between two limits, of all gains that are tried, the number of growing solutions is the same
    limits = _limits(L, (GAINS[0], GAINS[-1]))
    ends = np.concatenate([[GAINS[0]], limits, [GAINS[-1]]])
    winds = _windings(1 + L)
    counts = np.array([growing + winds - _windings(1 + k * L) for k in np.sqrt(ends[1:] * ends[:-1])])
    least = min(counts.min(), growing + winds)  # the latter without any gain
    fewest = counts == least
    unstable = bool(growing > least) and not inner
    if growing and not unstable:  # another loop is the cause, and margins say nothing
        return Loop(axis, kind, state, gain, closed, False, None, math.inf, 180.0, None)
    good = [k for k in sorted(GAINS, key=_log_distance) if fewest[np.searchsorted(limits, k)]]
    limit = min((limits if not unstable else _edges(ends, fewest)), key=_log_distance, default=None)
    advised = next(
        (k for k in good if _gain_margin(limits, k) >= GAIN_MARGIN and _phase_margin(L, k) >= PHASE_MARGIN), None
    )
    limit, advised = (None if factor is None else gain * float(factor) for factor in (limit, advised))
    return Loop(axis, kind, state, gain, closed, unstable, limit, gain_margin, phase_margin, advised)


def _log_distance(factor: float) -> float:
    return abs(math.log(factor))


def _edges(ends: Floats, inside: NDArray[np.bool_]) -> list[float]:
    """Where the intervals between `ends` begin and end that are `inside`, but for the outermost ends."""
    return [float(ends[k]) for k in range(1, len(ends) - 1) if inside[k - 1] != inside[k]]


def _limits(L: Complexes, within: tuple[float, float]) -> Floats:
    """Factors on an open-loop gain (F,), ascending, that take it through -1, between two."""
    angle, size = np.angle(-L), np.log(np.maximum(np.abs(L), SMALLEST_GAIN))
    turn = np.diff(angle)
    through = np.flatnonzero((np.signbit(angle[1:]) != np.signbit(angle[:-1])) & (np.abs(turn) < np.pi))
    share = -angle[through] / turn[through]
    factors = np.exp(-(size[through] + share * np.diff(size)[through]))
    if abs(angle[-1]) < PHASE_ROUNDING:  # half the sampling rate: the mirror image of the contour meets it there
        factors = np.append(factors, np.exp(-size[-1]))
    return np.sort(factors[(factors > within[0]) & (factors < within[1])])


def _gain_margin(limits: Floats, factor: float) -> float:
    return float(np.exp(np.abs(np.log(limits / factor)).min())) if limits.size else math.inf


def _phase_margin(L: Complexes, factor: float) -> float:
    angle, size = np.angle(-L), np.log(np.maximum(np.abs(L) * factor, SMALLEST_GAIN))
    through = np.flatnonzero((size[1:] < 0) != (size[:-1] < 0))
    if not through.size:
        return 180.0
    share = size[through] / (size[through] - size[through + 1])
    turned = np.angle(L[through + 1] / L[through])
    return float(np.degrees(np.abs((angle[through] + share * turned + np.pi) % (2 * np.pi) - np.pi).min()))


def _windings(values: Complexes) -> int:
    """How often values (F,) along half the contour, whose other half is the mirror image, wind around 0."""
    return round(float(np.angle(values[1:] / values[:-1]).sum()) / np.pi)


@dataclass(frozen=True, eq=False)
class SampledAxes:
    """The axes that are judged, and what their loops consist of.

    near: frequencies [Hz] about the resonances, free and with the motors held; None: those that show with these drives.
    """

    axes: tuple[str, ...]
    drives: tuple[LinearDrive, ...]
    bristles: tuple[Bristles | None, ...]
    plant: ModalPlant
    near: tuple[Floats, Floats] | None = None

    def judged(self, axes: Sequence[int] | None = None) -> tuple[Loop, ...]:
        """All loops in all states; axes: indices of those asked for."""
        return self.judged_with_levels(axes)[0]

    def judged_with_levels(self, axes: Sequence[int] | None = None) -> tuple[tuple[Loop, ...], Floats, Complexes]:
        """The same, with the frequencies (F,) [Hz] of the speed loops and their determinants (2, 1 + asked, F)."""
        asked = tuple(range(len(self.axes))) if axes is None else tuple(axes)
        cycles = self.drives[0].cycles
        free, locked = self.near or self.resonances()
        frequency, speed = self._sample_contour(
            partial(self._speed_level, asked), self._frequencies(0.5 / cycles.T_c, free)
        )
        _, position = self._sample_contour(
            partial(self._position_level, asked), self._frequencies(0.5 / cycles.T_pos, locked)
        )
        loops: list[Loop] = []
        kind: Kind
        for k, state in enumerate(STATES):
            of_speed = -_windings(speed[k, 0])
            closed = of_speed - _windings(position[k, 0])
            for j, i in enumerate(asked):
                axis, drive = self.axes[i], self.drives[i]
                for kind, level, gain, growing, inner in (
                    ("speed", speed[k], drive.drive.K_p, of_speed, 0),
                    ("position", position[k], drive.drive.K_v, closed, of_speed),
                ):
                    if gain > 0:
                        L = level[0] / level[1 + j] - 1
                        loops.append(_judge_loop(axis, kind, state, gain, L, growing, closed, inner))
        return tuple(loops), frequency, speed

    def _sample_contour(self, level: Callable[[Complexes], Complexes], frequency: Floats) -> tuple[Floats, Complexes]:
        """Half of a level's contour [Hz] and its determinants there (2, 1 + asked, F), close enough together that none
        jumps."""
        with np.errstate(over="ignore", invalid="ignore"):
            values = level(_s(frequency))
        if not np.isfinite(values).all():
            pairs = zip(self.axes, self.drives, strict=True)
            gains = ", ".join(f"axis {axis}: {drive.drive.K_p:.3g}" for axis, drive in pairs)
            raise InputError(f"the loops are beyond all numbers that a computer has; K_p [N.m.s/rad], {gains}")
        for _ in range(MAX_HALVINGS):
            turns = np.abs(np.angle(values[..., 1:] / values[..., :-1])).max(axis=(0, 1))
            L = values[:, :1] / values[:, 1:] - 1
            size = np.abs(L)
            counts = (np.abs(np.angle(-L)) < CRITICAL_SECTOR) & (size > 1 / CRITICAL_RATIO) & (size < CRITICAL_RATIO)
            changes = np.abs(np.diff(L)) > CRITICAL_STEP * size[..., 1:]
            reported = (changes & (counts[..., 1:] | counts[..., :-1])).any(axis=(0, 1))
            wide = np.flatnonzero((turns > MAX_PHASE_STEP) | reported)
            if not wide.size:
                break
            between = 0.5 * (frequency[wide] + frequency[wide + 1])
            values = np.insert(values, wide + 1, level(_s(between)), axis=2)
            frequency = np.insert(frequency, wide + 1, between)
        return frequency, values

    def _frequencies(self, highest: float, near: Floats) -> Floats:
        """Frequencies to begin with [Hz], 0, `highest` and points about resonances included."""
        slow = np.geomspace(GROWTH * 1e-2, 1.0, 30, endpoint=False)  # around the integrators
        fast = np.geomspace(1.0, highest, math.ceil(math.log(highest) / FREQUENCY_STEP))
        return np.unique(np.concatenate([[0.0], slow, fast, near[(near > 0) & (near < highest)]]))

    def resonances(self) -> tuple[Floats, Floats]:
        """Frequencies [Hz] about the modes that show in the speed loops: K_p n/M is n^2 K_p/(2 D omega) at the peak;
        and about those that show in the position loops."""
        plant, elastic = self.plant, self.plant.omega_0 > 0
        seen = np.maximum(np.abs(plant.rotor), np.abs(plant.scale) / self._leads)[elastic].max(axis=1)
        driven = (np.abs(plant.rotor[elastic]) * [drive.drive.K_p for drive in self.drives]).max(axis=1)
        omega, damping = plant.omega_0[elastic], plant.damping[elastic]
        free = _frequencies_about(omega, damping, seen * driven / np.maximum(2 * damping * omega, GROWTH))
        omega, damping, peak = self.locked_modes()
        return free, _frequencies_about(omega, damping, max(drive.drive.K_v for drive in self.drives) * peak)

    def locked_modes(self) -> tuple[Floats, Floats, Floats]:
        """Modes with the motors held, which stiff speed loops come close to: frequency (N,) [rad/s], damping ratio
        (N,), and its peak in an open-loop gain (N,) per K_v [s].

        With the motors' angles phi given, modal coordinates are q = R phi + N p, N the null space of the shapes at the
        rotors: p'' + N' Omega^2 N p = -N' Omega^2 R phi; the scales see p, and K_v/s makes phi of what they see.
        """
        return _locked_modes(self.plant, tuple(drive.I_P for drive in self.drives))

    @property
    def _leads(self) -> Floats:
        return np.array([drive.I_P for drive in self.drives])

    def _speed_level(self, asked: Sequence[int], s: Complexes) -> Complexes:
        """(2, 1 + asked, F) determinants of the speed loops, position loops open: all closed, and those of the axes
        asked for open in turn."""
        return np.stack([_determinants(loop, ports, asked) for _, loop, ports in self._speed_loops(s)])

    def _position_level(self, asked: Sequence[int], s: Complexes) -> Complexes:
        """(2, 1 + asked, F) the same of the position loops, speed loops closed."""
        A, m, T_pos = len(self.axes), self.drives[0].ticks, self.drives[0].cycles.T_pos
        components = range(-IMAGE_COUNT, IMAGE_COUNT + 1) if m > 2 * IMAGE_COUNT else range(m)
        every = (s[:, None] + 2j * np.pi * np.array(components) / T_pos).ravel()
        contour = every.tobytes()
        gains = np.array([drive.position_gain for drive in self.drives])
        answer = np.empty((len(every), A), dtype=np.complex128)
        for i, drive in enumerate(self.drives):
            torque, from_setpoint, ramp = (
                self._block(drive, name, contour) for name in ("torque", "from_setpoint", "ramp")
            )
            answer[:, i] = torque[0] * from_setpoint * ramp
        result = []
        for x, loop, _ in self._speed_loops(every):
            torques = np.linalg.solve(np.eye(A) + loop, np.eye(A) * answer[:, None])
            sampled = (x @ torques).reshape(len(s), len(components), A, A).sum(axis=1)
            result.append(_determinants(gains[:, None] * sampled, np.zeros_like(sampled), asked))
        return np.stack(result)

    def _speed_loops(self, s: Complexes) -> Iterator[tuple[Complexes, Complexes, Complexes]]:
        """Per state, (C, A, A) each: positions per torque, what the speed loops take off the torques, and what of that
        does not go through the speed controllers."""
        A, contour = len(self.axes), s.tobytes()
        n_M, x_M = n_fr, x_fr = self._ports("linear", contour)
        ideal = np.array([drive.drive.ideal_current_loop for drive in self.drives])
        if ideal.any():
            fixed = self._ports("held", contour)
            n_M, x_M = (np.asarray(np.where(ideal, h, linear)) for h, linear in zip(fixed, (n_M, x_M), strict=True))
        through, past = (np.empty((len(s), A, 1), dtype=np.complex128) for _ in range(2))
        for i, drive in enumerate(self.drives):
            E, past[:, i, 0] = self._block(drive, "torque", contour)
            through[:, i, 0] = E * self._block(drive, "from_speed", contour)
        windows = [drive.speed_of_position(s) for drive in self.drives]
        for state in STATES:
            n, x = n_M, x_M
            if state == "at rest":
                R = self._bristles(s)
                n = np.asarray(np.linalg.solve(np.eye(A) + n_fr * R[:, None], n_M))
                x = np.asarray(x_M - x_fr @ (R[:, :, None] * n))
            if any(drive.drive.indirect for drive in self.drives):
                entry = [drive.measured_position(s, n[:, i], x[:, i]) for i, drive in enumerate(self.drives)]
                x = np.stack(entry, axis=1)
            seen = n.copy()
            for i, V in enumerate(windows):
                if V is not None:
                    seen[:, i] = V[:, None] * x[:, i]
            yield x, through * seen + past * n, past * n

    def _ports(self, hold: InputHold, contour: bytes) -> tuple[Complexes, Complexes]:
        ports = _ports if self._is_known(contour) else _ports.__wrapped__
        return ports(self.plant, self.drives[0].cycles.T_c, hold, contour)

    def _block(self, drive: LinearDrive, name: str, contour: bytes) -> Any:
        block = _block if self._is_known(contour) else _block.__wrapped__
        seen = tuple(getattr(drive.drive, field) for field in SEEN_FIELDS[name])
        return block(name, seen, drive.cycles, contour)

    def _is_known(self, contour: bytes) -> bool:
        """Whether answers along it are remembered."""
        return len(contour) // 16 * len(self.axes) ** 2 <= MAX_KNOWN_VALUES

    def _bristles(self, s: Complexes) -> Complexes:
        """(C, A) friction torque at rest per speed [N.m.s/rad], sampled: the angle by the trapezoidal rule."""
        T_c = self.drives[0].cycles.T_c
        angle = 0.5 * T_c * (np.exp(s * T_c) + 1) / np.expm1(s * T_c)
        values = np.zeros((len(s), len(self.axes)), dtype=np.complex128)
        for i, value in enumerate(self.bristles):
            if value is not None:
                values[:, i] = value.stiffness * angle + value.sigma_1 + value.sigma_2
        return values


def _s(frequency: Floats) -> Complexes:
    return np.asarray(GROWTH + 2j * np.pi * frequency)


def _frequencies_about(omega: Floats, damping: Floats, peak: Floats) -> Floats:
    """Frequencies [Hz] about those of the resonances at omega [rad/s] whose `peak` in an open-loop gain shows."""
    shows = peak > NOTICEABLE_GAIN
    width = np.maximum(damping[shows] * omega[shows], GROWTH)
    return np.asarray((omega[shows, None] + width[:, None] * RESONANCE_POINTS).ravel() / (2 * np.pi))


def _determinants(loop: Complexes, opened: Complexes, rows: Sequence[int]) -> Complexes:
    """(1 + rows, C) determinants of 1 + loop (C, A, A), and of that with each of the rows in turn taken from
    `opened`."""
    every = np.repeat(loop[None], 1 + len(rows), axis=0)
    for k, i in enumerate(rows):
        every[1 + k, :, i] = opened[:, i]
    return np.asarray(np.linalg.det(np.eye(loop.shape[1]) + every))


# --- Many drives of one axis on the same structure: their loops, along the same contour, and the torque that noise
#     makes
# Noise: a motor encoder whose angle is off by white noise of standard deviation sigma [rad] at every control instant.
# The speed is formed from differences over N cycles, N = 1 or the drive's speed_window. With the open-loop gain L of
# the speed loop, position loops open, the motor torque answers to the angle by
#
#     G = E C (1 - 1/z^N)/(N T_c) / (1 + L)        sigma_M^2 = sigma^2 T_c/pi Int_0^(pi/T_c) |G|^2 d omega
#
# (Parseval's theorem for sampled signals; E, C as in plant.py).


# resonances that show with gains so many times the present ones are looked at closely from the start
MAX_GAIN_RATIO = 4.0


class JudgedAxis(NamedTuple):
    """Speed and position loop of the axis in both states, and the motor torque [N.m] per noise of the angle [rad]."""

    loops: tuple[Loop, ...]
    noise: float

    @property
    def stable(self) -> bool:
        """Whether no solution grows."""
        return not any(loop.growing for loop in self.loops)

    @property
    def gain_margin(self) -> float:
        """Least gain margin [dB]; minus infinity where a solution grows."""
        return 20 * math.log10(min(loop.gain_margin for loop in self.loops)) if self.stable else -math.inf

    @property
    def phase_margin(self) -> float:
        """Least phase margin [deg]; minus infinity where a solution grows."""
        return min(loop.phase_margin for loop in self.loops) if self.stable else -math.inf


class Candidates:
    """Judges drives of one axis of a machine, with the modes of one pose. All drives are shipped ones."""

    def __init__(self, machine: Machine, modes: Modes, axis: str) -> None:
        self.modes = modes
        axes = tuple(machine.axes)
        drives = tuple(
            LinearDrive(machine.shipped_drive(name, "tuning"), machine.cycles, axis.I_P)
            for name, axis in machine.axes.items()
        )
        frictions = machine.shipped_frictions
        bristles = tuple(Bristles.of(frictions[name]) if name in frictions else None for name in axes)
        self._index = axes.index(axis)
        base = SampledAxes(axes, drives, bristles, ModalPlant.of(modes, axes))
        own = drives[self._index].drive
        stiff = own.model_copy(update={"K_p": MAX_GAIN_RATIO * own.K_p, "K_v": MAX_GAIN_RATIO * own.K_v})
        self._base = replace(base, near=self._with_drive(base, stiff).resonances())

    def _with_drive(self, base: SampledAxes, drive: Drive) -> SampledAxes:
        own = replace(base.drives[self._index], drive=drive)
        return replace(base, drives=(*base.drives[: self._index], own, *base.drives[self._index + 1 :]))

    def judge(self, drive: Drive) -> JudgedAxis:
        """The loops of the axis with another drive. InputError: gains beyond all numbers."""
        changed = self._with_drive(self._base, drive)
        loops, frequency, levels = changed.judged_with_levels((self._index,))
        return JudgedAxis(loops, _noise(changed.drives[self._index], frequency, levels))


def _noise(own: LinearDrive, frequency: Floats, levels: Complexes) -> float:
    """Standard deviation of the motor torque over that of the encoder's angle [N.m/rad], of an axis that moves."""
    s = np.asarray(GROWTH + 2j * np.pi * frequency)
    window = max(1, own.drive.speed_window) * own.cycles.T_c
    torque = own.torque(s)[0] * own.from_speed(s) * -np.expm1(-s * window) / window
    answer = np.abs(torque * levels[0, 1] / levels[0, 0]) ** 2
    return math.sqrt(float(np.trapezoid(answer, frequency)) * 2 * own.cycles.T_c)
