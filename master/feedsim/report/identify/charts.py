"""The charts of an identification as data."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from feedsim.identify.record import Record
from feedsim.identify.result import NORMAL_95, Balance, Correlation, Drift, Identification, Plateau, Stationary, Stretch
from feedsim.report.chart import Axis, Band, Chart, Curve, Grid, Level, Panel, column_of
from feedsim.report.identify.quantities import MM_PER_MIN, is_curve
from feedsim.report.style import BLUE, GREEN, INK, ORANGE, PURPLE, VERMILLION, Array

SPEED, TIME = Axis("motor speed", "rad/s"), Axis("time", "s")
FRICTION = Axis("friction torque", "N·m")
ZERO = Level(0.0, dash="")
ZEROS = (ZERO, Level(0.0, upright=True, dash=""))
DIRECTIONS = ((1, BLUE, "positive"), (-1, VERMILLION, "negative"))

# Friction [N.m] over amounts of the speed [rad/s] in one direction.
OfDirection = Callable[[Mapping[str, float], int, Array], Array]


def stribeck_chart(found: Identification, stage: Stationary, of_direction: OfDirection) -> Chart:
    """Friction over speed with its band and the plateaus, and how far these are from the curve."""
    values = {name: each.value for name, each in stage.estimates.items()}
    half = NORMAL_95 * stage.sigma
    bands, below_bands = [], []
    if is_curve(stage):
        bands = [Band("95 % band", stage.torque - half, stage.torque + half, stage.speeds, GREEN)]
        share = 100 * half / stage.torque
        below_bands = [Band("95 % band", -share, share, stage.speeds, GREEN)]
    curves = [Curve("curve" if found.prior else "stage 1 alone", stage.speeds, stage.torque, GREEN, width=1.8)]
    below = []
    for sign, colour, word in DIRECTIONS:
        chosen = sorted((p for p in stage.plateaus if p.speed * sign > 0), key=lambda p: abs(p.speed))
        if not chosen:
            continue
        speed = np.array([abs(p.speed) for p in chosen])
        friction = np.array([sign * (p.torque - values["M_0"]) for p in chosen])
        spread = NORMAL_95 * np.array([p.sigma for p in chosen])
        expected = of_direction(values, sign, speed)
        name = f"plateaus, {word} direction"
        curves += _with_bars(name, speed, friction, spread, colour)
        below += _with_bars(name, speed, 100 * (friction / expected - 1), 100 * spread / expected, colour)
        if values["asymmetry"]:
            shown = of_direction(values, sign, stage.speeds)
            curves.append(Curve(f"curve, {word} direction", stage.speeds, shown, colour, "dashed", 0.9))
    if not found.prior:
        curves += _delivered(found, stage, of_direction)
    axis = Axis(SPEED.label, SPEED.unit, log=True)
    top = max(float(np.nanmax(each.y)) for each in curves)
    per = found.I_P * MM_PER_MIN
    return Chart([
        Panel("Friction over speed", axis, Axis(FRICTION.label, FRICTION.unit, span=(0.0, 1.08 * top)), curves,
              bands=bands, linked="n", height=1.5, note=f"1 rad/s of the motor is {per:.4g} mm/min of the axis"),
        Panel("Deviation from the curve", axis, Axis("deviation", "%"), below, [Level(0.0, colour=GREEN, dash="")],
              below_bands, linked="n"),
    ])  # fmt: skip


def _delivered(found: Identification, stage: Stationary, of_direction: OfDirection) -> list[Curve]:
    values = {name: each.value for name, each in found.estimates.items()}
    values.setdefault("M_0", 0.0)
    first = stage.estimates.get("M_0")
    more = values["M_0"] - first.value if first is not None else 0.0
    return [
        Curve(f"identified set, {mark}", stage.speeds, of_direction(values, sign, stage.speeds) + sign * more, PURPLE,
              "" if sign > 0 else "dotted", 1.3)
        for sign, mark in ((1, "+"), (-1, "−"))
    ]  # fmt: skip


def _with_bars(name: str, x: Array, y: Array, spread: Array, colour: str) -> list[Curve]:
    gaps = np.full(len(x), np.nan)
    bars = Curve(name, np.column_stack([x, x, gaps]).ravel(), np.column_stack([y - spread, y + spread, gaps]).ravel(),
                 colour, width=0.9)  # fmt: skip
    return [Curve(name, x, y, colour, width=3.0, dots=True), bars]


def plateaus_chart(
    shown: Sequence[tuple[Record, Sequence[Plateau]]], speed_of: Callable[[Record], Array], I_P: float
) -> Chart | None:
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
            Curve("motor torque", record.time, record.torque, BLUE, width=0.9),
            Curve("mean of a plateau", ends, means, VERMILLION, width=2.2),
        ]
        speed = Curve("speed", record.time, speed_of(record) * I_P * MM_PER_MIN, BLUE, width=0.9)
        panels += [
            Panel(f"{record.name}: torque", TIME, Axis("torque", "N·m"), torques, [ZERO], zones, linked=f"t{k}"),
            Panel(f"{record.name}: speed", TIME, Axis("speed", "mm/min"), [speed], [ZERO], zones, linked=f"t{k}",
                  height=0.8),
        ]  # fmt: skip
    return column_of(panels)


def loops_chart(
    shown: Sequence[Stretch], abscissae: Sequence[tuple[Array, Axis]], describe: Callable[[Stretch], str], columns: int
) -> Chart:
    """Measured and model torque of each move over one abscissa."""
    panels = [
        Panel(describe(stretch), axis, FRICTION,
              [Curve("measured", x, stretch.measured, BLUE, width=1.0, dots=True, most=2000),
               Curve("model", x, stretch.model, VERMILLION, width=1.2, most=2000)], ZEROS)
        for stretch, (x, axis) in zip(shown, abscissae, strict=True)
    ]  # fmt: skip
    return Chart(panels, (1.0,) * columns)


def residuals_chart(
    stretches: Sequence[Stretch], positions: Sequence[Array], unit: str, names: Sequence[str], colours: Sequence[str]
) -> Chart:
    """Measured less model over time, stretches one after another, over speed and over position."""
    begin, over_time, levels, over_speed, over_position = 0.0, [], [ZERO], [], []
    residual = Axis("residual", "N·m")
    for stretch, position, name, colour in zip(stretches, positions, names, colours, strict=True):
        left = stretch.measured - stretch.model
        time = stretch.time - stretch.time[0] + begin
        over_time.append(Curve(name, time, left, colour, width=0.9))
        for sign in (1, -1):
            level = sign * NORMAL_95 * stretch.weight
            levels.append(Level(level, ends=(float(time[0]), float(time[-1]))))
        over_speed.append(Curve(name, stretch.speed, left, colour, width=1.0, dots=True, most=1500))
        over_position.append(Curve(name, position, left, colour, width=1.0, dots=True, most=1500))
        begin = float(time[-1])
    time_axis = Axis("time, stretches one after another", "s")
    return Chart([
        Panel("Measured less model", time_axis, residual, over_time, levels),
        Panel("Over speed", SPEED, residual, over_speed, [ZERO]),
        Panel("Over position", Axis("position about the middle of the move", unit), residual, over_position, [ZERO]),
    ])  # fmt: skip


def open_loop_chart(drifts: Sequence[Drift], balance: Balance, mm: float) -> Chart:
    """Position and its error over time, before and after, a column per record. mm: per radian."""
    after = "open loop, after" if balance.applied else "open loop, tried"
    above, below = [], []
    for k, drift in enumerate(drifts):
        position = [
            Curve("recorded", drift.time, mm * drift.angle, INK, width=1.6),
            Curve("open loop, before", drift.time, mm * (drift.angle - drift.before), BLUE, width=1.1),
            Curve(after, drift.time, mm * (drift.angle - drift.after), VERMILLION, "dashed", 1.1),
        ]
        error = [
            Curve("open loop, before", drift.time, mm * drift.before, BLUE, width=1.1),
            Curve(after, drift.time, mm * drift.after, VERMILLION, width=1.1),
        ]
        above.append(Panel(drift.record, TIME, Axis("position", "mm"), position, linked=f"t{k}"))
        below.append(Panel("", TIME, Axis("recorded less open loop", "mm"), error, [ZERO], linked=f"t{k}", height=0.8))
    return Chart([*above, *below], (1.0,) * len(drifts))


def correlation_chart(axis: str, correlation: Correlation) -> Chart:
    """The matrix; the diagonal, which says nothing, is empty."""
    matrix = np.array(correlation.matrix, dtype=float)
    np.fill_diagonal(matrix, np.nan)
    title = f"Axis {axis}: correlation of the parameters"
    return Chart([Grid(title, correlation.names, correlation.names, matrix, (-1.0, 1.0))])
