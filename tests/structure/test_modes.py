"""The mode table as the master reads it: what it says of an axis, and what is wrong with a broken one."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from feedsim import scenario
from feedsim.files.fields import FileContent
from feedsim.foundation.errors import InputError
from feedsim.structure import checked_modes, read_modes

MACHINE = Path(__file__).resolve().parents[2] / "scenarios" / "machines" / "test_centre"
AXES = ("X", "Y", "Z")


def test_default_machine_figures() -> None:
    modes = checked_modes(scenario.load_machine(MACHINE))
    assert len(modes.frequency) == 93
    assert int(modes.rigid.sum()) == 3
    # Figures of the synthetic machine, given to four digits.
    assert [modes.J_tot(axis) for axis in AXES] == pytest.approx([0.08592, 0.02645, 0.01639], rel=5e-4)
    assert [modes.J_inf(axis) for axis in AXES] == pytest.approx([0.01514, 0.01118, 0.00754], rel=7e-4)
    # A pitch of 20 mm, and no axis moves another one's scale.
    np.testing.assert_allclose(modes.leads(AXES), np.eye(3) * 0.02 / (2 * np.pi), rtol=1e-6, atol=1e-9)


def test_basis_of_the_rigid_modes_is_arbitrary(tmp_path: Path) -> None:
    lines = (MACHINE / "modes.csv").read_text().splitlines()
    cells = np.array([[float(cell) for cell in line.split(",")] for line in lines[1:]])
    rng = np.random.default_rng(5)
    rotation = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    cells[:3, 3:] = rotation @ cells[:3, 3:]
    turned = tmp_path / "modes.csv"
    turned.write_text("\n".join([lines[0], *(",".join(repr(float(c)) for c in row) for row in cells)]) + "\n")
    before, after = read_modes(MACHINE / "modes.csv", AXES), read_modes(turned, AXES)
    for axis in AXES:
        assert after.J_tot(axis) == pytest.approx(before.J_tot(axis), rel=1e-12)
    np.testing.assert_allclose(after.leads(AXES), before.leads(AXES), rtol=1e-9, atol=1e-15)


Change = Callable[[list[str]], list[str]]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda lines: [], r"modes\.csv: empty; a table of modes begins with a header"),
        (lambda lines: lines[:1], r"modes\.csv: empty: a header, but no modes"),
        (lambda lines: [lines[0].replace("n_Z", "n_Q"), *lines[1:]], r"modes\.csv:1: column 'n_Z' is missing"),
        (lambda lines: [lines[0].replace("n_Z", "n_Q"), *lines[1:]], r"modes\.csv:1: column 'n_Q' belongs to no axis"),
        (lambda lines: [*lines[:6], lines[6].replace("32.5", "-32.5"), *lines[7:]], r"modes\.csv:7: .*freq.*negative"),
        (lambda lines: [*lines[:6], lines[6].replace("0.02,", "nan,"), *lines[7:]], r"modes\.csv:7: column 'damping"),
        (lambda lines: [*lines[:6], lines[6] + ",1", *lines[7:]], r"modes\.csv:7: 13 cells; the header has 12"),
        (lambda lines: [lines[0], *lines[4:]], r"0 rigid modes .*; 3 are needed"),
        (lambda lines: [lines[0], lines[1], lines[1], lines[1], *lines[4:]], r"3 rigid modes .*independently"),
    ],
)  # fmt: skip
def test_broken_table_is_refused_with_its_line(tmp_path: Path, change: Change, message: str) -> None:
    broken = tmp_path / "modes.csv"
    lines = change((MACHINE / "modes.csv").read_text().splitlines())
    broken.write_text("".join(line + "\n" for line in lines))
    machine = scenario.load_machine(MACHINE).model_copy(update={"modes": FileContent.read(broken)})
    with pytest.raises(InputError, match=message):
        checked_modes(machine)


def test_pitch_that_the_modes_contradict(tmp_path: Path) -> None:
    machine = scenario.load_machine(MACHINE)
    axes = dict(machine.axes) | {"Z": machine.axes["Z"].model_copy(update={"pitch": 0.010})}
    with pytest.raises(InputError, match=r"axis Z travels 20 mm per revolution by its modes; .* pitch: 10 mm"):
        checked_modes(machine.model_copy(update={"axes": axes}))
