"""The report on a machine's structure: what report.html says, with pictures of the structure and of its modes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from feedsim.report.content import FOLDER, Animation, Paragraph, Report, Section, Table, Text, Tile, code, typed
from feedsim.report.formatting import display_unit, number, typeset
from feedsim.report.machine.animation import mode_gif
from feedsim.report.machine.model import model
from feedsim.report.machine.pictures import mode_picture, mode_title, sheet_picture, structure_picture
from feedsim.report.machine.record import MEANINGS, USUAL_EXCHANGE, exchange, moves
from feedsim.report.picture import Picture
from feedsim.report.provenance import hashed
from feedsim.report.results import FIGURES, Content
from feedsim.report.sections import provenance_section
from feedsim.scenario.structure import Structure
from feedsim.structure.info import MachineInfo

FAR_BELOW = 0.1  # share of the limit of the exchange, up to which it is stable by far


@dataclass(frozen=True, eq=False)
class Drawings:
    """What a report shows of a machine: its pictures and animations, and the files of the latter."""

    parts: Sequence[Picture | Animation]
    files: Mapping[str, Content]


def drawn(
    structure: Structure, info: MachineInfo, *, modes: Sequence[int] = (), scale: float = 1.0, animate: bool = False
) -> Drawings:
    """The structure's picture, and those of `modes`, or without any a sheet of the first ones.

    Raises InputError: the model has no geometry.
    """
    built = info.built
    assert built is not None
    of = model(structure, built.assembly)
    pictures = [structure_picture(info, of)]
    if modes:
        pictures += [mode_picture(info, built, of, k, scale) for k in modes]
    elif (sheet := sheet_picture(info, built, of, scale)) is not None:
        pictures.append(sheet)
    gifs = {k: mode_gif(info, built, of, k, scale) for k in modes if animate}
    caption = "One period, slowed down and exaggerated."
    moving = [Animation(mode_title(info, k), caption, gif) for k, gif in gifs.items()]
    return Drawings([*pictures, *moving], {f"{FIGURES}/mode_{k}.gif": gif for k, gif in gifs.items()})


def report_of(info: MachineInfo, files: Sequence[tuple[str, Path]], pictures: Sequence[Picture | Animation]) -> Report:
    """Content of the report."""
    solution = info.solution
    assert solution is not None
    cutoff = f"{solution.cutoff / (2 * math.pi):g} Hz"
    rows = [
        ("Eigenproblem", f"{solution.method}; {solution.verification}"),
        ("Dropped", f"{solution.dropped} modes above {cutoff}"),
        ("Static correction", f"{solution.corrections} pseudo-modes" if solution.corrections else "none"),
    ]
    return Report(
        f"Structure: {info.name}",
        f"{info.title} · {solution.shapes.shape[0]} degrees of freedom · modes up to {cutoff}",
        answer=answers(info),
        warnings=info.warnings,
        notes=[info.note],
        tiles=list(_tiles(info)),
        next_step=(
            "See how a mode moves:\n",
            code(f"feedsim machine view {typed(files[0][1])} --mode {_lowest(info)} --animate --out {FOLDER}"),
        ),
        main=[*pictures, _axes(info), _modes(info)],
        provenance=provenance_section(rows, hashed(list(files))),
        footer="Values in full precision: summary.json. Pictures: figures/.",
    )


def answers(info: MachineInfo) -> list[str]:
    """The lowest mode and what moves in it, and whether the exchange with friction is stable."""
    lines = []
    if info.modes.frequency[k := _lowest(info)] > 0:
        lines.append(f"The lowest elastic mode is at {info.modes.frequency[k]:.2f} Hz: {moves(info, k)}.")
    shares = [axis.friction_slope / axis.coupling_limit for axis in info.axes if math.isfinite(axis.friction_slope)]
    if shares and max(shares) <= USUAL_EXCHANGE.stable_share:
        lines.append("The exchange of plant and friction is stable by far (table Axes)." if max(shares) < FAR_BELOW
                     else "The exchange of plant and friction is stable (table Axes).")  # fmt: skip
    return lines


def _lowest(info: MachineInfo) -> int:
    """Number of the lowest elastic mode; 0 where all are rigid."""
    return next((k for k, f in enumerate(info.modes.frequency.tolist()) if f > 0), 0)


def _tiles(info: MachineInfo) -> Iterator[Tile]:
    if math.isfinite(info.total_mass):
        yield Tile(f"{info.total_mass:.0f} kg", "total mass", "Mass of everything")
    elastic = info.modes.frequency[info.modes.frequency > 0]
    if len(elastic):
        yield Tile(f"{elastic[0]:.2f} Hz", "lowest elastic mode", "Frequency of the first mode that is not rigid")
    for axis in info.axes:
        if math.isfinite(axis.moving_mass):
            yield Tile(f"{axis.moving_mass:.0f} kg", f"{axis.name}: moving mass", MEANINGS["moving_mass"][1])


def _axes(info: MachineInfo) -> Section | None:
    rows: list[tuple[Text, ...]] = []
    for key, (unit, meaning) in MEANINGS.items():
        values = [getattr(axis, key) for axis in info.axes]
        if any(math.isfinite(value) for value in values):
            rows.append((typeset(meaning), display_unit(unit), *(number(value, 5) for value in values)))
    note = (
        f"h = {info.step * 1e6:.6g} µs. The default exchange of plant and friction is stable up to "
        f"{100 * USUAL_EXCHANGE.stable_share:.0f} % of 2 J_inf/h."
    )
    heads = ("Figure", "Unit", *(axis.name for axis in info.axes))
    parts = [Paragraph(typeset(line), "muted") for line in exchange(info)]
    return Section("Axes", [Table("tl" + "r" * len(info.axes), heads, rows, note), *parts]) if info.axes else None


def _modes(info: MachineInfo) -> Section:
    pairs = zip(info.modes.frequency.tolist(), info.modes.damping.tolist(), strict=True)
    rows = [(str(k), f"{f:.3f}", f"{100 * d:.3g}", moves(info, k)) for k, (f, d) in enumerate(pairs)]
    heads = ("Mode", "Frequency [Hz]", "Damping [%]", "What moves")
    return Section("Modes", [Table("rrrp", heads, rows, "Shares of the kinetic energy.")])
