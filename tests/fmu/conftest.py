"""The archives under test, unpacked once per session."""

from pathlib import Path

import pytest

from feedsim_packager import toolchain
from fmu.unpacked import UNITS, Archive, unpack


@pytest.fixture(scope="session", params=UNITS)
def unit(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="session")
def archive(unit: str, fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Archive:
    return unpack(unit, fmus, tmp_path_factory.mktemp(unit))


@pytest.fixture(scope="session")
def plant(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Archive:
    return unpack("plant", fmus, tmp_path_factory.mktemp("plant_alone"))


@pytest.fixture(scope="session")
def compiler() -> tuple[str, ...]:
    return toolchain.find_compiler()
