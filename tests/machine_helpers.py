"""Synthetic machines of any number of axes that do not know of each other: the default machine's Z drive on each.

Every axis is a rotor (J_1) on a shaft with its slide (J_2 on the motor side): one rigid and one elastic mode. As the
axes are decoupled, what one of them does cannot depend on how many others there are, nor on its name.
"""

from __future__ import annotations

import math
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

ROOT = Path(__file__).resolve().parent.parent
J_1, J_2 = 0.0075, 0.0089  # [kg.m2], about as in Z of the default machine
FREQUENCY, DAMPING = 60.0, 0.05  # of the elastic mode [Hz], [1]
LEAD = 0.020 / (2 * math.pi)  # [m/rad]


def modes_csv(axes: Sequence[str]) -> str:
    """Mode table; the tool moves in X, Y and Z with the axes of these names alone."""
    header = ["mode", "frequency [Hz]", "damping ratio [1]", *(f"n_{axis}" for axis in axes)]
    header += [*(f"x_{axis}" for axis in axes), "tcp_X", "tcp_Y", "tcp_Z"]
    J = J_1 + J_2
    shapes = [  # frequency, damping, rotor, slide as an angle; orthonormal with J_1 and J_2
        (0.0, 0.0, 1 / math.sqrt(J), 1 / math.sqrt(J)),
        (FREQUENCY, DAMPING, math.sqrt(J_2 / (J_1 * J)), -math.sqrt(J_1 / (J_2 * J))),
    ]
    lines = [",".join(header)]
    for frequency, damping, rotor, slide in shapes:
        for axis in axes:
            row = {"mode": len(lines) - 1, "frequency [Hz]": frequency, "damping ratio [1]": damping}
            row |= {f"n_{axis}": rotor, f"x_{axis}": LEAD * slide, f"tcp_{axis}": LEAD * slide}
            lines.append(",".join(repr(row.get(name, 0)) for name in header))
    return "\n".join(lines) + "\n"


def write_machine(folder: Path, pose: Mapping[str, float], **more: Any) -> Path:
    """Write machine.yaml and modes.csv of a machine with these axes at these positions [m]; `more`: further keys."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "modes.csv").write_text(modes_csv(list(pose)), encoding="utf-8")
    default = yaml.safe_load((ROOT / "scenarios/machines/test_centre/machine.yaml").read_text(encoding="utf-8"))
    machine = default | {
        "name": "Decoupled",
        "note": "Synthetic; for tests",
        "modes": "modes.csv",
        "pose": {axis: f"{position!r} m" for axis, position in pose.items()},
        "axes": dict.fromkeys(pose, default["axes"]["Z"]),
    }
    machine.pop("structure", None)
    path = folder / "machine.yaml"
    path.write_text(yaml.safe_dump(machine | more, sort_keys=False), encoding="utf-8")
    return path


def write_scenario(folder: Path, machine: Path, motions: Sequence[Mapping[str, Any]], **more: Any) -> Path:
    """Write scenario.yaml on that machine, recorded at every control cycle."""
    path = folder / "scenario.yaml"
    content = {"name": "Other axes", "machine": str(machine.resolve()), "motions": list(motions), **more}
    path.write_text(yaml.safe_dump({"recording": {"interval": "125 us"}} | content, sort_keys=False), encoding="utf-8")
    return path


def rigid_copy(machine: Path, folder: Path) -> Path:
    """A copy of a machine folder without the elastic modes of its table."""
    shutil.copytree(machine, folder)
    head, *rows = (folder / "modes.csv").read_text().splitlines()
    rigid = [row for row in rows if float(row.split(",")[1]) == 0]
    (folder / "modes.csv").write_text("\n".join([head, *rigid]) + "\n")
    return folder
