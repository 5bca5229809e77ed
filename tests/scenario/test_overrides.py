"""Changes from outside: --set KEY=VALUE and the scenario's own `set` group."""

import re
from pathlib import Path

import pytest

from feedsim.foundation.errors import InputError
from feedsim.motions import Move
from feedsim.scenario import Friction, Scenario, load

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
Z = SCENARIOS / "z_positioning.yaml"


def first_feed(scenario: Scenario) -> float:
    motion = scenario.motions[0]
    assert isinstance(motion, Move)
    return motion.feed


def refusal(*overrides: str, path: Path = Z) -> str:
    with pytest.raises(InputError) as caught:
        load(path, overrides)
    return str(caught.value)


def write(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def test_values_of_scenario_and_machine() -> None:
    scenario = load(
        Z,
        [
            "motions.0.feed=3 m/min",
            "machine.axes.Z.friction.W=0 rad",
            "machine.axes.Z.drive.symmetry_lag=true",
            "machine.axes.Z.drive.filter_2={type: low_pass, f: 2 kHz, D_den: 0.7}",
            "coupling.substeps=2",
            "recording.variables=['Z.*', tool.x_Z]",
        ],
    )
    assert first_feed(scenario) == 0.05
    axis = scenario.machine.axes["Z"]
    assert axis.friction.W == 0
    assert axis.drive.symmetry_lag is True
    assert axis.drive.parameters()["filter_2.type"] == 2
    assert axis.drive.parameters()["filter_2.f"] == 2000
    assert scenario.coupling.substeps == 2
    assert scenario.recording.variables == ("Z.*", "tool.x_Z")
    assert scenario.overrides[0] == "motions.0.feed=3 m/min"


def test_the_last_one_counts_and_the_file_stays_as_it_is() -> None:
    before = Z.read_bytes()
    assert first_feed(load(Z, ["motions.0.feed=3 m/min", "motions.0.feed=1.2 m/min"])) == 0.02
    assert first_feed(load(Z)) == 5 / 60
    assert Z.read_bytes() == before


def test_star_stands_for_every_entry() -> None:
    scenario = load(Z, ["machine.axes.*.friction.W=0 rad"])
    assert [axis.friction.W for axis in scenario.machine.axes.values()] == [0, 0, 0]


def test_a_value_set_at_several_places_is_not_shared() -> None:
    scenario = load(
        Z,
        ["machine.axes.*.drive.filter_4={type: low_pass, f: 1 kHz, D_den: 1}", "machine.axes.X.drive.filter_4.f=2 kHz"],
    )
    assert [axis.drive.filter_4.f for axis in scenario.machine.axes.values()] == [2000, 1000, 1000]


def test_a_group_from_a_file_is_relative_to_the_working_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = "F_C: 1 N.m\nF_S: 1.5 N.m\nv_s: 1 rad/s\nsigma_0: 100 N.m/rad\nsigma_1: 0 N.m.s/rad\nsigma_2: 0 N.m.s/rad\n"
    write(tmp_path / "friction.yaml", text)
    monkeypatch.chdir(tmp_path)
    scenario = load(Z, ["machine.axes.Z.friction=friction.yaml", "machine.axes.Z.friction.F_S=2 N.m"])
    expected = Friction(F_C=1, F_S=2, v_s=1, sigma_0=100, sigma_1=0, sigma_2=0)
    assert scenario.machine.axes["Z"].friction == expected

    write(tmp_path / "friction.yaml", text.replace("1.5 N.m", "1.5 N"))
    message = refusal("machine.axes.Z.friction=friction.yaml")
    assert message.startswith("friction.yaml:2: machine.axes.Z.friction.F_S: '1.5 N' is a force; a torque is expected")
    assert "no such file: none.yaml" in refusal("machine.axes.Z.friction=none.yaml")


def test_set_group_comes_before_the_command_line_and_is_relative_to_its_file(tmp_path: Path) -> None:
    write(tmp_path / "filter.yaml", "{type: low_pass, f: 900 Hz, D_den: 0.5}\n")
    path = write(
        tmp_path / "s.yaml",
        f"name: s\nmachine: {SCENARIOS / 'machines' / 'test_centre'}\nmotions: [{{kind: dwell, duration: 1 s}}]\n"
        "set:\n  machine.axes.Z.friction.W: 0 rad\n  machine.axes.*.friction.gamma: 50 %\n"
        "  machine.axes.X.drive.filter_2: filter.yaml\n",
    )
    axes = load(path, ["machine.axes.Z.friction.gamma=1"]).machine.axes
    assert axes["Z"].friction.W == 0
    assert [axis.friction.gamma for axis in axes.values()] == [0.5, 0.5, 1]
    assert axes["X"].drive.filter_2.f == 900
    assert "s.yaml:5: machine.axes.Z.friction.W: '1 m' is a length" in _with(path, "W: 0 rad", "W: 1 m")
    assert "s.yaml:5: unknown key 'friktion' in machine.axes.Z; did you mean 'friction'?" in _with(
        path, "Z.friction", "Z.friktion"
    )
    assert "s.yaml:4: set: a group of KEY: VALUE is expected" in _with(path, "set:\n", "set: [1]\nnote:\n")


def _with(path: Path, old: str, new: str) -> str:
    changed = path.with_name("changed_s.yaml")
    write(changed, path.read_text().replace(old, new))
    return refusal(path=changed)


def test_another_machine_meets_the_scenarios_own_settings(tmp_path: Path) -> None:
    machine = (SCENARIOS / "machines" / "test_centre" / "machine.yaml").read_text()
    modes = SCENARIOS / "machines" / "test_centre" / "modes.csv"
    write(
        tmp_path / "other.yaml",
        machine.replace("modes: modes.csv", f"modes: {modes}")
        .replace("structure: structure.yaml", f"structure: {modes.with_name('structure.yaml')}")
        .replace("name: Test centre", "name: Other"),
    )
    path = write(
        tmp_path / "s.yaml",
        f"name: s\nmachine: {SCENARIOS / 'machines' / 'test_centre'}\nmotions: [{{kind: dwell, duration: 1 s}}]\n"
        "set: {machine.axes.Z.friction.W: 0 rad}\n",
    )
    scenario = load(path, [f"machine={tmp_path / 'other.yaml'}"])
    assert scenario.machine.name == "Other"
    assert scenario.machine.axes["Z"].friction.W == 0
    assert scenario.machine.directory == tmp_path


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("motions.0.feed", "--set motions.0.feed: KEY=VALUE is needed"),
        ("=5", "KEY=VALUE is needed"),
        ("motions.0.fed=1 m/s", "unknown key 'fed' in motions.0; did you mean 'feed'?"),
        ("motions.3.feed=1 m/s", "motions is a list; '3' is no entry of it (entries: 0 to 1)"),
        ("motions.-1.feed=1 m/s", "'-1' is no entry of it"),
        ("motions.0.feed.x=1", "motions.0.feed is '5000 mm/min', which has no 'x' inside"),
        ("machine.axes.Q.friction.W=0 rad", "machine.axes has no 'Q'; allowed: X, Y, Z"),
        ("machine.axes.Z.frction.W=0 rad", "unknown key 'frction' in machine.axes.Z; did you mean 'friction'?"),
        (
            "machine.axes.Z.friction.warm_time=20 min",
            "unknown key 'warm_time' in machine.axes.Z.friction; it belongs to the guide of the axis, "
            "guide: {share: 100 %, warm_time: ...}",
        ),
        ("machin.axes=1", "unknown key 'machin' in the scenario; did you mean 'machine'?"),
        ("motions.0.feed=5000 mm", "--set motions.0.feed=5000 mm: motions.0.feed: '5000 mm' is a length; a speed is"),
        ("machine.axes.Z.friction.F_S=1 N.m", "F_S 1 N.m is smaller than F_C 1.6 N.m"),
        ("machine.axes.Z.friction.W=-0.01 rad", "-0.01 rad is outside the allowed range: at least 0 rad"),
        ("machine.axes.Z.friction.gamma=1.5", "1.5 is outside the allowed range: from 0 to 1"),
        ("recording.variables=[*.x_a]", "text that begins with '*' needs quotes"),
        ("name={", "--set name={: "),
        ("machine.axes=", "machine.axes: nothing (null); a group of keys is expected"),
    ],
)
def test_messages(override: str, message: str) -> None:
    assert message in refusal(override)


def test_all_faulty_overrides_are_listed() -> None:
    message = refusal("motions.0.fed=1 m/s", "coupling.scheme=jacoby", "nonsense")
    assert "3 problems" in message
    assert "did you mean 'jacobi'?" in message


def test_a_file_of_values_counts_like_its_entries(tmp_path: Path) -> None:
    values = tmp_path / "values.yaml"
    values.write_text(
        "set:\n  machine.axes.Z.drive.K_v: 60 1/s\n"
        "  machine.axes.Z.drive.filter_1: {type: low_pass, f: 500 Hz, D_den: 0.7}\n"
    )
    singly = [
        "machine.axes.Z.drive.K_v=60 1/s", "machine.axes.Z.drive.filter_1={type: low_pass, f: 500 Hz, D_den: 0.7}",
    ]  # fmt: skip
    by_file, by_hand = load(Z, [str(values)]), load(Z, singly)
    assert by_file.machine == by_hand.machine
    assert load(Z, by_file.overrides).machine == by_hand.machine, "what a run writes down can be typed"
    assert load(Z, [str(values), "machine.axes.Z.drive.K_v=70 1/s"]).machine.axes["Z"].drive.K_v == 70
    assert any(file == values for _, file in by_file.files)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("set: {a: 1}\nname: x\n", "has to hold the group `set` with KEY: VALUE, and nothing else"),
        ("set: 3\n", "nothing else"), ("- 1\n", "nothing else"), ("", "the file is empty"),
        ("set:\n  machine.axes.Z.drive.K_vv: 3 1/s\n", "values.yaml:2: unknown key 'K_vv' in machine.axes.Z.drive"),
    ],
)  # fmt: skip
def test_files_of_values_that_are_none(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "values.yaml").write_text(text)
    with pytest.raises(InputError, match=re.escape(words)):
        load(Z, [str(tmp_path / "values.yaml")])
