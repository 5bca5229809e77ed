"""SystemStructure.ssd of SSP 1.0: components, their connectors, connections, where parameters are; written and read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from feedsim.foundation.errors import InputError
from feedsim.simulation.cosim.archive import UnitDefinition
from feedsim.simulation.ssp import archive
from feedsim.simulation.ssp.archive import append_units, as_source, read_units
from feedsim.simulation.ssp.parameter_set import ParameterSet, from_element, number

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

    The source is a path inside an SSP that is written, and the URI of one that was read (`archive.resolve_source`).
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
    root = archive.element(
        "ssd:SystemStructureDescription",
        {"version": "1.0", "name": structure.name, **described, "generationTool": structure.tool},
    )
    system = archive.child(root, "ssd:System", {"name": "system"})
    elements = archive.child(system, "ssd:Elements")
    for component in structure.components:
        _append(elements, component)
    if structure.links:  # the schema has no empty ones
        connections = archive.child(system, "ssd:Connections")
        for link in structure.links:
            names = {"startElement": link.start[0], "startConnector": link.start[1]}
            archive.child(
                connections, "ssd:Connection", names | {"endElement": link.end[0], "endConnector": link.end[1]}
            )
    if structure.step is not None:
        place = archive.child(archive.child(system, "ssd:Annotations"), "ssc:Annotation", {"type": MASTER})
        master = archive.child(archive.child(place, "oms:Annotations"), "oms:SimulationInformation")
        reported = {"description": "oms-ma", "stepSize": repr(structure.step), "relativeTolerance": "0.0001"}
        archive.child(master, "oms:FixedStepMaster", reported)  # the tolerance is for masters whose step varies
    append_units(root, "ssd:Units", structure.units)
    experiment = archive.child(root, "ssd:DefaultExperiment", {"startTime": repr(structure.start)})
    if structure.stop is not None:
        experiment.set("stopTime", repr(structure.stop))
    annotations = archive.child(experiment, "ssd:Annotations") if structure.step or structure.scenario else experiment
    if structure.step is not None:
        algorithm = archive.child(archive.child(annotations, "ssc:Annotation", {"type": ALGORITHM}), "osp:Algorithm")
        archive.child(algorithm, "osp:FixedStepAlgorithm", {"baseStepSize": repr(structure.step)})
    if structure.scenario is not None:
        # Here, since tools that write a file anew keep the experiment's annotations and not always those of the root.
        place = archive.child(annotations, "ssc:Annotation", {"type": SCENARIO})
        archive.child(place, "feedsim:Scenario", {"version": "1"}).text = structure.scenario
    return archive.to_bytes(root)


def _append(elements: archive.Element, component: Component) -> None:
    entry = archive.child(
        elements,
        "ssd:Component",
        {"name": component.name, "type": FMU, "source": as_source(component.source), "implementation": "CoSimulation"},
    )
    connectors = archive.child(entry, "ssd:Connectors")
    for connector in component.connectors:
        place = archive.child(connectors, "ssd:Connector", {"name": connector.name, "kind": connector.kind})
        archive.child(place, f"ssc:{connector.type}", {} if connector.unit is None else {"unit": connector.unit})
    if component.box is not None:
        corners = zip(("x1", "y1", "x2", "y2"), component.box, strict=True)
        archive.child(entry, "ssd:ElementGeometry", {corner: repr(at) for corner, at in corners})
    if component.bindings:
        bindings = archive.child(entry, "ssd:ParameterBindings")
        for binding in component.bindings:
            assert binding.source is not None
            archive.child(bindings, "ssd:ParameterBinding", {"source": as_source(binding.source)})


def read_structure(content: bytes, where: str) -> Structure:
    """Read a document; what it cannot stand for in feedsim is refused. InputError lists every problem."""
    root = archive.parse(content, where, "ssd:SystemStructureDescription")
    system = root.find(archive.tag("ssd:System"))
    if system is None:
        raise InputError(f"{where}: has no ssd:System")
    problems: list[str] = []
    elements = system.find(archive.tag("ssd:Elements"))
    components: list[Component] = []
    for entry in () if elements is None else elements:
        if entry.tag != archive.tag("ssd:Component"):
            problems.append(
                f"{where}: {archive.prefixed_tag(entry.tag)} {entry.get('name')}: only components are read here"
            )
        else:
            components.append(_component(entry, where, problems))
    names = [component.name for component in components]
    problems += [f"{where}: component {name} is there {names.count(name)} times" for name in dict.fromkeys(names)
                 if names.count(name) > 1]  # fmt: skip
    links = tuple(map(_link, system.findall(f"{archive.tag('ssd:Connections')}/{archive.tag('ssd:Connection')}")))
    bindings = _bindings(system, "the system", where, problems)
    experiment = root.find(archive.tag("ssd:DefaultExperiment"))
    given = {} if experiment is None else experiment.attrib
    algorithm = root.find(f".//{archive.tag('osp:FixedStepAlgorithm')}")
    advised = {} if algorithm is None else algorithm.attrib
    start, stop = (_time(given, key, where, problems) for key in ("startTime", "stopTime"))
    step = _time(advised, "baseStepSize", where, problems)
    if problems:
        raise InputError.of(where, problems)
    own = root.find(f".//{archive.tag('ssc:Annotation')}[@type='{SCENARIO}']/{archive.tag('feedsim:Scenario')}")
    return Structure(
        name=root.get("name", ""),
        components=tuple(components),
        links=links,
        units=read_units(root.find(archive.tag("ssd:Units")), where),
        bindings=bindings,
        start=start or 0.0,
        stop=stop,
        step=step,
        scenario=None if own is None else own.text or "",
        description=root.get("description", ""),
        tool=root.get("generationTool", ""),
    )


def _component(entry: archive.Element, where: str, problems: list[str]) -> Component:
    name, kind = entry.get("name", ""), entry.get("type", FMU)
    if not name:
        problems.append(f"{where}: a component without a name")
    if kind != FMU:
        problems.append(f"{where}: component {name} is {kind}, no FMU")
    connectors = []
    for place in entry.findall(f"{archive.tag('ssd:Connectors')}/{archive.tag('ssd:Connector')}"):
        typed = next((element for element in place if element.tag.startswith(f"{{{archive.SSC}}}")), None)
        type_ = "Real" if typed is None else archive.prefixed_tag(typed.tag).partition(":")[2]
        unit = None if typed is None else typed.get("unit")
        connectors.append(Connector(place.get("name", ""), place.get("kind", ""), type_, unit))
    return Component(
        name, entry.get("source", ""), tuple(connectors), _bindings(entry, f"component {name}", where, problems)
    )


def _bindings(entry: archive.Element, owner: str, where: str, problems: list[str]) -> tuple[Binding, ...]:
    bindings: list[Binding] = []
    for element in entry.findall(f"{archive.tag('ssd:ParameterBindings')}/{archive.tag('ssd:ParameterBinding')}"):
        source, prefix = element.get("source"), element.get("prefix", "")
        if element.find(archive.tag("ssd:ParameterMapping")) is not None:
            problems.append(f"{where}: {owner}: a parameter mapping is not read; name the parameters as the FMU does")
        if element.get("sourceBase", "SSD") != "SSD":
            problems.append(f"{where}: {owner}: parameters inside the FMU ({source}) are not read")
        if source:
            bindings.append(Binding(source=source, prefix=prefix))
            continue
        for inline in element.findall(f"{archive.tag('ssd:ParameterValues')}/{archive.tag('ssv:ParameterSet')}"):
            try:
                bindings.append(Binding(inline=from_element(inline, f"{where}: {owner}"), prefix=prefix))
            except InputError as error:
                problems += error.problems
    return tuple(bindings)


def _link(entry: archive.Element) -> Link:
    transformed = False
    for element in entry:
        if element.tag == archive.tag("ssc:LinearTransformation"):
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
