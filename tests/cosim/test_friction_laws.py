"""Another shipped friction law on an axis: chosen in the machine file, run, judged, exported and read again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import feedsim as fs
from feedsim.estimation.identify.read import Provenance
from feedsim.estimation.identify.stages import AxisRequest
from feedsim.foundation.errors import InputError
from feedsim.linear.judgement import Bristles
from feedsim.report.provenance import axis_parameters
from feedsim.simulation.cosim.friction_law import FrictionLaw

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
PARAMETERS = {
    "sigma_0": "300 N.m/rad", "sigma_1": "0.8 N.m.s/rad", "sigma_2": "0.006 N.m.s/rad", "F_C": "1.6 N.m",
    "F_S": "2.1 N.m", "v_s": "0.6 rad/s", "F_log": "0.4 N.m", "spread": "30", "C": "150 N.m/s",
}  # fmt: skip


def gms(**changes: str) -> str:
    return f"{{law: gms, {', '.join(f'{name}: {value}' for name, value in (PARAMETERS | changes).items())}}}"


def test_a_run_is_of_that_law(fmus: Path) -> None:
    """The recorded torque is the law's along the recorded speed."""
    result = fs.run(SCENARIOS / "z_positioning.yaml", set=[f"machine.axes.Z.friction={gms()}"], fmus=fmus)
    trace = result.trace
    assert {"Z.z", "Z.k"} <= set(trace.columns)
    assert not {"Z.c", "Z.lambda"} & set(trace.columns)
    friction = result.scenario.machine.axes["Z"].friction
    assert friction.law == "gms"
    shown = {name: axis_parameters(axis)["friction"] for name, axis in result.scenario.machine.axes.items()}
    assert shown["Z"]["law"] == ("gms", "")
    assert "law" not in shown["X"]  # LuGre needs no word
    with FrictionLaw(fmus, "friction_gms") as law:
        parameters = {name: float(value) for name, value in friction.parameters().items()}
        expected = law(parameters, trace["Z.n_a"], float(trace.time[1] - trace.time[0]))
    # The unit sees n_fr, which is n_a here; the exchange extrapolates M_fr over a cycle, and rows are thinned.
    assert np.corrcoef(trace["Z.M_fr"], expected)[0, 1] > 0.999


def test_a_file_may_say_its_law(fmus: Path, tmp_path: Path) -> None:
    file = tmp_path / "friction.yaml"
    for law, known in (("gms", "GmsFriction"), ("lugre", "Friction")):
        lines = [f"law: {law}", *(f"{n}: {v}" for n, v in PARAMETERS.items() if n not in ("spread", "C"))]
        file.write_text("\n".join(lines) + "\n")
        machine = fs.load_machine(SCENARIOS / "machines" / "test_centre", [f"axes.Z.friction={file}"])
        assert type(machine.axes["Z"].friction).__name__ == known
        assert "law" not in machine.axes["Z"].friction.parameters()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (f"axes.Z.friction={gms().replace('gms', 'dahl')}", "'dahl' is no friction law; allowed: lugre, gms"),
        ("axes.Z.friction={law: [gms]}", "axes.Z.friction.law: a list is no friction law; allowed: lugre, gms"),
        (f"axes.Z.friction={gms(W='2 deg')}", "axes.Z.friction.law: the law gms has no W, but spread, skew, C"),
        ("axes.Z.friction.law=dahl", "axes.Z.friction.law: 'dahl' is no friction law; allowed: lugre, gms"),
        (
            "axes.Z.friction.law=gms",
            "--set axes.Z.friction.law=gms: axes.Z.friction.law: the law gms has no W, gamma, "
            "but spread, skew, C; another law needs the whole group anew, friction: {law: gms, sigma_0: ..., sigma_1: ",
        ),
        ("axes.Z.friction.spread=5", "unknown key 'spread' in axes.Z.friction; allowed: sigma_0"),
        (f"axes.Z.friction={gms(spread='0.5')}", "spread"),
        (f"axes.Z.friction={gms(warm_time='1 min')}", "warm_time: unknown key; allowed: "),  # a share is LuGre's alone
        (f"axes.Z.friction={gms(F_S='1 N.m')}", "F_S 1 N.m is smaller than F_C 1.6 N.m"),
    ],
)
def test_what_is_no_such_law_is_refused(change: str, words: str) -> None:
    with pytest.raises(InputError) as raised:
        fs.load_machine(SCENARIOS / "machines" / "test_centre", [change])
    assert words in str(raised.value)


def test_lugre_by_name_has_its_own_keys() -> None:
    """A value of it can be set, and one of the other law cannot."""
    centre, named = SCENARIOS / "machines" / "test_centre", "axes.Z.friction.law=lugre"
    machine = fs.load_machine(centre, [named, "axes.Z.friction.W=3 deg"])
    assert pytest.approx(np.radians(3)) == machine.axes["Z"].friction.W
    with pytest.raises(InputError, match="unknown key 'spread'"):
        fs.load_machine(centre, [named, "axes.Z.friction.spread=3"])
    with pytest.raises(
        InputError, match=r"--set axes\.Z\.friction\.law=lugre: .* the law lugre has no spread, C, but W"
    ):
        fs.load_machine(centre, [f"axes.Z.friction={gms()}", named])


def test_a_law_is_no_other_by_a_word_alone() -> None:
    """What a machine file with pure LuGre gives suits another law, which then has its own values beside it."""
    pure = "{" + ", ".join(f"{n}: {v}" for n, v in PARAMETERS.items() if n not in ("spread", "C")) + "}"
    machine = fs.load_machine(
        SCENARIOS / "machines" / "test_centre", [f"axes.Z.friction={pure}", "axes.Z.friction.law=gms"]
    )
    assert machine.axes["Z"].friction.law == "gms"


def test_the_guide_takes_no_share_of_it() -> None:
    with pytest.raises(InputError, match="this friction has the law gms"):
        fs.load_machine(
            SCENARIOS / "machines" / "test_centre", [f"axes.Z.friction={gms()}", "axes.Z.guide={share: 30 %}"]
        )


def test_what_needs_lugre_says_so(fmus: Path) -> None:
    scenario, change = SCENARIOS / "z_positioning.yaml", f"machine.axes.Z.friction={gms()}"
    with pytest.raises(InputError, match="axis Z: its friction has the law gms; one unit holds LuGre alone"):
        fs.run(scenario, set=[change, "coupling.units=one"], fmus=fmus)
    with pytest.raises(InputError, match=r"axis Z: its friction has the law gms; a page needs LuGre \(law: lugre\)"):
        fs.export(scenario, set=[change], fmus=fmus, kind="html")


def test_a_compensation_takes_the_law_of_its_axis(fmus: Path, tmp_path: Path) -> None:
    """By the same law what is left is no hundredth; a model of the other law, as well as it fits, leaves more."""
    circle, change = SCENARIOS / "xz_circle.yaml", f"machine.axes.Z.friction={gms()}"
    file = tmp_path / "friction.yaml"
    file.write_text(f"# a remark\n{gms()}\n")
    own = fs.tune_feedforward(circle, set=[change], table=False, fmus=fmus)
    by_file = fs.tune_feedforward(circle, friction={"Z": file}, set=[change], table=False, fmus=fmus)
    other = fs.tune_feedforward(circle, friction={"Z": file}, table=False, fmus=fmus)
    before, after = (float(own.figures[f"{when}.glitch_Z"]) for when in ("before", "after"))
    assert after < 0.01 * before
    assert float(by_file.figures["after.glitch_Z"]) == after
    assert float(other.figures["after.glitch_Z"]) > 10 * after


def test_errors_of_a_compensation_are_tried_of_what_its_law_has(fmus: Path) -> None:
    change = [f"machine.axes.{axis}.friction={gms()}" for axis in "XZ"]
    table = fs.tune_feedforward(SCENARIOS / "xz_circle.yaml", set=change, fmus=fmus).compensation.table
    assert {"spread", "C", "sigma_0", "delay"} <= {row.what for row in table}
    assert not {"W", "gamma"} & {row.what for row in table}


def test_a_compensation_says_whose_law_is_missing(tmp_path: Path) -> None:
    file = tmp_path / "friction.yaml"
    file.write_text(f"# a remark\n{gms(W='2 deg')}\n")
    with pytest.raises(InputError, match=r"friction\.yaml:2: .*the law gms has no W, but spread, skew, C"):
        fs.tune_feedforward(SCENARIOS / "xz_circle.yaml", friction={"Z": file}, out=tmp_path / "out")


@pytest.mark.parametrize(("law", "shared"), [("gms", True), ("lugre", False)])
def test_identification_falls_back_to_values_of_its_own_law(law: str, shared: bool) -> None:
    """sigma_0 of another law is another number; the torque over speed is the same."""
    centre = SCENARIOS / "machines" / "test_centre"
    machine = fs.load_machine(centre, [f"axes.Z.friction={gms()}"])
    trace = Provenance(Path("log.csv"), "", "Z", {}, pitch=0.02)
    fallback = AxisRequest(law=law).with_traces([trace], machine).fallback
    assert ("sigma_0" in fallback, "spread" in fallback) == (shared, shared)
    assert (fallback["F_C"], fallback["sigma_2"]) == (1.6, 0.006)


def test_at_rest_all_elements_are_springs() -> None:
    machine = fs.load_machine(SCENARIOS / "machines" / "test_centre", [f"axes.Z.friction={gms()}"])
    assert Bristles.of(machine.shipped_frictions["Z"]) == (300.0, 0.8, 0.006)


def test_an_ssp_keeps_the_law(fmus: Path, tmp_path: Path) -> None:
    scenario, change = SCENARIOS / "z_positioning.yaml", f"machine.axes.Z.friction={gms()}"
    fs.export(scenario, tmp_path / "machine.ssp", set=[change], fmus=fmus, kind="ssp")
    again = fs.run(tmp_path / "machine.ssp")
    assert again.scenario.machine.axes["Z"].friction.law == "gms"
    assert again.scenario.machine.axes["X"].friction.law == "lugre"
    first = fs.run(scenario, set=[change], fmus=fmus)
    for name in ("Z.x_a", "Z.M_fr", "Z.k"):
        np.testing.assert_array_equal(again.trace[name], first.trace[name])
