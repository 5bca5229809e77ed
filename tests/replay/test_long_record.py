"""Drives from long records: from the part that determines them best, as good as from a record of that part alone."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import feedsim as fs
from drive_helpers import MACHINES
from feedsim.estimation.replay import closed_loop
from feedsim.foundation.errors import InputError
from feedsim.jobs import replay as job
from feedsim.jobs.replay import ReplayRequest
from feedsim.scenario import load_machine

# Slow strokes to one side; strokes to and fro at several speeds; slow strokes again.
SCENARIO = """
name: long log
machine: {machine}
motions: [{motions}]
recording: {{interval: 1 ms}}
logging:
  interval: 2 ms
  axes: [X]
  signals: [x_s, x_a, x_e, n_s, n_ffw, M_a]
  noise: {{M_a: 5 %, x_a: 0.3 um, x_e: 0.3 um, n_s: 1 %}}
  seed: 1
"""
SLOW = ["{kind: move, by: {X: 0.5 mm}, feed: 60 mm/min}", "{kind: dwell, duration: 0.1 s}"]
QUICK = [
    f"{{kind: move, by: {{X: {way} mm}}, feed: {feed} mm/min}}"
    for way, feed in ((20, 10000), (-3, 1000), (-7, 6000), (-8, 3000), (5, 8000), (-5, 500))
]
TRUE = ("K_v", "k_ffw", "T_dyn", "T_sym", "K_p", "T_n", "omega_0", "D")


@pytest.fixture
def log(tmp_path: Path) -> Path:
    text = SCENARIO.format(machine=MACHINES / "one_axis", motions=", ".join([*8 * SLOW, *QUICK, *8 * SLOW]))
    (tmp_path / "moves.yaml").write_text(text)
    fs.run(tmp_path / "moves.yaml").save(tmp_path / "made")
    return tmp_path / "made" / "log.csv"


def asked_of(log: Path, window: str | None = None) -> ReplayRequest:
    return ReplayRequest.of(log, MACHINES / "one_axis", "X", None, window, None)


def test_the_part_that_moves_to_and_fro_is_taken(log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its intervals hold the parameters of the simulated drive: 95 % each, one of 8 may miss."""
    monkeypatch.setattr(job, "MAX_DRIVE_TIME", 4.5)
    result = fs.identify_drive(log, "X", MACHINES / "one_axis")
    (note,) = [finding for finding in result.findings if finding.code == "record-excerpt"]
    assert note.severity == "note"
    assert re.search(
        r"axis X: of 11\.38 s the drive is identified from [34]\.\d+ to [78]\.\d+ s, .*; window takes", str(note)
    )
    true = load_machine(MACHINES / "one_axis").axes["X"].drive
    found = result.found.drives["X"].estimates
    assert {"K_v", "K_p", "T_n", "omega_0"} <= {name for name in TRUE if found[name].status == "estimated"}
    misses = [
        name
        for name in TRUE
        if found[name].status == "estimated"
        and not found[name].interval[0] <= getattr(true, name) <= found[name].interval[1]
    ]
    assert len(misses) <= 1, misses


def test_a_window_that_is_given_counts(log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(job, "MAX_DRIVE_TIME", 4.5)
    read, records, _ = asked_of(log, "8 s..11 s").each_axis()
    assert records["X"].record.time[records["X"].rows][[0, -1]] == pytest.approx([8.0, 11.0])
    assert read["X"].records == (records["X"].record,)  # the regression takes no more than that
    assert "record-excerpt" not in {finding.code for finding in read["X"].provenance.warnings}


def test_a_short_record_is_taken_as_a_whole(log: Path) -> None:
    read, records, _ = asked_of(log).each_axis()
    assert len(records["X"].record) == len(read["X"].records[0])
    assert "record-excerpt" not in {finding.code for finding in read["X"].provenance.warnings}


def test_a_replay_of_too_many_rows_names_the_window(log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(closed_loop, "MAX_REPLAY_ROWS", 4000)
    with pytest.raises(InputError, match=r"log\.csv: 5,\d\d\d rows, 0\.\d+ min; allowed: up to 4,000\. .*window"):
        asked_of(log).records  # noqa: B018
    assert len(asked_of(log, "2 s..4 s").records["X"].record) < 4000
