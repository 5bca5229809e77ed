"""The units and scenarios against the pinned references, and `make check-reference` itself."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import check_reference
import make_reference
import numpy as np
import pytest
import solve_friction
import solve_friction_gms
import system
from cases import Pinned, controller_cases, friction_cases, friction_gms_cases
from reference_files import HERE, UNITS, all_cases, read_case, read_table, same_but_for_the_last_digit, write_table
from run_case import simulate
from solve_friction import OWN_ERROR

from feedsim.comparison import bounds_of, compare, tolerances_of
from feedsim.files.trace import Series

CASES, BOUNDS = all_cases(), ".bounds.csv"
NAMES = {f"{unit}/{'held/' if held else ''}{name}" for unit, name, held in CASES}
SYSTEMS = {f"{system.FOLDER}/{wanted.name}" for wanted in system.SYSTEMS}


@pytest.mark.parametrize(("unit", "name", "held"), CASES)
def test_unit(unit: str, name: str, held: bool, fmus: Path) -> None:
    found = check_reference.check_case(fmus / f"{unit}.fmu", read_case(unit, name, held=held))
    assert found.heading == "same", found.line  # in all rows
    assert len(found.variables) == len(read_case(unit, name, held=held).reference) - 1


@pytest.mark.parametrize("wanted", system.SYSTEMS, ids=lambda wanted: wanted.name)
def test_scenario(wanted: system.Scenario, fmus: Path) -> None:
    found = check_reference.check_system(fmus, wanted)
    assert found.heading == "same", found.line  # in all rows
    assert len(found.variables) == len(wanted.variables)


@pytest.mark.parametrize("wanted", system.SYSTEMS, ids=lambda wanted: wanted.name)
def test_scenario_as_one_unit(wanted: system.Scenario, fmus: Path) -> None:
    found = check_reference.check_one_unit(fmus, wanted)
    assert found.heading == "same", found.line
    assert len(found.variables) == len(wanted.variables)


@pytest.mark.extensive
@pytest.mark.parametrize(("unit", "name", "held"), CASES)
def test_what_is_off_between_the_rows_of_a_reference_is_found(unit: str, name: str, held: bool) -> None:
    """Half a unit more, or a tenth of the range, in every row that the reference has not: by its lines and bounds."""
    case = read_case(unit, name, held=held)
    path = HERE / unit / ("held" if held else "") / f"{name}_ref.csv"
    time, every = case.reference["time"], round(float(case.reference["time"][1] - case.start) / case.step)
    if every == 1:
        return
    t = np.interp(np.arange((len(time) - 1) * every + 1) / every, np.arange(len(time)), time)
    reference = Series(time, {each: values for each, values in case.reference.items() if each != "time"})
    tolerances, between = tolerances_of(path, None, ()), bounds_of(path)
    for column in reference.columns:
        values = {each: np.interp(t, time, reference[each]) for each in reference.columns}
        values[column][np.arange(len(t)) % every != 0] += max(0.5, 0.1 * np.ptp(values[column]))
        found = compare(Series(t, values), reference, tolerances, between=between)
        assert column in [each.name for each in found.those("different")]
        assert "compared all" in found.line
    assert compare(Series(t, values), reference, tolerances).heading.startswith("same in ")


def test_every_unit_has_its_cases() -> None:
    for unit, least in (("friction", 6), ("friction_gms", 6), ("plant", 7), ("controller", 8), ("setpoint", 2)):
        assert len([name for of, name, held in CASES if of == unit and not held]) >= least


# --- the files


@pytest.mark.extensive
def test_pinned_files_are_what_is_made(tmp_path: Path) -> None:
    assert set(make_reference.make(tmp_path)) == NAMES | SYSTEMS
    made = {path.relative_to(tmp_path) for path in tmp_path.rglob("*") if path.is_file()}
    pinned = {path.relative_to(HERE) for folder in (*UNITS, system.FOLDER) for path in (HERE / folder).rglob("*.*")}
    assert made == {path for path in pinned if path.suffix not in (".yaml", ".md")}
    for path in made:
        if not path.name.endswith(("_ref.csv", BOUNDS)):
            assert (tmp_path / path).read_bytes() == (HERE / path).read_bytes(), path
            continue
        fresh, expected = read_table(tmp_path / path), read_table(HERE / path)
        assert list(fresh) == list(expected)
        for name, values in expected.items():
            # What a reference hangs on is rounding: of libm, of linear algebra, and for the scenarios of what the
            # compiler makes for the processor. 2e-13 of a range by the units' solutions, which is their own error
            # (OWN_ERROR), 1e-10 by the scenarios'. Files of an earlier solution are good to 4e-12 of a range.
            share = 1e-9 if path.parts[0] == system.FOLDER else 1e-11
            limit = 1e-12 * max(1e-3, float(np.max(np.abs(values))))
            if path.name.endswith(BOUNDS) and name != "time":
                # three digits; what they are of is known as well as the reference itself
                whole = read_table(HERE / path.with_name(path.name.replace(BOUNDS, ".csv")))[name.rpartition(".")[0]]
                limit = 1e-12 * max(1e-3, float(np.max(np.abs(whole)))) + share * float(np.ptp(whole))
                share = 0.011
            np.testing.assert_allclose(fresh[name], values, rtol=share, atol=max(limit, share * np.ptp(values)))


@pytest.mark.extensive
@pytest.mark.parametrize("wanted", friction_cases(), ids=lambda wanted: wanted.case.name)
def test_own_error_of_the_friction_reference(wanted: Pinned) -> None:
    """Twice as many steps: what is left is far below what the files are compared to, a share of 1e-11."""
    case = make_reference.refined(read_case("friction", wanted.case.name), wanted.case.step)
    whole, halved = (solve_friction.solve(case, wanted.every, wanted.outputs, finer) for finer in (1, 2))
    for name in wanted.outputs:
        np.testing.assert_allclose(whole[name], halved[name], rtol=1e-15, atol=OWN_ERROR * np.ptp(halved[name]))


@pytest.mark.extensive
@pytest.mark.parametrize("wanted", friction_gms_cases(), ids=lambda wanted: wanted.case.name)
def test_own_error_of_the_reference_of_maxwell_slip(wanted: Pinned) -> None:
    case = make_reference.refined(read_case("friction_gms", wanted.case.name), wanted.case.step)
    whole, halved = (solve_friction_gms.solve(case, wanted.every, wanted.outputs, finer) for finer in (1, 2))
    for name in wanted.outputs:
        limit = solve_friction_gms.OWN_ERROR * np.ptp(halved[name])
        np.testing.assert_allclose(whole[name], halved[name], rtol=1e-15, atol=limit)


def test_inputs_are_the_same_but_for_the_last_digit(tmp_path: Path) -> None:
    file, table = tmp_path / "in.csv", {"time": np.array([0.0, 1e-3]), "x_s": np.array([0.1, 0.100000000001])}
    write_table(file, table)
    for off, same in ((1e-12, True), (2e-12, False)):
        assert same_but_for_the_last_digit(table | {"x_s": table["x_s"] + off}, file) == same
    assert not same_but_for_the_last_digit({"time": table["time"], "x_a": table["x_s"]}, file)
    assert not same_but_for_the_last_digit({name: values[:1] for name, values in table.items()}, file)
    assert not same_but_for_the_last_digit(table, tmp_path / "other.csv")


def test_made_twice_is_the_same_to_the_byte(tmp_path: Path) -> None:
    for folder in ("once", "again"):
        list(make_reference.make(tmp_path / folder, ("plant", "setpoint")))
        for wanted in controller_cases()[3:4]:
            list(make_reference.make_case(wanted, tmp_path / folder))
    once = sorted(path for path in (tmp_path / "once").rglob("*") if path.is_file())
    assert len(once) > 20
    for path in once:
        assert path.read_bytes() == (tmp_path / "again" / path.relative_to(tmp_path / "once")).read_bytes()


@pytest.mark.parametrize("folder", [*UNITS, system.FOLDER])
def test_files_follow_the_rules_of_the_cross_check(folder: str) -> None:
    files = [path for path in (HERE / folder).rglob("*.csv") if path.name.endswith(("_in.csv", "_ref.csv"))]
    assert files
    for path in files:
        assert path.stat().st_size < 1_000_000, path
        header, first, *_ = path.read_text(encoding="ascii").splitlines()
        names = header.split(",")
        assert len(names) <= 10, path
        assert names[0] == '"time"'
        assert all(name.startswith('"') and name.endswith('"') and "[" not in name for name in names)
        assert np.isfinite([float(value) for value in first.split(",")]).all()
        assert (np.diff(read_table(path)["time"]) > 0).all()


def test_every_tolerance_has_its_reason_beside_it() -> None:
    files = list(HERE.rglob("*tolerances.yaml"))
    assert len(files) >= 8
    for path in files:
        text = path.read_text(encoding="ascii")
        assert text.startswith("# ")
        for line in text.splitlines():
            exact = line.rpartition(":")[2].strip() == "0"
            assert ": " not in line or exact or "#" in line, f"{path}: {line}"


def test_closed_form_of_the_other_machine() -> None:
    """A rigid-body and an elastic mode per axis, a constant torque from rest: textbook answers."""
    found = read_case("plant", "other_machine").reference
    t = found["time"]
    for axis, torque, rigid, elastic, frequency, damping, start in (
        ("Y", -0.5, (6, 0.019), (-0.8, 0.002), 30.0, 0.05, 0.327),
        ("Z", 1.0, (8, 0.0255), (1.5, -0.004), 50.0, 0.02, 0.1),
    ):
        omega = 2 * np.pi * frequency
        root = np.sqrt(1 - damping**2)
        decay = np.exp(-damping * omega * t)
        ringing = decay * (np.cos(omega * root * t) + damping / root * np.sin(omega * root * t))
        x_a = start + torque * (rigid[1] * rigid[0] * t**2 / 2 + elastic[1] * elastic[0] / omega**2 * (1 - ringing))
        n_a = torque * (rigid[0] ** 2 * t + elastic[0] ** 2 / (omega * root) * decay * np.sin(omega * root * t))
        np.testing.assert_allclose(found[f"{axis}.x_a"], x_a, rtol=0, atol=1e-14)
        np.testing.assert_allclose(found[f"{axis}.n_a"], n_a, rtol=0, atol=1e-11)
    assert not found["X.n_a"].any()


def test_rapid_traverse_is_of_second_order(fmus: Path) -> None:
    """What its wider tolerance is given for: a quarter of the error at half the step."""
    case = read_case("friction", "rapid_traverse")
    errors = []
    for parts in (1, 2, 4):
        finer = replace(case, step=case.step / parts)
        result = simulate(fmus / "friction.fmu", finer)
        kept = np.searchsorted(result["time"], case.reference["time"] - 1e-9)
        errors.append(np.max(np.abs(result["M_fr"][kept] - case.reference["M_fr"])))
    np.testing.assert_allclose(np.log2(np.array(errors[:-1]) / errors[1:]), 2, atol=0.2)


# --- the check


@pytest.fixture
def one_case(tmp_path: Path) -> Path:
    """A tree of cases with a single friction case."""
    folder = tmp_path / "cases" / "friction"
    folder.mkdir(parents=True)
    for path in [*(HERE / "friction").glob("constant_speed_*"), HERE / "friction" / "tolerances.yaml"]:
        shutil.copy(path, folder)
    return folder.parent


def run(cases: Path, fmus: Path, *more: str) -> int:
    return check_reference.main(["--cases", str(cases), "--fmus", str(fmus), *more])


def test_same(one_case: Path, fmus: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(one_case, fmus) == 0
    assert "1 comparisons: all the same" in capsys.readouterr().out


def test_different(one_case: Path, fmus: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = one_case / "friction" / "constant_speed_ref.csv"
    header, *rows = path.read_text().splitlines()
    time, torque, rest = rows[300].split(",", 2)
    rows[300] = f"{time},{float(torque) + 40e-6!r},{rest}"
    path.write_text("\n".join([header, *rows]) + "\n")
    assert run(one_case, fmus, "--junit", str(tmp_path / "out.xml")) == 1
    out = capsys.readouterr().out
    assert "1 comparisons: 1 not the same" in out
    assert "worst M_fr" in out
    assert f"at {float(time):.9g} s" in out
    suites = ElementTree.parse(tmp_path / "out.xml").getroot()
    assert [case.get("name") for case in suites.iter("testcase") if case.find("failure") is not None]


def test_unusable(one_case: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(one_case, tmp_path) == 2
    assert "friction.fmu" in capsys.readouterr().err


def test_no_references(tmp_path: Path, fmus: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(tmp_path, fmus) == 2
    assert "no reference results" in capsys.readouterr().err
