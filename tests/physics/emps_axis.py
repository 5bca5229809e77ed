"""The measured axis EMPS: its record, and the units driven as the axis was.

A. Janot, M. Gautier, M. Brunot, "Data Set and Reference Models of EMPS", Workshop on Nonlinear System Identification
Benchmarks, 2019. The record is the user's own; the environment variable FEEDSIM_EMPS names it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml
from numpy.typing import NDArray
from scipy.io import loadmat
from scipy.signal import butter, cheby1, filtfilt

from feedsim import units
from feedsim.cosim import run
from feedsim.identify.record import Record
from feedsim.scenario import load, load_machine

Floats = NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[2]
SCENARIO = ROOT / "scenarios" / "emps.yaml"
MACHINE = load_machine(ROOT / "scenarios" / "machines" / "emps")
I_P = MACHINE.axes["X"].I_P  # [m/rad]
T = MACHINE.cycles.T_c  # [s], of the axis's controller and of the record
RUN_IN = 20  # cycles in which the open loop brings the axis to the record's first speed
RECORDED = "recording.variables=[X.x_s, X.x_a, X.n_a, X.M_a]"


@dataclass(frozen=True, eq=False)
class Measured:
    """(N,) at the instants k T: reference and position of the carriage [m], force of the drive on it [N]."""

    reference: Floats
    position: Floats
    force: Floats

    def __len__(self) -> int:
        """Number of instants."""
        return len(self.force)

    @property
    def record(self) -> Record:
        """For identification: motor side."""
        angles = self.position / I_P, self.reference / I_P
        return Record("EMPS", T * np.arange(len(self)), self.force * I_P, angle=angles[0], setpoint=angles[1])

    @property
    def first_speed(self) -> float:
        """Speed at the first instant [m/s]: the record begins in motion. Slope of a cubic through nine positions, whose
        50 nm steps it averages to some 0.1 mm/s."""
        cubic = np.polynomial.Polynomial.fit(T * np.arange(9), self.position[:9], 3)
        return float(cubic.deriv()(0.0))


@dataclass(frozen=True)
class Parameters:
    """A parameter set of the axis, motor side; without friction file the machine's friction.

    J: inertia [kg.m^2]; M_0: constant load [N.m]; friction: file with the friction parameters.
    """

    J: float
    M_0: float
    friction: Path | None = None

    @classmethod
    def published(cls) -> Parameters:
        """The least-squares parameters, as the machine file has them."""
        return cls(J=95.109 * I_P**2, M_0=MACHINE.axes["X"].M_0)

    @classmethod
    def identified(cls, file: Path) -> Parameters:
        """What `feedsim identify` left in its friction file."""
        found = yaml.safe_load(file.read_text(encoding="utf-8"))["identified"]
        J, M_0 = (found[name]["value"].split(maxsplit=1) for name in ("inertia", "constant_load"))
        return cls(
            J=float(J[0]) * float(units.factor(J[1], "kg.m2")),
            M_0=float(M_0[0]) * float(units.factor(M_0[1], "N.m")),
            friction=file,
        )

    def changes(self, folder: Path) -> list[str]:
        """As changes of the scenario; the inertia becomes a mode table in `folder`."""
        x = I_P / np.sqrt(self.J)
        modes = folder / "modes.csv"
        modes.write_text(
            "mode,frequency [Hz],damping ratio [1],n_X,x_X,tcp_X,tcp_Y,tcp_Z\n"
            f"0,0.0,0.0,{float(x / I_P)!r},{float(x)!r},{float(x)!r},0.0,0.0\n",
            encoding="utf-8",
        )
        friction = [] if self.friction is None else [f"machine.axes.X.friction={self.friction}"]
        return [f"machine.modes={modes}", f"machine.axes.X.constant_load={self.M_0!r} N.m", *friction]


def read(path: str | Path) -> Measured:
    """The record."""
    content = loadmat(path, squeeze_me=True)
    reference, position, command = (np.asarray(content[name], dtype=np.float64) for name in ("qg", "qm", "vir"))
    return Measured(reference, position, float(content["gtau"]) * command)


def rms(values: Floats) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def closed_loop(measured: Measured, parameters: Parameters, fmus: Path, folder: Path) -> tuple[float, float]:
    """RMS errors of position [m] and force [N] of the three units on the record's reference.

    The run begins at rest, a run-in ahead of the record, and its origin is its own: the position counts from the
    reference. A torque shown at t_k+1 is the one that was held since t_k.
    """
    setpoints = folder / "setpoints.csv"
    rows = [f"{k * T!r},{x!r}" for k, x in enumerate(measured.reference.tolist())]
    setpoints.write_text("\n".join(["time [s],X.x_s [m]", *rows, ""]), encoding="utf-8")
    changes = [f"motions.1.file={setpoints}", RECORDED, *parameters.changes(folder)]
    trace = run(load(SCENARIO, changes), fmus=fmus).trace
    first = _begin(trace["X.x_s"], measured.reference)
    here = slice(first, first + len(measured))
    late = slice(first + 1, first + 1 + len(measured))
    following = trace["X.x_a"][here] - trace["X.x_s"][here]
    force = trace["X.M_a"][late] / I_P
    return rms(following - (measured.position - measured.reference)), rms(force - measured.force)


def _begin(x_s: Floats, reference: Floats) -> int:
    """Row of the run at which the record begins; the run-in takes whole cycles."""
    steps = np.diff(reference[:500])
    offsets = [np.max(np.abs(np.diff(x_s[k : k + 500]) - steps)) for k in range(len(x_s) - len(reference))]
    best = int(np.argmin(offsets))
    assert offsets[best] < 5e-9  # the spline through the setpoints returns them
    return best


def open_loop(measured: Measured, parameters: Parameters, fmus: Path, folder: Path) -> float:
    """RMS error of the position [m] where the measured force drives plant and friction.

    The controllers' gains are 0, the force is added behind them. A constant force ahead of the record brings the axis
    from rest to the record's first speed.
    """

    def driven(torque: Floats) -> tuple[Floats, Floats]:
        file = folder / "open_loop.yaml"
        motion = {"kind": "dwell", "duration": f"{T * (len(torque) - 1)!r} s"}
        file.write_text(
            yaml.safe_dump(
                {
                    "name": "open loop",
                    "machine": str(MACHINE.directory),
                    "motions": [motion],
                    "coupling": {"substeps": 4},
                }
            ),
            encoding="utf-8",
        )
        gains = ["machine.axes.X.drive.K_v=0 1/s", "machine.axes.X.drive.K_p=0 N.m.s/rad"]
        scenario = load(file, [RECORDED, *gains, *parameters.changes(folder)])
        trace = run(scenario, fmus=fmus, torque_feedforward={"X": torque}).trace
        return trace["X.x_a"], trace["X.n_a"] * I_P

    def speed(force: float) -> float:
        return float(driven(np.full(RUN_IN + 1, force * I_P))[1][-1])

    wanted = measured.first_speed
    ahead = _secant(speed, wanted, 40.0 * np.sign(wanted), 60.0 * np.sign(wanted)) if wanted else 0.0
    force = np.concatenate([np.full(RUN_IN, ahead), measured.force])
    x, _ = driven(force * I_P)
    # The last force acts behind the last position.
    position = x[RUN_IN : RUN_IN + len(measured)] - x[RUN_IN] + measured.position[0]
    return rms(position - measured.position)


def _secant(function: Callable[[float], float], wanted: float, left: float, right: float) -> float:
    """Argument for which a nearly linear function takes the value `wanted`, within 0.1 %."""
    at_left, at_right = function(left), function(right)
    for _ in range(8):
        if abs(at_right - wanted) < 1e-3 * abs(wanted):
            break
        left, right = right, right + (wanted - at_right) * (right - left) / (at_right - at_left)
        at_left, at_right = at_right, function(right)
    assert abs(at_right - wanted) < 1e-3 * abs(wanted)
    return right


def least_squares(measured: Measured, *, decimation: int = 10) -> Sequence[float]:
    """M [kg], F_v [N.s/m], F_C [N], offset [N] of force = M a + F_v v + F_C sgn v + offset, by inverse dynamics.

    As in robotics: positions filtered forwards and backwards (Butterworth, 100 Hz), differences, then force and
    regressors through the same low-pass and decimated. Written here alone, as a second opinion.
    """
    q = filtfilt(*butter(4, 100.0, fs=1 / T), measured.position)
    v = np.gradient(q, T)
    columns = np.column_stack([np.gradient(v, T), v, np.sign(v), np.ones_like(v), measured.force])
    columns = filtfilt(*cheby1(8, 0.5, 0.8 / decimation), columns, axis=0)[100:-100:decimation]
    result = np.linalg.lstsq(columns[:, :4], columns[:, 4], rcond=None)[0]
    return [float(value) for value in result]
