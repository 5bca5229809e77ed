"""Signals that end a program are not swallowed by a library's bare ``except:``."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from feedsim.cosim import archive, signals
from feedsim.cosim.archive import Archive
from feedsim.cosim.unpacked import STORE

NAMES = [name for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]


class Ended(BaseException):
    """What the handler of this test raises."""


@pytest.fixture(params=NAMES)
def number(request: pytest.FixtureRequest) -> Iterator[int]:
    number: int = getattr(signal, request.param)
    former = signal.getsignal(number)

    def end(*_: object) -> None:
        raise Ended

    signal.signal(number, end)
    yield number
    signal.signal(number, former)


def _swallow(number: int) -> None:
    """As other people's code does by a bare ``except:``."""
    with suppress(BaseException):
        signal.raise_signal(number)


def test_a_signal_arrives_behind_the_block(number: int) -> None:
    _swallow(number)  # so it would be lost
    handler = signal.getsignal(number)
    went_on: list[bool] = []

    def block() -> None:
        with signals.held():
            _swallow(number)
            went_on.append(True)

    with pytest.raises(Ended):
        block()
    assert went_on == [True]
    assert signal.getsignal(number) is handler


def test_what_is_ignored_stays_so(number: int) -> None:
    signal.signal(number, signal.SIG_IGN)
    with signals.held():
        assert signal.getsignal(number) is signal.SIG_IGN
        signal.raise_signal(number)


def test_an_error_in_the_block_puts_the_handler_back(number: int) -> None:
    handler = signal.getsignal(number)
    with pytest.raises(ValueError, match="inside"), signals.held():
        raise ValueError("inside")
    assert signal.getsignal(number) is handler


def test_other_threads_are_left_alone() -> None:
    done: list[bool] = []

    def work() -> None:
        with signals.held():  # signal.signal would raise here
            done.append(True)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert done == [True]


def test_reading_an_archive_swallows_none(number: int, fmus: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    read = archive.read_model_description

    def validating(path: str) -> object:
        _swallow(number)
        return read(path)

    monkeypatch.setattr(STORE, "_contents", {})  # what another test has unpacked, and may still use, is not read again
    monkeypatch.setattr(archive, "read_model_description", validating)
    with pytest.raises(Ended), Archive(fmus / "friction.fmu"):
        pytest.fail("the signal was swallowed")
