"""The table of docs/importing.md: a row as it must stand there."""

from __future__ import annotations

from importers import z_move

PAGE = z_move.ROOT / "docs" / "importing.md"
# Below this, a difference is rounding: libcosim shows 1.4e-7 nm and 4e-8 mN.m over the move.
ROUNDING_X = 1e-5  # nm
ROUNDING_M = 1e-5  # mN.m


def number(value: float, rounding: float) -> str:
    """Three digits; 0 where not a bit differs."""
    if value == 0.0:
        return "0"
    if value < rounding:
        return "rounding"
    return f"{float(f'{value:.3g}'):.10g}"


def row(name: str, what: str, differences: tuple[float, float], overshoot: float, why: str) -> str:
    x, torque = number(differences[0], ROUNDING_X), number(differences[1], ROUNDING_M)
    return f"| {name} | {what} | {x} | {torque} | {overshoot:.2f} | {why} |"


def check(line: str) -> None:
    """The page has this row.

    Raises:
        AssertionError: with the row as measured and the one that stands there.
    """
    text = PAGE.read_text(encoding="utf-8")
    start = "|".join(line.split("|")[:3])
    there = [other for other in text.splitlines() if other.startswith(start)]
    assert line in text.splitlines(), f"measured:\n{line}\n{PAGE.name} says:\n" + "\n".join(there or ["(nothing)"])
