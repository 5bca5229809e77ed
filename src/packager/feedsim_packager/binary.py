"""What a shared library offers and asks for, read from the file itself, whatever platform it is for."""

import struct

from . import elf, macho, pe
from .symbols import Binary, Unreadable

__all__ = ["Binary", "Unreadable", "read"]


def read(content: bytes) -> tuple[Binary, ...]:
    """The library in `content`; several where the file is universal. Raises Unreadable."""
    try:
        if content.startswith(b"\x7fELF"):
            return (elf.read(content),)
        if content.startswith(b"MZ"):
            return (pe.read(content),)
        return macho.read(content)
    except (struct.error, IndexError, ValueError, UnicodeDecodeError) as error:
        raise Unreadable(f"neither ELF, PE nor Mach-O of 64 bit, or damaged: {error}") from error
