"""The shipped scenario and machine files, the models' agreement with the units' tables, and models built in Python."""

import math
import re
from pathlib import Path
from typing import Any, get_args

import pytest
from pydantic import BaseModel, ValidationError

from feedsim.files.fields import Quantity, is_multiple
from feedsim.foundation import units
from feedsim.motions import Arc, Circle, Column, Dwell, MeasuredSetpoints, Move
from feedsim.scenario import (
    CircleTest,
    CurrentController,
    Cycles,
    Drive,
    Filter,
    Friction,
    Machine,
    Positioning,
    Recording,
    Scenario,
    load,
    load_machine,
)

ROOT = Path(__file__).resolve().parents[2]
SCENARIOS = ROOT / "scenarios"
MACHINE = SCENARIOS / "machines" / "test_centre" / "machine.yaml"

# --- the shipped files ----------------------------------------------------------------------------------------------

# The default machine's numbers in SI, written down a second time.
DRIVE = {
    "X": {"K_p": 21.59, "T_n": 0.020, "omega_0": 747.3, "D": 1.487, "R": 0.25, "L_d": 3.0e-3, "K_t": 2.4, "M_max": 150,
          "T_dyn": 0.0, "T_sym": 4.854e-3, "filter_1.f": 455.0, "filter_1.D_num": 0.10, "filter_1.D_den": 1.0},
    "Y": {"K_p": 8.310, "T_n": 0.016, "omega_0": 835.5, "D": 1.330, "R": 0.40, "L_d": 4.5e-3, "K_t": 2.2, "M_max": 100,
          "T_dyn": 0.796e-3, "T_sym": 4.058e-3, "filter_1.f": 511.0, "filter_1.D_num": 0.08, "filter_1.D_den": 0.8},
    "Z": {"K_p": 6.180, "T_n": 0.012, "omega_0": 915.3, "D": 1.214, "R": 0.45, "L_d": 5.0e-3, "K_t": 2.0, "M_max": 80.0,
          "T_dyn": 1.326e-3, "T_sym": 3.528e-3, "filter_1.f": 602.0, "filter_1.D_num": 0.08, "filter_1.D_den": 0.8},
}  # fmt: skip
FRICTION = {
    "X": {"F_C": 2.4, "F_S": 3.1, "F_log": 0.6, "sigma_0": 450.0, "sigma_1": 1.2, "sigma_2": 0.010},
    "Y": {"F_C": 2.0, "F_S": 2.6, "F_log": 0.4, "sigma_0": 400.0, "sigma_1": 1.0, "sigma_2": 0.008},
    "Z": {"F_C": 1.6, "F_S": 2.1, "F_log": 0.4, "sigma_0": 300.0, "sigma_1": 0.8, "sigma_2": 0.006},
}
COMMON = {"v_s": 0.6, "beta": 1.0, "v_log": 3.0, "asymmetry": 0.0, "W": 0.040, "gamma": 0.35}


@pytest.mark.parametrize("name", ["X", "Y", "Z"])
def test_default_machine(name: str) -> None:
    machine = load_machine(MACHINE.parent)
    axis = machine.axes[name]
    drive = axis.drive.parameters()
    L, R = DRIVE[name]["L_d"], DRIVE[name]["R"]
    assert {key: drive[key] for key in DRIVE[name]} == DRIVE[name]
    # Written in the file with 16 to 17 digits.
    assert drive["current.K_p"] == pytest.approx(L * 2 * math.pi * 550, rel=4e-16)
    assert drive["current.T_n"] == pytest.approx(L / R, rel=4e-16)
    assert drive["K_v"] == pytest.approx(200 / 3, rel=4e-16)
    rest = {"L_q": L, "p": 5, "u_max": 350.0, "k_ffw": 1.0, "T_ref": 0.0, "filter_1.type": 1, "filter_2.type": 0}
    switches = {"symmetry_lag": False, "ramp_speed_setpoint": True, "speed_integrator": True, "reference_model": True}
    assert {key: drive[key] for key in (*rest, *switches)} == rest | switches
    start = {key: row.start for key, row in units.parameters("friction").items()}
    assert axis.friction.parameters() == start | COMMON | FRICTION[name]
    assert (axis.pitch, axis.max_acceleration, axis.max_speed, axis.M_0) == (0.020, 14.4, 0.5, 0.0)
    assert axis.travel == (0.0, {"X": 1.770, "Y": 0.655, "Z": 0.685}[name])
    assert axis.I_P * 2 * math.pi == pytest.approx(0.020, rel=4e-16)


def test_default_machine_as_a_whole() -> None:
    machine = load_machine(MACHINE)
    assert list(machine.axes) == ["X", "Y", "Z"]
    assert machine.pose == {"X": 0.8, "Y": 0.327, "Z": 0.1}
    assert (machine.cycles.T_c, machine.cycles.T_pos, machine.cycles.T_ipo) == (125e-6, 1e-3, 2e-3)
    assert (machine.path.jerk, machine.path.acceleration) == (150.0, 14.4)
    assert machine.modes.file == MACHINE.parent / "modes.csv"
    assert machine.directory == MACHINE.parent
    assert "ynthetic" in machine.note


def test_shipped_scenarios() -> None:
    positioning = load(SCENARIOS / "z_positioning.yaml")
    assert positioning.motions == (Move(by={"Z": 0.1}, feed=5 / 60), Dwell(duration=1.2))
    assert positioning.evaluate == (Positioning(axis="Z", band=1e-6),)
    assert (positioning.coupling.scheme, positioning.coupling.substeps) == ("extrapolated", 1)
    assert positioning.file == SCENARIOS / "z_positioning.yaml"

    circle = load(SCENARIOS / "xz_circle.yaml")
    assert circle.motions[0] == Circle(plane=("X", "Z"), radius=0.015, feed=0.05, direction="both", turns=3)
    assert circle.evaluate == (CircleTest(turn=2),)

    measured = load(SCENARIOS / "z_measured.yaml").motions[0]
    assert isinstance(measured, MeasuredSetpoints)
    assert measured.file == SCENARIOS / "recordings" / "z_setpoint.csv"
    assert measured.columns == {"Z": Column(column="Z.x_s")}


# --- agreement with the units' tables -------------------------------------------------------------------------------

ROW = re.compile(
    r"""^(REAL|INTEGER|BOOLEAN)(_OF)?\(\s*(?:(?P<group>\w+),\s*(?=\w+,\s*parameter))?"""
    r"""(?P<name>\w+),\s*parameter,\s*\w+,"""
    r"""\s*(?P<start>[^,]+)(?:,\s*"(?P<unit>[^"]*)",\s*"(?P<display>[^"]*)",\s*(?P<min>[^,]+),\s*(?P<max>[^,]+)|"""
    r""",\s*(?P<imin>[-0-9]+),\s*(?P<imax>[-0-9]+))?""",
    re.MULTILINE,
)


def table(unit: str) -> dict[str, dict[str, Any]]:
    """Parameters of a unit as its variables.def declares them."""
    text = (ROOT / "src" / f"{unit}_fmu" / "variables.def").read_text()
    rows = {}
    for match in ROW.finditer(text):
        name = f"{match['group']}.{match['name']}" if match["group"] else match["name"]
        rows[name] = {"kind": match[1], **match.groupdict()}
    return rows


def fields(model: type[BaseModel], prefix: str = "") -> dict[str, Any]:
    """Dotted key -> field of a model and of the models inside."""
    found: dict[str, Any] = {}
    for name, info in model.model_fields.items():
        inner = [part for part in (info.annotation, *get_args(info.annotation)) if isinstance(part, type)]
        groups = [part for part in inner if issubclass(part, BaseModel)]
        if groups:
            found |= fields(groups[0], f"{prefix}{name}.")
        else:
            found[prefix + name] = info
    return found


def notes(annotation: Any, metadata: list[Any]) -> list[Any]:
    return [*metadata, annotation, *(note for part in get_args(annotation) for note in notes(part, []))]


@pytest.mark.parametrize(
    ("model", "unit", "elsewhere"), [(Friction, "friction", set()), (Drive, "controller", {"T_c", "T_pos", "I_P"})]
)
def test_keys_units_and_ranges_are_those_of_the_unit(model: type[BaseModel], unit: str, elsewhere: set[str]) -> None:
    rows, keys = table(unit), fields(model)
    keys.pop("identified", None)  # where a friction file came from: nothing that the unit knows
    assert len(rows) >= 12
    assert set(keys) == set(rows) - elsewhere
    for name, info in keys.items():
        row, found = rows[name], notes(info.annotation, info.metadata)
        quantity = next((note for note in found if isinstance(note, Quantity)), None)
        if row["kind"] == "REAL":
            assert quantity is not None, name
            assert quantity.unit == row["unit"], name
            assert units.unit(quantity.unit).factor == units.unit(row["unit"]).factor, name
            low = -math.inf if row["min"] == "NO_MIN" else float(row["min"])
            high = math.inf if row["max"] == "NO_MAX" else float(row["max"])
            assert (quantity.minimum, quantity.maximum, quantity.above) == (low, high, -math.inf), name
            units.parse(f"1 {row['display']}", quantity.unit)
        elif row["kind"] == "BOOLEAN":
            assert bool in found, name
        elif name == "p":
            assert (row["imin"], row["imax"]) == ("1", "1000")
        elif name == "speed_window":
            assert (row["imin"], row["imax"]) == ("0", "1000")
        elif name == "measuring.seed":
            assert (row["imin"], row["imax"]) == ("0", "2147483647")
        elif name == "friction_table.points":
            assert (row["imin"], row["imax"]) == ("0", "8")
        else:
            assert set(get_args(info.annotation)) == {"off", "second_order", "band_stop", "low_pass"}, name


def test_the_default_machines_z_axis_is_what_the_units_start_with() -> None:
    axis = load_machine(MACHINE).axes["Z"]
    cycles = {"T_c": 125e-6, "T_pos": 1e-3, "I_P": axis.I_P}
    for unit, given in (("friction", axis.friction.parameters()), ("controller", axis.drive.parameters() | cycles)):
        for name, row in table(unit).items():
            if name in given and not name.endswith(".type"):
                # 1 ulp: the tables hold decimal text of the same numbers.
                assert float(given[name]) == pytest.approx(float(row["start"]), rel=3e-16, abs=0), name


@pytest.mark.parametrize(("override", "interval"), [((), 1e-3), (("machine.cycles.position=0.5 ms",), 0.5e-3)])
def test_recording_interval_defaults_to_the_position_cycle(
    tmp_path: Path, override: tuple[str, ...], interval: float
) -> None:
    path = tmp_path / "s.yaml"
    path.write_text(f"name: s\nmachine: {MACHINE}\nmotions: [{{kind: dwell, duration: 1 s}}]\n", encoding="utf-8")
    assert load(path, list(override)).recording.interval == interval


# --- models built in Python -----------------------------------------------------------------------------------------


def test_numbers_are_si_in_python() -> None:
    machine = load_machine(MACHINE)
    scenario = Scenario.model_validate({"name": "s", "machine": machine, "motions": [Move(by={"Z": 0.1}, feed=0.08)]})
    assert scenario.recording.interval == machine.cycles.T_pos
    with_units = Move.model_validate({"kind": "move", "by": {"Z": "100 mm"}, "feed": "5 m/min"})
    assert with_units == Move(by={"Z": 0.1}, feed=5 / 60)
    with pytest.raises(ValidationError, match="the machine has no axis 'Q'"):
        Scenario(
            name="s", machine=machine, motions=(Move(by={"Q": 0.1}, feed=0.08),), recording=Recording(interval=1e-3)
        )
    with pytest.raises(ValidationError, match="no whole multiple"):
        Scenario(name="s", machine=machine, motions=(Dwell(duration=1),), recording=Recording(interval=1.1e-3))
    with pytest.raises(ValidationError):
        scenario.name = "t"


def test_a_simple_drive_needs_no_motor_and_no_integrator() -> None:
    drive = Drive(
        K_v=50, T_sym=0, K_p=1, M_max=10, K_t=1, ideal_current_loop=True, speed_integrator=False, reference_model=False
    )
    assert "R" not in drive.parameters()
    assert drive.parameters()["ideal_current_loop"] is True
    with pytest.raises(ValidationError, match="missing key 'R'; needed as long as ideal_current_loop is false"):
        Drive(K_v=50, T_sym=0, K_p=1, M_max=10, K_t=1, speed_integrator=False, reference_model=False)


def test_groups_of_parameters() -> None:
    assert Filter(type="second_order", f=100, D_num=0.1, D_den=1).parameters() == {
        "type": 1, "f": 100.0, "D_num": 0.1, "D_den": 1.0
    }  # fmt: skip
    assert Filter(type="low_pass", f=100, D_den=1).parameters() == {"type": 2, "f": 100.0, "D_den": 1.0}
    assert CurrentController(K_p=1, T_n=0.01).parameters() == {"K_p": 1.0, "T_n": 0.01}


def test_motions_in_full() -> None:
    arc = Arc(
        plane=("X", "Z"), feed=1, centre_by={"X": 0, "Z": 0.01}, angle=math.pi / 2, jerk=10, direction="clockwise"
    )
    assert arc.angle == math.pi / 2
    assert Circle(plane=("X", "Z"), radius=0.01, feed=1, start_angle=0.1).turns == 1


@pytest.mark.parametrize("k", [1, 2, 3, 7, 8, 1000, 123457])
def test_multiples_survive_decimal_rounding(k: int) -> None:
    for step in (125e-6, 1e-3, 31.25e-6, 1 / 3):
        assert is_multiple(k * step, step)
        assert is_multiple(float(f"{k * step:.12g}"), step)
        assert not is_multiple((k + 1e-3) * step, step)
    assert not is_multiple(0.5e-3, 1e-3)


def test_cycles_accept_equal_and_multiple() -> None:
    assert Cycles(control=125e-6, position=125e-6, interpolation=1e-3).T_pos == 125e-6


def test_machine_models_are_complete_without_files() -> None:
    machine = load_machine(MACHINE)
    again = Machine.model_validate(machine.model_dump())  # numbers in SI
    assert again.model_dump() == machine.model_dump()
