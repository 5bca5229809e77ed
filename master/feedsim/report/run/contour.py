"""The contour error of an NC program in a report: the path coloured by it, its course, its worst blocks, its shares."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feedsim.analysis import ContourError
from feedsim.analysis.contour_error import SHARE_WORDS
from feedsim.files import sheets
from feedsim.motions.part_program import Motion
from feedsim.report.chart import Axis, Chart, Curve, Level, Panel
from feedsim.report.chart.model import extremes
from feedsim.report.content import Picture, Section, Table, Text, code
from feedsim.report.formatting import (
    AT_TOOL,
    FRICTION_COLOUR,
    GREEN,
    ORANGE,
    PURPLE,
    SETPOINT_COLOUR,
    SIMULATED_COLOUR,
    SKY,
    VERMILLION,
    Array,
    count_things,
    minus,
    number,
)
from feedsim.report.provenance import quantity
from feedsim.report.run.axis_plots import TIME, TOOL_TITLE

BLOCKS_FILE = "blocks.csv"
WORST_BLOCK_COUNT = 12  # blocks of the report's table
SHARE_COLOURS = {"plan": GREEN, "servo": SIMULATED_COLOUR, "friction": FRICTION_COLOUR, "structure": ORANGE}
# Classes of the path's picture, as shares of the largest distance, and their colours.
CLASSES = ((0.25, GREEN), (0.5, SKY), (0.75, PURPLE), (1.0, VERMILLION))
# Of the picture: rows of the path, share of its width that the largest distance is magnified to, and its height.
MOST_ROWS, MAGNIFIED, HEIGHT = 6000, 0.05, 2.0
# What a main share means, and what to do about it.
REMEDIES = {
    "plan": "The path itself is rounded there: lower the tolerance.",
    "servo": "The axes do not follow alike or ring there: lower feed or jerk, or tune the drives.",
    "friction": "Friction makes it where an axis reverses: friction compensation takes it away.",
    "structure": "The structure bends between scales and tool: lower acceleration or jerk.",
}


def contour_words(error: ContourError) -> list[str]:
    """What came out, in sentences: the largest distance, its block, what makes it."""
    largest, _, p95, at = error.overall("scale")
    share, part = error.main_share("scale")
    said = [
        f"largest deviation from the programmed path {_size(largest)} um, in "
        f"{error.block(int(error.by['scale'].row[at]))}, at {error.time[at]:.4g} s. "
        f"Main share: {share}, {_size(part)} um. {REMEDIES[share]}"
    ]
    if "tool" in error.by:
        at_tool, *_, row = error.overall("tool")
        share, part = error.main_share("tool")
        said.append(
            f"at the tool {_size(at_tool)} um, in {error.block(int(error.by['tool'].row[row]))}, "
            f"{_size(part)} um of it by the share {share}; 95 % of the positions of the axes are within "
            f"{_size(p95)} um."
        )
    return said


def _size(value: float) -> str:
    """Micrometres in a sentence, three digits, and none below 1 nm."""
    return f"{value * 1e6:.3g}" if abs(value) >= 1e-9 else "0"


# --- Pictures ---------------------------------------------------------------------------------------------------------


def contour_pictures(prefix: str, error: ContourError, stem: str) -> list[Picture]:
    """The path with its magnified deviations, and their course over time."""
    return [_path_picture(error, f"{stem}-path"), _course_picture(error, stem)]


def _plane(error: ContourError) -> tuple[int, int]:
    """The two axes that the path is seen along, in their order."""
    path = error.programmed.path
    reach = np.ptp(np.vstack([path.begin, path.begin[-1:] + path.line[-1:]]), axis=0) + np.abs(path.cosine).max(axis=0)
    first, second = sorted(np.argsort(-reach, kind="stable")[:2].tolist()) if len(reach) > 1 else (0, 0)
    return first, second


def _path_picture(error: ContourError, stem: str) -> Picture:
    """The programmed path, and where the axes were: away from it by a multiple of the deviation, in colours."""
    by = "tool" if "tool" in error.by else "scale"
    deviations, path = error.by[by], error.programmed.path
    i, j = _plane(error)
    names = error.axes
    counts = np.flatnonzero(error.cutting[deviations.row])
    rows = counts[extremes(deviations.distance[counts], MOST_ROWS)]
    foot = path.point(deviations.s[rows])[:, [i, j]]
    distance = deviations.distance[rows]
    off = error.vectors(by, rows).normal[:, [i, j]] * distance[:, None]
    along = path.point(np.linspace(0.0, path.s[-1], 2 * MOST_ROWS))[:, [i, j]]
    corners = path.begin[:: max(1, len(path.begin) // MOST_ROWS), [i, j]]
    whole = np.vstack([along, corners])
    size = float(np.ptp(whole, axis=0).max()) or 1e-3
    largest = float(distance.max()) or 1e-9
    magnified = _nice(MAGNIFIED * size / largest)
    drawn = foot + magnified * off
    order = np.argsort(
        np.concatenate(
            [np.linspace(0.0, path.s[-1], 2 * MOST_ROWS), path.s[:-1][:: max(1, len(path.begin) // MOST_ROWS)]]
        ),
        kind="stable",
    )
    programmed = whole[order] * 1e3
    curves = [
        Curve("programmed path", programmed[:, 0], programmed[:, 1], SETPOINT_COLOUR, "dotted", 1.0, most=3 * MOST_ROWS)
    ]
    # Rapids are left out: what comes before one and behind it is not joined.
    left_out = np.cumsum(~error.cutting[deviations.row])[rows]
    gaps = np.flatnonzero(np.diff(left_out)) + 1
    drawn, distance = np.insert(drawn, gaps, np.nan, axis=0), np.insert(distance, gaps, np.nan)
    below = 0.0
    for share, colour in CLASSES:
        mine = (distance > below * largest) | (below == 0.0)
        mine &= distance <= share * largest
        name = f"{below * largest * 1e6:.3g} to {share * largest * 1e6:.3g} µm"
        x, y = _pieces(drawn * 1e3, mine)
        curves.append(Curve(name, x, y, colour, width=1.6, most=4 * MOST_ROWS))
        below = share
    seen = np.vstack([programmed, drawn * 1e3])
    low, high = np.nanmin(seen, axis=0), np.nanmax(seen, axis=0)
    middle, half = (low + high) / 2, np.maximum((high - low) / 2 * 1.05, 1e-3)
    across, up = (
        Axis(names[axis], "mm", span=(middle[k] - half[k], middle[k] + half[k])) for k, axis in enumerate((i, j))
    )
    where = "tool point" if by == "tool" else "axes, by the linear scales"
    title = f"Deviation from the programmed path, magnified {magnified:,.0f} times"
    caption = (
        f"Programmed path in {names[i]}-{names[j]}, and the {where}: off it by {magnified:,.0f} times the deviation, "
        f"coloured by its size; the largest is {largest * 1e6:.3g} µm."
    )
    return Picture(stem, title, caption, Chart([Panel("", across, up, curves, height=HEIGHT, equal=True)]))


def _nice(value: float) -> float:
    """The largest of 1, 2, 5, 10 ... that is not above a value; 1 at least."""
    decade = 10.0 ** math.floor(math.log10(max(value, 1.0)))
    return max(step * decade for step in (1, 2, 5) if step * decade <= max(value, 1.0))


def _pieces(points: Array, mine: NDArray[np.bool_]) -> tuple[Array, Array]:
    """The rows that are mine and the one behind each piece of them, pieces apart by a NaN."""
    kept = mine | np.concatenate([[False], mine[:-1]])
    apart = ~kept & np.concatenate([[False], kept[:-1]])
    x, y = np.where((kept & ~apart)[:, None], points, np.nan).T
    return x[kept | apart], y[kept | apart]


def _course_picture(error: ContourError, stem: str) -> Picture:
    """Distance, shares and speed over time."""
    scale = error.by["scale"]
    curves = []
    if "tool" in error.by:
        curves.append(Curve(TOOL_TITLE, error.time, error.by["tool"].distance * 1e6, AT_TOOL, "dashed", 1.0))
    curves.append(Curve("linear scales", error.time, scale.distance * 1e6, SIMULATED_COLOUR, width=1.4))
    shares = [
        Curve(name, error.time, values * 1e6, SHARE_COLOURS[name], width=1.2) for name, values in scale.shares.items()
    ]
    if "tool" in error.by:
        shares.append(
            Curve(
                "structure",
                error.time,
                error.by["tool"].shares["structure"] * 1e6,
                SHARE_COLOURS["structure"],
                width=1.0,
            )
        )
    programmed = error.programmed
    time, s = programmed.time, programmed.s
    speed = np.diff(s) / np.diff(time) * 6e4 if len(time) > 1 else np.zeros(0)
    feeds = np.nan_to_num(programmed.moves.feed, nan=0.0) * 6e4
    starts = programmed.begin + np.column_stack([programmed.plan.start_time, programmed.plan.end_time]).ravel()
    planned = [
        Curve("programmed feed", starts, np.repeat(feeds, 2), SETPOINT_COLOUR, "dotted", 1.0),
        Curve("planned speed", time[1:], speed, SIMULATED_COLOUR, width=1.2),
    ]
    zero = [Level(0.0, dash="")]
    panels = [
        Panel("Distance from the programmed path", TIME, Axis("distance", "µm"), curves, zero, linked="t"),
        Panel("What makes it", TIME, Axis("share", "µm"), shares, zero, linked="t"),
        Panel("Speed along the path", TIME, Axis("speed", "mm/min"), planned, zero, linked="t"),
    ]
    caption = (
        "Distance from the programmed path over time; its shares, which add up to it (of the linear scales; that of "
        "the structure is added at the tool); programmed and planned speed along the path."
    )
    return Picture(f"{stem}-course", "Deviation, what makes it, and speed over time", caption, Chart(panels))


# --- Tables -----------------------------------------------------------------------------------------------------------


def contour_section(prefix: str, error: ContourError) -> Section:
    """The worst blocks, the shares of the largest distance by axis, what limits the speed, and the motors."""
    tables = [_worst_table(error), _share_table(error), _limit_table(error)]
    motors = [
        (axis, *(minus(f"{value:.3f}") for value in values[:2]), number(values[2], 3))
        for axis, values in error.torque.items()
    ]
    if motors:
        heads = ("Axis", "Largest torque [N·m]", "Torque rms [N·m]", "Work [J]")
        tables.append(
            Table("lrrr", heads, motors, "Work of the motor on its axis; what braking gives back is taken off.")
        )
    return Section(f"{prefix}: deviations block by block", tables, f"blocks-{prefix}")


def _um(value: float) -> str:
    return minus(f"{value * 1e6:.2f}") if math.isfinite(value) else "–"


def _worst_table(error: ContourError) -> Table:
    moves, plan, scale = error.programmed.moves, error.programmed.plan, error.by["scale"]
    blocks, tool = error.blocks["scale"], error.blocks.get("tool")
    several = len(moves.files) > 1
    rows: list[tuple[Text, ...]] = []
    for row in error.worst(WORST_BLOCK_COUNT):
        at = int(blocks.at[row])
        where = error.programmed.place(row) if several else str(moves.line[row])
        rows.append(
            (
                where, code(moves.text(row)), _um(blocks.largest[row]), _um(blocks.rms[row]), _um(blocks.p95[row]),
                *(_um(float(share[at])) for share in scale.shares.values()),
                _um(tool.largest[row]) if tool is not None else "–",
                f"{plan.end_time[row] - plan.start_time[row]:.4f}", number(_block_speed(error, row) * 6e4),
                error.programmed.limits[row],
            )
        )  # fmt: skip
    heads = (
        "Line", "Block", "Largest [µm]", "rms [µm]", "95 % [µm]", *(f"{name.title()} [µm]" for name in scale.shares),
        "Tool [µm]", "Time [s]", "Speed [mm/min]", "Limit",
    )  # fmt: skip
    note = (
        f"The {count_things(len(rows), 'block')} with the largest distance of the axes; shares of that distance, "
        f"which add "
        f"up to it. Tool: largest distance of the tool point in the block. All blocks: {BLOCKS_FILE}."
    )
    return Table("ll" + "r" * (len(heads) - 3) + "l", heads, rows, note)


def _block_speed(error: ContourError, row: int) -> float:
    """Mean speed of a block along the programmed path [m/s]."""
    path, plan = error.programmed.path, error.programmed.plan
    length = float(np.diff(path.s)[path.row == row].sum())
    taken = float(plan.end_time[row] - plan.start_time[row])
    return length / taken if taken > 0 else math.nan


def _share_table(error: ContourError) -> Table:
    rows = []
    for by, deviations in error.by.items():
        at = error.overall(by)[3]
        where = "tool" if by == "tool" else "axes"
        for name, share in error.vectors(by, np.array([at])).shares.items():
            rows.append((where, name, *map(_um, share[0].tolist()), _um(float(share.sum())), SHARE_WORDS[name]))
        rows.append((where, "distance", *("" for _ in error.axes), _um(float(deviations.distance[at])), ""))
    heads = ("Of the", "Share", *(f"{axis} [µm]" for axis in error.axes), "Sum [µm]", "What it is")
    known = "friction" in error.by["scale"].shares
    note = "At the largest distance, of the axes and of the tool point. Each axis counts along its direction."
    note += "" if known else " Friction is part of the servo share: it was not run without."
    return Table("ll" + "r" * (len(error.axes) + 1) + "p", heads, rows, note)


def _limit_table(error: ContourError) -> Table:
    plan = error.programmed.plan
    taken = plan.end_time - plan.start_time
    names = np.asarray(error.programmed.limits)
    total = float(taken.sum()) or 1.0
    rows = []
    for name in sorted(set(error.programmed.limits), key=lambda name: -float(taken[names == name].sum())):
        own = float(taken[names == name].sum())
        rows.append((name, str(int((names == name).sum())), f"{own:.4f}", minus(f"{100 * own / total:.1f}")))
    heads = ("What limits the speed", "Blocks", "Time [s]", "Share [%]")
    return Table("lrrr", heads, rows, "Of each block what limits it for most of its time.")


# --- Files ------------------------------------------------------------------------------------------------------------


def blocks_csv(error: ContourError) -> str:
    """Every block: place, text, times, limit, distances and shares, of the axes and of the tool."""
    moves, plan, path = error.programmed.moves, error.programmed.plan, error.programmed.path
    count = len(moves)
    length = np.bincount(path.row, np.diff(path.s), count)
    taken = plan.end_time - plan.start_time
    with np.errstate(divide="ignore", invalid="ignore"):
        speed = np.where(taken > 0, length / taken, np.nan)
    columns: dict[str, Array] = {
        "begin [s]": error.programmed.begin + plan.start_time,
        "end [s]": error.programmed.begin + plan.end_time,
        "length [mm]": np.asarray(length * 1e3, dtype=np.float64),
        "feed [mm/min]": moves.feed * 6e4,
        "speed [mm/min]": speed * 6e4,
    }
    for by in error.by:
        figures, ahead = error.blocks[by], "" if by == "scale" else "tool "
        at = figures.at
        columns |= {
            f"{ahead}largest [um]": figures.largest * 1e6,
            f"{ahead}rms [um]": figures.rms * 1e6,
            f"{ahead}p95 [um]": figures.p95 * 1e6,
            f"{ahead}at [s]": np.where(at >= 0, error.time[at], np.nan),
        }
        sideways, upwards = error.sides(by, np.maximum(at, 0))
        vectors = error.vectors(by, np.maximum(at, 0))
        columns |= {
            f"{ahead}left [um]": np.where(at >= 0, sideways, np.nan) * 1e6,
            f"{ahead}up [um]": np.where(at >= 0, upwards, np.nan) * 1e6,
        }
        for name, share in vectors.shares.items():
            own = np.where((at >= 0)[:, None], share, np.nan) * 1e6
            columns[f"{ahead}{name} [um]"] = own.sum(axis=1)
            columns |= {f"{ahead}{name} {axis} [um]": own[:, i] for i, axis in enumerate(error.axes)}
    heads = ["block", "file", "line", "text", "motion", "limit", *columns]
    values = np.column_stack(list(columns.values()))
    numbers = ",".join(["%.9g"] * len(columns))
    names, limits = error.programmed.names, error.programmed.limits
    lines = [",".join(heads)]
    for row, cells in enumerate(values.tolist()):
        motion = Motion(int(moves.motion[row])).name.lower()
        place = (row, names[moves.file[row]], int(moves.line[row]), moves.text(row), motion, limits[row])
        words = sheets.text_of([place])
        lines.append(f"{words.rstrip()},{(numbers % tuple(cells)).replace('nan', '')}")
    return "\n".join(lines) + "\n"


def contour_part(error: ContourError) -> dict[str, Any]:
    """The contour error in summary.json, in SI."""
    moves, plan = error.programmed.moves, error.programmed.plan
    worst = {by: np.array(error.worst(WORST_BLOCK_COUNT, by), dtype=np.int64) for by in error.by}
    vectors = {by: error.vectors(by, error.blocks[by].at[rows]) for by, rows in worst.items()}
    return {
        "delay": quantity(error.delay, "s"),
        "worst": {
            by: [
                {
                    "file": error.programmed.names[moves.file[row]],
                    "line": int(moves.line[row]),
                    "text": moves.text(row),
                    "largest": quantity(float(blocks.largest[row]), "m"),
                    "rms": quantity(float(blocks.rms[row]), "m"),
                    "p95": quantity(float(blocks.p95[row]), "m"),
                    "shares": {
                        name: quantity(dict(zip(error.axes, share[k].tolist(), strict=True)), "m")
                        for name, share in vectors[by].shares.items()
                    },
                    "begin": quantity(error.programmed.begin + float(plan.start_time[row]), "s"),
                    "end": quantity(error.programmed.begin + float(plan.end_time[row]), "s"),
                    "limit": error.programmed.limits[row],
                }
                for k, row in enumerate(worst[by].tolist())
            ]
            for by, blocks in error.blocks.items()
        },
    }
