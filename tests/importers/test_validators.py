"""What validators of other people say of the archives: nothing."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile

import pytest
from fmpy.validation import validate_fmu

from command_helpers import PATIENCE

UNITS = ("plant", "controller", "friction", "friction_gms", "setpoint", "machine")
# VDMCheck2 has its rules twice, written independently: what it calls with which class.
RULES = ("VDMCheckPlus", "VDMCheck")


@pytest.fixture(params=UNITS)
def archive(request: pytest.FixtureRequest, fmus: Path) -> Path:
    return fmus / f"{request.param}.fmu"


@pytest.fixture
def faulty(fmus: Path, tmp_path: Path) -> Path:
    """The friction unit with its output declared an input: a validator that says nothing of it says nothing at all."""
    path = tmp_path / "faulty.fmu"
    with ZipFile(fmus / "friction.fmu") as given, ZipFile(path, "w", ZIP_DEFLATED) as taken:
        for name in given.namelist():
            content = given.read(name)
            if name == "modelDescription.xml":
                assert b'causality="output"' in content
                content = content.replace(b'causality="output"', b'causality="input"')
            taken.writestr(name, content)
    return path


def test_fmpy(archive: Path) -> None:
    assert validate_fmu(str(archive)) == []


def test_fmpy_finds_a_fault(faulty: Path) -> None:
    assert validate_fmu(str(faulty)) != []


def _fmutool(archive: Path) -> str:
    tool = Path(sys.executable).with_name("fmutool")
    if not tool.is_file():
        pytest.skip("fmu-manipulation-toolbox is not installed")
    done = subprocess.run([tool, "-input", archive, "-check"], capture_output=True, text=True, timeout=PATIENCE)
    return done.stdout + done.stderr


def test_fmutool(archive: Path) -> None:
    said = _fmutool(archive)
    assert "compliant with FMI-2.0" in said
    assert "No semantic error" in said
    assert "WARNING" not in said
    assert "ERROR" not in said


def test_fmutool_finds_a_fault(faulty: Path) -> None:
    assert "No semantic error" not in _fmutool(faulty)


def _vdmcheck(archive: Path, rules: str, folder: Path) -> str:
    place = os.environ.get("FEEDSIM_IMPORTERS")
    jar = Path(place).resolve() / "vdmcheck" / "vdmcheck2.jar" if place else None
    if jar is None or not jar.is_file() or not shutil.which("java"):
        pytest.skip("VDMCheck2 is installed by `make test-importers` (Java and Maven)")
    command = ["java", "-cp", str(jar), rules, str(archive)]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=PATIENCE)
    return done.stdout + done.stderr


@pytest.mark.extensive
@pytest.mark.parametrize("rules", RULES)
def test_vdmcheck(archive: Path, rules: str, tmp_path: Path) -> None:
    said = [line for line in _vdmcheck(archive, rules, tmp_path).splitlines() if line]
    notes = ("Checking ", "FMU has no ", "Running ", "[")  # which files it looks at; on a slow machine, how to stop it
    assert {line for line in said if not line.startswith(notes)} == {"No errors found."}


@pytest.mark.extensive
@pytest.mark.parametrize("rules", RULES)
def test_vdmcheck_finds_a_fault(faulty: Path, rules: str, tmp_path: Path) -> None:
    assert "Errors found." in _vdmcheck(faulty, rules, tmp_path)
