"""What archives unpack to: once for each content and process, kept for the next run, gone when the process ends.

Kept is what an archive's bytes say, not its name: an archive that is built anew under its old name is another one, and
copies of an archive are the same. What nobody uses any more is kept for the next run, the latest :data:`KEPT` of them.
"""

from __future__ import annotations

import atexit
import hashlib
import os
import shutil
import tempfile
import threading
import weakref
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from feedsim.cosim import untrusted
from feedsim.errors import InputError

KEPT = 8  # contents that no archive uses: the three units', and those of some machines or SSP files
KEPT_SIZE = 64 << 20  # bytes; what is larger, such as the setpoints of a long program, goes with its last user


@dataclass
class Description:
    """What an archive says of itself.

    Attributes:
        model: its modelDescription.xml, as FMPy reads it.
        variables: by name; not to be changed.
        platforms: the folders in its binaries/, for this platform and others.
    """

    model: Any
    variables: Mapping[str, Any]
    platforms: tuple[str, ...]


class Content:
    """The unpacked content of an archive, in a folder that other users of the same content see too.

    Attributes:
        directory: the folder; only to be read.
        size: bytes of what is unpacked.
        description: see there.
        library: the loaded shared library, whatever the room that loads it takes for one; None as long as it is not
            needed. `unload` gives it back.
    """

    def __init__(self) -> None:
        self.directory = Path(tempfile.mkdtemp(prefix="feedsim-"))
        # Also when a signal ends the program while the archive is being unpacked, or when nobody closed it.
        self._remove = weakref.finalize(self, _remove, str(self.directory), os.getpid())
        self.size = 0
        self.description: Description
        self.library: Any = None
        self.unload: Callable[[], None] | None = None
        self.users = 0

    def remove(self) -> None:
        unload, self.library, self.unload = self.unload, None, None
        if unload is not None:
            unload()
        self._remove()


def _remove(folder: str, owner: int) -> None:
    """A process that was forked off leaves its parent's folders alone."""
    if os.getpid() == owner:
        shutil.rmtree(folder, ignore_errors=True)


class Store:
    """Contents by what they are, shared by all archives of a process."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._contents: dict[str, Content] = {}  # those used last stand last
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
                key = hashlib.file_digest(file, "sha256").hexdigest()
                file.seek(0)
            content = self._contents.pop(key, None)
            if content is None:
                content = Content()
                if not self._ends:  # after the first folder's own end is arranged for, so that this comes ahead of it
                    self._ends = True
                    atexit.register(self.clear)  # Windows does not remove a library that is loaded
                try:
                    unpack(file, content)
                except BaseException:
                    content.remove()
                    raise
                self._contents[key] = content
            else:
                self._contents[key] = content
                allowance.take(content.size, str(path))
            content.users += 1
            return content

    def give_back(self, content: Content) -> None:
        with self._lock:
            content.users -= 1
            if content not in self._contents.values():  # of a process that this one was forked off from
                return
            idle = [key for key, each in self._contents.items() if not each.users]
            large = [key for key in idle if self._contents[key].size > KEPT_SIZE]
            for key in {*large, *idle[: max(0, len(idle) - KEPT)]}:
                self._contents.pop(key).remove()

    def clear(self) -> None:
        """Let go of everything that no archive uses."""
        with self._lock:
            for key in [key for key, each in self._contents.items() if not each.users]:
                self._contents.pop(key).remove()

    def forget(self) -> None:
        """In a process just forked off: its parent's folders may go at any time."""
        self._lock = threading.Lock()  # another thread of the parent may have held it
        self._contents = {}


STORE = Store()
if hasattr(os, "register_at_fork"):  # Windows has none, and no fork either
    os.register_at_fork(after_in_child=STORE.forget)


def check_there(path: Path) -> None:
    """InputError where there is no file `path`."""
    if not path.is_file():
        raise InputError(f"{path}: no such file; `make fmus` builds the archives, FEEDSIM_FMUS names their folder")
