"""ELF (Linux): the dynamic section, as the loader reads it. Format: System V ABI, and LSB for symbol versions."""

import struct

from .symbols import Binary, text

_PROCESSORS = {62: "x86_64", 183: "aarch64"}
_PT_LOAD, _PT_DYNAMIC = 1, 2
_DT_NEEDED, _DT_STRTAB, _DT_SYMTAB, _DT_SONAME, _DT_VERNEED, _DT_VERNEEDNUM = 1, 5, 6, 14, 0x6FFFFFFE, 0x6FFFFFFF
_SHT_DYNSYM = 11
_LOCAL, _WEAK = 0, 2


def read(content: bytes) -> Binary:
    """A shared library of 64 bit, little-endian."""
    if content[4:6] != b"\x02\x01":
        raise ValueError("an ELF file that is not 64 bit, little-endian")
    machine = struct.unpack_from("<H", content, 18)[0]
    program_at, section_at = struct.unpack_from("<QQ", content, 32)
    entry, count, section_entry, section_count = struct.unpack_from("<4H", content, 54)
    segments = [struct.unpack_from("<IIQQQQ", content, program_at + i * entry) for i in range(count)]

    def offset(address: int) -> int:
        for kind, _, at, start, _, size in segments:
            if kind == _PT_LOAD and start <= address < start + size:
                return int(at + address - start)
        raise ValueError(f"address {address:#x} is in no segment")

    at, size = next((segment[2], segment[5]) for segment in segments if segment[0] == _PT_DYNAMIC)
    dynamic = [struct.unpack_from("<qQ", content, at + 16 * i) for i in range(size // 16)]
    tags = {tag: value for tag, value in reversed(dynamic)}
    strings, symbols_at = offset(tags[_DT_STRTAB]), offset(tags[_DT_SYMTAB])
    sections = [struct.unpack_from("<IIQQQQ", content, section_at + i * section_entry) for i in range(section_count)]
    symbols_size = next(section[5] for section in sections if section[1] == _SHT_DYNSYM)
    exported, imported = set(), set()
    for i in range(1, symbols_size // 24):
        name, info, _, section = struct.unpack_from("<IBBH", content, symbols_at + 24 * i)
        if info >> 4 == _LOCAL:
            continue
        if section:
            exported.add(text(content, strings + name))
        elif info >> 4 != _WEAK:  # the loader goes without a weak one
            imported.add(text(content, strings + name))
    return Binary(
        format="ELF",
        processor=_PROCESSORS.get(machine, f"machine {machine}"),
        exported=frozenset(exported),
        imported=frozenset(imported),
        libraries=tuple(text(content, strings + value) for tag, value in dynamic if tag == _DT_NEEDED),
        versions=_versions(content, strings, offset(tags[_DT_VERNEED]), tags[_DT_VERNEEDNUM])
        if _DT_VERNEED in tags
        else frozenset(),
        name=text(content, strings + tags[_DT_SONAME]) if _DT_SONAME in tags else "",
    )


def _versions(content: bytes, strings: int, at: int, files: int) -> frozenset[str]:
    result = set()
    for _ in range(files):
        _, count, _, first, following = struct.unpack_from("<HHIII", content, at)
        entry = at + first
        for _ in range(count):
            name, step = struct.unpack_from("<II", content, entry + 8)
            result.add(text(content, strings + name))
            entry += step
        at += following
    return frozenset(result)
