"""What the names of nodes in a machine written as geometry stand for."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from feedsim.errors import InputError
from feedsim.fields import did_you_mean
from feedsim.scenario.structure.geometry import GeometryStructure


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
class Held:
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
    _body(structure, body)
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
    _body(structure, body)
    groups = structure.bodies[body].nodes
    if name not in groups or groups[name].count is None:
        lines = [key for key, group in groups.items() if group.count is not None]
        what = "a single node, no line of nodes" if name in groups else f"no line of nodes of body {body}"
        hint = did_you_mean(name, lines) if lines else "; the body has none"
        raise InputError(f"{text!r}: {name} is {what}{hint}")
    return Line(body, name)


def held(structure: GeometryStructure, texts: Sequence[str]) -> Held:
    """What the words of a place to hold on to mean. InputError: unknown names, a rail among nodes, a node twice."""
    rails = [text.removeprefix("rail ") for text in texts if text.startswith("rail ")]
    if rails and len(texts) > 1:
        raise InputError(f"'rail {rails[0]}' stands alone, not in a list")
    if rails:
        return Held((), rail(structure, rails[0]))
    result = tuple(node(structure, text) for text in texts)
    if twice := [item for item in result if result.count(item) > 1]:
        raise InputError(f"{twice[0]} is listed twice")
    return Held(result, None)


def position(structure: GeometryStructure, item: Node) -> tuple[float, ...]:
    """Position of a node in the frame of its body [m]."""
    group = structure.bodies[item.body].nodes[item.name]
    if item.number is None or group.start is None or group.end is None or group.count is None:
        return group.at or ()
    share = item.number / (group.count - 1)
    return tuple(a + share * (b - a) for a, b in zip(group.start, group.end, strict=True))


def _body(structure: GeometryStructure, name: str) -> None:
    if name not in structure.bodies:
        raise InputError(f"there is no body {name!r}{did_you_mean(name, list(structure.bodies))}")


def _range(text: str, count: int) -> tuple[int, int]:
    if not text:
        return 0, count - 1
    first, _, last = re.sub(r"\.\.", " ", text).partition(" ")
    return int(first), int(last or first)
