"""Causes of circles that are not round, put into the simulated machine and found in its circles again."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path

import pytest

from feedsim import analysis, scenario
from feedsim.analysis import Diagnosis, Figure
from feedsim.simulation import cosim

CIRCLE = Path(__file__).resolve().parents[2] / "scenarios" / "xz_circle.yaml"
SPEED = 0.05  # m/s
NO_FEEDFORWARD = ("machine.axes.X.drive.k_ffw=0", "machine.axes.Z.drive.k_ffw=0")

Driven = Callable[..., tuple[Mapping[str, Figure], Diagnosis]]


def gains(x: float, z: float) -> tuple[str, ...]:
    """K_v of X and Z in (m/min)/mm, without speed feedforward."""
    return (
        *NO_FEEDFORWARD,
        f"machine.axes.X.drive.K_v={x:g} (m/min)/mm",
        f"machine.axes.Z.drive.K_v={z:g} (m/min)/mm",
    )


@pytest.fixture(scope="module")
def driven(fmus: Path) -> Driven:
    @cache
    def run(*overrides: str) -> tuple[Mapping[str, Figure], Diagnosis]:
        result = cosim.run(scenario.load(CIRCLE, list(overrides)), fmus=fmus)
        return analysis.evaluate(result), analysis.diagnoses(result)["XZ"]

    return run


def test_unlike_gains_are_a_servo_mismatch(driven: Driven) -> None:
    """Without feedforward an axis is 1/K_v late, whatever its inner loops: 15 ms at 4 (m/min)/mm, 12 ms at 5."""
    figures, found = driven(*gains(4, 5))
    late = 60e-3 / 4 - 60e-3 / 5
    assert figures["XZ.servo_mismatch"].value == pytest.approx(late * 1e3, rel=0.01)
    assert found["servo"].size / 2 == pytest.approx(SPEED * late / 2, rel=0.01)
    assert found["servo"].share > 0.99
    assert figures["XZ.squareness"].value == pytest.approx(0, abs=1)
    assert "X lags Z by 3.0 ms" in analysis.explain_circle(found)


def test_peaks_of_unlike_gains_are_those_of_like_ones(driven: Driven) -> None:
    """On an ellipse of 75 um: each axis' peak as in a machine of which both axes have its gain."""
    unlike = driven(*gains(4, 5))[0]
    for axis, gain in (("X", 4), ("Z", 5)):
        like = driven(*gains(gain, gain))[0]
        assert unlike[f"XZ.peak_{axis}"].value == pytest.approx(like[f"XZ.peak_{axis}"].value, abs=0.3)
        assert unlike[f"XZ.glitch_{axis}"].value > 60  # what the old definition makes of it


def test_glitches_that_are_none_are_told(driven: Driven) -> None:
    for overrides, axes in ((gains(4, 5), ["X", "Z"]), ((), [])):
        figures, found = driven(*overrides)
        told = analysis.doubt_figures(figures, {"XZ": found})
        assert {finding.code for finding in told} <= {"glitch-misleading"}
        assert [finding.text.split("glitch_")[1][0] for finding in told] == axes


def test_one_direction_does_not_name_which(driven: Driven) -> None:
    figures, found = driven(*gains(4, 5), "motions.0.direction=counterclockwise")
    assert figures["XZ.squareness_or_servo"].value == pytest.approx(75, rel=0.01)
    assert not {"XZ.servo_mismatch", "XZ.squareness"} & set(figures)
    assert "record the other direction" in analysis.explain_circle(found)


def test_the_first_direction_is_the_circle_of_one_direction(driven: Driven) -> None:
    """Bit for bit: what follows does not reach back."""
    both, one = driven()[0], driven("motions.0.direction=counterclockwise")[0]
    names = [name for name in one if name in both and name.split(".")[1] in ("G", "F_max", "glitch_X+", "tool", "mean")]
    assert len(names) > 10
    assert {name: both[name].value for name in names} == {name: one[name].value for name in names}


def test_second_direction_is_that_circle_alone(driven: Driven) -> None:
    """Friction has other rests behind it at its start; a turn later nothing of that is left."""
    both, alone = driven()[0], driven("motions.0.direction=clockwise")[0]
    for name in ("G", "F_max", "mean", "glitch_X", "glitch_Z"):
        assert both[f"XZ.clockwise.{name}"].value == pytest.approx(alone[f"XZ.{name}"].value, abs=0.01)


def test_hysteresis_of_a_servo_mismatch_is_twice_its_ellipse(driven: Driven) -> None:
    """Two ellipses along +45 and -45 deg: H is 2 * 75 um, at 45 deg; G(b) too."""
    figures, _ = driven(*gains(4, 5))
    assert figures["XZ.H"].value == pytest.approx(150, rel=0.01)
    assert figures["XZ.G_b"].value == pytest.approx(150, rel=0.01)


def test_path_lag_is_told_from_what_friction_makes_of_the_radius(driven: Driven) -> None:
    """With feedforward there is none. Without it and with other gains the radius changes by what is told."""
    with_it = driven()[0]
    assert with_it["XZ.radius_lag"].value == pytest.approx(0, abs=0.01)
    friction = with_it["XZ.radius_change"].value
    for overrides in (NO_FEEDFORWARD, gains(3, 5)):
        figures = driven(*overrides)[0]
        assert figures["XZ.radius_lag"].value < -5
        assert figures["XZ.radius_change"].value - friction == pytest.approx(figures["XZ.radius_lag"].value, abs=0.05)


def test_cogging_is_named_with_its_order_and_torque(driven: Driven) -> None:
    figures, found = driven(
        "motions.0.radius=60 mm", "machine.axes.X.drive.cogging_1.order=6",
        "machine.axes.X.drive.cogging_1.amplitude=0.4 N.m",
    )  # fmt: skip
    (term,) = (each for each in found.terms if each.key == "cogging")
    assert (term.axis, term.order) == ("X", 6)
    assert abs(term.value - 0.4) < term.half < 0.02
    assert figures["XZ.cogging_X_6"].value == term.value
    assert "cogging of X, 6 per turn" in [analysis.circle.term_name(each) for each in found.terms]
    assert not found.vibrations  # it is no vibration
    clean = driven("motions.0.radius=60 mm")[1]
    assert not [each for each in clean.terms if each.key == "cogging"]
    for axis in "XZ":  # the peaks are those of the machine without it
        assert found[f"peaks {axis}"].value == pytest.approx(clean[f"peaks {axis}"].value, rel=0.01)


@pytest.mark.parametrize(
    ("settings", "key", "size"),
    [
        (("encoder.eccentricity=0.6 mrad",), "pitch X", 0.6e-3 * 20e-3 / (2 * math.pi)),
        (("periodic_error_1.period=20 mm", "periodic_error_1.amplitude=2 um"), "pitch X", 2e-6),
        (("backlash_compensation.value=8 um",), "lost_motion X", -8e-6),
        ((), "", 0.0),
    ],
)  # fmt: skip
def test_a_fast_small_circle_has_its_cause_alone(
    driven: Driven, settings: tuple[str, ...], key: str, size: float
) -> None:
    """8.3 pitches a second, three of them in the circle, and friction that acts all the way round: unlike amplitudes
    are those of the linear response, and nothing else is there."""
    changes = tuple(f"machine.axes.X.drive.{each}" for each in settings)
    if key and "encoder" in settings[0]:
        changes += tuple(f"machine.axes.{axis}.drive.measuring.indirect=true" for axis in "XZ")
    _, found = driven("motions.0.radius=30 mm", "motions.0.feed=10 m/min", *changes)
    if key:
        term = found[key]
        assert abs(term.value - size) <= term.half < 0.35e-6
    assert found.unlike is not None
    for term in found.terms:
        if term.key in ("servo", "squareness", "lost_motion", "pitch", "cogging") and f"{term.key} {term.axis}" != key:
            assert not (term.shows and term.size > 0.5e-6), term
        if term.key == "scale":
            assert abs(term.value - found.unlike) <= term.half
