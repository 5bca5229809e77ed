"""What only shows when the parts of a machine written as geometry are seen together."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import dist, hypot
from pathlib import Path
from typing import NamedTuple

from feedsim.files.checked import check_tree, describe, read_group
from feedsim.files.fields import brief, did_you_mean, no_axis
from feedsim.files.source import Place
from feedsim.foundation.errors import InputError
from feedsim.scenario.structure import (
    FRAME,
    AnsysStructure,
    Body,
    CalculixStructure,
    GeometryStructure,
    MatrixMarketStructure,
    Structure,
)

# --- What the names of nodes in a machine written as geometry stand for -----------------------------------------------


class Node(NamedTuple):
    """A node: body, name of the node or of its line, number in the line (None: a single node)."""

    body: str
    name: str
    number: int | None

    def __str__(self) -> str:
        return f"{self.body}.{self.name}" + ("" if self.number is None else f".{self.number}")


class Line(NamedTuple):
    """A line of nodes that something rides on."""

    body: str
    name: str


@dataclass(frozen=True)
class Attachment:
    """What a point is held by: the mean of some nodes, or the place on a rail that it rides on."""

    nodes: tuple[Node, ...]
    rail: Line | None

    @property
    def bodies(self) -> tuple[str, ...]:
        """Bodies of the nodes or of the rail, each once."""
        return (self.rail.body,) if self.rail else tuple(dict.fromkeys(node.body for node in self.nodes))


def node(structure: GeometryStructure, text: str) -> Node:
    """The node that "column.top" or "bed.rail.3" means. InputError: there is none."""
    body, _, inner = text.partition(".")
    _names_body(structure, body)
    result = nodes(structure, body, inner)
    if len(result) > 1:
        raise InputError(f"{text!r} is a line of {len(result)} nodes; one of them is needed, such as {text}.0")
    return result[0]


def nodes(structure: GeometryStructure, body: str, text: str) -> tuple[Node, ...]:
    """The nodes of a body that "top", "rail.3", "rail.2..6" or "rail" (all) means. InputError: there are none."""
    name, _, index = text.partition(".")
    group = structure.bodies[body].nodes.get(name)
    if group is None:
        raise InputError(f"body {body} has no node {name!r}{did_you_mean(name, list(structure.bodies[body].nodes))}")
    if group.count is None:
        if index:
            raise InputError(f"{text!r}: {name} is a single node of body {body}, no line of nodes; write {name}")
        return (Node(body, name, None),)
    first, last = _range(index, group.count)
    if not first <= last < group.count:
        raise InputError(f"{text!r}: line {name} of body {body} has the nodes {name}.0 to {name}.{group.count - 1}")
    return tuple(Node(body, name, i) for i in range(first, last + 1))


def rail(structure: GeometryStructure, text: str) -> Line:
    """The line that "bed.rail" means. InputError: there is none."""
    body, _, name = text.partition(".")
    _names_body(structure, body)
    groups = structure.bodies[body].nodes
    if name not in groups or groups[name].count is None:
        lines = [key for key, group in groups.items() if group.count is not None]
        what = "a single node, no line of nodes" if name in groups else f"no line of nodes of body {body}"
        hint = did_you_mean(name, lines) if lines else "; the body has none"
        raise InputError(f"{text!r}: {name} is {what}{hint}")
    return Line(body, name)


def resolve_attachment(structure: GeometryStructure, texts: Sequence[str]) -> Attachment:
    """What the words of a place to hold on to mean. InputError: unknown names, a rail among nodes, a node twice."""
    rails = [text.removeprefix("rail ") for text in texts if text.startswith("rail ")]
    if rails and len(texts) > 1:
        raise InputError(f"'rail {rails[0]}' stands alone, not in a list")
    if rails:
        return Attachment((), rail(structure, rails[0]))
    result = tuple(node(structure, text) for text in texts)
    if twice := [item for item in result if result.count(item) > 1]:
        raise InputError(f"{twice[0]} is listed twice")
    return Attachment(result, None)


def position(structure: GeometryStructure, item: Node) -> tuple[float, ...]:
    """Position of a node in the frame of its body [m]."""
    group = structure.bodies[item.body].nodes[item.name]
    if item.number is None or group.start is None or group.end is None or group.count is None:
        return group.at or ()
    share = item.number / (group.count - 1)
    return tuple(a + share * (b - a) for a, b in zip(group.start, group.end, strict=True))


def _names_body(structure: GeometryStructure, name: str) -> None:
    if name not in structure.bodies:
        raise InputError(f"there is no body {name!r}{did_you_mean(name, list(structure.bodies))}")


def _range(text: str, count: int) -> tuple[int, int]:
    if not text:
        return 0, count - 1
    first, _, last = re.sub(r"\.\.", " ", text).partition(" ")
    return int(first), int(last or first)


Faults = Iterator[tuple[Place, str]]

# Directions come from coordinates in decimal text: beyond rounding they are either equal or mistaken.
ALIGNMENT_TOLERANCE = 1e-6
# A nut this far off its screw [m] is a slip of the pen, not rounding.
OFF_AXIS = 1e-6
# A beam shorter than this [m] joins two nodes at one place.
MIN_BEAM_LENGTH = 1e-9
# `up` this near to the beam's own direction turns nothing.
PARALLEL_TOLERANCE = 1e-6


def contradictions(structure: GeometryStructure) -> Faults:
    """Place and message of everything in a structure that cannot be or cannot go together."""
    result = [*_materials(structure), *_motions(structure)]
    for name, body in structure.bodies.items():
        result += _body(structure, name, body)
    for name in structure.axes:
        result += _drive(structure, name)
    result += _tool(structure)
    yield from result
    if not result:  # what can be asked only of names that are known
        yield from _loose_nodes(structure)
        for name in structure.axes:
            yield from _along_screw(structure, name)


def pose_faults(structure: GeometryStructure, pose: Mapping[str, float]) -> Iterator[str]:
    """What is wrong with a pose: axes missing or unknown, positions out of travel."""
    axes = structure.axes
    for name in pose:
        if name not in axes:
            yield f"pose: {no_axis(name, axes)}"
    for name, axis in axes.items():
        low, high = axis.travel
        if name not in pose:
            yield f"pose: the position of axis {name} is missing; {low:.9g} to {high:.9g} m is its travel"
        elif not low <= pose[name] <= high:
            yield f"pose: {name} at {pose[name]:.9g} m is outside its travel, {low:.9g} to {high:.9g} m"


def _materials(structure: GeometryStructure) -> Faults:
    known = list(structure.materials)
    for place, item in (
        *((("sections", name, "material"), section) for name, section in structure.sections.items()),
        *((("axes", name, "drive", "screw", "material"), axis.drive.screw) for name, axis in structure.axes.items()),
    ):
        if item.material is None and len(known) > 1:
            yield place, f"missing; there are several materials: {', '.join(known)}"
        elif item.material is not None and item.material not in known:
            yield place, f"there is no material {item.material!r}{did_you_mean(item.material, known)}"


def _motions(structure: GeometryStructure) -> Faults:
    for name, body in structure.bodies.items():
        for i, axis in enumerate(body.moves_with):
            if axis not in structure.axes:
                yield ("bodies", name, "moves_with", i), no_axis(axis, structure.axes)
            elif axis in body.moves_with[:i]:
                yield ("bodies", name, "moves_with", i), f"axis {axis} is listed twice"
        if body.mounts and body.moves_with:
            yield (
                ("bodies", name, "mounts"),
                f"{name} moves with {body.moves_with[0]}; a mount would hold it on the ground",
            )
    for axis in structure.axes:
        if not any(axis in body.moves_with for body in structure.bodies.values()):
            yield ("axes", axis), f"no body moves with axis {axis}; it belongs in the moves_with of those that do"


def _body(structure: GeometryStructure, name: str, body: Body) -> Faults:
    here: Place = ("bodies", name)
    for key, group in body.nodes.items():
        if group.section is not None and group.start is not None and group.end is not None:
            yield from _section(structure, (*here, "nodes", key, "section"), group.section)
            yield from _up((*here, "nodes", key, "up"), group.up, group.start, group.end)
    for i, beams in enumerate(body.beams):
        place: Place = (*here, "beams", i)
        yield from _section(structure, (*place, "section"), beams.section)
        stops: list[tuple[Node, ...]] = []
        for k, text in enumerate(beams.through):
            known, faults = _find_nodes(structure, name, (text,), (*place, "through", k))
            yield from faults
            if known and stops and len(known) != len(stops[-1]):
                counts = f"{beams.through[k - 1]} has {len(stops[-1])} nodes and {text} has {len(known)}"
                yield (*place, "through", k), f"{counts}; lines of equal count are joined node by node"
            elif known and stops:
                for first, second in zip(stops[-1], known, strict=True):
                    yield from _length(structure, (*place, "through", k), first, second)
                    yield from _up((*place, "up"), beams.up, position(structure, first), position(structure, second))
            if known:
                stops.append(known)
    for place, texts in (
        *(((*here, "masses", i, "nodes"), mass.nodes) for i, mass in enumerate(body.masses)),
        *(((*here, "mounts", i, "nodes"), mount.nodes) for i, mount in enumerate(body.mounts)),
    ):
        known, faults = _find_nodes(structure, name, texts, place)
        yield from faults
        if twice := [entry for k, entry in enumerate(known) if entry in known[:k]]:
            yield place, f"{twice[0]} is listed twice"
    for i, carriage in enumerate(body.carriages):
        place = (*here, "carriages", i)
        known, faults = _find_nodes(structure, name, (carriage.node,), (*place, "node"))
        yield from faults
        if len(known) > 1:
            yield (*place, "node"), f"{carriage.node!r} is a line of {len(known)} nodes; a carriage sits on one"
        try:
            line = rail(structure, carriage.rail)
        except InputError as error:
            yield (*place, "rail"), str(error)
            continue
        if line.body == name:
            yield (*place, "rail"), f"{carriage.rail} is part of {name} itself; a carriage rides on another body"
        for axis in _ways(structure, name) ^ _ways(structure, line.body):
            for k, direction in enumerate(carriage.directions):
                way = structure.axes[axis].direction if axis in structure.axes else (0.0, 0.0, 0.0)
                if abs(sum(a * b for a, b in zip(direction, way, strict=True))) > ALIGNMENT_TOLERANCE:
                    message = (
                        f"{_direction_text(direction)} is not square to {_direction_text(way)}, along "
                        f"which axis {axis} moves {name}"
                    )
                    yield (*place, "directions", k), f"{message} past {line.body}; the carriage would hold the axis"


def _section(structure: GeometryStructure, place: Place, name: str) -> Faults:
    if name not in structure.sections:
        hint = did_you_mean(name, list(structure.sections)) if structure.sections else ""
        yield place, f"there is no section {name!r}{hint}"


def _find_nodes(
    structure: GeometryStructure, body: str, texts: Sequence[str], place: Place
) -> tuple[tuple[Node, ...], list[tuple[Place, str]]]:
    """Nodes of a body that are named, and what is wrong with the names."""
    result: list[Node] = []
    faults: list[tuple[Place, str]] = []
    for text in texts:
        try:
            result += nodes(structure, body, text)
        except InputError as error:
            faults.append((place, str(error)))
    return tuple(result), faults


def _length(structure: GeometryStructure, place: Place, first: Node, second: Node) -> Faults:
    if dist(position(structure, first), position(structure, second)) < MIN_BEAM_LENGTH:
        what = "the same node" if first == second else "at the same point"
        yield place, f"a beam from {first} to {second}, which are {what}; a beam has a length"


def _up(place: Place, up: tuple[float, float, float] | None, start: Sequence[float], end: Sequence[float]) -> Faults:
    length = dist(start, end)
    if up is None or length < MIN_BEAM_LENGTH:
        return
    along = [(b - a) / length for a, b in zip(start, end, strict=True)]
    if hypot(*_cross(along, up)) < PARALLEL_TOLERANCE:
        yield place, "points along the beam itself, so it turns nothing; a direction across the beam is needed"


class _AttachedPoint(NamedTuple):
    """Something held at a point: its place in the file, by what, the body in whose frame the point is given (None: not
    known), and the axis that it must move with (True) or must not (False)."""

    place: Place
    texts: Sequence[str]
    frame: str | None = None
    axis: str | None = None
    moves: bool = False


def _drive(structure: GeometryStructure, name: str) -> Faults:
    axis = structure.axes[name]
    drive, scale, here = axis.drive, axis.scale, ("axes", name, "drive")
    screw, nut = drive.screw.body, drive.nut.body
    yield from _frame(structure, (*here, "screw", "body"), screw, name, False)
    yield from _frame(structure, (*here, "nut", "body"), nut, name, True)
    yield from _frame(structure, ("axes", name, "scale", "body"), scale.body)
    reads = scale.body in structure.bodies and name in structure.bodies[scale.body].moves_with
    holds = [
        _AttachedPoint((*here, "stator", "node"), (drive.stator.node,), screw, name, False),
        *(
            _AttachedPoint((*here, "bearings", i, "held_by"), it.held_by, screw, name, False)
            for i, it in enumerate(drive.bearings)
        ),
        _AttachedPoint((*here, "nut", "held_by"), drive.nut.held_by, nut, name, True),
        _AttachedPoint(("axes", name, "scale", "moving"), scale.moving, scale.body if reads else None, name, True),
        _AttachedPoint(("axes", name, "scale", "against"), scale.against, None if reads else scale.body, name, False),
    ]
    if drive.nut.rotation_of is not None:
        holds.append(_AttachedPoint((*here, "nut", "rotation_of"), drive.nut.rotation_of, nut, name, True))
    for hold in holds:
        yield from _check_attachment(structure, hold)


def _tool(structure: GeometryStructure) -> Faults:
    tool = structure.tool
    yield from _frame(structure, ("tool", "body"), tool.body)
    yield from _check_attachment(structure, _AttachedPoint(("tool", "held_by"), tool.held_by, tool.body))
    yield from _check_attachment(structure, _AttachedPoint(("tool", "against"), tool.against))


def _frame(structure: GeometryStructure, place: Place, body: str, axis: str = "", moves: bool = False) -> Faults:
    """The body is there, and moves with the axis or does not."""
    if body not in structure.bodies:
        yield place, f"there is no body {body!r}{did_you_mean(body, list(structure.bodies))}"
    elif axis and (axis in structure.bodies[body].moves_with) != moves:
        yield place, f"{_moving_axes_text(structure, body)}; it {'must' if moves else 'must not'} move with {axis}"


def _check_attachment(structure: GeometryStructure, hold: _AttachedPoint) -> Faults:
    """Names are known; nodes of one mean move alike, and as the point does that they hold."""
    try:
        result = resolve_attachment(structure, hold.texts)
    except InputError as error:
        yield hold.place, str(error)
        return
    ways = {body: _ways(structure, body) for body in result.bodies}
    body = result.bodies[0]
    if other := [name for name in ways if ways[name] != ways[body]]:
        yield (
            hold.place,
            f"{_moving_axes_text(structure, body)}, {_moving_axes_text(structure, other[0])}; nodes of a mean "
            f"must move alike",
        )
    elif hold.axis is not None and (hold.axis in ways[body]) != hold.moves:
        yield (
            hold.place,
            f"{_moving_axes_text(structure, body)}; it {'must' if hold.moves else 'must not'} move with {hold.axis}",
        )
    elif result.rail is None and hold.frame in structure.bodies and ways[body] != _ways(structure, hold.frame):
        both = f"{_moving_axes_text(structure, body)}, {_moving_axes_text(structure, hold.frame)}"
        yield hold.place, f"{both}; what holds a point must move as the body does in whose frame the point is given"


def _moving_axes_text(structure: GeometryStructure, body: str) -> str:
    return f"{body} moves with {', '.join(structure.bodies[body].moves_with) or 'no axis'}"


def _ways(structure: GeometryStructure, body: str | None) -> frozenset[str]:
    return frozenset(structure.bodies[body].moves_with) if body is not None else frozenset()


def _loose_nodes(structure: GeometryStructure) -> Faults:
    """Nodes that no beam reaches and no mass gives inertia to: the mass matrix would be singular."""
    for name, body in structure.bodies.items():
        held_by = {item for beams in body.beams for text in beams.through for item in nodes(structure, name, text)}
        massive = {
            item
            for mass in body.masses
            if all(moment > 0 for moment in mass.inertia)
            for text in mass.nodes
            for item in nodes(structure, name, text)
        }
        for key, group in body.nodes.items():
            if group.section is not None:
                continue
            for item in nodes(structure, name, key):
                if item not in held_by and item not in massive:
                    message = f"no beam reaches {item}; a node alone needs a mass with inertia about all three axes"
                    yield ("bodies", name, "nodes", key), message


def _along_screw(structure: GeometryStructure, name: str) -> Faults:
    """The screw lies along the axis, the nut lies on it over the whole travel."""
    axis = structure.axes[name]
    screw, nut = axis.drive.screw, axis.drive.nut
    length = dist(screw.start, screw.end)
    place = ("axes", name, "drive")
    if length < MIN_BEAM_LENGTH:
        yield (*place, "screw"), "start and end are the same point; a screw has a length"
        return
    along = [(b - a) / length for a, b in zip(screw.start, screw.end, strict=True)]
    if hypot(*_cross(along, axis.direction)) > ALIGNMENT_TOLERANCE:
        shown = ", ".join(f"{part:.6g}" for part in along)
        yield (*place, "screw"), f"the screw runs along [{shown}], axis {name} along {_direction_text(axis.direction)}"
        return
    for at in axis.travel:
        pose = {other: content.travel[0] for other, content in structure.axes.items()} | {name: at}
        way = [
            a + b - c - d
            for a, b, c, d in zip(
                _origin(structure, nut.body, pose),
                nut.at,
                _origin(structure, screw.body, pose),
                screw.start,
                strict=True,
            )
        ]
        reach = sum(a * b for a, b in zip(way, along, strict=True))
        off = hypot(*_cross(along, way))
        if off > OFF_AXIS:
            yield (*place, "nut", "at"), f"the nut lies {off:.6g} m beside the screw"
            return
        if not -OFF_AXIS <= reach <= length + OFF_AXIS:
            beyond = -reach if reach < 0 else reach - length
            end = "start" if reach < 0 else "end"
            message = f"with {name} at {at:.9g} m the nut is {beyond:.6g} m beyond the {end} of the screw"
            yield (*place, "nut", "at"), message
            return


def _origin(structure: GeometryStructure, body: str, pose: Mapping[str, float]) -> list[float]:
    values = list(structure.bodies[body].origin)
    for axis in structure.bodies[body].moves_with:
        values = [a + pose[axis] * b for a, b in zip(values, structure.axes[axis].direction, strict=True)]
    return values


def _cross(a: Sequence[float], b: Sequence[float]) -> tuple[float, float, float]:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _direction_text(direction: Iterable[float]) -> str:
    vector = tuple(direction)
    for letter, known in FRAME.items():
        if vector == known:
            return letter
    return f"[{', '.join(f'{part:.6g}' for part in vector)}]"


# --- Structure files: which model each kind is read as, and what is checked of it as a whole --------------------------


STRUCTURE_FILE = "structure.yaml"
STRUCTURE_KINDS: dict[str, type[Structure]] = {
    "geometry": GeometryStructure,
    "matrices": MatrixMarketStructure,
    "ansys": AnsysStructure,
    "calculix": CalculixStructure,
}


def contradictions_of(structure: Structure) -> Iterator[tuple[Place, str]]:
    """Place and message of what cannot go together in a structure of any kind."""
    if isinstance(structure, GeometryStructure):
        yield from contradictions(structure)


def load_structure(path: str | Path) -> Structure:
    """Read and check a structure: a structure file, or a folder with a structure.yaml, as the model its `kind` names.

    Raises InputError like load().
    """
    path = Path(path)
    path = path / STRUCTURE_FILE if path.is_dir() else path
    source = read_group(path)
    kind = source.data.get("kind")
    if kind is None:
        raise InputError(describe(source, ("kind",), f"missing key 'kind'; allowed: {', '.join(STRUCTURE_KINDS)}"))
    if not isinstance(kind, str) or kind not in STRUCTURE_KINDS:
        raise InputError(
            describe(source, ("kind",), f"unknown kind {brief(kind)}{did_you_mean(str(kind), [*STRUCTURE_KINDS])}")
        )
    return check_tree(source, STRUCTURE_KINDS[kind], path, contradictions_of)
