"""Synthetic machines of any size: the default machine's Z drive on every axis, and as many modes as asked for.

Every axis is a rotor (J_1) on a shaft with its slide (J_2, on the motor side): a rigid mode and an elastic one, 60 Hz.
Modes beyond those, 80 to 1000 Hz, move all axes with random signs; they take a tenth of the elastic mode's share, so
that what the drives meet is the same whatever the number of modes. They are mass-normalised, but no structure's.
"""

from __future__ import annotations

import math
from pathlib import Path

from harness import ROOT

import numpy as np
import yaml
from numpy.typing import NDArray

from feedsim.files.fields import FileContent
from feedsim.simulation.cosim import fmus_directory
from feedsim.structure.modes import Modes, write_modes
from feedsim.structure.pack import pack

NAMES = ("X", "Y", "Z", "U", "V", "W", "A", "B", "C", "P", "Q", "R")
POSE = 0.3  # m, of every axis
J_1, J_2 = 0.0075, 0.0089  # kg.m2, about as in Z of the default machine
LEAD = 0.020 / (2 * math.pi)  # m/rad
ELASTIC, DAMPING, SPREAD = 60.0, 0.05, 0.1
LOWEST, HIGHEST = 80.0, 1000.0  # Hz


def modes(axes: int, count: int) -> Modes:
    """Table of `count` modes, at least two per axis."""
    if count < 2 * axes:
        raise ValueError(f"{axes} axes need {2 * axes} modes at least, not {count}")
    names, further = NAMES[:axes], count - 2 * axes
    random = np.random.default_rng(1)
    J = J_1 + J_2
    rotor, slide = math.sqrt(J_2 / (J_1 * J)), -LEAD * math.sqrt(J_1 / (J_2 * J))
    # How much of the elastic motion each flexible mode has: rows are modes, columns axes; squares sum to 1 per axis.
    shares = math.sqrt(1 - SPREAD if further else 1.0) * np.eye(axes)
    if further:
        signs = random.choice([-1.0, 1.0], size=(further, axes))
        shares = np.vstack([shares, signs * math.sqrt(SPREAD / further)])
    rigid = np.eye(axes) / math.sqrt(J)

    def shape(of_rigid: float, of_elastic: float) -> NDArray[np.float64]:
        return np.vstack([of_rigid * rigid, of_elastic * shares])

    n, x = shape(1.0, rotor), shape(LEAD, slide)
    # The tool goes with the axes that are called like its directions, and with the first one where there is none.
    tcp = {f"tcp_{name}": x[:, names.index(name) if name in names else 0] for name in "XYZ"}
    ports = {f"n_{name}": n[:, i] for i, name in enumerate(names)}
    ports |= {f"x_{name}": x[:, i] for i, name in enumerate(names)}
    frequency = np.concatenate([np.zeros(axes), np.full(axes, ELASTIC), np.geomspace(LOWEST, HIGHEST, further)])
    damping = np.where(frequency > 0, DAMPING, 0.0)
    return Modes(Path("modes.csv"), frequency, damping, ports | tcp)


PLANT = "plant.fmu"
THERE_AND_BACK = 8  # with the rests some 6.7 s, 50,000 control cycles and more


def write(folder: Path, axes: int, count: int) -> Path:
    """Write such a machine with its packed plant, and a scenario in which all its axes go to and fro; return its path.

    Every machine is packed, that of the general archive's axes too: a start-up is the same for all of them.
    """
    folder.mkdir(parents=True, exist_ok=True)
    names = NAMES[:axes]
    write_modes(folder / "modes.csv", modes(axes, count))
    default = ROOT / "scenarios" / "machines" / "test_centre" / "machine.yaml"
    machine = yaml.safe_load(default.read_text(encoding="utf-8"))
    machine.pop("structure", None)
    machine |= {
        "name": f"{axes} axes, {count} modes",
        "note": "Synthetic; for benchmarks",
        "modes": "modes.csv",
        "plant": PLANT,
        "pose": dict.fromkeys(names, f"{POSE} m"),
        "axes": {name: {**machine["axes"]["Z"], "travel": ["0 m", "1 m"]} for name in names},
    }
    # Anchors would be legal, but no person writes them here.
    _dump(folder / "machine.yaml", machine)
    pack_machine(folder, axes)
    to, fro = ({"kind": "move", "by": dict.fromkeys(names, by), "feed": "3000 mm/min"} for by in ("5 mm", "-5 mm"))
    rest = {"kind": "dwell", "duration": "0.2 s"}
    scenario = {
        "name": machine["name"],
        "machine": "machine.yaml",
        "motions": [to, rest, fro, rest] * THERE_AND_BACK,
    }
    _dump(folder / "scenario.yaml", scenario)
    return folder / "scenario.yaml"


def pack_machine(folder: Path, axes: int) -> None:
    """Pack the machine of a folder, as ``feedsim export --plant`` does."""
    pose = dict.fromkeys(NAMES[:axes], POSE)
    pack(fmus_directory() / "plant.fmu", folder / PLANT, modes=FileContent.read(folder / "modes.csv"), pose=pose)


class _Plain(yaml.SafeDumper):
    def ignore_aliases(self, data: object) -> bool:
        return True


def _dump(path: Path, content: object) -> None:
    path.write_text(yaml.dump(content, Dumper=_Plain, sort_keys=False), encoding="utf-8")
