"""Logs of the study of drives: every kind can be simulated and read, and has what makes it this kind."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "benchmarks"))
from drive_study import KINDS, MACHINE, Kind, Outcome, changed, columns, scenario, table, truth  # noqa: E402

from feedsim.scenario import load, load_machine  # noqa: E402


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_a_log_of_each_kind(kind: Kind, tmp_path: Path) -> None:
    """The scenario is a valid one, and the truth is that of the machine that runs."""
    random = np.random.default_rng(4)
    changes = changed(load_machine(MACHINE), kind, random)
    (tmp_path / "moves.yaml").write_text(scenario(kind, random, 1))
    known = load(tmp_path / "moves.yaml", changes)
    true = truth(known.machine, kind.axis)
    assert true["K_p"] == known.machine.axes[kind.axis].drive.K_p
    assert (known.machine.cycles.T_pos == 2e-3) == (kind.name == "position loop of 2 ms")
    ways = [motion.by[kind.axis] for motion in known.motions if motion.kind == "move" and kind.axis in motion.by]
    assert len(ways) == 3
    assert (min(ways) > 0) == kind.one_way
    assert ("speed_setpoint" in columns(kind, kind.axis)) == (kind.name != "position only")


def test_the_table_counts_what_is_stated() -> None:
    """A parameter that is not determined counts nowhere, a refused draw as such, repeats by themselves."""
    done = [
        Outcome("clean", 1, 0, within={"J": True, "K_p": False}),
        Outcome("clean", 1, 1, within={"J": True}, undetermined=["K_p"]),
        Outcome("repeats", 1, 0, within={"J": False}, overlaps={"J": True}),
        Outcome("one mode", 1, 0, refused="no motion"),
    ]
    assert table(done) == [
        "| kind of log | draws | refused | J | K_p | repeats overlap |",
        "|---|---|---|---|---|---|",
        "| clean | 2 | - | 2/2 | 0/1 | - |",
        "| one mode | 1 | 1 | - | - | - |",
        "| repeats | 1 | - | 0/1 | - | 1/1 |",
        "| all | 4 | 1 | 2/3 | 0/1 | 1/1 |",
    ]
