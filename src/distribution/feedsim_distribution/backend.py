"""What pip calls (PEP 517): wheels and the source archive. An editable installation is left to setuptools.

Without a setting a wheel is for this machine, by its own compiler or, where it has none, by zig from PyPI.
`--config-settings platform=any` makes the one for all platforms, by zig; with `--config-settings archives=DIR` it takes
archives for all as they are.
"""

from collections.abc import Mapping
from pathlib import Path

from setuptools.build_meta import (
    build_editable,
    get_requires_for_build_editable,
    prepare_metadata_for_build_editable,
)

from feedsim_packager import toolchain
from feedsim_packager.errors import CompilerError, InputError

from . import sdist, shipped, wheel
from .project import configuration

__all__ = [
    "build_editable",
    "build_sdist",
    "build_wheel",
    "get_requires_for_build_editable",
    "get_requires_for_build_sdist",
    "get_requires_for_build_wheel",
    "prepare_metadata_for_build_editable",
]

Settings = Mapping[str, str] | None


def get_requires_for_build_sdist(config_settings: Settings = None) -> list[str]:
    """Nothing."""
    return []


def get_requires_for_build_wheel(config_settings: Settings = None) -> list[str]:
    """A compiler, where the machine has none that will do."""
    groups = configuration()["dependency-groups"]
    needed = [group for group in groups["build"] if not group.startswith("setuptools")]
    try:
        if not (config_settings or {}).get("platform"):
            toolchain.find_compiler()
            return needed
    except CompilerError:
        pass
    return [*needed, *groups["zig"]]


def build_sdist(sdist_directory: str, config_settings: Settings = None) -> str:
    """The source archive."""
    return sdist.write(Path(sdist_directory))


def build_wheel(wheel_directory: str, config_settings: Settings = None, metadata_directory: str | None = None) -> str:
    """A wheel, for this machine or all platforms."""
    asked = config_settings or {}
    if platform := asked.get("platform"):
        if platform != shipped.ANY:
            raise InputError(f"platform {platform}: no wheel is made for it; there is {shipped.ANY}, for all platforms")
        archives = Path(asked["archives"]) if "archives" in asked else None
        made = shipped.for_every_machine(shipped.zig(), archives)
    else:
        made = shipped.for_this_machine(toolchain.find_compiler())
    return wheel.write(Path(wheel_directory), made)
