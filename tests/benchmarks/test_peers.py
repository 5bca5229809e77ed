"""The benchmark against other simulators on a motion of a few milliseconds: that it runs, and refuses wrong results."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import peers
import pytest
from peers_contestants import Outcome

pytestmark = pytest.mark.extensive

ROOT = Path(__file__).resolve().parents[2]
SHORT = "motions=[{kind: circle, plane: [X, Z], radius: 50 um, feed: 3 m/min, turns: 1}, {kind: dwell, duration: 9 ms}]"


def _outcome(x: float, instants: list[int]) -> Outcome:
    return Outcome(1.0, 8, instants, {name: [x] * len(instants) for name in peers.AXES})


def test_all_of_it_on_a_short_motion(fmus: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FEEDSIM_FMUS", str(fmus))
    command = [sys.executable, "benchmarks/peers.py", "--rounds", "1", "--set", SHORT, "--set", "evaluate=[]"]
    command += ["--only", "ecos", "libcosim", "fmpy", "--json", str(tmp_path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / "peers.json").read_text(encoding="utf-8"))["results"]
    ran = set(found["us per cycle"])
    assert ran | set(found["left out"]) == {"native", "native-parallel", "ecos", "libcosim", "fmpy"}
    if "native" not in ran:
        pytest.skip(f"no native loop: {found['left out']['native']}")
    assert "fmpy" in ran  # a dependency of ours
    assert set(found["x_a differs m"]) == ran - {"native", "native-parallel"}
    for name in ran:
        row = next(line for line in done.stdout.splitlines() if line.startswith(f"| {LABELS[name]} |"))
        assert row.count("|") == 9


LABELS = {entry.key: entry.label for entry in peers.ENTRIES}


def test_what_is_not_there_is_left_out_with_its_reason(tmp_path: Path) -> None:
    bench = peers.Bench(tmp_path / "missing.ssp", (), 8, tmp_path)
    assert bench.run("ecos") is None
    assert bench.left_out["ecos"]


def test_a_wrong_result_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bench = peers.Bench(tmp_path / "any.ssp", (), 8, tmp_path)
    entry = peers.Entry("fmpy", "FMPy", "parallel", "", "reference", 1e-9)
    monkeypatch.setattr(bench, "run", lambda key: _outcome(0.1 + 2e-9, [8]))
    with pytest.raises(SystemExit, match="FMPy: x_a is 2e-09 m off, 1e-09 m are allowed"):
        peers.check(bench, [entry], {"reference": _outcome(0.1, [4, 8])})
    monkeypatch.setattr(bench, "run", lambda key: _outcome(float("nan"), [8]))
    with pytest.raises(SystemExit, match="nan m off"):
        peers.check(bench, [entry], {"reference": _outcome(0.1, [8])})


def test_results_without_a_common_instant_are_no_comparison() -> None:
    with pytest.raises(SystemExit, match="no instant in common"):
        peers._difference(_outcome(0.1, [8]), _outcome(0.1, [16]))


def test_the_pinned_reference_is_the_circle() -> None:
    found = peers._pinned()
    assert found.instants[:3] == [0, 16, 32]
    assert {name: values[0] for name, values in found.x_a.items()} == {"X": 0.8, "Y": 0.327, "Z": 0.1}
