"""What a command writes: files that are whole or not written, folders that one process owns, answers for the next one.

May use: errors and installation. Four parts, a heading each: signals, what belongs to a process, what may be written
(check_file()), answers kept on disk (cache_answer()).
"""

from __future__ import annotations

import _thread
import atexit
import errno
import hashlib
import json
import os
import platform
import re
import secrets
import shlex
import shutil
import signal
import stat
import sys
import tempfile
import threading
import time
import weakref
import zipfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from contextvars import ContextVar
from functools import lru_cache
from pathlib import Path
from types import FrameType, TracebackType
from typing import Any, Self

from feedsim.foundation.errors import OutputError
from feedsim.foundation.installation import version

# --- Signals that end a program: none is lost, and none stops what has to come to its end -----------------------------
# May use: nothing. Start reading at end_program(); defer_signals() is for a few steps that belong together.
#
# A handler of Python raises wherever the main thread is at work. In a callback from C, in that of a weak reference, in
# ``__del__`` and in a library with a bare ``except:`` the exception vanishes. An exception that is on its way lives; so
# one that is dead while the program is still at work has vanished, and the signal is sent once more. While a module is
# imported none is raised: there libraries make another exception of it, "import failed".


END_SIGNALS = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)  # Windows
EXCEPTION_POLL_INTERVAL = 0.02  # s between two looks at whether an exception lives


class EndRequest(KeyboardInterrupt, SystemExit):
    """A signal asks the program to end; whoever lets an interrupt or an exit pass lets this one pass."""


def end_program(program: Callable[[], object]) -> None:
    """Let signals unwind the stack of `program`, which is called next, and end the process with 128 + their number.

    The first one raises Ended, behind an import. Further ones find the program on its way out and do not disturb that.
    Behind `program` nothing is raised: what is registered with atexit comes to its end first. A signal that is ignored
    stays so (nohup).
    """
    arrived: list[int] = []
    raised: list[weakref.ref[EndRequest]] = []
    dead: list[weakref.ref[EndRequest]] = []
    main, shown, hook = threading.main_thread().ident or 0, sys.unraisablehook, sys.excepthook

    def end(number: int, frame: FrameType | None) -> None:
        arrived.append(number)
        if len(arrived) == 1:  # a plain thread: those of threading wait for locks that this one may have
            with suppress(RuntimeError):
                _thread.start_new_thread(watch, ())
        while frame is not None and frame.f_code is not program.__code__:
            if frame.f_code.co_filename.startswith("<frozen importlib"):
                return
            frame = frame.f_back
        if frame is None or len(dead) < len(raised):
            return
        ended = EndRequest(128 + arrived[0])
        raised.append(weakref.ref(ended, dead.append))
        try:
            raise ended
        finally:
            del ended  # its traceback would keep it alive by this frame

    def watch() -> None:
        while True:
            time.sleep(EXCEPTION_POLL_INTERVAL)
            if len(dead) < len(raised):
                continue
            if hasattr(signal, "pthread_kill"):
                signal.pthread_kill(main, arrived[0])  # ends what it waits for, too
            else:
                _thread.interrupt_main(signal.Signals(arrived[0]))

    def show(unraisable: Any) -> None:
        if unraisable.exc_type is not EndRequest:
            shown(unraisable)

    def tell(*error: Any) -> None:
        if not arrived:  # else it is most likely what a library has made of Ended
            hook(*error)

    def leave() -> None:
        if arrived:
            for stream in (sys.stdout, sys.stderr):
                with suppress(Exception):
                    stream.flush()
            os._exit(128 + arrived[0])
        for number in taken:  # nothing is left to be done
            signal.signal(number, signal.SIG_DFL)

    taken = [number for number in END_SIGNALS if signal.getsignal(number) not in (signal.SIG_IGN, None)]
    sys.unraisablehook, sys.excepthook = show, tell
    atexit.register(leave)  # the first, so that it is called last
    for number in taken:
        signal.signal(number, end)


@contextmanager
def defer_signals() -> Iterator[None]:
    """Let interrupts and requests to end arrive behind the block, not in it.

    For short blocks: steps of which all are done or none, and calls of what would swallow the exception of a handler.
    In other threads than the main one nothing is to be held: handlers run in the main thread.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    arrived: list[int] = []
    with ExitStack() as last:
        last.callback(lambda: [*map(signal.raise_signal, arrived)])
        # What is ignored stays so; None is a handler that was not set from Python and could not be put back.
        for number in END_SIGNALS:
            if (handler := signal.getsignal(number)) not in (signal.SIG_IGN, None):
                last.callback(signal.signal, number, handler)
                signal.signal(number, lambda number, _: arrived.append(number))
        yield


# --- What belongs to one process as long as it lives: folders of results and of temporary files, a file that grows ----
# Start reading at claim_folder(). A lock of the system on an open file shows whether its owner lives: it goes with the
# process, whatever has ended that. So nothing that a killed process leaves makes others wait, and the next start
# removes it.


PREFIX = "feedsim-"  # of folders for temporary files
_NAME_LETTERS, _LENGTH = "abcdefghijklmnopqrstuvwxyz0123456789_", 8  # of their names behind it, as tempfile has them
_OWNED_NAME = re.compile(rf"{PREFIX}[{_NAME_LETTERS}]{{{_LENGTH}}}")
LOCK = ".feedsim.lock"  # in a folder that belongs to a process
WRITE_GRACE_TIME = 2.0  # s for which processes that are just being ended may still write into a folder that is removed
LOCK_GRACE_TIME = 60.0  # s within which a folder without a lock may be one that is just being made
_LOCKED_ERRORS = (errno.EACCES, errno.EAGAIN, errno.EDEADLK)  # what a lock that another has is known by
_LOCK_OFFSET = 1 << 30  # where Windows locks: there a locked byte cannot be read
_LOCK_POLL_INTERVAL = 0.02  # s between two looks at a lock that is waited for
_RETRY_INTERVAL = 1e-4  # s between two attempts at what others may remove at the same moment
_RETRY_TIME = 5.0  # s for which they may
_folders: dict[tuple[int, str], TemporaryFolder] = {}  # by process and where the system keeps what is temporary
# What blocks have: locks and folders that were made, by path of the lock, thread and process.
_claims: dict[tuple[str, int, int], tuple[list[_Lock], list[Path]]] = {}


@contextmanager
def claim_folder(directory: Path, lock: str = LOCK, wait: float = 0.0) -> Iterator[None]:
    """Have a folder alone, among all processes and threads that claim it; it is made where it is missing.

    What is made is removed with the block if nothing is in it then. Blocks of one thread may stand in one another.

    Args:
        lock: name of the file that shows it.
        wait: for others to end [s].

    Raises:
        OutputError: another has it, with who that is; or the folder cannot be written to.
    """
    key = os.path.realpath(directory / lock), threading.get_ident(), os.getpid()
    if key in _claims:
        yield
        return
    made = []
    for path in (directory.absolute(), *directory.absolute().parents):
        try:  # one look: what another makes or removes in between is either there or not
            mode = path.stat().st_mode
        except OSError:
            made.append(path)
            continue
        if not stat.S_ISDIR(mode):
            raise OutputError(f"{directory}: cannot be written, {path} is a file; allowed: a directory")
        break
    _claims[key] = [], made
    try:
        _take_locks(directory, lock, time.monotonic() + wait, _claims[key][0])
        yield
    finally:
        _give_back(key)


def _give_back(key: tuple[str, int, int]) -> None:
    with defer_signals():
        locks, made = _claims[key]
        while locks:
            locks.pop().release()
        for path in made:
            with suppress(OSError):  # not empty, as a rule
                path.rmdir()
        del _claims[key]


@atexit.register
def _give_all_back() -> None:
    """A signal may have ended a block ahead of its end."""
    for key in [key for key in _claims if key[2] == os.getpid()]:
        _give_back(key)


def _take_locks(directory: Path, name: str, until: float, locks: list[_Lock]) -> None:
    """Add the locks that make a folder ours. OutputError."""
    began = time.monotonic()
    while True:
        try:
            directory.mkdir(parents=True, exist_ok=True)
            with defer_signals():
                locks.append(lock := _Lock(directory / name))
        except OSError as error:
            between = isinstance(error, (FileNotFoundError, FileExistsError))  # made or removed by another just now
            if between and not directory.is_symlink() and time.monotonic() < began + _RETRY_TIME:
                time.sleep(_RETRY_INTERVAL)  # not in step with the other
                continue
            raise OutputError(f"{directory}: cannot be written: {error.strerror or error}") from error
        if lock.state is None:  # a file system without locks; that of temporary files has some, for this machine alone
            holder = lock.content()
            if holder and f" on {platform.node()} since " not in holder:
                locks.pop().close()
                raise OutputError(
                    f"{directory}: another process writes its results there, as {lock.path} says: {holder}. If it is "
                    "not at work any more, remove that file; or take another directory"
                )
            unique = hashlib.sha256(os.path.realpath(lock.path).encode("utf-8", "surrogateescape")).hexdigest()[:32]
            with suppress(OSError), defer_signals():
                locks.append(_Lock(Path(tempfile.gettempdir()) / f"{PREFIX}{unique}.lock"))
        if all(lock.state is not False for lock in locks):
            lock.tell(_describe_process())
            return
        holder = lock.content()
        while locks:
            locks.pop().close()
        if time.monotonic() >= until:
            who = f": {holder}" if holder else ""
            raise OutputError(
                f"{directory}: another process writes its results there{who}; wait until it has ended, or take another "
                "directory"
            )
        time.sleep(_LOCK_POLL_INTERVAL)


def _describe_process() -> str:
    """This process, for those that meet its lock."""
    words = shlex.join([Path(sys.argv[0]).name, *sys.argv[1:]]) if sys.argv else "python"
    shown = "".join(c if c.isprintable() else "?" for c in words)
    since = time.strftime("%Y-%m-%d %H:%M:%S")
    return f"process {os.getpid()} on {platform.node()} since {since}: {shown[:300]}"


class _Lock:
    """A file that is locked as long as it is open.

    state: True; False: another has it; None: its file system has no locks.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        while True:
            try:
                self._file = os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o666)
            except PermissionError:  # another user's, who had the folder before
                if not path.is_file():
                    raise
                self._file = os.open(path, os.O_RDONLY)
            self.state = lock_file(self._file)
            if self.state is not True or _has_name(path, self._file):
                return
            os.close(self._file)  # removed by who had it, between our opening and our locking it

    def tell(self, text: str) -> None:
        """Write into it for others."""
        with suppress(OSError):
            os.ftruncate(self._file, 0)
            os.lseek(self._file, 0, os.SEEK_SET)
            os.write(self._file, text.encode("utf-8", "replace"))

    def content(self) -> str:
        """What its owner has written into it."""
        with suppress(OSError):
            os.lseek(self._file, 0, os.SEEK_SET)
            return os.read(self._file, 4096).decode("utf-8", "replace")
        return ""

    def close(self) -> None:
        """Give it back, and leave the file."""
        with suppress(OSError):
            os.close(self._file)

    def release(self) -> None:
        """Remove the file and give it back; ahead of that where the system can, so that none is removed of another."""
        with suppress(OSError):
            if os.name != "nt" and _has_name(self.path, self._file):
                self.path.unlink()
        self.close()
        if os.name == "nt":
            with suppress(OSError):  # another has opened it meanwhile
                self.path.unlink()


def lock_file(file: int) -> bool | None:
    """Lock an open file for this process; False: another has; None: its file system has no locks."""
    try:
        try:
            import fcntl
        except ImportError:  # Windows
            import msvcrt

            os.lseek(file, _LOCK_OFFSET, os.SEEK_SET)
            msvcrt.locking(file, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined,unused-ignore]
        else:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        return False if error.errno in _LOCKED_ERRORS else None
    return True


def _has_name(path: Path, file: int) -> bool:
    """Whether an open file is the one that has this name now."""
    try:
        return os.path.samestat(path.stat(), os.fstat(file))
    except OSError:
        return False


class BlockResource:
    """What is closed at the end of the block that it is opened for."""

    def close(self) -> None:
        raise NotImplementedError

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class TemporaryFolder:
    """A folder for temporary files, removed when it is closed, or at the latest with the process.

    Attributes:
        path: where it is.
    """

    def __init__(self, within: Path | None = None, *, lock: bool = False, prefix: str = PREFIX) -> None:
        """
        Args:
            within: where it is made; None: in the folder that this process has where the system keeps what is
                temporary.
            lock: whether it shows others that its process lives; what is in such a folder needs no lock of its own.
            prefix: of its name.

        OutputError: nothing can be written there.
        """
        try:
            while not self._make(within or _folder_of_process(), lock, prefix):
                pass
        except OSError as error:
            where = f"{within}: a folder" if within and not lock else "a folder for temporary files (TMPDIR)"
            raise OutputError(f"{where} cannot be made: {error.strerror or error}") from error

    def _make(self, parent: Path, lock: bool, prefix: str) -> bool:
        """Make it. False: another process has the name, or has taken it, while it was empty, for one that is left."""
        self.path = parent / (prefix + "".join(secrets.choice(_NAME_LETTERS) for _ in range(_LENGTH)))
        files: list[int] = []
        # Ahead of the folder: a signal may end the program between any two steps, and nobody may close it.
        self._end = weakref.finalize(self, _remove, self.path, files, os.getpid())
        try:
            self.path.mkdir(0o700)
            if lock:
                files.append(os.open(self.path / LOCK, os.O_RDWR | os.O_CREAT, 0o600))
            if not lock or (lock_file(files[0]) is not False and _has_name(self.path / LOCK, files[0])):
                return True
        except (FileExistsError, FileNotFoundError):
            if not parent.is_dir():
                raise
        self._end.detach()
        for file in files:
            os.close(file)
        return False

    def close(self) -> None:
        """Remove it with all that is in it."""
        if (known := self._end.peek()) is not None:
            _remove(*known[2])  # not by calling it, which forgets the folder first: a signal may end this half-way
            self._end.detach()

    def __enter__(self) -> Path:
        return self.path

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()


def _folder_of_process() -> Path:
    """The folder that has all others of this process, so that it leaves one if it is killed.

    It is made when it is needed; then what killed processes have left is removed, too.
    """
    key = os.getpid(), tempfile.gettempdir()
    if (known := _folders.get(key)) is None or not known.path.is_dir():  # cleaners take what has been idle for long
        _folders.pop(key, None)
        remove_orphans()
        known = _folders.setdefault(key, TemporaryFolder(Path(key[1]), lock=True))
        # Workers that multiprocessing forks end without what atexit and weakref were given.
        processes = sys.modules.get("multiprocessing.process")
        if processes is not None and processes.parent_process() is not None:
            from multiprocessing.util import Finalize

            Finalize(None, known.close, exitpriority=-100)  # the last, like multiprocessing's own folders
    return known.path


def _remove(folder: Path, files: list[int], owner: int) -> None:
    """Remove a folder and close its lock. A process that was forked off leaves its parent's folders alone."""
    if os.getpid() != owner:
        return
    with defer_signals():  # also where an exception of a handler would vanish, and the folder stay
        until = time.monotonic() + WRITE_GRACE_TIME
        while not _empty_folder(folder) and time.monotonic() < until:
            time.sleep(_LOCK_POLL_INTERVAL)
        while files:  # ahead of the rest: Windows does not remove what is open
            os.close(files.pop())
        shutil.rmtree(folder, ignore_errors=True)


def _empty_folder(folder: Path) -> bool:
    """Remove what is in a folder, but for what shows whose it is: a folder that is half removed still has an owner."""
    remaining = [path for path in folder.iterdir() if path.name != LOCK] if folder.is_dir() else []
    for path in remaining:
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path, ignore_errors=True)
        else:
            with suppress(OSError):
                path.unlink()
    return not any(os.path.lexists(path) for path in remaining)


def remove_orphans() -> None:
    """Remove this user's folders for temporary files whose process has gone."""
    folders: list[Path] = []
    with suppress(OSError):
        folders += Path(tempfile.gettempdir()).glob(f"{PREFIX}*")
    for folder in folders:
        with suppress(OSError):
            result = folder.lstat()
            if (
                _OWNED_NAME.fullmatch(folder.name)
                and stat.S_ISDIR(result.st_mode)
                and (not hasattr(os, "geteuid") or result.st_uid == os.geteuid())
            ):
                _remove_orphan(folder, time.time() - result.st_mtime)


def _remove_orphan(folder: Path, age: float) -> None:
    """Remove a folder whose lock is free, or which has none and is empty, `age` [s] after its last change. OSError."""
    try:
        file = os.open(folder / LOCK, os.O_RDWR)
    except FileNotFoundError:
        if age > LOCK_GRACE_TIME:
            folder.rmdir()
        return
    try:
        gone = lock_file(file) is True and _empty_folder(folder)
    finally:
        os.close(file)
    if gone:
        shutil.rmtree(folder, ignore_errors=True)


# --- What a command may write: inputs are never outputs, and what feedsim did not write itself stays unless forced ----
# Start reading at check_file(); folders of results ask the same questions (report/results.py).


HEAD_BYTES = 4096  # bytes of a file that are read to see what it is
_REPLACEMENT_ALLOWED = ContextVar("forced", default=False)


@contextmanager
def allow_replacement(allowed: bool = True) -> Iterator[None]:
    """A block in which files may be replaced that feedsim did not write: what --force asks for. Inputs never are."""
    before = _REPLACEMENT_ALLOWED.set(allowed)
    try:
        yield
    finally:
        _REPLACEMENT_ALLOWED.reset(before)


def is_replacement_allowed() -> bool:
    """Whether files of others may be replaced."""
    return _REPLACEMENT_ALLOWED.get()


def is_same_file(one: Path, other: Path) -> bool:
    """Whether both are one file, by whatever names, links included."""
    try:
        return one.samefile(other)
    except OSError:
        return os.path.realpath(one) == os.path.realpath(other)


def check_file(
    path: Path, inputs: Iterable[Path] = (), *, ours: Callable[[Path], bool] = lambda path: False, what: str = "file"
) -> None:
    """Refuse to write ``path`` where that would lose a file of the user.

    Args:
        inputs: files and folders that the command reads; none of them is written, by --force neither.
        ours: whether the file that is there now is one that the command wrote.
        what: the command writes, for the message.

    Raises:
        OutputError: `path` is an input or a folder, or a file is there that feedsim did not write.
    """
    if any(is_same_file(path, given) for given in inputs):
        raise OutputError(f"{path}: is an input and would be replaced; take another name")
    if path.is_dir():
        raise OutputError(f"{path}: is a directory; the name of a file is needed")
    if path.is_file() and not is_replacement_allowed() and not ours(path):
        raise OutputError(
            f"{path}: exists already, and is no {what} that feedsim wrote; take another name, or replace it with "
            "--force"
        )


def begins_with(*marks: bytes) -> Callable[[Path], bool]:
    """What shows files that hold one of the marks near their beginning."""

    def one(path: Path) -> bool:
        try:
            with path.open("rb") as file:
                head = file.read(HEAD_BYTES)
        except OSError:
            return False
        return any(mark in head for mark in marks)

    return one


def archive_with(member: str, mark: bytes) -> Callable[[Path], bool]:
    """What shows archives whose `member` holds the mark."""

    def one(path: Path) -> bool:
        try:
            with zipfile.ZipFile(path) as opened, opened.open(member) as file:
                return mark in file.read(64 * HEAD_BYTES)
        except (OSError, KeyError, zipfile.BadZipFile, NotImplementedError, RuntimeError, ValueError):
            return False

    return one


def content_check(content: bytes) -> Callable[[Path], bool]:
    """What shows a file that holds these bytes already: writing them again loses nothing."""

    def one(path: Path) -> bool:
        try:
            return path.stat().st_size == len(content) and path.read_bytes() == content
        except OSError:
            return False

    return one


# --- Answers that are dear to find and short to write, kept on disk from one process to the next ----------------------
# An answer belongs to all that it follows from: the bytes of the user's files, the arguments, and the code that finds
# it. Where one of these changes it is found anew, so that a kept answer is the very one that would be found. What
# cannot be read or written is found as if nothing had been kept. Start reading at cache_answer().


CACHE_VARIABLE = "FEEDSIM_CACHE"  # environment variable: the folder; empty: nothing is kept
MAX_ANSWERS = 256  # answers of one kind; the oldest go first
MAX_ANSWER_BYTES = 1 << 20  # bytes of an answer; a larger file is none of ours
LIBRARIES = ("numpy", "scipy", "jinja2")


def cache_answer(kind: str, follows_from: Sequence[Any], code: Sequence[Path], find: Callable[[], Any]) -> Any:
    """What `find` returns, numbers and texts as JSON has them; kept from an earlier process where nothing has changed.

    kind: letters, the beginning of the file's name. follows_from: what the answer depends on, as JSON has it. code:
    folders with the code that finds it.
    """
    place = cache_folder()
    if place is None:
        return find()
    asked = json.dumps([kind, _versions(tuple(code)), *follows_from], sort_keys=True)
    file = place / f"{kind}-{hashlib.sha256(asked.encode()).hexdigest()[:40]}.json"
    with suppress(OSError, ValueError, KeyError, TypeError, RecursionError):
        if file.stat().st_size <= MAX_ANSWER_BYTES:
            kept = json.loads(file.read_text(encoding="utf-8"))
            if kept["asked"] == asked:
                return kept["answer"]
    answer = find()
    with suppress(OSError):
        _store_answer(file, kind, json.dumps({"asked": asked, "answer": answer}))
    return answer


def cache_folder() -> Path | None:
    """Where answers are kept; None: nowhere."""
    if (given := os.environ.get(CACHE_VARIABLE)) is not None:
        return Path(given) if given else None
    if sys.platform == "win32":
        home = Path(os.environ.get("LOCALAPPDATA", ""))
    else:
        home = Path(os.environ.get("XDG_CACHE_HOME") or Path(os.environ.get("HOME", "")) / ".cache")
    return home / "feedsim" if home.is_absolute() else None


def own_folder(kind: str, code: Sequence[Path]) -> Path | None:
    """A folder for files of one kind that follow from this code and its libraries; None: none that is the user's own.

    Folders of the kind for other code are removed but for the last four: programs of several versions may take turns.
    """
    place = cache_folder()
    if place is None:
        return None
    name = hashlib.sha256(json.dumps(_versions(tuple(code))).encode()).hexdigest()[:20]
    own = place / f"{kind}-{name}"
    try:
        if not own.is_dir():
            own.mkdir(mode=0o700, parents=True)
            others = sorted(place.glob(f"{kind}-*/"), key=lambda path: path.stat().st_mtime)
            for old in others[:-5]:
                shutil.rmtree(old, ignore_errors=True)
        return own if _is_private(own) else None
    except OSError:
        return None


def _is_private(place: Path) -> bool:
    """Whether nobody else can write there: what is compiled is executed. Raises OSError."""
    if sys.platform == "win32":  # the folder is below the user's profile, where no other user writes
        return True
    result = place.stat()
    return result.st_uid == os.getuid() and not result.st_mode & 0o022


def file_digest(file: Path) -> str:
    """SHA-256 of a file's bytes. Raises OSError."""
    return hashlib.sha256(file.read_bytes()).hexdigest()


@lru_cache(maxsize=8)
def _versions(code: tuple[Path, ...]) -> list[str]:
    """The code that finds an answer, the libraries that it computes with, and the processor."""
    sources = hashlib.sha256()
    for path in code:
        for file in sorted(path.rglob("*.py")) if path.is_dir() else [path]:
            sources.update(file.read_bytes())
    libraries = [f"{name} {text}" for name in LIBRARIES if (text := version(name))]
    return [sources.hexdigest(), *libraries, platform.machine(), sys.byteorder]


def _store_answer(file: Path, kind: str, text: str) -> None:
    """Write it whole; others may read and write the same one meanwhile. Raises OSError."""
    if len(text) > MAX_ANSWER_BYTES:
        return
    file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    with (
        defer_signals(),
        tempfile.NamedTemporaryFile("w", encoding="utf-8", prefix=".", dir=file.parent, delete=False) as out,
    ):
        fresh = Path(out.name)
        try:
            out.write(text)
            out.close()
            fresh.replace(file)
        except BaseException:
            with suppress(OSError):
                fresh.unlink()
            raise
    others = sorted(file.parent.glob(f"{kind}-*.json"), key=lambda path: path.stat().st_mtime)
    for old in others[:-MAX_ANSWERS]:
        with suppress(OSError):
            old.unlink()
