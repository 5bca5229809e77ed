"""feedsim machine import: a folder that other commands take, messages, and inputs that stay as they are."""

from __future__ import annotations

import csv
import json
import shutil
from pathlib import Path
from typing import Any

import pytest

import feedsim as fs
from command_helpers import feedsim as command
from feedsim.scenario import load_machine

ROOT = Path(__file__).resolve().parents[2]
DATA = """N10000 $MN_AXCONF_MACHAX_NAME_TAB[0]="X1"
N32200 $MA_POSCTRL_GAIN[0,AX1]=5
N32300 $MA_MAX_AX_ACCEL[0,AX1]=9.5
N32620 $MA_FFW_MODE[AX1]=3
N32610 $MA_VELO_FFW_WEIGHT[0,AX1]=0.9
N32810 $MA_EQUIV_SPEEDCTRL_TIME[0,AX1]=0.0048
N36100 $MA_POS_LIMIT_MINUS[AX1]=900
N36110 $MA_POS_LIMIT_PLUS[AX1]=1500
N32450 $MA_BACKLASH[0,AX1]=5000
what is this
"""
DRIVE = "[PARAMETER]\np1460[0]=20\np1462[0]=15\np1656[0]='H0000'\n"


def feedsim(*words: str, cwd: Path) -> Any:
    return command(*words, fmus=ROOT / "fmus", cwd=cwd)


@pytest.fixture
def place(tmp_path: Path) -> Path:
    shutil.copytree(ROOT / "scenarios" / "machines" / "test_centre", tmp_path / "centre")
    (tmp_path / "nc.tea").write_bytes(DATA.replace("\n", "\r\n").encode())
    (tmp_path / "drive.tea").write_text(DRIVE)
    return tmp_path


def test_into_a_machine(place: Path) -> None:
    before = {path: path.read_bytes() for path in place.rglob("*") if path.is_file()}
    done = feedsim(
        "machine", "import", "nc.tea", "drive.tea", "--axes", "X=X1", "--machine", "centre", "--out", "new", cwd=place
    )
    assert done.returncode == 0, done.stderr
    assert "X: 10 values of X1 and drive, MD32200 = 5 (1000/min)" in done.stdout
    assert {path: path.read_bytes() for path in before} == before
    old, new = load_machine(place / "centre"), load_machine(place / "new")
    axis = new.axes["X"]
    assert (axis.drive.K_v, axis.drive.k_ffw, axis.drive.symmetry_lag) == (pytest.approx(250 / 3), 0.9, False)
    assert (axis.drive.K_p, axis.drive.T_n, axis.drive.filter_1.type) == (20.0, 0.015, "off")
    assert axis.max_acceleration == 9.5
    assert axis.drive.T_sym == old.axes["X"].drive.T_sym  # its unit is not confirmed
    assert axis.friction == old.axes["X"].friction
    assert (new.axes["Y"], new.axes["Z"], new.cycles, new.path) == (old.axes["Y"], old.axes["Z"], old.cycles, old.path)
    assert new.control == "sinumerik"
    text = (place / "new" / "machine.yaml").read_text()
    assert "K_v: 83.33333333333334 1/s      # MD32200 POSCTRL_GAIN = 5 (nc.tea:2)" in text
    found = json.loads((place / "new" / "summary.json").read_text())
    assert found["kind"] == "machine import"
    assert found["not_understood"][0]["line"] == 10
    assert {each["number"] for each in found["not_taken"] if each["acts"]} == {
        "MD32810",
        "MD36100",
        "MD36110",
        "MD32450",
    }
    with (place / "new" / "sheet.csv").open() as file:
        rows = {row["number"]: row for row in csv.DictReader(file)}
    assert (rows["MD32200"]["taken"], rows["MD32450"]["taken"]) == ("yes", "no")
    assert "outside the allowed range" in rows["MD32450"]["reason"]
    page = (place / "new" / "report.html").read_text()
    assert "Values that were not taken" in page
    assert "Where names and units come from" in page
    assert "SINUMERIK 808D ADVANCED parameter manual 6FC5397-8EP40-0BA0, p. 228" in page
    again = feedsim("machine", "info", "new", cwd=place)
    assert again.returncode == 0, again.stderr


def test_values_that_a_machine_cannot_have(place: Path) -> None:
    """The pose of the machine is outside of the limits that the control has."""
    done = feedsim("machine", "import", "nc.tea", "--axes", "X=X1", "--machine", "centre", "--checked",
                   "MD36100,MD36110", "--out", "new", cwd=place)  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "the pose of X, 0.8 m, is outside its travel" in (place / "new" / "sheet.csv").read_text()
    assert load_machine(place / "new").axes["X"].travel == load_machine(place / "centre").axes["X"].travel
    (place / "nc.tea").write_text(DATA.replace("=900", "=100"))
    done = feedsim("machine", "import", "nc.tea", "--axes", "X=X1", "--machine", "centre", "--checked", "all",
                   "--out", "new", cwd=place)  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert load_machine(place / "new").axes["X"].travel == pytest.approx((0.1, 1.5))


@pytest.mark.parametrize("change", ["p1660[0]=450", "p1660[0]=455\np1659[0]=0,9"])
def test_a_half_of_a_filter_is_not_taken(place: Path, change: str) -> None:
    """The machine keeps its own filter, and a finding names the control's."""
    (place / "f.tea").write_text(f"p1656[0]='H1'\np1657[0]=2\np1658[0]=455\np1659[0]=0.9\n{change}\np1661[0]=0.1\n")
    result = fs.machine_import(place / "f.tea", "X", place / "centre")
    result.save(place / "new")
    assert (
        load_machine(place / "new").axes["X"].drive.filter_1 == load_machine(place / "centre").axes["X"].drive.filter_1
    )
    assert [each.parameter for each in result.made.values] == [f"drive.filter_{k}.type" for k in (2, 3, 4)]
    assert result.findings[0].code == "values-not-taken"
    assert "X p1657" in result.findings[0].text or "X p1659" in result.findings[0].text


def test_a_draft(place: Path) -> None:
    done = feedsim("machine", "import", "nc.tea", "--axes", "X1", "--out", "new", cwd=place)
    assert done.returncode == 0
    assert "the machine file is a draft" in done.stderr
    assert "#   axes.X1.friction: missing" in (place / "new" / "machine.yaml").read_text()
    refused = feedsim("machine", "info", "new", cwd=place)
    assert refused.returncode == 2
    assert "axes.X1.friction: missing" in refused.stderr


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["nc.tea"], "--axes: which axes? The files have AX1 (X1)"),
        (["nc.tea", "--axes", "Q"], "no axis 'Q'; the files have AX1 (X1)"),
        (["nc.tea", "--axes", "X=X1,X=X1"], "--axes X=X1: X is named twice"),
        (["nc.tea", "--axes", "X=X1,Z=AX1"], "X=X1 and Z=AX1: the same axis of the control, given to two axes"),
        (["nc.tea", "--axes", "X=X1", "--machine", "nope"], "--machine: no such file: nope"),
        (["nc.tea", "--axes", "X1", "--assume", "FOO=1"], "FOO is nothing that a value of the control sinumerik"),
        (["centre", "--axes", "X"], "centre is a folder; name the files in it"),
        (["nc.tea", "--axes", "X="], "--axes X=: AXIS or AXIS=NAME IN THE CONTROL is needed"),
        (["nc.tea", "--axes", "Q=X1", "--machine", "centre"], "has no axis 'Q'; it has X, Y, Z"),
        (["nc.tea", "--axes", "X1", "--assume", "FFW_MODE"], "--assume FFW_MODE: NAME=VALUE is needed"),
        (["nc.tea", "--axes", "X1", "--assume", "A=b c"], "--assume A=b c: a number, TRUE, FALSE or 'H..' is needed"),
        (["nc.tea", "--axes", "X1", "--checked", "MD1"], "MD1 is no number of the table of names"),
        (["nc.tea", "--axes", "X1", "--drives", "X1=PS9"], "no drive object or list 'PS9'; the files have none"),
        (["centre/machine.yaml", "--axes", "X"], "centre/machine.yaml: holds no parameters of a control"),
        (["missing.tea", "--axes", "X"], "no such file"),
    ],
)
def test_messages(place: Path, words: list[str], message: str) -> None:
    done = feedsim("machine", "import", *words, "--out", "new", cwd=place)
    assert done.returncode == 2
    assert message in done.stderr
    assert not (place / "new").exists()


def test_an_input_is_no_output(place: Path) -> None:
    done = feedsim("machine", "import", "nc.tea", "--axes", "X=X1", "--machine", "centre", "--out", "centre",
                   "--force", cwd=place)  # fmt: skip
    assert done.returncode != 0
    assert "is an input and would be replaced" in done.stderr


def test_back_into_the_control(place: Path) -> None:
    words = ["machine", "export", "centre", "--like", "nc.tea", "drive.tea", "--axes", "X=X1", "--drives", "X=drive"]
    done = feedsim(*words, "--out", "load", cwd=place)
    assert done.returncode == 0, done.stderr
    assert "X MD32200 POSCTRL_GAIN: 5 -> 4 1000/min" in done.stdout
    old, new = (place / "nc.tea").read_bytes(), (place / "load" / "nc.tea").read_bytes()
    changed = [(a, b) for a, b in zip(old.split(b"\n"), new.split(b"\n"), strict=True) if a != b]
    assert changed == [
        (b"N32200 $MA_POSCTRL_GAIN[0,AX1]=5\r", b"N32200 $MA_POSCTRL_GAIN[0,AX1]=4\r"),
        (b"N32300 $MA_MAX_AX_ACCEL[0,AX1]=9.5\r", b"N32300 $MA_MAX_AX_ACCEL[0,AX1]=14.4\r"),
        (b"N32610 $MA_VELO_FFW_WEIGHT[0,AX1]=0.9\r", b"N32610 $MA_VELO_FFW_WEIGHT[0,AX1]=1\r"),
    ]
    with (place / "load" / "sheet.csv").open() as file:
        rows = {row["number"]: row for row in csv.DictReader(file)}
    assert rows["MD32200"] | {"where": ""} == {
        "axis": "X", "number": "MD32200", "name": "POSCTRL_GAIN", "old": "5", "new": "4", "unit": "1000/min",
        "unit confirmed": "yes", "written": "yes", "reason": "", "where": "",
    }  # fmt: skip
    assert (rows["MD32810"]["new"], rows["MD32810"]["written"]) == ("0.004854", "no")
    assert (rows["p1657"]["new"], rows["p1657"]["written"]) == ("2", "no")  # its bit of p1656 is 0
    # What the new files hold, beside the machine: the same values, but for those that were to be typed.
    again = fs.machine_import([place / "load" / "nc.tea", place / "load" / "drive.tea"], {"X": "X1"}, place / "centre",
                              drives={"X": "drive"})  # fmt: skip
    values = {each.parameter: each.value for each in again.made.values}
    drive = load_machine(place / "centre").axes["X"].drive
    assert values["drive.K_v"] == pytest.approx(drive.K_v, rel=1e-9)
    assert (values["drive.K_p"], values["drive.T_n"]) == (drive.K_p, drive.T_n)


def test_an_export_to_another_control(place: Path) -> None:
    file = place / "centre" / "machine.yaml"
    file.write_text(file.read_text().replace("\nmodes:", "\ncontrol: twincat\nmodes:", 1))
    done = feedsim("machine", "export", "centre", "--like", "nc.tea", "--axes", "X=X1", "--out", "load", cwd=place)
    assert done.returncode == 2
    assert "is of the control twincat, the files are of sinumerik" in done.stderr
    assert not (place / "load").exists()


def test_a_scenario_is_no_machine(place: Path) -> None:
    (place / "s.yaml").write_text("motions: []\n")
    for words in (["import", "nc.tea", "--machine", "s.yaml"], ["export", "s.yaml", "--like", "nc.tea"]):
        done = feedsim("machine", *words, "--axes", "X=X1", "--out", "new", cwd=place)
        assert done.returncode == 2
        assert "s.yaml is a scenario, which feedsim run takes" in done.stderr


def test_an_export_never_replaces_its_input(place: Path) -> None:
    done = feedsim("machine", "export", "centre", "--like", "nc.tea", "--axes", "X=X1", "--out", ".", "--force",
                   cwd=place)  # fmt: skip
    assert done.returncode != 0
    assert "nc.tea: is an input and would be replaced" in done.stderr


def test_in_python(place: Path) -> None:
    result = fs.machine_import(place / "nc.tea", {"X": "X1"}, place / "centre", checked="MD32810")
    assert result.made.values
    assert {each.name.number: each.value for each in result.reading.taken}["MD32810"] == 0.0048
    assert float(result.figures["values.taken"]) == len(result.made.values)
    assert result.kind == "machine import"
