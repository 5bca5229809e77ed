"""``feedsim machine build``, ``info`` and ``view`` as a user meets them: files, messages, and nothing half-written."""

from __future__ import annotations

import itertools
import json
import shlex
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from feedsim import cli, scenario
from feedsim.analysis import evaluate
from feedsim.simulation import cosim
from feedsim.simulation.judge import judge_run
from feedsim.structure import read_modes
from feedsim.structure.pose_change import table_mismatch

ROOT = Path(__file__).resolve().parents[2]
TEST_CENTRE, ONE_AXIS = (ROOT / "scenarios" / "machines" / name for name in ("test_centre", "one_axis"))
MATRICES, CALCULIX = (ROOT / "scenarios" / "structures" / name for name in ("matrix_market", "calculix"))
Capture = pytest.CaptureFixture[str]


@pytest.fixture
def machine(tmp_path: Path) -> Path:
    """A copy of the one-axis machine, to be changed."""
    folder = tmp_path / "my machine"
    shutil.copytree(ONE_AXIS, folder)
    return folder


def change(file: Path, old: str, new: str) -> None:
    text = file.read_text(encoding="utf-8")
    assert old in text
    file.write_text(text.replace(old, new, 1), encoding="utf-8")


def line_of(file: Path, text: str) -> int:
    return next(i for i, line in enumerate(file.read_text(encoding="utf-8").splitlines(), 1) if text in line)


def run(*words: str | Path) -> int:
    return cli.main(["machine", *map(str, words)])


def export(*words: str | Path) -> int:
    return cli.main(["export", "--plant", *map(str, words)])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--inputs"], "--inputs: --plant has no motion to leave out"),
        (["--fmus", "nowhere"], "--fmus: no such folder: nowhere"),
        (["--fmus", "."], "plant.fmu"),
    ],
)
def test_options_of_the_plant_are_taken_or_refused(
    words: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    monkeypatch.chdir(tmp_path)
    assert export(TEST_CENTRE, "--out", tmp_path / "plant.fmu", *words) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "plant.fmu").exists()


def test_build_as_documented(tmp_path: Path, capsys: Capture) -> None:
    out = tmp_path / "deep" / "out"
    assert run("build", TEST_CENTRE, "--at", "X=800mm", "Y=327mm", "Z=100mm", "--out", out) == 0
    said = capsys.readouterr()
    assert said.err == ""
    assert said.out.startswith("Test centre at X 800 mm, Y 327 mm, Z 100 mm: 615 degrees of freedom, 3 rigid and 90 ")
    assert said.out.splitlines()[1:] == [f"-> {out / 'modes.csv'}"]
    assert sorted(path.name for path in out.iterdir()) == ["build.json", "modes.csv"]
    axes = ["X", "Y", "Z"]
    built, shipped = read_modes(out / "modes.csv", axes), read_modes(TEST_CENTRE / "modes.csv", axes)
    assert built.frequency == pytest.approx(shipped.frequency, rel=1e-6)
    elastic = shipped.frequency > 0
    for first, second in itertools.combinations_with_replacement(shipped.ports, 2):
        products, given = ((modes.ports[first] * modes.ports[second]) for modes in (built, shipped))
        size = np.abs(given[elastic]).max()
        # of the largest product of the pair; a rigid basis is arbitrary, its sum is not
        assert products[elastic] == pytest.approx(given[elastic], abs=1e-6 * size, rel=0)
        assert products[~elastic].sum() == pytest.approx(given[~elastic].sum(), abs=1e-6 * max(size, 1e-12))
    assert (out / "modes.csv").read_text().splitlines()[0] == (TEST_CENTRE / "modes.csv").read_text().splitlines()[0]
    record = json.loads((out / "build.json").read_text(encoding="utf-8"))
    assert record["total_mass"]["value"] == pytest.approx(9061.64, abs=0.005)
    assert record["pose"]["Y"] == {"value": 0.327, "unit": "m"}
    assert record["axes"]["Z"]["J_inf"]["value"] == pytest.approx(0.00754, abs=5e-6)
    assert "rocking about X" in record["modes"][3]["moves"]
    assert record["solution"]["degrees_of_freedom"] == 615
    assert [file["role"] for file in record["inputs"]] == ["machine", "structure"]
    assert "synthetic" in record["note"].lower()


def test_build_elsewhere_and_differently(tmp_path: Path, capsys: Capture) -> None:
    """Another pose, another cut-off, static correction; axes that are not named stay where the machine has them."""
    assert run("build", ONE_AXIS, "--at", "X=0.5 m", "--cutoff", "250Hz", "--static-correction", "--out", tmp_path) == 0
    assert "X 500 mm" in capsys.readouterr().out
    record = json.loads((tmp_path / "build.json").read_text(encoding="utf-8"))
    frequency = read_modes(tmp_path / "modes.csv", ["X"]).frequency
    pseudo = record["solution"]["pseudo_modes"]
    assert pseudo == 4  # a torque and three tool forces
    assert frequency[-pseudo - 1] <= 250 < frequency[-pseudo]
    assert run("build", TEST_CENTRE, "--at", "X=1m", "--quiet", "--out", tmp_path) == 0
    assert capsys.readouterr().out == ""
    record = json.loads((tmp_path / "build.json").read_text(encoding="utf-8"))
    assert {axis: each["value"] for axis, each in record["pose"].items()} == {"X": 1.0, "Y": 0.327, "Z": 0.1}


def test_build_before_there_is_a_table_of_modes(machine: Path, tmp_path: Path, capsys: Capture) -> None:
    (machine / "modes.csv").unlink()
    assert run("build", machine, "--out", machine) == 0, capsys.readouterr().err
    assert (machine / "modes.csv").is_file()
    assert scenario.load_machine(machine).modes.file == machine / "modes.csv"
    # Nor need the rest of the machine be there.
    (machine / "machine.yaml").write_text("name: Begun\nstructure: structure.yaml\npose: {X: 100 mm}\n")
    (machine / "modes.csv").unlink()
    assert run("build", machine / "machine.yaml", "--out", machine) == 0, capsys.readouterr().err
    assert "Begun at X 100 mm" in capsys.readouterr().out
    assert run("info", machine) == 0
    assert "The machine file is not complete: " in capsys.readouterr().out


@pytest.mark.parametrize("source", [ONE_AXIS / "structure.yaml", ONE_AXIS, MATRICES, CALCULIX / "structure.yaml"])
def test_build_from_any_source(source: Path, tmp_path: Path, capsys: Capture) -> None:
    at = ["--at", "X=100mm"] if source.parent == ONE_AXIS else []
    assert run("build", source, *at, "--out", tmp_path) == 0, capsys.readouterr().err
    axes = ["X", "Y", "Z"] if source == MATRICES else ["X"]
    modes = read_modes(tmp_path / "modes.csv", axes)
    assert np.count_nonzero(modes.rigid) == len(axes)


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["--at", "X=5m"], 2, ["X at 5 m is outside its travel, 0 to 0.6 m"]),
        (["--at", "X=5kg"], 2, ["--at X=5kg: '5kg' is a mass"]),
        (["--at", "X:5mm"], 2, ["--at X:5mm: AXIS=POSITION is needed"]),
        (["--at", "X=5mm", "X=6mm"], 2, ["--at X=6mm: X is given twice"]),
        (["--at", "U=5mm"], 2, ["'U'", "X"]),
        (["--cutoff", "250"], 2, ["--cutoff 250: 250 has no unit"]),
        (["--cutoff", "0Hz"], 2, ["--cutoff 0Hz: more than zero is needed"]),
    ],
)
def test_build_refuses(arguments: list[str], code: int, words: list[str], tmp_path: Path, capsys: Capture) -> None:
    out = tmp_path / "out"
    assert run("build", ONE_AXIS, *arguments, "--out", out) == code
    said = capsys.readouterr()
    assert said.out == ""
    for word in words:
        assert word in said.err
    assert not out.exists()


def test_build_leaves_a_place_that_cannot_be_written(tmp_path: Path, capsys: Capture) -> None:
    blocker = tmp_path / "file"
    blocker.write_text("keep me")
    assert run("build", ONE_AXIS, "--out", blocker / "out") == 4
    assert str(blocker) in capsys.readouterr().err
    assert blocker.read_text() == "keep me"
    (tmp_path / "out" / "build.json").mkdir(parents=True)
    assert run("build", ONE_AXIS, "--out", tmp_path / "out") == 4
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["build.json"]


def test_a_structure_that_cannot_be_solved_writes_nothing(machine: Path, tmp_path: Path, capsys: Capture) -> None:
    data = yaml.safe_load((machine / "structure.yaml").read_text(encoding="utf-8"))
    del data["bodies"]["base"]["mounts"]
    (machine / "structure.yaml").write_text(yaml.safe_dump(data, sort_keys=False), encoding="utf-8")
    assert run("build", machine, "--out", tmp_path / "out") == 2
    assert "rigid" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("old", "new", "theirs", "words"),
    [
        ("pitch: 10 mm", "pitch: 12 mm", "pitch: 10 mm", ["axes.X.pitch: 12 mm", "axes.X.drive.pitch: 10 mm"]),
        ("travel: [0 mm, 600 mm]", "travel: [0 mm, 500 mm]", "travel: [0 mm", ["0 to 500 mm", "0 to 600 mm"]),
    ],
)
def test_machine_and_structure_that_contradict(
    old: str, new: str, theirs: str, words: list[str], machine: Path, tmp_path: Path, capsys: Capture
) -> None:
    mine, structure = machine / "machine.yaml", machine / "structure.yaml"
    change(mine, old, new)
    for command in (["build", machine, "--out", tmp_path / "out"], ["info", machine]):
        assert run(*command) == 2
        error = capsys.readouterr().err
        for word in (*words, f"{mine}:{line_of(mine, new)}: ", f"{structure}:{line_of(structure, theirs)}: "):
            assert word in error
    assert not (tmp_path / "out").exists()


def test_axes_of_other_names_contradict(machine: Path, tmp_path: Path, capsys: Capture) -> None:
    data: Any = yaml.safe_load((machine / "machine.yaml").read_text(encoding="utf-8"))
    data["pose"], data["axes"] = {"U": "0.3 m"}, {"U": data["axes"]["X"]}
    (machine / "machine.yaml").write_text(yaml.safe_dump(data), encoding="utf-8")
    assert run("build", machine, "--out", tmp_path / "out") == 2
    error = capsys.readouterr().err
    assert "axes: U; " in error
    assert "axes: X (other axes)" in error


def test_the_next_step_of_a_report_can_be_typed(machine: Path, tmp_path: Path, capsys: Capture) -> None:
    """It names a mode that is not rigid, and where its pictures go."""
    assert run("view", machine, "--out", tmp_path / "out", "--quiet") == 0
    words = shlex.split(json.loads((tmp_path / "out" / "summary.json").read_text())["next"]["command"])
    assert words[:3] == ["feedsim", "machine", "view"]
    assert Path(words[words.index("--out") + 1]) == tmp_path / "out"
    modes, lowest = read_modes(machine / "modes.csv", ["X"]), int(words[words.index("--mode") + 1])
    assert modes.frequency[lowest] > 0
    assert modes.frequency[lowest - 1] == 0
    capsys.readouterr()


def test_no_structure_no_build(machine: Path, tmp_path: Path, capsys: Capture) -> None:
    change(machine / "machine.yaml", "structure: structure.yaml", "# none")
    assert run("build", machine, "--out", tmp_path / "out") == 2
    assert "has no key structure" in capsys.readouterr().err
    assert run("view", machine, "--out", tmp_path / "out") == 2
    assert "a picture needs a structure file" in capsys.readouterr().err
    assert run("info", machine, "--at", "X=100mm") == 2
    assert "--at: " in capsys.readouterr().err
    (machine / "modes.csv").unlink()
    assert run("info", machine) == 2
    error = capsys.readouterr().err
    assert "modes: no such file" in error
    assert "no key structure" in error
    assert run("info", tmp_path) == 2
    assert "no machine.yaml and no structure.yaml in this folder" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_where_the_axes_stand_must_be_said(tmp_path: Path, capsys: Capture) -> None:
    assert run("build", ONE_AXIS / "structure.yaml", "--out", tmp_path / "out") == 2
    assert "nothing says where axis X stands" in (error := capsys.readouterr().err)
    assert "--at X=300mm" in error


def test_info_text(capsys: Capture) -> None:
    assert run("info", TEST_CENTRE, "--modes", "6") == 0
    text = capsys.readouterr().out
    lines = text.splitlines()
    assert lines[0] == "Test centre at X 800 mm, Y 327 mm, Z 100 mm"
    assert "made up to be credible" in lines[1]
    assert "615 degrees of freedom, total mass 9061.64 kg" in text
    row = next(line.split() for line in lines if line.startswith("Z  "))
    assert [float(cell) for cell in row[1:]] == pytest.approx(
        [20, 435, 0.00441, 0.01639, 0.00754, 2 * 0.00754 / 125e-6], rel=2e-3
    )
    assert "sigma_1 + sigma_2 = 0.806 N.m.s/rad, 0.67 % of 2 J_inf/h" in text
    assert "21.085" in text
    assert "rocking about X" in text
    assert "and 87 more up to 986.6 Hz" in text
    assert "dropped: 522 modes above 1000 Hz" in text


def test_info_json_of_machine_scenario_and_table(machine: Path, capsys: Capture) -> None:
    def info(*words: str | Path) -> Any:
        assert run("info", *words, "--json") == 0
        return json.loads(capsys.readouterr().out)

    built = info(machine)
    assert [file["role"] for file in built["inputs"]] == ["machine", "structure", "modes"]
    of_scenario = info(ROOT / "scenarios" / "one_axis.yaml")
    assert of_scenario["axes"] == built["axes"]
    change(machine / "machine.yaml", "structure: structure.yaml", "# none")
    table = info(machine)
    assert table["total_mass"]["value"] is None
    assert table["solution"] is None
    assert table["axes"]["X"]["J_inf"]["value"] == pytest.approx(built["axes"]["X"]["J_inf"]["value"], rel=1e-6)
    assert table["axes"]["X"]["friction_slope"] == built["axes"]["X"]["friction_slope"]
    halved = info(machine, "--step", "62.5 us")
    limit = table["axes"]["X"]["coupling_limit"]["value"]
    assert halved["axes"]["X"]["coupling_limit"]["value"] == pytest.approx(2 * limit)


def test_info_refuses(capsys: Capture) -> None:
    for arguments, words in (
        (["--modes", "few"], "--modes few: a whole number, or all, is needed"),
        (["--step", "5 mm"], "--step 5 mm: '5 mm' is a length"),
        (["--at", "X=-1mm"], "outside its travel"),
    ):
        assert run("info", ONE_AXIS, *arguments) == 2
        assert words in capsys.readouterr().err


def test_info_tells_of_a_table_that_is_not_the_structures(machine: Path, capsys: Capture) -> None:
    change(machine / "structure.yaml", "mass: 40 kg", "mass: 60 kg")
    assert run("info", machine) == 0
    said = capsys.readouterr()
    assert "modes.csv is not what" in said.err
    assert "Build it anew" in said.err
    # Where other modes are asked for, the table is another one anyway; and what is built is the new table.
    for words in (
        ["info", machine, "--at", "X=100mm"],
        ["build", machine, "--out", machine, "--force"],
        ["info", machine],
    ):
        assert run(*words) == 0
        assert capsys.readouterr().err == ""


def test_one_axis_machine_runs(fmus: Path) -> None:
    """Stable, without warnings, and with an overshoot that a positioning table may have."""
    result = judge_run(cosim.run(scenario.load(ROOT / "scenarios" / "one_axis.yaml"), fmus=fmus))
    figures = evaluate(result)
    assert result.warnings == ()
    assert figures["X.overshoot"].unit == "um"
    assert 0 < figures["X.overshoot"].value < 20
    assert figures["X.settling_time"].unit == "ms"
    assert figures["X.settling_time"].value < 200
    assert result.trace["X.x_a"][-1] == pytest.approx(0.4, abs=1e-6)


@pytest.mark.parametrize(
    ("poses", "words"),
    [
        ("Z=1m", "1 cell does not follow"),
        ("Z=300mm..400mm/20mm", "the machine stands at Z 100 mm, outside of the grid, 300 mm to 400 mm"),
        ("Z=0.1mm", "6850 cells of about 93 modes"),
    ],
)
def test_grids_that_would_not_follow_are_refused(tmp_path: Path, capsys: Capture, poses: str, words: str) -> None:
    assert export(TEST_CENTRE, "--poses", poses, "--out", tmp_path / "a.fmu") == 2
    assert words in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_an_archive_needs_a_name(tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder.fmu").mkdir()
    assert export(TEST_CENTRE, "--out", "folder.fmu") == 4
    assert "the name of a file is needed" in capsys.readouterr().err
    assert export(TEST_CENTRE, "--out", ".") == 2
    assert "the name must end in .fmu, .ssp, .html" in capsys.readouterr().err
    assert not list((tmp_path / "folder.fmu").iterdir())


def test_a_table_of_another_pose_is_not_packed_and_warned_of(tmp_path: Path, capsys: Capture) -> None:
    folder = tmp_path / "moved"
    shutil.copytree(TEST_CENTRE, folder)
    change(folder / "machine.yaml", "Z: 100 mm}", "Z: 400 mm}")
    assert export(folder, "--out", tmp_path / "a.fmu") == 2
    said = capsys.readouterr().err
    assert "is not that of the pose X 0.8 m, Y 0.327 m, Z 0.4 m" in said
    assert "--at X=800mm Y=327mm Z=400mm" in said
    assert table_mismatch(scenario.load_machine(folder)) is not None
    assert table_mismatch(scenario.load_machine(TEST_CENTRE)) is None
    # A table with static correction, of that pose, is as good.
    out = tmp_path / "corrected"
    assert run("build", folder, "--at", "Z=400mm", "--static-correction", "--out", out) == 0
    shutil.copy(out / "modes.csv", folder / "modes.csv")
    assert table_mismatch(scenario.load_machine(folder)) is None
