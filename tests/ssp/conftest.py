"""A short scenario, and the SSP file that is made of it."""

from __future__ import annotations

from pathlib import Path

import pytest

from feedsim import scenario
from feedsim.simulation import ssp
from ssp_helpers import short_scenario


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return short_scenario(tmp_path_factory.mktemp("scenario"))


@pytest.fixture(scope="module")
def exported(short: Path, fmus: Path) -> Path:
    out = short.with_suffix(".ssp")
    ssp.export(scenario.load(short), out, fmus=fmus)
    return out
