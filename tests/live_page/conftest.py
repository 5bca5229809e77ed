"""Browsers and pages that tests of pages share."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from feedsim import cli
from feedsim.simulation.cosim import fmus_directory
from page_browsers import FIREFOX, Firefox

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"


@pytest.fixture(scope="module")
def firefox(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Firefox]:
    if FIREFOX is None:
        pytest.skip("no Firefox on this machine (Debian: apt install firefox-esr)")
    try:
        found = Firefox(tmp_path_factory.mktemp("firefox"))
    except (OSError, RuntimeError) as error:
        pytest.skip(f"Firefox does not start here: {error}")
    yield found
    found.close()


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Pages of shipped scenarios."""
    if not (fmus_directory() / "machine.wasm").is_file():
        pytest.skip("no module of the machine (make page-module)")
    folder, found = tmp_path_factory.mktemp("pages"), {}
    for name in ("xz_circle", "z_positioning"):
        found[name] = folder / f"{name}.html"
        assert cli.main(["export", str(SCENARIOS / f"{name}.yaml"), "--out", str(found[name])]) == 0
    return found
