"""What to change: proposals as a section of a report, as part of summary.json and as lines."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from feedsim.control import names_of
from feedsim.report.content import Bullets, Section, Table, Text, code, typed
from feedsim.report.control import asked
from feedsim.report.formatting import minus, typeset
from feedsim.report.provenance import finite
from feedsim.scenario import Machine
from feedsim.tune import Proposal
from feedsim.units import convert
from feedsim.variables import parameters

NOTE = (
    "A value follows from the parameters of the machine file in closed form. Margins are the least of the speed and "
    "the position loop of the axis, moving and at rest. feedsim run --try makes a second run with the proposals and "
    "lays it over this one. A proposal is as good as the machine file."
)

TUNED = ("K_p", "T_n", "K_v", "T_sym", "T_dyn", "omega_0", "D")  # what feedsim tune drive finds
REVERSALS = "reversal peaks"


def changes_section(
    proposals: Sequence[Proposal], machine: Machine | None = None, scenario: Path | None = None
) -> Section | None:
    """Every proposal; None where there is none. scenario: its file, which commands that go on take."""
    if not proposals:
        return None
    rows: list[tuple[Text, ...]] = [
        (
            each.cause[:1].upper() + each.cause[1:], each.axis, code(each.parameter.removeprefix("drive.")),
            *_values(each), _named(each, machine), typeset(each.reason), _margins(each),
        )
        for each in proposals
    ]  # fmt: skip
    heads = ("Cause", "Axis", "Parameter", "Present", "Proposed", "In the control", "Why", "Margins")
    further = _further(proposals, typed(scenario)) if scenario is not None and scenario.suffix != ".ssp" else None
    return Section("What to change", [Table("tllrrttt", heads, rows, NOTE), further], "changes")


def _further(proposals: Sequence[Proposal], scenario: str) -> Bullets | None:
    """The commands that find all values of a drive, or of a compensation, on many motions."""
    axes = dict.fromkeys(each.axis for each in proposals if each.parameter.removeprefix("drive.") in TUNED)
    found: list[Text] = [
        (f"All values of the drive of {axis} together, within margins: ",
         code(f"feedsim tune drive {scenario} --axis {axis}"))
        for axis in axes
    ]  # fmt: skip
    if any(each.cause.startswith(REVERSALS) for each in proposals):
        found.append(("Values of a friction compensation: ", code(f"feedsim tune compensation {scenario}")))
    return Bullets(found) if found else None


def first_change(proposals: Sequence[Proposal]) -> str:
    """The first proposal that has a value, in a few words: "X.K_v 4 → 4.2 (m/min)/mm"; "" without one."""
    each = next((each for each in proposals if each.proposed is not None), None)
    if each is None:
        return ""
    present, proposed = _values(each)
    return f"{each.axis}.{each.parameter.removeprefix('drive.')} {present.split(' ')[0]} → {proposed}"


def change_lines(proposals: Sequence[Proposal]) -> list[str]:
    """A line each for the terminal."""
    found = []
    for each in proposals:
        present, proposed = _values(each)
        value = f"{present} -> {proposed}" if each.proposed is not None else f"{proposed} (now {present})"
        found.append(f"change: {each.axis}.{each.parameter.removeprefix('drive.')} {value}: {each.cause}")
    return found


def changes_part(proposals: Sequence[Proposal]) -> list[dict[str, Any]]:
    """The proposals in summary.json, in SI."""
    return [
        {
            "cause": each.cause, "axis": each.axis, "parameter": each.parameter, "present": each.present,
            "proposed": each.proposed, "unit": each.unit, "direction": each.direction, "reason": each.reason,
            "margins": None if each.margins is None else [list(map(finite, margin)) for margin in each.margins],
        }
        for each in proposals
    ]  # fmt: skip


def _values(each: Proposal) -> tuple[str, str]:
    present = "–" if each.present is None else _value(each, each.present)
    return present, each.direction if each.proposed is None else _value(each, each.proposed)


def _value(each: Proposal, value: float) -> str:
    unit = parameters("controller")[each.parameter.removeprefix("drive.")].display_unit
    number = minus(f"{convert(value, each.unit, unit):.4g}")
    return number if unit == "1" else f"{number} {unit}"


def _named(each: Proposal, machine: Machine | None) -> str:
    control = asked(machine)
    name = names_of(control).get(each.parameter) if control else None
    if name is None:
        return "–"
    return f"{name.number} {name.name}" if each.proposed is None else name.text(each.proposed)


def _margins(each: Proposal) -> str:
    if each.margins is None:
        return ""
    (a, b), (c, d) = each.margins
    return minus(f"{a:.3g} dB, {b:.3g}° -> {c:.3g} dB, {d:.3g}°")
