"""The packager reads unit expressions and tables, and refuses what no importer would notice."""

import math
from pathlib import Path

import pytest

from feedsim_packager import checkout, table, units, variables
from feedsim_packager.errors import CompilerError, InputError
from fmu.toy_table import GOOD, HEAD, read

# --- units

BASE_UNITS = {
    # From the table of units in the FMI 2.0 standard (2.2.2), and by hand from the SI.
    "N.m": ({"kg": 1, "m": 2, "s": -2}, 1.0),
    "rad/s": ({"rad": 1, "s": -1}, 1.0),
    "rpm": ({"rad": 1, "s": -1}, 0.1047197551196598),
    "Hz": ({"rad": 1, "s": -1}, 6.283185307179586),
    "deg": ({"rad": 1}, 0.017453292519943295),
    "1": ({}, 1.0),
    "%": ({}, 0.01),
    "km": ({"m": 1}, 1000.0),
    "N.m/rad": ({"kg": 1, "m": 2, "s": -2, "rad": -1}, 1.0),
    "N.m.s/rad": ({"kg": 1, "m": 2, "s": -1, "rad": -1}, 1.0),
    "N.m/A": ({"kg": 1, "m": 2, "s": -2, "A": -1}, 1.0),
    "V": ({"kg": 1, "m": 2, "s": -3, "A": -1}, 1.0),
    "Ohm": ({"kg": 1, "m": 2, "s": -3, "A": -2}, 1.0),
    "V/A": ({"kg": 1, "m": 2, "s": -3, "A": -2}, 1.0),
    "H": ({"kg": 1, "m": 2, "s": -2, "A": -2}, 1.0),
    "m/rad": ({"m": 1, "rad": -1}, 1.0),
    "1/s": ({"s": -1}, 1.0),
    "s-1": ({"s": -1}, 1.0),
    "m/s2": ({"m": 1, "s": -2}, 1.0),
    "m/s^3": ({"m": 1, "s": -3}, 1.0),
    "g": ({"kg": 1}, 0.001),
    "kg.m^2": ({"kg": 1, "m": 2}, 1.0),
    "mm/min": ({"m": 1, "s": -1}, 1 / 60000),
}


@pytest.mark.parametrize("name", BASE_UNITS)
def test_unit_is_reduced_to_base_units(name: str) -> None:
    exponents, factor = BASE_UNITS[name]
    unit = units.parse(name)
    assert dict(zip(units.BASE, unit.exponents, strict=True)) == dict.fromkeys(units.BASE, 0) | exponents
    # One rounding of the exact fraction and one of the product with pi.
    assert math.isclose(unit.factor, factor, rel_tol=3e-16)


@pytest.mark.parametrize(
    ("unit", "display", "factor"),
    [
        ("m", "mm", 1e3),
        ("m", "um", 1e6),
        ("s", "us", 1e6),
        ("s", "ms", 1e3),
        ("H", "mH", 1e3),
        ("1", "%", 100.0),
        ("m/rad", "mm/rad", 1e3),
        ("1/s", "(m/min)/mm", 0.06),  # K_v = 66.67 1/s is 4 (m/min)/mm
        ("rad/s", "rpm", 9.54929658551372),
        ("rad", "deg", 57.29577951308232),
        ("N.m", "N.m", 1.0),
    ],
)
def test_display_factor_is_right_to_the_last_bit(unit: str, display: str, factor: float) -> None:
    assert units.conversion(unit, display) == factor


@pytest.mark.parametrize(
    ("unit", "display"), [("rad/s", "1/s"), ("rad", "1"), ("m", "s"), ("N.m", "N.m/rad"), ("1/s", "Hz")]
)
def test_units_of_different_dimension_do_not_convert(unit: str, display: str) -> None:
    with pytest.raises(units.UnitError, match="does not fit"):
        units.conversion(unit, display)


@pytest.mark.parametrize("text", ["", "foo", "N.", "/s", "N..m", "(m/min", "m)", "m s", "kkg", "mmin", "2", "m/", "()"])
def test_unit_that_is_not_understood_is_refused(text: str) -> None:
    with pytest.raises(units.UnitError):
        units.parse(text)


# --- tables


def test_rows_are_read_as_they_are_spelled(tmp_path: Path, compiler: tuple[str, ...]) -> None:
    found = read(tmp_path, GOOD, compiler)
    assert found.unit == "toy"
    assert found.summary == "A unit for tests"
    assert [row.name for row in found.scalars] == ["v", "u", "group.y", "k", "group.n", "on", "lit", "path"]
    assert [row.field for row in found.scalars] == ["v", "u", "group_y", "k", "group_n", "on", "lit", "path"]
    assert [row.line for row in found.scalars] == [2, 3, 4, 5, 6, 7, 8, 9]
    _v, _u, y, k, n, _on, lit, path = found.scalars
    assert (y.description, y.depends, y.display_unit) == ('Out "quoted", with comma', ("u",), "um")
    assert y.depends_initially == ("v",)
    assert (k.start, k.min, k.max, k.description) == ("125e-6", "-1", "2.5", "Gain; in two pieces")
    assert (n.kind, n.start, n.minimum, n.maximum) == ("INTEGER", "-3", -5, 7)
    assert (lit.kind, lit.min, lit.max, lit.depends) == ("BOOLEAN", "NO_MIN", "NO_MAX", ("u",))
    assert path.start == "a|b \\ c"


def test_fingerprint_is_the_agreed_text(tmp_path: Path, compiler: tuple[str, ...]) -> None:
    found = read(tmp_path, GOOD, compiler)
    assert found.fingerprint_text().splitlines() == [
        "v|REAL|input|discrete|0|m|NO_MIN|NO_MAX",
        "u|REAL|input|continuous|0|m|NO_MIN|NO_MAX",
        "group.y|REAL|output|continuous|0|m|NO_MIN|NO_MAX",
        "k|REAL|parameter|tunable|125e-6|1|-1|2.5",
        "group.n|INTEGER|parameter|fixed|-3||-5|7",
        "on|BOOLEAN|parameter|fixed|1||NO_MIN|NO_MAX",
        "lit|BOOLEAN|output|discrete|0||NO_MIN|NO_MAX",
        "path|STRING|parameter|fixed|a|b \\ c||NO_MIN|NO_MAX",
    ]


@pytest.mark.parametrize(
    ("data", "digits"),  # published test vectors of FNV-1a, 64 bit
    [(b"", "cbf29ce484222325"), (b"a", "af63dc4c8601ec8c"), (b"foobar", "85944171f73967e8")],
)
def test_hash_is_fnv1a(data: bytes, digits: str) -> None:
    assert variables.fnv1a_64(data) == digits


def test_all_faults_of_a_table_are_listed_with_their_lines(tmp_path: Path, compiler: tuple[str, ...]) -> None:
    rows = HEAD + (
        'REAL(u, input, continuous, 0, "m", "mm", NO_MIN, NO_MAX, "", "In")\n'
        'REAL(u, input, continuous, 0, "m", "mm", NO_MIN, NO_MAX, "", "Again")\n'
        'REAL(high, parameter, fixed, 3, "m", "mm", 0, 2, "", "Start above max")\n'
        'REAL(turned, parameter, fixed, 1, "m", "mm", 2, 0, "", "Bounds turned")\n'
        'REAL(word, parameter, fixed, PI, "m", "mm", NO_MIN, NO_MAX, "", "Start is a word")\n'
        'REAL(huge, parameter, fixed, 1e999, "m", "mm", NO_MIN, NO_MAX, "", "Start is infinite")\n'
        'REAL(unit, parameter, fixed, 1, "parsec", "m", NO_MIN, NO_MAX, "", "Unit unknown")\n'
        'REAL(shown, parameter, fixed, 1, "m", "s", NO_MIN, NO_MAX, "", "Display unit of other dimension")\n'
        'REAL(moving, parameter, continuous, 1, "m", "m", NO_MIN, NO_MAX, "", "Variability not legal")\n'
        'REAL(what, wish, fixed, 1, "m", "m", NO_MIN, NO_MAX, "", "Causality not legal")\n'
        'INTEGER(octal, parameter, fixed, 010, 0, 100, "", "Octal")\n'
        'INTEGER(large, parameter, fixed, 3000000000, NO_MIN, NO_MAX, "", "Too large")\n'
        'BOOLEAN(maybe, parameter, fixed, 2, "", "Neither 0 nor 1")\n'
        'BOOLEAN(flows, output, continuous, 0, "", "Continuous Boolean")\n'
        'REAL(y, output, continuous, 5, "m", "m", NO_MIN, NO_MAX, "high (nothing)", "Depends on what is no input")\n'
        'REAL(silent, parameter, fixed, 1, "m", "m", NO_MIN, NO_MAX, "u", "")\n'
        f'STRING(text, parameter, fixed, "{"x" * 1024}", "Too long")\n'
    )
    with pytest.raises(InputError) as caught:
        read(tmp_path, rows, compiler)
    found = caught.value.problems
    expected = {
        3: ["name u is already used in line 2", "field u is already used in line 2"],
        4: ["start 3 is outside 0 to 2"],
        5: ["min 2 is above max 0"],
        6: ["start PI is not a plain number"],
        7: ["start 1e999 is beyond"],
        8: ["'parsec'"],
        9: ["'s' [s] does not fit unit 'm' [m]"],
        10: ["variability continuous is not allowed for causality parameter (allowed: fixed or tunable)"],
        11: ["causality wish is none of"],
        12: ["start 010 is not a plain integer"],
        13: ["start 3000000000 is beyond"],
        14: ["start 2 is not 0 or 1"],
        15: ["continuous is for REAL alone"],
        16: ["depends on high", "depends on nothing", "start must be 0"],
        17: ["description is empty", "only outputs and locals depend"],
        18: ["1025 bytes"],
    }
    for line, texts in expected.items():
        for text in texts:
            assert any(p.startswith(f"line {line}: ") and text in p for p in found), (line, text, found)
    assert len(found) == sum(map(len, expected.values())), found
    assert str(tmp_path / "variables.def") in str(caught.value)


@pytest.mark.parametrize("rows", ['REALL(u, input, 0, "m")\n', GOOD + "stray\n", "stray " + GOOD])
def test_what_is_no_row_is_refused(tmp_path: Path, rows: str, compiler: tuple[str, ...]) -> None:
    with pytest.raises(InputError, match=r"not a row: (REALL|stray)"):
        read(tmp_path, rows, compiler)


def test_row_with_too_few_columns_is_told_by_line(tmp_path: Path, compiler: tuple[str, ...]) -> None:
    with pytest.raises(CompilerError, match=r"variables\.def:2"):
        read(tmp_path, HEAD + 'REAL(u, input, continuous, 0, "m")\n', compiler)


def test_empty_table_is_refused(tmp_path: Path, compiler: tuple[str, ...]) -> None:
    with pytest.raises(InputError, match="no rows"):
        read(tmp_path, HEAD, compiler)


def test_folder_without_table_is_refused(tmp_path: Path, compiler: tuple[str, ...]) -> None:
    with pytest.raises(InputError, match=r"variables\.def: no such file"):
        table.read(tmp_path, (checkout.SHELL,), compiler)
