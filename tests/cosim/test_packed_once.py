"""A machine with other axes than plant.fmu's is packed once per process, by what it is packed from."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from feedsim.scenario import load
from feedsim.simulation.cosim import plant

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def packs(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """The machines that are packed, one entry each time."""
    made: list[Path] = []
    original = plant.pack

    def counted(*given: object, **named: object) -> object:
        made.append(named["modes"])  # type: ignore[arg-type]
        return original(*given, **named)  # type: ignore[arg-type]

    monkeypatch.setattr(plant, "pack", counted)
    monkeypatch.setattr(plant, "_PACKED_ARCHIVES", {})
    return made


def guid(machine: Path, fmus: Path, *overrides: str) -> str:
    """Of the plant that a run of the machine would have."""
    scenario = load(ROOT / "scenarios" / "one_axis.yaml", [f"machine={machine}", *overrides])
    archive = plant.open_plant(scenario.machine, fmus)[0]
    archive.close()
    return archive.guid


def test_packed_once_by_content(packs: list[Path], fmus: Path, tmp_path: Path) -> None:
    folder = ROOT / "scenarios" / "machines" / "one_axis"
    first = guid(folder, fmus)
    assert guid(folder, fmus, "machine.axes.X.friction.W=0.01 rad") == first
    copied = tmp_path / "copy"
    shutil.copytree(folder, copied)
    assert guid(copied, fmus) == first
    assert len(packs) == 1
    # Another table under the same name is another plant.
    table = copied / "modes.csv"
    table.write_text(table.read_text().replace(",0.0", ",0.00", 1))
    assert guid(copied, fmus) != first
    assert len(packs) == 2
    assert guid(folder, fmus) == first
    assert len(packs) == 2


def test_bounded(packs: list[Path], fmus: Path) -> None:
    folder = ROOT / "scenarios" / "machines" / "one_axis"
    for i in range(plant.MAX_PACKED_PLANTS + 2):
        guid(folder, fmus, f"machine.name=M{i}")
    assert len(packs) == plant.MAX_PACKED_PLANTS + 2
    assert len(plant._PACKED_ARCHIVES) == plant.MAX_PACKED_PLANTS
    guid(folder, fmus, f"machine.name=M{plant.MAX_PACKED_PLANTS + 1}")  # one of the latest
    assert len(packs) == plant.MAX_PACKED_PLANTS + 2
