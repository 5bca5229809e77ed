"""Wiring is refused before the first step when an input is unconnected, driven twice or in another unit."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from feedsim.foundation.errors import InputError
from feedsim.simulation.cosim import system
from feedsim.simulation.cosim.archive import Archive
from feedsim.simulation.cosim.system import Connection, Variable

AXES = ("X", "Y", "Z")


@pytest.fixture(scope="module")
def instances(fmus: Path) -> Iterator[dict[str, Archive]]:
    with (
        Archive(fmus / "plant.fmu") as plant,
        Archive(fmus / "controller.fmu") as controller,
        Archive(fmus / "friction.fmu") as friction,
    ):
        yield {
            "plant": plant,
            **{system.controller(axis): controller for axis in AXES},
            **{system.friction(axis): friction for axis in AXES},
        }


def test_figure_2_is_complete(instances: dict[str, Archive]) -> None:
    connections = system.figure_2(AXES)
    system.check(connections, instances)
    inputs = sum(v.causality == "input" for archive in instances.values() for v in archive.variables.values())
    assert len(connections) == inputs


def test_unconnected_input_is_named(instances: dict[str, Archive]) -> None:
    connections = [c for c in system.figure_2(AXES) if c.target != Variable("friction_Y", "n_fr")]
    with pytest.raises(InputError, match=r"friction_Y/n_fr is an input without a connection"):
        system.check(connections, instances)


def test_input_driven_twice_is_named(instances: dict[str, Archive]) -> None:
    connections = [*system.figure_2(AXES), Connection(Variable("plant", "X.M_fr"), Variable("friction_Y", "M_fr"))]
    with pytest.raises(InputError, match=r"plant/X\.M_fr is connected 2 times"):
        system.check(connections, instances)


def test_every_drive_is_released_by_the_source_of_its_setpoints(instances: dict[str, Archive]) -> None:
    sources = {each.target: each.source for each in system.figure_2(AXES)}
    for axis in AXES:
        assert sources[Variable(f"controller_{axis}", "release")] == Variable(system.NC, f"{axis}.release")
    connections = [
        Connection(each.target, Variable("plant", "X.x_a")) if each.target.name == "release" else each
        for each in system.figure_2(AXES)
    ]
    with pytest.raises(InputError, match=r"controller_X/release is in 1, but plant/X\.x_a is in m"):
        system.check(connections, instances)


def test_other_unit_is_refused(instances: dict[str, Archive]) -> None:
    target = Variable("controller_X", "x_a")
    connections = [
        Connection(target, Variable("plant", "X.n_a")) if c.target == target else c for c in system.figure_2(AXES)
    ]
    with pytest.raises(InputError, match=r"controller_X/x_a is in m, but plant/X\.n_a is in rad/s"):
        system.check(connections, instances)


def test_unknown_variable_and_wrong_causality_are_listed_together(instances: dict[str, Archive]) -> None:
    connections = [
        *system.figure_2(AXES),
        Connection(Variable("plant", "A.M_a"), Variable("controller_X", "M_a")),
        Connection(Variable("plant", "X.n_a"), Variable("controller_X", "M_a")),
    ]
    with pytest.raises(InputError) as caught:
        system.check(connections, instances)
    assert "plant/A.M_a does not exist or is no input" in str(caught.value)
    assert "plant/X.n_a does not exist or is no input" in str(caught.value)
