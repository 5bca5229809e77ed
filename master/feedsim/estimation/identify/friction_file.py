"""friction.yaml, what an identification leaves and machine files name: values with their intervals, and where they come
from. It holds the keys of `scenario.Friction` with their units, and in `identified` where they come from."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from feedsim.analysis.history import Scatter
from feedsim.estimation.identify.parameters import PARAMETER_KINDS
from feedsim.estimation.identify.read import Provenance, distinct
from feedsim.estimation.identify.record import Record
from feedsim.estimation.identify.result import Balance, Estimate, Identification
from feedsim.estimation.least_squares import NORMAL_95
from feedsim.estimation.parameter import Prior
from feedsim.files.checked import read_group
from feedsim.files.fields import Quantity
from feedsim.foundation import units
from feedsim.foundation.arguments import amount
from feedsim.foundation.errors import Finding, InputError, OutputError, rank_findings
from feedsim.scenario import Friction, FrictionParameters, GmsFriction, Subject
from feedsim.scenario.roles import GMS

FRICTION_FILE = "friction.yaml"
# Relative 5e-8 at most: what is calculated from the file is that of the fit to 1e-6, and a person can still read it.
DIGITS = 8
FILE_COLUMNS = 118
EXACT_DIGITS = 8  # significant digits of the other values of a group `identified`


@dataclass(frozen=True)
class Line:
    """A parameter as it stands in the file: SI value, and a remark behind it."""

    value: float
    remark: str = ""


@dataclass(frozen=True, eq=False)
class IdentifiedFriction:
    """An identification with what it rests on.

    Attributes:
        records: what was identified from, in the order of their files.
        sources: of each file.
        subject: the machine that pitch, torque constant or inertia are from; None where none was named.
        settings: option -> value, as the user gave them.
        date: day of the identification, ISO 8601.
    """

    found: Identification
    records: tuple[Record, ...]
    sources: tuple[Provenance, ...]
    subject: Subject | None = None
    settings: Mapping[str, str] = field(default_factory=dict)
    date: str = ""

    @property
    def estimates(self) -> Mapping[str, Estimate]:
        """Every friction parameter, M_0, J and delay, by name: value, interval, status."""
        return self.found.estimates

    @property
    def traces(self) -> tuple[str, ...]:
        """Names of the traces, in the order of the sources."""
        return distinct([source.file for source in self.sources])

    @property
    def warnings(self) -> list[Finding]:
        """Of reading and of identifying."""
        reading = (warning for source in self.sources for warning in source.warnings)
        return rank_findings((*reading, *self.found.warnings))

    @property
    def notes(self) -> list[str]:
        """What the numbers are worth: the notes of the mappings, and the machine's with whose it is."""
        notes = [source.note for source in self.sources]
        if self.subject is not None:
            notes += [f"{self.subject.machine.name}: {note}" for note in self.subject.notes]
        return [note for note in dict.fromkeys(notes) if note]


def friction_yaml(identified: IdentifiedFriction, software: Mapping[str, str]) -> str:
    """Text of friction.yaml. software: versions, of feedsim and what it calculates with.

    Raises OutputError where the values make no friction, e.g. one beyond its range.
    """
    estimates = identified.found.estimates
    model = GmsFriction if "spread" in estimates else Friction
    lines = {name: _line(estimates[name]) for name in model.model_fields if name in estimates}
    origin = _origin(identified, software)
    return friction_text(lines, origin, _head(identified, software["feedsim"]), name=FRICTION_FILE, model=model)


def fleet_yaml(axes: Mapping[str, Sequence[Scatter]], machines: Sequence[str]) -> str:
    """Text of fleet.yaml: axis -> mean and scatter of its parameters over machines of one kind.

    `deviation` is that of a value of a further machine: what identify friction --prior expects of it.
    """
    content: dict[str, Any] = {"machines": list(machines), "axes": {}}
    for axis, scatters in axes.items():
        content["axes"][axis] = {
            one.name.partition(".")[2]: {
                "mean": _quantity(one.mean, one.unit),
                "deviation": _quantity(one.predicted, one.unit),
                "between": _quantity(one.between, one.unit),
                **({"within": _quantity(one.within, one.unit)} if math.isfinite(one.within) else {}),
                "machines": one.machines,
                "results": one.records,
            }
            for one in scatters
        }
    text: str = yaml.dump(content, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=FILE_COLUMNS)
    head = "# Friction of machines of one kind, by feedsim history --machines; SI, motor side."
    return f"{head}\n# To use: feedsim identify friction LOG.csv --prior fleet.yaml\n{text}"


def read_fleet(path: Path | str) -> dict[str, Prior]:
    """Axis -> what fleet.yaml has of its friction: means with the deviations of a further machine, uncorrelated.

    Raises InputError: no such file, an entry that is none.
    """
    source = read_group(Path(path))
    axes = source.data.get("axes")
    if not isinstance(axes, dict) or not all(isinstance(group, dict) for group in axes.values()):
        raise InputError(f"{path}: no group axes; a fleet.yaml of feedsim history --machines is needed")
    result = {}
    for axis, group in axes.items():
        known: dict[str, tuple[float, float]] = {}
        for name, entry in group.items():
            where = f"{path}: axes.{axis}.{name}"
            if name not in PARAMETER_KINDS:
                raise InputError(f"{where}: no parameter of friction; there are {', '.join(PARAMETER_KINDS)}")
            if not isinstance(entry, dict) or not {"mean", "deviation"} <= set(entry):
                raise InputError(f"{where}: mean and deviation are needed")
            unit = PARAMETER_KINDS[name].unit
            try:
                mean, deviation = (amount(entry[key], unit, f"1 {unit}") for key in ("mean", "deviation"))
                PARAMETER_KINDS[name].check("the mean is", mean)
            except (InputError, TypeError, ValueError) as error:
                raise InputError(f"{where}: {error}") from None
            if not deviation > 0:
                raise InputError(f"{where}: deviation {entry['deviation']}; more than 0 is needed")
            if name not in ("M_0", "J", "delay"):  # of the single machine and its control, not of the kind
                known[name] = mean, deviation
        values = np.array([mean for mean, _ in known.values()])
        result[str(axis)] = Prior(tuple(known), values, np.diag([deviation**2 for _, deviation in known.values()]))
    return result


def constant_load_hint(identification: Identification) -> str:
    """How to set the constant load, which is no friction; empty where there is none beyond doubt."""
    load = identification.estimates.get("M_0")
    if load is None or load.status == "held" or not abs(load.value) > NORMAL_95 * np.nan_to_num(load.sigma):
        return ""
    key = f"machine.axes.{identification.axis}.constant_load"
    interval = f" (95 %: {interval_text(load)})" if interval_text(load) else ""
    text = f"constant load M_0 {value_text(load)} N.m{interval} is no part of the friction"
    lean = identification.estimates.get("asymmetry")
    if lean is not None and lean.status == "estimated" and abs(lean.value) > NORMAL_95 * lean.sigma:
        text += ", but goes with this asymmetry (either alone is wrong)"
    return f'{text}; set it with {key}="{load.value:.6g} N.m"'


def open_loop_line(identification: Identification) -> str:
    """What the position in open loop changed, in one line; empty where there is nothing to say: it was not asked for,
    or all records are of sines."""
    balance = identification.balance
    if balance is None or not balance.applies:
        return ""
    if not balance.applied:
        return f"not applied: {balance.reason}"
    before, after = (1e3 * identification.I_P * rms for rms in balance.position)
    parts = [f"position off by {after:.3g} mm rms instead of {before:.3g} mm"]
    words: dict[str, list[str]] = {}  # "F_C and F_S -1.2 %" and "M_0 +0.0034 N.m", of those that moved
    for name, (old, new) in balance.changes.items():
        if new != old:
            words.setdefault(f"{new - old:+.3g} N.m" if name == "M_0" else change_text(old, new), []).append(name)
    if words:
        parts.append(", ".join(f"{' and '.join(names)} {text}" for text, names in words.items()))
    parts.append(f"torque residual {change_text(*balance.torque)}")
    return "; ".join([*parts, *drift_texts(balance)])


def drift_texts(balance: Balance) -> list[str]:
    """How the constant load drifted, a clause for each record; none where the open loop was not applied."""
    rates = balance.load_rates if balance.applied else {}
    said = {
        record: "{:.2g} N.m/s (95 %: {:.2g} to {:.2g})".format(rate.value, *rate.interval)
        for record, rate in rates.items()
    }
    words = "a drift of M_0 is not determined, and not used:" if any(map(_open, rates.values())) else "M_0 drifts by"
    return [f"{words} {text}" + (f" in {record}" if len(said) > 1 else "") for record, text in said.items()]


def _open(rate: Estimate) -> bool:
    return rate.status == "undetermined"


def change_text(before: float, after: float) -> str:
    """Change in percent of what was before; empty where that says nothing."""
    if not (math.isfinite(after) and math.isfinite(before) and before > 0):
        return ""
    return f"{100 * (after / before - 1):+.2g} %"


def value_text(estimate: Estimate, factor: float = 1.0) -> str:
    """A value to two digits of its interval, five where there is none."""
    if not 0 < estimate.sigma < math.inf:
        return f"{factor * estimate.value:.5g}"
    return f"{factor * estimate.value:.{_places(estimate, factor)}f}"


def interval_text(estimate: Estimate, factor: float = 1.0) -> str:
    """ "1.597 to 1.603"; empty where there is no interval."""
    if not 0 < estimate.sigma < math.inf:
        return ""
    places = _places(estimate, factor)
    return " to ".join(f"{factor * end:.{places}f}" for end in estimate.interval)


def relative_text(estimate: Estimate) -> str:
    """Half the interval in percent of the value; empty where that says nothing."""
    if not 0 < estimate.sigma < math.inf or estimate.value == 0 or estimate.name in ("delay", "M_0", "asymmetry"):
        return ""
    share = 100 * NORMAL_95 * estimate.sigma / abs(estimate.value)
    return f"{share:.2g} %" if share < 100 else "over 100 %"


def remark_text(estimate: Estimate) -> str:
    """What to know of a value that was not simply estimated."""
    word = "" if estimate.status == "estimated" or estimate.reason.startswith(estimate.status) else estimate.status
    return ": ".join(part for part in (word, estimate.reason) if part)


def _places(estimate: Estimate, factor: float) -> int:
    """Decimal places that show two digits of half the interval."""
    half = abs(factor) * NORMAL_95 * estimate.sigma
    return min(12, max(0, 1 - math.floor(math.log10(half))))


def _line(estimate: Estimate) -> Line:
    interval, relative = interval_text(estimate), relative_text(estimate)
    spread = f"95 %: {interval}" + (f" (+-{relative})" if relative else "") if interval else ""
    return Line(estimate.value, "; ".join(part for part in (spread, remark_text(estimate)) if part))


def _head(identified: IdentifiedFriction, version: str) -> Sequence[str]:
    axis = identified.found.axis
    machine = f" of {identified.subject.machine.name}" if identified.subject is not None else ""
    lines = [
        f"Friction of axis {axis}{machine}, identified by feedsim {version} on {identified.date} from",
        *(f"  {name}" for name in identified.traces),
        *identified.notes,
        "Motor side. Behind a value its 95 % confidence interval, from the model linearised at the optimum.",
        f"To use: feedsim run SCENARIO.yaml --set machine.axes.{axis}.friction={FRICTION_FILE}",
    ]
    hint = constant_load_hint(identified.found)
    return [*lines, f"The {hint}"] if hint else lines


def _origin(identified: IdentifiedFriction, software: Mapping[str, str]) -> dict[str, Any]:
    """The group `identified`: where the values come from, for people and programs."""
    identification, subject = identified.found, identified.subject
    sources = zip(identified.traces, identified.sources, strict=True)
    content: dict[str, Any] = {
        "axis": identification.axis,
        "date": identified.date,
        "traces": [{"file": name, "sha256": source.sha256} for name, source in sources],
    }
    if subject is not None:
        content["machine"] = {"name": subject.machine.name, "note": subject.machine.note}
    if identified.settings:
        content["settings"] = dict(identified.settings)
    content["lead"] = _quantity(identification.I_P, "m/rad")
    named = {"M_0": "constant_load", "J": "inertia", "delay": "delay"}
    for name, key in named.items():
        if (estimate := identification.estimates.get(name)) is not None:
            content[key] = {"value": _quantity(estimate.value, estimate.unit), **_interval(estimate)}
    if identification.balance is not None and identification.balance.applied:
        drifts = [
            {"record": record, "value": _quantity(rate.value, rate.unit), **_interval(rate)}
            for record, rate in identification.balance.load_rates.items()
            if not _open(rate)
        ]
        if drifts:
            content["constant_load"]["drift"] = drifts
    if line := open_loop_line(identification):
        content["open_loop"] = line
    content["parameters"] = {
        name: _interval(estimate) for name, estimate in identification.estimates.items() if name not in named
    }
    if identification.correlation.names:
        matrix = [[round(float(value), 4) for value in row] for row in identification.correlation.matrix]
        content["correlation"] = {"names": list(identification.correlation.names), "matrix": matrix}
    if identified.warnings:
        content["warnings"] = [str(warning) for warning in identified.warnings]
    content["software"] = {name: software[name] for name in ("feedsim", "python", "numpy", "scipy")}
    return content


def _interval(estimate: Estimate) -> Mapping[str, Any]:
    content: dict[str, Any] = {"status": estimate.status}
    if all(math.isfinite(end) for end in estimate.interval):
        content["interval"] = [_quantity(end, estimate.unit) for end in estimate.interval]
    return content | ({"reason": estimate.reason} if estimate.reason else {})


def _quantity(value: float, unit: str) -> str | float:
    return float(f"{value:.{EXACT_DIGITS}g}") if unit == units.DIMENSIONLESS else f"{value:.{EXACT_DIGITS}g} {unit}"


def friction_text(
    parameters: Mapping[str, Line],
    identified: Mapping[str, Any],
    head: Sequence[str] = (),
    *,
    name: str,
    model: type[FrictionParameters] = Friction,
) -> str:
    """Content of a friction file.

    parameters: keys of `model`, SI values. identified: plain values (text, numbers, lists, groups), kept by readers
    and not calculated with. head: lines of the comment at the top. name: of the file, for messages. Raises OutputError:
    a value is outside its allowed range or not finite, a key is unknown or missing.
    """
    known = _units(model)
    law = {"law": GMS} if model is GmsFriction else {}
    if unknown := [key for key in parameters if key not in known]:
        raise OutputError(
            f"{name} is not written: {unknown[0]!r} is no friction parameter; there are {', '.join(known)}"
        )
    rounded = {key: float(f"{line.value:.{DIGITS}g}") for key, line in parameters.items()}
    try:
        model.model_validate({**law, **rounded, "identified": dict(identified)})
    except ValueError as error:  # pydantic's
        raise OutputError(f"{name} is not written: {_first_fault(error)}") from None
    lines = [f"# {line}".rstrip() for text in head for line in text.splitlines() or [""]]
    lines += [f"{key}: {value}" for key, value in law.items()]
    entries = [
        (f"{key}: {_number(rounded[key])} {known[key]}".removesuffix(" 1"), key) for key in known if key in rounded
    ]
    column = max(len(entry) for entry, _ in entries) + 3
    for entry, key in entries:
        remark = " ".join(parameters[key].remark.split())
        lines.append(f"{entry:<{column}}# {remark}" if remark else entry)
    if identified:
        content = {"identified": _plain_value(identified)}
        group: str = yaml.dump(content, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=FILE_COLUMNS)
        lines += ["", "# Where the values come from: kept and shown, not calculated with.", group.rstrip("\n")]
    return "\n".join(lines) + "\n"


class _Dumper(yaml.SafeDumper):
    """Lists of plain values in one line; text that YAML 1.2 takes for a number in quotes, as PyYAML knows 1.1 only."""


def _text(dumper: _Dumper, value: str) -> yaml.ScalarNode:
    style = "'" if re.fullmatch(units.NUMBER, value) else None
    return dumper.represent_scalar("tag:yaml.org,2002:str", value, style=style)


def _list(dumper: _Dumper, values: list[Any]) -> yaml.SequenceNode:
    plain = not any(isinstance(value, (list, dict)) for value in values)
    return dumper.represent_sequence("tag:yaml.org,2002:seq", values, flow_style=plain)


_Dumper.add_representer(str, _text)
_Dumper.add_representer(list, _list)


def _units(model: type[FrictionParameters]) -> dict[str, str]:
    """Name -> SI unit of every friction parameter, in the order of the file."""
    quantities = {name: Quantity.of(info) for name, info in model.model_fields.items()}
    return {name: quantity.unit for name, quantity in quantities.items() if quantity is not None}


def _number(value: float) -> str:
    """Shortest text of a number, without an exponent where that reads better."""
    if value == 0 or 1e-6 <= abs(value) < 1e9:
        places = 0 if value == 0 else max(0, DIGITS - 1 - math.floor(math.log10(abs(value))))
        text = f"{value:.{places}f}"
        return text.rstrip("0").rstrip(".") if "." in text else text
    return repr(value)


def _plain_value(value: Any) -> Any:
    """Values as YAML has them: numbers of Python, no tuples; what is not finite is left open."""
    if isinstance(value, Mapping):
        return {str(key): _plain_value(inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain_value(inner) for inner in value]
    if isinstance(value, bool) or value is None or isinstance(value, (str, int)):
        return value
    number = float(value)
    return number if math.isfinite(number) else None


def _first_fault(error: ValueError) -> str:
    details: list[Any] = getattr(error, "errors", list)()
    if not details:
        return str(error)
    place = ".".join(str(key) for key in details[0]["loc"])
    return f"{place}: {details[0]['msg']}"
