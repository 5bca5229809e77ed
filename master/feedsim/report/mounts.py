"""mounts.yaml and its table, swings.csv, ring_downs.csv, summary.json, report.html and figures of identified mounts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from feedsim.analysis import Figure
from feedsim.estimation.identify import Estimate
from feedsim.estimation.least_squares import NORMAL_95
from feedsim.estimation.replay.mounts import FoundMounts, RingDown, Swing
from feedsim.foundation.errors import Finding
from feedsim.foundation.installation import version
from feedsim.report.chart import Axis, Chart, Curve, Level, Panel
from feedsim.report.content import (
    FOLDER,
    Paragraph,
    Picture,
    Report,
    Section,
    Step,
    Table,
    Text,
    Tile,
    code,
    figures_footer,
    figures_section,
    provenance_section,
    tile_value,
    with_remark,
)
from feedsim.report.formatting import (
    ALTERNATIVE_COLOUR,
    RECORDED_COLOUR,
    SIMULATED_COLOUR,
    minus,
    scale,
    typeset,
)
from feedsim.report.provenance import finite, hash_files, inputs_part, quantity
from feedsim.report.results import Content
from feedsim.scenario import Subject
from feedsim.structure.modes import checked_modes
from feedsim.structure.mounts import MOUNTS_FILE, MountTable, read_mounts

GROUP, SWINGS, RING_DOWNS = "mounts.yaml", "swings.csv", "ring_downs.csv"
KEPT_FILES = (GROUP, MOUNTS_FILE)
FILES = (*KEPT_FILES, SWINGS, RING_DOWNS)  # besides report.html and summary.json
UNITS = {"K_e": ("N/um", 1e-6), "F_max": ("N", 1.0), "x_2": ("um", 1e6), "K_v": ("N/um", 1e-6), "c": ("N.s/mm", 1e-3)}
PLACES = {"K_e": 1, "F_max": 2, "x_2": 3, "K_v": 4, "c": 5}  # in a row of the table
MODEL_ERROR = 2.0  # times the noise: what a simulation leaves of a ring-down beyond that is its own error
METHOD = (
    "The units follow the setpoints of each log. What they leave of the ring-downs is least over factors on the "
    "elements of all mounts; the factors are known beforehand to a factor of e either way. Rows that are correlated "
    "count as one. "
    "Frequency and damping are those of damped oscillations over two swings each, of record and simulation alike."
)


@dataclass(frozen=True, eq=False)
class MountsReport:
    """What was identified, and what it rests on."""

    mounts: FoundMounts
    files: Sequence[Path]
    subject: Subject
    settings: Mapping[str, str]
    read: Sequence[Finding]

    @property
    def estimates(self) -> Mapping[str, Estimate]:
        """K_e, F_max, x_2, K_v and c as factors on the table of mounts: value, interval, status."""
        return self.mounts.estimates

    @property
    def table(self) -> MountTable:
        """The mounts of the machine file."""
        machine = self.subject.machine
        assert machine.mounts is not None
        bare = checked_modes(machine.model_copy(update={"mounts": None}))
        return read_mounts(machine.mounts.table, len(bare.frequency))

    @property
    def figures(self) -> dict[str, Figure]:
        """By name."""
        figures = {
            name: Figure(100 * one.value, "%", f"{one.meaning}{_interval(one)}")
            for name, one in self.mounts.estimates.items()
        }
        for k, stop in enumerate(self.mounts.ring_downs, 1):
            for when, swings in (("first", stop.recorded_swings[:1]), ("last", stop.recorded_swings[-1:])):
                for swing in swings:
                    figures[f"stop_{k}.frequency_{when}"] = Figure(
                        swing.frequency, "Hz", f"{stop.name}: frequency of the {when} swings, ± "
                        f"{NORMAL_95 * swing.frequency_sigma:.2g} (95 %)",
                    )  # fmt: skip
                    figures[f"stop_{k}.damping_{when}"] = Figure(
                        100 * swing.damping, "%", f"{stop.name}: damping of the {when} swings, ± "
                        f"{100 * NORMAL_95 * swing.damping_sigma:.2g} (95 %)",
                    )  # fmt: skip
            figures[f"stop_{k}.deflection"] = Figure(
                1e6 * stop.deflection, "um", f"{stop.name}: largest deflection of a mount, simulated"
            )
            size = float(np.sqrt(np.mean(stop.recorded**2)))
            figures[f"stop_{k}.left"] = Figure(
                100 * stop.remaining / size,
                "%",
                f"{stop.name}: what the simulation leaves, over the ring-down, both rms",
            )
        return figures

    @property
    def warnings(self) -> list[Finding]:
        """What a user should know."""
        result = list(self.read)
        for stop in self.mounts.ring_downs:
            jumps = np.diff(stop.recorded, 2)
            white = float(np.median(np.abs(jumps))) / (0.6745 * np.sqrt(6))
            if stop.remaining > MODEL_ERROR * max(white, 0.02 * float(np.std(stop.recorded))):
                unit = scale(stop.unit, np.array([stop.remaining]))
                result.append(Finding(
                    "machine-not-of-record", "doubt",
                    f"{stop.name}: the simulation leaves {unit.factor * stop.remaining:.2g} {unit.shown_unit} of the "
                    "ring-down (rms), more than its noise: structure, drive or friction of the machine file are not "
                    "those of the log, and the values make up for it as far as they can",
                    stop.name,
                ))  # fmt: skip
        return result


def _interval(one: Estimate) -> str:
    if one.status != "estimated":
        return f", not determined: {one.reason}"
    return f", ± {100 * NORMAL_95 * one.sigma:.2g} (95 %)"


def groups(report: MountsReport) -> Iterator[tuple[str, Sequence[float]]]:
    """Mounts with the same elements, in words, and a row of the table of one of them."""
    table = report.table
    alike: dict[tuple[str, ...], list[int]] = {}
    for i, name in enumerate(table.names):
        alike.setdefault((name.rpartition(" ")[2], *map(repr, table.element[i].tolist())), []).append(i)
    for (direction, *_), rows in alike.items():
        words = table.names[rows[0]] if len(rows) == 1 else f"{len(rows)} mounts, {direction}"
        yield words, table.element[rows[0]].tolist()


def _rows(report: MountsReport) -> Iterator[tuple[str, str, str, str, str, str]]:
    """Parameter, mounts, machine file, identified, 95 % interval, unit."""
    begin = report.subject.machine.mounts
    assert begin is not None
    for name, one in report.mounts.estimates.items():
        unit, factor = UNITS[name]
        for words, row in groups(report):
            value = factor * row[PLACES[name]]
            before = value * float(begin.parameters().get(name, 1.0))
            low, high = (value * end for end in one.interval)
            places = max(0, 1 - int(np.floor(np.log10(max(high - low, 1e-12))))) if one.sigma > 0 else 3
            known = one.status == "estimated"
            yield (
                name, words, f"{before:.4g}", f"{value * one.value:.{places}f}" if known else "not determined",
                f"{low:.{places}f} to {high:.{places}f}" if known else "", unit,
            )  # fmt: skip


def files_of(report: MountsReport) -> dict[str, Content]:
    """Name -> content of the files besides report.html and summary.json."""
    machine = report.subject.machine
    assert machine.mounts is not None
    swings = ["stop,of,time [s],amplitude,unit,frequency [Hz],+-,damping [1],+-"]
    downs = ["stop,time [s],recorded,simulated,machine file,unit"]
    for stop in report.mounts.ring_downs:
        name = f'"{stop.name}"'
        for of, several in (("record", stop.recorded_swings), ("simulation", stop.simulated_swings)):
            swings += (
                f"{name},{of},{one.time!r},{one.amplitude!r},{stop.unit},{one.frequency!r},"
                f"{NORMAL_95 * one.frequency_sigma!r},{one.damping!r},{NORMAL_95 * one.damping_sigma!r}"
                for one in several
            )
        rows = np.column_stack([stop.time, stop.recorded, stop.simulated, stop.before]).tolist()
        downs += (f"{name},{','.join(map(repr, row))},{stop.unit}" for row in rows)
    return {
        GROUP: group_text(report),
        MOUNTS_FILE: machine.mounts.table.read_text(encoding="utf-8"),
        SWINGS: "\n".join(swings) + "\n",
        RING_DOWNS: "\n".join(downs) + "\n",
    }


def group_text(report: MountsReport) -> str:
    """Text of mounts.yaml."""
    mounts = report.mounts
    lines = [
        f"# Levelling mounts of {report.subject.machine.name}, by feedsim identify mounts {version('feedsim')} from "
        f"{', '.join(file.name for file in report.files)}.",
        f"# {answers(report)[0]}",
        "# To use: mounts: mounts.yaml in a machine file, or --set machine.mounts=mounts.yaml; factors on the table.",
        f"table: {MOUNTS_FILE}",
    ]
    for name, one in mounts.estimates.items():
        low, high = (100 * end for end in one.interval)
        remark = f"95 %: {low:.4g} to {high:.4g} %" if one.status == "estimated" else f"not determined: {one.reason}"
        lines.append(f"{name + ':':7}{100 * mounts.factors[name]:.8g} %  # {remark}")
    return "\n".join(lines) + "\n"


def report_of(report: MountsReport) -> Report:
    """Content of the report."""
    mounts = report.mounts
    drawn = [picture for picture in (_over_amplitude(mounts), _over_time(mounts)) if picture is not None]
    files = ", ".join(file.name for file in report.files)
    pictures = with_remark(drawn, f"{files}; {report.subject.machine.name}")
    rows: list[tuple[Text, ...]] = [(code(name), *map(minus, rest)) for name, *rest in _rows(report)]
    heads = ("Parameter", "Mounts", "Machine file", "Identified", "95 % interval", "Unit")
    why = [
        f"{name}: not determined, {one.reason}." for name, one in mounts.estimates.items() if one.status != "estimated"
    ]
    values = Section(
        "Elements of the mounts", [Table("hlrrrl", heads, rows), *map(Paragraph, why), Paragraph(METHOD, "muted")],
        unfolded=True,
    )  # fmt: skip
    downs = Section("Ring-downs", [Table(
        "hrrrrrr",
        ("Stop", "Deflection [µm]", "First swings [Hz]", "Damping [%]", "Last swings [Hz]", "Damping [%]", "Left [%]"),
        [_stop_row(stop) for stop in mounts.ring_downs],
        "Deflection: of the mount that moves most, simulated. Left: rms by the simulation, over that of the ring-down.",
    )])  # fmt: skip
    return Report(
        f"Mounts of {report.subject.machine.name}",
        f"identified from {', '.join(file.name for file in report.files)}",
        warnings=report.warnings,
        notes=[note for note in report.subject.notes if note],
        answer=answers(report),
        tiles=[
            Tile(tile_value(Figure(100 * one.value, "%", "")), f"{name} of the machine file's", typeset(one.meaning))
            for name, one in mounts.estimates.items()
            if one.status == "estimated"
        ],
        main=[*pictures, values, downs, figures_section(report.figures)],
        provenance=provenance_section([("Logs", ", ".join(f.name for f in report.files))], hash_files(_files(report))),
        footer=figures_footer(f"What machines take: {GROUP}; what the figures show: {SWINGS}, {RING_DOWNS}.",
                              "docs/effects.md"),
        next_step=_next_step(report),
    )  # fmt: skip


def _next_step(report: MountsReport) -> Step:
    subject = report.subject
    chosen = [*subject.overrides, f"machine.mounts={FOLDER}/{GROUP}"]
    if subject.scenario is not None:
        return Step("Run the scenario with these mounts", "run",
                    {"scenario": subject.file, "machine": None, "axes": None, "set": chosen})  # fmt: skip
    wanted = {"subject": subject.file, "axes": None, "measure": False, "mount_amplitude": "10 um", "set": chosen}
    return Step("See the machine on these mounts", "frf", wanted)


def _stop_row(stop: RingDown) -> tuple[str, ...]:
    cells = [stop.name, f"{1e6 * stop.deflection:.3g}"]
    for swings in (stop.recorded_swings[:1], stop.recorded_swings[-1:]):
        cells += [f"{s.frequency:.2f} ± {NORMAL_95 * s.frequency_sigma:.1g}" for s in swings] or ["–"]
        cells += [f"{100 * s.damping:.1f} ± {100 * NORMAL_95 * s.damping_sigma:.1g}" for s in swings] or ["–"]
    return *cells, f"{100 * stop.remaining / float(np.std(stop.recorded)):.2g}"


def _over_amplitude(mounts: FoundMounts) -> Picture | None:
    """Frequency and damping of every stretch over its amplitude; None where no stretch is clear."""
    stops = [stop for stop in mounts.ring_downs if stop.recorded_swings]
    if not stops:
        return None
    amplitudes = [swing.amplitude for stop in stops for swing in stop.recorded_swings]
    unit = scale(stops[0].unit, np.array(amplitudes))
    span = 0.7 * unit.factor * min(amplitudes), 1.4 * unit.factor * max(amplitudes)
    x = Axis("amplitude at the sensor", unit.shown_unit, log=True, span=span)
    levels = [
        Level(unit.factor * stop.recorded_swings[0].amplitude, stop.name.removesuffix(".csv"), upright=True)
        for stop in stops
    ]
    panels = []
    for label, shown_unit, factor, value, sigma in (
        ("frequency", "Hz", 1.0, "frequency", "frequency_sigma"),
        ("damping", "%", 100.0, "damping", "damping_sigma"),
    ):
        curves = []
        for stop in stops:
            recorded, simulated = _order_swings(stop.recorded_swings), _order_swings(stop.simulated_swings)
            at = np.array([unit.factor * swing.amplitude for swing in recorded])
            y, half = (factor * np.array([getattr(swing, name) for swing in recorded]) for name in (value, sigma))
            for a, middle, part in zip(at, y, NORMAL_95 * half, strict=True):
                ends = np.array([middle - part, middle + part])
                curves.append(Curve("recorded, 95 %", np.array([a, a]), ends, RECORDED_COLOUR, width=1.0))
            curves.append(Curve("recorded", at, y, RECORDED_COLOUR, dots=True, width=3.0))
            own = np.array([unit.factor * swing.amplitude for swing in simulated])
            curves.append(
                Curve("simulated", own, factor * np.array([getattr(s, value) for s in simulated]), SIMULATED_COLOUR)
            )
        panels.append(Panel(f"{label} of the ring-downs", x, Axis(label, shown_unit), curves, levels, linked="a"))
    caption = (
        "Every stretch of two swings, recorded with its interval and simulated with the mounts that were mounts. "
        "Upright lines: where each stop begins. Of linear mounts both are level."
    )
    return Picture("mounts-amplitude", "Frequency and damping over the amplitude", caption, Chart(panels))


def _order_swings(swings: Sequence[Swing]) -> list[Swing]:
    return sorted(swings, key=lambda swing: swing.amplitude)


def _over_time(mounts: FoundMounts) -> Picture:
    panels = []
    for stop in mounts.ring_downs:
        unit = scale(stop.unit, np.abs(stop.recorded))
        time, factor = 1e3 * stop.time, unit.factor
        curves = [
            Curve("recorded", time, factor * stop.recorded, RECORDED_COLOUR),
            Curve("simulated", time, factor * stop.simulated, SIMULATED_COLOUR),
            Curve("machine file", time, factor * stop.before, ALTERNATIVE_COLOUR, "dashed"),
        ]
        axis = Axis("off its mean", unit.shown_unit)
        panels.append(Panel(stop.name, Axis("time since the setpoint stands still", "ms"), axis, curves, height=0.8))
    caption = "Recorded, simulated with the mounts that were found, and with those of the machine file."
    return Picture("mounts-ring-downs", "Ring-downs", caption, Chart(panels))


def _files(report: MountsReport) -> list[tuple[str, Path]]:
    return [*(("log", file) for file in report.files), *report.subject.files]


def details(report: MountsReport) -> dict[str, Any]:
    """What summary.json has besides the figures."""
    mounts = report.mounts
    return {
        "settings": dict(report.settings),
        "machine": report.subject.machine.name,
        "verdict": mounts.verdict,
        "estimates": {
            name: quantity(one.value, one.unit, meaning=one.meaning, status=one.status, reason=one.reason)
            | {"sigma": finite(one.sigma), "low": finite(one.interval[0]), "high": finite(one.interval[1])}
            for name, one in mounts.estimates.items()
        },
        "stops": [
            {"name": stop.name, "unit": stop.unit, "deflection": quantity(stop.deflection, "m"),
             "left": stop.remaining, "noise": stop.noise}
            for stop in mounts.ring_downs
        ],
        "inputs": inputs_part(hash_files(_files(report))),
    }  # fmt: skip


def answers(report: MountsReport) -> list[str]:
    """Whether the mounts are linear, what they are, and how near the simulation comes."""
    mounts = report.mounts
    verdict = {
        "not linear": "The mounts are not linear",
        "linear": "The mounts are linear: without friction they explain the ring-downs as well",
        "open": "The ring-downs do not show whether the mounts are linear: their amplitudes are too small, or too much "
        "alike. Log stops at a further, higher jerk",
    }[mounts.verdict]
    parts = [f"{verdict}."]
    stop = max(mounts.ring_downs, key=lambda one: one.recorded_swings[0].amplitude if one.recorded_swings else 0.0)
    swings = stop.simulated_swings[: len(stop.recorded_swings)]  # as long as they are seen, but without noise
    if mounts.verdict == "not linear" and len(swings) > 1:
        first, last = swings[0], swings[-1]
        parts[0] = (
            f"{verdict}: behind {stop.name} the machine swings at {first.frequency:.3g} Hz with "
            f"{100 * first.damping:.2g} % damping at first, at {last.frequency:.3g} Hz with {100 * last.damping:.2g} % "
            "in the end."
        )
    known = [
        f"{name} {100 * one.value:.3g} ± {100 * NORMAL_95 * one.sigma:.2g} %"
        for name, one in mounts.estimates.items() if one.status == "estimated"
    ]  # fmt: skip
    if known:
        parts.append(f"Of the values of the machine file: {', '.join(known)} (95 %).")
    unknown = [name for name, one in mounts.estimates.items() if one.status != "estimated"]
    if unknown and mounts.verdict != "open":
        parts.append(f"Not determined: {', '.join(unknown)}; {mounts.estimates[unknown[0]].reason}.")
    remaining = ", ".join(f"{100 * s.remaining / float(np.std(s.recorded)):.2g} %" for s in mounts.ring_downs)
    parts.append(f"The simulation leaves {remaining} of the ring-down{'s'[: len(mounts.ring_downs) > 1]} (rms).")
    return parts


def rows(report: MountsReport) -> list[str]:
    """For the terminal: every value with its interval, as a table."""
    rows = [("", "mounts", "machine file", "identified", "95 % interval", "unit"), *_rows(report)]
    widths = [max(len(row[k]) for row in rows) for k in range(6)]
    return [
        f"  {row[0]:<{widths[0]}}  {row[1]:<{widths[1]}}  {row[2]:>{widths[2]}}  {row[3]:>{widths[3]}}  "
        f"{row[4]:>{widths[4]}}  {row[5]}".rstrip()
        for row in rows
    ]
