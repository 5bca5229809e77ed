"""A mode shape in motion: an animated GIF of one period."""

from __future__ import annotations

import io

import numpy as np

from feedsim.report.chart.file import png, standalone
from feedsim.report.machine.model import Model, motion
from feedsim.report.machine.pictures import mode_drawing, mode_title
from feedsim.structure.build import Built
from feedsim.structure.info import MachineInfo

FRAMES = 24
PERIOD = 1.6  # s
PIXELS = 1.09  # of a frame for one of the drawing
COLOURS = 128


def mode_gif(info: MachineInfo, built: Built, of: Model, k: int, scale: float = 1.0) -> bytes:
    """One period of mode k, repeated for ever; the picture is that of the still, without arrows."""
    from PIL import Image

    moved = motion(built, of, k, scale)
    phases = np.sin(2 * np.pi * np.arange(FRAMES) / FRAMES).round(12).tolist()
    drawn: dict[float, Image.Image] = {}
    for phase in dict.fromkeys(phases):  # each is passed twice
        frame = standalone(mode_drawing(info, of, k, moved, phase), mode_title(info, k))
        drawn[phase] = Image.open(io.BytesIO(png(frame, PIXELS))).convert("RGB")
    palette = drawn[max(drawn)].quantize(COLOURS)
    frames = [drawn[phase].quantize(palette=palette, dither=Image.Dither.NONE) for phase in phases]
    out = io.BytesIO()
    frames[0].save(
        out, format="GIF", save_all=True, append_images=frames[1:], duration=round(1e3 * PERIOD / FRAMES), loop=0
    )
    return out.getvalue()
