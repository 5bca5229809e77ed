"""The measured axis EMPS: its record, and the units driven as the axis was.

A. Janot, M. Gautier, M. Brunot, "Data Set and Reference Models of EMPS", Workshop on Nonlinear System Identification
Benchmarks, 2019. The record is the user's own; the environment variable FEEDSIM_EMPS names it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml
from numpy.typing import NDArray
from scipy.io import loadmat
from scipy.optimize import brentq
from scipy.signal import butter, cheby1, filtfilt

from feedsim.estimation.identify.record import Record
from feedsim.foundation import units
from feedsim.motions.setpoints import RecordedGeometry
from feedsim.scenario import load, load_machine
from feedsim.simulation.cosim import run
from feedsim.simulation.nc import Program

Floats = NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[2]
SCENARIO = ROOT / "scenarios" / "emps.yaml"
MACHINE = load_machine(ROOT / "scenarios" / "machines" / "emps")
I_P = MACHINE.axes["X"].I_P  # [m/rad]
T = MACHINE.cycles.T_c  # [s], of the axis's controller; a record is logged at this cycle or a multiple of it
RUN_IN = 100  # cycles in which the open loop brings the axis to the record's first speed, far below M_max
SLOW = 1e-4  # m/s; up to which the first speed counts as rest, as the first positions tell it no better
# s, left out of both errors: a run begins at rest. Where the record begins in motion, at its top speed even, the
# controller still works off the jerk of the run-in then (half of its 3.4 N is from the first 0.1 s in such a record).
SETTLING = 0.1
COLUMNS = ("qg", "qm", "vir")  # reference, position, command
RECORDED = "recording.variables=[X.x_s, X.x_a, X.n_a, X.M_a]"


@dataclass(frozen=True, eq=False)
class Measured:
    """(N,) at the instants k T `every`: reference and position of the carriage [m], force of the drive on it [N].

    A force is that which the controller computes at its instant and holds for T.
    """

    reference: Floats
    position: Floats
    force: Floats
    every: int = 1

    def __len__(self) -> int:
        """Number of instants."""
        return len(self.force)

    @property
    def interval(self) -> float:
        """Between the instants [s]."""
        return T * self.every

    @property
    def time(self) -> Floats:
        """(N,) [s], from 0."""
        return np.asarray(self.interval * np.arange(len(self)))

    @property
    def record(self) -> Record:
        """For identification: motor side."""
        angles = self.position / I_P, self.reference / I_P
        return Record("EMPS", self.time, self.force * I_P, angle=angles[0], setpoint=angles[1])

    @property
    def first_speed(self) -> float:
        """Speed at the first instant [m/s]: the record begins in motion. Slope of a cubic through nine positions, whose
        50 nm steps it averages to some 0.1 mm/s."""
        cubic = np.polynomial.Polynomial.fit(self.time[:9], self.position[:9], 3)
        return float(cubic.deriv()(0.0))


@dataclass(frozen=True)
class Parameters:
    """A parameter set of the axis, motor side; without friction file the machine's friction.

    J: inertia [kg.m^2]; M_0: constant load [N.m]; friction: file with the friction parameters.
    rate: at which the load changes over the record, whose middle has M_0 [N.m/s].
    """

    J: float
    M_0: float
    friction: Path | None = None
    rate: float = 0.0

    @classmethod
    def published(cls) -> Parameters:
        """The least-squares parameters, as the machine file has them."""
        return cls(J=95.109 * I_P**2, M_0=MACHINE.axes["X"].M_0)

    @classmethod
    def identified(cls, file: Path) -> Parameters:
        """What `feedsim identify friction` left in its friction file."""
        found = yaml.safe_load(file.read_text(encoding="utf-8"))["identified"]
        J, M_0 = (found[name]["value"].split(maxsplit=1) for name in ("inertia", "constant_load"))
        rates = [each["value"].split(maxsplit=1) for each in found["constant_load"].get("drift", ())]
        return cls(
            rate=sum(float(value) * float(units.factor(unit, "N.m/s")) for value, unit in rates),
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
    """The record.

    Raises ValueError: its interval is no multiple of the controller's cycle, so that the run has no instants of the
    record's to be compared at.
    """
    content = loadmat(path, squeeze_me=True)
    time, reference, position, command = (np.asarray(content[name], dtype=np.float64) for name in ("t", *COLUMNS))
    cycles = float(time[-1] - time[0]) / (len(time) - 1) / T
    every = round(cycles)
    # 1e-3: more than the rounding of a log's clock, less than what would put a row of 1 s of record onto another
    if every < 1 or abs(cycles / every - 1) > 1e-3:
        raise ValueError(f"{path}: logged every {cycles * T * 1e3:.6g} ms; multiples of {T * 1e3:g} ms can be compared")
    return Measured(reference, position, float(content["gtau"]) * command, every)


def rms(values: Floats) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def closed_loop(
    measured: Measured, parameters: Parameters, fmus: Path, folder: Path, push: Floats | None = None
) -> tuple[float, float]:
    """RMS errors of position [m] and force [N] of the three units on the record's reference, but for its SETTLING.

    The run begins at rest, a run-in ahead of the record, and its origin is its own: the position counts from the
    reference. A torque shown at t_k+1 is the one that was held since t_k. push: force on the carriage [N] at the
    record's instants.
    """
    following, force = follow(measured, parameters, fmus, folder, push)
    settled = measured.time >= SETTLING
    return (
        rms((following - (measured.position - measured.reference))[settled]),
        rms((force - measured.force)[settled]),
    )


def follow(
    measured: Measured, parameters: Parameters, fmus: Path, folder: Path, push: Floats | None = None
) -> tuple[Floats, Floats]:
    """Position less reference [m] and force [N], each (N,), of the three units at the record's instants."""
    setpoints = folder / "setpoints.csv"
    columns = (measured.time, measured.reference, np.zeros(len(measured)) if push is None else push)
    rows = [",".join(map(repr, row)) for row in zip(*(column.tolist() for column in columns), strict=True)]
    setpoints.write_text("\n".join(["time [s],X.x_s [m],F [N]", *rows, ""]), encoding="utf-8")
    changes = [f"motions.1.file={setpoints}", RECORDED, *parameters.changes(folder)]
    if push is not None:
        changes.append(f"loads=[{{kind: slide, axis: X, file: {setpoints}, column: F, motion: 1}}]")
    found = run(load(SCENARIO, changes), fmus=fmus)
    at = _begin(found.program) + measured.every * np.arange(len(measured))
    trace = found.trace
    return trace["X.x_a"][at] - trace["X.x_s"][at], trace["X.M_a"][at + 1] / I_P


def _begin(program: Program) -> int:
    """Row of the run, at the cycle, with the record's first row; the run-in takes whole cycles."""
    (begin,) = (each.geometry.begin for each in program.segments if isinstance(each.geometry, RecordedGeometry))
    row = round(begin / T)
    assert abs(begin - row * T) < 1e-9
    return row


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

    def too_fast(force: float) -> float:
        return float(driven(np.full(RUN_IN + 1, force * I_P))[1][-1]) - wanted

    wanted, ahead = measured.first_speed, 0.0
    if abs(wanted) > SLOW:
        # Friction alone leaves the axis below the wanted speed, twice the force of a mass beyond it.
        most = 2 * parameters.J / I_P**2 * abs(wanted) / (RUN_IN * T) + 100.0
        ahead = float(brentq(too_fast, 0.0, np.copysign(most, wanted), xtol=1e-3))
    # A force between two rows is not in the record: the mean of its neighbours by their distance.
    cycles = T * np.arange(measured.every * (len(measured) - 1) + 1)
    drifts = parameters.rate / I_P * (cycles - cycles[-1] / 2)
    force = np.concatenate([np.full(RUN_IN, ahead), np.interp(cycles, measured.time, measured.force) - drifts])
    x, _ = driven(force * I_P)
    # The last force acts behind the last position.
    position = x[RUN_IN :: measured.every][: len(measured)] - x[RUN_IN] + measured.position[0]
    return rms(position - measured.position)


def least_squares(measured: Measured, *, step: float = 10e-3) -> Sequence[float]:
    """M [kg], F_v [N.s/m], F_C [N], offset [N] of force = M a + F_v v + F_C sgn v + offset, by inverse dynamics.

    As in robotics: positions filtered forwards and backwards (Butterworth, 100 Hz), differences, then force and
    regressors through the same low-pass and decimated to `step` [s]. Written here alone, as a second opinion.
    """
    decimation = round(step / measured.interval)
    q = filtfilt(*butter(4, 100.0, fs=1 / measured.interval), measured.position)
    v = np.gradient(q, measured.interval)
    columns = np.column_stack([np.gradient(v, measured.interval), v, np.sign(v), np.ones_like(v), measured.force])
    columns = filtfilt(*cheby1(8, 0.5, 0.8 / decimation), columns, axis=0)[100:-100:decimation]
    result = np.linalg.lstsq(columns[:, :4], columns[:, 4], rcond=None)[0]
    return [float(value) for value in result]
