"""The Python of docs/importing.md runs as it stands there."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from feedsim import cli, scenario
from feedsim.files.trace import write_csv
from feedsim.simulation import cosim, ssp
from importers import document, with_ecos, z_move

pytestmark = pytest.mark.extensive

_PART = re.compile(r"^### (.+?)\n(.*?)(?=^##)", re.MULTILINE | re.DOTALL)
_CODE = re.compile(r"```python\n(.*?)```", re.DOTALL)
NEEDS = {"ecos": "ecospy", "libcosim": "libcosimpy", "FMPy": "fmpy", "fmucontainer": "fmu_manipulation_toolbox"}


def _snippets() -> dict[str, str]:
    parts = _PART.findall(document.PAGE.read_text(encoding="utf-8"))
    return {name: "\n".join(_CODE.findall(text)) for name, text in parts if name in NEEDS}


def test_there_is_one_for_each() -> None:
    assert set(_snippets()) == set(NEEDS)
    assert all(_snippets().values())


# What each prints last, after 1 s: Z [m]. In the SSP file it is on its way at 83.3 mm/s, so that a step more or less,
# which FMPy's sum of steps may make, is 10.4 um. The default table of setpoint.fmu has moved Z by 10 mm by then and
# rests; friction and a drive with another K_v leave less than 1 um.
STEP = 11e-6  # m
REST = 1e-6  # m


@pytest.mark.parametrize("name", NEEDS)
def test_it_runs(name: str, fmus: Path, tmp_path: Path) -> None:
    """In a folder with fmus/ and the Z move's SSP file."""
    try:
        if name == "ecos":
            with_ecos.load()
        __import__(NEEDS[name])
    except (ImportError, OSError) as error:
        pytest.skip(str(error))
    (tmp_path / "fmus").symlink_to(fmus)
    loaded = scenario.load(z_move.SCENARIO, ["coupling.scheme=parallel"])
    ssp.export(loaded, tmp_path / "z_positioning.ssp", fmus=fmus)
    code = _snippets()[name]
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    told = float(done.stdout.split()[-1])
    if name == "fmucontainer":
        assert abs(told - 0.11) < REST
    else:
        result = cosim.run(loaded, fmus=fmus)
        assert abs(told - np.interp(1.0, result.trace.time, result.trace["Z.x_a"])) < STEP
    if name == "ecos":
        write_csv(tmp_path / "reference.csv", result.trace)
        assert _compared(tmp_path) == 0


def _compared(folder: Path) -> int:
    """What the page's comparison of ecos with a run gives; the run, without its report, is folder/reference.csv."""
    (command,) = re.findall(r"(?ms)^feedsim (compare ecos\.csv .*?)\n```", document.PAGE.read_text(encoding="utf-8"))
    words = shlex.split(command.replace("\\\n", " "))
    assert words[2] == "results/z_parallel/result.csv"
    return cli.main([words[0], str(folder / words[1]), str(folder / "reference.csv"), *words[3:]])
