"""Write pictures, report and figures of a machine's structure into a directory, whole or not at all."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from feedsim.report.machine.animation import mode_gif
from feedsim.report.machine.model import model
from feedsim.report.machine.page import page
from feedsim.report.machine.pictures import mode_picture, mode_title, sheet_picture, structure_picture
from feedsim.report.machine.record import record
from feedsim.report.results import FIGURES, REPORT, SUMMARY, check_place, write_results, write_text
from feedsim.report.style import PALETTE, PAPER, Picture
from feedsim.report.summary import to_json
from feedsim.scenario import Structure
from feedsim.structure.info import MachineInfo


def check_writable(directory: Path | str) -> None:
    """Raise OutputError unless the pictures can be written to ``directory``; leaves nothing behind."""
    check_place(directory, (REPORT, SUMMARY))


def write(
    structure: Structure,
    info: MachineInfo,
    files: Sequence[tuple[str, Path]],
    directory: Path | str,
    *,
    modes: Sequence[int] = (),
    scale: float = 1.0,
    animate: bool = False,
) -> tuple[Path, ...]:
    """Write the structure's picture, and those of `modes`, or without any a sheet of the first ones.

    Each as figures/*.png and *.svg, animated ones as *.gif; report.html, summary.json. Returns the paths.

    Raises:
        InputError: the model has no geometry.
        OutputError: it cannot be written.
    """
    built = info.built
    assert built is not None
    of = model(structure, built.assembly)
    pictures = [structure_picture(info, of)]
    if modes:
        pictures += [mode_picture(info, built, of, k, scale) for k in modes]
    elif (sheet := sheet_picture(info, built, of, scale)) is not None:
        pictures.append(sheet)
    gifs = {f"{FIGURES}/mode_{k}.gif": (k, mode_gif(info, built, of, k, scale)) for k in modes if animate}
    drawings = {f"{FIGURES}/{picture.stem}.svg": picture for picture in pictures}

    def fill(fresh: Path, names: Sequence[str]) -> None:
        for name, picture in drawings.items():
            write_text(fresh / name, standalone(picture))
        for name, (_, content) in gifs.items():
            (fresh / name).write_bytes(content)
        moving = [(content, mode_title(info, k)) for k, content in gifs.values()]
        write_text(fresh / REPORT, page(info, files, pictures, moving))
        write_text(fresh / SUMMARY, to_json(record(info, files) | {"files": list(names)}))

    return write_results(directory, [*drawings, *gifs, REPORT, SUMMARY], pictures, fill)


def standalone(picture: Picture) -> str:
    """The picture's SVG as a file of its own: colours as numbers, a size, a light ground."""
    svg = picture.svg
    for name, colour, _ in PALETTE:
        svg = svg.replace(f"var(--{name})", colour)
    if match := re.search(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', svg):
        svg = svg.replace("<svg", f'<svg width="{match[1]}pt" height="{match[2]}pt"', 1)
    end = svg.index(">") + 1
    ground = f'<rect width="100%" height="100%" fill="{PAPER}"/>'
    return f'<?xml version="1.0" encoding="utf-8"?>\n{svg[:end]}{ground}{svg[end:]}\n'
