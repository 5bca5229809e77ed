"""Figures of stage 1: friction over speed with its plateaus, and where the plateaus were found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from feedsim.estimation.identify import IdentifiedFriction
from feedsim.estimation.identify.parameters import torque as motor_torque
from feedsim.estimation.identify.record import Record
from feedsim.estimation.identify.result import Estimate, Identification, Plateau, Stationary
from feedsim.estimation.least_squares import NORMAL_95
from feedsim.report.chart import Axis, Band, Chart, Curve, Dash, Level, Panel
from feedsim.report.content import Picture
from feedsim.report.formatting import (
    ALTERNATIVE_COLOUR,
    ORANGE,
    RECORDED_COLOUR,
    SIMULATED_COLOUR,
    Array,
    count_things,
    powers,
)
from feedsim.report.provenance import InputFile, hash_files

# --- What the report of an identification shows: error of the curve, values at the slide, units, files read -----------


MM_PER_MIN = 60e3  # per m/s
LEAST_SPEEDS = 3  # that make a curve
SAME_SPEED = 1.05  # ratio up to which two speeds are one: that of a direction and of the other, or of a repetition


def remark(identified: IdentifiedFriction) -> str:
    """For the pictures, in one line: axis and traces, and what the numbers are worth."""
    traces = identified.traces
    listed = ", ".join(traces[:4]) + (f" and {len(traces) - 4} more" if len(traces) > 4 else "")
    sentences = (f"Axis {identified.found.axis} from {listed}", *identified.notes)
    return " ".join(f"{text.rstrip('.')}." for text in sentences)


def input_files(identified: IdentifiedFriction) -> list[InputFile]:
    """Traces and mappings (hashed when they were read), and the machine's files."""
    subject, pairs = identified.subject, zip(identified.traces, identified.sources, strict=True)
    files = [InputFile("trace", name, source.sha256) for name, source in pairs]
    named = [("mapping", source.mapping) for source in identified.sources if source.mapping is not None]
    return files + hash_files([*named, *(subject.files if subject is not None else ())])


def curve_error(stage: Stationary) -> float:
    """Half width of the curve's 95 % band, relative, where it is widest within the speeds of the plateaus [1]."""
    inside = (stage.speeds >= stage.range[0] * (1 - 1e-9)) & (stage.speeds <= stage.range[1] * (1 + 1e-9))
    if not np.any(inside):
        inside[:] = True
    return float(NORMAL_95 * np.max(stage.sigma[inside] / np.abs(stage.torque[inside])))


def speeds_of(stage: Stationary) -> int:
    """Number of distinct speeds of the plateaus, whatever their direction."""
    sizes = np.sort([abs(plateau.speed) for plateau in stage.plateaus])
    return int(1 + np.count_nonzero(sizes[1:] > SAME_SPEED * sizes[:-1])) if len(sizes) else 0


def is_curve(stage: Stationary) -> bool:
    """Whether there are enough speeds to speak of a curve and of its error."""
    return speeds_of(stage) >= LEAST_SPEEDS


def at_slide(name: str, I_P: float) -> tuple[float, str] | None:
    """Factor from the motor's side (SI) to the slide, and the unit there; None where it is the same at both.

    With x = I_P angle, F = M / I_P.
    """
    if name in ("F_C", "F_S", "F_log", "M_0"):
        return 1 / I_P, "N"
    if name == "dM_0/dt":
        return 1 / I_P, "N/s"
    if name == "sigma_0":
        return 1e-6 / I_P**2, "N/um"
    if name in ("sigma_1", "sigma_2"):
        return 1e-3 / I_P**2, "N.s/mm"
    if name in ("v_s", "v_log"):
        return MM_PER_MIN * I_P, "mm/min"
    if name == "W":
        return 1e6 * I_P, "um"
    return (1 / I_P**2, "kg") if name == "J" else None


def shown_unit(estimate: Estimate) -> tuple[float, str]:
    """Factor and unit in which a value is shown on the motor's side: SI, times in ms."""
    return (1e3, "ms") if estimate.unit == "s" else (1.0, estimate.unit)


SPEED_AXIS, TIME_AXIS = Axis("motor speed", "rad/s"), Axis("time", "s")
TORQUE_AXIS = Axis("friction torque", "N·m")
ZERO = Level(0.0, dash="")
SPEED_DIRECTIONS = ((1, "positive"), (-1, "negative"))  # the second one paler
FEW_DECADES = 20  # ratio of speeds below which they are shown on a linear axis
MOST_RECORDS = 3  # with plateaus, that are shown over time


def stribeck_picture(identification: Identification, stage: Stationary) -> Picture:
    """Friction over speed with its 95 % band, the plateaus of both directions, and how far they are from the curve.

    Where stage 1 did not enter the estimates, the curve of the set that is delivered stands beside it.
    """
    values = {name: estimate.value for name, estimate in stage.estimates.items()}
    asymmetry = values["asymmetry"]
    curve, alone = is_curve(stage), "" if identification.prior else " of stage 1 alone"
    delivered = (
        " Identified set: the friction that is delivered, which stage 1 did not enter, with its constant load less "
        "stage 1's."
    )
    caption = (
        "Motor torque of every plateau less the constant load, over the amount of its speed; bars: 95 % of the "
        "mean's scatter. Below: deviation from the curve"
        + (" of its direction (dashed), which the direction dependence shifts" if asymmetry else "")
        + (f"; shaded: 95 % band of the curve{alone}" if curve else "")
        + f". Largest deviation of a plateau {powers(f'{100 * stage.worst_curve:.2g}')} %."
        + ("" if identification.prior else delivered)
    )
    return Picture("stribeck", "Stribeck curve", caption, _curves(identification, stage))


def stribeck_title(identification: Identification, stage: Stationary) -> str:
    """What is shown, and how well the curve is known."""
    known = f"known to ±{100 * curve_error(stage):.2g} % (95 %)"
    if not is_curve(stage):
        known = f"no curve: {count_things(speeds_of(stage), 'speed')}"
    return (
        f"Axis {identification.axis}: friction over speed{'' if identification.prior else ', stage 1 alone'}, {known}"
    )


def _curves(identification: Identification, stage: Stationary) -> Chart:
    """Friction over speed with its band and the plateaus, and how far these are from the curve."""
    values = {name: estimate.value for name, estimate in stage.estimates.items()}
    half = NORMAL_95 * stage.sigma
    bands, below_bands = [], []
    if is_curve(stage):
        bands = [Band("95 % band", stage.torque - half, stage.torque + half, stage.speeds, SIMULATED_COLOUR)]
        share = 100 * half / stage.torque
        below_bands = [Band("95 % band", -share, share, stage.speeds, SIMULATED_COLOUR)]
    curves = [
        Curve(
            "curve" if identification.prior else "stage 1 alone",
            stage.speeds,
            stage.torque,
            SIMULATED_COLOUR,
            width=1.8,
        )
    ]
    below = []
    for sign, word in SPEED_DIRECTIONS:
        chosen = sorted((p for p in stage.plateaus if p.speed * sign > 0), key=lambda p: abs(p.speed))
        if not chosen:
            continue
        speed = np.array([abs(p.speed) for p in chosen])
        friction = np.array([sign * (p.torque - values["M_0"]) for p in chosen])
        spread = NORMAL_95 * np.array([p.sigma for p in chosen])
        expected = _of_direction(values, sign, speed)
        name = f"plateaus, {word} direction"
        curves += _with_bars(name, speed, friction, spread, sign < 0)
        below += _with_bars(name, speed, 100 * (friction / expected - 1), 100 * spread / expected, sign < 0)
        if values["asymmetry"]:
            shown = _of_direction(values, sign, stage.speeds)
            dash: Dash = "dashed" if sign > 0 else "dotted"
            curves.append(Curve(f"curve, {word} direction", stage.speeds, shown, SIMULATED_COLOUR, dash, 0.9))
    if not identification.prior:
        curves += _delivered_curves(identification, stage)
    axis = Axis(SPEED_AXIS.label, SPEED_AXIS.unit, log=True)
    above = replace(axis, also=("axis speed", "mm/min", identification.I_P * MM_PER_MIN))
    top = max(float(np.nanmax(curve.y)) for curve in curves)
    ordinate = replace(TORQUE_AXIS, span=(0.0, 1.08 * top), also=("at the slide", "N", 1 / identification.I_P))
    return Chart(
        [
            Panel(stribeck_title(identification, stage), above, ordinate, curves, bands=bands, linked="n", height=1.5),
            Panel(
                "Deviation from the curve",
                axis,
                Axis("deviation", "%"),
                below,
                [Level(0.0, colour=SIMULATED_COLOUR, dash="")],
                below_bands,
                linked="n",
            ),
        ]
    )


def _delivered_curves(identification: Identification, stage: Stationary) -> list[Curve]:
    """The set that is delivered, in both directions.

    The plateaus have stage 1's constant load taken off, the set has its own: the difference belongs to the curves, else
    a load that asymmetry stands for would look like a misfit.
    """
    values = {name: estimate.value for name, estimate in identification.estimates.items()}
    # A load that no stage shows is not in the set; it is taken off the curve in any case.
    values.setdefault("M_0", 0.0)
    first = stage.estimates.get("M_0")
    more = values["M_0"] - first.value if first is not None else 0.0
    return [
        Curve(f"identified set, {mark}", stage.speeds, _of_direction(values, sign, stage.speeds) + sign * more,
              ALTERNATIVE_COLOUR, "" if sign > 0 else "dotted", 1.3)
        for sign, mark in ((1, "+"), (-1, "−"))
    ]  # fmt: skip


def _with_bars(name: str, x: Array, y: Array, spread: Array, faint: bool) -> list[Curve]:
    gaps = np.full(len(x), np.nan)
    bars = Curve(name, np.column_stack([x, x, gaps]).ravel(), np.column_stack([y - spread, y + spread, gaps]).ravel(),
                 RECORDED_COLOUR, width=0.9, faint=faint)  # fmt: skip
    return [Curve(name, x, y, RECORDED_COLOUR, width=3.0, dots=True, faint=faint), bars]


def plateaus_picture(identification: Identification, stage: Stationary, records: Sequence[Record]) -> Picture | None:
    """The plateaus in torque and speed over time; None without records."""
    count = {record.name: sum(p.record == record.name for p in stage.plateaus) for record in records}
    shown = sorted((r for r in records if count[r.name]), key=lambda r: -count[r.name])[:MOST_RECORDS]
    if not shown:
        return None
    own = [(record, [p for p in stage.plateaus if p.record == record.name]) for record in shown]
    remaining = sum(1 for number in count.values() if number) - len(shown)
    fate = "is not shown" if remaining == 1 else "are not shown"
    more = f" {count_things(remaining, 'more record')} with plateaus {fate}." if remaining else ""
    caption = (
        "Shaded: stretches at constant speed whose mean torque (line) counts as friction. Speeds of several "
        f"decades are drawn logarithmically in both directions.{more}"
    )
    return Picture("plateaus", "Plateaus found in the traces", caption, _over_time(own, identification.I_P))


def _over_time(shown: Sequence[tuple[Record, Sequence[Plateau]]], I_P: float) -> Chart:
    """Torque and speed of records over time, their plateaus shaded."""
    panels = []
    for k, (record, own) in enumerate(shown):
        zones = [
            Band("stretches that count", -1e9, 1e9, np.array([plateau.begin, plateau.end]), ORANGE) for plateau in own
        ]
        gap = [np.nan]
        ends = np.array([t for plateau in own for t in (plateau.begin, plateau.end, *gap)])
        means = np.array([m for plateau in own for m in (plateau.torque, plateau.torque, *gap)])
        torques = [
            Curve("motor torque", record.time, record.torque, RECORDED_COLOUR, width=0.9),
            Curve("mean of a plateau", ends, means, SIMULATED_COLOUR, width=2.2),
        ]
        speed = Curve("speed", record.time, _record_speed(record) * I_P * MM_PER_MIN, RECORDED_COLOUR, width=0.9)
        title = f"{record.name}: {count_things(len(own), 'plateau')}"
        panels += [
            Panel(title, TIME_AXIS, Axis("torque", "N·m"), torques, [ZERO], zones, linked=f"t{k}"),
            Panel("", TIME_AXIS, _speeds(speed.y, own, I_P), [speed], [ZERO], zones, linked=f"t{k}", height=0.8),
        ]  # fmt: skip
    return Chart(panels)


def _speeds(speed: Array, own: Sequence[Plateau], I_P: float) -> Axis:
    """Logarithmic in both directions from the slowest plateau on; linear where the speeds are of one order."""
    slowest = min(abs(plateau.speed) for plateau in own) * I_P * MM_PER_MIN
    wide = float(np.max(np.abs(speed))) >= FEW_DECADES * slowest
    return Axis("speed", "mm/min", symlog=slowest if wide else 0.0)


def _record_speed(record: Record) -> Array:
    if record.speed is not None:
        return record.speed
    assert record.angle is not None
    return np.asarray(np.gradient(record.angle, record.interval), dtype=np.float64)


def _of_direction(values: Mapping[str, float], sign: int, speed: Array) -> Array:
    """The curve in one direction."""
    return np.asarray(sign * (motor_torque(values, sign * speed) - values["M_0"]))
