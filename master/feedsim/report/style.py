"""How figures look: colours, fonts, and drawing a figure as PNG and as inline SVG, where that is asked for.

Colours are Okabe and Ito's, which stay apart for the colour-blind and in grey print. In the SVG every colour of the
palette becomes a CSS variable, so that one drawing serves light, dark and paper; the PNG is drawn on white.
matplotlib is imported on first use.
"""

from __future__ import annotations

import io
import re
import textwrap
from collections.abc import Callable, Iterator
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
    from matplotlib.text import Text

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

PNG_DPI = 160
# The best compression of a PNG takes half as long again, for a file that is a ninth smaller.
PNG_EFFORT = {"compress_level": 3}
# An inline SVG above this size [bytes] is put into the page as PNG instead.
LARGEST_SVG = 400_000

# What stands in small print in every figure that is finished inside remarked().
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
    """Figures made inside say `text` in their upper right corner: a picture travels without its page.

    width, lines: characters of a line and lines that fit the narrowest figure; what is longer ends there.
    """
    with said("\n".join(textwrap.wrap(text, width)[:lines])):
        yield


@contextmanager
def said(remark: str) -> Iterator[None]:
    """Figures finished inside have this in small print."""
    token = REMARK.set(remark)
    try:
        yield
    finally:
        REMARK.reset(token)


def finish(
    figure: Drawing, stem: str, title: str, caption: str = "", *, worded: bool = False,
    then: Callable[[], object] = lambda: None,
) -> Drawn:  # fmt: skip
    """Render ``figure``; call inside its ``drawing``. The result depends on nothing but what was drawn.

    worded: title and caption stand above the PNG, which travels alone; the page has them beside the SVG. then: called
    when the layout is known. Legends of the figure that the layout leaves out stand above everything but
    these words.
    """
    head, words_above = _head(figure, title, caption) if worded else (0.0, [])
    if remark := REMARK.get():
        words = figure.text(0.995, 0.995, remark, fontsize=6.5, color=MUTED, ha="right", va="top")
        words.set_in_layout(False)
        words.set_y(0.995 - head / figure.get_figheight())
    room = head + (0.13 * (1 + remark.count("\n")) if remark else 0.0)
    for legend in [each for each in figure.legends if not each.get_in_layout()]:
        tall = legend.get_window_extent().height / figure.dpi
        figure.set_figheight(figure.get_figheight() + tall)
        legend.set_bbox_to_anchor((0.06 / figure.get_figwidth(), 1 - (room + 0.04) / figure.get_figheight()))
        room += tall
    if room:
        layout: Any = figure.get_layout_engine()
        layout.set(rect=(0, 0, 1, 1 - room / figure.get_figheight()))  # inches to a share of the height
    from matplotlib.transforms import Bbox

    png, svg = io.BytesIO(), io.StringIO()
    with catch_warnings():
        # Names in scripts that the font lacks; the page around the picture has them.
        filterwarnings("ignore", message=r"Glyph \d+ .*missing from")
        _lay_out(figure, then)
        figure.savefig(png, format="png", dpi=PNG_DPI, metadata={"Software": None}, pil_kwargs=PNG_EFFORT)
        figure.patch.set_visible(False)
        for text in words_above:
            text.set_visible(False)
        below = Bbox.from_extents(0, 0, figure.get_figwidth(), figure.get_figheight() - head) if head else None
        nothing = {"Date": None, "Creator": None, "Format": None, "Type": None}
        figure.savefig(svg, format="svg", metadata=nothing, bbox_inches=below)
    return Drawn(png.getvalue(), _inline(svg.getvalue(), stem, title))


def _head(figure: Drawing, title: str, caption: str) -> tuple[float, list[Text]]:
    """Make room for title and caption above a figure and write them there: room [inches], and texts."""
    texts: list[Text] = []
    lines = textwrap.wrap(caption, int(15.5 * figure.get_figwidth()))
    head = 0.3 + 0.135 * len(lines)
    figure.set_figheight(figure.get_figheight() + head)
    height = figure.get_figheight()
    for text, top, size, weight, colour in (
        (title, 0.07, 11.0, "bold", INK),
        ("\n".join(lines), 0.28, 7.5, "normal", MUTED),
    ):
        written = figure.text(
            0.1 / figure.get_figwidth(), 1 - top / height, text.replace("$", r"\$"),
            fontsize=size, fontweight=weight, color=colour, va="top", linespacing=1.2,
        )  # fmt: skip
        written.set_in_layout(False)
        texts.append(written)
    return head, texts


def _lay_out(figure: Drawing, then: Callable[[], object]) -> None:
    """Give the rooms their places once: saving would for each format, and draw everything once more to do it."""
    engine = figure.get_layout_engine()
    if engine is not None:
        dpi, figure.dpi = figure.dpi, PNG_DPI
        engine.execute(figure)
        figure.set_layout_engine(None)  # "none" would leave one that does nothing, but costs as much
        then()
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
