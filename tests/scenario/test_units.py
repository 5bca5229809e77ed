"""Quantities with units: exact conversion, dimensions with angle, messages."""

import math
from decimal import Decimal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from feedsim.foundation import units
from feedsim.foundation.errors import InputError


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("5000 mm/min", "m/s", 5 / 60),
        ("150 m/s^3", "m/s^3", 150.0),
        ("150 m/s**3", "m/s^3", 150.0),
        ("150 m/s3", "m/s^3", 150.0),
        ("150 m/s³", "m/s^3", 150.0),
        ("125 us", "s", 125e-6),
        ("125 µs", "s", 125e-6),
        ("125 μs", "s", 125e-6),  # Greek letter instead of the micro sign
        ("1.326 ms", "s", 1.326e-3),
        ("21.59 N.m.s/rad", "N.m.s/rad", 21.59),
        ("21.59 N m s / rad", "N.m.s/rad", 21.59),
        ("21.59 N·m·s/rad", "N.m.s/rad", 21.59),
        ("21.59 Nm/(rad/s)", "N.m.s/rad", 21.59),
        ("2.4 N.m/A", "N.m/A", 2.4),
        ("0.25 Ohm", "Ohm", 0.25),
        ("0.25 ohm", "Ohm", 0.25),
        ("0.25 Ω", "Ohm", 0.25),
        ("250 mOhm", "Ohm", 0.25),
        ("10 V/A", "Ohm", 10.0),
        ("5.0 mH", "H", 5e-3),
        ("0.27 V.s", "Wb", 0.27),
        ("14.4 kg.m/s2", "N", 14.4),
        ("35 %", "1", 0.35),
        ("35%", "1", 0.35),
        ("0.35", "1", 0.35),
        ("100mm", "m", 0.1),
        (" +1e2 mm ", "m", 0.1),
        ("-.5 m", "m", -0.5),
        ("0 rad", "rad", 0.0),
    ],
)
def test_conversion_is_correctly_rounded(text: str, unit: str, value: float) -> None:
    # Equality: a factor is an exact fraction, so the result is the double nearest to the exact value.
    assert units.parse(text, unit) == value


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("4 (m/min)/mm", "1/s", 200 / 3),
        ("455 Hz", "rad/s", 455 * 2 * math.pi),
        ("455 rev/s", "Hz", 455.0),
        ("1 rpm", "rad/s", math.pi / 30),
        ("180 deg", "rad", math.pi),
        ("180 °", "rad", math.pi),
        ("20 mm/rev", "m/rad", 0.02 / (2 * math.pi)),
    ],
)
def test_angles_and_gains(text: str, unit: str, value: float) -> None:
    # One rounding of the expected value's own arithmetic.
    assert units.parse(text, unit) == pytest.approx(value, rel=4e-16, abs=0)


@given(st.decimals(min_value="-1e6", max_value="1e6", allow_nan=False, places=6))
def test_scaling_by_powers_of_ten_only_moves_the_point(number: Decimal) -> None:
    assert units.parse(f"{number} um", "m") == float(number.scaleb(-6))
    assert units.parse(f"{number} kN", "N") == float(number.scaleb(3))


def test_hertz_is_never_silently_one_over_second_or_radian_per_second() -> None:
    assert units.parse("747.3 Hz", "rad/s") != pytest.approx(747.3, rel=0.5)
    with pytest.raises(InputError, match="Hz and rad/s hold an angle"):
        units.parse("66.67 Hz", "1/s")
    with pytest.raises(InputError):
        units.parse("747.3 1/s", "rad/s")


@pytest.mark.parametrize(
    ("text", "unit", "message"),
    [
        ("5000 mm", "m/s", "'5000 mm' is a length; a speed is expected, for example 5000 mm/min"),
        ("5000", "m/s", "5000 has no unit; a speed is expected, for example 5000 mm/min"),
        ("5 kg.m^3", "N.m", "'5 kg.m^3' is a length^3*mass; a torque is expected, for example 2.1 N.m"),
        ("5,5 mm", "m", "write a decimal point, not a comma"),
        ("5 MM", "m", "unknown unit 'MM'; did you mean 'mm'?"),
        ("5 inch", "m", "unknown unit 'inch'; did you mean 'in'?"),
        ("5 furlong", "m", "unknown unit 'furlong'; known are m, "),
        ("6 N.m/rad.s", "N.m.s/rad", "ambiguous; put what stands under the line in brackets"),
        ("fast", "m/s", "'fast' is not a number with a unit; a speed is expected"),
        ("", "m/s", "'' is not a number with a unit"),
        ("nan m/s", "m/s", "is not a number with a unit"),
        ("1e400 m", "m", "too large"),
        ("1e306 km", "m", "too large"),
        ("5 m$", "m", "holds '$'"),
    ],
)
def test_messages(text: str, unit: str, message: str) -> None:
    with pytest.raises(InputError) as caught:
        units.parse(text, unit)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    "text",
    [
        "m/",
        "/s",
        "m^",
        "m^^2",
        "m^2^2",
        "(m",
        "m)",
        "()",
        "m^0.5",
        "m/0",
        "2 m",
        "m^99",
        "(mm^9)^9",
        "m**",
        "m_s",
        "m " * 99,
    ],
)
def test_bad_unit_expressions_are_refused(text: str) -> None:
    with pytest.raises(InputError):
        units.unit(text)


@given(st.text(alphabet="mskgNVAHrad/.*^() 129-%°", max_size=30))
def test_any_text_is_read_or_refused(text: str) -> None:
    try:
        units.unit(text)
    except InputError:
        return


def test_a_tiny_number_does_not_take_long() -> None:
    assert units.parse("1e-999999999 mm", "m") == 0.0


def test_factor_between_units() -> None:
    assert units.convert(250.0, "mm", "m") == 0.25
    with pytest.raises(InputError, match="unit 'A' is that of a current; one of a length is expected"):
        units.factor("A", "m")


def test_every_unit_of_messages_can_be_read() -> None:
    for unit, (_, example) in units.QUANTITY_NAMES.items():
        units.parse(example, unit)
    for spelling in (*units.UNIT_SYMBOLS, *units.ALIASES):
        assert units.unit(spelling).factor > 0


def test_a_long_word_is_refused_at_once() -> None:
    """Letters ahead of a character that no unit has; tried in every way, it would take years."""
    with pytest.raises(InputError, match="holds '&'"):
        units.unit("o" * 50 + "&")
