"""How this process computes: rounding, denormal numbers, traps, which a program of another maker may leave changed.

All units share it: one that rounds upward changes what every other unit computes. The native loop looks at it itself.
"""

from __future__ import annotations

import ctypes
import platform
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

# System, processor -> which words of its fenv_t hold settings, with a mask of what is no flag of a past operation.
_SETTINGS = {
    ("linux", "x86_64"): ((0, 0xFFFF), (7, 0xFFC0)),
    ("darwin", "x86_64"): ((0, 0xFFFF), (1, 0xFFC0)),
    ("linux", "aarch64"): ((0, 0xFFFFFFFF),),
    ("darwin", "arm64"): ((2, 0xFFFFFFFF),),
}
_Words = ctypes.c_uint32 * 64  # no fenv_t is larger


def _functions() -> tuple[Any, Any] | None:
    """fegetenv and fesetenv of C's <fenv.h>; None where its fenv_t is not known: nothing is looked at there."""
    if (sys.platform, platform.machine()) not in _SETTINGS:
        return None
    try:
        library = ctypes.PyDLL("libm.so.6" if sys.platform == "linux" else None)
        return library.fegetenv, library.fesetenv
    except (OSError, AttributeError):  # another C library than the usual one
        return None


_FUNCTIONS = _functions()
_MASKS = _SETTINGS.get((sys.platform, platform.machine()), ())
_now = _Words()


def settings() -> Any:
    """Of now, for :func:`restore`."""
    words = _Words()
    if _FUNCTIONS is not None:
        _FUNCTIONS[0](words)
    return words


def restore(kept: Any) -> bool:
    """Go back to :func:`settings` of before. Whether anything but the flags of past operations has changed since."""
    if _FUNCTIONS is None:
        return False
    get, put = _FUNCTIONS
    get(_now)
    for word, mask in _MASKS:
        if (_now[word] ^ kept[word]) & mask:
            put(kept)
            return True
    return False


@contextmanager
def restored(changed: Callable[[], None] | None = None) -> Iterator[None]:
    """A block that calls another program; behind it this process computes as before. `changed` is called where the
    program has left it otherwise."""
    before = settings()
    try:
        yield
    finally:
        if restore(before) and changed is not None:
            changed()
