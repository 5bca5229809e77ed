"""One parameter of a drive off by a factor: sentence, action, Next and "What to change" name that one."""

from __future__ import annotations

import random

import pytest

import feedsim as fs
from feedsim.report.changes import changes_section
from feedsim.report.content import Table

# Parameter -> unit, and the factors that make a circle worse. A higher gain and a shorter T_n make it better here.
OFF = {
    "K_v": ("1/s", (0.4, 0.75)),
    "K_p": ("N.m.s/rad", (0.4, 0.8)),
    "T_n": ("s", (1.4, 3.0)),
    "T_sym": ("s", (0.5, 0.9)),
    "k_ffw": ("1", (0.5, 0.97)),
    "omega_0": ("rad/s", (0.5, 0.8)),
    "D": ("1", (1.3, 2.0)),
}
MACHINES, RIGHT = 20, 19


@pytest.fixture(scope="module")
def circle(tmp_path_factory: pytest.TempPathFactory) -> str:
    folder = tmp_path_factory.mktemp("circle")
    fs.example("xz_circle", to=folder)
    return str(folder / "xz_circle.yaml")


def test_the_parameter_that_is_off_is_named(circle: str) -> None:
    """Twenty draws of the default machine: axis, parameter and factor at random. Nothing contradicts anything."""
    draw = random.Random(40)
    machine, right = fs.load(circle).machine, 0
    for k in range(MACHINES):
        name = list(OFF)[k % len(OFF)]
        axis, (unit, span) = draw.choice("XZ"), OFF[name]
        factor = draw.uniform(*span)
        if name == "T_sym" and draw.random() < 0.5:
            factor = 1 / factor
        value = factor * getattr(machine.axes[axis].drive, name)
        result = fs.run(
            circle, set={f"machine.axes.{axis}.drive.{name}": f"{value!r}{'' if unit == '1' else f' {unit}'}"}
        )
        first = result.changes[0]
        page = result.report()
        said = (first.what, page.answer[0], page.action, page.next_step.words if page.next_step else "")
        section = changes_section(result.changes)
        assert section is not None
        table = next(part for part in section.parts if isinstance(part, Table))
        for text in said[1:]:
            assert first.what in text, said
        assert (table.rows[0][1], getattr(table.rows[0][2], "text", "")) == (
            first.axis,
            first.parameter.removeprefix("drive."),
        )
        named = (first.axis, first.parameter) == (axis, f"drive.{name}")
        right += named and first.proposed == pytest.approx(value / factor, rel=0.15)
    assert right >= RIGHT
