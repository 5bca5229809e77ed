"""Distance from the programmed path: the foot against a search of the whole window, blocks, shares, delay."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import feedsim as fs
from feedsim.analysis import contours
from feedsim.analysis.contour_error import ContourError, contour_error, per_block, without_friction
from feedsim.files.trace import Trace
from feedsim.motions.part_program import Motion, Moves
from feedsim.motions.planner.nearest import ProgrammedPath
from feedsim.motions.program import ProgrammedGeometry
from feedsim.simulation.nc import Program, Segment

Array = NDArray[np.float64]
NAN3 = [np.nan] * 3
MACHINE = fs.load_machine("scenarios/machines/test_centre")


def moves_of(axes: tuple[str, ...], start: Any, rows: list[tuple[Any, ...]]) -> Moves:
    """Rows ("line", end) or ("arc", end, centre, normal, angle) at 3 m/min."""
    arcs = [row if row[0] == "arc" else (row[0], row[1], NAN3, NAN3, np.nan) for row in rows]
    _, end, centre, normal, angle = (list(column) for column in zip(*arcs, strict=True))
    count = len(rows)
    return Moves(
        axes=axes, start=np.array(start, dtype=float),
        motion=np.array([Motion.ARC if row[0] == "arc" else Motion.LINE for row in rows], dtype=np.int8),
        end=np.array(end, dtype=float), centre=np.array(centre, dtype=float), normal=np.array(normal, dtype=float),
        angle=np.array(angle, dtype=float), feed=np.full(count, 0.05), dwell=np.zeros(count),
        blending=np.zeros(count, dtype=np.int8), tolerance=np.full(count, np.nan),
        jerk_limited=np.ones(count, dtype=bool), feedforward=np.ones(count, dtype=bool),
        compressed=np.zeros(count, dtype=bool), file=np.zeros(count, dtype=np.int32),
        line=np.arange(1, count + 1, dtype=np.int32), files=("hand.mpf",),
        texts=("\n".join(f"N{k}" for k in range(count)),), notes=(),
    )  # fmt: skip


def turned(v: Array, k: Array, angle: float) -> Array:
    """Rodrigues: v turned about the unit vector k."""
    return np.asarray(v * np.cos(angle) + np.cross(k, v) * np.sin(angle) + k * (k @ v) * (1 - np.cos(angle)))


def random_path(rng: np.random.Generator, count: int) -> Moves:
    """Lines, arcs of up to one and a half turns and helices, in space."""
    x, rows = np.zeros(3), []
    for _ in range(count):
        if rng.random() < 0.5:
            x = x + rng.normal(0, 1e-3, 3)
            rows.append(("line", x))
            continue
        k = rng.normal(size=3)
        k /= np.linalg.norm(k)
        radius = rng.normal(0, 1e-3, 3)
        radius -= (radius @ k) * k
        centre, angle = x - radius, rng.uniform(0.1, 9.0)
        x = centre + turned(radius, k, angle) + k * rng.choice([0.0, 2e-4])
        rows.append(("arc", x, centre, k, angle))
    return moves_of(("X", "Y", "Z"), np.zeros(3), rows)


@pytest.mark.parametrize("seed", range(8))
def test_the_foot_is_the_nearest_point_of_its_window(seed: int) -> None:
    """Against 20,001 points of the window: none is nearer, and the foot is as near as their distance allows."""
    rng = np.random.default_rng(seed)
    moves = random_path(rng, 20)
    path = ProgrammedPath.of(moves)
    np.testing.assert_allclose(path.point(path.s[1:] - 1e-15), moves.end[path.row], rtol=0, atol=1e-11)
    s, reach = rng.uniform(0, path.s[-1], 60), rng.uniform(1e-4, 3e-3, 60)
    x = path.point(s) + rng.normal(0, 3e-5, (60, 3))
    feet = path.nearest(x, s, reach)
    found = np.linalg.norm(x - feet.point, axis=1)
    np.testing.assert_allclose(path.point(feet.s), feet.point, rtol=0, atol=1e-12)
    for k in range(60):
        window = np.linspace(max(0, s[k] - reach[k]), min(path.s[-1], s[k] + reach[k]), 20_001)
        sought = np.linalg.norm(path.point(window) - x[k], axis=1).min()
        assert sought - 1e-8 <= found[k] <= sought + 1e-9
        assert abs(feet.s[k] - s[k]) <= reach[k] + 1e-12


def test_a_path_there_and_back_and_a_crossing_give_no_wrong_block() -> None:
    """The nearest point of the whole path is of the wrong block half of the time; that of the window never is."""
    rows = [("line", (0.02, 0.0)), ("line", (0.0, 0.0)), ("line", (0.01, 0.01)), ("line", (0.01, -0.01))]
    path = ProgrammedPath.of(moves_of(("X", "Y"), (0.0, 0.0), rows))
    s = np.linspace(1e-4, path.s[-1] - 1e-4, 5000)
    block = np.searchsorted(path.s, s) - 1
    clear = np.abs(s[:, None] - path.s[None, :]).min(axis=1) > 40e-6
    x = path.point(s) + np.random.default_rng(1).normal(0, 3e-6, (5000, 2))
    feet = path.nearest(x, s, np.full(5000, 40e-6))
    assert np.array_equal(feet.row[clear], block[clear])
    everywhere = path.nearest(x, s, np.full(5000, path.s[-1])).row
    assert (everywhere[clear] == block[clear]).mean() > 0.99  # equally near to 1 nm: that nearer to where the plan is
    unaware = path.nearest(x, np.zeros(5000), np.full(5000, 2 * path.s[-1])).row
    assert (unaware[clear] != block[clear]).mean() > 0.2


def test_the_left_of_the_motion_is_positive() -> None:
    axes = (("X", "Y"), ("X", "Z"))
    for names, normal in zip(axes, ((0, 0, 1.0), (0, 1.0, 0)), strict=True):
        error = deviation_of(names, [("line", (0.01, 0.0))], lambda t: (0.05 * t, np.full_like(t, 3e-6)))
        # X to Y turns to the left seen from +Z; Z to X does seen from +Y, so that +Z is to the right of +X.
        left, up = error.sides("scale", np.arange(100, 150))
        assert up == pytest.approx(0.0, abs=1e-15)
        assert left == pytest.approx(3e-6 if normal[2] else -3e-6, abs=1e-12)


def deviation_of(names: tuple[str, ...], rows: list[tuple[Any, ...]], at: Any, delay: float = 0.0) -> ContourError:
    """Of positions at(t) after a path driven at 0.05 m/s without accelerations; setpoints are on the path."""
    moves = moves_of(names, np.zeros(len(names)), rows)
    path = ProgrammedPath.of(moves)
    return evaluated(moves, path, at, delay)


def evaluated(moves: Moves, path: ProgrammedPath, at: Any, delay: float, frictionless: Any = None) -> ContourError:
    names, end = moves.axes, path.s[-1] / 0.05
    time = np.arange(round(end / 1e-3) + 60) * 1e-3
    x_s = path.point(np.minimum(0.05 * time, path.s[-1]))
    speed = np.gradient(x_s, 1e-3, axis=0)
    program = Program(
        time,
        {axis: x_s[:, i] for i, axis in enumerate(names)},
        {axis: speed[:, i] / MACHINE.axes[axis].I_P for i, axis in enumerate(names)},
    )
    ends = path.s / 0.05
    plan = SimpleNamespace(start_time=ends[:-1], end_time=ends[1:], notes=())
    programmed = ProgrammedGeometry(moves, path, plan, 0.0, time, np.minimum(0.05 * time, path.s[-1]), names)  # type: ignore[arg-type]
    segment = Segment("program", 0, 0.0, end, "", {}, {}, names, programmed)
    columns = {f"{axis}.x_a": np.asarray(at(time)[i]) for i, axis in enumerate(names)}
    trace = Trace(time, columns, dict.fromkeys(columns, "m"))
    other = None
    if frictionless is not None:
        columns = {f"{axis}.x_a": np.asarray(frictionless(time)[i]) for i, axis in enumerate(names)}
        other = Trace(time, columns, dict.fromkeys(columns, "m"))
    return contour_error(trace, program, segment, MACHINE, other)


def arc(radius: float) -> list[tuple[Any, ...]]:
    return [("arc", (0.0, 0.0), (-radius, 0, 0), (0, 0, 1.0), 2 * np.pi)]


def on_the_arc(radius: float, off: float, delay: float = 0.0) -> Any:
    def at(time: Array) -> tuple[Array, Array]:
        phi = 0.05 * np.clip(time - delay, 0, 2 * np.pi * radius / 0.05) / radius
        return (radius + off) * np.cos(phi) - radius, (radius + off) * np.sin(phi)

    return at


def test_a_delay_of_the_drives_is_no_deviation() -> None:
    """Positions 4.861 ms behind their setpoints on a circle, and 2 um outside: distance 2 um, delay 4.861 ms."""
    error = deviation_of(("X", "Y"), arc(0.01), on_the_arc(0.01, 2e-6, 4.861e-3))
    assert error.delay == pytest.approx(4.861e-3, abs=2e-6)
    inner = error.by["scale"].distance[50:-50]
    assert inner == pytest.approx(2e-6, abs=1e-11)
    left, _ = error.sides("scale", np.arange(50, 1000))
    assert left == pytest.approx(-2e-6, abs=1e-11)  # outside of a circle to the left
    assert error.figures()["largest"].value == pytest.approx(2.0, abs=1e-3)


def test_shares_are_the_distance_to_the_last_digits() -> None:
    """Of axes and tool, with and without the share of friction; each axis counts along the normal."""
    moves = moves_of(("X", "Y"), (0.0, 0.0), [("line", (0.01, 0.0)), ("line", (0.01, 0.01)), *arc(5e-3)[:0]])
    path = ProgrammedPath.of(moves)
    rng = np.random.default_rng(3)
    wave = rng.uniform(50, 400, (4, 2))

    def moved(size: float, phase: int) -> Any:
        def at(time: Array) -> list[Array]:
            x = path.point(np.clip(0.05 * (time - 3e-3), 0, path.s[-1]))
            return [x[:, i] + size * np.sin(wave[phase, i] * time + i) for i in (0, 1)]

        return at

    for frictionless in (None, moved(4e-6, 1)):
        error = evaluated(moves, path, moved(9e-6, 0), 0.0, frictionless)
        own = error.by["scale"]
        names = ["plan", "servo"] + (["friction"] if frictionless else [])
        assert list(own.shares) == names
        total = np.sum([own.shares[name] for name in names], axis=0)
        vectors = error.vectors("scale", np.arange(len(error.time)))
        position = np.stack(moved(9e-6, 0)(error.time), axis=1)
        distance = np.linalg.norm(position - path.point(own.s), axis=1)
        np.testing.assert_allclose(total, distance, rtol=0, atol=1e-15)
        np.testing.assert_allclose(own.distance, distance, rtol=0, atol=1e-15)
        for name in names:
            np.testing.assert_allclose(vectors.shares[name].sum(axis=1), own.shares[name], rtol=0, atol=1e-18)
    # The share of friction is the difference of the two runs along the normal.
    difference = np.stack(moved(9e-6, 0)(error.time), axis=1) - np.stack(moved(4e-6, 1)(error.time), axis=1)
    np.testing.assert_allclose(own.shares["friction"], (vectors.normal * difference).sum(axis=1), rtol=0, atol=1e-15)


def test_figures_of_blocks_are_those_of_their_positions() -> None:
    rng = np.random.default_rng(5)
    row, distance = rng.integers(0, 40, 3000), rng.exponential(1e-6, 3000)
    row[row == 7] = 8
    blocks = per_block(row, distance, 40)
    for k in range(40):
        own = np.sort(distance[row == k])
        if k == 7:
            assert np.isnan([blocks.largest[k], blocks.rms[k], blocks.p95[k]]).all()
            assert blocks.at[k] == -1
            continue
        assert blocks.largest[k] == own[-1] == distance[blocks.at[k]]
        assert blocks.rms[k] == pytest.approx(np.sqrt(np.mean(own**2)), rel=1e-12)
        assert (own <= blocks.p95[k]).mean() >= 0.95 > (own < blocks.p95[k]).mean()


def test_rapids_do_not_count_where_there_are_blocks_at_a_feed() -> None:
    moves = moves_of(("X", "Y"), (0.0, 0.0), [("line", (0.01, 0.0)), ("line", (0.02, 0.0))])
    path = ProgrammedPath.of(moves)

    def at(time: Array) -> tuple[Array, Array]:
        return np.clip(0.05 * time, 0, 0.02), np.where(0.05 * time < 0.01, 5e-6, 1e-6)

    assert evaluated(moves, path, at, 0.0).figures()["largest"].value == pytest.approx(5, abs=1e-3)
    rapid = replace(moves, motion=np.array([Motion.RAPID, Motion.LINE], dtype=np.int8))
    assert evaluated(rapid, path, at, 0.0).figures()["largest"].value == pytest.approx(1, abs=1e-3)
    alone = replace(moves, motion=np.full(2, Motion.RAPID, dtype=np.int8))
    assert evaluated(alone, path, at, 0.0).figures()["largest"].value == pytest.approx(5, abs=1e-3)


def test_a_machine_nearly_without_friction_differs_in_friction_alone() -> None:
    bare = without_friction(MACHINE)
    assert bare is not None
    for name, axis in bare.axes.items():
        own = MACHINE.axes[name]
        for key in ("F_C", "F_S", "F_log", "sigma_0", "sigma_1", "sigma_2"):
            assert getattr(axis.friction, key) == pytest.approx(1e-6 * getattr(own.friction, key), rel=1e-12)
        for key in ("v_s", "beta", "v_log", "W"):
            assert getattr(axis.friction, key) == getattr(own.friction, key)
        assert axis.M_0 == own.M_0
        assert axis.drive == own.drive


def test_a_full_circle_has_the_deviations_of_the_circle_scenario(tmp_path: Path) -> None:
    """Three turns of the shipped circle as a program, where the path's limits bind and no axis's: in the turn that the
    scenario evaluates the distances to the outside are its deviations of the radius, to 1 nm."""
    scenario = fs.run("scenarios/xz_circle.yaml", set={"motions.0.direction": "counterclockwise"})
    (tmp_path / "circle.mpf").write_text("G18 G91 G64\nG2 X0 Z0 I-15 K0 TURN=2 F3000\n")  # X to Z: clockwise about +Y
    program = fs.run(
        tmp_path / "circle.mpf", machine="scenarios/machines/test_centre", friction_share=False,
        set={"machine.axes.*.max_jerk": "800 m/s^3"},
    )  # fmt: skip
    error = contours(program)["contour"]
    begin, end = scenario.program.segments[0].geometry.turns[1]
    turn = np.flatnonzero((error.time >= begin) & (error.time < end))
    outside, _ = error.sides("scale", turn)  # the centre is to the right
    for name, value in (("F_max", outside.max()), ("F_min", outside.min()), ("mean", outside.mean())):
        assert 1e6 * value == pytest.approx(scenario.figures[f"XZ.{name}"].value, abs=1e-3)
    plan = np.abs(error.by["scale"].shares["plan"][turn])
    assert plan.max() < 1e-10  # setpoints are on the circle, a tenth of the 1 nm above
    outside, _ = error.sides("tool", turn)
    assert 1e6 * outside.max() == pytest.approx(scenario.figures["XZ.tool.F_max"].value, abs=1e-3)


def test_the_share_of_friction_is_what_vanishes_without_it(tmp_path: Path) -> None:
    """A reversal: friction makes the peak; the same program on the machine without friction has none."""
    (tmp_path / "reversal.mpf").write_text("G18 G91 G64\nG2 X0 Z0 I-5 K0 F1000\n")
    with_share = fs.run(tmp_path / "reversal.mpf", machine="scenarios/machines/test_centre")
    error = contours(with_share)["contour"]
    assert error.main_share("scale")[0] == "friction"
    largest, friction = (with_share.figures[f"contour.{name}"].value for name in ("largest", "friction"))
    bare = without_friction(with_share.scenario.machine)
    again = fs.run(with_share.scenario.model_copy(update={"machine": bare}), friction_share=False)
    at = error.overall("scale")[3]
    rest = contours(again)["contour"].by["scale"].distance[at] * 1e6
    assert friction == pytest.approx(largest, abs=3 * rest + 0.01)
    assert rest < 0.2 * largest
    shares = [with_share.figures[f"contour.{name}"].value for name in ("plan", "servo", "friction")]
    assert sum(shares) == pytest.approx(largest, abs=1e-9)
    names = ("plan", "servo", "friction", "structure")
    shares = [with_share.figures[f"contour.tool.{name}"].value for name in names]
    assert sum(shares) == pytest.approx(with_share.figures["contour.tool.largest"].value, abs=1e-9)


def test_a_plan_on_the_path_has_no_share_where_an_axis_overshoots() -> None:
    """There and back: the axis stays 4 um beyond the turn while the setpoint is on its way back."""
    rows = [("line", (0.01, 0.0)), ("line", (0.0, 0.0))]
    path = ProgrammedPath.of(moves_of(("X", "Y"), (0.0, 0.0), rows))

    def at(time: Array) -> tuple[Array, Array]:
        x = path.point(np.minimum(0.05 * time, path.s[-1]))
        late = (time >= 0.2) & (time < 0.21)
        return np.where(late, 0.01 + 4e-6, x[:, 0]), x[:, 1]

    own = evaluated(moves_of(("X", "Y"), (0.0, 0.0), rows), path, at, 0.0).by["scale"]
    assert own.distance.max() == pytest.approx(4e-6, abs=1e-12)
    assert np.abs(own.shares["plan"]).max() < 1e-12
    np.testing.assert_allclose(own.shares["plan"] + own.shares["servo"], own.distance, rtol=0, atol=1e-15)
