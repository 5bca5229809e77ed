"""``feedsim export`` as a user meets it: what it writes, what it refuses, and nothing half-written."""

from __future__ import annotations

from pathlib import Path
from zipfile import ZipFile

import fmpy
import pytest

from feedsim import cli

ROOT = Path(__file__).resolve().parents[2]
SCENARIOS = ROOT / "scenarios"
Capture = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def _archives(fmus: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FEEDSIM_FMUS", str(fmus))


def run(*words: str | Path) -> int:
    return cli.main(["export", *map(str, words)])


def starts(archive: Path) -> dict[str, str | None]:
    return {each.name: each.start for each in fmpy.read_model_description(str(archive)).modelVariables}


def test_a_scenario_is_packed_with_its_motion(tmp_path: Path, capsys: Capture) -> None:
    out = tmp_path / "machine.fmu"
    change = "machine.axes.Z.drive.K_v=3 (m/min)/mm"
    assert run(SCENARIOS / "z_positioning.yaml", "--out", out, "--set", change) == 0
    said = capsys.readouterr().out
    assert "axes X, Y, Z; motion of 2.448 s inside; control cycle 125 us" in said
    assert said.splitlines()[1:] == [f"-> {out}"]
    description = fmpy.read_model_description(str(out))
    assert description.defaultExperiment.stopTime == "2.448"
    assert float(description.defaultExperiment.stepSize) == 1e-3
    assert description.modelName == "Z positioning"
    assert description.coSimulation.modelIdentifier == "machine"
    assert "Test centre; motion: Z positioning" in description.description
    found = starts(out)
    assert (found["motion.built_in"], found["Z.drive.K_v"]) == ("true", "50")
    assert (found["X.drive.K_p"], found["X.friction.F_C"]) == ("21.59", "2.4")
    assert fmpy.validation.validate_fmu(str(out)) == []


@pytest.mark.parametrize("words", [("machines/test_centre",), ("z_positioning.yaml", "--inputs")])
def test_a_machine_has_setpoints_as_inputs(tmp_path: Path, capsys: Capture, words: tuple[str, ...]) -> None:
    out = tmp_path / "machine.fmu"
    assert run(SCENARIOS / words[0], *words[1:], "--out", out) == 0
    assert "setpoints are inputs" in capsys.readouterr().out
    assert starts(out)["motion.built_in"] == "false"
    assert fmpy.read_model_description(str(out)).modelName == "Test centre"


def test_the_default_step_holds_no_setpoint_longer_than_the_drive(tmp_path: Path) -> None:
    """With the motion inside nothing is held, and 1 ms is enough for whoever looks; so it is in an SSP file."""
    out = tmp_path / "machine.fmu"
    fast = "machine.cycles.position=500 us"
    for words, step in ((("--inputs",), 0.5e-3), ((), 1e-3)):
        assert run(SCENARIOS / "z_positioning.yaml", *words, "--set", fast, "--out", out) == 0
        assert float(fmpy.read_model_description(str(out)).defaultExperiment.stepSize) == step
    ssp = tmp_path / "one.ssp"
    words = ["ssp", str(SCENARIOS / "z_positioning.yaml"), "--one", "--set", fast, "--out", str(ssp)]
    assert cli.main(words) == 0
    with ZipFile(ssp) as files:
        assert 'baseStepSize="0.001"' in files.read("SystemStructure.ssd").decode()


def test_the_same_bytes_again(tmp_path: Path) -> None:
    archives = [tmp_path / f"{name}.fmu" for name in "ab"]
    for out in archives:
        assert run(SCENARIOS / "one_axis.yaml", "--out", out) == 0
    assert archives[0].read_bytes() == archives[1].read_bytes()


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (("--set", "machine.axes.Z.drive.M_max=-1 N.m"), 2, "M_max"),
        (("--base", "plant.fmu"), 2, "has resources of the kind 'machine'"),
        (("--base", "missing.fmu"), 2, "missing.fmu"),
    ],
)
def test_what_cannot_be_packed_leaves_nothing(
    tmp_path: Path, fmus: Path, capsys: Capture, words: tuple[str, ...], code: int, said: str
) -> None:
    out = tmp_path / "machine.fmu"
    given = [fmus / word if word.endswith(".fmu") else word for word in words]
    assert run(SCENARIOS / "z_positioning.yaml", "--out", out, *given) == code
    assert said in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_is_not_there(tmp_path: Path, capsys: Capture) -> None:
    assert run(SCENARIOS / "one_axis.yaml", "--out", tmp_path / "no" / "machine.fmu") == 4
    assert "no such folder" in capsys.readouterr().err


def test_loads_are_never_inside(tmp_path: Path, capsys: Capture) -> None:
    text = (SCENARIOS / "z_positioning.yaml").read_text(encoding="utf-8")
    scenario, out = tmp_path / "loaded.yaml", tmp_path / "machine.fmu"
    load = "loads:\n  - {kind: tool, direction: Z, table: {time: [0 s, 1 s], values: [0 N, 5 N]}}\n"
    scenario.write_text(text.replace("machines/", f"{SCENARIOS}/machines/") + load, encoding="utf-8")
    for inputs in ([], ["--inputs"]):
        assert run(scenario, "--out", out, *inputs) == 2
        said = capsys.readouterr().err
        assert "loads.0: the load on the tool in Z does not go into the unit" in said
        assert "--set loads=[] packs it without, and its importer drives tool.F_Z" in said
    assert not out.exists()
    assert run(scenario, "--out", out, "--set", "loads=[]") == 0
    assert out.exists()
