"""The other maker's archives, compiled once."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from foreign import acme


@dataclass(frozen=True)
class Libraries:
    """What the archives are made from; each test makes its own."""

    drive: bytes
    friction: bytes


@pytest.fixture(scope="session")
def libraries(tmp_path_factory: pytest.TempPathFactory) -> Libraries:
    folder = tmp_path_factory.mktemp("acme")
    return Libraries(acme.compiled(folder, "drive"), acme.compiled(folder, "friction"))
