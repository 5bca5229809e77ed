"""An SSP file: its files by name, read with distrust and when they are asked for; written the same each time, whole or
not at all."""

from __future__ import annotations

import posixpath
import zipfile
from collections.abc import Container, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import quote, unquote, urlsplit

from feedsim.cosim import untrusted
from feedsim.cosim.untrusted import Allowance
from feedsim.errors import InputError, no_such_file
from feedsim.trace.files import written_whole

STRUCTURE = "SystemStructure.ssd"
_EPOCH = (1980, 1, 1, 0, 0, 0)  # the first date that a zip file can hold


def write(path: Path, files: Mapping[str, bytes]) -> int:
    """Write `files` in their order and return the size [bytes]. Stored, not deflated: what weighs is archives already,
    and the bytes then depend on no version of zlib. OutputError: the file cannot be written; nothing is left then."""
    with written_whole(path) as file:
        with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as package:
            for name, content in files.items():
                entry = zipfile.ZipInfo(name, _EPOCH)
                entry.create_system = 3
                entry.external_attr = 0o644 << 16
                package.writestr(entry, content)
        return file.tell()


class Files(Mapping[str, bytes]):
    """Files of an SSP by name. Only what is asked for is unpacked, and only so much of it (`allowance`)."""

    def __init__(self, path: Path, package: zipfile.ZipFile) -> None:
        self.path = path
        self.allowance = Allowance(path)
        self._package = package
        self._entries = untrusted.entries(package, str(path))

    def __getitem__(self, name: str) -> bytes:
        """A document, whole. InputError: it is damaged, or too large for one."""
        entry = self._entries[name]
        if entry.file_size > untrusted.LARGEST_DOCUMENT:
            raise InputError(
                f"{self.path}: {name} has {entry.file_size} bytes; at most {untrusted.LARGEST_DOCUMENT} are read of a "
                "document"
            )
        self.allowance.take(entry.file_size, str(self.path))
        with untrusted.readable(f"{self.path}: {name} cannot be read"):
            return self._package.read(entry)

    def __contains__(self, name: object) -> bool:
        return name in self._entries

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)

    def copy(self, name: str, to: Path) -> None:
        """Write a file of any size to `to`, whose folders are made. InputError: damaged, too large, no room for it."""
        self.allowance.take(self._entries[name].file_size, str(self.path))
        with untrusted.readable(f"{self.path}: {untrusted.shortened(name)} cannot be unpacked"):
            untrusted.copy(self._package, self._entries[name], to)


def inside(source: str, files: Container[str]) -> str:
    """Name of the file that a `source` means: a URI (RFC 3986) relative to the SSP file's top. InputError: there is
    none, in words that go on behind "source 'x'".

    Some programs write names as they are: such a source is taken where the file has that very name.
    """
    if source in files:
        return source
    try:
        uri = urlsplit(source)
        path = unquote(uri.path, errors="strict")
    except ValueError:
        raise InputError("is not in the file: it is no URI (RFC 3986)") from None
    if uri.scheme or uri.netloc or path.startswith("/"):
        raise InputError("is not in the file: it is not relative to it")
    if "\\" in path or not path.isprintable():
        raise InputError("is not in the file: it has backslashes or control characters, where / parts folders")
    name = posixpath.normpath(path)
    if name.split("/")[0] == "..":
        raise InputError("is not in the file: it leads out of it")
    if name not in files:
        raise InputError("is not in the file")
    return name


def as_source(name: str) -> str:
    """The URI of a file inside, relative to the top."""
    return quote(name, safe="/!$&'()*+,;=@~")


@contextmanager
def read(path: Path) -> Iterator[Files]:
    """The files of an SSP, for as long as the block lasts.

    Raises:
        InputError: no such file, no zip file, damaged, or with entries that do not belong into one
            (:func:`feedsim.cosim.untrusted.entries`); it unpacks to more than it may.
    """
    with untrusted.readable(f"{path} cannot be read"):
        folder, there, regular = path.is_dir(), path.exists(), path.is_file()
    if folder:
        raise InputError(f"{path} is a folder, not an SSP file")
    if not there:
        raise InputError(no_such_file(path))
    if not regular:
        raise InputError(f"{path} is no regular file, and no SSP file")
    with untrusted.readable(f"{path}: not a readable SSP, which is a zip file"):
        package = zipfile.ZipFile(path)
    with package:
        files = Files(path, package)
        if STRUCTURE not in files:
            raise InputError(f"{path}: has no {STRUCTURE} at its top; it is no SSP file, or damaged")
        yield files
