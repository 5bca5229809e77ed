"""The benchmarks' harness: statistics, tables, the JSON file. Nothing is asserted about time."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path

import harness
import pytest
from harness import Contestant, Costs, digits, measure, table


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
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "1")
    costs = Costs({"a": {0: 2.0}, "b": {0: 1.0}})
    path = harness.write_json("some", {"costs": costs.as_json("b")}, tmp_path / "bench")
    assert [file.name for file in path.parent.iterdir()] == ["some.json"]
    found = json.loads(path.read_text(encoding="utf-8"))
    assert found["command"] == "python benchmarks/peers.py --rounds 2"
    assert found["benchmark"] == "some"
    assert found["versions"].keys() >= {"Python", "compiler", "feedsim", "numpy", "fmpy"}
    assert found["machine"].keys() >= {"processor", "cores", "memory GB", "system", "architecture", "load"}
    assert found["results"]["costs"]["a"] == {"values": [2.0], "median": 2.0, "shortest": 2.0, "of b": 2.0}
    assert found["environment"] == {"OPENBLAS_NUM_THREADS": "1"}


def test_no_figure_is_not_a_number(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="nan"):
        harness.write_json("some", {"a": math.nan}, tmp_path)
    assert not (tmp_path / "some.json").exists()
