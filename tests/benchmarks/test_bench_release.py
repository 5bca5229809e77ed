"""What a release is refused for: times that are longer beyond their scatter, or of another commit."""

from __future__ import annotations

import json
from pathlib import Path

import harness

import provenance
import pytest
import release


@pytest.mark.parametrize(
    ("now", "slower"),
    [([1.10, 1.11, 1.12], True), ([1.02, 1.02, 1.02], False), ([1.0, 1.2, 1.0, 1.2, 1.2], False), ([0.9, 0.9], False)],
)
def test_slower_is_beyond_three_percent_and_the_scatter(now: list[float], slower: bool) -> None:
    costs = harness.Costs({"before": dict.fromkeys(range(len(now)), 1.0), "now": dict(enumerate(now))})
    assert release.is_slower(costs, "now", "before") == slower


@pytest.mark.parametrize(
    ("commit", "short", "slower", "said"),
    [
        (None, False, [], ""),
        ("0" * 40, False, [], "is not of these sources"),
        (None, True, [], "is not of these sources"),
        (None, False, ["`frf`"], "slower than v1: `frf`"),
    ],
)
def test_a_release_needs_figures_of_its_commit_and_nothing_slower(
    commit: str | None, short: bool, slower: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.setattr(release, "RESULTS", tmp_path)
    monkeypatch.setattr(release, "ROOT", tmp_path)
    sources = provenance.sources()
    assert sources
    content = {"short": short, "sources": sources | ({"commit": commit} if commit else {}),
               "results": {"against": "v1", "slower": slower}}  # fmt: skip
    (tmp_path / "release.json").write_text(json.dumps(content), encoding="utf-8")
    assert release.main(["--check"]) == bool(said)
    assert said in capsys.readouterr().err


def test_without_figures_there_is_no_release(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(release, "RESULTS", tmp_path)
    monkeypatch.setattr(release, "ROOT", tmp_path)
    assert release.check() == 1
    assert "make bench-release" in capsys.readouterr().err
