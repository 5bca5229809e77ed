"""What `make test-importers` does to a machine: nothing, unless it is told to."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from importers import install

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def commands(monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """Root on a Debian without Java; commands that would be run."""
    found: list[list[str]] = []
    monkeypatch.setattr(shutil, "which", lambda name: f"/usr/bin/{name}" if name == "apt-get" else None)
    monkeypatch.setattr(os, "geteuid", lambda: 0, raising=False)
    monkeypatch.setattr(subprocess, "run", lambda words, **_: found.append(words))
    return found


def test_nothing_is_installed_unasked(
    commands: list[list[str]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert install.main([str(tmp_path)]) == 0
    assert commands == []
    said = capsys.readouterr().out
    assert "java and mvn not found" in said
    assert "--system" in said


def test_java_and_maven_are_installed_when_asked(commands: list[list[str]], tmp_path: Path) -> None:
    assert install.main(["--system", str(tmp_path)]) == 0
    assert [words[0] for words in commands] == ["apt-get", "apt-get"]
    assert set(install.PACKAGES.values()) <= set(commands[-1])


def test_only_continuous_integration_asks() -> None:
    lines = (ROOT / "Makefile").read_text(encoding="utf-8").splitlines()
    (line,) = [line for line in lines if "importers/install.py" in line]
    assert "--system" not in line
