"""Some seconds of the readers' fuzzer, always the same ones, and every finding of the past (readers.py)."""

from __future__ import annotations

import ctypes
import platform
import time
from collections.abc import Callable
from pathlib import Path

import pytest

if platform.system() != "Linux":
    pytest.skip("cases are processes that are forked and limited as Linux has it", allow_module_level=True)

from fuzz import readers, sizes

SECONDS = 6
ALLOWED = ("read", "refused")


@pytest.fixture(scope="module")
def known(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, readers.Kind]:
    return readers.kinds(tmp_path_factory.mktemp("seeds"), fmus)


def test_files_that_are_whole_are_read(known: dict[str, readers.Kind], tmp_path: Path) -> None:
    for name, kind in known.items():
        for content in kind.whole:
            path = tmp_path / f"case{kind.suffix}"
            path.write_bytes(content)
            assert readers.outcome(kind.read, path) == "read", name


def test_no_finding_of_the_past_comes_back(known: dict[str, readers.Kind], tmp_path: Path) -> None:
    ends = readers.replayed(known, tmp_path)
    assert ends
    assert not {name: end for name, end in ends.items() if end not in ALLOWED}


def test_readers_withstand_what_a_fuzzer_makes_up(known: dict[str, readers.Kind], tmp_path: Path) -> None:
    counts, findings = readers.fuzz(known, tmp_path, SECONDS, 1, tmp_path / "found")
    assert not findings
    assert sum(counts.values()) > 20


@pytest.mark.extensive
@pytest.mark.parametrize("kind", sizes.SIZES)
def test_time_grows_with_the_size_of_a_file_alone(kind: str, known: dict[str, readers.Kind], tmp_path: Path) -> None:
    """Nested, long, wide or many of one thing: a megabyte is answered in seconds of a processor."""
    path = tmp_path / f"case{known[kind].suffix}"
    ends = {}
    for name, content in sizes.files(kind):
        path.write_bytes(content)
        ends[name] = readers.outcome(known[kind].read, path, sizes.SECONDS)
    assert ends
    assert not {name: end for name, end in ends.items() if end not in ALLOWED}


def _for_ever(path: Path) -> None:
    while True:
        pass


@pytest.mark.parametrize(
    ("read", "words"),
    [
        (lambda path: ctypes.string_at(0), "crash by signal 11"),
        (lambda path: bytearray(3 << 30), "MemoryError"),
        (lambda path: 1 // 0, "ZeroDivisionError"),
        (_for_ever, "more than 1 s of computing"),
        (lambda path: time.sleep(1000), "no end within 3 s"),
    ],
)
def test_what_goes_wrong_is_found(
    read: Callable[[Path], object], words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The fuzzer itself: each way to go wrong is told as what it is."""
    monkeypatch.setattr(readers, "COMPUTING", 1)
    monkeypatch.setattr(readers, "WAITING", 3 if "no end" in words else 60)
    assert words in readers.outcome(read, tmp_path / "case")
