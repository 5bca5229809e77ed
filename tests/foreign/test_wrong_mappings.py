"""What cannot fill a role is refused before the first step: what is missing, what is there, the nearest name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from feedsim import scenario
from feedsim.foundation.errors import InputError
from feedsim.simulation import judge, nc
from foreign import acme
from foreign.conftest import Libraries
from foreign.test_foreign_units import MOTION, ROOT

DRIVE: dict[str, Any] = {**acme.MAPPED_DRIVE, "fmu": "acme_drive.fmu"}
FRICTION: dict[str, Any] = {**acme.MAPPED_FRICTION, "fmu": "acme_friction.fmu"}


def inputs(**changes: str) -> dict[str, Any]:
    return {"inputs": {**acme.MAPPED_DRIVE["inputs"], **changes}}


def outputs(**changes: str) -> dict[str, Any]:
    return {"outputs": {**acme.MAPPED_DRIVE["outputs"], **changes}}


def parameters(**given: Any) -> dict[str, Any]:
    return {"parameters": given}


def without(group: str, name: str) -> dict[str, Any]:
    return {group: {key: value for key, value in acme.MAPPED_DRIVE[group].items() if key != name}}


def refusal(folder: Path, fmus: Path, drive: Mapping[str, Any], friction: Mapping[str, Any]) -> str:
    """What is said of these units on an axis, checked and not run."""
    file = folder / "s.yaml"
    file.write_text(MOTION.format(machine=ROOT / "scenarios" / "machines" / "emps"), encoding="utf-8")
    text = {name: str(group).replace("True", "true") for name, group in (("drive", drive), ("friction", friction))}
    named = "".join(f"  machine.axes.X.{name}: {group}\n" for name, group in text.items())
    file.write_text(file.read_text(encoding="utf-8") + f"set:\n{named}", encoding="utf-8")
    try:
        loaded = scenario.load(file)
        judge.check(loaded, nc.plan(loaded), fmus=fmus)
    except InputError as error:
        return str(error)
    pytest.fail("nothing was refused")


def write_both(folder: Path, libraries: Libraries) -> None:
    acme.archive(folder / "acme_drive.fmu", "drive", libraries.drive, acme.DRIVE)
    acme.archive(folder / "acme_friction.fmu", "friction", libraries.friction, acme.FRICTION)


LISTED = "input: PosSetpoint, PosActual, SpeedForward, SpeedActual, Override, Enable"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        # with file and line, by the scenario alone
        ({"fmu": "acme_drvie.fmu"}, ["s.yaml:9: machine.axes.X.drive.fmu: no such file", "acme_drvie.fmu"]),
        (without("inputs", "x_a"), ["s.yaml:9: machine.axes.X.drive.inputs.x_a: missing", "measured axis position"]),
        (without("outputs", "M_a"), ["machine.axes.X.drive.outputs.M_a: missing", "motor torque [N.m]"]),
        (inputs(xa="PosActual"), ["machine.axes.X.drive.inputs.xa: unknown key; did you mean 'x_a'?"]),
        (outputs(M="Torque"), ["machine.axes.X.drive.outputs.M: unknown key; allowed: M_a, x_e"]),
        ({"K_v": "66 1/s"}, ["X.drive.K_v: 'K_v' is a parameter of the shipped controller.fmu", "under 'parameters'"]),
        (parameters(Kv=[1]), ["X.drive.parameters.Kv: a list is no value of a variable"]),
        # by what the archive says of itself
        (inputs(x_a="PosAktual"), ["x_a: 'PosAktual' is no variable", "did you mean 'PosActual'?", LISTED]),
        (inputs(x_a="Torque"), ["x_a: 'Torque' is output, input is needed", LISTED]),
        (outputs(M_a="Kv"), ["M_a: 'Kv' is parameter, output is needed; output: Torque, SpeedSetpoint, Limited"]),
        (inputs(x_a="Enable"), ["x_a: 'Enable' is Boolean, Real is needed"]),
        (inputs(release="Override"), ["release: 'Override' is Real, Boolean is needed"]),
        (inputs(x_a="SpeedActual"), ["x_a: 'SpeedActual' is in rpm", "an angular speed", "a length is expected"]),
        (inputs(n_a="PosActual"), ["n_a: 'PosActual' stands for x_a already"]),
        (outputs(M_a="SpeedSetpoint"), ["M_a: 'SpeedSetpoint' is in rpm", "a torque is expected"]),
        (parameters(KV=1), ["'KV' is no variable", "did you mean 'Kv'?", "parameter: Kv, Kp, Tn, Lead, Limit"]),
        (parameters(Kv=-1), ["parameter 'Kv' is -1 1/s; allowed: at least 0 1/s, at most 1000 1/s"]),
        (parameters(Kv="66 mm"), ["parameter 'Kv' cannot be that: '66 mm' is a length", "declares it in 1/s"]),
        (parameters(Lead="10 mm/round"), ["machine.axes.X.drive.parameters: parameter 'Lead'", "unknown unit 'round'"]),
        (parameters(Kv=True), ["parameter 'Kv' is Real, true is no value of that type"]),
        (parameters(Torque=1), ["parameter 'Torque' stands for M_a"]),
        (parameters(Enable=True), ["parameter 'Enable' stands for release"]),
    ],
    ids=lambda value: str(value)[:40],
)  # fmt: skip
def test_a_wrong_drive(
    libraries: Libraries, fmus: Path, tmp_path: Path, change: dict[str, Any], words: list[str]
) -> None:
    write_both(tmp_path, libraries)
    told = refusal(tmp_path, fmus, DRIVE | change, FRICTION)
    assert all(each in told for each in words), told


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"version": "1.0"}, ["not a usable FMI 2.0 archive"]),
        ({"platform": "sparc32"}, ["has no binary for this platform", "it has sparc32"]),
        ({"units": {**acme.UNITS, "N.mm": {"kg": "1", "m": "1", "s": "-2"}}}, ["'Torque' is in N.mm", "a force"]),
        ({"step": "0.0003"}, ["whole multiples of its own step of 300 us", "by 1000 us", "coupling.substeps"]),
    ],
    ids=lambda value: str(value)[:40],
)  # fmt: skip
def test_an_archive_that_cannot_serve(
    libraries: Libraries, fmus: Path, tmp_path: Path, options: dict[str, Any], words: list[str]
) -> None:
    write_both(tmp_path, libraries)
    options = dict(options)
    variables = acme.FRICTION
    if unit := options.pop("unit", None):
        variables = (replace(variables[0], unit=unit), *variables[1:])
    acme.archive(tmp_path / "acme_friction.fmu", "friction", libraries.friction, variables, **options)
    told = refusal(tmp_path, fmus, DRIVE, FRICTION)
    assert all(each in told for each in words), told


def test_all_faults_of_both_units_at_once(libraries: Libraries, fmus: Path, tmp_path: Path) -> None:
    write_both(tmp_path, libraries)
    friction = FRICTION | {"inputs": {"n_fr": "speed"}, "parameters": {"Coulomp": 1}}
    told = refusal(tmp_path, fmus, DRIVE | inputs(x_a="PosAktual", n_a="Torque"), friction)
    assert "4 problems" in told
    assert "n_fr: 'speed' is no variable of the archive; did you mean 'Speed'?" in told


def test_a_text_that_is_no_archive(fmus: Path, libraries: Libraries, tmp_path: Path) -> None:
    write_both(tmp_path, libraries)
    (tmp_path / "acme_drive.fmu").write_text("not a zip file", encoding="utf-8")
    assert "acme_drive.fmu: not a usable FMI 2.0 archive" in refusal(tmp_path, fmus, DRIVE, FRICTION)


def test_an_archive_that_allows_one_instance(fmus: Path, libraries: Libraries, tmp_path: Path) -> None:
    """One archive on two axes."""
    flags = {"canBeInstantiatedOnlyOncePerProcess": "true"}
    fmu = acme.archive(tmp_path / "acme_friction.fmu", "friction", libraries.friction, acme.FRICTION, flags=flags)
    group = {**acme.MAPPED_FRICTION, "fmu": str(fmu)}
    both = [f"machine.axes.{axis}.friction={group}" for axis in ("X", "Z")]
    loaded = scenario.load(ROOT / "scenarios" / "z_positioning.yaml", both)
    with pytest.raises(
        InputError, match="allows one instance in a process; it is named as friction of X, friction of Z"
    ):
        judge.check(loaded, nc.plan(loaded), fmus=fmus)


def test_a_unit_without_units_is_taken_to_be_in_si(fmus: Path, libraries: Libraries, tmp_path: Path) -> None:
    variables = tuple(replace(each, unit=None) for each in acme.FRICTION)
    fmu = acme.archive(tmp_path / "bare.fmu", "friction", libraries.friction, variables)
    loaded = scenario.load(
        ROOT / "scenarios" / "z_positioning.yaml",
        [f"machine.axes.Z.friction={ {**acme.MAPPED_FRICTION, 'fmu': str(fmu)} }"],
    )
    told = judge.check(loaded, nc.plan(loaded), fmus=fmus)
    (bare,) = (finding for finding in told if finding.code == "variable-without-unit")
    assert bare.place == "Z"
    assert "bare.fmu: modelDescription.xml gives no unit for Speed (rad/s), Torque (N.m)" in bare.text


def test_what_needs_the_shipped_law_says_so(fmus: Path, libraries: Libraries, tmp_path: Path) -> None:
    write_both(tmp_path, libraries)
    group = {**DRIVE, "fmu": str(tmp_path / "acme_drive.fmu")}
    machine = scenario.load(ROOT / "scenarios" / "z_positioning.yaml", [f"machine.axes.Z.drive={group}"]).machine
    with pytest.raises(InputError, match=r"axis Z: its drive is acme_drive\.fmu, a unit of another maker; the linear"):
        machine.shipped_drive("Z", "the linear model")
    settings = [f"machine.axes.Z.friction={ {**FRICTION, 'fmu': str(tmp_path / 'acme_friction.fmu')} }"]
    with pytest.raises(InputError, match=r"unknown key 'F_C' in machine\.axes\.Z\.friction; allowed: fmu, inputs"):
        scenario.load(ROOT / "scenarios" / "z_positioning.yaml", [*settings, "machine.axes.Z.friction.F_C=1 N.m"])
