"""Pictures of a machine's structure and of its modes."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from feedsim.report.formatting import minus
from feedsim.report.machine import projection
from feedsim.report.machine.model import Model, Motion, extent, motion, rotor_disc, solids
from feedsim.report.machine.projection import Faces, View
from feedsim.report.picture import Picture
from feedsim.report.style import INK, MUTED, PAPER, PNG_DPI, VERMILLION, Drawn, drawing, finish
from feedsim.structure.build import Built
from feedsim.structure.geometry.outline import deflection, node_motion
from feedsim.structure.info import MachineInfo

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawing

GHOST = np.array([0.87, 0.89, 0.91])  # the structure at rest behind a mode shape
# Kind of a feature -> marker, size, in words. Drawn over the bodies: they sit inside.
MARKS = {
    "mount": ("^", 42.0, "mount on the ground"),
    "carriage": ("s", 22.0, "guide carriage"),
    "bearing": ("o", 20.0, "screw bearing"),
    "nut": ("D", 24.0, "nut"),
    "scale": ("|", 60.0, "linear scale, reading point"),
    "mass": ("o", 30.0, "mass on a node"),
    "tool": ("*", 130.0, "tool centre point"),
}
SHEET = 8
NOTE_WIDTH, NOTE_LINES = 100, 3  # of the remark, letters
MOST_BODIES = 12  # in a legend
ARROW = 0.025  # shortest arrow of a motion, of the machine's size
WORTH_AN_ARROW = 0.08  # of the kinetic energy


def structure_picture(info: MachineInfo, of: Model) -> Picture:
    """The machine at rest, from three sides, with what holds and drives it."""

    def draw() -> Drawn:
        with drawing(11.6, 7.0) as figure:
            panels = figure.subplot_mosaic(
                [["oblique", "front"], ["oblique", "side"]], width_ratios=[2.1, 1], height_ratios=[1, 1]
            )
            points = extent(of)
            for key, where in (("oblique", projection.OBLIQUE), ("front", projection.FRONT), ("side", projection.SIDE)):
                axes = panels[key]
                projection.frame_limits(axes, where, points, 0.03, below=0.2 if where.name else 0.0)
                _draw(axes, where, of, None, 1.0)
                _marks(axes, where, of)
                triad(axes, where)
                if where.name:
                    axes.set_title(where.name, fontsize=9, fontweight="normal", color=MUTED)
            _legend(figure, of, panels["oblique"].get_legend_handles_labels()[0])
            figure.set_dpi(PNG_DPI)
            remark(figure, info)
            figure.suptitle(info.title, x=0.015, ha="left", fontsize=12, fontweight="bold")
            return finish(figure, "structure", "Structure")

    mass = f", {info.total_mass:.0f} kg" if np.isfinite(info.total_mass) else ""
    caption = (
        f"{of.assembly.mass.shape[0]} degrees of freedom{mass}. "
        + ("Beams are drawn with their cross-sections. " if of.looks else "Lines between the nodes. ")
        + "Y is up."
    )
    return Picture("structure", "Structure", caption, draw)


def mode_picture(info: MachineInfo, built: Built, of: Model, k: int, scale: float = 1.0) -> Picture:
    """A mode shape, exaggerated, over the structure at rest; beside it the view from the side where most is seen."""
    moved = motion(built, of, k, scale)
    shares = built.solution.moving[k].shares

    def draw() -> Drawn:
        with drawing(11.6, 5.8) as figure:
            for axes, where in mode_panels(figure, of, moved):
                draw_mode(axes, where, of, moved, 1.0)
                arrows(axes, where, of, moved, [share.body for share in shares if share.energy >= WORTH_AN_ARROW])
            mode_heading(figure, info, of, k)
            figure.set_dpi(PNG_DPI)
            remark(figure, info)
            return finish(figure, f"mode_{k}", mode_title(info, k))

    return Picture(f"mode_{k}", mode_title(info, k), mode_caption(info, k), draw)


def sheet_picture(info: MachineInfo, built: Built, of: Model, scale: float = 1.0) -> Picture | None:
    """The first elastic modes, small; None where there are none."""
    modes = np.flatnonzero(info.modes.frequency > 0)[:SHEET].tolist()
    if not modes:
        return None
    columns = min(4, len(modes))
    rows = -(-len(modes) // columns)

    def draw() -> Drawn:
        with drawing(11.6, 0.7 + 2.9 * rows) as figure:
            panels = figure.subplots(rows, columns, squeeze=False).ravel()
            for axes in panels[len(modes) :]:
                axes.set_axis_off()
            motions = [motion(built, of, k, scale) for k in modes]
            points = np.concatenate([extent(of, moved) for moved in motions])
            for axes, k, moved in zip(panels, modes, motions, strict=False):
                projection.frame_limits(axes, projection.OBLIQUE, points, 0.01)
                draw_mode(axes, projection.OBLIQUE, of, moved, 1.0)
                axes.set_title(f"{k}: {frequency(info, k)}", fontsize=10, pad=16)
                axes.text(
                    0, 1.0, _short(info.moving[k]), transform=axes.transAxes, fontsize=7.5, color=MUTED, va="bottom"
                )
            figure.set_dpi(PNG_DPI)
            remark(figure, info, below=True)
            figure.suptitle(
                f"{info.title}: the first elastic modes", x=0.015, ha="left", fontsize=12, fontweight="bold"
            )
            return finish(figure, "modes", "The first elastic modes")

    caption = (
        "Deflections exaggerated, over the structure at rest in grey; below the frequency the body that has the "
        "largest share of the kinetic energy."
    )
    return Picture("modes", "The first elastic modes", caption, draw)


def mode_panels(figure: Drawing, of: Model, moved: Motion) -> Iterator[tuple[Axes, View]]:
    """Two axes with their views, limits set so that the whole oscillation fits."""
    points = extent(of, moved)
    panels = figure.subplot_mosaic([["oblique", "flat"]], width_ratios=[1.5, 1])
    for key, where in (("oblique", projection.OBLIQUE), ("flat", telling_view(of, moved))):
        axes = panels[key]
        projection.frame_limits(axes, where, points, 0.03, below=0.2 if where.name else 0.0)
        triad(axes, where)
        if where.name:
            axes.set_title(where.name, fontsize=9, fontweight="normal", color=MUTED)
        yield axes, where


def telling_view(of: Model, moved: Motion) -> View:
    """Of front, side and top the one in whose plane there is most of the motion."""
    motion_energy = moved.shape * (of.assembly.mass @ moved.shape)
    by_direction = []
    for d in range(3):
        dofs = of.geometry.dofs[:, d]
        by_direction.append(float(motion_energy[dofs[dofs >= 0]].sum()))
    x, y, z = by_direction
    return max(
        ((x + y, projection.FRONT), (y + z, projection.SIDE), (x + z, projection.TOP)), key=lambda pair: pair[0]
    )[1]


def draw_mode(axes: Axes, where: View, of: Model, moved: Motion, phase: float) -> None:
    """The structure at rest in grey, and on it a phase (-1 to 1) of the motion."""
    _draw(axes, where, of, None, 1.0, ghost=True)
    _draw(axes, where, of, moved, phase)
    _ground(axes, where, of)


def mode_title(info: MachineInfo, k: int) -> str:
    """Number, frequency and damping."""
    if info.modes.frequency[k] == 0:
        return f"Mode {k}: rigid, 0 Hz"
    return f"Mode {k}: {frequency(info, k)}, damping {100 * info.modes.damping[k]:.3g} %"


def mode_heading(figure: Drawing, info: MachineInfo, of: Model, k: int) -> None:
    """Frequency, damping and what moves, above a picture of a mode; below it the names of the bodies."""
    from matplotlib.patches import Patch

    _legend(figure, of, [Patch(facecolor=tuple(GHOST), label="at rest")])
    figure.suptitle(f"{mode_title(info, k)}\n", x=0.015, ha="left", fontsize=12, fontweight="bold")
    words = figure.text(0.015, 0.925, info.moving[k], fontsize=9.5, color=MUTED, va="center")
    words.set_in_layout(False)


def remark(figure: Drawing, info: MachineInfo, *, below: bool = False) -> None:
    """What the machine's numbers are worth, in a corner on the right: a picture travels without its page."""
    y, side = (0.012, "bottom") if below else (0.985, "top")
    note = "\n".join(textwrap.wrap(info.note, NOTE_WIDTH)[:NOTE_LINES])
    words = figure.text(0.99, y, note, fontsize=7.5, color=MUTED, ha="right", va=side)
    words.set_in_layout(False)


def mode_caption(info: MachineInfo, k: int) -> str:
    """What moves."""
    return f"Kinetic energy: {info.moving[k]}. Deflection exaggerated; at rest in grey."


def frequency(info: MachineInfo, k: int) -> str:
    """To four digits, with unit."""
    f = float(info.modes.frequency[k])
    return minus(f"{f:.2f} Hz" if f < 100 else f"{f:.1f} Hz")


def triad(axes: Axes, where: View) -> None:
    """The directions of the machine's frame, in the lower left corner."""
    remaining, bottom = axes.get_xlim()[0], axes.get_ylim()[0]
    length = 0.085 * max(np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim()))
    flat = where.flat(np.eye(3)) * length
    origin = np.array([remaining, bottom]) - np.minimum(flat.min(axis=0), 0) + 0.25 * length
    for letter, arrow in zip("XYZ", flat, strict=True):
        if np.hypot(*arrow) < 0.05 * length:
            continue
        axes.annotate(
            "", tuple((origin + arrow).tolist()), tuple(origin.tolist()), annotation_clip=False,
            arrowprops={"arrowstyle": "-|>", "color": INK, "linewidth": 1.0, "shrinkA": 0, "shrinkB": 0,
                        "mutation_scale": 8},
        )  # fmt: skip
        x, y = (origin + arrow * 1.22).tolist()
        axes.text(x, y, letter, fontsize=8.5, ha="center", va="center", color=INK)


def _draw(axes: Axes, where: View, of: Model, moved: Motion | None, phase: float, ghost: bool = False) -> None:
    """All bodies, as solids where cross-sections are known, else as lines."""
    if of.looks is not None:
        faces = solids(of, moved, phase)
        if ghost:
            faces = [Faces(group.corners, np.tile(GHOST, (len(group.corners), 1))) for group in faces]
        projection.draw_faces(axes, where, faces, flat=ghost, zorder=1 if ghost else 2)
        for feature in of.looks.features:
            if feature.kind == "motor" and not ghost:
                _pointer(axes, where, of, feature.name, moved, phase)
        return
    shape = np.zeros(of.assembly.mass.shape[0]) if moved is None else moved.shape * phase
    geometry = of.geometry
    if len(geometry.lines):
        bent = deflection(geometry, shape, of.pieces)
        colours = np.array([of.colours[geometry.bodies[first]] for first in geometry.lines[:, 0].tolist()])
        if ghost:
            colours = np.tile(GHOST * 0.9, (len(colours), 1))
        projection.draw_lines(axes, where, bent.points + bent.displacements, colours, 1.5, zorder=1 if ghost else 2)
    joined = np.zeros(len(geometry.nodes), dtype=bool)
    joined[geometry.lines.ravel()] = True
    if not joined.all():
        flat = where.flat((geometry.nodes + node_motion(geometry, shape)[0])[~joined])
        colours = np.array([of.colours[body] for body in np.array(geometry.bodies)[~joined].tolist()])
        colours = np.tile(GHOST * 0.9, (len(colours), 1)) if ghost else colours
        axes.scatter(flat[:, 0], flat[:, 1], s=16, c=colours, zorder=1 if ghost else 3)


def _pointer(axes: Axes, where: View, of: Model, name: str, moved: Motion | None, phase: float) -> None:
    """A mark on the rotor, which shows how it turns."""
    looks = of.looks
    assert looks is not None
    feature = next(f for f in looks.features if f.kind == "motor" and f.name == name)
    frame, radius = rotor_disc(of, name)
    facing = -1.0 if frame[0] @ where.basis[2] < 0 else 1.0
    centre = feature.point - (1.6 if facing < 0 else 0.1) * radius * frame[0]
    angle = 0.0
    if moved is not None:
        centre = centre + feature.moved(moved.shape * phase)[0]
        angle = phase * moved.rotors.get(f"rotor {name}", 0.0)
    tip = centre + radius * (np.cos(angle) * frame[1] + np.sin(angle) * frame[2])
    flat = where.flat(np.array([centre, tip]))
    axes.plot(*flat.T, color=PAPER, linewidth=1.6, zorder=4, solid_capstyle="round")


def _marks(axes: Axes, where: View, of: Model) -> None:
    """What holds, guides, drives and measures, with arms to the nodes."""
    if of.looks is None:
        return
    for kind, (marker, size, words) in MARKS.items():
        features = [f for f in of.looks.features if f.kind == kind]
        if not features:
            continue
        for feature in features if kind != "scale" else ():
            for anchor in feature.anchors:
                flat = where.flat(np.array([anchor, feature.point]))
                axes.plot(*flat.T, color=INK, linewidth=0.5, alpha=0.55, zorder=5)
        flat = where.flat(np.array([f.point for f in features]))
        colour = VERMILLION if kind == "tool" else PAPER if kind in ("carriage", "bearing", "nut") else INK
        hollow = kind == "mass"
        edge: dict[str, Any] = {} if kind == "scale" else {"edgecolors": PAPER if kind == "tool" else INK}
        width = 1.4 if kind == "scale" else 0.9
        axes.scatter(
            flat[:, 0], flat[:, 1], marker=marker, s=size, zorder=6, label=words, linewidths=width,
            facecolors="none" if hollow else colour, **edge,
        )  # fmt: skip
    for feature in of.looks.features:
        if feature.kind == "motor" and not where.name:
            frame, radius = rotor_disc(of, feature.name)
            x, y = where.flat(feature.point - 2.6 * radius * frame[0]).tolist()
            axes.annotate(
                f"motor {feature.name}", (x, y), fontsize=8.5, ha="center", va="center", zorder=8,
                bbox={"facecolor": PAPER, "edgecolor": "none", "pad": 1.0, "alpha": 0.85},
            )  # fmt: skip


def _ground(axes: Axes, where: View, of: Model) -> None:
    """Mounts, which stand still, under a mode shape."""
    if of.looks is None:
        return
    points = [f.point for f in of.looks.features if f.kind == "mount"]
    if points:
        flat = where.flat(np.array(points))
        axes.scatter(flat[:, 0], flat[:, 1], marker="^", s=30, color=INK, zorder=1.5)


def arrows(axes: Axes, where: View, of: Model, moved: Motion, bodies: Sequence[str]) -> None:
    """Of each body the point that moves the furthest, from rest to its place in the motion."""
    from matplotlib.patheffects import withStroke

    u, _ = node_motion(of.geometry, moved.shape)
    far = np.linalg.norm(u, axis=1)
    owner = np.array(of.geometry.bodies)
    for body in bodies:
        mine = np.flatnonzero(owner == body)
        if not len(mine):
            continue
        k = int(mine[np.argmax(far[mine])])
        start, end = where.flat(of.geometry.nodes[k]), where.flat(of.geometry.nodes[k] + u[k])
        if np.hypot(*(end - start)) < ARROW * of.size:
            continue
        axes.annotate(
            "", tuple(end.tolist()), tuple(start.tolist()), zorder=7,
            arrowprops={"arrowstyle": "-|>", "color": INK, "linewidth": 1.8, "shrinkA": 0, "shrinkB": 0,
                        "mutation_scale": 13, "path_effects": [withStroke(linewidth=3.6, foreground=PAPER)]},
        )  # fmt: skip


def _legend(figure: Drawing, of: Model, more: Sequence[object] = ()) -> None:
    """Bodies by their colours, and `more` handles, below the panels."""
    from matplotlib.patches import Patch

    metal = [name for name in of.colours if name.startswith(("screw ", "rotor "))]
    handles: list[object] = [
        Patch(facecolor=tuple(colour * 0.86), label=name or "(no body)")
        for name, colour in list(of.colours.items())[:MOST_BODIES]
        if name not in metal
    ]
    if metal:
        handles.append(Patch(facecolor=tuple(of.colours[metal[0]] * 0.86), label="screws, motors"))
    figure.legend(
        handles=[*handles, *more], loc="outside lower left", fontsize=8.5, ncols=7, handlelength=1.2,
        handleheight=0.9, columnspacing=1.6, handletextpad=0.5,
    )  # fmt: skip


def _short(words: str) -> str:
    """The first body and how it moves."""
    first = words.partition(", ")[0]
    return first.replace(" (", ": ").rstrip(")")
