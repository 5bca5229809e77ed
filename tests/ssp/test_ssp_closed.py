"""Whatever a text in an archive says, no file outside of the archive is opened: every text that an SSP holds is put in
the place of every value, and Python's audit hook tells what is opened."""

from __future__ import annotations

import json
import os
import stat
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape, unescape

import pytest

from audit_helpers import outside, watched
from feedsim import cli
from feedsim.files.source import confine_references
from feedsim.foundation.errors import InputError
from feedsim.simulation.ssp import archive
from feedsim.structure.matrices.calculix import _cards
from ssp_helpers import STRUCTURE, contents

MARK = '<feedsim:Scenario version="1">'


@pytest.fixture(scope="module")
def baits(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """Names of files outside: what may be read, what never ends, what is not there."""
    folder = tmp_path_factory.mktemp("outside")
    for name in ("secret.yaml", "secret.csv", "machine.yaml"):
        (folder / name).write_text("substeps: 4\n", encoding="utf-8")
    os.mkfifo(folder / "pipe.yaml")
    climbing = "../" * 20 + str(folder).lstrip("/")
    texts = [
        f"{folder}/secret.yaml",
        f"{climbing}/secret.yaml",
        f"{folder}/pipe.yaml",
        f"{folder}",
        "/dev/zero",
        f"{folder}/none.yml",
        f"{folder}/secret.csv",
        f"resources/../../{climbing}/secret.yaml",
        "/proc/self/fd/0",
        f"file://{folder}/secret.yaml",
        f"{folder}/secret.yaml\0.yaml",
        "x" * 300 + ".yaml",
        "x/" * 3000 + ".yaml",
    ]
    return texts  # fmt: skip


def parts(file: Path) -> tuple[str, Any, str]:
    """The system's text before the annotation, the annotation's data, the text behind."""
    before, _, rest = contents(file)[STRUCTURE].decode().partition(MARK)
    inside, _, behind = rest.partition("</feedsim:Scenario>")
    return before + MARK, json.loads(unescape(inside)), "</feedsim:Scenario>" + behind


def places(data: Any, place: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    for key, value in data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ():
        yield (*place, key)
        yield from places(value, (*place, key))


def replaced(data: Any, place: tuple[Any, ...], value: str) -> Any:
    if not place:
        return value
    copy = dict(data) if isinstance(data, dict) else list(data)
    copy[place[0]] = replaced(copy[place[0]], place[1:], value)
    return copy


def stored(path: Path, files: dict[str, bytes]) -> Path:
    archive.write(path, files)
    return path


def attribute(text: str) -> str:
    """A text within quotes in XML, which no null character can be in."""
    return escape(text.replace("\0", ""), {'"': "&quot;"})


def pairs(baits: list[str], changes: int) -> Iterator[tuple[str, int]]:
    """Every third bait for every change, each time others."""
    for change in range(changes):
        yield from ((bait, change) for bait in baits[change % 3 :: 3])


def refuses_to_look(command: list[str], file: Path) -> str:
    """Run a command in this process; what it opened that it should not."""
    with watched() as seen:
        code = cli.main([*command, str(file)])
    assert code in (0, 2)
    found = outside(seen, file.parent)
    assert not found, f"{found[:3]}"
    return str(code)


def test_texts_of_the_annotation(exported: Path, tmp_path: Path, baits: list[str], capsys: Any) -> None:
    before, own, behind = parts(exported)
    files = contents(exported)
    own |= {"coupling": {}, "recording": own["recording"], "logging": {"axes": ["Z"]}}
    known = list(places(own))
    assert len(known) > 50
    trials = [(place, baits[i % len(baits)]) for i, place in enumerate(known)]
    keys = ("coupling", "recording", "logging", "evaluate", "motions")
    trials += [((keys[i],), bait) for bait, i in pairs(baits, len(keys))]
    trials += [(("machine", key), baits[0]) for key in ("structure", "modes", "plant", "drive")]
    own["machine"] |= {key: "" for key in ("structure", "modes", "plant", "drive")}
    for place, bait in trials:
        data = json.dumps(replaced(own, place, bait))
        content = {**files, STRUCTURE: f"{before}{escape(data)}{behind}".encode()}
        refuses_to_look(["validate"], stored(tmp_path / "evil.ssp", content))
    capsys.readouterr()


def test_texts_of_the_structure_that_travels_along(
    exported: Path, tmp_path: Path, baits: list[str], capsys: Any
) -> None:
    """It is another file, read on its own: what it names is as closed."""
    before, own, behind = parts(exported)
    own["machine"]["structure"] = "resources/structure.yaml"
    files = {**contents(exported), STRUCTURE: f"{before}{escape(json.dumps(own))}{behind}".encode()}
    kinds = (("matrices", "mass", "stiffness", "ports", "nodes"), ("ansys", "full"),
             ("calculix", "stiffness", "mass", "dofs", "mesh"), ("geometry", "bodies", "guides", "drives"))  # fmt: skip
    for bait, i in pairs(baits, len(kinds)):
        kind, *keys = kinds[i]
        content = {
            **files,
            "resources/structure.yaml": json.dumps({"kind": kind, **dict.fromkeys(keys, bait)}).encode(),
        }
        refuses_to_look(["validate"], stored(tmp_path / "evil.ssp", content))
    capsys.readouterr()


def test_names_in_the_system_structure(exported: Path, tmp_path: Path, baits: list[str], capsys: Any) -> None:
    """Sources of components and parameter sets, in any of their places, and entities of the document itself."""
    files = contents(exported)
    text = files[STRUCTURE].decode()
    changes = (
        ('source="resources/plant.fmu"', 'source="{}"'),
        ('source="resources/friction_Z.ssv"', 'source="{}"'),
        ('source="resources/friction_Z.ssv"', 'source="{}" sourceBase="component"'),
        ("<ssd:Elements>", '<ssd:Elements><ssd:Component name="x" source="{}" type="{}"/>'),
        ("<ssd:Elements>", '<ssd:Elements><ssd:System name="s"><ssd:Component source="{}"/></ssd:System>'),
        ("<ssd:Elements>", '<ssd:Elements><ssd:SignalDictionaryReference name="x" dictionary="{}"/>'),
        ("?>", '?><!DOCTYPE x [<!ENTITY e SYSTEM "{}">]>'),
        ("?>", '?><?xml-stylesheet href="{}"?>'),
        ("<ssd:SystemStructureDescription",
         '<ssd:SystemStructureDescription xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" '
         'xsi:schemaLocation="http://ssp-standard.org/SSP1/SystemStructureDescription {}"'),
    )  # fmt: skip
    more = ["fmu://plant", "http://localhost:9/plant.fmu", "../SystemStructure.ssd", "file:///dev/zero"]
    for bait, i in pairs([*baits, *more], len(changes)):
        old, new = changes[i]
        assert old in text
        changed = text.replace(old, new.replace("{}", attribute(bait)), 1).encode()
        refuses_to_look(["validate"], stored(tmp_path / "evil.ssp", {**files, STRUCTURE: changed}))
    capsys.readouterr()


def test_texts_inside_the_archives(exported: Path, tmp_path: Path, baits: list[str], capsys: Any) -> None:
    """What an FMU inside says of itself, its table of axes, and parameters that are texts."""
    files = contents(exported)
    inner = tmp_path / "plant.fmu"
    inner.write_bytes(files["resources/plant.fmu"])
    plant = contents(inner)
    description = plant["modelDescription.xml"].decode()
    assert 'name="modes_file"' in description
    changes = (
        ('modelIdentifier="plant"', 'modelIdentifier="{}"'),
        ('<String start=""', '<String start="{}"'),
        ('guid="', 'guid="{}'),
        ("?>", '?><!DOCTYPE x [<!ENTITY % e SYSTEM "{}"> %e;]>'),
        ("<CoSimulation", '<xi:include xmlns:xi="http://www.w3.org/2001/XInclude" href="{}"/><CoSimulation'),
    )
    sets = files["resources/plant.ssv"].decode()
    said = '<ssv:Parameter name="modes_file"><ssv:String value="{}"/></ssv:Parameter></ssv:Parameters>'
    for bait, i in pairs(baits, len(changes)):
        old, new = changes[i]
        assert old in description
        changed = description.replace(old, new.replace("{}", attribute(bait)), 1).encode()
        content = {
            **files,
            "resources/plant.fmu": stored(inner, {**plant, "modelDescription.xml": changed}).read_bytes(),
        }
        refuses_to_look(["validate"], stored(tmp_path / "evil.ssp", content))
        told = sets.replace("</ssv:Parameters>", said.replace("{}", attribute(bait))).encode()
        refuses_to_look(["validate"], stored(tmp_path / "evil.ssp", {**files, "resources/plant.ssv": told}))
    capsys.readouterr()


def test_entries_that_are_links(exported: Path, tmp_path: Path, baits: list[str], capsys: Any) -> None:
    for name in ("resources/structure.yaml", "resources/plant.ssv", STRUCTURE):
        file = tmp_path / "link.ssp"
        with zipfile.ZipFile(file, "w") as package:
            for each, content in contents(exported).items():
                if each != name:
                    package.writestr(each, content)
            link = zipfile.ZipInfo(name)
            link.create_system, link.external_attr = 3, (stat.S_IFLNK | 0o777) << 16
            package.writestr(link, baits[0])
        assert refuses_to_look(["run", "--out", str(tmp_path / "out")], file) == "2"
    assert "is a link" in capsys.readouterr().err


def test_a_file_that_includes_others(exported: Path, tmp_path: Path, baits: list[str]) -> None:
    """Neither does the second name outside: a recording that is a model of CalculiX, which names another file."""
    with confine_references(tmp_path):
        for bait in [bait for bait in baits if bait[0] in "./"]:
            (tmp_path / "mesh.inp").write_text(f"*INCLUDE, INPUT={bait}\n", encoding="utf-8")
            with watched() as seen, pytest.raises(InputError, match=r"leads out of the archive|is no file name"):
                list(_cards(tmp_path / "mesh.inp"))
            assert not outside(seen, tmp_path)


def test_a_pipe_that_is_called_an_ssp(tmp_path: Path, capsys: Any) -> None:
    os.mkfifo(tmp_path / "x.ssp")
    assert refuses_to_look(["validate"], tmp_path / "x.ssp") == "2"
    assert "is no regular file" in capsys.readouterr().err
