"""What to change: proposals as a section of a report, as part of summary.json and as lines."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from functools import reduce
from pathlib import Path
from typing import Any

from feedsim.analysis.proposals import COMPENSATION, Proposal
from feedsim.files.control import Name, names_of
from feedsim.report.content import Bullets, Section, Table, Text, code, command_path
from feedsim.report.formatting import minus, typeset
from feedsim.report.provenance import finite
from feedsim.scenario import Machine

# --- Parameters in the words of a control: its numbers, names and units beside ours, as a section of any report -------


# What the causes of a circle are set by, where no machine shows values.
OF_CIRCLES = (
    "drive.K_v", "drive.k_ffw", "drive.T_sym", "drive.T_dyn", "drive.backlash_compensation.value",
    "drive.friction_pulse.amplitude", "drive.friction_pulse.time",
)  # fmt: skip
NAMES_NOTE = (
    "Confirmed: a public source with meaning and unit was opened. Of all others the unit is an assumption: check it at "
    "the control before you type a value. Names, units and sources: docs/controls.md."
)


_REQUESTED_CONTROL = ContextVar("control", default="")


@contextmanager
def control_names(control: str) -> Iterator[None]:
    """A block in which reports show parameters in the names of a control, too: what --control asks for."""
    before = _REQUESTED_CONTROL.set(control)
    try:
        yield
    finally:
        _REQUESTED_CONTROL.reset(before)


def control_section(
    machine: Machine | None = None, changes: Mapping[str, Sequence[str]] | None = None
) -> Section | None:
    """The section, where a control is asked for or the machine file names one; else None.

    changes: parameter of a machine file -> value of every source, where the report is about those.
    """
    control = requested_control(machine)
    return section(control, machine, changes) if control else None


def requested_control(machine: Machine | None = None) -> str:
    """The control whose names are asked for, or that the machine file names; "" without one."""
    return _REQUESTED_CONTROL.get() or (machine.control or "" if machine is not None else "")


def section(control: str, machine: Machine | None, changes: Mapping[str, Sequence[str]] | None = None) -> Section:
    """The control's names: with the values of a machine's axes, with values that differ, or by themselves."""
    names = names_of(control)
    if changes is not None:
        return _section(control, _change_rows(names, changes), ("Axis", "Values"), "ll")
    if machine is None:
        rows = [
            (*_head(names[key]), names[key].unit, _confirmation_text(names[key])) for key in OF_CIRCLES if key in names
        ]
        return _section(control, rows, (), "")
    values = {axis: axis_values(control, machine, axis) for axis in machine.axes}
    rows = [
        (*_head(name), *(minus(f"{own[key]:.6g}") if key in own else "–" for own in values.values()), name.unit,
         _confirmation_text(name))
        for key, name in names.items()
        if any(key in own for own in values.values())
    ]  # fmt: skip
    return _section(control, rows, tuple(values), "r" * len(values))


def axis_values(control: str, machine: Machine, axis: str) -> dict[str, float]:
    """Our parameter -> value in the control's unit, of an axis, as far as it has them."""
    values = {}
    for key, name in names_of(control).items():
        value = reduce(lambda entry, step: getattr(entry, step, None), key.split("."), _start(machine, axis))
        if isinstance(value, bool | int | float):
            values[key] = name.shown(float(value))
    return values


def _start(machine: Machine, axis: str) -> Any:
    return machine.axes[axis]


def _change_rows(names: Mapping[str, Name], changes: Mapping[str, Sequence[str]]) -> list[tuple[Text, ...]]:
    rows: list[tuple[Text, ...]] = []
    for key, values in changes.items():
        axis, _, parameter = key.removeprefix("machine.").removeprefix("axes.").partition(".")
        if (name := names.get(parameter)) is None:
            continue
        shown = []
        for value in values:
            with suppress(ValueError):
                shown.append(f"{name.shown(float(value.partition(' ')[0])):.6g}")
        rows.append((*_head(name), axis, minus(" | ".join(shown)), name.unit, _confirmation_text(name)))
    return rows


def _head(name: Name) -> tuple[Text, ...]:
    return code(name.number), name.name, code(name.parameter.removeprefix("drive."))


def _confirmation_text(name: Name) -> str:
    return "confirmed" if name.confirmed else "not confirmed"


def _section(control: str, rows: Sequence[Sequence[Text]], heads: tuple[str, ...], columns: str) -> Section:
    table = Table(
        f"lll{columns}ll",
        ("Number", "Name in the control", "Ours", *heads, "Unit", "Unit and meaning"),
        rows,
        NAMES_NOTE,
    )
    return Section(f"Names in the control {control}", [table], "control")


# --- What to change: proposals as a section of a report, as part of summary.json and as lines -------------------------


NOTE = (
    "A value follows from the parameters of the machine file in closed form. Margins are the least of the speed and "
    "the position loop of the axis, moving and at rest. feedsim tune proposals makes a second run with the proposals "
    "and lays it over this one. A proposal is as good as the machine file."
)

TUNED_PARAMETERS = ("K_p", "T_n", "K_v", "T_sym", "T_dyn", "omega_0", "D")  # what feedsim tune drive finds
REVERSALS = "reversal peaks"


def changes_section(
    proposals: Sequence[Proposal], machine: Machine | None = None, scenario: Path | None = None
) -> Section | None:
    """Every proposal; None where there is none. scenario: its file, which commands that go on take."""
    if not proposals:
        return None
    rows: list[tuple[Text, ...]] = [
        (
            proposal.cause[:1].upper() + proposal.cause[1:],
            proposal.axis,
            code(proposal.parameter.removeprefix("drive.")),
            *_values(proposal),
            _control_value(proposal, machine),
            typeset(proposal.reason),
            _margins(proposal),
        )
        for proposal in proposals
    ]
    heads = ("Cause", "Axis", "Parameter", "Present", "Proposed", "In the control", "Why", "Margins")
    further = (
        _suggest_commands(proposals, command_path(scenario))
        if scenario is not None and scenario.suffix != ".ssp"
        else None
    )
    return Section("What to change", [Table("tllrrttt", heads, rows, NOTE), further], "changes", unfolded=True)


def _suggest_commands(proposals: Sequence[Proposal], scenario: str) -> Bullets | None:
    """The commands that find all values of a drive, or of a compensation, on many motions."""
    axes = dict.fromkeys(
        proposal.axis for proposal in proposals if proposal.parameter.removeprefix("drive.") in TUNED_PARAMETERS
    )
    result: list[Text] = [
        (f"All values of the drive of {axis} together, within margins: ",
         code(f"feedsim tune drive {scenario} --axes {axis}"))
        for axis in axes
    ]  # fmt: skip
    if any(proposal.cause.startswith(REVERSALS) for proposal in proposals):
        result.append(("Values of a friction compensation: ", code(f"feedsim tune compensation {scenario}")))
    return Bullets(result) if result else None


def change_words(proposal: Proposal) -> str:
    """A proposal in a few words: "T_sym of Z from 2.9 to 3.53 ms", "T_dyn of X: +0.40 ms"."""
    present, proposed = _values(proposal)
    if proposal.proposed is not None:
        unit = present.partition(" ")[2]
        start = present.partition(" ")[0] if unit == proposed.partition(" ")[2] else present
        return f"{proposal.what} from {start} to {proposed}"
    return f"{proposal.what}: {proposed}" if proposal.parameter != COMPENSATION else proposal.what


def action(proposals: Sequence[Proposal], machine: Machine | None = None) -> str:
    """What to type first, in the control's number and unit where one is asked for or named; "" without proposals."""
    if not proposals:
        return ""
    proposal = proposals[0]
    control = requested_control(machine)
    name = names_of(control).get(proposal.parameter) if control else None
    text = change_words(proposal)
    if proposal.parameter == COMPENSATION:
        return f"Change: {text}: {proposal.direction} (feedsim tune compensation finds its values)."
    if name is None:
        return f"Change: {text}."
    place = f"{name.number} {name.name}" + (f" of {proposal.axis}" if proposal.axis else "")
    doubt = "" if name.confirmed else "; check the unit at the control"
    if proposal.proposed is not None and proposal.present is not None:
        old, new = (f"{name.shown(value):.3g}" for value in (proposal.present, proposal.proposed))
        return f"Change: {place} from {old} to {new} {name.unit}".rstrip() + f" ({text}{doubt})."
    if proposal.step is not None:
        return f"Change: {place} by {name.shown(proposal.step):+#.2g} {name.unit}".rstrip() + f" ({text}{doubt})."
    return f"Change: {place}: {proposal.direction} ({text})."


def change_lines(proposals: Sequence[Proposal]) -> list[str]:
    """A line each for the terminal."""
    result = []
    for proposal in proposals:
        present, proposed = _values(proposal)
        value = f"{present} -> {proposed}" if proposal.proposed is not None else f"{proposed} (now {present})"
        result.append(
            f"change: {proposal.key.removeprefix('machine.').removeprefix('axes.')} {value}: {proposal.cause}"
        )
    return result


def changes_part(proposals: Sequence[Proposal]) -> list[dict[str, Any]]:
    """The proposals in summary.json, in SI."""
    return [
        {
            "cause": proposal.cause,
            "axis": proposal.axis,
            "parameter": proposal.parameter,
            "present": proposal.present,
            "proposed": proposal.proposed,
            "step": proposal.step,
            "unit": proposal.unit,
            "direction": proposal.direction,
            "reason": proposal.reason,
            "margins": None if proposal.margins is None else [list(map(finite, margin)) for margin in proposal.margins],
        }
        for proposal in proposals
    ]


def _values(proposal: Proposal) -> tuple[str, str]:
    present = "–" if proposal.present is None else proposal.shown(proposal.present, 4)
    if proposal.proposed is not None:
        return minus(present), minus(proposal.shown(proposal.proposed))
    if proposal.step is not None:
        return minus(present), minus("+" * (proposal.step > 0) + proposal.shown(proposal.step, 2, kept=True))
    return minus(present), proposal.direction


def _control_value(proposal: Proposal, machine: Machine | None) -> str:
    control = requested_control(machine)
    name = names_of(control).get(proposal.parameter) if control else None
    if name is None:
        return "–"
    return f"{name.number} {name.name}" if proposal.proposed is None else name.text(proposal.proposed)


def _margins(proposal: Proposal) -> str:
    if proposal.margins is None:
        return ""
    (a, b), (c, d) = proposal.margins
    return minus(f"{a:.3g} dB, {b:.3g}° -> {c:.3g} dB, {d:.3g}°")
