"""SystemStructure.ssd of SSP 1.0: components, their connectors, connections, where parameters are; written and read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from feedsim.cosim.archive import UnitDefinition
from feedsim.errors import InputError
from feedsim.ssp import xml
from feedsim.ssp.archive import as_source
from feedsim.ssp.parameter_set import ParameterSet, from_element, number
from feedsim.ssp.xml import append_units, read_units

ALGORITHM = "com.opensimulationplatform"  # annotation in which libcosim looks for the step size
MASTER = "org.openmodelica"  # annotation of the system in which OMSimulator looks for its master
SCENARIO = "feedsim.scenario"  # annotation with what the units cannot know: motions, evaluation, limits
FMU = "application/x-fmu-sharedlibrary"


@dataclass(frozen=True)
class Connector:
    """A variable of a component that can be connected. `unit` is None where the file gives none."""

    name: str
    kind: str  # "input", "output", ...
    type: str = "Real"
    unit: str | None = None


@dataclass(frozen=True)
class Binding:
    """Parameters of a component: those of the file `source`, or `inline`; `prefix` stands before each name."""

    source: str | None = None
    inline: ParameterSet | None = None
    prefix: str = ""


@dataclass(frozen=True)
class Component:
    """An instance of the archive `source`; `box` is x1, y1, x2, y2 in a picture, y upwards.

    The source is a path inside an SSP that is written, and the URI of one that was read (`archive.inside`).
    """

    name: str
    source: str
    connectors: tuple[Connector, ...] = ()
    bindings: tuple[Binding, ...] = ()
    box: tuple[float, float, float, float] | None = None


@dataclass(frozen=True)
class Link:
    """A connection; which end is the start says nothing about the direction."""

    start: tuple[str, str]  # element ("" for the system itself), connector
    end: tuple[str, str]
    transformed: bool = False  # carries a transformation that does something
    unconverted: bool = False  # units of measure are not to be converted

    def __str__(self) -> str:
        ends = (".".join(filter(None, end)) for end in (self.start, self.end))
        return " - ".join(ends)


@dataclass(frozen=True)
class Structure:
    """A system. `step` [s] is for libcosim and OMSimulator, and for files whose drives show no control cycle;
    `scenario` is the content of the annotation of that name."""

    name: str
    components: tuple[Component, ...]
    links: tuple[Link, ...]
    units: Mapping[str, UnitDefinition] = field(default_factory=dict)
    bindings: tuple[Binding, ...] = ()
    start: float = 0.0
    stop: float | None = None
    step: float | None = None
    scenario: str | None = None
    description: str = ""
    tool: str = ""


def to_bytes(structure: Structure) -> bytes:
    """The document. Its components' parameters are in files of their own."""
    described = {"description": structure.description} if structure.description else {}
    root = xml.element(
        "ssd:SystemStructureDescription",
        {"version": "1.0", "name": structure.name, **described, "generationTool": structure.tool},
    )
    system = xml.child(root, "ssd:System", {"name": "system"})
    elements = xml.child(system, "ssd:Elements")
    for component in structure.components:
        _append(elements, component)
    if structure.links:  # the schema has no empty ones
        connections = xml.child(system, "ssd:Connections")
        for link in structure.links:
            names = {"startElement": link.start[0], "startConnector": link.start[1]}
            xml.child(connections, "ssd:Connection", names | {"endElement": link.end[0], "endConnector": link.end[1]})
    if structure.step is not None:
        place = xml.child(xml.child(system, "ssd:Annotations"), "ssc:Annotation", {"type": MASTER})
        master = xml.child(xml.child(place, "oms:Annotations"), "oms:SimulationInformation")
        reported = {"description": "oms-ma", "stepSize": repr(structure.step), "relativeTolerance": "0.0001"}
        xml.child(master, "oms:FixedStepMaster", reported)  # the tolerance is for masters whose step varies
    append_units(root, "ssd:Units", structure.units)
    experiment = xml.child(root, "ssd:DefaultExperiment", {"startTime": repr(structure.start)})
    if structure.stop is not None:
        experiment.set("stopTime", repr(structure.stop))
    annotations = xml.child(experiment, "ssd:Annotations") if structure.step or structure.scenario else experiment
    if structure.step is not None:
        algorithm = xml.child(xml.child(annotations, "ssc:Annotation", {"type": ALGORITHM}), "osp:Algorithm")
        xml.child(algorithm, "osp:FixedStepAlgorithm", {"baseStepSize": repr(structure.step)})
    if structure.scenario is not None:
        # Here, since tools that write a file anew keep the experiment's annotations and not always those of the root.
        place = xml.child(annotations, "ssc:Annotation", {"type": SCENARIO})
        xml.child(place, "feedsim:Scenario", {"version": "1"}).text = structure.scenario
    return xml.to_bytes(root)


def _append(elements: xml.Element, component: Component) -> None:
    entry = xml.child(
        elements,
        "ssd:Component",
        {"name": component.name, "type": FMU, "source": as_source(component.source), "implementation": "CoSimulation"},
    )
    connectors = xml.child(entry, "ssd:Connectors")
    for connector in component.connectors:
        place = xml.child(connectors, "ssd:Connector", {"name": connector.name, "kind": connector.kind})
        xml.child(place, f"ssc:{connector.type}", {} if connector.unit is None else {"unit": connector.unit})
    if component.box is not None:
        corners = zip(("x1", "y1", "x2", "y2"), component.box, strict=True)
        xml.child(entry, "ssd:ElementGeometry", {corner: repr(at) for corner, at in corners})
    if component.bindings:
        bindings = xml.child(entry, "ssd:ParameterBindings")
        for binding in component.bindings:
            assert binding.source is not None
            xml.child(bindings, "ssd:ParameterBinding", {"source": as_source(binding.source)})


def read(content: bytes, where: str) -> Structure:
    """Read a document; what it cannot stand for in feedsim is refused. InputError lists every problem."""
    root = xml.parse(content, where, "ssd:SystemStructureDescription")
    system = root.find(xml.tag("ssd:System"))
    if system is None:
        raise InputError(f"{where}: has no ssd:System")
    problems: list[str] = []
    elements = system.find(xml.tag("ssd:Elements"))
    components: list[Component] = []
    for entry in () if elements is None else elements:
        if entry.tag != xml.tag("ssd:Component"):
            problems.append(f"{where}: {xml.shown(entry.tag)} {entry.get('name')}: only components are read here")
        else:
            components.append(_component(entry, where, problems))
    names = [component.name for component in components]
    problems += [f"{where}: component {name} is there {names.count(name)} times" for name in dict.fromkeys(names)
                 if names.count(name) > 1]  # fmt: skip
    links = tuple(map(_link, system.findall(f"{xml.tag('ssd:Connections')}/{xml.tag('ssd:Connection')}")))
    bindings = _bindings(system, "the system", where, problems)
    experiment = root.find(xml.tag("ssd:DefaultExperiment"))
    given = {} if experiment is None else experiment.attrib
    algorithm = root.find(f".//{xml.tag('osp:FixedStepAlgorithm')}")
    advised = {} if algorithm is None else algorithm.attrib
    start, stop = (_time(given, key, where, problems) for key in ("startTime", "stopTime"))
    step = _time(advised, "baseStepSize", where, problems)
    if problems:
        raise InputError.of(where, problems)
    own = root.find(f".//{xml.tag('ssc:Annotation')}[@type='{SCENARIO}']/{xml.tag('feedsim:Scenario')}")
    return Structure(
        name=root.get("name", ""),
        components=tuple(components),
        links=links,
        units=read_units(root.find(xml.tag("ssd:Units")), where),
        bindings=bindings,
        start=start or 0.0,
        stop=stop,
        step=step,
        scenario=None if own is None else own.text or "",
        description=root.get("description", ""),
        tool=root.get("generationTool", ""),
    )


def _component(entry: xml.Element, where: str, problems: list[str]) -> Component:
    name, kind = entry.get("name", ""), entry.get("type", FMU)
    if not name:
        problems.append(f"{where}: a component without a name")
    if kind != FMU:
        problems.append(f"{where}: component {name} is {kind}, no FMU")
    connectors = []
    for place in entry.findall(f"{xml.tag('ssd:Connectors')}/{xml.tag('ssd:Connector')}"):
        typed = next((element for element in place if element.tag.startswith(f"{{{xml.SSC}}}")), None)
        type_ = "Real" if typed is None else xml.shown(typed.tag).partition(":")[2]
        unit = None if typed is None else typed.get("unit")
        connectors.append(Connector(place.get("name", ""), place.get("kind", ""), type_, unit))
    return Component(
        name, entry.get("source", ""), tuple(connectors), _bindings(entry, f"component {name}", where, problems)
    )


def _bindings(entry: xml.Element, owner: str, where: str, problems: list[str]) -> tuple[Binding, ...]:
    bindings: list[Binding] = []
    for element in entry.findall(f"{xml.tag('ssd:ParameterBindings')}/{xml.tag('ssd:ParameterBinding')}"):
        source, prefix = element.get("source"), element.get("prefix", "")
        if element.find(xml.tag("ssd:ParameterMapping")) is not None:
            problems.append(f"{where}: {owner}: a parameter mapping is not read; name the parameters as the FMU does")
        if element.get("sourceBase", "SSD") != "SSD":
            problems.append(f"{where}: {owner}: parameters inside the FMU ({source}) are not read")
        if source:
            bindings.append(Binding(source=source, prefix=prefix))
            continue
        for inline in element.findall(f"{xml.tag('ssd:ParameterValues')}/{xml.tag('ssv:ParameterSet')}"):
            try:
                bindings.append(Binding(inline=from_element(inline, f"{where}: {owner}"), prefix=prefix))
            except InputError as error:
                problems += error.problems
    return tuple(bindings)


def _link(entry: xml.Element) -> Link:
    transformed = False
    for element in entry:
        if element.tag == xml.tag("ssc:LinearTransformation"):
            transformed |= (element.get("factor", "1"), element.get("offset", "0")) not in _IDENTITY
        elif element.tag.endswith("Transformation"):
            transformed = True
    start, end = (
        (entry.get(f"{which}Element") or "", entry.get(f"{which}Connector", "")) for which in ("start", "end")
    )
    return Link(start, end, transformed, entry.get("suppressUnitConversion") in ("true", "1"))


_IDENTITY = {(factor, offset) for factor in ("1", "1.0") for offset in ("0", "0.0")}


def _time(given: Mapping[str, str], key: str, where: str, problems: list[str]) -> float | None:
    try:
        return number(given[key].strip()) if key in given else None
    except InputError as error:
        problems.append(f"{where}: {key} {error}")
        return None
