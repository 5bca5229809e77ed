"""Libraries of C that the master calls, beside the archives: found, checked for their interface, loaded once.

May use: installation. Start reading at library().
"""

from __future__ import annotations

import ctypes
import hashlib
import sys
from functools import cache
from pathlib import Path

_SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")

# By name and SHA-256 of the file: each study lays out a copy of its own, and what is loaded stays until the end.
_loaded: dict[tuple[str, bytes], ctypes.CDLL] = {}


def library_name(name: str) -> str:
    """File name of a library on this platform, such as "exchange.so"."""
    return name + _SUFFIX


@cache
def library(name: str, folder: Path, interface: str) -> ctypes.CDLL | str:
    """The library beside the archives in `folder`, or why none there can be used, without the folder's name.

    interface: what the function `<name>_interface` of the library must return: version and layouts of its sources.
    """
    file = library_name(name)
    path = folder.resolve() / file
    try:
        digest = hashlib.sha256(path.read_bytes()).digest()
        if (known := _loaded.get((name, digest))) is not None:
            return known
        loaded = ctypes.CDLL(str(path))
        asked = getattr(loaded, f"{name}_interface")
        asked.restype = ctypes.c_char_p
        result = (asked() or b"").decode(errors="replace")
    except FileNotFoundError:
        return f"{file}: no such file beside the archives"
    except (OSError, AttributeError) as error:
        return f"{file}: cannot be used: {str(error).replace(str(path), file)}"
    if result != interface:
        return f"{file}: built from other sources (its interface is {result!r}, wanted is {interface!r})"
    _loaded[name, digest] = loaded
    return loaded
