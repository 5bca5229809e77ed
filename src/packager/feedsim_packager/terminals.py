"""terminalsAndIcons/ of an archive and model.png: the unit's icon, and its inputs and outputs grouped into terminals.

What belongs together is declared once, in KINDS, for both sides of a connection; which terminals a unit has follows
from the names of its variables. The format is that of FMI 3.0, section 2.4.9, which FMI 2.0.4 and later allow as it is.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as ET

from .checkout import SHELL
from .errors import InputError
from .variables import Variable

FOLDER = "terminalsAndIcons"
DESCRIPTION = f"{FOLDER}/terminalsAndIcons.xml"
MODEL_PICTURE = "model.png"  # the icon where importers of FMI 2.0 look for it
PICTURES = SHELL / "terminals"  # one PNG and SVG per kind

_FMI_VERSION = "3.0"  # of the format; its schema wants it, in archives of FMI 2.0 as well
_EXTENT = 100  # the icon reaches from -100 to 100, the standard's default
_SIZE = 20  # of a terminal's symbol, less where an edge is crowded
_STROKE = "2"


@dataclass(frozen=True)
class Kind:
    """What two units exchange. `gives` are outputs of the one side, the giver, and inputs of the other; `takes` the
    other way round. Members are the last parts of the variables' names.

    `rule` is the standard's matching rule: plug connects all members or none, bus those that are there.
    """

    name: str
    gives: tuple[str, ...]
    takes: tuple[str, ...]
    text: str
    colour: str  # of connections, red green blue
    edges: tuple[str, str]  # of the icon, where the terminal is: giver's side, other side
    rule: str = "plug"


# The order is that of Fig. 2, from the setpoint to the contact.
KINDS = (
    Kind(
        name="setpoint",
        gives=("x_s", "n_ffw", "release"),
        takes=(),
        text="Position setpoint, speed feedforward and release for a controller",
        colour="89 99 110",
        edges=("right", "left"),
    ),
    Kind(
        name="motor",
        gives=("M_a",),
        takes=("n_a", "x_a"),
        text="Motor torque of a controller against speed and position measured on the plant",
        colour="0 114 178",
        edges=("right", "left"),
    ),
    Kind(
        name="friction",
        gives=("M_fr",),
        takes=("n_fr",),
        text="Friction torque against the speed at its contact in the plant",
        colour="213 94 0",
        edges=("left", "right"),
    ),
    Kind(
        name="tool",
        gives=("F_X", "F_Y", "F_Z"),
        takes=("x_X", "x_Y", "x_Z"),
        text="Forces on the tool against its displacements",
        colour="0 158 115",
        edges=("left", "bottom"),
        rule="bus",
    ),
)


@dataclass(frozen=True)
class Terminal:
    """A terminal of a unit: member name -> name of the variable."""

    name: str
    kind: Kind
    group: str  # common to its variables' names, ahead of the last dot; empty without one
    gives: bool
    members: Mapping[str, str]

    @property
    def edge(self) -> str:
        """Edge of the unit's icon that it lies on."""
        return self.kind.edges[0 if self.gives else 1]

    @property
    def description(self) -> str:
        """The kind's text, and of which axis."""
        return self.kind.text + (f", axis {self.group}" if self.group not in ("", self.kind.name) else "")


def find(variables: Iterable[Variable]) -> tuple[Terminal, ...]:
    """The terminals of a unit with these variables, by group in order of the variables, then by kind.

    A group of variables (`Z.` of Z.M_a, or those without a group) has a terminal of each kind whose members are all
    among its inputs and outputs. It is called group.kind; or by the kind alone where there is no group, or one of the
    kind's own name.

    Raises:
        InputError: members are there, but neither as the one side of the kind nor as the other.
    """
    groups: dict[str, dict[str, Variable]] = {}
    for variable in variables:
        if variable.row.causality in ("input", "output"):
            group, _, member = variable.name.rpartition(".")
            groups.setdefault(group, {})[member] = variable
    terminals: list[Terminal] = []
    problems: list[str] = []
    for group, present in groups.items():
        for kind in KINDS:
            names = (*kind.gives, *kind.takes)
            if not all(name in present for name in names):
                continue
            found_as = {name: present[name].row.causality for name in names}
            giver = dict.fromkeys(kind.gives, "output") | dict.fromkeys(kind.takes, "input")
            other = dict.fromkeys(kind.gives, "input") | dict.fromkeys(kind.takes, "output")
            name = kind.name if group in ("", kind.name) else f"{group}.{kind.name}"
            if kind.takes and set(found_as.values()) == {"output"}:
                continue  # both sides are within the unit, which shows what they exchange
            if found_as not in (giver, other):
                stated = ", ".join(f"{present[member].name} {causality}" for member, causality in found_as.items())
                problems.append(
                    f"{name}: {stated}; a connection needs {_words(giver)}, or all of them the other way round"
                )
            members = {member: present[member].name for member in names}
            terminals.append(Terminal(name, kind, group, found_as == giver, members))
    if problems:
        raise InputError("terminals that nothing can be connected to", problems)
    return tuple(terminals)


def _words(causalities: Mapping[str, str]) -> str:
    return ", ".join(f"{member} as {causality}" for member, causality in causalities.items())


def files(directory: Path, variables: Sequence[Variable]) -> tuple[dict[str, bytes], list[str]]:
    """Archive path -> content of all that this module is about, for the unit in `directory`; and warnings.

    The unit's icon is icon.svg of the directory and icon.png, drawn from it. A unit without them goes without.
    """
    result: dict[str, bytes] = {}
    warnings: list[str] = []
    for name in ("icon.png", "icon.svg"):
        if (path := directory / name).is_file():
            result[f"{FOLDER}/{name}"] = path.read_bytes()
    if icon := result.get(f"{FOLDER}/icon.png"):
        result[MODEL_PICTURE] = icon
    else:
        result = {}  # the standard allows the SVG beside the PNG only
        warnings.append(f"icon.png of {directory.name} is missing: the archive goes without a picture of the unit")
    for kind in {terminal.kind.name for terminal in find(variables)}:
        for suffix in (".png", ".svg"):
            result[f"{FOLDER}/{kind}{suffix}"] = (PICTURES / f"{kind}{suffix}").read_bytes()
    return result | describe(variables, result), warnings


def without(files: Mapping[str, bytes]) -> dict[str, bytes]:
    """An archive's files without terminals and icons, for importers that stumble over them; the picture stays."""
    return {path: content for path, content in files.items() if not path.startswith(f"{FOLDER}/")}


def describe(variables: Sequence[Variable], present: Collection[str]) -> dict[str, bytes]:
    """terminalsAndIcons.xml under its path in the archive; nothing where there is nothing to tell.

    `present` are the paths in the archive: pictures that are not among them are not referred to.
    """
    terminals = find(variables)
    if not terminals:
        return {}
    # No GraphicalRepresentation ahead of the terminals: it would only repeat the standard's default coordinate system
    # and lay the icon over it, and the FMU Manipulation Toolbox (2.0) finds terminals in the first element alone.
    root = ET.Element("fmiTerminalsAndIcons", fmiVersion=_FMI_VERSION)
    parent = ET.SubElement(root, "Terminals")
    for terminal, place in zip(terminals, _places(terminals), strict=True):
        element = _add_terminal(parent, terminal)
        if f"{FOLDER}/{terminal.kind.name}.png" in present:
            ET.SubElement(
                element,
                "TerminalGraphicalRepresentation",
                {
                    "defaultConnectionColor": terminal.kind.colour,
                    "defaultConnectionStrokeSize": _STROKE,
                    **place,
                    "iconBaseName": terminal.kind.name,
                },
            )
    ET.indent(root)
    content: str = ET.tostring(root, encoding="unicode")
    return {DESCRIPTION: f'<?xml version="1.0" encoding="UTF-8"?>\n{content}\n'.encode()}


def _add_terminal(parent: ET.Element, terminal: Terminal) -> ET.Element:
    kind = terminal.kind
    element = ET.SubElement(
        parent,
        "Terminal",
        name=terminal.name,
        matchingRule=kind.rule,
        terminalKind=f"_feedsim_{kind.name}",  # the standard's form for kinds that no standard defines
        description=terminal.description,
    )
    for member, variable in terminal.members.items():
        # signal: plain flow from output to input. Torques as flows (inflow, outflow) would be added up to zero, but
        # M_fr is counted against M_a.
        ET.SubElement(
            element, "TerminalMemberVariable", variableName=variable, memberName=member, variableKind="signal"
        )
    return element


def _extent(x: float, y: float, half: float) -> dict[str, str]:
    corners = {"x1": x - half, "y1": y - half, "x2": x + half, "y2": y + half}
    return {name: f"{value:g}" for name, value in corners.items()}


def _places(terminals: Sequence[Terminal]) -> list[dict[str, str]]:
    """Where the terminals' symbols are: centred on their edge of the icon, evenly, from the top or from the left."""
    edges: dict[str, int] = {}
    for terminal in terminals:
        edges[terminal.edge] = edges.get(terminal.edge, 0) + 1
    taken = dict.fromkeys(edges, 0)
    places = []
    for terminal in terminals:
        edge, pitch = terminal.edge, 2 * _EXTENT / edges[terminal.edge]
        along = _EXTENT - (taken[edge] + 0.5) * pitch
        taken[edge] += 1
        half = min(_SIZE, 0.8 * pitch) / 2
        x, y = {"left": (-_EXTENT, along), "right": (_EXTENT, along), "bottom": (-along, -_EXTENT)}[edge]
        places.append(_extent(x, y, half))
    return places
