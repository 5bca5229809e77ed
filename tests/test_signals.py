"""Signals that end a program are not lost, wherever they arrive, and leave what has to come to its end alone."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from feedsim.foundation import outputs
from feedsim.simulation.cosim import archive
from feedsim.simulation.cosim.archive import Archive
from feedsim.simulation.cosim.unpacked import STORE

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
        with outputs.defer_signals():
            _swallow(number)
            went_on.append(True)

    with pytest.raises(Ended):
        block()
    assert went_on == [True]
    assert signal.getsignal(number) is handler


def test_what_is_ignored_stays_so(number: int) -> None:
    signal.signal(number, signal.SIG_IGN)
    with outputs.defer_signals():
        assert signal.getsignal(number) is signal.SIG_IGN
        signal.raise_signal(number)


def test_an_error_in_the_block_puts_the_handler_back(number: int) -> None:
    handler = signal.getsignal(number)
    with pytest.raises(ValueError, match="inside"), outputs.defer_signals():
        raise ValueError("inside")
    assert signal.getsignal(number) is handler


def test_other_threads_are_left_alone() -> None:
    done: list[bool] = []

    def work() -> None:
        with outputs.defer_signals():  # signal.signal would raise here
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


# Where an exception of a handler vanishes.
PLACES = {
    "nowhere": "strike()",
    "a callback from C": "ctypes.CFUNCTYPE(None)(strike)()",
    "a weak reference": "it = It(); kept = weakref.ref(it, strike); del it",
    "a destructor": "It.__del__ = strike; It()",
    "a bare except": "try: strike()\n        except: pass",
    "two of them": "ctypes.CFUNCTYPE(None)(strike)(); weakref.finalize(It(), strike)",
    "a library that makes another error of it": """
        try: strike()
        except BaseException: raise ImportError("broken") from None
    """,
    "a generator that nobody asks any more": "[it for it, _ in zip('ab', asked())]",
}
PROGRAM = """
import atexit, ctypes, signal, sys, time, weakref
from feedsim.foundation.outputs import end_program

class It:
    pass

def strike(*_):
    signal.raise_signal({number})

def asked():
    try:
        yield from range(9)
    finally:
        strike()

def program():
    try:
        {place}
        time.sleep(120)
    finally:
        {again}
        print("unwound", flush=True)

def at_the_end():
    strike()
    print("left", flush=True)

{before}
end_program(program)
atexit.register(at_the_end)
program()
"""


def ended(place: str, number: int, again: str = "pass", before: str = "") -> subprocess.CompletedProcess[str]:
    code = PROGRAM.format(place=place, number=number, again=again, before=before)
    environment = {**os.environ, "PYTHONPATH": str(Path(outputs.__file__).parents[1])}
    return subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=100)


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("place", PLACES)
def test_a_signal_ends_the_program_wherever_it_arrives(place: str, name: str) -> None:
    """And only once, though it comes again while the program is on its way out, and at the very end."""
    number = getattr(signal, name)
    done = ended(PLACES[place], number, again="strike()")
    assert (done.returncode, done.stdout, done.stderr) == (128 + number, "unwound\nleft\n", "")


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_an_import_comes_to_its_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of one that is broken off libraries say that it has failed, and go on."""
    (tmp_path / "imported.py").write_text(
        "import __main__, time\n__main__.strike()\ntime.sleep(0.1)\nprint('imported')\n"
    )
    done = ended(f"sys.path.insert(0, {str(tmp_path)!r}); import imported", signal.SIGTERM)
    assert (done.returncode, done.stdout, done.stderr) == (143, "imported\nunwound\nleft\n", "")


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_one_at_the_end_lets_that_come_to_its_end() -> None:
    done = ended("return", signal.SIGTERM)
    assert (done.returncode, done.stdout, done.stderr) == (143, "unwound\nleft\n", "")


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="Windows")
def test_nohup_is_obeyed() -> None:
    done = ended("strike(); return", signal.SIGHUP, before="signal.signal(signal.SIGHUP, signal.SIG_IGN)")
    assert (done.returncode, done.stdout, done.stderr) == (0, "unwound\nleft\n", "")
