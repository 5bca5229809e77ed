"""What real-time targets need of doStep: no memory, no locks that wait, no call of the operating system."""

import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import worst_case

import fmi_helpers
from feedsim.simulation.cosim.archive import Archive
from fmu.unpacked import UNITS

pytestmark = pytest.mark.skipif(
    not sys.platform.startswith("linux") or not shutil.which("cc"), reason="needs Linux and its C compiler"
)


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return worst_case.compile_harness(tmp_path_factory.mktemp("worst_case"))


@pytest.mark.parametrize("unit", UNITS)
def test_steps_call_nothing_of_the_operating_system(unit: str, fmus: Path, program: Path, tmp_path: Path) -> None:
    """A second with all system calls forbidden: the kernel kills the process at the first one. Memory the C library
    would have had in stock is counted by the callbacks; the units have no other way to ask for it."""
    given = worst_case.case_of(unit)
    with Archive(fmus / f"{unit}.fmu") as archive:
        worst_case.write_script(tmp_path / "script.txt", given, archive)
        lines = worst_case.run(program, "confined", worst_case.library(archive, unit), tmp_path / "script.txt", 1)
        assert lines == ["stepped 0"]
        with pytest.raises(subprocess.CalledProcessError) as caught:  # a call of the system is noticed
            worst_case.run(program, "confined", worst_case.library(archive, unit), tmp_path / "script.txt", 0)
    assert caught.value.returncode == -signal.SIGKILL


def test_a_crossing_of_poses_calls_nothing_either(fmus: Path, program: Path, tmp_path: Path) -> None:
    given = worst_case.with_poses(tmp_path, 4, fmus)
    assert given.archive is not None
    with Archive(given.archive) as archive:
        worst_case.write_script(tmp_path / "script.txt", given, archive)
        binary = worst_case.library(archive, "plant")
        assert worst_case.run(program, "confined", binary, tmp_path / "script.txt", 1) == ["stepped 0"]
    again = fmi_helpers.Archive.unpack(given.archive, tmp_path / "again")
    with again.instance(given.parameters, inputs={name: values[0] for name, values in given.inputs.items()}) as unit:
        unit.run(worst_case.H, list(given.inputs), np.column_stack(list(given.inputs.values())), ["Z.x_a"])
        assert unit.fmu.getInteger(unit.references(["pose.crossings"]))[0] >= 3
