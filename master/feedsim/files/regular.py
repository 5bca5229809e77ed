"""Bytes of a file that a user names: of a regular one, up to a size. No pipe or device keeps a command waiting.

JSON from such files is read here as well: nested so deep that Python's stack would not hold it, it is refused.
"""

from __future__ import annotations

import hashlib
import json
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from io import BufferedReader
from pathlib import Path
from typing import Any

from feedsim.foundation.errors import InputError, no_such_file

MAX_JSON_DEPTH = 100  # levels of groups and lists
# What else a name may stand for, in words.
_OTHERS = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISSOCK, "a socket"),
    (lambda _: True, "a device"),
)
_INSTRUMENT = (
    "a file that its instrument's own program reads",
    ("export the test as text or CSV, with angle and deviation (or radius), or both positions"),
)
_ANSYS = "a file of ANSYS that is not read", "jobname.full of a modal analysis is (kind: ansys)"
_NASTRAN = (
    "a file of Nastran that is not read",
    ("convert its matrices to Matrix Market (kind: matrices), or make a table of modes"),
)
_ABAQUS = (
    "a file of Abaqus that is not read",
    ("write the matrices with *MATRIX GENERATE and convert them to Matrix Market (kind: matrices)"),
)
_RECORDER = "a recorder's file that is not read", "export the signals there as CSV, with a header of names and units"
# Ending of files that nothing here reads -> what they are, and what to do.
UNREAD = {
    **dict.fromkeys((".b5r", ".b20", ".b5s", ".bbx", ".kgm", ".acc"), _INSTRUMENT),
    **dict.fromkeys((".rst", ".rth", ".rfrq", ".emat", ".esav", ".db", ".dbb", ".cdb", ".mechdb"), _ANSYS),
    **dict.fromkeys((".op2", ".op4", ".pch", ".f06", ".bdf", ".nas"), _NASTRAN),
    **dict.fromkeys((".odb", ".cae"), _ABAQUS),
    **dict.fromkeys((".frd", ".rout"), (
        "a result of CalculiX", "store the matrices with *FREQUENCY, SOLVER=MATRIXSTORAGE (kind: calculix)"
    )),
    **dict.fromkeys((".svdx", ".svd", ".tcscopex"), (
        "a project of TwinCAT Scope", "export its data there as CSV, with the header and a time for every channel"
    )),
    **dict.fromkeys((".tdms", ".mf4", ".mdf", ".dxd", ".d7d"), _RECORDER),
    **dict.fromkeys((".slx", ".mdl", ".mldatx", ".fig"), (
        "a file that only MATLAB reads", "save the signals there as vectors: save('record.mat', 't', 'x', '-v7')"
    )),
    **dict.fromkeys((".mph", ".mnf"), (
        "a model that is not read", "export mass and stiffness there as Matrix Market (kind: matrices)"
    )),
}  # fmt: skip
_OPENING = os.O_RDONLY | sum(getattr(os, name, 0) for name in ("O_BINARY", "O_CLOEXEC", "O_NONBLOCK", "O_NOCTTY"))


def refuse_unread(path: Path) -> None:
    """InputError with what to do: a file of a kind that nothing here reads, by its ending."""
    if path.suffix.lower() in UNREAD and path.is_file():
        what, advice = UNREAD[path.suffix.lower()]
        raise InputError(f"{path} is {what}; {advice}")


@contextmanager
def opened(path: Path, *, pipes: bool = False) -> Iterator[BufferedReader]:
    """A file to be read piece by piece. pipes, errors: as of content(), without its limit."""
    refuse_unread(path)
    try:
        number = os.open(path, _OPENING)
        with os.fdopen(number, "rb") as file:
            result = os.fstat(number)
            if not (stat.S_ISREG(result.st_mode) or (pipes and stat.S_ISFIFO(result.st_mode))):
                what = next(name for is_one, name in _OTHERS if is_one(result.st_mode))
                raise InputError(f"{path} is {what}, not a file")
            if hasattr(os, "O_NONBLOCK"):
                os.set_blocking(number, True)
            yield file
    except FileNotFoundError:
        raise InputError(no_such_file(path)) from None
    except IsADirectoryError:
        raise InputError(f"{path} is a folder, not a file") from None
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from None


def content(path: Path, largest: int | None = None, *, pipes: bool = False) -> bytes:
    """What is in a file.

    Args:
        largest: bytes that it may have; None: any number.
        pipes: one that somebody writes to, such as a shell's <(command), will do too; without a writer it is empty.

    Raises:
        InputError: no such file, one that cannot be read, is too large, or is no regular one.
    """
    with opened(path, pipes=pipes) as file:
        read = file.read() if largest is None else file.read(largest + 1)
        size = max(os.fstat(file.fileno()).st_size, len(read))
    if largest is not None and len(read) > largest:
        raise InputError(f"{path} has {size / 1e6:.4g} MB; a file of this kind may have {largest / 1e6:.4g} MB at most")
    return read


def digest(path: Path) -> str:
    """SHA-256 of what is in a file, which may be larger than the memory. InputError: as of content()."""
    with opened(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def json_file(path: Path, largest: int | None = None) -> Any:
    """What is in a JSON file in UTF-8. InputError: as of content() and json_value()."""
    return json_value(content(path, largest), str(path))


def json_value(text: str | bytes, where: str) -> Any:
    """The value of a JSON text. InputError: it is none, or nested too deep."""
    try:
        value = json.loads(text)
    except RecursionError:
        raise _too_deep(where) from None
    except ValueError as error:  # bytes that are no UTF-8, and whole numbers of thousands of digits, too
        raise InputError(f"{where} is no JSON that can be read: {error}") from None
    check_depth(value, text, where)
    return value


def check_depth(value: Any, text: str | bytes, where: str) -> None:
    """InputError: a value, which JSON text holds, is nested deeper than what works on it could follow."""
    opening = ("[", "{") if isinstance(text, str) else (b"[", b"{")
    if sum(map(text.count, opening)) <= MAX_JSON_DEPTH:  # type: ignore[arg-type]
        return
    level = [value]
    for _ in range(MAX_JSON_DEPTH + 1):
        level = [inner for outer in level if isinstance(outer, list | dict)
                 for inner in (outer.values() if isinstance(outer, dict) else outer)]  # fmt: skip
        if not level:
            return
    raise _too_deep(where)


def _too_deep(where: str) -> InputError:
    return InputError(f"{where}: its values are nested too deep; allowed: up to {MAX_JSON_DEPTH} levels")


# --- Names of files within texts -> the files: relative to the file that names them, and never out of an archive ------


MAX_NAME_BYTES, MAX_PART_BYTES = 4096, 255  # bytes of a name that Linux takes, and of each part of it
_CLOSED: list[str] = []  # folders that hold what archives were unpacked to


@contextmanager
def closed(folder: Path) -> Iterator[None]:
    """For as long as the block lasts, what is written in files of `folder` names no file outside of it."""
    root = _absolute(folder)
    _CLOSED.append(root)
    try:
        yield
    finally:
        _CLOSED.remove(root)


def referred(folder: Path, name: str) -> Path:
    """The file that a text in a file of `folder` names. No file is looked at.

    Raises:
        InputError: it is none that a system can have; `folder` is closed and the name leads out.
    """
    from feedsim.files.fields import brief  # loads pydantic, which who asks for the kind of a file has no need of

    if not _possible(name):
        raise InputError(f"{brief(name)} is no file name")
    path = folder / name
    root = next((name for name in reversed(_CLOSED) if _inside(_absolute(folder), name)), None)
    if root is not None and not _inside(_absolute(path), root):
        raise InputError(f"{brief(name)} leads out of the archive; what is written in one names files in it alone")
    return path


def _absolute(path: Path) -> str:
    """Without looking at it: resolve() follows links."""
    return os.path.abspath(path)  # noqa: PTH100


def _possible(name: str) -> bool:
    """Whether a system can be asked for such a name: what it answers otherwise is an error of the caller's."""
    try:
        return (
            "\0" not in name
            and len(os.fsencode(name)) < MAX_NAME_BYTES
            and all(len(os.fsencode(part)) <= MAX_PART_BYTES for part in Path(name).parts)
        )
    except UnicodeEncodeError:
        return False


def _inside(path: str, root: str) -> bool:
    return path == root or path.startswith(root + os.sep)
