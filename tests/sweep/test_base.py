"""A scenario that is read once gives what reading it anew gives: the same values, the same messages."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from feedsim.foundation.errors import InputError
from feedsim.scenario import Base, Change, load

ROOT = Path(__file__).resolve().parents[2]
SCENARIOS = [ROOT / "scenarios" / f"{name}.yaml" for name in ("z_positioning", "xz_circle", "z_measured")]


def change(key: str, text: str) -> Change:
    return Change(key, text, text)


CHANGES = [
    [],
    [change("machine.axes.*.friction.W", "0 rad")],
    [change("machine.axes.Z.friction.F_C", "1.25 N.m"), change("coupling.scheme", "jacobi")],
    [Change("coupling.substeps", "3", 3), change("recording.interval", "500 us")],
    [Change("coupling", "{scheme: jacobi, substeps: 2}", {"scheme": "jacobi", "substeps": 2})],
    [Change("recording.variables", "[Z.x_a, Z.M_a]", ["Z.x_a", "Z.M_a"])],
    [
        Change("motions", "[{kind: dwell, duration: 1 s}]", [{"kind": "dwell", "duration": "1 s"}]),
        Change("evaluate", "[]", []),
    ],
    [change("machine.axes.X.drive.K_v", "3 (m/min)/mm"), change("machine.axes.X.drive.K_v", "4 (m/min)/mm")],
]


@pytest.mark.parametrize("file", SCENARIOS, ids=lambda file: file.stem)
@pytest.mark.parametrize("sent", [False, True])
def test_as_load(file: Path, sent: bool) -> None:
    base = Base.read(file, ["machine.axes.Z.friction.sigma_2=0.005 N.m.s/rad"])
    base = Base.from_json(base.to_json()) if sent else base
    for changes in [*CHANGES, CHANGES[0]]:
        found = base.with_changes(changes)
        expected = load(file, [*base.draft.overrides, *(item.option for item in changes)])
        assert found == expected
        for name in ("file", "overrides", "settings", "files"):
            assert getattr(found, name) == getattr(expected, name), name
        assert found.at("motions", 0) == expected.at("motions", 0)
        assert found.machine.directory == expected.machine.directory


@pytest.mark.parametrize(
    "wrong",
    [
        change("machine.axes.Z.friction.F_CC", "1 N.m"),
        change("machine.axes.Z.friction.F_C", "-1 N.m"),
        change("machine.axes.Z.friction.F_C", "100 N.m"),
        change("recording.interval", "130 us"),
        change("machine", "no/such/machine"),
    ],
    ids=lambda wrong: wrong.option,
)
def test_messages_as_load(wrong: Change) -> None:
    file = SCENARIOS[0]
    base = Base.read(file)
    with pytest.raises(InputError) as expected:
        load(file, [wrong.option])
    for _ in range(2):  # what is wrong leaves no trace
        with pytest.raises(InputError) as found:
            base.with_changes([wrong])
        assert str(found.value) == str(expected.value)
    assert base.with_changes([]) == load(file)


def test_another_machine_meets_all_settings() -> None:
    file, machine = SCENARIOS[0], ROOT / "scenarios" / "machines" / "test_centre"
    settings = ["machine.axes.Z.friction.W=0 rad"]
    base = Base.read(file, settings)
    found = base.with_changes([change("machine", str(machine)), change("motions.0.feed", "1 m/min")])
    assert found == load(file, [*settings, f"machine={machine}", "motions.0.feed=1 m/min"])
    assert found.machine.axes["Z"].friction.W == 0.0


def test_data_files_elsewhere(tmp_path: Path) -> None:
    base = Base.read(SCENARIOS[2])
    assert {file.name for file in base.files} >= {"modes.csv", "z_setpoint.csv"}
    moved = {}
    for i, file in enumerate(base.files):
        moved[str(file)] = str(tmp_path / f"{i}{file.suffix}")
        shutil.copy(file, moved[str(file)])
    away = Base.from_json(base.to_json()).relocate(moved)
    assert {file.parent for file in away.files} == {tmp_path}
    assert away.with_changes(CHANGES[1]).machine.modes.file == Path(moved[str(base.scenario.machine.modes)])
    assert away.content({new: "x" for new in moved.values()}) == base.content({old: "x" for old in moved})


def test_content_tells_scenarios_apart(tmp_path: Path) -> None:
    first = Base.read(SCENARIOS[0])
    assert Base.read(SCENARIOS[0]).content({}) == first.content({})
    assert Base.read(SCENARIOS[0], ["motions.0.feed=4 m/min"]).content({}) != first.content({})
