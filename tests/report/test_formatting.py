"""How numbers, units and words are set in reports."""

from __future__ import annotations

import pytest

from feedsim.analysis import Figure
from feedsim.foundation.errors import Finding
from feedsim.report.content import Report
from feedsim.report.formatting import display_unit, duration, figure_text, minus, powers, typeset
from feedsim.report.page import html
from report_helpers import Page


@pytest.mark.parametrize(
    ("said", "printed"),
    [
        ("3 um +-1 um at -3 dB, (-2 %)", "3 µm ±1 µm at −3 dB, (−2 %)"),
        ("1.2 N.m, 0.8 N.m.s/rad, 45 deg, mass x lead^2", "1.2 N·m, 0.8 N·m·s/rad, 45°, mass x lead²"),
        ("off by 4.5e-07 m", "off by 4.5×10⁻⁷ m"),
        ("record 2026-11-24 of ISO 230-2, --tol 840d", "record 2026-11-24 of ISO 230-2, --tol 840d"),
        ('set it with load="-0.002 N.m"', 'set it with load="-0.002 N.m"'),
    ],
)
def test_words_are_printed_with_signs_of_their_own(said: str, printed: str) -> None:
    assert typeset(said) == printed
    finding = Finding("not-settled", "doubt", said)
    text = html(Report("t", "s", [], "", answer=[said], warnings=[finding], notes=[said]))
    assert [word.strip() for word in Page(text).words].count(printed) == 3


def test_a_zero_has_no_sign() -> None:
    assert [minus(text) for text in ("-0.00", "-0", "-0.01", "-5")] == ["0.00", "0", "−0.01", "−5"]


def test_units_to_a_power() -> None:
    assert [display_unit(unit) for unit in ("m/s^3", "m/s2", "kg.m2", "deg")] == ["m/s³", "m/s²", "kg·m²", "°"]


def test_a_delay_is_told_in_microseconds() -> None:
    assert [figure_text(Figure(value, "ms", ""))[0] for value in (0.3519, -3.94217, 99.02)] == [
        "0.352",
        "−3.942",
        "99.0",
    ]


def test_durations_read_well() -> None:
    assert [duration(t) for t in (125e-6, 1e-3, 1e-6, 0.25, 2.0)] == ["125 µs", "1 ms", "1 µs", "250 ms", "2 s"]


@pytest.mark.parametrize(
    ("text", "printed"),
    [
        ("0.0000147", "1.47×10⁻⁵"),
        ("1.5057e-05", "1.5057×10⁻⁵"),
        ("0.0000120 to 0.0000174", "1.20×10⁻⁵ to 1.74×10⁻⁵"),
        ("-0.0000120 to 0.2", "-1.20×10⁻⁵ to 0.2"),
        ("3e-12", "3×10⁻¹²"),
        ("0.0001", "0.0001"),
        ("0.0000", "0.0000"),
        ("1.6000", "1.6000"),
        ("1e+06", "1e+06"),
    ],
)
def test_small_numbers_have_a_power_of_ten(text: str, printed: str) -> None:
    assert powers(text) == printed
