"""Instantiate what was built, before it is packed: GUID, resources and binary must fit together on this machine.

Runs as a program of its own (`python trial.py LIBRARY UNIT GUID RESOURCES`), so that a crash in the library cannot take
the packager with it and Windows lets go of the file afterwards. Exit code 1 with the unit's own words where it refuses.
"""

import ctypes
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

_TIMEOUT = 60  # s; an instantiation takes milliseconds

_Logger = ctypes.CFUNCTYPE(
    None, ctypes.c_void_p, ctypes.c_char_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p
)  # variadic in C; what follows the message is not used
_Allocate = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_size_t, ctypes.c_size_t)
_Free = ctypes.CFUNCTYPE(None, ctypes.c_void_p)
_COSIMULATION = 1  # fmi2Type


class _Callbacks(ctypes.Structure):
    _fields_ = (
        ("logger", _Logger),
        ("allocateMemory", _Allocate),
        ("freeMemory", _Free),
        ("stepFinished", ctypes.c_void_p),
        ("componentEnvironment", ctypes.c_void_p),
    )


def instantiate(library: Path, unit: str, guid: str, resources: Path) -> str | None:
    """None if the library can be instantiated, otherwise what it (or the loader) said."""
    # -I: this folder stays off the search path, where its modules could hide standard ones.
    command = [sys.executable, "-I", str(Path(__file__).resolve()), *map(str, (library, unit, guid, resources))]
    try:
        done = subprocess.run(command, capture_output=True, encoding="utf-8", errors="replace", timeout=_TIMEOUT)
    except subprocess.TimeoutExpired:
        return f"no answer within {_TIMEOUT} s"
    if done.returncode == 0:
        return None
    return (done.stdout + done.stderr).strip() or f"the trial ended with exit code {done.returncode}"


def check(library: Path, unit: str, guid: str, resources: Mapping[str, bytes], stage: Path) -> None:
    """Instantiate once with these resources (archive path -> content), which are written into the folder `stage`.

    Raises:
        InputError: with the unit's own words where it refuses.
    """
    from .errors import InputError  # the program that this file is as well knows no package

    (stage / "resources").mkdir(exist_ok=True)
    for path in (stage / "resources").iterdir():
        path.unlink()  # left from an earlier build
    for name, content in resources.items():
        (stage / name).write_bytes(content)
    refusal = instantiate(library, unit, guid, stage / "resources")
    if refusal is not None:
        raise InputError(f"{unit}: packed, but cannot be instantiated", refusal.splitlines())


def _main(library: str, unit: str, guid: str, resources: str) -> int:
    c = ctypes.CDLL(library)
    c_library = ctypes.CDLL("msvcrt" if sys.platform == "win32" else None)
    c_library.calloc.restype = ctypes.c_void_p
    c_library.calloc.argtypes = [ctypes.c_size_t, ctypes.c_size_t]
    c_library.free.restype = None
    c_library.free.argtypes = [ctypes.c_void_p]

    def log(_environment: int, _name: bytes, _status: int, _category: bytes, message: bytes) -> None:
        print(message.decode("utf-8", "replace").replace("%%", "%").replace("##", "#"))

    callbacks = _Callbacks(_Logger(log), _Allocate(c_library.calloc), _Free(c_library.free), None, None)
    c.fmi2Instantiate.restype = ctypes.c_void_p
    c.fmi2Instantiate.argtypes = [
        *(ctypes.c_char_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p),
        *(ctypes.POINTER(_Callbacks), ctypes.c_int, ctypes.c_int),
    ]
    c.fmi2FreeInstance.restype = None
    c.fmi2FreeInstance.argtypes = [ctypes.c_void_p]
    location = Path(resources).resolve().as_uri().encode()
    component = c.fmi2Instantiate(b"trial", _COSIMULATION, guid.encode(), location, ctypes.byref(callbacks), 0, 0)
    if component is None:
        print(f"{unit} refused to be instantiated with guid {guid}")
        return 1
    c.fmi2FreeInstance(component)
    return 0


if __name__ == "__main__":
    sys.exit(_main(*sys.argv[1:]))
