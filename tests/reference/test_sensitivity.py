"""The comparison can fail: parameters that are a little off are found different."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import check_reference
import pytest
import system
from monolithic.machine import MODES_FILE
from reference_files import HERE, read_case

pytestmark = pytest.mark.extensive


@pytest.mark.parametrize("held", [False, True], ids=["linear", "held"])
@pytest.mark.parametrize("case", ["presliding", "reversal", "reversal_lugre", "stick", "constant_speed"])
@pytest.mark.parametrize(
    ("parameter", "value"),
    [("sigma_0", 300 * 1.001), ("F_S", 2.1 * 1.001), ("sigma_1", 0.8 * 1.01)],
    ids=lambda value: str(value),
)
def test_friction(case: str, held: bool, parameter: str, value: float, fmus: Path) -> None:
    """A thousandth more stiffness or break-away torque, a hundredth more damping."""
    found = read_case("friction", case, held=held)
    off = replace(found, parameters={**found.parameters, parameter: value})
    comparison = check_reference.check_case(fmus / "friction.fmu", off)
    assert comparison.verdict == "different", comparison.line


@pytest.mark.parametrize(
    ("parameter", "value"),
    [
        ("filter_1.D_num", 0.08 * (1 + 1e-6)),
        ("filter_1.D_den", 0.8 * (1 + 1e-6)),
        ("filter_1.f", 602 * (1 + 1e-6)),
        ("K_p", 6.18 * (1 + 1e-6)),
        ("T_sym", 3.528e-3 + 1e-9),
        ("L_q", 5e-3 * (1 + 1e-6)),
    ],
)
def test_controller(parameter: str, value: float, fmus: Path) -> None:
    """A millionth of a filter's damping ratio, a nanosecond of a delay."""
    case = read_case("controller", "move")
    comparison = check_reference.check_case(fmus / "controller.fmu", replace(case, parameters={parameter: value}))
    assert comparison.verdict == "different", comparison.line


@pytest.mark.parametrize("held", [False, True], ids=["linear", "held"])
@pytest.mark.parametrize("column", [1, 2, 5], ids=["frequency", "damping", "shape"])
@pytest.mark.parametrize(("mode", "share"), [(3, 1e-6), (4, 1e-6), (19, 1e-6), (42, 1e-5), (92, 1e-2)])
def test_modes(mode: int, share: float, column: int, held: bool, fmus: Path, tmp_path: Path) -> None:
    """A millionth of a mode's frequency, damping ratio or shape at Z's motor (column n_Z); of the modes around 400 Hz
    and 1 kHz, which the impulses hardly reach, a little more."""
    rows = [line.split(",") for line in MODES_FILE.read_text(encoding="ascii").splitlines()]
    rows[1 + mode][column] = repr(float(rows[1 + mode][column]) * (1 + share))
    (tmp_path / "modes.csv").write_text("\n".join(",".join(row) for row in rows) + "\n", encoding="ascii")
    case = replace(read_case("plant", "impulse", held=held), modes=tmp_path / "modes.csv")
    comparison = check_reference.check_case(fmus / "plant.fmu", case)
    assert comparison.verdict == "different", comparison.line


def test_same_modes_from_a_file_are_the_same(fmus: Path) -> None:
    case = replace(read_case("plant", "impulse"), modes=MODES_FILE)
    assert check_reference.check_case(fmus / "plant.fmu", case).same


@pytest.mark.parametrize(
    "override",
    [
        "machine.axes.Z.friction.sigma_0=300.3 N.m/rad",
        "machine.axes.Z.drive.filter_1.D_num=0.0808",
        "machine.axes.Z.drive.T_sym=3.529 ms",
        "coupling.scheme=gauss_seidel",
    ],
)
@pytest.mark.parametrize("wanted", system.SYSTEMS, ids=lambda wanted: wanted.name)
def test_scenarios(wanted: system.Scenario, override: str, fmus: Path) -> None:
    comparison = check_reference.check_system(fmus, wanted, HERE, override)
    assert comparison.verdict == "different", comparison.line
