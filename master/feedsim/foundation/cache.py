"""Answers that are dear to find and short to write, kept on disk from one process to the next.

An answer belongs to all that it follows from: the bytes of the user's files, the arguments, and the code that finds it.
Where one of these changes it is found anew, so that a kept answer is the very one that would be found. What cannot be
read or written is found as if nothing had been kept. May use: signals and installation. Start reading at cached().
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import shutil
import sys
import tempfile
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Any

from feedsim.foundation.installation import version
from feedsim.foundation.owned import held

FOLDER = "FEEDSIM_CACHE"  # environment variable: the folder; empty: nothing is kept
MAX_ANSWERS = 256  # answers of one kind; the oldest go first
MAX_ANSWER_BYTES = 1 << 20  # bytes of an answer; a larger file is none of ours
LIBRARIES = ("numpy", "scipy", "jinja2")


def cached(kind: str, follows_from: Sequence[Any], code: Sequence[Path], find: Callable[[], Any]) -> Any:
    """What `find` returns, numbers and texts as JSON has them; kept from an earlier process where nothing has changed.

    kind: letters, the beginning of the file's name. follows_from: what the answer depends on, as JSON has it. code:
    folders with the code that finds it.
    """
    place = folder()
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
        _keep(file, kind, json.dumps({"asked": asked, "answer": answer}))
    return answer


def folder() -> Path | None:
    """Where answers are kept; None: nowhere."""
    if (given := os.environ.get(FOLDER)) is not None:
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
    place = folder()
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
        return own if _private(own) else None
    except OSError:
        return None


def _private(place: Path) -> bool:
    """Whether nobody else can write there: what is compiled is executed. Raises OSError."""
    if sys.platform == "win32":  # the folder is below the user's profile, where no other user writes
        return True
    result = place.stat()
    return result.st_uid == os.getuid() and not result.st_mode & 0o022


def digest(file: Path) -> str:
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


def _keep(file: Path, kind: str, text: str) -> None:
    """Write it whole; others may read and write the same one meanwhile. Raises OSError."""
    if len(text) > MAX_ANSWER_BYTES:
        return
    file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    with held(), tempfile.NamedTemporaryFile("w", encoding="utf-8", prefix=".", dir=file.parent, delete=False) as out:
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
