"""What archives unpack to: once for each content and process, kept for the next run, gone when the process ends.

Kept is what an archive's bytes say, not its name: an archive that is built anew under its old name is another one, and
copies of an archive are the same. What nobody uses any more is kept for the next run, the latest
:data:`MAX_UNUSED_CONTENTS` of them.
"""

from __future__ import annotations

import atexit
import hashlib
import os
import stat
import threading
import time
import unicodedata
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from io import BufferedReader
from pathlib import Path
from typing import IO, Any
from xml.parsers import expat

from feedsim.foundation.errors import InputError, OutputError
from feedsim.foundation.installation import repair_advice, shipped
from feedsim.foundation.outputs import TemporaryFolder

# --- What comes from elsewhere, read with distrust: zip archives (names, sizes) and XML documents (no document
#     type)


MAX_UNPACKED_BYTES = 4 << 30  # bytes that a file may unpack to; the setpoints of the longest program take less
RATIO = 100  # to the file's own size; tables of setpoints reach some 10, files made to fill a disk 1000
FREE_BYTES = 64 << 20  # bytes up to which the ratio does not count
LARGEST_DOCUMENT = 64 << 20  # bytes of what is read into memory at once: XML, JSON, YAML
MOST_ENTRIES = 20_000  # files and folders; archives of simulators have some hundreds
MAX_PATH_PART_BYTES = 240  # bytes of a file's or folder's name; systems know 255
MAX_PATH_BYTES = 1024  # bytes of a name with its folders
# On Windows, with any ending.
_PORTS = (f"{port}{n}" for port in ("COM", "LPT") for n in "0123456789¹²³")
_DEVICES = frozenset(("CON", "PRN", "AUX", "NUL", "CONIN$", "CONOUT$", *_PORTS))
_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)  # those of the standards FMI and SSP


class Allowance:
    """What a file from elsewhere may still unpack to, the archives inside it included."""

    def __init__(self, path: Path) -> None:
        try:
            self._size = path.stat().st_size
        except OSError as error:
            raise InputError(f"{path} cannot be read: {error.strerror or error}") from error
        self._limit = min(MAX_UNPACKED_BYTES, max(FREE_BYTES, RATIO * self._size))
        self._used = 0

    def take(self, size: int, where: str) -> None:
        """Count `size` bytes. InputError: they are too many."""
        self._used += size
        if self._used > self._limit:
            raise InputError(
                f"{where}: what is needed of it unpacks to {self._used} bytes or more; at most {self._limit} are read "
                f"of a file of {self._size} bytes ({RATIO} times its size, from {FREE_BYTES >> 20} MiB to "
                f"{MAX_UNPACKED_BYTES >> 30} "
                "GiB)"
            )


def entries(package: zipfile.ZipFile, where: str) -> dict[str, zipfile.ZipInfo]:
    """Files in a zip archive by name; backslashes in names, which some programs on Windows write, separate as / does.

    Raises:
        InputError: lists entries that do not belong into one: names that lead out of it, occur twice, are none that
            every system has, cannot be on a disk together (one that does not separate upper from lower case, nor the
            ways to write an accent) or are too long; links; what is encrypted or packed by an unusual method.
    """
    if (count := len(package.infolist())) > MOST_ENTRIES:
        raise InputError(f"{where}: cannot be trusted: it has {count} entries; allowed: up to {MOST_ENTRIES}")
    for entry in package.infolist():
        entry.filename = entry.filename.replace("\\", "/")
    zip_infos = [entry for entry in package.infolist() if not entry.filename.endswith("/")]
    names: dict[str, str] = {}  # as a disk compares them -> as the first of the entries has it
    for entry in zip_infos:
        names.setdefault(_fold_case(entry.filename), entry.filename)
    faults: list[str] = []
    seen: set[str] = set()
    for entry in zip_infos:
        name = entry.filename
        if fault := _fault(entry, name in seen, names):
            faults.append(f"{where}: the entry {shorten_name(name)!r} {fault}")
        seen.add(name)
    if faults:
        more = len(faults) - 20
        faults = [*faults[:20], f"{where}: {more} more like these"] if more > 0 else faults
        raise InputError.of(f"{where}: cannot be trusted", faults)
    return {entry.filename: entry for entry in zip_infos}


def _fault(entry: zipfile.ZipInfo, twice: bool, names: dict[str, str]) -> str | None:
    name = entry.filename
    if leads_out(name):
        return "leads out of the archive"
    if stat.S_ISLNK(entry.external_attr >> 16):
        return "is a link"
    if entry.flag_bits & 1:
        return "is encrypted"
    if entry.compress_type not in _METHODS:
        return "is neither stored nor deflated; FMI and SSP know no other method"
    if twice:
        return "is there twice"
    size = len(name.encode("utf-8", "surrogatepass"))
    if size > MAX_PATH_BYTES or any(
        len(p.encode("utf-8", "surrogatepass")) > MAX_PATH_PART_BYTES for p in name.split("/")
    ):
        return f"has a name of more than {MAX_PATH_PART_BYTES} bytes ({MAX_PATH_BYTES} with its folders)"
    if fault := next(filter(None, map(_part_fault, name.split("/"))), None):
        return fault
    folded = _fold_case(name)
    if names[folded] != name:
        return (
            f"differs from {shorten_name(names[folded])!r} only in case or accents, which some disks do not tell apart"
        )
    parts = folded.split("/")
    above = next((names[text] for i in range(1, len(parts)) if (text := "/".join(parts[:i])) in names), None)
    return f"is in the folder {shorten_name(above)!r}, which is a file too" if above else None


def _part_fault(part: str) -> str | None:
    """What keeps the name of a file or folder from being one on every system."""
    if part in ("", "."):
        return "has a part that is empty or '.'"
    if part[-1] in ". ":
        return f"has a part that ends in a dot or a space, {shorten_name(part)!r}, which Windows leaves away"
    if part.partition(".")[0].rstrip(" ").upper() in _DEVICES:
        return f"has a part, {shorten_name(part)!r}, that is a device on Windows"
    return None


def _fold_case(name: str) -> str:
    """A name as disks compare it that do not separate upper from lower case, nor the ways to write an accent."""
    return unicodedata.normalize("NFC", unicodedata.normalize("NFC", name).casefold())


def leads_out(name: str) -> bool:
    """Whether a name inside an archive is absolute, climbs, or is none that every system reads alike."""
    return (
        not name
        or name.startswith("/")
        or ".." in name.split("/")
        or any(c in name for c in "\\:\0")
        or any(ord(c) < 32 or 0xD800 <= ord(c) < 0xE000 for c in name)
    )


def shorten_name(name: str) -> str:
    """A name for a message."""
    return name if len(name) <= 80 else f"{name[:77]}..."


def copy_stream(package: zipfile.ZipFile, entry: zipfile.ZipInfo, to: Path) -> None:
    """Write an entry to the file `to`, whose folders are made; never more bytes than it says it has.

    OutputError: it cannot be written, which is no fault of the archive.
    """
    with package.open(entry) as source:
        with _report_write_errors(to):
            to.parent.mkdir(parents=True, exist_ok=True)
            target = to.open("wb")
        try:
            while block := source.read(1 << 20):
                with _report_write_errors(to):
                    target.write(block)
        finally:
            with _report_write_errors(to):
                target.close()


@contextmanager
def _report_write_errors(to: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise OutputError(
            f"{to}: a temporary file cannot be written: {error.strerror or error}; TMPDIR names their folder"
        ) from error


@contextmanager
def readable(what: str) -> Iterator[None]:
    """Make an InputError, `what` ahead, of whatever a damaged archive or a full disk raises in the block."""
    try:
        yield
    except (zipfile.BadZipFile, EOFError, NotImplementedError, RuntimeError, ValueError, zlib.error) as error:
        raise InputError(f"{what}: {error}") from error
    except OSError as error:
        raise InputError(f"{what}: {error.strerror or error}") from error


class _Root(Exception):
    """The root element begins: no document type can follow."""


def refuse_document_type(content: bytes, where: str) -> None:
    """Raise InputError for an XML document with a document type declaration, in any encoding, or with bad XML ahead of
    its root."""

    def refuse(*_: object) -> None:
        raise InputError(f"{where}: has a document type declaration; FMI and SSP know none, and none is read")

    def stop(*_: object) -> None:
        raise _Root

    parser = expat.ParserCreate()
    parser.StartDoctypeDeclHandler = refuse
    parser.StartElementHandler = stop
    try:
        parser.Parse(content, True)
    except _Root:
        pass
    except (expat.ExpatError, ValueError, LookupError) as error:
        raise InputError(f"{where}: not readable XML: {error}") from error


# --- What archives unpack to: once for each content and process, kept for the next run, gone when the process ends ----


MAX_UNUSED_CONTENTS = 8  # contents that no archive uses: the three units', and those of some machines or SSP files
KEPT_SIZE = 64 << 20  # bytes; what is larger, such as the setpoints of a long program, goes with its last user
# A file that has rested for so long [ns] has other times after its next change; a younger one may change within the
# same tick of its file system's clock.
MIN_FILE_AGE = 2_000_000_000
DIGESTS = 64  # how many are remembered


class Content:
    """The unpacked content of an archive, in a folder that other users of the same content see too.

    Attributes:
        directory: the folder; only to be read.
        size: bytes of what is unpacked.
        files: what is unpacked, and the size of each.
        description: what the archive says of itself: modelDescription.xml, as FMPy reads it.
        problems: what of it FMI 2.0 does not allow.
        variables: of the description, by name; not to be changed.
        platforms: the folders in its binaries/, for this platform and others.
        library: the loaded shared library, whatever the room that loads it takes for one; None as long as it is not
            needed. `unload` gives it back.
    """

    def __init__(self) -> None:
        self._folder = TemporaryFolder()
        self.directory, self.remove_folder = self._folder.path, self._folder.close
        self.size = 0
        self.files: dict[Path, int] = {}
        self.description: Any = None
        self.problems: list[str] = []
        self.variables: Mapping[str, Any] = {}
        self.platforms: tuple[str, ...] = ()
        self.library: Any = None
        self.unload: Callable[[], None] | None = None
        self.users = 0

    def complete(self) -> None:
        """Take note of what is there."""
        self.files = {file: file.stat().st_size for file in self.directory.rglob("*") if file.is_file()}

    @property
    def whole(self) -> bool:
        """Whether it is still there: what cleans a folder for temporary files takes what has been idle for long."""
        try:
            return all(file.stat().st_size == size for file, size in self.files.items())
        except OSError:
            return False

    def remove(self) -> None:
        unload, self.library, self.unload = self.unload, None, None
        if unload is not None:
            unload()
        self.remove_folder()


class Store:
    """Contents by what they are, shared by all archives of a process.

    Attributes:
        loading: to be held while a library is being loaded.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self.loading = threading.Lock()  # FMPy changes the working folder while it loads a library
        self._contents: dict[str, Content] = {}  # those used last stand last
        self._digests: dict[tuple[int, ...], str] = {}  # by what separates a file from others and from its later states
        self._ends = False

    def take(self, path: Path, allowance: Allowance, unpack: Callable[[IO[bytes], Content], None]) -> Content:
        """The content of the archive `path`, until it is given back.

        Args:
            allowance: what it may unpack to, which is counted again where it is there already.
            unpack: fills a new content from the open file; what it raises is passed on, and nothing is left.

        Raises:
            InputError: the file cannot be read, or unpacks to more than is allowed.
        """
        with readable(f"{path}: not a usable FMI 2.0 archive"):
            file = path.open("rb")
        with file, self._lock:
            with readable(f"{path}: not a usable FMI 2.0 archive"):
                key = self._digest(file)
            content = self._contents.pop(key, None)
            if content is not None and not content.whole:
                if not content.users:
                    content.remove()
                content = None
            if content is None:
                content = Content()
                self._arrange_for_the_end()  # after the folder's own end is arranged for, so that this comes ahead
                try:
                    unpack(file, content)
                    content.complete()
                except BaseException:
                    content.remove()
                    raise
                self._contents[key] = content
            else:
                self._contents[key] = content
                allowance.take(content.size, str(path))
            content.users += 1
            return content

    def digest(self, path: Path) -> str:
        """SHA-256 of a file. OSError: it cannot be read."""
        with path.open("rb") as file, self._lock:
            return self._digest(file)

    def _arrange_for_the_end(self) -> None:
        if self._ends:
            return
        self._ends = True
        atexit.register(self.clear)  # Windows does not remove a library that is loaded

    def _digest(self, file: BufferedReader) -> str:
        """SHA-256 of an open file, computed once as long as the file stays as it is."""
        result = os.fstat(file.fileno())
        state = (result.st_dev, result.st_ino, result.st_size, result.st_mtime_ns, result.st_ctime_ns)
        if (known := self._digests.get(state)) is not None:
            return known
        rested = time.time_ns() - max(result.st_mtime_ns, result.st_ctime_ns) > MIN_FILE_AGE  # asked before it is read
        digest = hashlib.file_digest(file, "sha256").hexdigest()
        file.seek(0)
        if rested:
            if len(self._digests) >= DIGESTS:
                self._digests.clear()
            self._digests[state] = digest
        return digest

    def give_back(self, content: Content) -> None:
        with self._lock:
            content.users -= 1
            if content not in self._contents.values():  # of a process that this one was forked off from
                return
            idle = [key for key, content in self._contents.items() if not content.users]
            large = [key for key in idle if self._contents[key].size > KEPT_SIZE]
            for key in {*large, *idle[: max(0, len(idle) - MAX_UNUSED_CONTENTS)]}:
                self._contents.pop(key).remove()

    def clear(self) -> None:
        """Let go of everything that no archive uses."""
        with self._lock:
            for key in [key for key, content in self._contents.items() if not content.users]:
                self._contents.pop(key).remove()

    def forget(self) -> None:
        """In a process just forked off: its parent's folders may go at any time."""
        self._lock, self.loading = threading.Lock(), threading.Lock()  # other threads of the parent may have held them
        self._contents = {}
        self._ends = False


STORE = Store()
if hasattr(os, "register_at_fork"):  # Windows has none, and no fork either
    os.register_at_fork(after_in_child=STORE.forget)


def check_there(path: Path) -> None:
    """InputError where there is no file `path`."""
    if not path.is_file():
        ours = path.parent == shipped("fmus")
        raise InputError(
            f"{path}: no such file; "
            f"{repair_advice('the archives') if ours else 'FEEDSIM_FMUS or --fmus names their folder'}"
        )
