"""Machines with other axes than those of the default one run without a compiler, packed by hand or by themselves."""

from __future__ import annotations

import json
import shutil
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from feedsim import cli, scenario
from feedsim.files.fields import FileContent
from feedsim.foundation.errors import InputError, OutputError
from feedsim.scenario import load_machine
from feedsim.scenario.structure_checks import load_structure
from feedsim.simulation import cosim
from feedsim.simulation.cosim.archive import Archive
from feedsim.simulation.cosim.plant import axes_of, modes_file, open_plant
from feedsim.structure import read_modes
from feedsim.structure.build import build
from feedsim.structure.modes import write_modes
from feedsim.structure.pack import pack
from machine_helpers import write_machine, write_scenario

MACHINE = Path(__file__).resolve().parents[2] / "scenarios" / "machines" / "test_centre"
MOVE = {"by": "20 mm", "feed": "3000 mm/min"}
MACHINES = {
    "one axis": {"Q": 0.1},
    "two axes with long names": {"carriage_left": 0.1, "b2": 0.2},
    "five axes": {"X": 0.5, "Y": 0.3, "Z": 0.1, "U": 0.2, "W": 0.4},
    "other order": {"Z": 0.1, "X": 0.5, "Y": 0.3},
}


def table_in(folder: Path) -> FileContent:
    return FileContent.read(folder / "modes.csv")


def move(axis: str) -> dict[str, Any]:
    return {"kind": "move", "by": {axis: MOVE["by"]}, "feed": MOVE["feed"]}


def trace_of(folder: Path, pose: dict[str, float], axis: str, fmus: Path, **more: Any) -> dict[str, Any]:
    """Columns of `axis`, without its name, of a run in which it moves; and the plant's GUID."""
    machine = write_machine(folder, pose, **more)
    path = write_scenario(folder, machine, [move(axis), {"kind": "dwell", "duration": "50 ms"}])
    run = cosim.run(scenario.load(path), fmus=fmus)
    columns = {name.partition(".")[2]: run.trace[name] for name in run.trace.columns if name.startswith(f"{axis}.")}
    return columns | {"guid": run.units["plant"]["guid"]}


@pytest.mark.parametrize("pose", MACHINES.values(), ids=MACHINES)
def test_command_line_runs_any_axes(
    pose: dict[str, float], tmp_path: Path, fmus: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """From the files to the report, with every evaluation that these axes allow."""
    last = list(pose)[-1]
    motions = [move(last), {"kind": "dwell", "duration": "0.2 s"}]
    evaluate: list[dict[str, Any]] = [{"kind": "positioning", "axis": last, "band": "1 um"}]
    if len(pose) > 1:
        plane = [next(iter(pose)), last]
        motions += [{"kind": "circle", "plane": plane, "radius": "2 mm", "feed": "2000 mm/min", "turns": 3}]
        motions += [{"kind": "dwell", "duration": "0.1 s"}]
        evaluate += [{"kind": "circle", "turn": 2}]
    path = write_scenario(tmp_path, write_machine(tmp_path, pose), motions, evaluate=evaluate)
    out = tmp_path / "out"
    assert cli.main(["run", str(path), "--fmus", str(fmus), "--out", str(out)]) == 0, capsys.readouterr().err
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    assert f"{last}.overshoot" in str(summary)
    page = (out / "report.html").read_text(encoding="utf-8")
    assert all(axis in page for axis in pose)
    header = (out / "result.csv").read_text(encoding="utf-8").splitlines()[0]
    assert all(f"{axis}.x_a [m]" in header for axis in pose)


def test_an_axis_does_as_it_does_among_others(tmp_path: Path, fmus: Path) -> None:
    """Decoupled axes: the table from a file in the general unit, a unit packed for one axis, one packed for five."""
    by_file = trace_of(tmp_path / "three", {"X": 0.5, "Y": 0.3, "Z": 0.1}, "Z", fmus)
    alone = trace_of(tmp_path / "one", {"Q": 0.1}, "Q", fmus)
    among = trace_of(tmp_path / "five", {"X": 0.5, "Y": 0.3, "U": 0.2, "W": 0.1, "Z": 0.4}, "W", fmus)
    with Archive(fmus / "plant.fmu") as general:
        assert by_file["guid"] == general.guid
        assert len({by_file["guid"], alone["guid"], among["guid"]}) == 3
        code = {found["guid"].partition("-")[0] for found in (by_file, alone, among)}
        assert code == {general.guid.partition("-")[0]}
    assert np.ptp(by_file["x_a"]) > 0.019  # of 20 mm: it has moved
    for found in (alone, among):
        assert found.keys() == by_file.keys()
        for name in by_file.keys() - {"guid"}:
            # The other axes add exact zeros to every sum.
            assert np.array_equal(found[name], by_file[name]), name


def test_own_archive_gives_the_numbers_of_the_table(tmp_path: Path, fmus: Path) -> None:
    """The default axes, by modes_file of the general unit and by an archive under `plant`: the same bits."""
    pose = {"X": 0.5, "Y": 0.3, "Z": 0.1}
    by_file = trace_of(tmp_path, pose, "X", fmus)
    packed = pack(fmus / "plant.fmu", tmp_path / "own.fmu", modes=table_in(tmp_path), pose=pose)
    by_archive = trace_of(tmp_path, pose, "X", fmus, plant="own.fmu")
    assert by_archive["guid"] == packed.guid != by_file["guid"]
    for name in by_file.keys() - {"guid"}:
        assert np.array_equal(by_archive[name], by_file[name]), name


def test_general_archive_serves_its_own_axes_unpacked(fmus: Path) -> None:
    machine = load_machine(MACHINE)
    plant, takes_modes = open_plant(machine, fmus)
    with plant as archive:
        assert archive.path == fmus / "plant.fmu"
        assert takes_modes
    assert modes_file(machine.modes).read_bytes() == machine.modes.file.read_bytes()


def test_archive_of_other_modes_or_axes_is_refused(tmp_path: Path, fmus: Path) -> None:
    write_machine(tmp_path, {"Q": 0.1})
    pack(fmus / "plant.fmu", tmp_path / "own.fmu", modes=table_in(tmp_path), pose={"Q": 0.1})
    path = write_machine(tmp_path, {"Q": 0.1}, plant="own.fmu")
    with open_plant(load_machine(path), fmus)[0] as archive:
        assert axes_of(archive) == ("Q",)

    table = (tmp_path / "modes.csv").read_text(encoding="utf-8")
    (tmp_path / "modes.csv").write_text(table.replace("0.05", "0.06"), encoding="utf-8")
    with pytest.raises(InputError, match=r"own\.fmu: its table of modes is not the machine's.*export --plant .* --out"):
        open_plant(load_machine(path), fmus)

    path = write_machine(tmp_path, {"Q": 0.1, "R": 0.1}, plant="own.fmu")
    with pytest.raises(InputError, match=r"own\.fmu: a plant with the axes Q; the machine has Q, R; pack it anew"):
        open_plant(load_machine(path), fmus)

    path = write_machine(tmp_path, {"Q": 0.1}, plant="missing.fmu")
    with pytest.raises(InputError, match=r"plant: no such file: .*missing\.fmu"):
        load_machine(path)


def test_pack_command_makes_what_plant_names(
    tmp_path: Path, fmus: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("FEEDSIM_FMUS", str(fmus))
    out = tmp_path / "my plant.fmu"
    path = write_machine(tmp_path / "machine", {"Q": 0.1, "b2": 0.25})
    assert cli.main(["export", "--plant", str(path.parent), "--out", str(out), "--name", "Saw 3"]) == 0
    with Archive(out) as archive:
        said = capsys.readouterr().out
        assert said.startswith("Q at 100 mm, b2 at 250 mm")
        assert said.endswith(f"-> {out}\n")
        assert archive.guid in said
        assert axes_of(archive) == ("Q", "b2")
        assert archive.description.description.endswith("Machine: Saw 3. Synthetic; for tests")
    write_machine(path.parent, {"Q": 0.1, "b2": 0.25}, plant=str(out))
    with open_plant(load_machine(path), fmus)[0] as archive:
        assert archive.path == out

    base = tmp_path / "base.fmu"
    shutil.copy(fmus / "plant.fmu", base)
    assert cli.main(["export", "--plant", str(path), "--base", str(base), "--out", str(base)]) == 0  # in place
    assert base.read_bytes() != (fmus / "plant.fmu").read_bytes()


def test_pack_command_computes_the_modes_of_another_pose(tmp_path: Path, fmus: Path) -> None:
    """The default machine elsewhere: its structure's modes there, and the pose; named axes alone change."""
    folder = tmp_path / "machine"
    shutil.copytree(MACHINE, folder)
    text = (folder / "machine.yaml").read_text(encoding="utf-8")
    if "\nstructure:" not in text:
        (folder / "machine.yaml").write_text(text + "\nstructure: structure.yaml\n", encoding="utf-8")
    machine = load_machine(folder)
    assert machine.structure is not None
    pose = {**machine.pose, "X": 1.2, "Z": 0.4}
    out = tmp_path / "there.fmu"
    arguments = ["--at", "X=1200mm", "Z=0.4 m", "--base", str(fmus / "plant.fmu"), "--out", str(out)]
    assert cli.main(["export", "--plant", str(folder), *arguments]) == 0
    built = build(load_structure(machine.structure), pose).solution.modes
    with Archive(out) as archive:
        starts = {axis: float(archive.variables[f"{axis}.x_0"].start) for axis in axes_of(archive)}
        assert starts == pose
        packed = read_modes(archive.directory / "resources" / "modes.csv", list(pose))
    assert np.array_equal(packed.frequency, built.frequency)
    # Directly from the modes, the same archive.
    table = tmp_path / "modes.csv"
    write_modes(table, built)
    pack(
        fmus / "plant.fmu",
        tmp_path / "direct.fmu",
        modes=table_in(tmp_path),
        pose=pose,
        name=machine.name,
        note=machine.note,
    )
    assert (tmp_path / "direct.fmu").read_bytes() == out.read_bytes()


@pytest.mark.parametrize(
    ("arguments", "code", "text"),
    [
        (["--base", "nowhere.fmu"], 2, "--base: no such file: nowhere.fmu"),
        (["--at", "Q"], 2, "--at Q: AXIS=POSITION is needed, e.g. X=800mm"),
        (["--at", "V=1mm"], 2, "--at: the machine has no axis V; axes are Q"),
        (["--at", "Q=1kg"], 2, "--at Q=1kg: "),
        (["--at", "Q=2m"], 2, "--at Q: 2 m is outside of the travel, 0 m to 0.685 m"),
        (["--at", "Q=0.2m"], 2, "Decoupled: has no structure to compute modes from at another pose"),
        (["--name", "Saw\a"], 2, "cannot be printed"),
    ],
)
def test_pack_command_refuses(
    arguments: list[str], code: int, text: str, tmp_path: Path, fmus: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write_machine(tmp_path, {"Q": 0.1})
    out = tmp_path / "out.fmu"
    base = [] if "--base" in arguments else ["--base", str(fmus / "plant.fmu")]
    assert cli.main(["export", "--plant", str(path), "--out", str(out), *base, *arguments]) == code
    assert text in capsys.readouterr().err
    assert not out.exists()


def test_archive_that_cannot_be_written_is_told(tmp_path: Path, fmus: Path) -> None:
    write_machine(tmp_path, {"Q": 0.1})
    with pytest.raises(OutputError, match="cannot write"):
        pack(fmus / "plant.fmu", tmp_path, modes=table_in(tmp_path), pose={"Q": 0.1})  # a folder is in the way
    assert not list(tmp_path.parent.glob(".*.part"))


def test_base_that_carries_no_table_is_refused(tmp_path: Path, fmus: Path) -> None:
    write_machine(tmp_path, {"Q": 0.1})
    with pytest.raises(InputError, match="controller: takes no resources"):
        pack(fmus / "controller.fmu", tmp_path / "x.fmu", modes=table_in(tmp_path), pose={"Q": 0.1})
    with zipfile.ZipFile(fmus / "plant.fmu") as whole, zipfile.ZipFile(tmp_path / "old.fmu", "w") as old:
        for name in whole.namelist():
            if name != "sources/variables.json":
                old.writestr(name, whole.read(name))
    with pytest.raises(InputError, match=r"old\.fmu: has no sources/variables\.json.*build it anew"):
        pack(tmp_path / "old.fmu", tmp_path / "x.fmu", modes=table_in(tmp_path), pose={"Q": 0.1})
    assert not (tmp_path / "x.fmu").exists()
