"""What `make test-importers` does to a machine: nothing, unless it is asked to."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from importers import install, with_cargo

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def commands(monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """Root on a Debian without Java; commands that would be run."""
    found: list[list[str]] = []
    monkeypatch.setattr(shutil, "which", lambda name, path=None: f"/usr/bin/{name}" if name == "apt-get" else None)
    monkeypatch.setattr(os, "geteuid", lambda: 0, raising=False)
    monkeypatch.setattr(subprocess, "run", lambda words, **_: found.append(words))
    return found


def test_nothing_is_installed_unasked(
    commands: list[list[str]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert install.main(["--rust", str(tmp_path)]) == 0
    assert commands == []
    said = capsys.readouterr().out
    assert "java and mvn not found" in said
    assert "--system" in said
    for name in install.RUST:
        assert f"left out: {name}: cargo not found" in said


def test_what_is_missing_is_installed_when_asked(
    commands: list[list[str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(install, "LIBCLANG", ())
    monkeypatch.delenv("LIBCLANG_PATH", raising=False)
    assert install.main(["--system", "--rust", str(tmp_path)]) == 0
    assert {words[0] for words in commands} == {"apt-get"}
    assert set(install.PACKAGES.values()) <= {word for words in commands for word in words}


def test_cargo_builds_what_is_not_there_yet(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """By versions that do not move; a build that fails is said and is no failure."""
    made: list[list[str]] = []

    def refuse(words: list[str], **_: object) -> subprocess.CompletedProcess[str]:
        made.append(words)
        return subprocess.CompletedProcess(words, 101, "", "error: no such crate")

    there = lambda name, path=None: None if path else f"/usr/bin/{name}"  # noqa: E731
    monkeypatch.setattr(shutil, "which", there)
    monkeypatch.setattr(subprocess, "run", refuse)
    install.build(tmp_path)
    assert [words[:2] for words in made] == [["cargo", "install"]] * len(install.RUST)
    assert capsys.readouterr().out.count("error: no such crate") == len(install.RUST)
    made.clear()
    monkeypatch.setattr(shutil, "which", lambda name, path=None: f"/usr/bin/{name}")
    install.build(tmp_path)
    assert made == []


def test_a_build_without_libclang_names_its_package(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fault = subprocess.CompletedProcess([], 101, "", "Unable to find libclang: set the `LIBCLANG_PATH` variable")
    monkeypatch.setattr(shutil, "which", lambda name, path=None: None if path else f"/usr/bin/{name}")
    monkeypatch.setattr(subprocess, "run", lambda words, **_: fault)
    install.build(tmp_path)
    assert "Debian: libclang-dev" in capsys.readouterr().out


def test_versions_are_those_of_the_page() -> None:
    assert with_cargo.VERSIONS["fmi-sim"] in install.RUST["fmi-sim"]
    manifest = (ROOT / "tests" / "importers" / "rust" / "Cargo.toml").read_text(encoding="utf-8")
    assert f'fmu-runner = "={with_cargo.VERSIONS["fmu-runner"]}"' in manifest
    page = (ROOT / "docs" / "importing.md").read_text(encoding="utf-8")
    for name, version in with_cargo.VERSIONS.items():
        assert re.search(rf"\| `?{name}`? {re.escape(version)} ", page)


def test_only_continuous_integration_asks() -> None:
    lines = (ROOT / "Makefile").read_text(encoding="utf-8").splitlines()
    (line,) = [line for line in lines if "importers/install.py" in line]
    assert "--system" not in line
    assert "--rust" in line
    asked = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    assert "install.py --system build" in asked  # and no minutes of cargo
