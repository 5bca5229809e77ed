"""Platforms that an archive can hold a binary for, and how zig names them."""

import platform
from dataclasses import dataclass

from .errors import CompilerError, InputError

# Oldest glibc the Linux binaries shall run with. zig links against any version; gcc and clang against the host's, where
# exp, log and pow bind to GLIBC_2.29 since their re-implementation there.
OLDEST_GLIBC = "2.17"
# Oldest macOS: the first that runs on Apple's own processors. The libraries ask for no function younger than that.
OLDEST_MACOS = "11.0"


@dataclass(frozen=True)
class Target:
    """A platform: its folder under binaries/, the library's suffix, its names for zig. Several names are processors
    that share one file (universal, Mach-O only), in the order in which they stand in it."""

    folder: str
    suffix: str
    zig: tuple[str, ...]

    @property
    def ending(self) -> str:
        """Of a library that lies beside those of all platforms: Linux has two, whose suffix is the same."""
        return f"-aarch64{self.suffix}" if self.folder == "aarch64-linux" else self.suffix


_MAC_X86_64 = f"x86_64-macos.{OLDEST_MACOS}"
_MAC_ARM64 = f"aarch64-macos.{OLDEST_MACOS}"

# FMI 2.0 names x86-64 folders; other processors use the tuples of FMI 3.0. Importers on a Mac with a processor of
# either sort look into darwin64 (FMPy) or into the tuple's folder, hence the universal file and the other.
LINUX64 = Target("linux64", ".so", (f"x86_64-linux-gnu.{OLDEST_GLIBC}",))
WIN64 = Target("win64", ".dll", ("x86_64-windows-gnu",))
DARWIN64 = Target("darwin64", ".dylib", (_MAC_X86_64, _MAC_ARM64))
AARCH64_LINUX = Target("aarch64-linux", ".so", (f"aarch64-linux-gnu.{OLDEST_GLIBC}",))
AARCH64_DARWIN = Target("aarch64-darwin", ".dylib", (_MAC_ARM64,))
ALL = {target.folder: target for target in (LINUX64, WIN64, DARWIN64, AARCH64_LINUX, AARCH64_DARWIN)}

# A host's own compiler makes its own processor's code only, in darwin64 as well.
_HOSTS = {
    ("Linux", "x86_64"): LINUX64,
    ("Linux", "aarch64"): AARCH64_LINUX,
    ("Darwin", "x86_64"): Target("darwin64", ".dylib", (_MAC_X86_64,)),
    ("Darwin", "arm64"): AARCH64_DARWIN,
    ("Windows", "AMD64"): WIN64,
}


def host_target() -> Target:
    """The platform this runs on; CompilerError where FMI has no name for it."""
    host = (platform.system(), platform.machine())
    if host not in _HOSTS:
        known = ", ".join(" ".join(entry) for entry in _HOSTS)
        raise CompilerError(f"no binaries folder is known for {' '.join(host)} (known: {known})")
    return _HOSTS[host]


def named(text: str) -> tuple[Target, ...]:
    """Targets of a list such as "linux64,win64", or of "all"; each once, in the order given."""
    folders = list(dict.fromkeys(part.strip() for part in text.split(",") if part.strip()))
    if folders == ["all"]:
        return tuple(ALL.values())
    unknown = [folder for folder in folders if folder not in ALL]
    if unknown or not folders:
        raise InputError(f"--platforms {text}: no platform '{', '.join(unknown)}' (known: {', '.join(ALL)}, or all)")
    return tuple(ALL[folder] for folder in folders)
