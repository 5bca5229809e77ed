"""What friction compensations reach on machines of different kinds: reduction of errors on circles not used for tuning.

The machines are synthetic: the default one, a table with two linear motors, and a gantry of nine tonnes. An axis of the
other two is a rotor on a contact with its slide, a rigid mode and an elastic one.

    make compensation-study               all kinds on all machines
    python benchmarks/compensation_study.py --kinds pulse --machines gantry
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import yaml

import feedsim as fs
from feedsim.design.tune.compensators import COMPENSATOR_KINDS
from feedsim.structure.modes import Modes, write_modes

CIRCLE = Path(__file__).resolve().parents[1] / "scenarios" / "xz_circle.yaml"
UNITS = {
    **dict.fromkeys(("F_C", "F_S", "F_log"), "N.m"), **dict.fromkeys(("v_s", "v_log"), "rad/s"),
    **dict.fromkeys(("sigma_1", "sigma_2"), "N.m.s/rad"), "sigma_0": "N.m/rad", "W": "rad",
}  # fmt: skip
MODEL_DAMPING = 1.487  # of the reference model, as in the default machine
CASES = {
    "held_out": "friction's part", "friction+": "friction 20 % higher", "friction-": "20 % lower", "worn": "worn axes",
}  # fmt: skip
AIMS = {"pulse": (45, 20), "pulse_characteristic": (55, 40), "table": (40, 30), "model": (95, 90)}  # median, least [%]


@dataclass(frozen=True)
class Axis:
    """An axis of two inertias.

    pitch [m] per turn of the motor, or of 2 pi of a linear motor's angle. mass [kg] of the slide. rotor [kg.m2].
    elastic [Hz]: rotor against slide, where a band stop lies. bandwidth [Hz]: K_p/(2 pi J). K_v [1/s]. T_n [s].
    travel [m], speed [m/s], acceleration [m/s2]. motor: R [Ohm], L [H], K_t [N.m/A], M_max [N.m]. friction: SI, keys
    of machine files.
    """

    pitch: float
    mass: float
    rotor: float
    elastic: float
    bandwidth: float
    K_v: float
    T_n: float
    travel: float
    speed: float
    acceleration: float
    motor: tuple[float, float, float, float]
    friction: Mapping[str, float]

    @property
    def I_P(self) -> float:
        """Travel per angle [m/rad]."""
        return self.pitch / (2 * math.pi)

    @property
    def slide(self) -> float:
        """Inertia of the slide on the motor side [kg.m2]."""
        return self.mass * self.I_P**2


@dataclass(frozen=True)
class Made:
    """A machine of two such axes. position: cycle of the position control [s]. jerk, acceleration: of the path."""

    name: str
    X: Axis
    Z: Axis
    position: float
    jerk: float
    acceleration: float


def friction(F_C: float, F_S: float, sigma_0: float, sigma_1: float, **more: float) -> dict[str, float]:
    """A friction with the Stribeck speed of the default machine where no other is given."""
    return {"F_C": F_C, "F_S": F_S, "sigma_0": sigma_0, "sigma_1": sigma_1, "v_s": 0.6, "v_log": 3.0, **more}


MACHINES = {
    "linear": Made(
        "Table with linear motors",
        Axis(0.040, 40.0, 8e-4, 420.0, 60.0, 133.0, 8e-3, 0.5, 1.0, 20.0, (1.5, 8e-3, 0.5, 12.0),
             friction(0.38, 0.49, 208.0, 0.15, v_s=0.3, v_log=1.5, F_log=0.06, sigma_2=1e-3, W=0.010, gamma=0.5)),
        Axis(0.040, 24.0, 5e-4, 480.0, 60.0, 133.0, 8e-3, 0.4, 1.0, 20.0, (1.5, 8e-3, 0.5, 8.0),
             friction(0.22, 0.29, 123.0, 0.09, v_s=0.3, v_log=1.5, F_log=0.04, sigma_2=6e-4, W=0.010, gamma=0.5)),
        500e-6, 500.0, 20.0,
    ),
    "gantry": Made(
        "Gantry of nine tonnes",
        Axis(0.030, 9000.0, 0.030, 70.0, 20.0, 33.0, 30e-3, 4.0, 0.33, 2.5, (0.25, 5e-3, 3.0, 250.0),
             friction(8.0, 11.0, 1750.0, 4.0, F_log=1.5, sigma_2=0.05, W=0.050, gamma=0.3)),
        Axis(0.025, 2500.0, 0.012, 90.0, 25.0, 33.0, 25e-3, 1.5, 0.33, 3.0, (0.4, 5e-3, 2.0, 90.0),
             friction(3.0, 3.9, 620.0, 1.1, F_log=0.7, sigma_2=0.02, W=0.045, gamma=0.4)),
        2e-3, 20.0, 2.5,
    ),
}  # fmt: skip


def modes(made: Made) -> Modes:
    """A rigid and an elastic mode of each axis, of unit modal mass."""
    ports = {f"{port}_{name}": np.zeros(4) for name in ("X", "Z") for port in ("n", "x")}
    frequency = np.zeros(4)
    for k, name in enumerate(("X", "Z")):
        axis: Axis = getattr(made, name)
        J_1, J_2 = axis.rotor, axis.slide
        J = J_1 + J_2
        ports[f"n_{name}"][[k, 2 + k]] = 1 / math.sqrt(J), math.sqrt(J_2 / (J_1 * J))
        ports[f"x_{name}"][[k, 2 + k]] = axis.I_P / math.sqrt(J), -axis.I_P * math.sqrt(J_1 / (J_2 * J))
        frequency[2 + k] = axis.elastic
    tool = {f"tcp_{d}": ports[f"x_{d}"].copy() if d != "Y" else np.zeros(4) for d in "XYZ"}
    return Modes(Path("modes.csv"), frequency, np.where(frequency > 0, 0.03, 0.0), ports | tool)


def machine_file(made: Made) -> dict[str, object]:
    """The machine as its file has it."""
    control = 125e-6
    axes: dict[str, object] = {}
    lags = {name: 1 / (2 * math.pi * getattr(made, name).bandwidth) + made.position - control for name in ("X", "Z")}
    for name in ("X", "Z"):
        axis: Axis = getattr(made, name)
        R, L, K_t, M_max = axis.motor
        rise = 2 * math.pi * axis.bandwidth
        axes[name] = {
            "pitch": f"{axis.pitch!r} m", "travel": ["0 m", f"{axis.travel!r} m"],
            "max_speed": f"{axis.speed!r} m/s", "max_acceleration": f"{axis.acceleration!r} m/s^2",
            "drive": {
                "K_v": f"{axis.K_v!r} 1/s", "k_ffw": 1.0, "K_p": f"{(axis.rotor + axis.slide) * rise!r} N.m.s/rad",
                "T_n": f"{axis.T_n!r} s", "T_sym": f"{lags[name]!r} s",
                "T_dyn": f"{max(lags.values()) - lags[name]!r} s",
                "omega_0": f"{2 * MODEL_DAMPING * rise!r} rad/s", "D": MODEL_DAMPING, "M_max": f"{M_max!r} N.m",
                "current": {"K_p": f"{L * 2 * math.pi * 550!r} V/A", "T_n": f"{L / R!r} s"}, "u_max": "350 V",
                "filter_1": {"type": "band_stop", "f": f"{axis.elastic!r} Hz", "D_num": 0.1, "D_den": 0.8},
                "R": f"{R!r} Ohm", "L_d": f"{L!r} H", "L_q": f"{L!r} H", "p": 5, "K_t": f"{K_t!r} N.m/A",
            },
            "friction": {key: f"{value!r} {UNITS.get(key, '')}".strip() for key, value in axis.friction.items()},
        }  # fmt: skip
    return {
        "name": made.name, "note": "Synthetic machine.", "modes": "modes.csv",
        "pose": {name: f"{getattr(made, name).travel / 2!r} m" for name in ("X", "Z")},
        "cycles": {"control": f"{control!r} s", "position": f"{made.position!r} s",
                   "interpolation": f"{2 * made.position!r} s"},
        "path": {"jerk": f"{made.jerk!r} m/s^3", "acceleration": f"{made.acceleration!r} m/s^2"}, "axes": axes,
    }  # fmt: skip


def written(made: Made, folder: Path) -> Path:
    """The scenario of a circle on the machine, in a folder."""
    write_modes(folder / "modes.csv", modes(made))
    (folder / "machine.yaml").write_text(yaml.safe_dump(machine_file(made), sort_keys=False))
    motions = "motions:\n  - {kind: circle, plane: [X, Z], radius: 20 mm, feed: 2 m/min}\n"
    (folder / "circle.yaml").write_text(f"name: Circle\nmachine: machine.yaml\n{motions}")
    return folder / "circle.yaml"


def scenarios(folder: Path, names: list[str]) -> Iterator[tuple[str, Path]]:
    """Name of the machine and its scenario."""
    for name in names:
        if name == "default":
            yield name, CIRCLE
        else:
            (own := folder / name).mkdir()
            yield name, written(MACHINES[name], own)


def row(name: str, kind: str, result: fs.Result, taken: float) -> str:
    """Median and least reduction [%] of the error and of what friction makes of it, the latter on changed machines."""
    found = {key: float(figure) for key, figure in result.figures.items()}

    def both(key: str) -> str:
        return " / ".join(f"{found[f'{key}{end}']:.1f}" for end in ("median", "worst"))

    asked = " / ".join(map(str, AIMS[kind]))
    cells = [both("held_out."), *(both(f"{case}.friction_") for case in CASES), asked]
    return f"| {name} | {kind} | {' | '.join(cells)} | {taken:.0f} |"


def main() -> int:
    """Tune every kind on every machine, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kinds", default=",".join(COMPENSATOR_KINDS))
    parser.add_argument("--machines", default=",".join(["default", *MACHINES]))
    given = parser.parse_args()
    print("Median / least reduction in per cent: of the whole error, then of the part that friction makes.")
    heads = ("machine", "kind", "whole", *CASES.values(), "asked", "time [s]")
    print(f"| {' | '.join(heads)} |\n{'|---' * len(heads)}|", flush=True)
    with TemporaryDirectory() as folder:
        for name, scenario in scenarios(Path(folder), given.machines.split(",")):
            for kind in given.kinds.split(","):
                start = time.process_time()
                result = fs.tune_compensation(scenario, kind=kind)
                print(row(name, kind, result, time.process_time() - start), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
