"""What archives unpack to: once for each content and process, kept for the next run, gone when the process ends.

Kept is what an archive's bytes say, not its name: an archive that is built anew under its old name is another one, and
copies of an archive are the same. What nobody uses any more is kept for the next run, the latest
:data:`MAX_UNUSED_CONTENTS` of them.
"""

from __future__ import annotations

import atexit
import hashlib
import os
import threading
import time
from collections.abc import Callable, Mapping
from io import BufferedReader
from pathlib import Path
from typing import IO, Any

from feedsim.cosim import untrusted
from feedsim.errors import InputError
from feedsim.installation import mend, shipped
from feedsim.owned import TemporaryFolder

MAX_UNUSED_CONTENTS = 8  # contents that no archive uses: the three units', and those of some machines or SSP files
KEPT_SIZE = 64 << 20  # bytes; what is larger, such as the setpoints of a long program, goes with its last user
# A file that has rested for so long [ns] has other times after its next change; a younger one may change within the
# same tick of its file system's clock.
RESTED = 2_000_000_000
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

    def take(self, path: Path, allowance: untrusted.Allowance, unpack: Callable[[IO[bytes], Content], None]) -> Content:
        """The content of the archive `path`, until it is given back.

        Args:
            allowance: what it may unpack to, which is counted again where it is there already.
            unpack: fills a new content from the open file; what it raises is passed on, and nothing is left.

        Raises:
            InputError: the file cannot be read, or unpacks to more than is allowed.
        """
        with untrusted.readable(f"{path}: not a usable FMI 2.0 archive"):
            file = path.open("rb")
        with file, self._lock:
            with untrusted.readable(f"{path}: not a usable FMI 2.0 archive"):
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
        rested = time.time_ns() - max(result.st_mtime_ns, result.st_ctime_ns) > RESTED  # asked before it is read
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
            f"{path}: no such file; {mend('the archives') if ours else 'FEEDSIM_FMUS or --fmus names their folder'}"
        )
