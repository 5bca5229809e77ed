"""Study files: what they mean, and what is said of what is wrong with them."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path

import jsonschema
import pytest
import yaml

from feedsim.cli import main
from feedsim.design.sweep import design
from feedsim.foundation.errors import InputError
from feedsim.scenario.schema import json_schema
from feedsim.scenario.study import load_study

Write = Callable[..., Path]
HEAD = "name: S\nscenario: short.yaml\nsampling: {method: sobol, runs: 8}\nparameters:\n"
GRID = "name: S\nscenario: short.yaml\nsampling: {method: grid}\nparameters:\n"


def test_units_are_those_of_the_key(study: Write) -> None:
    found = load_study(study())
    assert [parameter.label for parameter in found.parameters] == ["F_C [N.m]", "W [1]", "scheme"]
    factor = found.parameters[1]
    assert [key for key, _, _ in factor.origins] == [f"machine.axes.{axis}.friction.W" for axis in "XYZ"]
    assert factor.origins[0][1:] == (found.base.scenario.machine.axes["X"].friction.W, "rad")


def test_numbers_are_converted(study: Write) -> None:
    text = GRID + "  v: {key: motions.0.feed, from: 1200 mm/min, to: 3 m/min, count: 4}\n"
    planned = design(load_study(study(text)))
    assert planned.values[:, 0] == pytest.approx([0.02, 0.03, 0.04, 0.05], rel=1e-15)
    assert planned.options(0) == ["motions.0.feed=0.02 m/s"]


def test_quantities_listed_are_numbers_and_words_are_words(study: Write) -> None:
    text = (
        GRID
        + "  v: {key: motions.0.feed, values: [1200 mm/min, 3 m/min]}\n"
        + "  scheme: {key: coupling.scheme, values: [jacobi, iterated]}\n"
        + "  n: {key: coupling.substeps, from: 1, to: 3}\n"
    )
    planned = design(load_study(study(text)))
    assert planned.runs == 12
    assert planned.shown(0) == [0.02, "jacobi", 1.0]
    assert planned.shown(11) == [0.05, "iterated", 3.0]
    assert planned.options(5) == ["motions.0.feed=0.02 m/s", "coupling.scheme=iterated", "coupling.substeps=3"]


def test_files_named_by_choices_are_relative_to_the_study(study: Write) -> None:
    friction = (
        "F_C: {} N.m\nF_S: 4 N.m\nv_s: 0.6 rad/s\nW: 0.04 rad\n"
        "sigma_0: 400 N.m/rad\nsigma_1: 0.8 N.m.s/rad\nsigma_2: 0.006 N.m.s/rad\n"
    )
    folder = study().parent
    for name, value in (("new", 1.5), ("worn", 1.1)):
        (folder / f"{name}.yaml").write_text(friction.format(value))
    text = GRID + "  state: {key: machine.axes.Z.friction, values: [new.yaml, worn.yaml]}\n"
    found = load_study(study(text))
    assert found.base.with_changes(design(found).changes(1)).machine.axes["Z"].friction.F_C == 1.1
    assert design(found).shown(1) == ["worn.yaml"]
    (option,) = design(found).options(1)
    assert Path(option.partition("=")[2]) == folder / "worn.yaml"


def test_factors_of_one_place_multiply(study: Write) -> None:
    text = GRID + "".join(
        f"  {name}: {{key: [{key}], factor: true, values: [{value}]}}\n"
        for name, key, value in (
            ("a", "machine.axes.Z.friction.F_C, machine.axes.X.friction.F_C", 0.5),
            ("b", "machine.axes.Z.friction.F_C", 1.25),
        )
    )
    found = load_study(study(text))
    axes = found.base.with_changes(design(found).changes(0)).machine.axes
    before = found.base.scenario.machine.axes
    assert axes["X"].friction.F_C == before["X"].friction.F_C * 0.5
    assert axes["Z"].friction.F_C == before["Z"].friction.F_C * 0.5 * 1.25


def test_settings_of_the_study_and_from_outside(study: Write) -> None:
    text = "set: {machine.axes.*.friction.W: 0.03 rad, motions.0.feed: 1 m/min}\n" + HEAD
    text += "  F_C: {key: machine.axes.Z.friction.F_C, from: 1.2 N.m, to: 2 N.m}\n"
    found = load_study(study(text), ["motions.0.feed=2 m/min"])
    assert found.base.scenario.machine.axes["X"].friction.W == 0.03
    assert found.base.scenario.motions[0].feed == pytest.approx(2 / 60)
    assert found.settings == ("machine.axes.*.friction.W=0.03 rad", "motions.0.feed=1 m/min")


@pytest.mark.parametrize(
    ("entry", "line", "told"),
    [
        ("{key: machine.axes.Z.friction.F_CC, from: 1 N.m, to: 2 N.m}", 5, "unknown key 'F_CC'.*did you mean 'F_C'"),
        ("{key: machine.axes.Q.friction.F_C, from: 1 N.m, to: 2 N.m}", 5, "has no 'Q'"),
        ("{key: motions.0.by.Q, from: 1 mm, to: 2 mm}", 5, "motions.0.by has no 'Q'"),
        ("{key: motions.4.feed, from: 1 m/s, to: 2 m/s}", 5, "'4' is no entry"),
        ("{key: machine.axes.Z.friction.F_C, from: 1 mm, to: 2 N.m}", 5, "from: '1 mm' is a length; a torque is exp"),
        ("{key: machine.axes.Z.friction.F_C, from: 1, to: 2 N.m}", 5, "from: 1 has no unit; a torque"),
        ("{key: machine.axes.Z.friction.F_C, from: 2 N.m, to: 1 N.m}", 5, "to: 1 is not more than from, 2"),
        ("{key: machine.axes.Z.friction.F_C, from: -1 N.m, to: 1 N.m}", 5, "from: -1 N.m is outside the allowed range"),
        ("{key: machine.axes.Z.friction.W, factor: true, from: -1, to: 1}", 5, "from: -1 times 0.0\\S+ rad is outside"),
        ("{key: machine.axes.Z.friction.W, factor: true, from: 1 rad, to: 2}", 5, "from: '1 rad' is an angle; a plain"),
        ("{key: coupling.scheme, from: 1, to: 2}", 5, "takes no number"),
        (
            "{key: coupling.scheme, values: [jacobi, jacobbi]}",
            5,
            "'jacobbi' is not allowed here; did you mean 'jacobi'",
        ),
        ("{key: coupling.scheme, values: [jacobi, jacobi]}", 5, "jacobi stands there twice"),
        ("{key: coupling.substeps, from: 1.5, to: 3}", 5, "from: 1.5 is no whole number"),
        ("{key: coupling.substeps, from: 0, to: 3}", 5, "from:.*outside the allowed range: at least 1"),
        ("{key: coupling.substeps, values: [1, 0]}", 5, "outside the allowed range: at least 1"),
        ("{key: motions.0.feed, distribution: normal, mean: 1 m/s}", 5, "normal: missing key 'deviation'"),
        ("{key: motions.0.feed, distribution: normal, mean: 1 m/s, deviation: 0 m/s}", 5, "deviation: 0 is outside"),
        ("{key: motions.0.feed, distribution: loguniform, from: 0 m/s, to: 1 m/s}", 5, "from: 0"),
        ("{key: motions.0.feed, distribution: triangular, from: 1 m/s, to: 2 m/s, mode: 3 m/s}", 5, "mode: 3 is not"),
        ("{key: motions.0.feed, distribution: weibull, from: 1 m/s, to: 2 m/s}", 5, "'weibull' is not allowed here"),
        ("{key: motions.0.feed, from: 1 m/min, to: 2 m/min, count: 3}", 5, "count: only in a grid"),
        ("{key: motions.0.feed, from: 1 m/min, to: 2 m/min, values: [1 m/min]}", 5, "from: not beside values"),
        ("{key: motions.0.feed}", 5, "nothing is said of its values"),
        ("{key: [motions.0.feed, machine.axes.Z.friction.W], from: 1 m/s, to: 2 m/s}", 5, "a speed.*an angle"),
        ("{key: evaluate.0.axis, factor: true, from: 1, to: 2}", 5, "cannot be multiplied"),
        ("{keys: motions.0.feed, from: 1 m/min, to: 2 m/min}", 5, "unknown key; did you mean 'key'"),
    ],
)
def test_what_is_wrong_is_told_with_its_line(study: Write, entry: str, line: int, told: str) -> None:
    file = study(HEAD + f"  p: {entry}\n")
    with pytest.raises(InputError, match=told) as error:
        load_study(file)
    assert f"{file}:{line}: " in str(error.value)


def test_all_problems_at_once(study: Write) -> None:
    text = """name: S
scenario: short.yaml
sampling: {method: sobbol, runs: 8}
set: {motions.0.fed: 1 m/min}
parameters:
  p: {key: motions.0.feed, from: 1 mm, to: 2 mm}
  status: {key: motions.0.feed, from: 1 m/s, to: 2 m/s}
figuers: [Z.*]
"""
    with pytest.raises(InputError) as error:
        load_study(study(text))
    for told in ("sobbol", "unknown key 'fed'", "'status' is a column of every table", "did you mean 'figures'"):
        assert told in str(error.value)


@pytest.mark.parametrize(
    ("sampling", "told"),
    [
        ("{method: sobol}", "sampling.runs: missing"),
        ("{method: sensitivity, runs: 6}", "6 is no power of two"),
        ("{method: grid, runs: 4}", "sampling.runs: not for a grid"),
        ("{method: sobol, runs: 0}", "sampling.runs: 0 is outside the allowed range: at least 1"),
    ],
)
def test_sampling(study: Write, sampling: str, told: str) -> None:
    text = f"name: S\nscenario: short.yaml\nsampling: {sampling}\nparameters:\n"
    count = ", count: 3" if "grid" in sampling else ""
    with pytest.raises(InputError, match=told):
        load_study(study(text + f"  p: {{key: motions.0.feed, from: 1 m/min, to: 2 m/min{count}}}\n"))


def test_what_sets_the_same_place_twice(study: Write) -> None:
    text = HEAD + (
        "  a: {key: machine.axes.Z.friction.W, from: 0.01 rad, to: 0.02 rad}\n"
        "  b: {key: machine.axes.*.friction.W, from: 0.01 rad, to: 0.02 rad}\n"
    )
    with pytest.raises(InputError, match=r":6: parameters\.b\.key: a sets machine\.axes\.Z\.friction\.W already"):
        load_study(study(text))


def test_sobol_that_is_not_balanced_is_warned_of(study: Write) -> None:
    assert not load_study(study(), runs=64).warnings
    (warning,) = load_study(study(), runs=100).warnings
    assert (warning.code, warning.remedy) == ("sampling-unbalanced", "--runs 64")


def test_a_middle_that_contradicts_the_scenario_is_warned_of(study: Write) -> None:
    text = HEAD + "  F_C: {key: machine.axes.Z.friction.F_C, from: 1 N.m, to: 30 N.m}\n"
    (warning,) = load_study(study(text)).warnings
    assert warning.code == "middle-refused"
    assert "static friction is at least Coulomb friction" in warning.text


def test_schema(study: Write, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["tools", "schema", "study"]) == 0
    schema = json.loads(capsys.readouterr().out)
    assert schema == json_schema("study")
    check = jsonschema.Draft202012Validator(schema)
    check.check_schema(schema)
    good = yaml.safe_load(study().read_text())
    check.validate(good)
    for file in sorted((Path(__file__).resolve().parents[2] / "scenarios" / "studies").glob("*.yaml")):
        check.validate(yaml.safe_load(file.read_text()))
        assert design(load_study(file)).runs > 1
    for bad in ({**good, "sampling": {"method": "guess"}}, {**good, "parameters": {}}, {**good, "extra": 1}):
        assert not check.is_valid(bad)


def test_validate_and_run_know_a_study(study: Write, capsys: pytest.CaptureFixture[str], fmus: Path) -> None:
    assert main(["check", str(study()), "--fmus", str(fmus)]) == 0
    assert "16 runs" in capsys.readouterr().out
    assert main(["run", str(study())]) == 2
    assert "feedsim sweep" in capsys.readouterr().err


def test_written_numbers_read_back(study: Write) -> None:
    """What the table shows, set by hand, is the run: bit for bit."""
    found = load_study(study())
    planned = design(found)
    for run in range(planned.runs):
        changed = found.base.with_changes(planned.changes(run))
        assert planned.values[run, 0] == changed.machine.axes["Z"].friction.F_C
        expected = found.base.scenario.machine.axes["Y"].friction.W * planned.values[run, 1]
        assert math.isclose(changed.machine.axes["Y"].friction.W, expected, rel_tol=0.0, abs_tol=0.0)
