"""The benchmarks' harness: statistics, tables, the JSON file. Nothing is asserted about time."""

from __future__ import annotations

import importlib
import json
import math
import re
import subprocess
import sys
from collections import namedtuple
from pathlib import Path

import harness
from harness import Contestant, Costs, digits, measure, table

import provenance
import pytest

from command_helpers import PATIENCE

all_benchmarks = importlib.import_module("all")  # as a name of this module it would hide Python's own


def _scripted(log: list[str], name: str, costs: list[float | None], rounds: int | None = None) -> Contestant:
    left = iter(costs)

    def run() -> float | None:
        log.append(name)
        return next(left)

    return Contestant(name, run, rounds)


def test_contestants_take_turns() -> None:
    log: list[str] = []
    measure([_scripted(log, "a", [1.0] * 3), _scripted(log, "b", [1.0] * 3)], 3)
    assert log == ["a", "b"] * 3


@pytest.mark.parametrize(
    ("wanted", "rounds", "expected"), [(3, 9, [0, 3, 6]), (2, 5, [0, 2]), (1, 4, [0]), (7, 2, [0, 1])]
)
def test_those_that_take_long_are_spread_evenly(wanted: int, rounds: int, expected: list[int]) -> None:
    costs = measure([Contestant("a", lambda: 1.0, wanted)], rounds)
    assert list(costs.costs["a"]) == expected


def test_a_ratio_is_of_neighbours() -> None:
    """A machine that is three times as slow in the last two rounds: the medians of all would say 6 / 1, or 2 / 3."""
    costs = measure([_scripted([], "a", [2.0, 6.0, 6.0]), _scripted([], "b", [1.0, 3.0, 3.0])], 3)
    assert costs.ratios("a", "b") == [2.0, 2.0, 2.0]
    costs = Costs({"a": {0: 2.0, 2: 8.0}, "b": {0: 1.0, 1: 100.0, 2: 1.0}})
    assert costs.ratios("a", "b") == [2.0, 8.0]
    assert (costs.ratio("a", "b"), costs.median("b"), costs.shortest("a")) == (5.0, 1.0, 2.0)


def test_a_failed_round_is_left_out() -> None:
    costs = measure([_scripted([], "a", [None, 2.0]), _scripted([], "b", [1.0, 4.0]), Contestant("c", lambda: None)], 2)
    assert costs.costs == {"a": {1: 2.0}, "b": {0: 1.0, 1: 4.0}}
    assert costs.ratio("a", "b") == 0.5


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (28.44, "28.4"),
        (0.99996, "1.00"),
        (99.96, "100"),
        (1234.5, "1230"),
        (1e-9, "1e-09"),
        (0.0, "0"),
        (-2.5, "-2.50"),
    ],
)
def test_digits(value: float, shown: str) -> None:
    assert digits(value) == shown


def test_a_table_is_markdown() -> None:
    assert table(["a", "b"], [[1, "---"], ["x", 2.5]]) == "| a | b |\n|---|---|\n| 1 | --- |\n| x | 2.5 |"


def test_json_says_what_figures_depend_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", [str(harness.ROOT / "benchmarks" / "peers.py"), "--rounds", "2"])
    for name in harness.SETTINGS:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("FEEDSIM_CFLAGS", "-g")
    (tmp_path / "plant.fmu").write_bytes(b"abc")
    monkeypatch.setenv("FEEDSIM_FMUS", str(tmp_path))
    costs = Costs({"a": {0: 2.0}, "b": {0: 1.0}})
    path = harness.write_json("some", {"costs": costs.as_json("b")}, tmp_path / "bench", rounds=2, only=["a", "b"])
    assert [file.name for file in path.parent.iterdir()] == ["some.json"]
    found = json.loads(path.read_text(encoding="utf-8"))
    assert found["command"].endswith("python benchmarks/peers.py --rounds 2")
    assert found["benchmark"] == "some"
    assert (found["rounds"], found["only"]) == (2, ["a", "b"])
    assert found["versions"].keys() >= {"Python", "compiler", "feedsim", "numpy", "fmpy"}
    assert found["machine"].keys() >= {"processor", "cores", "memory GB", "system", "architecture"}
    assert found["results"]["costs"]["a"] == {
        "values": [2.0], "median": 2.0, "shortest": 2.0, "of b": 2.0, "of b, quartiles": [2.0, 2.0]
    }  # fmt: skip
    assert found["environment"] == {"FEEDSIM_CFLAGS": "-g", "FEEDSIM_FMUS": str(tmp_path)}
    assert found["binaries"] == {"plant.fmu": "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"}
    assert found["compiler flags"] is None or "-g" in found["compiler flags"]


def test_sources_are_told_where_there_is_git(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = provenance.sources()
    assert found is None or (re.fullmatch(r"[0-9a-f]{40}", str(found["commit"])) and isinstance(found["changed"], bool))
    monkeypatch.setenv("PATH", str(tmp_path))
    assert provenance.sources() is None


def test_spread_is_told_as_quartiles() -> None:
    costs = Costs(
        {"a": {i: float(value) for i, value in enumerate([1, 2, 3, 4, 9])}, "b": dict.fromkeys(range(5), 1.0)}
    )
    assert costs.ratio_text("a", "b") == "3.00 (2.00-4.00)"
    assert costs.ratio_text("b", "b") == "1.00"
    assert Costs({"a": {0: 2.0}, "b": {0: 1.0}}).ratio_text("a", "b") == "2.00"
    assert Costs({"a": {0: 2.0}, "b": {1: 1.0}}).ratio_text("a", "b") == ""


def test_common_options(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(provenance, "LOOK", 0.01)
    words = ["--rounds", "2", "--only", "b", "a", "--json", str(tmp_path), "--images", "i", "--own", "x"]
    bench = harness.arguments(
        "some", "Text.", words, rounds=5, only=("a", "b", "c"), images=True, more=lambda p: p.add_argument("--own")
    )
    assert (bench.rounds, bench.only, bench.images, bench.given.own) == (2, ("a", "b"), Path("i"), "x")
    bench.tell("| table |", {"figure": 1.5})
    assert sorted(file.name for file in tmp_path.iterdir()) == ["some.json", "some.md"]
    printed = (tmp_path / "some.md").read_text(encoding="utf-8")
    assert printed == capsys.readouterr().out
    assert printed.startswith("feedsim ")
    assert printed.endswith("\n\n| table |\n")
    found = json.loads((tmp_path / "some.json").read_text(encoding="utf-8"))
    assert found["load"].keys() >= {"cores taken by others before", "cores taken by others during", "busy"}
    assert harness.arguments("some", "Text.", [], rounds=5, only=("a", "b")).only == ("a", "b")


@pytest.mark.parametrize("words", [["--rounds", "0"], ["--only", "d"], ["--images", "i"]])
def test_wrong_options_are_refused(words: list[str]) -> None:
    with pytest.raises(SystemExit) as raised:
        harness.arguments("some", "Text.", words, rounds=5, only=("a", "b"))
    assert raised.value.code == 2


@pytest.mark.parametrize(("before", "during", "busy"), [(0.1, 0.1, False), (1.5, 0.1, True), (0.1, 1.5, True)])
def test_a_busy_machine_is_told(monkeypatch: pytest.MonkeyPatch, before: float, during: float, busy: bool) -> None:
    monkeypatch.setattr(provenance, "LOOK", 0.01)
    monkeypatch.setattr(provenance.os, "cpu_count", lambda: 2)
    load = harness.Load()
    load.before = before
    monkeypatch.setattr(load, "during", lambda: during)
    assert bool(load.told()) is busy
    assert load.as_json()["busy"] is busy


def test_own_work_is_no_load_of_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 3 s that all programs work in 4 s, 2 s are a child's: others take a quarter of a core, whatever runs here."""
    Everybody = namedtuple("Everybody", "user system idle iowait guest")
    Own = namedtuple("Own", "user system children_user children_system elapsed")
    clocks = iter(
        [
            (Everybody(50, 10, 100, 5, 1), Own(1, 0, 0, 0, 7)),
            (Everybody(51.5, 11.5, 101, 6, 2), Own(1, 0, 1.5, 0.5, 11)),
        ]
    )
    monkeypatch.setattr(provenance, "LOOK", 0.01)
    now: list[tuple[tuple[float, ...], tuple[float, ...]]] = [next(clocks)]
    monkeypatch.setattr(provenance.psutil, "cpu_percent", lambda _: 0.0)
    monkeypatch.setattr(provenance.psutil, "cpu_times", lambda: now[0][0])
    monkeypatch.setattr(provenance.os, "times", lambda: now[0][1])
    load = harness.Load()
    now[0] = next(clocks)
    assert load.elapsed() == 4
    assert load.during() == (3 - 2) / 4


def test_numpy_comes_after_the_harness() -> None:
    """It reads how many threads linear algebra may have when it is loaded."""
    code = "import sys, harness; sys.exit('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], cwd=harness.ROOT / "benchmarks").returncode == 0


@pytest.mark.parametrize(
    "name",
    [
        "accuracy",
        "all",
        "cycle",
        "duration",
        "eigen",
        "floor",
        "growth",
        "one_unit",
        "peers",
        "setpoints",
        "stability",
        "startup",
        "sweep",
        "foreign_units",
        "worst_case",
    ],
)
def test_every_benchmark_tells_its_options(name: str) -> None:
    command = [sys.executable, str(harness.ROOT / "benchmarks" / f"{name}.py"), "--help"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE)
    assert done.returncode == 0, done.stderr
    assert "--json" in done.stdout


def test_all_goes_on_after_a_failure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    write = "import sys, pathlib; pathlib.Path(sys.argv[2], '{}.md').write_text('new')"
    (tmp_path / "cycle.py").write_text("import sys; sys.exit(3)\n")
    (tmp_path / "floor.py").write_text(write.format("floor"))
    out = tmp_path / "out"
    out.mkdir()
    (out / "cycle.md").write_text("old")
    monkeypatch.setattr(all_benchmarks, "HERE", tmp_path)
    assert all_benchmarks.main(["--only", "cycle", "floor", "--json", str(out)]) == 1
    assert [file.name for file in out.iterdir()] == ["floor.md"]
    assert "failed: cycle" in capfd.readouterr().err
    assert all_benchmarks.main(["--only", "floor", "--json", str(out)]) == 0


def test_no_figure_is_not_a_number(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="nan"):
        harness.write_json("some", {"a": math.nan}, tmp_path)
    assert not (tmp_path / "some.json").exists()
