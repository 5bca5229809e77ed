"""SSP files made to do harm, or by tools that go wrong: refused with words, at once, and by the name of the file."""

from __future__ import annotations

import copy
import json
import random
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

import pytest

from feedsim import cli
from feedsim.foundation import units
from feedsim.foundation.errors import InputError
from feedsim.simulation import ssp
from feedsim.simulation.cosim import unpacked
from feedsim.simulation.ssp import parameter_set, rebuilt
from feedsim.simulation.ssp.opened import _load
from ssp_helpers import STRUCTURE, UNPACKED, altered, contents, edited, write

FRICTION = "resources/friction_Z.ssv"


def refusal(file: Path, capsys: pytest.CaptureFixture[str]) -> str:
    assert cli.main(["check", str(file)]) == 2
    said = capsys.readouterr().err
    assert str(file) in said
    assert UNPACKED not in said
    return said


# --- numbers and parameter sets ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("text", ["1_0", "0x1", "1e", "", "\u0661", "+", "nan", "Infinity", "1 0", "--1", "1.5."])
def test_texts_that_are_no_numbers(text: str) -> None:
    with pytest.raises(InputError, match="is no number"):
        parameter_set.number(text)


@pytest.mark.parametrize("text", ["1", "+1.", "-.5", "1.5E-3", "0", "1e308", "4.9e-324", "1e-999"])
def test_texts_that_are(text: str) -> None:
    assert parameter_set.number(text) == float(text)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1e-30000000", 0.0),
        ("-1e-999999999999", 0.0),
        ("0e30000000", 0.0),
        ("1" + "0" * 5000, "characters"),
        ("0." + "0" * 5000 + "1e5001", "characters"),
        ("1e30000000", "no number to calculate with"),
        ("1.7e308", "too large"),
    ],
)
def test_numbers_that_take_for_ever(text: str, expected: float | str) -> None:
    given = parameter_set.Parameter("F_C", "Real", text, "kN.m")
    if isinstance(expected, float):
        assert parameter_set.value(given, "Real", "N.m") == expected
    else:
        with pytest.raises(InputError, match=expected) as caught:
            parameter_set.value(given, "Real", "N.m")
        assert len(str(caught.value)) < 200


def test_a_scenario_s_number_of_too_many_digits() -> None:
    with pytest.raises(InputError, match="characters"):
        units.parse("0." + "0" * 5000 + "1 N.m", "N.m")


def test_a_unit_without_a_size(exported: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for factor in ("0", "nan", "inf", "1e999"):
        unit = f'<ssv:Units><ssc:Unit name="furlong"><ssc:BaseUnit rad="1" factor="{factor}"/></ssc:Unit>'
        file = edited(
            exported, tmp_path / "x.ssp", FRICTION, ("<ssv:Units>", unit), ('"0.04" unit="rad"', '"3" unit="furlong"')
        )
        assert "unit furlong: factor" in refusal(file, capsys)


def test_sixty_thousand_parameters(exported: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Twice the same, or unknown: told at once, and not all of them."""
    start = "<ssv:Parameters>"
    for name in ("F_C{}", "F_C"):
        many = "".join(
            f'<ssv:Parameter name="{name.format(i)}"><ssv:Real value="1"/></ssv:Parameter>' for i in range(60_000)
        )
        file = edited(exported, tmp_path / "many.ssp", FRICTION, (start, start + many))
        said = refusal(file, capsys)
        assert len(said.splitlines()) < 30
        assert "more" in said


# --- the zip file -----------------------------------------------------------------------------------------------------


def _more(text: str, entry: str) -> str:
    return text.replace('"motions": [', f'"motions": [{{"kind": "setpoints", "file": "{entry}"}},', 1)


@pytest.mark.parametrize(
    "names",
    [
        ["resources/recordings/a", "resources/recordings/a/b"],
        ["resources/recordings/" + 250 * "x"],
        [1000 * "d/" + "x"],
    ],
    ids=["file and folder", "long", "deep"],
)
def test_names_that_no_disk_takes(
    exported: Path, tmp_path: Path, names: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    file = write(tmp_path / "x.ssp", contents(exported) | dict.fromkeys(names, b"x"))
    said = refusal(file, capsys)
    assert "which is a file too" in said or "has a name of more than" in said


def test_a_path_that_no_disk_takes(capsys: pytest.CaptureFixture[str]) -> None:
    assert "cannot be read: File name too long" in refusal(Path(300 * "x" + ".ssp"), capsys)


def test_what_nobody_names_is_not_unpacked(exported: Path, tmp_path: Path) -> None:
    zeros = bytes(unpacked.FREE_BYTES + 1)
    file = write(tmp_path / "x.ssp", contents(exported) | {"extra/zeros": zeros, "resources/recordings/0.csv": zeros})
    with ssp.open_system(file) as found:
        assert not (found.fmus / "resources").exists()
        assert not (found.fmus / "extra").exists()


@pytest.mark.parametrize(
    "name", ["resources/plant.ssv", STRUCTURE, "resources/friction.fmu", "resources/recordings/0.csv"]
)
def test_what_unpacks_to_far_too_much(
    exported: Path, tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(unpacked, "RATIO", 1)  # of a file this small the rest is free anyway
    files = contents(exported) | {name: bytes(unpacked.FREE_BYTES + 1)}
    if name.endswith(".csv"):
        files[STRUCTURE] = _more(files[STRUCTURE].decode(), name).encode()
    said = refusal(write(tmp_path / "bomb.ssp", files), capsys)
    assert "at most" in said


def test_archives_inside_count_together(
    exported: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each of the archives unpacks to less than is allowed, both to more."""
    monkeypatch.setattr(unpacked, "RATIO", 1)
    files = contents(exported)
    for unit in ("friction", "controller"):
        inner = tmp_path / f"{unit}.fmu"
        inner.write_bytes(files[f"resources/{unit}.fmu"])
        half = {"resources/half": bytes(unpacked.FREE_BYTES * 2 // 3)}
        files[f"resources/{unit}.fmu"] = write(inner, contents(inner) | half).read_bytes()
    assert "unpacks to" in refusal(write(tmp_path / "nested.ssp", files), capsys)


def test_setpoints_deflate_far_less_than_is_allowed() -> None:
    """Even of axes at rest: a motion of any length is under the ratio."""
    import zlib

    rows = "".join(f"{i / 1000!r},0.8,0.0,0.327,0.0,0.1,0.0\n" for i in range(100_000)).encode()
    assert len(rows) / len(zlib.compress(rows, 9)) < unpacked.RATIO / 4


def test_a_document_type_in_utf_16(exported: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in (STRUCTURE, FRICTION):
        files = contents(exported)
        _, _, rest = files[name].decode().partition("?>")
        text = f'<?xml version="1.0" encoding="UTF-16"?><!DOCTYPE x [<!ENTITY a "b">]>{rest}'
        for encoding in ("utf-16", "utf-8"):
            files[name] = text.replace("UTF-16", encoding.upper()).encode(encoding)
            assert "document type declaration" in refusal(write(tmp_path / "x.ssp", files), capsys)
    files = contents(exported)
    _, _, rest = files[FRICTION].decode().partition("?>")
    files[FRICTION] = f'<?xml version="1.0" encoding="UTF-16"?><!-- <!DOCTYPE -->{rest}'.encode("utf-16")
    with ssp.open_system(write(tmp_path / "fine.ssp", files)):
        pass


def test_an_archive_without_a_binary(exported: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = contents(exported)
    inner = tmp_path / "friction.fmu"
    inner.write_bytes(files["resources/friction.fmu"])
    bare = {name: content for name, content in contents(inner).items() if not name.startswith("binaries/")}
    files["resources/friction.fmu"] = write(inner, bare | {"binaries/riscv64-linux/friction.so": b""}).read_bytes()
    file = write(tmp_path / "x.ssp", files)
    assert cli.main(["run", str(file), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert f"{file}: friction.fmu: has no binary for this platform" in said
    assert "it has riscv64-linux" in said
    assert not (tmp_path / "out").exists()


# --- the annotation ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda own: own.update(motions=[{"kind": "setpoints", "file": ["x"]}]), "a motion's file is no text"),
        (lambda own: own.update(motions=[{"kind": "setpoints", "file": {}}]), "a motion's file is no text"),
        (lambda own: own.update(motions=5), "its motions are no list of groups"),
        (lambda own: own.update(motions=[[]]), "its motions are no list of groups"),
        (lambda own: own.update(name=["x"]), "a name is no text"),
        (lambda own: own["machine"]["axes"]["Z"].update(friction="x"), "an axis's friction is no group"),
        (lambda own: own["machine"].update(structure="resources/structure.yaml"), "which is not in it"),
        (lambda own: own.update(note="\ud800"), "characters that no text can hold"),
        (lambda own: own.update(note=json.loads(60 * "[" + 60 * "]")), "nested too deeply"),
    ],
)
def test_an_annotation_of_other_types(
    exported: Path, tmp_path: Path, change: Callable[[dict[str, Any]], None], words: str,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    def changed(text: str) -> str:
        before, _, rest = text.partition('<feedsim:Scenario version="1">')
        own, _, after = rest.partition("</feedsim:Scenario>")
        data = json.loads(own)
        change(data)
        return f'{before}<feedsim:Scenario version="1">{escape(json.dumps(data))}</feedsim:Scenario>{after}'

    assert words in refusal(altered(exported, tmp_path / "x.ssp", STRUCTURE, changed), capsys)


def _places(data: Any, place: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    yield place
    for key, inner in data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ():
        yield from _places(inner, (*place, key))


def _replaced(data: Any, place: tuple[Any, ...], value: Any) -> Any:
    if not place:
        return value
    data = copy.deepcopy(data)
    inner = data
    for key in place[:-1]:
        inner = inner[key]
    inner[place[-1]] = value
    return data


STRANGE: tuple[Any, ...] = (
    None, True, 0, -1, 10**400, 1e400, -0.5, "", "x", "1e999 m", "nan m", "\0", "\x85", "\ud83d\ude00", "*", "&x",
    "a: b", [], ["x"], [[]], [{}], {}, {"": ""}, {"x": []}, {"file": "x"}, {"kind": []}, {"file": ["x"]},
)  # fmt: skip


@pytest.mark.extensive
def test_every_type_in_every_place(exported: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each value of the annotation replaced by each strange one, and pairs of them: words, or a scenario; never a
    traceback. What comes before and behind the annotation stays as it is, for the time it takes."""
    with ssp.open_system(exported) as found:
        kept = _parts_of(exported, monkeypatch)
        own = json.loads(kept["text"])
        places = list(_places(own))
        assert len(places) > 50
        cases = [(place, value) for place in places for value in STRANGE]
        random_ = random.Random(5)
        outcomes = {"refused": 0, "accepted": 0}
        for place, value in random_.sample(cases, 500):
            data = _replaced(own, place, value)
            if random_.random() < 0.3:
                other = random_.choice(list(_places(data)))
                data = _replaced(data, other, random_.choice(STRANGE))
            try:
                told = rebuilt.annotation(json.dumps(data), kept["files"], "x.ssp")
                for motions in (True, False):
                    found_data = rebuilt.scenario_data(kept["parts"], told, "x", found.fmus, motions=motions)
                    _load(found_data, found.fmus, exported)
                outcomes["accepted"] += 1
            except InputError:
                outcomes["refused"] += 1
        assert min(outcomes.values()) > 20, outcomes  # both happen


def _parts_of(file: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What the annotation is put together with; the archives' descriptions stay in memory."""
    kept: dict[str, Any] = {}
    annotation, scenario_data = rebuilt.annotation, rebuilt.scenario_data

    def annotated(text: Any, files: Any, where: str) -> Any:
        kept.update(text=text, files=set(files))
        return annotation(text, files, where)

    def rebuilding(parts: Any, *rest: Any, **named: Any) -> Any:
        kept["parts"] = parts
        return scenario_data(parts, *rest, **named)

    with monkeypatch.context() as patched:
        patched.setattr(rebuilt, "annotation", annotated)
        patched.setattr(rebuilt, "scenario_data", rebuilding)
        with ssp.open_system(file):
            pass
    return kept
