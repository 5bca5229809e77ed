"""Each unit alone in every importer gives what the same calls made by hand give."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from importers import alone, loops, with_fmpy, z_move
from importers.registry import Importer
from importers.system import FINISHED, RELEASE, Component, Experiment, Result, System, difference

# Relative to the largest value. libcosim's time is whole nanoseconds and its steps differences of such times, exact to
# some 1e-17 s of 125 us, so 1e-13 of a step; measured are 3e-15. In the others no bit differs.
SAME = 1e-12
ENUMERATIONS_UNKNOWN = ("ecos", "libcosim", "Maestro")  # what becomes of them there: docs/importing.md, "choices"


def _agree(result: Result, expected: Result, *, first: int = 0) -> None:
    for key, values in expected.items():
        assert np.ptp(values) > 0.0, f"{key} does nothing: it would prove nothing"
        scale = np.max(np.abs(values))
        assert difference(result[key][first:], values[first:]) <= SAME * scale, key


# Two units show how an importer calls them; the wired system, which is run with each importer, has all of them.
@pytest.mark.parametrize(
    "case",
    [
        pytest.param(case, marks=() if case.unit in ("plant", "friction") else pytest.mark.extensive)
        for case in alone.CASES
    ],
    ids=lambda case: case.unit,
)
def test_a_unit_alone(case: alone.Case, importer: Importer, fmus: Path, tmp_path: Path) -> None:
    if importer.sequential:
        pytest.skip("one after the other, the unit would get its inputs a step early: compared in the wired system")
    if importer.master.zeros:
        pytest.skip("its first step is made with zeros: simulate_fmu is compared instead")
    result = importer.run(alone.with_table(case, fmus, tmp_path), alone.experiment(case), tmp_path)
    _agree(result, alone.by_hand(case, fmus))


@pytest.mark.extensive
def test_why_choices_are_no_enumerations(importer: Importer, fmus: Path, tmp_path: Path) -> None:
    """Most importers cannot set one; the page says so. Who learns it fails here, and the page is to be changed."""
    if importer.sequential or importer.master.zeros:
        pytest.skip("not compared alone, as above")
    (case,) = (case for case in alone.CASES if "filter_2.type" in case.start)
    system = alone.with_table(case, fmus, tmp_path)
    changed = alone.with_enumerations(fmus / "controller.fmu", tmp_path / "controller.fmu")
    parts = {**system.components, case.unit: Component(changed, system.components[case.unit].start)}
    expected = alone.by_hand(case, fmus)
    try:
        _agree(importer.run(System(parts, system.connections), alone.experiment(case), tmp_path), expected)
    except (AssertionError, KeyError):
        assert importer.name in ENUMERATIONS_UNKNOWN
    else:
        assert importer.name not in ENUMERATIONS_UNKNOWN


@pytest.mark.parametrize("case", alone.CASES, ids=lambda case: case.unit)
def test_a_unit_alone_in_simulate_fmu(case: alone.Case, fmus: Path) -> None:
    component = Component(fmus / f"{case.unit}.fmu", case.start)
    result = with_fmpy.run_unit(component, alone.inputs(case), alone.experiment(case))
    _agree(result, alone.by_hand(case, fmus))


@pytest.mark.extensive
def test_a_boolean_connection_carries(importer: Importer, fmus: Path, tmp_path: Path) -> None:
    """A drive that is released when the table has ended. In the wired system every drive always is, which one that took
    no notice of the connection would be, too."""
    time = np.arange(41) * 1e-3
    x_s = 1e-5 * time / time[-1]  # x_a stays at its start value, 0
    table = z_move.table(fmus, tmp_path / "table.fmu", time, {"Z": (x_s, np.zeros(41))})
    do = Experiment(alone.STEP, 640, (("controller", "M_a"), ("controller", "x_e")))
    system = System(
        {"setpoint": Component(table), "controller": Component(fmus / "controller.fmu")},
        ((("setpoint", "Z.x_s"), ("controller", "x_s")), (("setpoint", FINISHED), ("controller", RELEASE))),
    )
    result = importer.run(system, do, tmp_path)
    _agree(result, loops.run(system, do, importer.master))
    told = result["controller", "M_a"]
    ended = 40 * 8 + 1  # the row counts at the end of the step that reaches it
    assert np.nanmax(np.abs(told[:ended])) == 0.0
    assert np.nanmax(np.abs(told[ended:])) > 0.1


@pytest.mark.extensive
def test_the_setpoint_unit_alone(move: z_move.Move, system: System, importer: Importer, tmp_path: Path) -> None:
    """The planned motion comes out bit by bit, held over the position cycle. One unit needs no second one: except in
    Maestro, which wants a connection."""
    names = {"Z.x_s": move.program.x_s["Z"], "Z.n_ffw": move.program.n_ffw["Z"]}
    do = Experiment(move.experiment.step, 2000, tuple(("setpoint", name) for name in names))
    parts = {"setpoint": system.components["setpoint"], "controller_Z": system.components["controller_Z"]}
    pair = System(parts, tuple((("setpoint", name), ("controller_Z", name.removeprefix("Z."))) for name in names))
    result = importer.run(pair, do, tmp_path)
    row = np.arange(do.steps + 1) // round(1e-3 / do.step)
    for name, column in names.items():
        told = np.isfinite(result["setpoint", name])
        np.testing.assert_array_equal(result["setpoint", name][told], column[row][told])
        assert told.sum() >= do.steps
