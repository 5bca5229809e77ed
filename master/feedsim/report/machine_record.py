"""A machine's structure in figures: as content of a JSON file, and as text for the terminal."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np

from feedsim.foundation.errors import InputError
from feedsim.report.formatting import BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILLION, Array
from feedsim.report.provenance import hash_files, inputs_part, quantity, software
from feedsim.scenario import Coupling
from feedsim.scenario.model import SCHEMES
from feedsim.scenario.structure import GeometryStructure, Structure
from feedsim.structure.assembly import Assembly, Geometry
from feedsim.structure.build import Built
from feedsim.structure.geometry.outline import Outline, deflection, node_motion, outline
from feedsim.structure.info import MachineInfo

FORMAT = 1
USUAL_EXCHANGE = SCHEMES[Coupling().scheme]
MEANINGS = {
    "lead": ("m/rad", "travel per radian of the motor"),
    "J_tot": ("kg.m2", "inertia of the axis as a whole, seen by its motor"),
    "J_inf": ("kg.m2", "inertia that a sudden torque meets: 1 / sum of n^2 over all modes"),
    "moving_mass": ("kg", "mass that travels with the axis"),
    "J_moving": ("kg.m2", "reflected inertia of the moving mass, mass x lead^2"),
    "coupling_limit": ("N.m.s/rad", "2 J_inf/h; the slope of friction over speed must stay well below"),
    "friction_slope": ("N.m.s/rad", "sigma_1 + sigma_2, the slope of friction that the exchange meets"),
}


def record(info: MachineInfo, files: Sequence[tuple[str, Path]]) -> dict[str, Any]:
    """Content of build.json. Figures that are not known are null."""
    solution = info.solution
    modes = info.modes
    return {
        "format": FORMAT,
        "name": info.name,
        "note": info.note,
        "warnings": [str(warning) for warning in info.warnings],
        "pose": {axis: {"value": position, "unit": "m"} for axis, position in info.pose.items()},
        "step": {"value": info.step, "unit": "s"},
        "total_mass": quantity(info.total_mass, "kg"),
        "axes": {
            axis.name: {
                key: quantity(getattr(axis, key), unit, meaning=meaning) for key, (unit, meaning) in MEANINGS.items()
            }
            for axis in info.axes
        },
        "modes": [
            {"mode": k, "frequency": quantity(f, "Hz"), "damping": quantity(d, "1"), "moves": info.moving[k]}
            for k, (f, d) in enumerate(zip(modes.frequency.tolist(), modes.damping.tolist(), strict=True))
        ],
        "solution": None
        if solution is None
        else {
            "degrees_of_freedom": int(solution.shapes.shape[0]),
            "method": solution.method,
            "verification": solution.verification,
            "cutoff": quantity(solution.cutoff / (2 * math.pi), "Hz"),
            "dropped_modes": solution.dropped,
            "next_frequencies_above": [quantity(f, "Hz") for f in solution.above[:5].tolist()],
            "pseudo_modes": solution.corrections,
            "J_inf_of_all_modes": {axis: quantity(J, "kg.m2") for axis, J in solution.J_inf_full.items()},
        },
        "inputs": inputs_part(hash_files(list(files))),
        "software": software(),
    }


def text(info: MachineInfo, most: int | None = None) -> str:
    """The figures as a table for the terminal, with the first `most` modes (None: all)."""
    return "\n".join(_lines(info, most))


def _lines(info: MachineInfo, most: int | None) -> Iterator[str]:
    yield info.title
    if info.note:
        yield f"Note: {info.note}"
    if info.solution is not None:
        mass = f", total mass {info.total_mass:.2f} kg" if math.isfinite(info.total_mass) else ""
        yield f"{info.solution.shapes.shape[0]} degrees of freedom{mass}"
    else:
        yield "from its table of modes; masses and what moves need a structure file (key structure)"
    yield ""
    step = f"h = {info.step * 1e6:.6g} us"
    yield from _table(
        ("axis", "lead", "moving mass", "mass x lead^2", "J_tot", "J_inf", f"2 J_inf/h, {step}"),
        ("", "mm/rev", "kg", "kg.m2", "kg.m2", "kg.m2", "N.m.s/rad"),
        [
            (
                axis.name,
                f"{2e3 * math.pi * axis.lead:.6g}",
                *(_number_text(value) for value in (axis.moving_mass, axis.J_moving, axis.J_tot, axis.J_inf)),
                _number_text(axis.coupling_limit),
            )
            for axis in info.axes
        ],
    )
    yield from exchange(info)
    yield ""
    count = len(info.modes.frequency)
    shown = count if most is None else min(most, count)
    yield from _table(
        ("mode", "frequency", "damping", "what moves (share of the kinetic energy)"),
        ("", "Hz", "%", ""),
        [
            (
                str(k),
                f"{info.modes.frequency[k]:.3f}" if info.modes.frequency[k] else "0",
                f"{100 * info.modes.damping[k]:.3g}",
                describe_mode(info, k),
            )
            for k in range(shown)
        ],
    )
    if shown < count:
        yield f"and {count - shown} more up to {info.modes.frequency[-1]:.1f} Hz"
    if info.solution is not None:
        yield from _describe_dropped_modes(info)


def exchange(info: MachineInfo) -> Iterator[str]:
    """Friction held against the limit of the explicit exchange."""
    for axis in info.axes:
        if math.isfinite(axis.friction_slope):
            slope, allowed = axis.friction_slope, USUAL_EXCHANGE.stable_share
            share = slope / axis.coupling_limit
            yield (
                f"{axis.name}: sigma_1 + sigma_2 = {slope:.4g} N.m.s/rad, {100 * share:.2g} % of 2 J_inf/h; "
                + (
                    f"the default exchange is stable up to {100 * allowed:.0f} %"
                    if share <= allowed
                    else f"UNSTABLE: the default exchange allows {100 * allowed:.0f} %; use more coupling.substeps"
                )
            )


def describe_mode(info: MachineInfo, k: int) -> str:
    """What moves in mode k, with the shares of the kinetic energy."""
    pseudo = info.solution is not None and k >= len(info.modes.frequency) - info.solution.corrections
    return f"(static correction) {info.moving[k]}" if pseudo else info.moving[k]


def _describe_dropped_modes(info: MachineInfo) -> Iterator[str]:
    solution = info.solution
    assert solution is not None
    if solution.dropped > 0:
        next_ones = ", ".join(f"{f:.1f}" for f in solution.above[:3].tolist())
        yield (
            f"dropped: {solution.dropped} modes above {solution.cutoff / (2 * math.pi):.6g} Hz"
            f"{f' (next: {next_ones} Hz)' if next_ones else ''}; "
            + (
                f"{solution.corrections} pseudo-modes make up for their static compliance"
                if solution.corrections
                else "their static compliance is missing (--static-correction adds it)"
            )
        )
    for axis in info.axes:
        full = solution.J_inf_full.get(axis.name, math.nan)
        if math.isfinite(full):
            yield f"{axis.name}: J_inf with all modes of the model {full:.5g} kg.m2"


def _number_text(value: float) -> str:
    return f"{value:.5g}" if math.isfinite(value) else "-"


def _table(heads: Sequence[str], units: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Columns of equal width, numbers to the right; the last column runs on."""
    full = [heads, [f"[{unit}]" if unit else "" for unit in units], *rows]
    widths = [max(len(row[i]) for row in full) for i in range(len(heads))]
    for row in full:
        cells = [
            cell.ljust(width) if i in (0, len(heads) - 1) else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        yield "  ".join(cells).rstrip()


# --- Bodies in space on paper: parallel projection with Y up, shaded faces, the hidden behind what hides it -----------
# Start with Field, which draws them as shapes of an SVG.


Box = tuple[float, float, float, float]  # left, top, width, height [pixels]
# Towards the eye from the light: faces that look up are the brightest, those to the right the darkest.
LIGHT_DIRECTION = np.array([-0.35, 0.85, 0.55]) / np.linalg.norm([-0.35, 0.85, 0.55])
OVERLAP = 0.35  # pixels of a face beyond its edges
SHADE = 0.42  # brightness of a face that looks away from the light, that of one towards it being 1


@dataclass(frozen=True, eq=False)
class View:
    """A direction to look from.

    Attributes:
        name: in words.
        basis: (3, 3) rows: to the right on paper, upwards on paper, towards the eye.
    """

    name: str
    basis: Array

    def flat(self, points: Array) -> Array:
        """(..., 2) on paper of (..., 3) in space."""
        return np.asarray(points @ self.basis[:2].T)

    def depth(self, points: Array) -> Array:
        """(...) distance towards the eye."""
        return np.asarray(points @ self.basis[2])


def view(name: str, towards_eye: Sequence[float], up: Sequence[float] = (0.0, 1.0, 0.0)) -> View:
    """The view from a direction, `up` upwards on paper."""
    eye = np.asarray(towards_eye, dtype=float) / np.linalg.norm(towards_eye)
    right = np.cross(up, eye)
    right /= np.linalg.norm(right)
    return View(name, np.array([right, np.cross(eye, right), eye]))


OBLIQUE = view("", (0.62, 0.46, 0.78))
FRONT_VIEW = view("front, X–Y", (0, 0, 1))
SIDE_VIEW = view("side, Z–Y", (1, 0, 0))
TOP_VIEW = view("top, X–Z", (0, 1, 0), (0, 0, -1))


@dataclass(frozen=True, eq=False)
class Faces:
    """Quadrilaterals and other polygons of one number of corners: (F, c, 3) corners [m], (F, 3) colours 0..1."""

    corners: Array
    colours: Array


def tube(stations: Array, colour: Array) -> list[Faces]:
    """Faces of a body through cross-sections: stations (S, c, 3), corners of each in the same order; ends closed."""
    c = stations.shape[1]
    first, after = stations[:-1], stations[1:]
    turn = [(i + 1) % c for i in range(c)]
    sides = np.stack([first, first[:, turn], after[:, turn], after], axis=2).reshape(-1, 4, 3)
    ends = np.stack([stations[0][::-1], stations[-1]])
    faces = [Faces(sides, np.tile(colour, (len(sides), 1)))]
    return [*faces, Faces(ends, np.tile(colour, (2, 1)))]


class Field:
    """A view on paper: where points in space stand [pixels], and what is drawn there, from the back to the front.

    Its scale is the same in both directions. Shapes of a larger level cover those of a smaller one.
    """

    def __init__(self, where: View, box: Box, points: Array, margin: float = 0.03, below: float = 0.0) -> None:
        """Hold points (..., 3) in a box; margin, below: room on all sides, and below, as shares of their extent."""
        flat = where.flat(points.reshape(-1, 3))
        low, high = flat.min(axis=0), flat.max(axis=0)
        extent = float(np.max(high - low)) or 1.0
        low, high = low - margin * extent, high + margin * extent
        low[1] -= below * extent
        x, y, wide, tall = box
        self.where, self.box = where, box
        self.per = min(wide / (high[0] - low[0]), tall / (high[1] - low[1]))
        left, bottom = x + (wide - self.per * (high[0] - low[0])) / 2, y + (tall + self.per * (high[1] - low[1])) / 2
        self._origin = np.array([left - self.per * low[0], bottom + self.per * low[1]])
        self.corner = (left, bottom)
        self._shapes: list[tuple[float, str]] = []

    def at(self, points: Array) -> Array:
        """(..., 2) in pixels of (..., 3) in space."""
        return np.asarray(self._origin + self.where.flat(points) * np.array([self.per, -self.per]))

    def add(self, level: float, shape: str) -> None:
        """Draw a shape in front of those of smaller levels."""
        self._shapes.append((level, shape))

    def drawn(self) -> str:
        """All shapes as text of an SVG."""
        return "".join(shape for _, shape in sorted(self._shapes, key=lambda pair: pair[0]))

    def faces(self, level: float, groups: Sequence[Faces], *, flat: bool = False) -> None:
        """Paint faces from the back to the front, those that look away left out; `flat` without shading."""
        ways: list[str] = []
        paints: list[Array] = []
        depths: list[Array] = []
        for group in groups:
            corners = group.corners
            normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            size = np.linalg.norm(normal, axis=1)
            normal = normal / np.where(size > 0, size, 1)[:, None]
            seen = (size > 0) & (normal @ self.where.basis[2] > 1e-9)
            light = (
                np.ones(len(corners))
                if flat
                else SHADE + (1 - SHADE) * np.clip(0.5 + 0.5 * normal @ LIGHT_DIRECTION, 0, 1)
            )
            ways += [f"{_way(each)}Z" for each in _widen_polygons(self.at(corners[seen])).tolist()]
            paints.append((group.colours * light[:, None])[seen])
            depths.append(self.where.depth(corners[seen].mean(axis=1)))
        if ways:
            order = np.argsort(np.concatenate(depths), kind="stable").tolist()  # far ones first
            self.add(level, _painted_paths([ways[k] for k in order], np.concatenate(paints)[order], "fill"))

    def lines(self, level: float, lines: Array, colours: Array, width: float) -> None:
        """Paint polylines (L, n, 3) in colours (L, 3), from the back to the front."""
        order = np.argsort(self.where.depth(lines.mean(axis=1)), kind="stable")
        drawn = _painted_paths([_way(each) for each in self.at(lines[order]).tolist()], colours[order], "stroke")
        self.add(level, f'<g stroke-width="{width:g}" stroke-linecap="round" fill="none">{drawn}</g>')


def _way(points: Sequence[Sequence[float]]) -> str:
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points)


def _widen_polygons(corners: Array) -> Array:
    """Polygons (F, c, 2) a little larger on all sides: neighbours overlap, and no ground shines through."""
    edges = np.roll(corners, -1, axis=1) - corners
    normals = np.stack([edges[..., 1], -edges[..., 0]], axis=-1)
    lengths = np.linalg.norm(normals, axis=-1, keepdims=True)
    area = edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]
    normals *= np.sign(area)[:, None, None] / np.where(lengths > 0, lengths, 1.0)
    return np.asarray(corners + OVERLAP * (normals + np.roll(normals, 1, axis=1)))


def _painted_paths(ways: Sequence[str], colours: Array, by: str) -> str:
    """Paths in their colours (N, 3), neighbours of one colour as one path; by: the attribute with the colour."""
    names = [hexadecimal(colour) for colour in colours]
    return "".join(
        f'<path {by}="{name}" d="{"".join(way for _, way in group)}"/>'
        for name, group in groupby(zip(names, ways, strict=True), key=itemgetter(0))
    )


def hexadecimal(colour: Array) -> str:
    """A colour (3,), 0 to 1, as an SVG has it."""
    return "#" + "".join(f"{round(255 * min(1.0, max(0.0, part))):02x}" for part in colour.tolist())


# --- A machine's model made ready for pictures: bodies with colours, solids of its beams, at rest and in a motion -----


COLOURS = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY)
METAL = "#7b8794"  # screws, rotors, and bodies beyond the colours
SOFT = 0.18  # of white in a body's colour
CORNERS = 10  # of a round section
PIECE = 1 / 45  # longest straight piece of a bent beam, of the machine's size
MOST_PIECES = 8
MODE_DEFLECTION = 0.09  # deflection that is drawn for a mode that moves bodies, of the machine's size
ROTOR_TURN = 1.1  # rad, drawn for a rotor that has all of a mode's energy


@dataclass(frozen=True, eq=False)
class Model:
    """What pictures of a machine are drawn from.

    Attributes:
        geometry: its nodes and lines.
        looks: cross-sections and features; None where the model came as matrices.
        colours: body -> (3,) colour, 0..1, in the order in which bodies appear.
        size: largest extent of the machine [m].
        pieces: straight pieces that a line is drawn in.
    """

    assembly: Assembly
    geometry: Geometry
    looks: Outline | None
    colours: Mapping[str, Array]
    size: float
    pieces: int


def model(structure: Structure, assembly: Assembly) -> Model:
    """The model of an assembly.

    Raises:
        InputError: nothing is known of where its nodes are.
    """
    geometry = assembly.geometry
    if geometry is None or len(geometry.nodes) == 0:
        raise InputError(
            f"{assembly.name}: a picture needs to know where the nodes are: give the structure file a table of nodes "
            "(key nodes: node, x, y, z, and the degrees of freedom ux ... rz) and one of the lines between them (key "
            "lines: from, to); with CalculiX, the mesh (key mesh)"
        )
    looks = outline(structure, assembly) if isinstance(structure, GeometryStructure) else None
    size = float(np.max(np.ptp(geometry.nodes, axis=0))) or 1.0
    longest = 0.0
    if len(geometry.lines):
        ends = geometry.nodes[geometry.lines]
        longest = float(np.max(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)))
    bending = bool(np.any(geometry.dofs[:, 3:] >= 0)) and len(geometry.lines) < 5000
    pieces = min(MOST_PIECES, max(2, int(np.ceil(longest / (PIECE * size))))) if bending else 1
    return Model(assembly, geometry, looks, _colours(geometry), size, pieces)


def _colours(geometry: Geometry) -> dict[str, Array]:
    names = list(dict.fromkeys(geometry.bodies))
    large = [name for name in names if not name.startswith(("screw ", "rotor "))]
    result = {name: colour for name, colour in zip(large, COLOURS, strict=False)}
    return {name: rgb(result.get(name, METAL)) for name in names}


def rgb(text: str, white: float = SOFT) -> Array:
    """(3,) of a colour #rrggbb, mixed with white."""
    plain = np.array([int(text[i : i + 2], 16) for i in (1, 3, 5)]) / 255
    return np.asarray(plain * (1 - white) + white)


@dataclass(frozen=True, eq=False)
class Motion:
    """A motion to be drawn: the shape's vector (N,) scaled to metres, and how far rotors turn [rad]."""

    shape: Array
    rotors: Mapping[str, float]


def motion(built: Built, of: Model, k: int, scale: float = 1.0) -> Motion:
    """Mode k, exaggerated to MODE_DEFLECTION of the machine's size times `scale`.

    Where most of the energy is in parts that turn (a rotor, a screw), deflections are less: the root of the share of
    the energy that is in translations, so that a mode of torsion does not look like one of the bed.
    """
    shape = built.solution.shapes[:, k]
    energy = shape * (built.assembly.mass @ shape)
    whole = float(energy.sum()) or 1.0
    displacements, _ = node_motion(of.geometry, shape)
    largest = float(np.max(np.linalg.norm(displacements, axis=1)))
    dofs = of.geometry.dofs[:, :3]
    moving = max(0.0, min(1.0, float(energy[dofs[dofs >= 0]].sum()) / whole))
    factor = scale * MODE_DEFLECTION * of.size * np.sqrt(moving) / largest if largest > 0 else 0.0
    rotors = {}
    for i, body in enumerate(of.geometry.bodies):
        if body.startswith("rotor "):
            dof = int(of.geometry.dofs[i].max())
            rotors[body] = scale * ROTOR_TURN * float(np.sign(shape[dof]) * np.sqrt(max(0.0, energy[dof] / whole)))
    return Motion(shape * factor, rotors)


def solids(of: Model, moved: Motion | None, phase: float = 1.0) -> list[Faces]:
    """Faces of all beams, rotors and blocks, at rest or in a motion times `phase`."""
    looks, geometry = of.looks, of.geometry
    assert looks is not None
    shape = np.zeros(of.assembly.mass.shape[0]) if moved is None else moved.shape * phase
    bent = deflection(geometry, shape, of.pieces)
    faces: list[Faces] = []
    for i, (first, _) in enumerate(geometry.lines.tolist()):
        corners = _section(looks.sizes[i], bool(looks.is_round[i])) @ looks.frames[i][1:]
        rotations = bent.rotations[i]
        if looks.is_round[i]:  # twist is not to be seen on a round bar, and a screw's is many times its deflection
            rotations = rotations - np.outer(rotations @ looks.frames[i][0], looks.frames[i][0])
        stations = (bent.points[i] + bent.displacements[i])[:, None, :] + turn_vectors(corners, rotations)
        faces += tube(stations, of.colours[geometry.bodies[first]])
    u, phi = node_motion(geometry, shape)
    for body, (node, (low, high)) in looks.blocks.items():
        x, y, z = np.stack([low, high]).T
        base = np.array([[x[0], y[0]], [x[1], y[0]], [x[1], y[1]], [x[0], y[1]]])
        stations = np.array([np.column_stack([base, np.full(4, depth)]) for depth in z])
        levers = turn_vectors((stations - geometry.nodes[node]).reshape(-1, 3), phi[[node]]).reshape(2, 4, 3)
        faces += tube(geometry.nodes[node] + u[node] + levers, of.colours[body])
    for feature in looks.features:
        if feature.kind == "motor":
            faces += _rotor(of, feature.point + feature.moved(shape)[0], feature.name)
    return faces


def turn_vectors(vectors: Array, rotations: Array) -> Array:
    """(S, c, 3) vectors (c, 3) turned by each of the rotation vectors (S, 3); lengths stay (Rodrigues' formula)."""
    angle = np.linalg.norm(rotations, axis=1)[:, None, None]
    axis = rotations[:, None, :] / np.where(angle > 0, angle, 1)
    along = np.sum(axis * vectors, axis=2, keepdims=True) * axis
    return np.asarray(np.cos(angle) * (vectors - along) + np.sin(angle) * np.cross(axis, vectors[None]) + along)


def _section(size: Array, is_round: bool) -> Array:
    """(c, 2) corners of a section: local y, local z; counted so that its normal is local x."""
    height, width = size.tolist()
    if is_round:
        angle = 2 * np.pi * np.arange(CORNERS) / CORNERS
        return np.asarray(0.5 * height * np.column_stack([np.cos(angle), np.sin(angle)]))
    return 0.5 * np.array([[-height, -width], [height, -width], [height, width], [-height, width]])


def rotor_disc(of: Model, name: str) -> tuple[Array, float]:
    """(3, 3) direction of an axis's motor and two across it, and the radius that its rotor is drawn with [m]."""
    looks = of.looks
    assert looks is not None
    lines = [i for i, (a, _) in enumerate(of.geometry.lines.tolist()) if of.geometry.bodies[a] == f"screw {name}"]
    return looks.frames[lines[0]], max(0.03 * of.size, 1.6 * float(looks.sizes[lines[0], 0]))


def _rotor(of: Model, centre: Array, name: str) -> list[Faces]:
    """A disc with some thickness behind the start of the screw."""
    frame, radius = rotor_disc(of, name)
    corners = _section(np.array([2 * radius, 2 * radius]), True) @ frame[1:]
    stations = np.array([centre + corners - 1.6 * radius * frame[0], centre + corners - 0.1 * radius * frame[0]])
    return tube(stations, rgb(METAL, 0.0))


def extent(of: Model, moved: Motion | None = None) -> Array:
    """Points that a picture must hold: all that is drawn at rest and at both ends of a motion."""
    if of.looks is None:
        points = [of.geometry.nodes]
        if moved is not None:
            u, _ = node_motion(of.geometry, moved.shape)
            points += [of.geometry.nodes + u, of.geometry.nodes - u]
        return np.concatenate(points)
    phases = (None,) if moved is None else (0.0, 1.0, -1.0)
    faces = [group for phase in phases for group in solids(of, None if phase is None else moved, phase or 0.0)]
    points = [group.corners.reshape(-1, 3) for group in faces]
    points += [feature.point[None] for feature in of.looks.features if feature.kind in ("mount", "tool", "mass")]
    return np.concatenate(points)
