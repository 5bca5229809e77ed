"""Machines of other axes: one axis by hand calculation, turned in space, five axes with names of their own."""

from __future__ import annotations

from copy import deepcopy
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from feedsim.structure.build import build
from feedsim.structure.geometry.assemble import Assembler, assemble
from feedsim.structure.info import info_of_model
from structure_helpers import MACHINES, dense_modes, from_data, geometry, one_axis_data

LEAD = 0.010 / (2 * pi)
SCREW = 7850 * pi * 0.025**4 / 32 * 1.0  # polar moment of inertia [kg.m2]


def test_one_axis_by_hand() -> None:
    structure = geometry(MACHINES / "one_axis")
    assembler = Assembler(structure)
    screw = 7850 * pi / 4 * 0.025**2 * 1.0
    info = info_of_model("", "", build(structure, {"X": 0.3}), 125e-6)
    assert info.total_mass == pytest.approx(2900 * 1.4 * 0.6 * 0.25 + 40 + 5 + screw, rel=1e-12)
    assert info.axes[0].moving_mass == pytest.approx(40, rel=1e-6)  # by the rigid mode, which the solution makes
    for X in structure.axes["X"].travel:
        assembly = assembler.at({"X": X})
        found, shapes = dense_modes(assembly)
        assert found[0] < 0.01  # rounding of the largest squared frequency, about 1e5 Hz
        assert 20 < found[1] < found[10] < 500
        # The base stands on the ground: rigidly only rotor, screw and table move.
        n = float(shapes[:, 0] @ assembly.ports["n_X"])
        assert 1 / n**2 == pytest.approx(0.0006 + SCREW + 40 * LEAD**2, rel=1e-6)
        assert float(shapes[:, 0] @ assembly.ports["x_X"]) / n == pytest.approx(LEAD, rel=1e-6)


def test_figures_of_the_documentation() -> None:
    assembly = assemble(geometry(MACHINES / "one_axis"), {"X": 0.3})
    assert len(assembly.labels) == 139
    found, shapes = dense_modes(assembly)
    # Below 500 Hz the scale sees the table move most where it swings on its drive.
    swinging = int(np.argmax(np.where((found > 1) & (found < 500), np.abs(assembly.ports["x_X"] @ shapes), 0)))
    assert found[1] == pytest.approx(27.0, abs=0.05)
    assert found[swinging] == pytest.approx(211, abs=0.5)


def turned(value: Any, R: np.ndarray[tuple[int, ...], np.dtype[np.float64]], key: str = "") -> Any:
    """The tree of a structure with every point and direction turned."""
    if isinstance(value, dict):
        return {name: turned(part, R, name) for name, part in value.items()}
    if key == "directions":
        return [turned(part, R, "direction") for part in value]
    if key in ("direction", "up"):
        letters = dict(zip("XYZ", np.eye(3), strict=True))
        return [float(part) for part in R @ letters[value]]
    if key in ("at", "start", "end", "offset", "origin") and isinstance(value, list):
        return [f"{part!r} mm" for part in (R @ [float(text.removesuffix(" mm")) for text in value]).tolist()]
    return [turned(part, R) for part in value] if isinstance(value, list) else value


def test_a_machine_does_not_know_how_it_is_turned(tmp_path: Path) -> None:
    data = one_axis_data()
    data["bodies"]["base"]["nodes"]["block"]["up"] = "Y"
    same = ["0.6 kg.m^2"] * 3  # inertias and mounts count along the frame: alike in all directions they turn with it
    data["bodies"]["table"]["masses"][0]["inertia"] = same
    data["axes"]["X"]["drive"]["stator"]["inertia"] = same
    for mount in data["bodies"]["base"]["mounts"]:
        mount["stiffness"] = ["6 N/um"] * 3
    # Any turn will do; this one leaves no component of any direction zero.
    a, b = (
        np.array([[0.8, -0.6, 0], [0.6, 0.8, 0], [0, 0, 1]]),
        np.array([[1, 0, 0], [0, 0.28, -0.96], [0, 0.96, 0.28]]),
    )
    before = assemble(from_data(data, tmp_path), {"X": 0.2})
    after = assemble(from_data(turned(data, a @ b @ a), tmp_path), {"X": 0.2})
    found, shapes = dense_modes(after)
    expected, others = dense_modes(before)
    # The eigensolver's error: 1e-16 of the largest squared frequency (1e5 Hz) against 30 Hz squared is 1e-9.
    assert found[1:60] == pytest.approx(expected[1:60], rel=1e-8)
    for port in ("n_X", "x_X"):
        for k in (1, 2, 3, 4, 5):
            assert abs(shapes[:, k] @ after.ports[port]) == pytest.approx(
                abs(others[:, k] @ before.ports[port]), rel=1e-6, abs=1e-9
            )


def test_five_axes_with_names_of_their_own(tmp_path: Path) -> None:
    data = one_axis_data()
    names = ["U", "V", "X2", "feed", "W_b"]
    one, table = data["axes"].pop("X"), data["bodies"].pop("table")
    for name in names:
        text = deepcopy({"body": table | {"moves_with": [name]}, "axis": one})
        text["axis"]["drive"]["nut"] |= {"body": f"table_{name}", "held_by": f"table_{name}.plate"}
        text["axis"]["scale"] |= {"body": f"table_{name}", "moving": f"table_{name}.plate"}
        data["bodies"][f"table_{name}"], data["axes"][name] = text["body"], text["axis"]
    data["axes"]["V"]["direction"] = "-X"
    data["bodies"]["table_V"]["origin"][0] = "300 mm"
    data["tool"] |= {"body": "table_feed", "held_by": "table_feed.plate"}
    structure = from_data(data, tmp_path)
    assembly = assemble(structure, {name: 0.1 * i for i, name in enumerate(names)})
    assert assembly.axes == tuple(names)
    assert list(assembly.ports) == [
        *(f"n_{name}" for name in names),
        *(f"x_{name}" for name in names),
        *("tcp_X", "tcp_Y", "tcp_Z"),
    ]
    found, shapes = dense_modes(assembly)
    assert np.all(found[:5] < 0.01)
    assert found[5] > 10
    n = shapes[:, :5].T @ np.column_stack([assembly.ports[f"n_{name}"] for name in names])
    x = shapes[:, :5].T @ np.column_stack([assembly.ports[f"x_{name}"] for name in names])
    # Each axis travels its own lead per radian of its own rotor, the reversed one too.
    assert np.linalg.solve(n, x) == pytest.approx(np.eye(5) * LEAD, abs=1e-6 * LEAD)
