"""What a difference looks like: planted causes are named with their size, and what has no such cause is given none."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from feedsim import cli
from feedsim.comparison import Comparison, Options, Tolerances, compare
from feedsim.files.trace import Array, Series

TIME = np.linspace(0.0, 1.2, 1201)
UNITS = {"Z.x_a": "m", "Z.n_a": "rad/s", "Z.M_a": "N.m"}


def motion(at: Array) -> dict[str, Array]:
    """A position, a speed and a torque that are no ramps and no single sine."""
    x = 0.12 + 0.05 * np.sin(5 * at) + 0.013 * np.cos(17 * at + 0.4)
    n = 300 * (0.25 * np.cos(5 * at) - 0.221 * np.sin(17 * at + 0.4))
    return {"Z.x_a": x, "Z.n_a": n, "Z.M_a": 2 + 1.5 * np.tanh(0.2 * n) + 0.4 * np.sin(31 * at)}


REFERENCE = Series(TIME, motion(TIME), UNITS)


def differs(
    columns: dict[str, Array], units: dict[str, str] | None = None, time: Array = TIME, tol: str = "1e-6",
    options: Options | None = None,
) -> Comparison:  # fmt: skip
    found = compare(Series(time, columns, units or UNITS), REFERENCE, Tolerances.parse([tol]), options)
    assert found.verdict == "different"
    return found


def texts(found: Comparison) -> str:
    return "\n".join(each.text for each in found.looks_like)


@pytest.mark.parametrize(
    ("late", "rows", "words"),
    [
        (3e-3, 1e-3, "later by 3 ms (3 rows): --shift '-3 ms'; all of it would be within the tolerance"),
        (-3e-3, 1e-3, "earlier by 3 ms (3 rows): --shift '3 ms'; all of it would be within the tolerance"),
        (1e-3, 1e-3, "later by 1 ms (1 row): results of the step before, or inputs held for a step: --shift '-1 ms'"),
        (-1e-3, 1e-3, "earlier by 1 ms (1 row): results of a step written beside its start: --shift '1 ms'"),
        (23e-3, 0.5e-3, "later by 23 ms (46 rows)"),
    ],
)
def test_a_result_that_is_late(late: float, rows: float, words: str) -> None:
    time = np.arange(0.1, 1.1, rows)
    found = differs(motion(time - late), time=time, tol="1e-3", options=Options(start=0.2, end=1.0))
    (proposal,) = found.looks_like
    assert proposal.names == ("Z.x_a", "Z.n_a", "Z.M_a")
    assert proposal.text.startswith(f"Z.x_a, Z.n_a, Z.M_a: {words}")


def test_one_row_without_a_number_is_no_other_time() -> None:
    """All other rows are the reference's: a shift of 0 s explains nothing."""
    columns = motion(TIME)
    columns["Z.x_a"][300] = np.nan
    assert "earlier" not in texts(differs(columns))
    columns = motion(TIME)
    columns["Z.x_a"][300] += 1e-3
    assert "earlier" not in texts(differs(columns))
    assert "later" not in texts(differs(columns))


def test_a_part_of_a_row_late() -> None:
    found = differs(motion(TIME - 0.4e-3), tol="1e-5")
    (proposal,) = found.looks_like
    number, unit = proposal.text.split("--shift '-")[1].split("'")[0].split()
    # The reference is a polyline through rows of 1 ms, which cuts the crests of the torque by h^2/8 of its curvature.
    assert float(number) * {"us": 1e-6, "ms": 1e-3}[unit] == pytest.approx(0.4e-3, rel=2e-3)


def test_what_it_proposes_makes_it_the_same() -> None:
    time = np.arange(0.1, 1.1, 1e-3)
    result = Series(time, motion(time - 5e-3), UNITS)
    options = Options(start=0.2, end=1.0)
    found = compare(result, REFERENCE, Tolerances.parse(["1e-6"]), options)
    assert "--shift '-5 ms'; all of it would be within" in texts(found)
    shifted = Options(start=0.2, end=1.0, shift=-5e-3)
    assert compare(result, REFERENCE, Tolerances.parse(["1e-6"]), shifted).same


def test_a_shift_that_is_there_is_corrected() -> None:
    time = np.arange(0.1, 1.1, 1e-3)
    found = differs(motion(time - 5e-3), time=time, options=Options(start=0.2, end=1.0, shift=-2e-3))
    assert "later by 3 ms (3 rows): --shift '-5 ms'" in texts(found)


@pytest.mark.parametrize(
    ("name", "factor", "words"),
    [
        ("Z.x_a", 1000.0, "factor 1000: in mm? (its header says m)"),
        ("Z.x_a", 1e6, "factor 1e+06: in um?"),
        ("Z.x_a", 1 / 0.0254, "factor 39.3701: in in?"),
        ("Z.n_a", 30 / np.pi, "factor 9.5493: in rpm?"),
        ("Z.n_a", 180 / np.pi, "factor 57.2958: in deg/s?"),
        ("Z.M_a", 100.0, "factor 100: in N.cm?"),
        ("Z.M_a", -1.0, "sign reversed: the other direction counts as positive there?"),
        ("Z.x_a", -1000.0, "sign reversed, factor 1000: in mm?"),
        ("Z.M_a", 1.07, "1.07 times the reference throughout"),
    ],
)
def test_another_unit_or_sign(name: str, factor: float, words: str) -> None:
    columns = motion(TIME)
    columns[name] = factor * columns[name]
    (proposal,) = differs(columns).looks_like
    assert proposal.names == (name,)
    assert proposal.text.startswith(f"{name}: {words}")
    assert proposal.text.endswith("all of it would be within the tolerance")


def test_a_header_without_unit_is_given_one() -> None:
    columns = motion(TIME)
    columns["Z.x_a"] = 1000 * columns["Z.x_a"]
    found = differs(columns, {**UNITS, "Z.x_a": ""})
    assert "Z.x_a: factor 1000: in mm? (--unit 'Z.x_a=mm')" in texts(found)
    again = compare(
        Series(TIME, columns, {**UNITS, "Z.x_a": ""}), REFERENCE, Tolerances.parse(["1e-6"]),
        Options(units={"Z.x_a": "mm"}),
    )  # fmt: skip
    assert again.same


def test_another_zero_point() -> None:
    columns = motion(TIME)
    columns["Z.x_a"] = columns["Z.x_a"] - 0.12
    assert "Z.x_a: less by 0.12 m throughout: another zero point?" in texts(differs(columns))


@pytest.mark.parametrize(
    ("form", "words"),
    [
        (".6f", "rounded to 1e-06 m: more digits, or --tol 'Z.x_a=1e-06 m'"),
        (".5g", "rounded to 5 significant digits"),
    ],
)
def test_digits(form: str, words: str) -> None:
    columns = motion(TIME)
    # from 0.01 on, so that digits are no places
    x = columns["Z.x_a"] = columns["Z.x_a"] - 0.05
    columns["Z.x_a"] = np.array([float(f"{value:{form}}") for value in x])
    reference = Series(TIME, {**motion(TIME), "Z.x_a": x}, UNITS)
    found = compare(Series(TIME, columns, UNITS), reference, Tolerances.parse(["1e-9 m", "Z.[!x]*=1"]).for_several())
    assert "Z.x_a: " + words in texts(found)


def test_digits_in_the_unit_of_the_result() -> None:
    columns = motion(TIME)
    columns["Z.x_a"] = np.round(1000 * columns["Z.x_a"], 3)
    found = differs(columns, {**UNITS, "Z.x_a": "mm"}, tol="1e-7")
    assert "Z.x_a: rounded to 0.001 mm: more digits, or --tol 'Z.x_a=0.001 mm'" in texts(found)


def test_single_precision() -> None:
    columns = {name: values.astype(np.float32).astype(float) for name, values in motion(TIME).items()}
    assert "Z.x_a, Z.n_a, Z.M_a: in single precision" in texts(differs(columns, tol="1e-12"))


def test_several_causes_are_told_apart() -> None:
    columns = motion(TIME)
    columns |= {"Z.x_a": 1e3 * columns["Z.x_a"], "Z.M_a": -columns["Z.M_a"]}
    assert [each.names for each in differs(columns).looks_like] == [("Z.x_a",), ("Z.M_a",)]


def test_what_has_no_such_cause_gets_none() -> None:
    """Noise, a spike, another course, a constant that differs from nothing."""
    rng = np.random.default_rng(5)
    for change in (
        lambda x: x + 1e-3 * rng.standard_normal(len(x)),
        lambda x: x + np.where(np.arange(len(x)) == 700, 0.5, 0.0),
        lambda x: x + 0.01 * np.sin(40 * TIME),
        lambda x: x * (1 + 0.5 * TIME),
    ):
        columns = motion(TIME)
        columns["Z.x_a"] = change(columns["Z.x_a"])
        assert not differs(columns).looks_like


def test_holes_and_few_rows_do_not_hurt() -> None:
    columns = motion(TIME)
    columns["Z.x_a"] = np.where(TIME < 0.5, np.nan, 1000 * columns["Z.x_a"])
    assert "in mm?" in texts(differs(columns))
    few = Series(np.array([0.0, 1.0]), {"x": np.array([0.0, 1.0])})
    other = Series(np.array([0.0, 1.0]), {"x": np.array([0.0, 1e308])})
    assert compare(few, other).verdict == "different"
    assert compare(other, few).verdict == "different"
    still = Series(TIME, {"x": np.zeros_like(TIME)})
    assert "more by 2 throughout" in texts(compare(Series(TIME, {"x": np.full_like(TIME, 2.0)}), still))


def test_it_stands_in_every_output(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name, values in (("a.csv", TIME**2), ("b.csv", 1000 * TIME**2)):
        rows = [f"{t!r},{v!r}" for t, v in zip(TIME.tolist(), values.tolist(), strict=True)]
        (tmp_path / name).write_text("\n".join(["time [s],x [m]", *rows]))
    words = [str(tmp_path / "b.csv"), str(tmp_path / "a.csv"), "--tol", "1e-6"]
    outputs = {what: tmp_path / f"out.{what}" for what in ("junit", "report")}
    assert (
        cli.main(["compare", *words, *(part for what, file in outputs.items() for part in (f"--{what}", str(file)))])
        == 1
    )
    told = "x: factor 1000: in mm? (its header says m); all of it would be within the tolerance"
    assert f"  looks like: {told}" in capsys.readouterr().out
    assert cli.main(["compare", *words, "--json"]) == 1
    (proposal,) = json.loads(capsys.readouterr().out)["comparisons"][0]["looks_like"]
    assert proposal == {"names": ["x"], "text": told}
    assert f"looks like: {told}" in outputs["junit"].read_text()
    assert "in mm?" in outputs["report"].read_text()


# --- the default tolerance ---


def moved(off: float) -> tuple[Series, Series]:
    """A move of 100 mm, 0.5 mm behind its setpoint; a result that is off."""
    setpoint = 0.1 * np.clip(TIME, 0, 1)
    actual = setpoint - 0.5e-3 * np.sin(np.pi * np.clip(TIME, 0, 1))
    units = {"X.x_s": "m", "X.x_a": "m"}
    reference = Series(TIME, {"X.x_s": setpoint, "X.x_a": actual}, units)
    return Series(TIME, {"X.x_s": setpoint, "X.x_a": actual + off * np.sin(20 * TIME)}, units), reference


def test_the_default_is_told_beside_what_matters() -> None:
    found = compare(*moved(40e-6))
    assert found.same
    (note,) = [each for each in found.notes if "no tolerance" in each]
    assert note == (
        "no tolerance is given for X.x_a: 0.001 of the range is allowed, 0.0001 m of X.x_a, which differs from X.x_s "
        "by 0.0005 m at most; --tol 'X.x_a=5e-07 m' is a thousandth of that"
    )
    assert compare(*moved(40e-6), Tolerances.parse(["X.x_a=5e-07 m"])).verdict == "different"


def test_a_tolerance_that_is_given_is_no_default() -> None:
    assert not [each for each in compare(*moved(40e-6), Tolerances.parse(["1e-3"])).notes if "no tolerance" in each]
    assert not [each for each in compare(*moved(0.0)).notes if "no tolerance" in each]  # the same to the bit


def test_of_many_pairs_it_is_told_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for folder, series in zip(("results", "references"), moved(40e-6), strict=True):
        (tmp_path / folder).mkdir()
        rows = zip(series.time.tolist(), *(values.tolist() for values in series.columns.values()), strict=True)
        text = "\n".join(["time [s],X.x_s [m],X.x_a [m]", *(",".join(map(repr, row)) for row in rows)])
        for name in ("one.csv", "two.csv"):
            (tmp_path / folder / name).write_text(text)
    assert cli.main(["compare", str(tmp_path / "results"), str(tmp_path / "references")]) == 0
    out = capsys.readouterr().out
    assert out.count("no tolerance is given") == 1
    assert "(as in 1 more)" in out
