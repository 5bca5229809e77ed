"""Each unit alone: what drives it, what is compared, and the same done by hand through the FMI."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile

import numpy as np

from feedsim.simulation.cosim.archive import Archive
from feedsim.simulation.cosim.operations import Interpreter, do_step
from feedsim.simulation.cosim.unit import Port, Unit
from importers import z_move
from importers.system import Component, Experiment, Floats, Result, System, Value

STEP = 125e-6  # s
STEPS = 1600


def _signals() -> dict[str, Floats]:
    """Inputs that move every unit through its interesting parts: reversals, a stop, a jump; (STEPS + 1,) each."""
    time = np.arange(STEPS + 1) * STEP
    wave = np.sin(2 * np.pi * 8 * time)
    ramp = np.minimum(time, 0.1)
    return {
        "speed": 20.0 * wave * (time < 0.16),  # rad/s: slides, reverses, sticks
        "torque": 3.0 * wave + 2.0 * (time > 0.05),  # N.m
        "friction": 1.5 * np.sign(wave) * np.minimum(1.0, 40.0 * np.abs(wave)),  # N.m
        "other_torque": -2.0 * wave,  # N.m
        "other_friction": 0.5 * np.sign(wave),  # N.m
        "x_s": 0.1 + 0.02 * ramp,  # m
        "x_a": 0.1 + 0.02 * np.maximum(ramp - 0.005, 0.0),  # m
        "n_ffw": np.where(time < 0.1, 6.28, 0.0),  # rad/s
        "n_a": np.where((time > 0.005) & (time < 0.105), 6.28, 0.0),  # rad/s
    }


@dataclass(frozen=True)
class Case:
    """A unit alone: input -> name of its signal, outputs to compare, parameters unlike the defaults (of every type).

    Every input has a signal of its own: of two inputs of one unit on the same output, Maestro serves only one.
    """

    unit: str
    inputs: Mapping[str, str]
    outputs: tuple[str, ...]
    start: Mapping[str, Value]


CASES = (
    Case("friction", {"n_fr": "speed"}, ("M_fr",), {"F_C": 2.0, "F_S": 2.9}),
    Case("friction_gms", {"n_fr": "speed"}, ("M_fr",), {"F_C": 2.0, "F_S": 2.9, "spread": 40.0}),
    Case(
        "plant",
        {"X.M_a": "torque", "X.M_fr": "friction", "Z.M_a": "other_torque", "Z.M_fr": "other_friction"},
        ("X.x_a", "X.n_a", "X.n_fr", "Z.x_a", "Z.n_fr", "tool.x_Z"),
        {"X.x_0": 0.25},
    ),
    Case(
        "controller",
        {"x_s": "x_s", "n_ffw": "n_ffw", "x_a": "x_a", "n_a": "n_a"},
        ("M_a", "x_e", "n_s", "u_q"),
        {"K_v": 50.0, "symmetry_lag": True, "ramp_speed_setpoint": False, "filter_2.type": 2},
    ),
)


def experiment(case: Case) -> Experiment:
    return Experiment(STEP, STEPS, tuple((case.unit, name) for name in case.outputs))


def _without_units(table: Path, bare: Path) -> Path:
    """The archive without units of measure: Maestro connects only equal ones, and this table plays anything."""
    with ZipFile(table) as given, ZipFile(bare, "w", ZIP_DEFLATED) as taken:
        for name in given.namelist():
            content = given.read(name)
            if name == "modelDescription.xml":
                content = re.sub(rb'<Real (declaredType|unit)="[^>]*?/>', b"<Real/>", content)
            taken.writestr(name, content)
    return bare


def with_enumerations(controller: Path, changed: Path) -> Path:
    """The archive with the types of the filters as FMI enumerations; its library is the same."""
    items = "".join(f'<Item name="{name}" value="{i}"/>' for i, name in enumerate(("off", "second_order", "low_pass")))
    declared = f'<SimpleType name="FilterType"><Enumeration>{items}</Enumeration></SimpleType></TypeDefinitions>'
    with ZipFile(controller) as given, ZipFile(changed, "w", ZIP_DEFLATED) as taken:
        for name in given.namelist():
            content = given.read(name)
            if name == "modelDescription.xml":
                pattern = rb'(name="filter_\d\.type"[^>]*>\s*)<Integer( [^>]*/>)'
                content, found = re.subn(pattern, rb'\1<Enumeration declaredType="FilterType"\2', content)
                assert found == 4
                content = content.replace(b"</TypeDefinitions>", declared.encode())
            taken.writestr(name, content)
    return changed


def with_table(case: Case, fmus: Path, folder: Path) -> System:
    """The unit, driven by the unit that plays a table: two columns of the table per axis of it, whatever they mean."""
    signals, names = _signals(), list(dict.fromkeys(case.inputs.values()))
    columns: dict[str, tuple[Floats, Floats]] = {}
    port: dict[str, str] = {}
    for i in range(0, len(names), 2):
        axis, pair = f"S{i}", (names[i], names[min(i + 1, len(names) - 1)])
        columns[axis] = (signals[pair[0]], signals[pair[1]])
        port[pair[1]], port[pair[0]] = f"{axis}.n_ffw", f"{axis}.x_s"
    time = np.arange(STEPS + 1) * STEP
    table = _without_units(z_move.table(fmus, folder / "table.fmu", time, columns), folder / "signals.fmu")
    # Start values that are the first row's: some importers initialise a unit before it knows its inputs.
    held = {given: float(signals[name][0]) for given, name in case.inputs.items()}
    return System(
        {"signals": Component(table), case.unit: Component(fmus / f"{case.unit}.fmu", {**case.start, **held})},
        tuple((("signals", port[name]), (case.unit, given)) for given, name in case.inputs.items()),
    )


def inputs(case: Case) -> dict[str, Floats]:
    signals = _signals()
    return {given: signals[name] for given, name in case.inputs.items()}


def by_hand(case: Case, fmus: Path) -> Result:
    """The unit stepped by our own calls, inputs set to row k before the step from t_k. No table unit is involved."""
    given = inputs(case)
    do = experiment(case)
    result: Result = {key: np.empty(STEPS + 1) for key in do.record}
    with Archive(fmus / f"{case.unit}.fmu") as archive:
        unit = Unit(archive, case.unit)
        try:
            unit.set_parameters(case.start)
            unit.enter_initialisation(0.0, do.stop)
            port, out = Port(unit, list(given)), Port(unit, list(case.outputs))
            steps = Interpreter([do_step(unit, 0.0, STEP)], STEP)
            for k in range(STEPS + 1):
                if k == 1:
                    unit.exit_initialisation()
                if k:
                    steps.run(k - 1, k)
                port.values[:] = [column[k] for column in given.values()]
                if k == 0:
                    port.set()
                out.get()
                for key, value in zip(do.record, out.values, strict=True):
                    result[key][k] = value
                if k:
                    port.set()
        finally:
            unit.close()
    return result
