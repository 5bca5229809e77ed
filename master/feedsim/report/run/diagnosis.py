"""Why a circle is not round, as a section of a report and as part of summary.json."""

from __future__ import annotations

import math
from typing import Any

from feedsim.analysis.circle import Diagnosis, Peak, Term, answer, further, name, sentence, separating_radius, swinging
from feedsim.analysis.evaluate import FIGURE_UNITS
from feedsim.motions.circular import SENSE_WORDS
from feedsim.report.content import Section, Table, Tile
from feedsim.report.formatting import minus, number, three, typeset
from feedsim.report.provenance import finite, quantity


def diagnosis_section(prefix: str, diagnosis: Diagnosis) -> Section:
    """Every cause with its interval, what it makes alone, its share of G and what it means; and the reversal peaks."""
    rows = [
        (
            name(term)[:1].upper() + name(term)[1:],
            _value(term),
            _um(term.size),
            _share(term),
            typeset(sentence(diagnosis, term)),
        )
        for term in diagnosis.terms
    ]
    note = (
        "± is half of an interval of 95 %. Alone: from peak to valley of the radial deviation that the cause makes "
        "alone. Share of G: what it contributes where the deviation is largest, less where it is smallest; the shares "
        "add up to 100 %, and one that makes G smaller is negative."
    )
    if diagnosis.left_out:
        axes = " and ".join(diagnosis.left_out)
        note += (
            f"\nA circle of {1e3 * separating_radius(diagnosis.circle, diagnosis.left_out):.3g} mm or more separates "
            f"errors that repeat with the pitch of {axes}; this one is too small."
        )
    if words := swinging(diagnosis):
        note += f"\n{typeset(words)}"
    note += "".join(f"\n{typeset(words)}" for words in further(diagnosis))
    heads = ("Cause", "Amount", "Alone [µm]", "Share of G [%]", "What it means, where to look")
    peaks = [(minus(peak.name), SENSE_WORDS[peak.sense], *_peak(peak)) for peak in diagnosis.peaks]
    peak_heads = ("Reversal at", "Direction", "Peak [µm]", "±", "Width at half the height [ms]", "Falls to 1/e in [ms]")
    peak_note = "Peaks stand over the fitted rest of the circle; 0: nothing stands out of the noise."
    tables = [Table("lrrrp", heads, rows, note)]
    if peaks:  # none on an arc without reversals
        tables.append(Table("llrrrr", peak_heads, peaks, peak_note))
    return Section(f"{prefix}: why the circle is not round", tables)


def cause_tile(diagnosis: Diagnosis, term: Term) -> Tile:
    """A cause by its amount: the height of a peak, the time of a mismatch."""
    own = [peak.height for peak in diagnosis.peaks if term.key == "peaks" and peak.axis == term.axis]
    factor, unit = FIGURE_UNITS[term.unit]
    value = 1e6 * max(own, key=abs) if own else factor * abs(term.value)
    label = f"reversal peak, {term.axis} reverses" if own else name(term)
    return Tile(f"{three(value)} {typeset(unit)}", label, typeset(sentence(diagnosis, term)))


def diagnosis_part(diagnosis: Diagnosis) -> dict[str, Any]:
    """The diagnosis in summary.json, in SI."""
    return {
        "answer": answer(diagnosis),
        "directions": [SENSE_WORDS[sense] for sense in diagnosis.senses],
        **({"G": quantity(diagnosis.G, "m")} if diagnosis.arc is None else {"arc_range": quantity(diagnosis.G, "m")}),
        "causes": [
            {
                "name": name(term),
                **quantity(term.value, term.unit),
                "half_interval": finite(term.half),
                "alone": quantity(term.size, "m"),
                "share": term.share,
                "told_from_zero": term.shows,
                "meaning": sentence(diagnosis, term),
            }
            for term in diagnosis.terms
        ],
        "peaks": [
            {
                "at": peak.name,
                "direction": SENSE_WORDS[peak.sense],
                "height": quantity(peak.height, "m"),
                "half_interval": finite(peak.half),
                "width": quantity(peak.width, "s"),
                "decay": quantity(peak.decay, "s"),
            }
            for peak in diagnosis.peaks
        ],
        "vibrations": [
            {
                "axis": vibration.axis,
                "frequency": quantity(vibration.frequency, "Hz"),
                "amplitude": quantity(vibration.amplitude, "m"),
                "half_interval": finite(vibration.half),
            }
            for vibration in diagnosis.vibrations
        ],
        **_of_records(diagnosis),
        "path_lag": None if diagnosis.lag is None else quantity(diagnosis.lag, "m"),
        "form": {str(order): quantity(amplitude, "m") for order, amplitude in diagnosis.form.items()},
        "noise": quantity(diagnosis.noise, "m"),
    }


def _of_records(diagnosis: Diagnosis) -> dict[str, Any]:
    """What there is besides where an instrument has measured."""
    if diagnosis.angles is None:
        return {}
    return {
        "angle_offset": {
            **quantity(diagnosis.angles.angle, "rad"),
            "standard_deviation": diagnosis.angles.deviation,
            "seen": diagnosis.angles.seen,
        },
        "further": further(diagnosis),
    }


def _value(term: Term) -> str:
    """To the digits that its interval leaves it."""
    if not term.determined:
        return "not determined"
    factor, unit = FIGURE_UNITS[term.unit]
    value, half = factor * term.value, factor * term.half
    if not math.isfinite(half) or half <= 0:
        return f"{minus(number(value, 3))} {typeset(unit)}"
    places = max(0, 1 - math.floor(math.log10(half)))
    return f"{minus(f'{value:.{places}f}')} ± {half:.{places}f} {typeset(unit)}"


def _um(value: float) -> str:
    return minus(f"{value * 1e6:.2f}")


def _share(term: Term) -> str:
    return minus(f"{100 * term.share:.1f}").replace("−0.0", "0.0")


def _peak(peak: Peak) -> tuple[str, str, str, str]:
    def ms(value: float) -> str:
        return f"{value * 1e3:.1f}" if math.isfinite(value) else "–"

    return _um(peak.height), _um(peak.half) if math.isfinite(peak.half) else "–", ms(peak.width), ms(peak.decay)
