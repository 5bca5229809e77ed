"""Variables -> modelDescription.xml (FMI 2.0, co-simulation)."""

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from xml.etree import ElementTree as ET

from . import units
from .errors import InputError
from .machine import Machine
from .resources import Experiment
from .table import INITIAL, Row, Table
from .variables import Variable

GENERATION_TOOL = "feedsim packager"

LOG_CATEGORIES = {
    "logStatusError": "Calls that were refused or failed, with the reason",
    "logStatusWarning": "Calls that were carried out although something is doubtful",
    "logEvents": "Instantiation, initialisation, reset and termination",
    "logFmi2Call": "Every call of an FMI function, with its arguments",
    "logAll": "All messages",
}

# unit -> (type name, quantity). A unit that is missing here gets no type, which is no loss but of a nice name.
TYPES = {
    "1": ("Ratio", "Ratio"),
    "m": ("Position", "Length"),
    "rad": ("Angle", "Angle"),
    "rad/s": ("AngularVelocity", "AngularVelocity"),
    "s": ("Duration", "Time"),
    "Hz": ("Frequency", "Frequency"),
    "1/s": ("PositionGain", "VelocityGain"),
    "m/rad": ("Lead", "LengthPerAngle"),
    "N": ("Force", "Force"),
    "N/m": ("Stiffness", "TranslationalSpringConstant"),
    "N.s/m": ("Damping", "TranslationalDampingConstant"),
    "m/s": ("Velocity", "Velocity"),
    "m/s2": ("Acceleration", "Acceleration"),
    "J": ("Energy", "Energy"),
    "W": ("Power", "Power"),
    "N.m": ("Torque", "Torque"),
    "N.m/s": ("TorqueRate", "TorquePerTime"),
    "N.m/rad": ("RotationalStiffness", "RotationalSpringConstant"),
    "N.m.s/rad": ("RotationalDamping", "RotationalDampingConstant"),
    "N.m/A": ("TorqueConstant", "ElectricalTorqueConstant"),
    "A": ("Current", "ElectricCurrent"),
    "V": ("Voltage", "ElectricPotential"),
    "V/A": ("CurrentGain", "Resistance"),
    "kg.m2": ("MomentOfInertia", "MomentOfInertia"),
    "Ohm": ("Resistance", "Resistance"),
    "H": ("Inductance", "Inductance"),
}


def capabilities(variables: Iterable[Variable]) -> dict[str, bool | int]:
    """What the shell in src/fmi2 can do, with such variables."""
    reals = [variable.row for variable in variables if variable.row.kind == "REAL"]
    continuous = any(row.causality == "output" and row.variability == "continuous" for row in reals)
    return {
        "needsExecutionTool": False,
        "canHandleVariableCommunicationStepSize": True,
        "canInterpolateInputs": True,  # where there are none, all of them: some tools ask every unit of a system
        "maxOutputDerivativeOrder": 1 if continuous else 0,  # values that are held have none (it would be stated as 0)
        "canRunAsynchronuously": False,  # spelled so in the standard
        "canBeInstantiatedOnlyOncePerProcess": False,
        "canNotUseMemoryManagementFunctions": False,
        "canGetAndSetFMUstate": True,
        "canSerializeFMUstate": True,
        "providesDirectionalDerivative": True,
    }


def describe(
    table: Table,
    variables: Sequence[Variable],
    *,
    guid: str,
    version: str,
    sources: Iterable[str],
    machine: Machine,
    experiment: Experiment,
) -> bytes:
    """The file's content. `sources` are the C files to compile, by name. Deterministic: no date, no computer."""
    summary = ". ".join(text for text in (table.summary, machine.sentence()) if text)
    root = ET.Element(
        "fmiModelDescription",
        {
            "fmiVersion": "2.0",
            "modelName": machine.model or table.unit,
            "guid": guid,
            **({"description": summary} if summary else {}),
            "version": version,
            "license": "MIT",
            "generationTool": f"{GENERATION_TOOL} {version}",
            "variableNamingConvention": "structured",
        },
    )
    can = {name: _text(value) for name, value in capabilities(variables).items()}
    simulation = ET.SubElement(root, "CoSimulation", {"modelIdentifier": table.unit, **can})
    files = ET.SubElement(simulation, "SourceFiles")
    for name in sorted(sources):
        ET.SubElement(files, "File", name=name)
    reals = [variable.row for variable in variables if variable.row.kind == "REAL"]
    _add_units(root, reals)
    _add_types(root, reals, {variable.name for variable in variables})
    categories = ET.SubElement(root, "LogCategories")
    for name, text in LOG_CATEGORIES.items():
        ET.SubElement(categories, "Category", name=name, description=text)
    times = {"startTime": 0.0, "stopTime": experiment.stop, "stepSize": experiment.step}
    ET.SubElement(root, "DefaultExperiment", {name: _text(value) for name, value in times.items()})
    _add_variables(root, variables)
    _add_structure(root, variables)
    ET.indent(root)
    content: str = ET.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{content}\n'.encode()


def _text(value: bool | int | float) -> str:
    """A value as XML Schema spells it; floats in the shortest form that reads back the same."""
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(value).removesuffix(".0")


def _display_units(rows: Iterable[Row]) -> dict[str, list[str]]:
    """unit -> its display units; a unit is not its own display unit.

    Units in order of their first use, display units with the one of most signals first, then of most parameters: there
    are importers that show all values of a unit in its first one (FMPy's plots), and signals are what is plotted.
    """
    result: dict[str, Counter[str]] = {}
    plotted: Counter[tuple[str, str]] = Counter()
    for row in rows:
        result.setdefault(row.unit, Counter())[row.display_unit] += 1
        plotted[row.unit, row.display_unit] += row.causality != "parameter"
    return {  # equally many: in order of their first use
        unit: sorted((n for n in names if n != unit), key=lambda n: (-plotted[unit, n], -names[n]))
        for unit, names in result.items()
    }


def _add_units(root: ET.Element, rows: Sequence[Row]) -> None:
    if not rows:
        return
    definitions = ET.SubElement(root, "UnitDefinitions")
    for name, display_names in _display_units(rows).items():
        unit = units.parse(name)
        element = ET.SubElement(definitions, "Unit", name=name)
        base = ET.SubElement(element, "BaseUnit")
        for symbol, exponent in zip(units.BASE, unit.exponents, strict=True):
            if exponent:
                base.set(symbol, str(exponent))
        if unit.factor != 1:
            base.set("factor", _text(unit.factor))
        for display in display_names:
            ET.SubElement(element, "DisplayUnit", name=display, factor=_text(units.conversion(name, display)))


def _add_types(root: ET.Element, rows: Sequence[Row], variable_names: set[str]) -> None:
    typed = [unit for unit in _display_units(rows) if unit in TYPES]
    if not typed:
        return
    definitions = ET.SubElement(root, "TypeDefinitions")
    for unit in typed:
        name, quantity = TYPES[unit]
        if name in variable_names:
            raise InputError(f"variable {name}: the name is taken by the type of unit {unit}; FMI wants both unique")
        # No displayUnit: a variable that has none of its own would inherit it.
        ET.SubElement(ET.SubElement(definitions, "SimpleType", name=name), "Real", quantity=quantity, unit=unit)


def _add_variables(root: ET.Element, variables: Iterable[Variable]) -> None:
    parent = ET.SubElement(root, "ModelVariables")
    for variable in variables:
        row = variable.row
        element = ET.SubElement(
            parent,
            "ScalarVariable",
            name=variable.name,
            valueReference=str(variable.reference),
            description=row.description,
            causality=row.causality,
            variability=row.variability,
        )
        if initial := INITIAL[row.causality]:
            element.set("initial", initial)
        ET.SubElement(element, row.kind.capitalize(), _type_attributes(variable))


def _type_attributes(variable: Variable) -> dict[str, str]:
    row = variable.row
    attributes: dict[str, str] = {}
    if row.kind == "REAL":
        # The unit is repeated beside the type: many importers do not look it up there.
        if row.unit in TYPES:
            attributes["declaredType"] = TYPES[row.unit][0]
        attributes["unit"] = row.unit
        if row.display_unit != row.unit:
            attributes["displayUnit"] = row.display_unit
    if row.kind in ("REAL", "INTEGER"):
        number = float if row.kind == "REAL" else int
        for name, value in (("min", row.minimum), ("max", row.maximum)):
            if math.isfinite(value):
                attributes[name] = _text(number(value))
    if variable.start is not None:
        attributes["start"] = _start(row.kind, variable.start)
    return attributes


def _start(kind: str, start: str) -> str:
    match kind:
        case "REAL":
            return _text(float(start))
        case "INTEGER":
            return _text(int(start))
        case "BOOLEAN":
            return _text(bool(int(start)))
    return start


def _add_structure(root: ET.Element, variables: Sequence[Variable]) -> None:
    structure = ET.SubElement(root, "ModelStructure")
    outputs = [variable for variable in variables if variable.row.causality == "output"]
    if not outputs:
        return
    element = ET.SubElement(structure, "Outputs")
    for variable in outputs:
        _add_unknown(element, variable, variable.depends)
    # Inputs by declaration, so that importers see no loop of initial values where there is none; parameters without
    # distinction, as no importer solves for them.
    parameters = [variable.reference for variable in variables if variable.row.causality == "parameter"]
    element = ET.SubElement(structure, "InitialUnknowns")
    for variable in outputs:
        _add_unknown(element, variable, sorted((*variable.depends_initially, *parameters)))


def _add_unknown(parent: ET.Element, variable: Variable, references: Sequence[int]) -> None:
    ET.SubElement(
        parent,
        "Unknown",
        index=str(variable.reference + 1),  # counts from 1; value references are the positions from 0
        dependencies=" ".join(str(reference + 1) for reference in references),
        dependenciesKind=" ".join("dependent" for _ in references),
    )
