"""Figures of stage 1: friction over speed with its plateaus, and where the plateaus were found."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from feedsim.identify.parameters import torque as motor_torque
from feedsim.identify.record import Record
from feedsim.identify.result import NORMAL_95, Identification, Stationary
from feedsim.report import style
from feedsim.report.formatting import counted
from feedsim.report.identify.charts import plateaus_chart, stribeck_chart
from feedsim.report.identify.quantities import MM_PER_MIN, curve_error, is_curve, speeds_of
from feedsim.report.labels import heading, legend_above
from feedsim.report.picture import Picture
from feedsim.report.style import Array, Drawn, drawing, finish, thinned

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DIRECTIONS = ((1, style.BLUE, "^", "positive"), (-1, style.VERMILLION, "v", "negative"))
TITLE_PAD, LEGEND_PAD = 58.0, 37.0  # points above the axes, clear of the scale at the top
FEW_DECADES = 20  # ratio of speeds below which an axis is labelled between the decades too, or is linear
MOST_RECORDS = 3  # with plateaus, that are shown over time


def stribeck_picture(found: Identification, stage: Stationary) -> Picture:
    """Friction over speed with its 95 % band, the plateaus of both directions, and how far they are from the curve.

    Where stage 1 did not enter the estimates, the curve of the set that is delivered stands beside it.
    """
    values = {name: each.value for name, each in stage.estimates.items()}
    load, asymmetry = values["M_0"], values["asymmetry"]
    curve, alone = is_curve(stage), "" if found.prior else " of stage 1 alone"

    def draw() -> Drawn:
        with drawing(9.6, 6.4) as figure:
            main, below = figure.subplots(2, 1, sharex=True, gridspec_kw={"height_ratios": [2.6, 1]})
            half = NORMAL_95 * stage.sigma
            if curve:
                band: dict[str, Any] = {"color": style.GREEN, "alpha": 0.25, "linewidth": 0}
                main.fill_between(stage.speeds, stage.torque - half, stage.torque + half, label="95 % band", **band)
                below.fill_between(stage.speeds, -100 * half / stage.torque, 100 * half / stage.torque, **band)
            main.plot(
                stage.speeds,
                stage.torque,
                color=style.GREEN,
                label="curve" if found.prior else "stage 1 alone",
                zorder=3,
            )
            below.axhline(0.0, color=style.GREEN, linewidth=1.4)
            for sign, colour, marker, word in DIRECTIONS:
                chosen = [p for p in stage.plateaus if p.speed * sign > 0]
                if not chosen:
                    continue
                speed = np.array([abs(p.speed) for p in chosen])
                friction = np.array([sign * (p.torque - load) for p in chosen])
                spread = NORMAL_95 * np.array([p.sigma for p in chosen])
                look = {"fmt": marker, "color": colour, "markersize": 5.5, "elinewidth": 0.9, "capsize": 2, "zorder": 4}
                label = f"plateaus, {word} direction" if found.prior else f"plateaus, {'+' if sign > 0 else '−'}"
                main.errorbar(speed, friction, spread, label=label, **look)
                expected = _of_direction(values, sign, speed)
                if asymmetry:
                    dashes = {"color": colour, "linewidth": 0.9, "linestyle": (0, (4, 2)), "zorder": 2}
                    main.plot(stage.speeds, _of_direction(values, sign, stage.speeds), **dashes)
                below.errorbar(speed, 100 * (friction / expected - 1), 100 * spread / expected, **look)
            if not found.prior:
                _delivered(main, found, stage.speeds)
            main.set_xscale("log")
            main.set_ylim(bottom=0)
            main.set_ylabel("friction torque [N·m]")
            below.set_ylabel("deviation [%]")
            below.set_xlabel("motor speed [rad/s]")
            _feed_axis(main, found.I_P)
            main.set_title(stribeck_title(found, stage), pad=TITLE_PAD)
            _legend(main)
            slide = main.secondary_yaxis("right", functions=(lambda M: M / found.I_P, lambda F: F * found.I_P))
            slide.set_ylabel("at the slide [N]")
            return finish(figure, "stribeck", "Stribeck curve", caption)

    delivered = (
        " Identified set: the friction that is delivered, which stage 1 did not enter, with its constant load less "
        "stage 1's."
    )
    caption = (
        "Motor torque of every plateau less the constant load, over the amount of its speed; bars: 95 % of the "
        "mean's scatter. Below: deviation from the curve"
        + (" of its direction (dashed), which the direction dependence shifts" if asymmetry else "")
        + (f"; shaded: 95 % band of the curve{alone}" if curve else "")
        + f". Largest deviation of a plateau {100 * stage.worst_curve:.2g} %."
        + ("" if found.prior else delivered)
    )
    return Picture("stribeck", "Stribeck curve", caption, draw, stribeck_chart(found, stage, _of_direction))


def stribeck_title(found: Identification, stage: Stationary) -> str:
    """What is shown, and how well the curve is known."""
    known = f"known to ±{100 * curve_error(stage):.2g} % (95 %)"
    if not is_curve(stage):
        known = f"no curve: {counted(speeds_of(stage), 'speed')}"
    return f"Axis {found.axis}: friction over speed{'' if found.prior else ', stage 1 alone'}, {known}"


def _delivered(axes: Axes, found: Identification, speeds: Array) -> None:
    """The set that is delivered, in both directions.

    The plateaus have stage 1's constant load taken off, the set has its own: the difference belongs to the curves, else
    a load that asymmetry stands for would look like a misfit.
    """
    values = {name: each.value for name, each in found.estimates.items()}
    # A load that no stage tells is not in the set; it is taken off the curve in any case.
    values.setdefault("M_0", 0.0)
    first = found.stationary.estimates.get("M_0") if found.stationary is not None else None
    more = values["M_0"] - first.value if first is not None else 0.0
    for sign, mark, dashes in ((1, "+", "solid"), (-1, "−", (0, (1.5, 1.5)))):
        look: dict[str, Any] = {"color": style.PURPLE, "linewidth": 1.3, "linestyle": dashes, "zorder": 3}
        shown = _of_direction(values, sign, speeds) + sign * more
        axes.plot(speeds, shown, label=f"identified set, {mark}", **look)


def plateaus_picture(found: Identification, stage: Stationary, records: Sequence[Record]) -> Picture | None:
    """The plateaus in torque and speed over time; None where none of the records is at hand."""
    count = {record.name: sum(p.record == record.name for p in stage.plateaus) for record in records}
    shown = sorted((r for r in records if count[r.name]), key=lambda r: -count[r.name])[:MOST_RECORDS]
    if not shown:
        return None

    def draw() -> Drawn:
        with drawing(10.0, 0.6 + 4.4 * len(shown)) as figure:
            rooms = figure.subplots(2 * len(shown), 1, squeeze=False)[:, 0]
            for record, torque, speed in zip(shown, rooms[::2], rooms[1::2], strict=True):
                speed.sharex(torque)
                own = [p for p in stage.plateaus if p.record == record.name]
                _over_time(torque, record.time, record.torque, "motor torque")
                _over_time(speed, record.time, _speed(record) * found.I_P * MM_PER_MIN, "")
                for room in (torque, speed):
                    for p in own:
                        room.axvspan(p.begin, p.end, color=style.ORANGE, alpha=0.2, linewidth=0)
                    room.axhline(0.0, color=style.MUTED, linewidth=0.8)
                    room.margins(x=0.01)
                for k, p in enumerate(own):
                    label = "mean of a plateau" if k == 0 else None
                    torque.plot(
                        [p.begin, p.end], [p.torque, p.torque], color=style.VERMILLION, linewidth=2.0, label=label
                    )
                heading(torque, f"{record.name}: {counted(len(own), 'plateau')}")
                torque.set_ylabel("torque [N·m]")
                speed.set_ylabel("speed [mm/min]")
                _decades(speed, min(abs(p.speed) for p in own) * found.I_P * MM_PER_MIN)
                speed.set_xlabel("time [s]")
                legend_above(torque)
            return finish(figure, "plateaus", "Plateaus found in the traces", caption)

    own = [(record, [p for p in stage.plateaus if p.record == record.name]) for record in shown]
    chart = plateaus_chart(own, _speed, found.I_P)
    left = sum(1 for number in count.values() if number) - len(shown)
    fate = "is not shown" if left == 1 else "are not shown"
    more = f" {counted(left, 'more record')} with plateaus {fate}." if left else ""
    caption = (
        "Shaded: stretches at constant speed whose mean torque (line) counts as friction. Speeds of several "
        f"decades are drawn logarithmically in both directions.{more}"
    )
    return Picture("plateaus", "Plateaus found in the traces", caption, draw, chart)


def _over_time(axes: Axes, time: Array, values: Array, label: str) -> None:
    t, y = thinned(time, values)
    axes.plot(t, y, color=style.BLUE, linewidth=0.8, label=label)


def _decades(axes: Axes, smallest: float) -> None:
    """A scale that is logarithmic in both directions, with a tick per decade from the slowest plateau on; linear where
    the speeds are of one order."""
    if float(np.max(np.abs(axes.dataLim.intervaly))) < FEW_DECADES * smallest:
        return
    axes.set_yscale("symlog", linthresh=smallest, linscale=0.5)
    largest = float(np.max(np.abs(axes.dataLim.intervaly)))
    first, last = math.floor(math.log10(smallest) + 1e-9), math.floor(math.log10(max(largest, smallest)))
    decades = [10.0**k for k in range(first, last + 1) if 10.0**k >= 0.5 * smallest]
    axes.set_yticks([*(-v for v in reversed(decades)), 0.0, *decades])
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}".replace("-", "−"))
    axes.minorticks_off()


def _speed(record: Record) -> Array:
    if record.speed is not None:
        return record.speed
    assert record.angle is not None
    return np.asarray(np.gradient(record.angle, record.interval), dtype=np.float64)


def _of_direction(values: Mapping[str, float], sign: int, speed: Array) -> Array:
    """The curve in one direction."""
    return np.asarray(sign * (motor_torque(values, sign * speed) - values["M_0"]))


def _feed_axis(axes: Axes, I_P: float) -> None:
    per = I_P * MM_PER_MIN

    def to_feed(speed: Any) -> Any:
        return speed * per

    def to_speed(feed: Any) -> Any:
        return feed / per

    top = axes.secondary_xaxis("top", functions=(to_feed, to_speed))
    top.set_xlabel("axis speed [mm/min]", labelpad=4)
    low, high = axes.get_xlim()
    few = high < FEW_DECADES * low

    def minor(value: float, _: float) -> str:
        return f"{value:g}" if few and f"{value:e}"[0] in "235" else ""

    for axis in (top.xaxis, axes.xaxis):
        axis.set_major_formatter(lambda value, _: f"{value:g}")
        axis.set_minor_formatter(minor)


def _legend(axes: Axes) -> None:
    from matplotlib.transforms import ScaledTranslation

    shift = ScaledTranslation(0, LEGEND_PAD / 72, axes.figure.dpi_scale_trans)
    legend_above(axes)
    legend = axes.get_legend()
    assert legend is not None
    legend.set_bbox_to_anchor((0, 1), transform=axes.transAxes + shift)
