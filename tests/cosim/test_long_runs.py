"""Long runs: what is computed, recorded and read stretch by stretch is the same to the bit, and memory stays flat."""

from __future__ import annotations

import gc
import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from feedsim import scenario
from feedsim.files.trace import Table, Trace, least_and_largest, read_csv, release, stretches, write_csv
from feedsim.files.trace import trace as table
from feedsim.foundation.errors import InputError, OutputError, SimulationError
from feedsim.foundation.outputs import allow_replacement
from feedsim.motions import circular
from feedsim.motions.kind import HeldPoints, JoinedPoints
from feedsim.report import page
from feedsim.report import run as report
from feedsim.simulation import cosim, nc
from feedsim.simulation import nc as program
from feedsim.simulation import nc as spline
from feedsim.simulation.cosim import recording, schedule
from feedsim.simulation.cosim.unit import Log
from feedsim.simulation.judge import judge_run
from report_helpers import write_run

ROOT = Path(__file__).resolve().parents[2]
CIRCLE = ROOT / "scenarios" / "xz_circle.yaml"
SHORT = (
    "motions=[{kind: circle, plane: [X, Z], radius: 1 mm, feed: 3 m/min, turns: 5}, {kind: dwell, duration: 50 ms}]",
    "evaluate=[]",
)


@pytest.fixture
def everything_is_long(monkeypatch: pytest.MonkeyPatch) -> None:
    """Stretches and rings so small that a short run has many of them, their borders at odd places."""
    monkeypatch.setattr(table, "IN_MEMORY", 0)
    monkeypatch.setattr(table, "STRETCH", 101)
    monkeypatch.setattr(program, "SPLINE_POINTS", 64)
    monkeypatch.setattr(spline.LongSpline.__init__, "__defaults__", (64,))
    monkeypatch.setattr(circular, "INSTANTS", 77)
    for room in (schedule, recording):
        monkeypatch.setattr(room, "RING", 3)
        monkeypatch.setattr(room, "REPORTED_EVERY", 203)


@pytest.mark.parametrize("in_memory", [0, 10**6])
def test_table(in_memory: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(table, "IN_MEMORY", in_memory)
    values = np.random.default_rng(1).normal(size=(3, 50_000))
    filled = Table(3, 60_000, tmp_path)
    for first in range(0, 50_000, 7001):
        filled.append(values[:, first : first + 7001])
    columns = filled.columns()
    assert not list(tmp_path.iterdir()), "the file has no name"
    np.testing.assert_array_equal(np.array(columns), values)
    release(*columns)
    np.testing.assert_array_equal(np.array(columns), values)
    assert least_and_largest(columns[1]) == (values[1].min(), values[1].max())
    assert [len(part) for (part,) in stretches(columns[0], rows=20_000)] == [20_000, 20_000, 10_000]
    with pytest.raises(ValueError, match="read-only"):
        columns[0][0] = 1.0
    with pytest.raises(ValueError, match="behind row 50000"):
        filled.append(values[:, :1])


@pytest.mark.skipif(not Path("/proc/self/maps").exists(), reason="tells mappings on Linux only")
def test_file_goes_with_the_last_array(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(table, "IN_MEMORY", 0)

    def open_files() -> int:
        return Path("/proc/self/maps").read_text().count(str(tmp_path)) + sum(
            os.path.realpath(link).startswith(str(tmp_path)) for link in Path("/proc/self/fd").iterdir()
        )

    filled = Table(2, 1000, tmp_path)
    filled.append(np.arange(2000.0).reshape(2, -1))
    time, values = filled.columns()
    part = Trace(time, {"y": values}).between(10.0, 20.0)
    del filled, time, values
    gc.collect()
    assert open_files() > 0
    assert part["y"].tolist() == list(np.arange(1010.0, 1021.0))
    del part
    gc.collect()
    assert open_files() == 0


def test_full_disk_is_an_error_that_tells_the_size(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(table, "IN_MEMORY", 0)
    with pytest.raises(OutputError, match=r"gone: a temporary file of 8 MB .* cannot be written: No such file"):
        Table(10, 100_000, tmp_path / "gone")


def test_trace_takes_what_nobody_can_change_as_it_is() -> None:
    time, y = np.arange(5.0), np.arange(5.0) ** 2
    trace = Trace(time, {"y": y})
    y[0] = 7.0
    assert trace["y"][0] == 0.0, "of what can be changed it has a copy"
    assert trace.select(["y"])["y"] is trace["y"]
    assert np.shares_memory(trace.between(1, 3)["y"], trace["y"])


def test_long_traces_are_written_like_short_ones(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    time = np.arange(1000) / 7
    trace = Trace(time, {"y": np.sin(time), "n": np.round(time)}, {"y": "m"})
    write_csv(tmp_path / "whole.csv", trace)
    monkeypatch.setattr("feedsim.files.trace.files.ROWS", 13)
    write_csv(tmp_path / "parts.csv", trace)
    assert (tmp_path / "parts.csv").read_bytes() == (tmp_path / "whole.csv").read_bytes()


@pytest.mark.parametrize("per_point", [1, 2, 3])
def test_spline_solved_in_blocks_is_the_same_to_the_bit(per_point: int) -> None:
    points = 0.8 + np.cumsum(np.random.default_rng(per_point).normal(size=3000)) * 1e-4
    parts = JoinedPoints([points[:1], points[1:700], HeldPoints(float(points[699]), 5), points[705:]])
    points = parts[0 : len(parts)]
    instants = np.arange((len(points) + 40) * per_point)
    whole = spline.LongSpline(points, block=10**6)(instants, per_point)
    for block in (50, 64, 1000):
        found = spline.LongSpline(parts, block)(instants, per_point)
        np.testing.assert_array_equal(found, whole)


def test_same_run_stretch_by_stretch(fmus: Path, everything_is_long: None, monkeypatch: pytest.MonkeyPatch) -> None:
    settings = (
        "recording.interval=375 us", "logging={interval: 250 us, axes: [Z, X], noise: {x_a: 1 um}}",
    )  # fmt: skip
    loaded = scenario.load(CIRCLE, [*SHORT, *settings])
    found: list[Trace] = []
    runs = [
        judge_run(cosim.run(loaded, fmus=fmus, sink=found.append)),
        judge_run(cosim.run(loaded, fmus=fmus, native=False)),
    ]
    long_setpoints = nc.plan(loaded)
    monkeypatch.undo()
    short = judge_run(cosim.run(loaded, fmus=fmus))
    for axis in loaded.machine.axes:
        np.testing.assert_array_equal(long_setpoints.x_s[axis], short.program.x_s[axis])
        np.testing.assert_array_equal(long_setpoints.n_ffw[axis], short.program.n_ffw[axis])
    for run in runs:
        assert run.coupling == short.coupling
        assert run.warnings == short.warnings
        for one, other in ((run.trace, short.trace), (run.log, short.log), (run.fine, short.fine)):
            assert one is not None
            assert other is not None
            assert one.units == other.units
            np.testing.assert_array_equal(one.time, other.time)
            for name in other:
                np.testing.assert_array_equal(one[name], other[name], err_msg=name)
    assert len(found) > 10
    np.testing.assert_array_equal(np.concatenate([part.time for part in found]), short.trace.time)
    np.testing.assert_array_equal(np.concatenate([part["X.x_a"] for part in found]), short.trace["X.x_a"])


def test_units_are_asked_for_what_is_recorded_alone(fmus: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: dict[str, set[str]] = {}

    def log(unit: object, names: list[str], rows: int) -> Log:
        asked.setdefault(unit.name, set()).update(names)  # type: ignore[attr-defined]
        return Log(unit, names, rows)  # type: ignore[arg-type]

    monkeypatch.setattr(recording, "Log", log)
    limits = {"torque_limited", "voltage_limited"}  # for the warnings
    cosim.run(scenario.load(CIRCLE, [*SHORT, "recording.variables=[X.x_a, X.x_s, Z.M_s, 'tcp.*']"]), fmus=fmus)
    assert asked == {
        "plant": {"X.x_a", "tcp.x_X", "tcp.x_Y", "tcp.x_Z"},
        "controller_X": limits,
        "controller_Y": limits,
        "controller_Z": {"M_s", *limits},
    }


def test_residual_is_recorded_where_it_is_asked_for(fmus: Path) -> None:
    run = judge_run(cosim.run(scenario.load(CIRCLE, [*SHORT, "recording.variables=['?.residual']"]), fmus=fmus))
    assert list(run.trace) == ["X.residual", "Y.residual", "Z.residual"]
    assert run.trace.unit("X.residual") == "J"
    assert run.trace["X.residual"][0] == 0.0
    assert run.trace["X.residual"][-1] == run.coupling["X.residual"]
    assert "X.residual" not in cosim.run(scenario.load(CIRCLE, [*SHORT]), fmus=fmus).trace


# An unstable speed loop: its numbers leave what a double can hold after some cycles.
FAILING = [
    f"machine.axes.Z.drive.{entry}" for entry in ("K_p=1e300 N.m.s/rad", "M_max=1e308 N.m", "ideal_current_loop=true")
]


@pytest.mark.parametrize("native", [None, False])
def test_what_failed_leaves_its_rows(native: bool | None, fmus: Path, tmp_path: Path) -> None:
    loaded = scenario.load(CIRCLE, [*SHORT, "recording.interval=125 us"])
    whole = cosim.run(loaded, fmus=fmus).trace
    stopped = 1.5 * 2048 * 125e-6

    class Stop(Exception):
        pass

    def progress(done: int, total: int) -> None:
        if done * 125e-6 > stopped:
            raise Stop

    partial = report.growing_result(tmp_path / "out")
    with pytest.raises(Stop), partial:
        cosim.run(loaded, fmus=fmus, native=native, progress=progress, sink=partial)
    assert [file.name for file in (tmp_path / "out").iterdir()] == ["result.partial.csv"]
    left = read_csv(partial.path)
    assert len(left) == partial.rows == 4096
    np.testing.assert_array_equal(left["Z.x_a"], whole["Z.x_a"][:4096])


@pytest.mark.parametrize("native", [None, False])
def test_rows_up_to_the_failing_cycle(native: bool | None, fmus: Path) -> None:
    found: list[Trace] = []
    with pytest.raises(SimulationError, match=r"t = [0-9.e-]+ s") as caught:
        cosim.run(
            scenario.load(CIRCLE, [*SHORT, *FAILING, "recording.interval=125 us"]),
            fmus=fmus, native=native, sink=found.append,
        )  # fmt: skip
    failed = float(str(caught.value).partition("t = ")[2].partition(" s")[0])
    last = found[-1].time[-1] if found else -125e-6
    assert failed - 2.1 * 125e-6 < last < failed


def test_finished_run_has_no_partial_file(fmus: Path, tmp_path: Path) -> None:
    (tmp_path / "result.partial.csv").write_text("of another run")
    loaded = scenario.load(CIRCLE, [*SHORT])
    with report.growing_result(tmp_path) as partial:
        run = judge_run(cosim.run(loaded, fmus=fmus, sink=partial))
        write_run(run, {}, tmp_path, partial)
    assert not partial.path.exists()
    write_csv(tmp_path / "afterwards.csv", run.trace)
    assert (tmp_path / "result.csv").read_bytes() == (tmp_path / "afterwards.csv").read_bytes()


def _failing(monkeypatch: pytest.MonkeyPatch, name: str, folder: Path, *, away: bool) -> None:
    """Let the moving of a file fail once, into the folder or away from it."""
    real = Path.replace
    failed: list[str] = []

    def replace(self: Path, target: Path) -> Path:
        if (self if away else target) == folder / name and not failed:
            failed.append(name)
            raise PermissionError(13, "Permission denied")
        return real(self, target)

    monkeypatch.setattr(Path, "replace", replace)


@pytest.mark.parametrize(
    ("name", "away"), [("result.csv", True), ("result.csv", False), ("report.html", False), ("summary.json", False)]
)
def test_rows_stay_where_results_cannot_be_written(
    name: str, away: bool, fmus: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A result.csv that another program holds, a quota: the rows of a good run are not lost, nor is the old result."""
    loaded = scenario.load(CIRCLE, [*SHORT])
    for earlier in ("result.csv", "report.html"):
        (tmp_path / earlier).write_text(f"old {earlier}")
    partial = report.growing_result(tmp_path)
    run = judge_run(cosim.run(loaded, fmus=fmus, sink=partial))
    _failing(monkeypatch, name, tmp_path, away=away)
    with allow_replacement(), pytest.raises(OutputError, match="Permission denied"), partial:
        write_run(run, {}, tmp_path, partial)
    monkeypatch.undo()
    assert sorted(file.name for file in tmp_path.iterdir()) == ["report.html", "result.csv", "result.partial.csv"]
    assert (tmp_path / "result.csv").read_text() == "old result.csv"
    assert (tmp_path / "report.html").read_text() == "old report.html"
    assert partial.has_rows
    write_csv(tmp_path / "afterwards.csv", run.trace)
    assert partial.path.read_bytes() == (tmp_path / "afterwards.csv").read_bytes()


def test_run_that_never_begins_takes_no_rows_away(fmus: Path, tmp_path: Path) -> None:
    kept, target = tmp_path / "result.partial.csv", tmp_path / "elsewhere.csv"
    target.write_text("of another run")
    kept.symlink_to(target)
    with pytest.raises(InputError), report.growing_result(tmp_path) as partial:
        cosim.run(scenario.load(CIRCLE, [*SHORT]), fmus=tmp_path / "none", sink=partial)
    assert kept.read_text() == "of another run"
    assert not partial.has_rows
    partial = report.growing_result(tmp_path)
    cosim.run(scenario.load(CIRCLE, [*SHORT]), fmus=fmus, sink=partial)
    assert partial.has_rows
    assert kept.read_text().startswith("time [s],")
    assert target.read_text() == "of another run"


def test_rows_are_written_in_order_up_to_a_fault_and_not_behind_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However much slower the writing is than what brings the rows; then no thread is there any more."""
    write = page.Partial._write
    monkeypatch.setattr(page.Partial, "_write", lambda self, part: (time.sleep(0.01), write(self, part)))
    threads = threading.active_count()

    def bring(partial: page.Partial, count: int) -> int:
        """How many parts were brought, one of which has a fault."""
        for k in range(count):
            at = np.arange(3.0 * k, 3 * k + 3)
            try:
                partial(Trace(at, {"x": np.where(at == 31, np.nan, at)}, {"x": "m"}))
            except OutputError:
                return k
        return count

    with report.growing_result(tmp_path) as partial:
        assert 10 < bring(partial, 1000) < 30
        with pytest.raises(OutputError, match="x is nan at 31 s"):
            partial.catch_up()
        assert (partial.rows, partial.time) == (30, 29.0)
        np.testing.assert_array_equal(read_csv(partial.path).time, np.arange(30.0))
    with report.growing_result(tmp_path) as partial:
        bring(partial, 11)
        with pytest.raises(OutputError):
            partial.finished()
    with report.growing_result(tmp_path) as partial:
        assert bring(partial, 9) == 9
        partial.catch_up()
        assert (partial.rows, threading.active_count()) == (27, threads)
    assert not partial.path.exists()


MEMORY = """
import sys, tracemalloc
from pathlib import Path
from feedsim import scenario
from feedsim.simulation import cosim
from feedsim.report import run as report
from feedsim.files.trace import trace as table
table.IN_MEMORY = 0
def peak(turns):
    settings = [f"motions.0.turns={turns}", "motions.0.radius=5 mm", "recording.interval=250 us", "evaluate=[]"]
    loaded = scenario.load(sys.argv[1], settings)
    tracemalloc.reset_peak()
    with report.growing_result(sys.argv[2]) as partial:
        run = cosim.run(loaded, fmus=Path(sys.argv[3]), sink=partial)
    assert len(run.trace) > 2500 * turns
    return tracemalloc.get_traced_memory()[1]
tracemalloc.start()
peak(1)
print(peak(1), peak(4))
"""


@pytest.mark.extensive
def test_memory_does_not_grow_with_the_duration(fmus: Path, tmp_path: Path) -> None:
    """Four times the rows; held in memory, the 67 columns of the 7500 further ones would be 4 MB."""
    words = [sys.executable, "-c", MEMORY, str(CIRCLE), str(tmp_path / "out"), str(fmus)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "master"), "TMPDIR": str(tmp_path)}
    done = subprocess.run(words, capture_output=True, text=True, check=True, env=environment)
    once, four_times = map(int, done.stdout.split())
    # what is said of each turn, and setpoints, of which a shorter program has not a whole block: some 0.1 MB
    assert four_times - once < 1_000_000, (once, four_times)
