"""The report on a machine's structure: what report.html says, with pictures of the structure and of its modes."""

from __future__ import annotations

import io
import math
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape
from pathlib import Path

import numpy as np

from feedsim.report.chart.svg import BOLD, WIDTH, circle, fill, line, png, rectangle, standalone, text
from feedsim.report.content import (
    FOLDER,
    Animation,
    Paragraph,
    Picture,
    Report,
    Section,
    Step,
    Table,
    Text,
    Tile,
    provenance_section,
)
from feedsim.report.formatting import INK, MUTED, PAPER, VERMILLION, Array, display_unit, minus, number, typeset
from feedsim.report.machine_record import (
    FRONT_VIEW,
    MEANINGS,
    OBLIQUE,
    SIDE_VIEW,
    TOP_VIEW,
    USUAL_EXCHANGE,
    Box,
    Faces,
    Field,
    Model,
    Motion,
    View,
    describe_mode,
    exchange,
    extent,
    hexadecimal,
    model,
    motion,
    rotor_disc,
    solids,
)
from feedsim.report.provenance import hash_files
from feedsim.report.results import FIGURES, Content
from feedsim.scenario.structure import Structure
from feedsim.structure.build import Built
from feedsim.structure.geometry.outline import deflection, node_motion
from feedsim.structure.info import MachineInfo

# --- Pictures of a machine's structure and of its modes, as text of SVG -----------------------------------------------


GHOST = np.array([0.87, 0.89, 0.91])  # the structure at rest behind a mode shape
# Kind of a feature -> marker, its size [pixels], in words. Drawn over the bodies: they sit inside.
MARKS = {
    "mount": ("triangle", 7.5, "mount on the ground"),
    "carriage": ("square", 5.4, "guide carriage"),
    "bearing": ("circle", 5.2, "screw bearing"),
    "nut": ("diamond", 5.6, "nut"),
    "scale": ("bar", 9.0, "linear scale, reading point"),
    "mass": ("circle", 6.3, "mass on a node"),
    "tool": ("star", 13.0, "tool centre point"),
}
SHEET = 8
NOTE_WIDTH, NOTE_LINES = 100, 3  # of the remark, letters
MOST_BODIES = 12  # in a legend
ARROW = 0.025  # shortest arrow of a motion, of the machine's size
WORTH_AN_ARROW = 0.08  # of the kinetic energy
HEAD, LEGEND_ROW = 46.0, 18.0  # pixels above the views, and of a row of names below them
# Levels, from the back to the front.
AT_REST, GROUND, BODIES, POINTS, POINTERS, ARMS, FEATURES, ARROWS, NAMES = range(9)
LegendEntry = tuple[str, str]  # of a legend: a shape around (0, 0), and its name


def structure_picture(info: MachineInfo, of: Model) -> Picture:
    """The machine at rest, from three sides, with what holds and drives it."""

    def draw() -> str:
        points = extent(of)
        views = ((OBLIQUE, (0.0, HEAD, 620.0, 500.0)), (FRONT_VIEW, (640.0, HEAD + 14, 320.0, 232.0)),
                 (SIDE_VIEW, (640.0, HEAD + 268, 320.0, 232.0)))  # fmt: skip
        fields = []
        for where, box in views:
            field = Field(where, box, points, below=0.2 if where.name else 0.0)
            _bodies(field, of, None, 1.0)
            _features(field, of)
            triad(field)
            fields.append(field)
        return compose_picture(info, "Structure", info.title, "", fields, [*_named_bodies(of), *_named_features(of)])

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
    bodies = [share.body for share in built.solution.moving[k].shares if share.energy >= WORTH_AN_ARROW]
    return Picture(f"mode_{k}", mode_title(info, k), mode_caption(info, k),
                   lambda: mode_drawing(info, of, k, moved, 1.0, bodies))  # fmt: skip


def mode_drawing(info: MachineInfo, of: Model, k: int, moved: Motion, phase: float, arrowed: Sequence[str] = ()) -> str:
    """A phase (-1 to 1) of a mode from two sides, the whole oscillation within; arrowed: bodies with arrows."""
    points = extent(of, moved)
    views: tuple[tuple[View, Box], ...] = (
        (OBLIQUE, (0.0, HEAD, 570.0, 400.0)), (telling_view(of, moved), (590.0, HEAD + 14, 370.0, 386.0)),
    )  # fmt: skip
    fields = []
    for where, box in views:
        field = Field(where, box, points, below=0.2 if where.name else 0.0)
        draw_mode(field, of, moved, phase)
        arrows(field, of, moved, arrowed)
        triad(field)
        fields.append(field)
    title = mode_title(info, k)
    return compose_picture(info, title, title, info.moving[k], fields, [*_named_bodies(of), _patch(GHOST, "at rest")])


def sheet_picture(info: MachineInfo, built: Built, of: Model, scale: float = 1.0) -> Picture | None:
    """The first elastic modes, small; None where there are none."""
    modes = np.flatnonzero(info.modes.frequency > 0)[:SHEET].tolist()
    if not modes:
        return None

    def draw() -> str:
        columns = min(4, len(modes))
        wide, tall = WIDTH / columns, 250.0
        motions = [motion(built, of, k, scale) for k in modes]
        points = np.concatenate([extent(of, moved) for moved in motions])
        fields, words = [], []
        for n, (k, moved) in enumerate(zip(modes, motions, strict=True)):
            x, y = wide * (n % columns), HEAD + tall * (n // columns)
            field = Field(OBLIQUE, (x, y + 34, wide - 8, tall - 42), points, 0.01)
            draw_mode(field, of, moved, 1.0)
            fields.append(field)
            words.append(text(x, y + 14, f"{k}: {frequency(info, k)}", BOLD))
            words.append(text(x, y + 28, _shorten_words(info.moving[k]), 'font-size="9"', MUTED))
        return compose_picture(
            info, "The first elastic modes", f"{info.title}: the first elastic modes", "", fields, (), words
        )

    caption = (
        "Deflections exaggerated, over the structure at rest in grey; below the frequency the body that has the "
        "largest share of the kinetic energy."
    )
    return Picture("modes", "The first elastic modes", caption, draw)


def compose_picture(
    info: MachineInfo, label: str, title: str, below: str, fields: Sequence[Field], legend: Sequence[LegendEntry],
    words: Sequence[str] = (),
) -> str:  # fmt: skip
    """An SVG of views with title, a line below it, names below the views, and in a corner what the numbers are.

    A picture travels without its page.
    """
    parts = [text(0, 15, title, f'{BOLD} font-size="14"'), text(0, 31, below, 'font-size="11"', MUTED)]
    for k, note in enumerate(textwrap.wrap(info.note, NOTE_WIDTH)[:NOTE_LINES]):
        parts.append(text(WIDTH, 9 + 10 * k, note, 'font-size="8"', MUTED, "end"))
    for field in fields:
        x, y, _, _ = field.box
        parts += [text(x, y - 3, field.where.name, 'font-size="10"', MUTED), field.drawn()]
    bottom = max(y + tall for _, y, _, tall in (field.box for field in fields)) + 8
    x = 0.0
    for k, (sample, name) in enumerate(legend):
        room = 30 + 6.6 * len(name)
        if k == 0 or x + room > WIDTH:
            x, bottom = 0.0, bottom + LEGEND_ROW
        parts.append(f'<g transform="translate({x + 8:g} {bottom - 4:g})">{sample}</g>{text(x + 20, bottom, name)}')
        x += room
    box = f"0 0 {WIDTH:g} {bottom + 8:g}"
    head = f'<svg role="img" aria-label="{escape(label)}" class="plot" viewBox="{box}" font-size="10.5">'
    return "".join([head, *parts, *words, "</svg>"])


def telling_view(of: Model, moved: Motion) -> View:
    """Of front, side and top the one in whose plane there is most of the motion."""
    motion_energy = moved.shape * (of.assembly.mass @ moved.shape)
    by_direction = []
    for d in range(3):
        dofs = of.geometry.dofs[:, d]
        by_direction.append(float(motion_energy[dofs[dofs >= 0]].sum()))
    x, y, z = by_direction
    return max(((x + y, FRONT_VIEW), (y + z, SIDE_VIEW), (x + z, TOP_VIEW)), key=lambda pair: pair[0])[1]


def draw_mode(field: Field, of: Model, moved: Motion, phase: float) -> None:
    """The structure at rest in grey, and on it a phase (-1 to 1) of the motion."""
    _bodies(field, of, None, 1.0, ghost=True)
    _bodies(field, of, moved, phase)
    for feature in of.looks.features if of.looks is not None else ():
        if feature.kind == "mount":  # stands still
            x, y = field.at(feature.point).tolist()
            field.add(GROUND, _marker("triangle", x, y, 6.0, f'fill="{fill(INK)}"'))


def mode_title(info: MachineInfo, k: int) -> str:
    """Number, frequency and damping."""
    if info.modes.frequency[k] == 0:
        return f"Mode {k}: rigid, 0 Hz"
    return f"Mode {k}: {frequency(info, k)}, damping {100 * info.modes.damping[k]:.3g} %"


def mode_caption(info: MachineInfo, k: int) -> str:
    """What moves."""
    return f"Kinetic energy: {info.moving[k]}. Deflection exaggerated; at rest in grey."


def frequency(info: MachineInfo, k: int) -> str:
    """To four digits, with unit."""
    f = float(info.modes.frequency[k])
    return minus(f"{f:.2f} Hz" if f < 100 else f"{f:.1f} Hz")


def triad(field: Field) -> None:
    """The directions of the machine's frame, in the lower left corner."""
    _, _, wide, tall = field.box
    length = 0.085 * max(wide, tall)
    ways = field.where.flat(np.eye(3)) * np.array([length, -length])
    left, bottom = field.corner
    origin = np.array([left - min(0.0, ways[:, 0].min()), bottom - max(0.0, ways[:, 1].max())])
    origin += np.array([0.25, -0.25]) * length
    for letter, way in zip("XYZ", ways, strict=True):
        if np.hypot(*way) < 0.05 * length:
            continue
        field.add(NAMES, _arrow(origin, origin + way, 1.2, 7.0))
        x, y = (origin + 1.22 * way).tolist()
        field.add(NAMES, text(x, y + 4, letter, anchor="middle"))


def _bodies(field: Field, of: Model, moved: Motion | None, phase: float, *, ghost: bool = False) -> None:
    """All bodies, as solids where cross-sections are known, else as lines."""
    level = AT_REST if ghost else BODIES
    if of.looks is not None:
        faces = solids(replace(of, pieces=1) if ghost else of, moved, phase)  # at rest beams are straight
        if ghost:
            faces = [Faces(group.corners, np.tile(GHOST, (len(group.corners), 1))) for group in faces]
        field.faces(level, faces, flat=ghost)
        for feature in of.looks.features:
            if feature.kind == "motor" and not ghost:
                _pointer(field, of, feature.name, moved, phase)
        return
    shape = np.zeros(of.assembly.mass.shape[0]) if moved is None else moved.shape * phase
    geometry = of.geometry
    if len(geometry.lines):
        bent = deflection(geometry, shape, of.pieces)
        colours = np.array([of.colours[geometry.bodies[first]] for first in geometry.lines[:, 0].tolist()])
        if ghost:
            colours = np.tile(GHOST * 0.9, (len(colours), 1))
        field.lines(level, bent.points + bent.displacements, colours, 1.7)
    joined = np.zeros(len(geometry.nodes), dtype=bool)
    joined[geometry.lines.ravel()] = True
    places = field.at((geometry.nodes + node_motion(geometry, shape)[0])[~joined])
    for (x, y), body in zip(places.tolist(), np.array(geometry.bodies)[~joined].tolist(), strict=True):
        colour = GHOST * 0.9 if ghost else of.colours[body]
        field.add(AT_REST if ghost else POINTS, circle(x, y, 2.6, f'fill="{hexadecimal(colour)}"'))


def _pointer(field: Field, of: Model, name: str, moved: Motion | None, phase: float) -> None:
    """A mark on the rotor, which shows how it turns."""
    looks = of.looks
    assert looks is not None
    feature = next(f for f in looks.features if f.kind == "motor" and f.name == name)
    frame, radius = rotor_disc(of, name)
    facing = -1.0 if frame[0] @ field.where.basis[2] < 0 else 1.0
    centre = feature.point - (1.6 if facing < 0 else 0.1) * radius * frame[0]
    angle = 0.0
    if moved is not None:
        centre = centre + feature.moved(moved.shape * phase)[0]
        angle = phase * moved.rotors.get(f"rotor {name}", 0.0)
    tip = centre + radius * (np.cos(angle) * frame[1] + np.sin(angle) * frame[2])
    (a, b), (c, d) = field.at(np.array([centre, tip])).tolist()
    field.add(POINTERS, line(a, b, c, d, f'stroke="{PAPER}" stroke-width="1.8" stroke-linecap="round"'))


def _features(field: Field, of: Model) -> None:
    """What holds, guides, drives and measures, with arms to the nodes."""
    for feature in of.looks.features if of.looks is not None else ():
        x, y = field.at(feature.point).tolist()
        if feature.kind in MARKS:
            for anchor in feature.anchors if feature.kind != "scale" else ():
                a, b = field.at(anchor).tolist()
                field.add(ARMS, line(a, b, x, y, f'stroke="{INK}" stroke-width="0.6" stroke-opacity="0.55"'))
            field.add(FEATURES, _feature(feature.kind, x, y))
        elif feature.kind == "motor" and not field.where.name:
            frame, radius = rotor_disc(of, feature.name)
            a, b = field.at(feature.point - 2.6 * radius * frame[0]).tolist()
            name = f"motor {feature.name}"
            wide = 6.0 * len(name)
            ground = rectangle(a - wide / 2, b - 8, wide, 13, f'fill="{PAPER}" fill-opacity="0.85"')
            field.add(NAMES, f'{ground}<text x="{a:.1f}" y="{b + 3:.1f}" fill="{INK}" text-anchor="middle" '
                             f'font-size="9.5">{escape(name)}</text>')  # fmt: skip


def _feature(kind: str, x: float, y: float) -> str:
    """The marker of a kind of feature."""
    marker, size, _ = MARKS[kind]
    face = VERMILLION if kind == "tool" else PAPER if kind in ("carriage", "bearing", "nut") else INK
    edge = PAPER if kind == "tool" else INK
    paint = "none" if kind == "mass" else face
    return _marker(marker, x, y, size, f'fill="{paint}" stroke="{edge}" stroke-width="{1.5 if marker == "bar" else 1}"')


def _marker(shape: str, x: float, y: float, size: float, look: str) -> str:
    """A marker about as wide as `size`."""
    r = size / 2
    if shape == "circle":
        return circle(x, y, r, look)
    if shape == "star":
        radii, turns = np.where(np.arange(10) % 2, 0.42 * r, r), np.pi * (np.arange(10) / 5 - 0.5)
        points = np.column_stack([radii * np.cos(turns), radii * np.sin(turns)])
    else:
        points = np.array({
            "triangle": [(-r, r), (0, -r), (r, r)], "square": [(-r, -r), (r, -r), (r, r), (-r, r)],
            "diamond": [(-r, 0), (0, -r), (r, 0), (0, r)], "bar": [(0, -r), (0, r)],
        }[shape])  # fmt: skip
    way = "L".join(f"{a:.1f} {b:.1f}" for a, b in (points + np.array([x, y])).tolist())
    return f'<path d="M{way}Z" {look}/>'


def arrows(field: Field, of: Model, moved: Motion, bodies: Sequence[str]) -> None:
    """Of each body the point that moves the furthest, from rest to its place in the motion."""
    u, _ = node_motion(of.geometry, moved.shape)
    far = np.linalg.norm(u, axis=1)
    owner = np.array(of.geometry.bodies)
    for body in bodies:
        mine = np.flatnonzero(owner == body)
        if not len(mine):
            continue
        k = int(mine[np.argmax(far[mine])])
        start, end = field.at(of.geometry.nodes[k]), field.at(of.geometry.nodes[k] + u[k])
        if np.hypot(*(end - start)) >= ARROW * of.size * field.per:
            field.add(ARROWS, _arrow(start, end, 4.0, 15.0, PAPER) + _arrow(start, end, 2.0, 11.0, INK))


def _arrow(start: Array, end: Array, width: float, tip: float, colour: str = "") -> str:
    """A line with a head; without a colour in the page's ink."""
    paint = colour or fill(INK)
    length = float(np.hypot(*(end - start))) or 1.0
    along, tip = (end - start) / length, min(tip, 0.6 * length)
    across = np.array([-along[1], along[0]])
    foot = end - tip * along
    (a, b), (c, d), (e, f) = (foot + 0.4 * tip * across).tolist(), end.tolist(), (foot - 0.4 * tip * across).tolist()
    (g, h), (i, j) = start.tolist(), foot.tolist()
    shaft = line(g, h, i, j, f'stroke="{paint}" stroke-width="{width:g}"')
    return f'{shaft}<path d="M{a:.1f} {b:.1f}L{c:.1f} {d:.1f}L{e:.1f} {f:.1f}Z" fill="{paint}"/>'


def _named_bodies(of: Model) -> list[LegendEntry]:
    """Bodies by their colours."""
    metal = [name for name in of.colours if name.startswith(("screw ", "rotor "))]
    names = [_patch(colour * 0.86, name or "(no body)") for name, colour in list(of.colours.items())[:MOST_BODIES]
             if name not in metal]  # fmt: skip
    return [*names, _patch(of.colours[metal[0]] * 0.86, "screws, motors")] if metal else names


def _named_features(of: Model) -> list[LegendEntry]:
    there = {feature.kind for feature in of.looks.features} if of.looks is not None else set()
    return [(_feature(kind, 0.0, 0.0), words) for kind, (_, _, words) in MARKS.items() if kind in there]


def _patch(colour: Array, name: str) -> LegendEntry:
    return rectangle(-7, -5, 14, 10, f'fill="{hexadecimal(colour)}"'), name


def _shorten_words(words: str) -> str:
    """The first body and how it moves."""
    first = words.partition(", ")[0]
    return first.replace(" (", ": ").rstrip(")")


# --- A mode shape in motion: an animated GIF of one period ------------------------------------------------------------


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


FAR_BELOW = 0.1  # share of the limit of the exchange, up to which it is stable by far


@dataclass(frozen=True, eq=False)
class Drawings:
    """What a report shows of a machine: its pictures and animations, and the files of the latter."""

    parts: Sequence[Picture | Animation]
    files: Mapping[str, Content]


def draw_machine(
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
        next_step=Step(
            "See how the lowest mode moves",
            "machine view",
            {"mode": [str(_lowest_elastic_mode(info))], "animate": True, "out": FOLDER},
        ),
        main=[*pictures, _axes(info), _modes(info)],
        provenance=provenance_section(rows, hash_files(list(files))),
        footer="Values in full precision: summary.json. Pictures: figures/.",
    )


def answers(info: MachineInfo) -> list[str]:
    """The lowest mode and what moves in it, and whether the exchange with friction is stable."""
    lines = []
    if info.modes.frequency[k := _lowest_elastic_mode(info)] > 0:
        lines.append(f"The lowest elastic mode is at {info.modes.frequency[k]:.2f} Hz: {describe_mode(info, k)}.")
    shares = [axis.friction_slope / axis.coupling_limit for axis in info.axes if math.isfinite(axis.friction_slope)]
    if shares and max(shares) <= USUAL_EXCHANGE.stable_share:
        lines.append("The exchange of plant and friction is stable by far (table Axes)." if max(shares) < FAR_BELOW
                     else "The exchange of plant and friction is stable (table Axes).")  # fmt: skip
    return lines


def _lowest_elastic_mode(info: MachineInfo) -> int:
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
    rows = [(str(k), f"{f:.3f}", f"{100 * d:.3g}", describe_mode(info, k)) for k, (f, d) in enumerate(pairs)]
    heads = ("Mode", "Frequency [Hz]", "Damping [%]", "What moves")
    return Section("Modes", [Table("rrrp", heads, rows, "Shares of the kinetic energy.")])
