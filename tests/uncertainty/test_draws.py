"""Draws of a machine: their moments, what they leave alone, what is refused; intervals by order."""

from __future__ import annotations

import csv
import shutil
from pathlib import Path

import numpy as np
import pytest
import yaml

from feedsim.design import uncertainty as drawing
from feedsim.design.uncertainty import cloud_of, interval, of_run, on_draw, share_of, torque_scale
from feedsim.foundation.errors import InputError, SimulationError
from feedsim.jobs.tune_feedforward import _open_of as open_values
from feedsim.scenario import Friction, GmsFriction, load
from feedsim.scenario.load import read_friction
from feedsim.simulation import cosim, nc
from identified_sets import CIRCLE, VALUES, write_set


def drawn(file: Path, count: int, *more: str) -> list[Friction]:
    machine = load(CIRCLE, [f"machine.axes.Z.friction={file}", *more]).machine
    return [each.shipped_friction("Z", "a test") for each in cloud_of(machine).draws(count)]


def test_draws_have_the_covariance_of_the_file(tmp_path: Path) -> None:
    """Half intervals of 1.96 standard deviations; 4000 draws: of a correlation to 0.02, of a spread to 2.3 %."""
    draws = drawn(write_set(tmp_path, sigma=0.03, correlation=-0.6), 4000)
    F_C, sigma_0, F_S = (np.array([getattr(each, name) for each in draws]) for name in ("F_C", "sigma_0", "F_S"))
    assert F_C.mean() == pytest.approx(1.6, rel=0.0015)
    assert F_C.std() == pytest.approx(0.03 * 1.6, rel=0.04)
    assert np.corrcoef(F_C, sigma_0)[0, 1] == pytest.approx(-0.6, abs=0.03)
    assert abs(np.corrcoef(F_S, sigma_0)[0, 1]) < 0.05


def test_draws_are_possible(tmp_path: Path) -> None:
    """Intervals that reach beyond what is possible are cut there: F_S at least F_C, gamma at most 1, sigma_1 from 0."""
    draws = drawn(write_set(tmp_path, sigma=0.4), 500)
    assert all(each.F_S >= each.F_C > 0 and each.sigma_1 >= 0 and 0 < each.gamma <= 1 for each in draws)
    assert np.std([each.sigma_1 for each in draws]) > 0.2 * 0.8
    for each in draws[:20]:
        Friction.model_validate(dict(each))  # the check of machine files


def test_draws_are_the_same_in_every_call(tmp_path: Path) -> None:
    file = write_set(tmp_path)
    assert drawn(file, 3) == drawn(file, 5)[:3]


def test_a_value_that_was_set_does_not_vary(tmp_path: Path) -> None:
    draws = drawn(write_set(tmp_path), 5, "machine.axes.Z.friction.F_C=1.7 N.m")
    assert {each.F_C for each in draws} == {1.7}
    assert len({each.sigma_0 for each in draws}) == 5


def test_the_constant_load_varies_where_it_is_the_identified_one(tmp_path: Path) -> None:
    file = write_set(tmp_path, load=0.5)

    def loads(*more: str) -> set[float]:
        machine = load(CIRCLE, [f"machine.axes.Z.friction={file}", *more]).machine
        return {each.axes["Z"].constant_load for each in cloud_of(machine).draws(4)}

    assert loads() == {0.0}
    assert len(loads("machine.axes.Z.constant_load=0.5 N.m")) == 4


def test_what_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no axis has identified values with intervals"):
        cloud_of(load(CIRCLE).machine)
    file = write_set(tmp_path)
    content = yaml.safe_load(file.read_text())
    content["identified"]["correlation"]["matrix"] = [[1.0]]
    file.write_text(yaml.safe_dump(content))
    with pytest.raises(
        InputError, match="axis Z: the group identified of its friction is not as feedsim identify friction"
    ):
        cloud_of(load(CIRCLE, [f"machine.axes.Z.friction={file}"]).machine)


def test_a_set_that_compensates_varies_where_the_machine_does_not(tmp_path: Path) -> None:
    """The machine is what the set stands for: of one axis either varies, or one error would count twice. Of a file of
    identify-drive a set has the friction alone."""
    file = write_set(tmp_path, load=0.5)
    content = yaml.safe_load(file.read_text())
    content["identified"]["parameters"]["drive.K_v"] = {"interval": ["60 1/s", "70 1/s"]}
    content["identified"]["inertia"] = {"interval": ["0.05 kg.m2", "0.09 kg.m2"]}
    file.write_text(yaml.safe_dump(content))
    sets = dict.fromkeys(("X", "Z"), read_friction(file))
    known, cloud = open_values(load(CIRCLE), sets, 19)
    assert cloud is None
    assert {axis: set(each.names) - set(VALUES) for axis, each in known.items()} == {"X": set(), "Z": set()}
    assert all(each.fixed == () for each in known.values())
    known, cloud = open_values(load(CIRCLE, [f"machine.axes.Z.friction={file}"]), sets, 19)
    assert set(known) == {"X"}
    assert cloud is not None
    assert set(cloud.known) == {"Z"}
    assert "inertia" in cloud.known["Z"].names
    broken = tmp_path / "broken.yaml"
    content["identified"]["correlation"]["matrix"] = [[1.0]]
    broken.write_text(yaml.safe_dump(content))
    with pytest.raises(
        InputError, match="axis Z: the group identified of its friction is not as feedsim identify friction"
    ):
        open_values(load(CIRCLE, [f"machine.axes.Z.friction={broken}"]), sets, 19)


def test_a_draw_that_fails_says_so(tmp_path: Path, fmus: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = load(CIRCLE, [f"machine.axes.Z.friction={write_set(tmp_path)}", "motions.0.radius=5 mm"])
    nominal = cosim.run(scenario, fmus=fmus)

    def fail(*args: object, **named: object) -> None:
        raise SimulationError("unit Z.friction: no")

    monkeypatch.setattr("feedsim.design.uncertainty.run", fail)
    with pytest.raises(SimulationError, match=r"^draw 1 of 19 of the machine: unit Z\.friction: no"):
        of_run(nominal, cloud_of(scenario.machine), 19, progress=lambda what, done, total: None)


def test_intervals_hold_their_share_whatever_the_distribution() -> None:
    """Of normal, uniform and very skew draws: the mean over 2000 sets is that of the order statistics, to 0.5 %."""
    random = np.random.default_rng(5)
    for make in (random.normal, random.uniform, random.exponential):
        for count in (19, 39, 80):
            low, high = interval(make(size=(count, 2000)))
            further = make(size=(50, 2000))
            assert np.mean((low < further) & (further < high)) == pytest.approx(share_of(count), abs=0.005)
    assert share_of(19) == 0.9
    low, high = interval(np.arange(1.0, 40.0))
    assert (float(low), float(high)) == pytest.approx((1.0, 39.0), rel=1e-12)


def test_a_drawn_inertia_moves_as_a_plant_with_that_inertia(tmp_path: Path, fmus: Path) -> None:
    """Torques divided by the inertia against a table of modes that has it: the same motion."""
    folder = tmp_path / "machine"
    shutil.copytree(CIRCLE.parent / "machines" / "sinumerik_840d", folder)
    file = folder / "friction_X.yaml"
    content = yaml.safe_load(file.read_text())
    content["identified"] = {"axis": "X", "inertia": {"interval": ["0.05 kg.m2", "0.09 kg.m2"]}}
    file.write_text(yaml.safe_dump(content))
    other = yaml.safe_load((folder / "friction_Y.yaml").read_text())
    (folder / "friction_Y.yaml").write_text(yaml.safe_dump({k: v for k, v in other.items() if k != "identified"}))
    scenario = tmp_path / "move.yaml"
    scenario.write_text(
        "name: Move\nmachine: machine\nmotions:\n  - {kind: dwell, duration: 0.05 s}\n"
        "  - {kind: move, by: {X: 5 mm}, feed: 3 m/min}\n  - {kind: dwell, duration: 0.2 s}\n"
        "loads:\n  - {kind: slide, axis: X, table: {time: [0.1 s, 0.2 s], values: [0 N, 300 N]}}\n"
        "  - {kind: tool, direction: Z, factor: 0.5, table: {time: [0 s, 0.2 s], values: [0 N, 10 N]}}\n"
    )
    more = [
        f"machine.axes.X.{each}"
        for each in ("drive.cogging_1.order=10", "drive.cogging_1.amplitude=0.2 N.m", "drive.friction_table.points=2",
                     "drive.friction_table.speed_1=10 mm/s", "drive.friction_table.torque_1=0.3 N.m",
                     "guide.F_C=20 N", "guide.F_S=30 N", "transmission.stiffness=400 N/um",
                     "transmission.damping=1e4 N.s/m")
    ]  # fmt: skip
    inertia = 0.01  # [kg.m2] of what turns with the motor
    plan = load(scenario, [*more, f"machine.axes.X.transmission.inertia={inertia} kg.m^2"])
    (drawn,) = cloud_of(plan.machine).draws(1)
    before, after = plan.machine.axes["X"], drawn.axes["X"]
    ratio = before.drive.K_p / after.drive.K_p  # of the inertia
    assert abs(ratio - 1) > 0.02
    scale = torque_scale(plan.machine, drawn, "X")
    assert scale == pytest.approx(1 / ratio, rel=1e-12)
    assert torque_scale(plan.machine, drawn, "Y") == 1.0
    program = nc.plan(plan)
    cycles = (len(program.time) - 1) * round(plan.machine.cycles.T_pos / plan.machine.cycles.T_c)
    torque = 0.2 * np.sin(np.linspace(0, 60, cycles + 1))  # from outside
    plain = cosim.run(plan, fmus=fmus, torque_feedforward={"X": torque}).trace["X.x_a"]
    by_torque = cosim.run(on_draw(plan, drawn), fmus=fmus, torque_feedforward={"X": scale * torque}).trace["X.x_a"]

    with (folder / "modes.csv").open(newline="") as text:
        heads, *rows = list(csv.reader(text))
    of_X = [k for k, head in enumerate(heads) if head in ("n_X", "x_X", "tcp_X")]
    for row in rows:
        for k in of_X:
            row[k] = repr(float(row[k]) / ratio**0.5)
    with (folder / "modes.csv").open("w", newline="") as text:
        csv.writer(text, lineterminator="\n").writerows([heads, *rows])
    other = load(scenario, [*more, f"machine.axes.X.transmission.inertia={inertia * ratio!r} kg.m^2"])
    by_inertia = cosim.run(other, fmus=fmus, torque_feedforward={"X": torque}).trace["X.x_a"]
    assert np.abs(by_torque - by_inertia).max() < 1e-10
    assert np.abs(by_torque - plain).max() > 1e-8  # and it makes a difference


def test_draws_of_maxwell_slip_keep_its_law() -> None:
    """Spread and attraction are drawn and scaled as torques of LuGre are; what is no parameter of it is none."""
    values = {"sigma_0": 300.0, "sigma_1": 0.8, "sigma_2": 0.006, "F_C": 1.6, "F_S": 2.1, "v_s": 0.6, "spread": 20.0}
    friction = GmsFriction.model_validate({"law": "gms", **values})
    made = drawing._friction(friction, {"spread": 25.0, "F_C": 1.7, "W": 0.1}, 1.1)
    assert made is not None
    assert (made.law, made.spread, made.F_C, made.C) == ("gms", 25.0, pytest.approx(1.87), pytest.approx(220.0))
    assert drawing.unit_of("C") == "N.m/s"
    assert drawing.unit_of("spread") == "1"
    assert drawing._friction(friction, {"spread": 0.5}, 1.0) is None
