"""Which public source says what a number of a control means, and in which unit."""

from __future__ import annotations

from collections.abc import Iterable

from feedsim.control import Name
from feedsim.report.content import Section, Table, Text, code

NOTE = (
    "Confirmed: a public source that was opened states meaning and unit. Of all others the unit is supposed: they are "
    "taken and written only where --checked names them, or where the file states the unit."
)


def sources_section(names: Iterable[Name]) -> Section | None:
    """A row for every name, confirmed ones first."""
    each_once = sorted(dict.fromkeys(names), key=lambda name: not name.confirmed)
    rows: list[tuple[Text, ...]] = [
        (
            code(name.number),
            name.name,
            name.unit or "–",
            "confirmed" if name.confirmed else "not confirmed",
            name.source,
        )
        for name in each_once
    ]
    heads = ("Number", "Name", "Unit", "Unit and meaning", "Source")
    return Section("Where names and units come from", [Table("llllp", heads, rows, NOTE)], "sources") if rows else None
