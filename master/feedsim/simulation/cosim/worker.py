"""Programs of other makers in a process of their own, and what is said where one does not come back.

A unit of another maker may crash, hang, or end the process. So what executes one is done by a worker process, which
notes in shared memory whose call it is in (mark.py); this process watches, and loses nothing when the worker dies. A
worker serves one call after the other, so that a study starts it once. Where all programs are the shipped ones there is
none. Windows has no such worker: there the call is made in this process.

Such a unit may also write into descriptors, close them, or lower what its process may take. The pipes between the two
have numbers out of reach, and what arrives is checked (channel.py). A result is handed over before the units are ended,
so that one that crashes there takes nothing along.

Start reading at call(); serve() is what the worker does.
"""

from __future__ import annotations

import atexit
import mmap
import os
import pickle
import select
import signal
import struct
import subprocess
import sys
import threading
import time
import traceback
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from feedsim.foundation.errors import FeedsimError, Finding, SimulationError
from feedsim.foundation.outputs import TemporaryFolder, defer_signals

# --- Messages between two processes of which one executes programs of other makers, which may write into the pipe
#     or close
# it: nothing of what arrives is believed before it is known to be whole, and nobody waits for what does not come.


TOKEN = 16  # bytes that nobody else knows
_HEAD = struct.Struct(f"<{TOKEN}sQI")  # token, bytes of the message, their CRC-32
_BLOCK = 1 << 20


class GarbledError(Exception):
    """What has arrived is no message."""


class Sender:
    """The end that messages are sent by; a process that a unit has forked off from its own ends at the first."""

    def __init__(self, descriptor: int, token: bytes) -> None:
        self.descriptor, self._token, self._owner = descriptor, token, os.getpid()

    def send(self, message: Any) -> None:
        """OSError: nobody listens, or another program has closed this end."""
        if os.getpid() != self._owner:
            os._exit(0)
        content = pickle.dumps(message, protocol=pickle.HIGHEST_PROTOCOL)
        for part in (_HEAD.pack(self._token, len(content), zlib.crc32(content)), content):
            remaining = memoryview(part)
            while remaining:
                remaining = remaining[os.write(self.descriptor, remaining) :]


class Receiver:
    """The end that messages arrive at.

    begun: bytes of a message that is not whole yet.
    """

    def __init__(self, descriptor: int, token: bytes) -> None:
        os.set_blocking(descriptor, False)
        self.descriptor, self._token = descriptor, token
        self._received_bytes = bytearray()
        self._poll = select.poll()
        self._poll.register(descriptor, select.POLLIN)

    @property
    def begun(self) -> int:
        return len(self._received_bytes)

    def receive(self, wait: float | None) -> Any:
        """The next message; None where nothing more arrives within `wait` [s], which is for ever where it is None.

        Raises:
            EOFError: nobody can send any more.
            GarbledError: somebody else has written into it.
            OSError: another program has closed this end.
        """
        while (content := self._whole()) is None:
            if not self._poll.poll(None if wait is None else 1000 * wait):
                return None
            if not (block := os.read(self.descriptor, _BLOCK)):
                raise EOFError
            self._received_bytes += block
        return pickle.loads(content)

    def _whole(self) -> bytes | None:
        """Content of the first message, once it is there."""
        head = bytes(self._received_bytes[: _HEAD.size])
        if head[:TOKEN] != self._token[: len(head)]:
            raise GarbledError
        if len(head) < _HEAD.size:
            return None
        _, size, check = _HEAD.unpack(head)
        if len(self._received_bytes) < _HEAD.size + size:
            return None
        content = bytes(memoryview(self._received_bytes)[_HEAD.size : _HEAD.size + size])
        del self._received_bytes[: _HEAD.size + size]
        if zlib.crc32(content) != check:
            raise GarbledError
        return content


# --- What a process is just at, in memory that another process reads: whose call it is, and in which control cycle ----
# A process that executes programs of other makers (worker.py) has a mark; elsewhere there is none, and nothing is
# noted.


SIZE = 4096
_MARK_HEAD = 40  # bytes of the numbers
# in place of an operation: a call that `text` describes; code of our own, which takes its time; a process that cannot
# go on, as `text` says
DESCRIBED_CALL, OWN_CODE, SPOILED = -1, -2, -3


class Mark:
    """A note in a file that two processes have in their memory.

    Attributes:
        numbers: (5,) control cycle, operation in it (or DESCRIBED_CALL, or OWN_CODE), two of the native loop, notes so
            far. The native loop writes the first four itself (exchange_run_marked).
    """

    def __init__(self, path: Path, closed: bool = False) -> None:
        """path: the file, SIZE bytes long; it is made where it is missing. closed: leave no descriptor open by which
        another program could write into it; in a process that does nothing beside."""
        self.path = path
        if not path.exists():
            path.write_bytes(bytes(SIZE))
        with path.open("r+b") as file:
            own = os.dup(file.fileno())
            os.close(own)
            self._memory = mmap.mmap(file.fileno(), SIZE)  # keeps a copy of the descriptor, with the lowest free number
        if closed:
            with Path(os.devnull).open("r+b") as nothing:
                os.dup2(nothing.fileno(), own, inheritable=False)
        self.numbers = np.frombuffer(self._memory, dtype=np.int64, count=5)

    def at(self, text: str, what: int = DESCRIBED_CALL) -> None:
        """Note what comes next."""
        content = text.encode("utf-8", "replace")[: SIZE - _MARK_HEAD - 1]
        self._memory[_MARK_HEAD : _MARK_HEAD + len(content) + 1] = content + b"\0"
        self.numbers[1] = what
        self.numbers[4] += 1

    def back(self) -> None:
        """Note that the call has come back."""
        self.numbers[1] = OWN_CODE
        self.numbers[4] += 1

    @property
    def text(self) -> str:
        """What :meth:`at` has noted last."""
        return bytes(self._memory[_MARK_HEAD:]).partition(b"\0")[0].decode("utf-8", "replace")

    def state(self) -> tuple[int, ...]:
        """The numbers: where they stay as they are, a call has not come back."""
        return tuple(int(number) for number in self.numbers)


class WatchedProcess:
    """The mark of this process, and who needs to know which operations its numbers stand for.

    spent: whether another process is to do what comes next.
    """

    def __init__(self) -> None:
        self.mark: Mark | None = None
        self.spent = False
        self.process = os.getpid()

    def describe(self, T_c: float, operations: Sequence[tuple[str, str, float]]) -> None:
        """Say what the operations of a cycle are: unit, what it is at, when in the cycle [s]."""

    def deliver(self, result: Any) -> None:
        """Hand over what was asked for, ahead of the units' last calls, in which one may end the process."""


_watched_process: WatchedProcess | None = None


def watched_process() -> WatchedProcess | None:
    """Of this process; None: nobody watches."""
    return _watched_process


def watch(here: WatchedProcess | None) -> None:
    """Have this process watched."""
    global _watched_process
    _watched_process = here


def deliver(result: Any) -> None:
    """Hand over a result with `notes` or `warnings` to a process that watches, where there is one."""
    if _watched_process is not None:
        _watched_process.deliver(result)


@contextmanager
def mark_call(text: str) -> Iterator[None]:
    """A block that calls another program; `text` says which and for what, where somebody watches."""
    mark = None if _watched_process is None else _watched_process.mark
    if mark is None:
        yield
        return
    mark.at(text)
    try:
        yield
    finally:
        mark.back()


# --- Programs of other makers in a process of their own, and what is said where one does not come back ----------------


T = TypeVar("T")

WORKERS_AVAILABLE = os.name == "posix"
WORKER_POLL_INTERVAL = 0.05  # s between two looks at a worker that says nothing
TOLD_EVERY = 0.1  # s between two reports of progress
MAX_DESCRIPTOR = 1 << 16
WORKER_END_TIME = 5.0  # s for a worker to end that is asked to
_SERVE = "import sys; from feedsim.simulation.cosim.worker import serve; serve(*sys.argv[1:])"
_thread_worker = threading.local()  # a worker for each thread that needs one
_workers: list[_Worker] = []


def call(
    function: Callable[..., T],
    *given: Any,
    limit: float,
    sink: Callable[[Any], None] | None = None,
    progress: Callable[[int, int], None] | None = None,
    **named: Any,
) -> T:
    """What ``function(*given, sink=..., progress=..., **named)`` returns, executed by the worker of this thread.

    Args:
        function: of a module; it and what it is given are sent to the worker.
        limit: how long a single call of a unit may take [s].
        sink, progress: called here with what the function calls its own with; left out where they are None.

    Raises:
        SimulationError: the worker has ended, or a call takes longer than `limit`: which unit, in what, when.
        FeedsimError: what the function raises.
    """
    if watched_process() is not None or not WORKERS_AVAILABLE:  # already there; or it cannot be helped
        more = {name: one for name, one in (("sink", sink), ("progress", progress)) if one is not None}
        return function(*given, **more, **named)
    worker: _Worker | None = getattr(_thread_worker, "worker", None)
    if worker is None or not worker.alive:
        worker = _thread_worker.worker = _Worker()
    answer: T = worker.call(function, given, named, limit, sink, progress)
    return answer


class _Worker:
    """A worker, seen from the process that watches it."""

    def __init__(self) -> None:
        self._folder = TemporaryFolder()
        self._mark = Mark(self._folder.path / "mark")
        token = os.urandom(TOKEN)
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path or str(Path.cwd()) for path in sys.path)}
        environment |= dict.fromkeys(("TMPDIR", "TMP", "TEMP"), str(self._folder.path))  # what it leaves goes
        self._owner = os.getpid()
        with defer_signals():  # a worker that runs is known
            their_end, ours = os.pipe()
            our_end, theirs = os.pipe()
            words = [sys.executable, "-c", _SERVE, str(their_end), str(theirs), str(self._mark.path), token.hex()]
            # In a session of its own: a Ctrl-C is for us, and we end it.
            self._process = subprocess.Popen(
                words, env=environment, stdin=subprocess.DEVNULL, pass_fds=(their_end, theirs), start_new_session=True
            )
            os.close(their_end)
            os.close(theirs)
            self._sender, self._receiver = Sender(ours, token), Receiver(our_end, token)
            self._ended = False
            _workers.append(self)

    @property
    def alive(self) -> bool:
        """Whether it can be asked for something more."""
        return self._owner == os.getpid() and not self._ended and self._process.poll() is None

    def call(
        self, function: Callable[..., Any], given: Sequence[Any], named: Mapping[str, Any], limit: float,
        sink: Callable[[Any], None] | None, progress: Callable[[int, int], None] | None,
    ) -> Any:  # fmt: skip
        """As :func:`call`."""
        surroundings = (Path.cwd(), {name: value for name, value in os.environ.items() if name.startswith("FEEDSIM")})
        self._mark.at("the worker: starting", OWN_CODE)
        try:
            with suppress(BrokenPipeError):  # it has ended since: the answer shows how
                self._sender.send((surroundings, function, given, dict(named), sink is not None, progress is not None))
            return self._watch(limit, sink, progress)
        except FeedsimError:
            raise
        except OSError as error:
            self.end()
            raise SimulationError(f"the worker process of other makers' units cannot be asked: {error}") from error
        except BaseException:  # interrupted: the call may never come back
            self.end()
            raise

    def _watch(self, limit: float, sink: Callable[[Any], None] | None, progress: Any) -> Any:
        """What the call returns. A worker that ends after it has handed that over leaves a note in it."""
        operations: tuple[float, Sequence[tuple[str, str, float]]] = (0.0, ())
        state, since = self._mark.state(), time.monotonic()
        result: Any = None
        while True:
            try:
                message = self._receiver.receive(WORKER_POLL_INTERVAL)
                if message is None and self._process.poll() is not None and self._receiver.receive(0.0) is None:
                    raise EOFError
            except (EOFError, OSError, GarbledError) as error:
                return self._lost(result, self._describe_end(operations, garbled=isinstance(error, GarbledError)))
            if message is not None:
                kind, content = message
                if kind in ("end", "error"):
                    content, spent = content
                    if spent:
                        self.end()
                    if kind == "error":
                        raise content
                    return result if content is None else replace(result, **{_notes(result): content})
                if kind == "result":
                    result = content
                elif kind == "operations":
                    operations = content
                elif kind == "rows" and sink is not None:
                    sink(content)
                elif kind == "progress" and progress is not None:
                    progress(*content)
            now = (*self._mark.state(), self._receiver.begun)
            if now != state or message is not None:
                state, since = now, time.monotonic()
            elif (state[1] != OWN_CODE or self._receiver.begun) and time.monotonic() - since > limit:
                return self._lost(
                    result,
                    f"{self._describe_place(operations)} does not come back within {limit:g} s; it has been ended. "
                    "coupling.call_limit allows a longer call",
                )

    def _lost(self, result: Any, how: str) -> Any:
        """Of a worker that serves no more: the result, if it has one, with a note; else raise."""
        self.end()
        if result is None:
            raise SimulationError(how)
        said = Finding("unit-ended-late", "doubt", f"{how}; that was behind the last step, the result is whole")
        return replace(result, **{_notes(result): (*getattr(result, _notes(result)), said)})

    def _describe_end(self, operations: tuple[float, Sequence[tuple[str, str, float]]], garbled: bool) -> str:
        """Who, in what, when, and how the worker has ended, or is to end."""
        fault = (
            "; the fault is in that unit's own program: its maker needs this message, and a debugger shows where it "
            "stops"
        )
        if garbled:
            return f"{self._describe_place(operations)} has written into descriptors that are not its own{fault}"
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(WORKER_END_TIME)
        code, where = self._process.poll(), self._describe_place(operations)
        if self._mark.state()[1] == SPOILED:
            return f"{self._mark.text}{fault}"
        if code is None:
            return f"{where} has closed descriptors that are not its own{fault}"
        if code < 0:
            name = (
                signal.Signals(-code).name
                if -code in {int(signals) for signals in signal.Signals}
                else f"signal {-code}"
            )
            return f"{where} was ended by {name} ({signal.strsignal(-code) or 'unknown'}){fault}"
        return f"{where} ended the process by itself, with exit status {code}{fault}"

    def _describe_place(self, operations: tuple[float, Sequence[tuple[str, str, float]]]) -> str:
        """Which unit, in what, when; what a sentence begins with."""
        cycle, operation, *_ = self._mark.state()
        T_c, known = operations
        if operation == OWN_CODE:
            return f'the worker process, behind "{self._mark.text}",'
        if operation == DESCRIBED_CALL or not 0 <= operation < len(known):
            return self._mark.text
        unit, about, within = known[operation]
        return f"unit {unit}, t = {cycle * T_c + within:.9g} s: {about}"

    def end(self) -> None:
        """End it, and remove what it leaves behind."""
        if self._owner != os.getpid() or self._ended:
            return
        self._ended = True
        with suppress(OSError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        for end in (self._sender, self._receiver):
            os.close(end.descriptor)
        self._folder.close()
        with suppress(ValueError):
            _workers.remove(self)


def _notes(result: Any) -> str:
    """Where a result has what there is to say of it."""
    return "notes" if hasattr(result, "notes") else "warnings"


@atexit.register
def _end_all() -> None:
    for worker in [*_workers]:
        worker.end()


# --- in the worker


class _ServingProcess(WatchedProcess):
    def __init__(self, mark: Mark, answers: Sender) -> None:
        super().__init__()
        self.mark = mark
        self._answers = answers
        self._report_time = 0.0
        self.delivered = False

    def describe(self, T_c: float, operations: Sequence[tuple[str, str, float]]) -> None:
        self._answers.send(("operations", (T_c, list(operations))))

    def deliver(self, result: Any) -> None:
        self._answers.send(("result", result))
        self.delivered = True

    def rows(self, part: Any) -> None:
        self._answers.send(("rows", part))

    def progress(self, done: int, total: int) -> None:
        if done == total or time.monotonic() - self._report_time > TOLD_EVERY:
            self._report_time = time.monotonic()
            self._answers.send(("progress", (done, total)))


def serve(asked: str, answers: str, mark: str, token: str) -> None:
    """What a worker does: one call after the other, until nobody asks any more."""
    import resource

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    questions = Receiver(_out_of_reach(int(asked)), bytes.fromhex(token))
    replies = Sender(_out_of_reach(int(answers)), bytes.fromhex(token))
    noted = Mark(Path(mark), closed=True)
    here = _ServingProcess(noted, replies)
    limits = {name: resource.getrlimit(getattr(resource, name)) for name in _LIMITS if hasattr(resource, name)}

    def lowered() -> list[str]:
        return [name for name in limits if resource.getrlimit(getattr(resource, name)) != limits[name]]

    watch(here)
    waiting: list[Any] = []
    arrived = threading.Semaphore(0)

    def receive() -> None:
        """Beside the calls: when the process that asks has gone, nobody is left who could end a call that hangs."""
        while True:
            try:
                waiting.append(questions.receive(None))
            except (EOFError, OSError, GarbledError, MemoryError):
                os._exit(0)
            arrived.release()

    threading.Thread(target=receive, daemon=True).start()
    while True:
        arrived.acquire()
        (folder, environment), function, given, named, rows, progress = waiting.pop(0)
        os.chdir(folder)
        os.environ.update(environment)
        more: dict[str, Any] = {"sink": here.rows} if rows else {}
        more |= {"progress": here.progress} if progress else {}
        here.delivered = False
        try:
            answer: tuple[str, Any]
            try:
                result = function(*given, **named, **more)
                answer = ("end", getattr(result, _notes(result)) if here.delivered else None)
                if not here.delivered:
                    here.deliver(result)
            except FeedsimError as error:
                answer = ("error", error)
            except (MemoryError, OSError):
                raise
            except Exception:
                answer = ("error", RuntimeError(f"in the worker:\n{traceback.format_exc()}"))
            kind, content = answer
            replies.send((kind, (content, here.spent or bool(lowered()))))
        except (MemoryError, OSError) as error:  # what a unit has taken, or closed, is not there to say it with
            why = f"{', '.join(lowered())} of it was lowered" if lowered() else f"{error or type(error).__name__}"
            noted.at(f"the process of other makers' units lacks memory or descriptors: {why}", SPOILED)
            os._exit(1)


_LIMITS = ("RLIMIT_AS", "RLIMIT_DATA", "RLIMIT_STACK", "RLIMIT_NOFILE", "RLIMIT_FSIZE", "RLIMIT_NPROC", "RLIMIT_CPU")


def _out_of_reach(descriptor: int) -> int:
    """The same with a number so high that programs that close or use all that they can think of do not come to it."""
    import fcntl
    import resource

    most, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    least = min(most if most > 0 else MAX_DESCRIPTOR, MAX_DESCRIPTOR) - 64
    high = fcntl.fcntl(descriptor, fcntl.F_DUPFD_CLOEXEC, max(least, 3))
    os.close(descriptor)
    return high
