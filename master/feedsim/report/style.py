"""How figures look: colours, fonts, and drawing a figure as PNG and as inline SVG, where that is asked for.

Colours are Okabe and Ito's, which stay apart for the colour-blind and in grey print. In the SVG every colour of the
palette becomes a CSS variable, so that one drawing serves light, dark and paper; the PNG is drawn on white.
matplotlib is imported on first use.
"""

from __future__ import annotations

import io
import re
import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any
from warnings import catch_warnings, filterwarnings

import numpy as np
from numpy.typing import NDArray

from feedsim.extras import ask

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing

Array = NDArray[np.float64]

INK, MUTED, GRID, PAPER = "#1b1f24", "#59636e", "#d4dae1", "#fefefe"
BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY = "#0072b2", "#d55e00", "#009e73", "#b0528a", "#b87a00", "#3d9bd0"
# What a colour means, in every picture. Panel or label names the axis; dashes show the second direction of a circle.
SIMULATED = AFTER = BLUE
RECORDED = BEFORE = INK
SETPOINT = MUTED
AT_TOOL = ORANGE
RESIDUAL_COLOUR = VERMILLION  # what is left, stands out or lies outside
ALLOWED = GREEN  # bands that are allowed or targets
FRICTION = PURPLE
OTHERWISE = SKY  # simulated in another way: another set, another side

# CSS variable, colour on light ground (= in the drawing), colour on dark ground
PALETTE = (
    ("ink", INK, "#e6e9ed"),
    ("muted", MUTED, "#a3adb8"),
    ("grid", GRID, "#3a424c"),
    ("paper", PAPER, "#14181d"),
    ("blue", BLUE, "#5bb8f0"),
    ("vermillion", VERMILLION, "#ff9152"),
    ("green", GREEN, "#3fd0a3"),
    ("purple", PURPLE, "#e29ac5"),
    ("orange", ORANGE, "#e8b04a"),
    ("sky", SKY, "#8fd0f5"),
)


def named(colour: str) -> str:
    """The name of a colour of the palette."""
    return _NAMES[colour]


_NAMES = {on_light: name for name, on_light, _ in PALETTE}
# Colours by their variables, as on white paper.
PAGE_COLOURS = {name: colour for name, colour, _ in PALETTE} | {"ground": "#ffffff"}

PNG_DPI = 160
# The best compression of a PNG takes half as long again, for a file that is a ninth smaller.
PNG_EFFORT = {"compress_level": 3}
# An inline SVG above this size [bytes] is put into the page as PNG instead.
LARGEST_SVG = 400_000

# What stands in small print in every picture that is made inside remarked().
REMARK: ContextVar[str] = ContextVar("remark", default="")


@dataclass(frozen=True)
class Drawn:
    """A drawn figure: PNG bytes, SVG text with ids prefixed by the stem."""

    png: bytes
    svg: str

    @property
    def is_light(self) -> bool:
        """Whether a page holds the SVG; one above LARGEST_SVG it holds as PNG."""
        return len(self.svg.encode()) <= LARGEST_SVG


@contextmanager
def drawing(width: float, height: float) -> Iterator[Drawing]:
    """An empty figure of ``width`` x ``height`` inches in the house style. Raises MissingPackage."""
    ask("a drawing", "figures")
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure as Drawing
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    settings: Any = {
        "font.family": "DejaVu Sans",
        "font.size": 10,
        "axes.titlesize": 10.5,
        "axes.titleweight": "bold",
        "axes.titlelocation": "left",
        "axes.labelsize": 10,
        "axes.edgecolor": MUTED,
        "axes.linewidth": 0.8,
        "axes.grid": True,
        "axes.axisbelow": True,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.facecolor": "none",
        "figure.facecolor": PAPER,
        "grid.color": GRID,
        "grid.linewidth": 0.6,
        "lines.linewidth": 1.4,
        "lines.solid_capstyle": "round",
        "legend.frameon": False,
        "legend.fontsize": 9,
        "xtick.labelsize": 9,
        "ytick.labelsize": 9,
        "text.color": INK,
        "axes.labelcolor": INK,
        "axes.titlecolor": INK,
        "xtick.color": MUTED,
        "ytick.color": MUTED,
        "xtick.labelcolor": INK,
        "ytick.labelcolor": INK,
        "axes.formatter.useoffset": False,
        "axes.unicode_minus": True,
        "path.simplify_threshold": 0.15,
        "svg.fonttype": "path",
        "svg.hashsalt": "feedsim",
    }
    with rc_context(settings):
        figure = Drawing(figsize=(width, height), layout=ConstrainedLayoutEngine(h_pad=0.1, w_pad=0.06))
        FigureCanvasAgg(figure)
        yield figure


@contextmanager
def remarked(text: str, width: int = 150, lines: int = 2) -> Iterator[None]:
    """Charts made inside have `text` in their upper right corner as files: a picture travels without its page.

    width, lines: characters of a line and lines that fit the narrowest figure; what is longer ends there.
    """
    token = REMARK.set("\n".join(textwrap.wrap(text, width)[:lines]))
    try:
        yield
    finally:
        REMARK.reset(token)


def finish(figure: Drawing, stem: str, title: str) -> Drawn:
    """Render ``figure``; call inside its ``drawing``. The result depends on nothing but what was drawn."""
    png, svg = io.BytesIO(), io.StringIO()
    with catch_warnings():
        # Names in scripts that the font lacks; the page around the picture has them.
        filterwarnings("ignore", message=r"Glyph \d+ .*missing from")
        _lay_out(figure)
        figure.savefig(png, format="png", dpi=PNG_DPI, metadata={"Software": None}, pil_kwargs=PNG_EFFORT)
        figure.patch.set_visible(False)
        nothing = {"Date": None, "Creator": None, "Format": None, "Type": None}
        figure.savefig(svg, format="svg", metadata=nothing)
    return Drawn(png.getvalue(), _inline(svg.getvalue(), stem, title))


def _lay_out(figure: Drawing) -> None:
    """Give the rooms their places once: saving would for each format, and draw everything once more to do it."""
    engine = figure.get_layout_engine()
    if engine is not None:
        dpi, figure.dpi = figure.dpi, PNG_DPI
        engine.execute(figure)
        figure.set_layout_engine(None)  # "none" would leave one that does nothing, but costs as much
        figure.dpi = dpi


def _inline(svg: str, stem: str, title: str) -> str:
    """SVG for use inside a page: no prologue, ids of its own, the palette as variables, scaled to its container."""
    svg = svg[svg.index("<svg") :].rstrip()
    svg = re.sub(r"<metadata>.*?</metadata>\s*", "", svg, flags=re.DOTALL)
    svg = re.sub(r"<style[^>]*>.*?</style>", "", svg, flags=re.DOTALL)
    svg = re.sub(r"<defs>\s*</defs>\s*", "", svg)
    svg = re.sub(r'\bid="', f'id="{stem}-', svg)
    svg = re.sub(r'href="#', f'href="#{stem}-', svg)
    svg = re.sub(r"url\(#", f"url(#{stem}-", svg)
    svg = re.sub(r'(<svg[^>]*?) width="[^"]*"', r"\1", svg, count=1)
    svg = re.sub(r'(<svg[^>]*?) height="[^"]*"', r"\1", svg, count=1)
    for name, on_light, _ in PALETTE:
        svg = re.sub(re.escape(on_light), f"var(--{name})", svg, flags=re.IGNORECASE)
    return svg.replace("<svg", f'<svg role="img" aria-label="{escape(title)}" class="plot"', 1)


def standalone_drawing(svg: str) -> str:
    """An SVG as a file of its own: colours as numbers, a size, a light ground."""
    svg = re.sub(r"var\(--(\w+)\)", lambda match: PAGE_COLOURS[match[1]], svg)
    if match := re.search(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', svg):
        svg = svg.replace("<svg", f'<svg width="{match[1]}pt" height="{match[2]}pt"', 1)
    end = svg.index(">") + 1
    ground = f'<rect width="100%" height="100%" fill="{PAPER}"/>'
    return f'<?xml version="1.0" encoding="utf-8"?>\n{svg[:end]}{ground}{svg[end:]}\n'
