"""Judging executes nobody's program but the shipped ones: a library leaves a mark as soon as it is loaded. A run says
ahead what it will execute."""

from __future__ import annotations

import hashlib
import os
import subprocess
import zipfile
from pathlib import Path

import pytest

from feedsim import cli
from feedsim.simulation.cosim import exchange
from feedsim.simulation.cosim.archive import Archive, folders
from feedsim_packager import toolchain
from foreign import acme
from foreign.conftest import Libraries
from foreign.test_foreign_units import MOTION, ROOT, mapped
from ssp_helpers import contents, export_short, write

MARK = "FEEDSIM_TEST_MARK"
LOADED = f"""
#include <stdio.h>
#include <stdlib.h>
__attribute__((constructor)) static void loaded(void) {{
    FILE *file = getenv("{MARK}") ? fopen(getenv("{MARK}"), "w") : NULL;
    if (file) fclose(file);
}}
"""


@pytest.fixture(scope="module")
def marking(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """A library that leaves a mark when it is loaded."""
    folder = tmp_path_factory.mktemp("mark")
    (folder / "mark.c").write_text(LOADED, encoding="utf-8")
    out = folder / "mark.so"
    subprocess.run([*toolchain.find_compiler(), "-shared", "-fPIC", str(folder / "mark.c"), "-o", str(out)], check=True)
    return out.read_bytes()


@pytest.fixture
def mark(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(MARK, str(tmp_path / "mark"))
    return tmp_path / "mark"


@pytest.fixture
def scenario_file(tmp_path: Path, marking: bytes) -> Path:
    """The EMPS axis with a drive and a friction that leave marks, and a study of it."""
    for name, variables in (("drive", acme.DRIVE), ("friction", acme.FRICTION)):
        acme.archive(tmp_path / f"acme_{name}.fmu", name, marking, variables)
    settings = "".join(f"  {text.replace('=', ': ', 1)}\n" for text in mapped(tmp_path))
    text = MOTION.format(machine=ROOT / "scenarios" / "machines" / "emps") + f"set:\n{settings}"
    (tmp_path / "s.yaml").write_text(text, encoding="utf-8")
    study = (
        "name: s\nscenario: s.yaml\nparameters: {feed: {key: motions.0.feed, values: [3000 mm/min]}}\n"
        "sampling: {method: grid}\n"
    )
    (tmp_path / "study.yaml").write_text(study, encoding="utf-8")
    return tmp_path / "s.yaml"


@pytest.fixture
def marked_ssp(tmp_path: Path, fmus: Path, marking: bytes) -> Path:
    """An SSP whose archives say that they are the shipped ones, with other libraries."""
    file = export_short(tmp_path, fmus)
    files = contents(file)
    for name in [each for each in files if each.endswith(".fmu")]:
        inner = tmp_path / "inner.fmu"
        inner.write_bytes(files[name])
        own = {each: marking if each.startswith("binaries/") else content for each, content in contents(inner).items()}
        files[name] = write(inner, own).read_bytes()
    return write(tmp_path / "marked.ssp", files)


def test_a_scenario_is_judged_without_its_programs(
    scenario_file: Path, mark: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = ["--out", str(tmp_path / "exported.ssp")]
    for command in (["validate", scenario_file], ["validate", scenario_file.with_name("study.yaml")],
                    ["ssp", scenario_file, *out], ["validate", tmp_path / "exported.ssp"]):  # fmt: skip
        assert cli.main([str(part) for part in command]) == 0
        assert not mark.exists(), command
        out_said, said = capsys.readouterr()
        assert "study" in str(command[1]) or command[0] == "ssp" or "valid as far as no other maker's" in out_said
        for name in ("acme_drive.fmu", "acme_friction.fmu"):
            assert f"{name} itself says of its parameters, and whether it can be loaded" in said, said
        assert "executes" not in said.replace("only a run executes", "")


def test_what_the_archives_say_is_judged_all_the_same(
    scenario_file: Path, mark: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for setting, words in (
        ("machine.axes.X.drive.parameters.Kv=1001 1/s", "allowed: at least 0 1/s, at most 1000 1/s"),
        ("machine.axes.X.drive.inputs.x_a=PosAktual", "did you mean 'PosActual'?"),
        ("machine.axes.X.drive.parameters.Kv=3 kg", "the archive declares it in 1/s"),
    ):
        assert cli.main(["check", str(scenario_file), "--set", setting]) == 2
        assert words in capsys.readouterr().err
    platform = acme.archive(scenario_file.with_name("acme_drive.fmu"), "drive", b"", acme.DRIVE, platform="other")
    assert cli.main(["check", str(scenario_file)]) == 2
    assert f"{platform}: has no binary for this platform" in capsys.readouterr().err
    assert not mark.exists()


def test_an_ssp_with_other_programs_in_the_place_of_ours(
    marked_ssp: Path, mark: Path, marking: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["check", str(marked_ssp)]) == 0
    said = capsys.readouterr().err
    assert not mark.exists()
    for name in ("plant", "controller", "friction"):
        assert f"not checked: what {marked_ssp}: resources/{name}.fmu itself says" in said
    assert cli.main(["run", str(marked_ssp), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert mark.exists()
    with zipfile.ZipFile(marked_ssp) as package:
        digests = {n: hashlib.sha256(package.read(f"resources/{n}.fmu")).hexdigest() for n in ("plant", "friction")}
    for name, digest in digests.items():
        assert f"feedsim: executes {marked_ssp}: resources/{name}.fmu as " in said
        assert f": binaries/{folders()[0]}/{name}.so; SHA-256 {digest}\n" in said


def test_a_run_says_ahead_what_it_executes(
    scenario_file: Path, libraries: Libraries, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    acme.archive(tmp_path / "acme_drive.fmu", "drive", libraries.drive, acme.DRIVE)
    acme.archive(tmp_path / "acme_friction.fmu", "friction", libraries.friction, acme.FRICTION)
    assert cli.main(["run", str(scenario_file), "--out", str(tmp_path / "out"), "--quiet"]) == 0
    said = capsys.readouterr().err
    digest = hashlib.sha256((tmp_path / "acme_drive.fmu").read_bytes()).hexdigest()
    place = f"{tmp_path / 'acme_drive.fmu'} as drive of X: binaries/{folders()[0]}/drive.so"
    assert said.startswith(f"feedsim: executes {place}; SHA-256 {digest}\n"), said


def test_the_sum_is_of_the_whole_archive(libraries: Libraries, tmp_path: Path) -> None:
    """One wrapper's library executes whatever program lies in resources/."""
    sums = set()
    for program in ("print(1)", "print(2)"):
        path = acme.archive(tmp_path / "wrapped.fmu", "friction", libraries.friction, acme.FRICTION)
        with zipfile.ZipFile(path, "a") as package:
            package.writestr("resources/program.py", program)
        sums.add(exchange.describe_archive_programs(path, "friction of X")[0])
    assert len(sums) == 2


def test_what_is_not_executed_is_not_announced(
    scenario_file: Path, libraries: Libraries, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A run that is refused, and frequency responses in closed form, execute nothing."""
    acme.archive(tmp_path / "acme_drive.fmu", "drive", libraries.drive, acme.DRIVE)
    acme.archive(tmp_path / "acme_friction.fmu", "friction", libraries.friction, acme.FRICTION)
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "result.csv").write_text("of another program")
    assert cli.main(["run", str(scenario_file), "--out", str(tmp_path / "out"), "--quiet"]) == 4
    assert "executes" not in capsys.readouterr().err


def test_whose_programs_they_are(fmus: Path, tmp_path: Path) -> None:
    """The shipped ones by their bytes, under any name; not with another byte, nor with another file beside them."""
    shipped = contents(fmus / "plant.fmu")
    library = next(name for name in shipped if name.startswith(f"binaries/{folders()[0]}/"))
    beside = f"binaries/{folders()[0]}/libm.so.6"
    for changed, ours in (
        ({}, True),
        ({"resources/modes.csv": b""}, True),
        ({library: shipped[library] + b"\0"}, False),
        ({beside: b""}, False),
    ):
        with Archive(write(tmp_path / "other.fmu", {**shipped, **changed})) as archive:
            assert exchange.is_shipped(archive) == ours, changed.keys()
    named = tmp_path / "friction.fmu"
    os.link(tmp_path / "other.fmu", named)
    with Archive(named) as archive:
        assert not exchange.is_shipped(archive)


def test_archives_that_are_named_apart(
    fmus: Path, mark: Path, marking: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The base of a packed plant is tried, and the friction law called: both are said ahead where they are not ours."""
    shipped = contents(fmus / "plant.fmu")
    own = {name: marking if name.startswith("binaries/") else content for name, content in shipped.items()}
    base = write(tmp_path / "plant.fmu", own)
    machine = str(ROOT / "scenarios" / "machines" / "test_centre")
    cli.main(["export", "--plant", machine, "--base", str(base), "--out", str(tmp_path / "packed.fmu")])
    digest = hashlib.sha256(base.read_bytes()).hexdigest()
    said = capsys.readouterr().err
    assert f"executes {base} as the packed plant's trial: binaries/{folders()[0]}/plant.so; SHA-256 {digest}" in said
    assert exchange.describe_archive_programs(fmus / "friction.fmu", "friction law") == []
