"""What takes turns is there, and no file is left out at every turn."""

from __future__ import annotations

from pathlib import Path

import pytest

import rotation

TESTS = Path(__file__).resolve().parent
FILES = [file for group in rotation.GROUPS for file in group]


def test_its_files_are_there_and_each_has_one_turn() -> None:
    assert [file for file in FILES if not (TESTS / file).is_file()] == []
    assert sorted(set(FILES)) == sorted(FILES)


def test_every_file_runs_at_one_turn_of_all(monkeypatch: pytest.MonkeyPatch) -> None:
    for number in range(40, 40 + len(rotation.GROUPS)):
        monkeypatch.setenv("FEEDSIM_TURN", str(number))
        at_rest = rotation.left_out(rotation.turn())
        assert set(FILES) - at_rest == set(rotation.GROUPS[number % len(rotation.GROUPS)])


def test_without_a_turn_all_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("FEEDSIM_TURN", raising=False)
    assert rotation.left_out(rotation.turn()) == frozenset()
