"""SSP files for tests: a short move exported, and altered as a text editor or another tool would."""

from __future__ import annotations

import tempfile
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path

from feedsim import scenario
from feedsim.simulation import cosim, ssp
from feedsim.simulation.judge import JudgedRun, judge_run

ROOT = Path(__file__).resolve().parents[1]
STRUCTURE = "SystemStructure.ssd"
UNPACKED = str(Path(tempfile.gettempdir()) / "feedsim-")  # how the folders begin that archives are unpacked to
SHORT = """
name: short move
machine: {machine}
motions:
  - {{kind: move, by: {{Z: 1 mm}}, feed: 3000 mm/min}}
  - {{kind: dwell, duration: 150 ms}}
recording: {{interval: 1 ms}}
evaluate:
  - {{kind: positioning, axis: Z, band: 1 um}}
set: {{machine.structure: null}}  # what other poses would change takes seconds
"""


def short_scenario(folder: Path, machine: str = "test_centre", text: str = SHORT) -> Path:
    file = folder / "short.yaml"
    file.write_text(text.format(machine=ROOT / "scenarios" / "machines" / machine), encoding="utf-8")
    return file


def export_short(folder: Path, fmus: Path) -> Path:
    """The short move as an SSP file in `folder`."""
    file = short_scenario(folder)
    out = file.with_suffix(".ssp")
    ssp.export(scenario.load(file), out, fmus=fmus)
    return out


def run_ssp(file: Path, *overrides: str) -> JudgedRun:
    """The scenario that an SSP file holds, run on the archives in it."""
    with ssp.open_system(file, overrides) as found:
        return judge_run(cosim.run(found.scenario, program=found.program, fmus=found.fmus))


def contents(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as package:
        return {name: package.read(name) for name in package.namelist()}


def write(path: Path, files: Mapping[str, bytes]) -> Path:
    """Another tool's zip: deflated, with today's date."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as package:
        for name, content in files.items():
            package.writestr(name, content)
    return path


def edited(path: Path, out: Path, name: str, *changes: tuple[str, str], count: int = 1) -> Path:
    """The SSP with texts in its file `name` replaced; each must be there."""

    def edit(text: str) -> str:
        for old, new in changes:
            assert old in text, f"{old!r} is not in {name}"
            text = text.replace(old, new, count)
        return text

    return altered(path, out, name, edit)


def altered(path: Path, out: Path, name: str, change: Callable[[str], str]) -> Path:
    files = contents(path)
    files[name] = change(files[name].decode("utf-8")).encode("utf-8")
    return write(out, files)
