"""A mode shape in motion: an animated GIF of one period."""

from __future__ import annotations

import io
from typing import Any

import numpy as np

from feedsim.report.machine.model import Model, motion
from feedsim.report.machine.pictures import draw_mode, mode_heading, mode_panels, remark
from feedsim.report.style import drawing
from feedsim.structure.build import Built
from feedsim.structure.info import MachineInfo

FRAMES = 24
PERIOD = 1.6  # s
DPI = 90
COLOURS = 128


def mode_gif(info: MachineInfo, built: Built, of: Model, k: int, scale: float = 1.0) -> bytes:
    """One period of mode k, repeated for ever; the picture is that of the still, without arrows."""
    from PIL import Image

    moved = motion(built, of, k, scale)
    phases = np.sin(2 * np.pi * np.arange(FRAMES) / FRAMES).round(12).tolist()
    drawn: dict[float, Image.Image] = {}
    with drawing(11.6, 5.8) as figure:
        figure.set_dpi(DPI)
        mode_heading(figure, info, of, k)
        remark(figure, info)
        panels = list(mode_panels(figure, of, moved))
        canvas: Any = figure.canvas  # of drawing(): Agg's
        for phase in dict.fromkeys(phases):  # each is passed twice
            before = [set(axes.get_children()) for axes, _ in panels]
            for axes, where in panels:
                draw_mode(axes, where, of, moved, phase)
            canvas.draw()
            figure.set_layout_engine("none")  # the layout of the first frame is that of all
            drawn[phase] = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
            for (axes, _), kept in zip(panels, before, strict=True):
                for artist in set(axes.get_children()) - kept:
                    artist.remove()
    palette = drawn[max(drawn)].quantize(COLOURS)
    frames = [drawn[phase].quantize(palette=palette, dither=Image.Dither.NONE) for phase in phases]
    out = io.BytesIO()
    frames[0].save(
        out, format="GIF", save_all=True, append_images=frames[1:], duration=round(1e3 * PERIOD / FRAMES), loop=0
    )
    return out.getvalue()
