"""SSP files that feedsim does not run: every one is refused with what is wrong and where, and nothing is written."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from feedsim import cli, scenario
from feedsim.foundation.errors import InputError, OutputError
from feedsim.simulation import ssp
from feedsim.simulation.cosim import archive
from ssp_helpers import STRUCTURE, UNPACKED, altered, contents, edited, short_scenario, write

M_A = '<ssd:Connection startElement="controller_Z" startConnector="M_a" endElement="plant" endConnector="Z.M_a" />'


def refusal(file: Path, *overrides: str) -> InputError:
    with pytest.raises(InputError) as caught, ssp.open_system(file, overrides):
        pass
    assert str(file) in str(caught.value)
    assert UNPACKED not in str(caught.value)  # not of the folder that it was unpacked to
    return caught.value


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (M_A, "", "plant.Z.M_a is not connected; the output M_a of a controller belongs there"),
        (M_A, M_A + M_A, "plant.Z.M_a is connected twice: to controller_Z.M_a and to controller_Z.M_a"),
        (M_A, M_A.replace("controller_Z", "controller_X"), "controller_X drives 2 axes; one is allowed"),
        (M_A, M_A.replace('"M_a"', '"M_s"'), "plant.Z.M_a is connected to controller_Z.M_s; the output M_a"),
        (M_A, M_A.replace('endConnector="Z.M_a"', 'endConnector="W.M_a"'), "plant has no variable 'W.M_a'"),
        (M_A, M_A.replace('endElement="plant"', 'endElement="plnt"'), "there is no component 'plnt'"),
        (M_A, M_A.replace("controller_Z", "").replace('"M_a"', '"M"', 1), "the other end is outside the system"),
        (
            M_A,
            M_A.replace(" />", '><ssc:LinearTransformation factor="2"/></ssd:Connection>'),
            "a transformation is not carried out here",
        ),
        ('startConnector="Z.x_a"', 'startConnector="X.x_a"', "controller_Z.x_a is connected to plant.X.x_a; plant.Z."),
        ('startConnector="Z.x_a"', 'startConnector="Z.n_a"', "controller_Z.x_a is in m, but plant.Z.n_a is in rad/s"),
        ('startConnector="Z.x_s"', 'startConnector="Y.x_s"', "controller_Z.n_ffw is connected to setpoint.Z.n_ffw"),
        (
            'startConnector="Z.release"', 'startConnector="X.release"',
            "controller_Z.release is connected to setpoint.X.release; setpoint.Z.release belongs there",
        ),
        ('startConnector="Z.release"', 'startConnector="finished"', "setpoint.Z.release belongs there"),
        ('startConnector="Z.release"', 'startConnector="Z.x_s"', "controller_Z.release is connected to setpoint.Z.x_s"),
        ('source="resources/friction.fmu"', 'source="resources/plant.fmu"', "one component made from plant.fmu"),
        ('source="resources/friction.fmu"', 'source="../friction.fmu"', "'../friction.fmu' is not in the file"),
        ('source="resources/friction.fmu"', 'source="..%2Ffriction.fmu"', "it leads out of it"),
        ('source="resources/friction.fmu"', 'source="resources/%2e%2e/%2e%2e/friction.fmu"', "it leads out of it"),
        ('source="resources/friction.fmu"', 'source="resources%5Cfriction.fmu"', "it has backslashes"),
        ('source="resources/friction.fmu"', 'source="resources/friction%00.fmu"', "or control characters"),
        ('source="resources/friction.fmu"', 'source="file:///resources/friction.fmu"', "it is not relative to it"),
        ('source="resources/friction.fmu"', 'source="/resources/friction.fmu"', "it is not relative to it"),
        ('source="resources/friction.fmu"', 'source="resources/friction%FF.fmu"', "it is no URI"),
        ('source="resources/plant.ssv"', 'source="../plant.ssv"', "but not in the file: it leads out of it"),
        ('name="friction_X"', 'name="friction_Y"', "component friction_Y is there 2 times"),
        ('<ssc:Real unit="N.m" />', '<ssc:Real unit="lbf.ft" />', "is in lbf.ft according to the SSP, and in N.m"),
        ('name="x_a" kind="input"', 'name="x_a" kind="output"', "is no output of"),
        ('name="x_a" kind="input"', 'name="x_b" kind="input"', "has no such variable"),
        ('source="resources/plant.ssv"', 'source="resources/plant2.ssv"', "is named by a parameter binding, but not"),
        ("<ssd:System ", "<ssd:Systen ", "not readable XML"),
        ("</ssd:Elements>", '<ssd:System name="nested"/></ssd:Elements>', "ssd:System nested: only components"),
        (
            '<ssd:ParameterBinding source="resources/plant.ssv" />',
            '<ssd:ParameterBinding source="resources/plant.ssv"><ssd:ParameterMapping/></ssd:ParameterBinding>',
            "a parameter mapping is not read",
        ),
        ('type="application/x-fmu-sharedlibrary"', 'type="application/x-ssp-package"', "is application/x-ssp-package"),
        ("<?xml version", '<!DOCTYPE x [<!ENTITY a "b">]><?xml version', "document type declaration"),
        ("SystemStructureDescription", "SystemStructure", "its root is"),
        ('stopTime="', 'stopTime="soon', "is no number"),
        ('stopTime="', 'stopTime="-', "position cycles; allowed"),
        ('stopTime="', 'stopTime="9999999', "position cycles; allowed"),
        ('"motions": [', '"motions": [,', "annotation feedsim.scenario is no JSON that can be read"),
        ('"note": "",', '"noot": "",', "unknown key 'noot'"),
        ('"cycles": {', '"cycles": 1, "x": {', "has no machine with cycles, path and axes"),
        ('"kind": "move"', '"kind": "setpoints", "file": "/etc/passwd"', "names the recording '/etc/passwd'"),
    ],
)  # fmt: skip
def test_a_system_that_is_not_figure_2(exported: Path, tmp_path: Path, old: str, new: str, words: str) -> None:
    count = -1 if old.startswith("SystemStructure") else 1
    file = edited(exported, tmp_path / "other.ssp", STRUCTURE, (old, new), count=count)
    assert words in str(refusal(file))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('name="F_C"', 'name="F_c"', "F_c: is no parameter of friction_Z; did you mean 'F_C'?"),
        ('name="F_C"', 'name="z"', "z: is local, no parameter, of friction_Z"),
        ('name="F_C"', 'name="F_S"', "parameter F_S is there twice"),
        ('"1.6" unit="N.m"', '"1.6" unit="N"', "F_C: unit 'N' is that of a force"),
        ('"1.6" unit="N.m"', '"1.6" unit="Nmm"', "unit 'Nmm'"),
        ('"1.6" unit="N.m"', '"NaN" unit="N.m"', "no number to calculate with"),
        ('"1.6" unit="N.m"', '"INF" unit="N.m"', "is no number"),
        ('"1.6" unit="N.m"', '"1,6" unit="N.m"', "'1,6' is no number"),
        ("<ssv:Real", "<ssv:Binary", "one value of Real, Integer"),
        ('"1.6" unit="N.m"', '"-1.6" unit="N.m"', "outside the allowed range"),
        ('"1.6" unit="N.m"', '"5.6" unit="N.m"', "F_S 2.1 N.m is smaller than F_C 5.6 N.m"),
    ],
)  # fmt: skip
def test_parameters_that_cannot_be(exported: Path, tmp_path: Path, old: str, new: str, words: str) -> None:
    file = edited(exported, tmp_path / "other.ssp", "resources/friction_Z.ssv", (old, new))
    assert words in str(refusal(file))


def test_all_faults_at_once(exported: Path, tmp_path: Path) -> None:
    first = edited(exported, tmp_path / "1.ssp", "resources/friction_Z.ssv", ('name="F_C"', 'name="F_c"'))
    second = edited(first, tmp_path / "2.ssp", "resources/controller_X.ssv", ('name="K_v"', 'name="K_V"'))
    assert len(refusal(second).problems) == 2


RELEASE = (
    '<ssd:Connection startElement="setpoint" startConnector="Z.release" endElement="controller_Z" '
    'endConnector="release" />'
)


def _parameter(name: str, value: str, kind: str = "Real", unit: str = "") -> str:
    given = f' unit="{unit}"' if unit else ""
    return f'<ssv:Parameter name="{name}"><ssv:{kind} value="{value}"{given} /></ssv:Parameter>'


def _with_start_values(file: Path, out: Path, component: str, *parameters: str) -> Path:
    start = "<ssv:Parameters>"
    return edited(file, out, f"resources/{component}.ssv", (start, start + "".join(parameters)))


@pytest.mark.parametrize(
    ("component", "parameter", "words"),
    [
        ("plant", _parameter("tool.F_Z", "500", unit="N"), ("plant.tool.F_Z: 500 N is", "such an input at 0 N:")),
        ("plant", _parameter("tool.F_Z", "0.5", unit="kN"), ("plant.tool.F_Z: 0.5 kN is", "such an input at 0 N:")),
        ("plant", _parameter("tool.F_Z", "much"), ("plant.tool.F_Z: 'much' is no number",)),
        ("controller_Z", _parameter("M_add", "5", unit="N.m"), ("controller_Z.M_add: 5 N.m is", "at 0 N.m:")),
        ("controller_Z", _parameter("n_add", "1"), ("controller_Z.n_add: 1 is", "at 0 rad/s:")),
        ("controller_Z", _parameter("release", "false", "Boolean"), ("controller_Z.release: false is", "at true:")),
    ],
)
def test_start_values_that_cannot_be_held(
    exported: Path, tmp_path: Path, component: str, parameter: str, words: tuple[str, ...]
) -> None:
    """Of inputs that nothing drives: other tools hold them for the whole run, feedsim would not and says so."""
    file = edited(exported, tmp_path / "free.ssp", STRUCTURE, (RELEASE, ""))
    said = refusal(_with_start_values(file, tmp_path / "start.ssp", component, parameter))
    assert len(said.problems) == 1
    assert f"resources/{component}.ssv" in str(said)
    for each in words:
        assert each in str(said)


def test_start_values_that_cannot_be_held_are_told_with_other_faults(
    exported: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first = edited(exported, tmp_path / "1.ssp", "resources/friction_Z.ssv", ('name="F_C"', 'name="F_c"'))
    both = (_parameter("tool.F_X", "1", unit="N"), _parameter("tool.F_Z", "500", unit="N"))
    file = _with_start_values(first, tmp_path / "2.ssp", "plant", *both)
    assert len(refusal(file).problems) == 3
    assert cli.main(["run", str(file), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    for words in ("plant.tool.F_X", "plant.tool.F_Z", "feedsim cannot hold it"):
        assert words in said
    assert not (tmp_path / "out").exists()


def test_start_values_of_inputs_that_change_nothing(exported: Path, tmp_path: Path) -> None:
    """Of connected inputs, whatever they are; of others the archive's own; and one that the system's set takes back."""
    first = _with_start_values(
        exported, tmp_path / "1.ssp", "controller_Z",
        _parameter("release", "false", "Boolean"), _parameter("x_a", "0.3", unit="m"), _parameter("M_add", "0.0"),
    )  # fmt: skip
    file = _with_start_values(first, tmp_path / "2.ssp", "plant", _parameter("tool.F_Z", "0", unit="kN"))
    with ssp.open_system(file):
        pass
    file = _with_start_values(first, tmp_path / "3.ssp", "plant", _parameter("tool.F_Z", "500", unit="N"))
    refusal(file)
    inline = (
        "<ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues>"
        f'<ssv:ParameterSet version="1.0" name="x"><ssv:Parameters>{_parameter("plant.tool.F_Z", "VALUE", unit="N")}'
        "</ssv:Parameters></ssv:ParameterSet></ssd:ParameterValues></ssd:ParameterBinding></ssd:ParameterBindings>"
    )
    space = 'xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues"'
    old = "<ssd:Elements>"
    for number, given in enumerate((file, exported)):
        for value, fine in (("0", True), ("7", False)):
            new = inline.replace("VALUE", value).replace("<ssv:ParameterSet ", f"<ssv:ParameterSet {space} ") + old
            changed = edited(given, tmp_path / f"s{number}{value}.ssp", STRUCTURE, (old, new))
            if fine:
                with ssp.open_system(changed):
                    pass
            else:
                assert "plant.tool.F_Z: 7 N is asked" in str(refusal(changed))


def test_controllers_with_different_cycles(exported: Path, tmp_path: Path) -> None:
    old = 'Real value="0.000125"'
    file = edited(exported, tmp_path / "c.ssp", "resources/controller_X.ssv", (old, 'Real value="0.00025"'))
    assert "the controllers differ in T_c" in str(refusal(file))


def test_another_modes_file(exported: Path, tmp_path: Path) -> None:
    new = '<ssv:Parameter name="modes_file"><ssv:String value="/m.csv"/></ssv:Parameter>'
    start = "<ssv:Parameters>"
    file = edited(exported, tmp_path / "m.ssp", "resources/plant.ssv", (start, start + new))
    assert "the modes are those inside plant.fmu" in str(refusal(file))


def test_an_axis_that_does_not_stand_where_its_setpoints_begin(
    exported: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A start position can be edited; whoever does it hears what follows. No message names a temporary folder."""
    file = edited(exported, tmp_path / "x_0.ssp", "resources/plant.ssv", ('"0.1"', '"0.2"'))
    assert cli.main(["check", str(file)]) == 0
    told = capsys.readouterr().err
    assert "axis Z stands at 0.2 m, its setpoints begin at 0.1 m: it jumps there at once" in told
    old, new = '"0.003183098861837907"', '"0.0015"'
    file = edited(exported, tmp_path / "I_P.ssp", "resources/controller_Z.ssv", (old, new))
    assert cli.main(["run", str(file), "--out", str(tmp_path / "out")]) == 2
    told += capsys.readouterr().err
    assert f"{file}: modes.csv: axis Z travels 20 mm per revolution" in told
    assert "feedsim-" not in told.replace("feedsim machine", "")
    assert not (tmp_path / "out").exists()


def _without(name: str) -> Callable[[dict[str, bytes]], dict[str, bytes]]:
    return lambda files: {key: value for key, value in files.items() if key != name}


def test_files_that_are_missing(exported: Path, tmp_path: Path) -> None:
    for name, words in {
        "resources/friction.fmu": "its source 'resources/friction.fmu' is not in the file",
        STRUCTURE: "it is no SSP file",
        "resources/friction_Z.ssv": "is named by a parameter binding",
    }.items():
        assert words in str(refusal(write(tmp_path / "less.ssp", _without(name)(contents(exported)))))
    bad = contents(exported) | {"resources/friction.fmu": b"PK nothing"}
    assert "resources/friction.fmu: not a usable FMI 2.0 archive" in str(refusal(write(tmp_path / "bad.ssp", bad)))


def test_no_setpoint_unit(exported: Path, tmp_path: Path) -> None:
    def drop(text: str) -> str:
        start = text.index('<ssd:Component name="setpoint"')
        end = text.index("</ssd:Component>", start) + len("</ssd:Component>")
        return text[:start] + text[end:]

    message = str(refusal(altered(exported, tmp_path / "none.ssp", STRUCTURE, drop)))
    assert "one component made from setpoint.fmu is needed; there is none" in message


@pytest.mark.parametrize("name", ["../evil.txt", "/etc/evil", "a/../../b", "C:evil", "a\\..\\..\\b"])
def test_entries_that_lead_out(exported: Path, tmp_path: Path, name: str) -> None:
    file = tmp_path / "in" / "evil.ssp"
    file.parent.mkdir()
    write(file, contents(exported) | {name: b"x"})
    assert "leads out of the archive" in str(refusal(file))
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["evil.ssp", "in"]


def test_a_link_and_a_double_entry(exported: Path, tmp_path: Path) -> None:
    file = write(tmp_path / "link.ssp", contents(exported))
    with zipfile.ZipFile(file, "a") as package:
        entry = zipfile.ZipInfo("resources/link.csv")
        entry.create_system, entry.external_attr = 3, 0o120777 << 16
        package.writestr(entry, "/etc/passwd")
        with pytest.warns(UserWarning, match="Duplicate"):
            package.writestr(STRUCTURE, "<x/>")
    problems = refusal(file).problems
    assert any("is a link" in problem for problem in problems)
    assert any("is there twice" in problem for problem in problems)


@pytest.mark.parametrize("cut", [0, 10, 1000, -30, -2000])
def test_a_damaged_file(exported: Path, tmp_path: Path, cut: int) -> None:
    file = tmp_path / "damaged.ssp"
    file.write_bytes(exported.read_bytes()[:cut])
    # Without its end a zip file may be taken for the last archive inside it.
    assert any(words in str(refusal(file)) for words in ("zip file", "it is no SSP file, or damaged"))


def test_a_flipped_byte(exported: Path, tmp_path: Path) -> None:
    """The check sum of the zip file finds it."""
    whole = bytearray(exported.read_bytes())
    at = whole.index(b"sigma_1")
    whole[at] ^= 1
    file = tmp_path / "flipped.ssp"
    file.write_bytes(whole)
    assert "Bad CRC-32" in str(refusal(file))


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("motions.0.feed=1 m/min", "would change the setpoints"),
        ("machine.cycles.position=2 ms", "would change the setpoints"),
        ("machine.axes.Z.pitch=10 mm", "would change the setpoints"),
        ("machine.axes.Z.friction.F_c=1 N.m", "unknown key 'F_c'"),
        ("coupling.scheme=gauss", "coupling.scheme"),
    ],
)
def test_settings_that_cannot_be(exported: Path, override: str, words: str) -> None:
    with pytest.raises(InputError) as caught, ssp.open_system(exported, [override]):
        pass
    assert words in str(caught.value)
    assert override in str(caught.value)


def test_the_command_line(exported: Path, fmus: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    bad = edited(exported, tmp_path / "bad.ssp", STRUCTURE, (M_A, ""))
    for words in (["run", str(bad), "--out", str(out)], ["validate", str(bad)]):
        assert cli.main(words) == 2
        assert "plant.Z.M_a is not connected" in capsys.readouterr().err
    assert cli.main(["run", str(tmp_path / "none.ssp")]) == 2
    assert cli.main(["run", str(exported), "--fmus", str(fmus)]) == 2
    assert "has its own archives" in capsys.readouterr().err
    assert not out.exists()
    assert cli.main(["run", str(exported), "--out", str(out), "--quiet"]) == 0
    assert {"result.csv", "summary.json", "report.html"} <= {path.name for path in out.iterdir()}
    assert cli.main(["check", str(exported)]) == 0
    assert "valid; 2 motions" in capsys.readouterr().out


def test_writing_is_whole_or_not_at_all(fmus: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = short_scenario(tmp_path)
    fine = ["export", str(file), "--fmus", str(fmus), "--out"]
    assert cli.main([*fine, str(tmp_path / "x.zip")]) == 2  # importers tell it by its name
    assert cli.main([*fine, str(tmp_path / "none" / "x.ssp")]) == 4
    (tmp_path / "folder.ssp").mkdir()
    assert cli.main([*fine, str(tmp_path / "folder.ssp")]) == 4
    assert cli.main([*fine, str(tmp_path / "x.ssp"), "--set", "motions.0.by.Z=900 mm"]) == 2  # too far
    assert cli.main(["export", str(file), "--fmus", str(tmp_path), "--out", str(tmp_path / "x.ssp")]) == 2
    assert sorted(path.name for path in tmp_path.iterdir()) == ["folder.ssp", "short.yaml"]
    capsys.readouterr()
    assert cli.main([*fine, str(tmp_path / "x.ssp")]) == 0
    said = capsys.readouterr().out
    assert said.endswith(f"-> {tmp_path / 'x.ssp'}\n")
    assert archive.folders()[0] in said.rpartition("runs on ")[2].splitlines()[0]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["folder.ssp", "short.yaml", "x.ssp"]


def test_an_old_file_stays_where_a_new_one_fails(exported: Path, fmus: Path, tmp_path: Path) -> None:
    out = write(tmp_path / "x.ssp", contents(exported))
    before = out.read_bytes()
    loaded = scenario.load(short_scenario(tmp_path))
    with pytest.raises(InputError, match=r"setpoint\.fmu: no such file"):
        ssp.export(loaded, out, fmus=_incomplete(fmus, tmp_path / "fmus"))
    with pytest.raises(OutputError):
        ssp.export(loaded, tmp_path / "none" / "x.ssp", fmus=fmus)
    assert out.read_bytes() == before


def _incomplete(fmus: Path, folder: Path) -> Path:
    folder.mkdir()
    for unit in ("plant", "controller", "friction"):
        (folder / f"{unit}.fmu").write_bytes((fmus / f"{unit}.fmu").read_bytes())
    return folder
