"""The report of an identified drive: the files that were made of it, summary.json, report.html and figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from feedsim.analysis import Figure
from feedsim.estimation.identify import AxisLimits, Provenance
from feedsim.estimation.identify.friction_file import interval_text, value_text
from feedsim.estimation.identify.read import recording_day, recording_temperature
from feedsim.estimation.identify.result import Estimate
from feedsim.estimation.least_squares import NORMAL_95
from feedsim.estimation.replay.compare import Comparison
from feedsim.estimation.replay.drive import DriveFound
from feedsim.estimation.replay.identified import DrivesFound
from feedsim.estimation.replay.machine_files import ElasticMode, drive_file, friction_file
from feedsim.estimation.replay.moving_lines import in_words
from feedsim.estimation.replay.tuning import ERROR_RATE, OtherCycle, decision
from feedsim.files.control import names_of
from feedsim.files.trace import Mark
from feedsim.foundation.arguments import spell_argument
from feedsim.foundation.errors import Finding
from feedsim.foundation.units import convert
from feedsim.report.changes import control_section, requested_control
from feedsim.report.content import (
    FOLDER,
    Paragraph,
    Report,
    Section,
    Step,
    Table,
    Text,
    Tile,
    code,
    figures_footer,
    figures_section,
    provenance_section,
    tile_value,
    with_remark,
)
from feedsim.report.formatting import display_unit, minus, powers, three_digits, typeset
from feedsim.report.provenance import finite, hash_files, inputs_part, quantity
from feedsim.report.replay import pictures_of
from feedsim.scenario import Drive, Friction, Machine, Subject
from feedsim.scenario.axis_units import ParameterGroup

# --- Identified values beside those of the machine file that was given, in the control's words too --------------------


NOTE = (
    "A value differs where the 95 % interval leaves out that of the machine file, and where both are more than 1 % "
    "apart. Then one of the two is not that of the machine: look at the control before you change it."
)
MIN_DIFFERENCE_SHARE = 0.01  # share by which a value differs
OF_THE_AXIS = {"M_0": "constant_load"}


@dataclass(frozen=True)
class ComparedParameter:
    """A parameter. present: of the machine file, SI. found: identified."""

    axis: str
    parameter: str
    present: float
    found: Estimate

    @property
    def differs(self) -> bool:
        """Whether the record speaks against the machine file."""
        low, high = self.found.interval
        apart = abs(self.found.value - self.present) > MIN_DIFFERENCE_SHARE * abs(self.present)
        return self.found.status == "estimated" and apart and not low <= self.present <= high


def compare_parameters(machine: Machine, estimates: Mapping[str, Mapping[str, Estimate]]) -> list[ComparedParameter]:
    """Parameters that the machine file has; estimates: axis -> name -> value."""
    result = []
    for axis, own in estimates.items():
        known = machine.axes[axis]
        for name, estimate in own.items():
            drive = known.drive if isinstance(known.drive, Drive) else None
            friction = known.friction if isinstance(known.friction, Friction) else None
            parameter, value = f"drive.{name}", getattr(drive, name, None)
            if value is None or isinstance(value, ParameterGroup):
                parameter, value = f"friction.{name}", getattr(friction, name, None)
            if name in OF_THE_AXIS:
                parameter, value = OF_THE_AXIS[name], getattr(known, OF_THE_AXIS[name])
            if isinstance(value, int | float) and not isinstance(value, bool):
                result.append(ComparedParameter(axis, parameter, float(value), estimate))
    return result


def comparison_section(machine: Machine, result: list[ComparedParameter]) -> Section | None:
    """All of them, in SI and in the control's words."""
    if not result:
        return None
    control = requested_control(machine)
    names = names_of(control) if control else {}
    rows: list[tuple[Text, ...]] = []
    for entry in result:
        name = names.get(entry.parameter)
        shown = "–"
        if name is not None:
            old, new = (minus(f"{name.shown(value):.5g}") for value in (entry.present, entry.found.value))
            doubt = "" if name.confirmed else " (unit not confirmed)"
            shown = f"{name.number} {name.name}: {old} | {new} {name.unit}{doubt}".rstrip()
        rows.append((
            entry.axis, code(entry.parameter.rpartition(".")[2]), minus(f"{entry.present:.5g}"),
            minus(powers(value_text(entry.found))), display_unit(entry.found.unit),
            minus(powers(interval_text(entry.found))), shown, "differs" if entry.differs else "",
        ))  # fmt: skip
    heads = ("Axis", "Parameter", "Machine file", "Identified", "SI unit", "95 % interval", "In the control", "")
    return Section("Beside the machine file", [Table("llrrlrtl", heads, rows, NOTE)], "beside")


def comparison_part(result: list[ComparedParameter]) -> list[dict[str, Any]]:
    """The same in summary.json, in SI."""
    return [
        {
            "axis": entry.axis,
            "parameter": entry.parameter,
            "machine_file": entry.present,
            "identified": entry.found.value,
            "unit": entry.found.unit,
            "status": entry.found.status,
            "differs": entry.differs,
        }
        for entry in result
    ]


def comparison_lines(machine: Machine, result: list[ComparedParameter]) -> list[str]:
    """Values that differ, a line each for the terminal."""
    control = requested_control(machine)
    names = names_of(control) if control else {}
    said = []
    for entry in result:
        if entry.differs:
            name = names.get(entry.parameter)
            words = f": {name.number} {name.shown(entry.present):.5g} -> {name.text(entry.found.value)}" if name else ""
            said.append(
                f"  differs: {entry.axis}.{entry.parameter} is {entry.present:.5g} {entry.found.unit} in the machine "
                f"file, {value_text(entry.found)} in the record{words}"
            )
    return said


MACHINE, MODES_FILE = "machine.yaml", "modes.csv"
LEADING_ERRORS = {"position_rms": "position error, rms", "torque_rms": "torque error, rms"}
FRICTION_PARTS = (
    "A part is taken where the record predicts stretches and kinds of its motion better with it that the fit has not "
    "seen (cross-validation): gain of the logarithm of the likelihood."
)


STRUCTURES = (
    "The fit is tried again with each of these: gain of the logarithm of the likelihood, and what it has to be for a "
    f"test that errs in {100 * ERROR_RATE:.0f} % of the records. Intervals include the values with a structure that is "
    "not taken."
)
LIMITS_TEXT = (
    "Least squares of the profile with seven phases of constant jerk on moves from rest to rest. A speed is a limit of "
    "the axis only where no lower one was programmed."
)
MODES_TEXT = (
    "Shapes are relative to the rigid motion. A mode stays where a fit to three quarters of the motion predicts the "
    "fourth one better with it."
)


@dataclass(frozen=True, eq=False)
class DriveReport:
    """What was identified, and what it rests on."""

    found: DrivesFound
    sources: Sequence[Provenance]
    subject: Subject | None
    name: str
    settings: Mapping[str, str]
    marks: Sequence[Mark]
    unread: Sequence[Finding] = ()  # notes on columns

    @property
    def exit_code(self) -> int:
        """0, or 1 where an axis that was asked for has no drive."""
        return int(bool(self.found.refused))

    @property
    def comparisons(self) -> Sequence[Comparison]:
        """Each axis with what was found, beside its record."""
        return self.found.comparisons

    @property
    def figures(self) -> dict[str, Figure]:
        """Of all axes."""
        return {name: figure for comparison in self.comparisons for name, figure in comparison.figures.items()}

    @property
    def notes(self) -> list[str]:
        """What the numbers are worth."""
        reported = self.subject.notes if self.subject is not None else ()
        return [note for note in dict.fromkeys((*reported, *(source.note for source in self.sources))) if note]

    @property
    def warnings(self) -> list[Finding]:
        """What a user should know."""
        result = [
            Finding("drive-not-identified", "wrong", f"axis {axis} has no drive: {reason}", axis)
            for axis, reason in self.found.refused.items()
        ]
        result += [warning for source in self.sources for warning in source.warnings]
        result += [*self.unread, *self.found.clipped]
        for axis, lines in self.found.outside.items():
            if lines:
                text = f"{in_words(axis, lines)}; it was taken out of what was fitted"
                result.append(Finding("lines-from-outside", "note", text, axis))
        for comparison in self.comparisons:
            if comparison.moving_lines:
                text = in_words(comparison.axis, comparison.moving_lines, moving=True)
                result.append(Finding("lines-while-moving", "note", text, comparison.axis))
        for axis, one in self.found.drives.items():
            open_ones = [name for name, estimate in one.estimates.items() if estimate.status == "undetermined"]
            if open_ones:
                result.append(Finding(
                    "parameter-undetermined", "note",
                    f"axis {axis}: the record does not determine {', '.join(open_ones)}; their values fit "
                    "together with the rest, and may be others",
                    ", ".join(f"{axis}.{name}" for name in open_ones),
                ))  # fmt: skip
            if one.other is not None:
                result.append(_position_cycle(axis, one, one.other, self.found.undecided_cycle))
        return list(dict.fromkeys(result))


def _position_cycle(axis: str, one: DriveFound, other: OtherCycle, undecided: bool) -> Finding:
    """What the record of an axis says of the cycle of the position loop."""
    own, option = 1e3 * one.machine.cycles.T_pos, spell_argument("position_cycle")
    cycles = f"position cycles of {own:g} ms (taken) and {1e3 * other.cycle:g} ms ({option})"
    decided = 0 if undecided else decision([other])
    if decided > 0:
        text = f"axis {axis}: of {cycles} the record speaks for the latter"
        return Finding("position-cycle-contradicted", "doubt", text, axis)
    if decided < 0:
        text = f"axis {axis}: of {cycles} the record speaks for the former"
        return Finding("position-cycle-confirmed", "note", text, axis)
    if not undecided:  # a cycle was given
        return Finding("position-cycle-open", "note", f"axis {axis}: {cycles} fit alike", axis)
    short, long = sorted((own, 1e3 * other.cycle))
    remedy = (
        f"Give {option} {short:g}ms if the drive closes the position loop (DSC), or {option} {long:g}ms if the "
        "control does"
    )
    return Finding("position-cycle-open", "note", f"axis {axis}: {cycles} fit alike. {remedy}", axis, remedy)


def head(record: Path, window: tuple[float, float] | None, day: str) -> list[str]:
    """Comment at the top of the files."""
    part = f", {window[0]:g} to {window[1]:g} s" if window is not None else ""
    return [f"Identified by feedsim identify drive from {record.name}{part}, {day}.",
            "Intervals hold 95 % as far as the model is that of the axis."]  # fmt: skip


def note(record: Path, modes: int | None = 0) -> str:
    """Of the machine that is written."""
    axes = "rigid" if modes == 0 else "rigid but for the modes in modes.csv"
    return f"Identified from {record.name}. Axes are {axes}; what the record does not show is assumed (see the files)."


def machine_of(report: DriveReport) -> Machine:
    """The machine with all axes that were identified."""
    drives = report.found.drives
    machine = next(iter(drives.values())).machine
    return machine.model_copy(update={"axes": {axis: one.machine.axes[axis] for axis, one in drives.items()}})


def _machine_of_replay(report: DriveReport) -> dict[str, Any]:
    """Arguments of a replay on what was identified: the folder is a machine, or has parts of one."""
    if report.subject is None:
        return {"machine": FOLDER, "set": None}
    parts = [
        f"machine.axes.{axis}.{part}={FOLDER}/{file}"
        for axis in report.found.drives
        for part, file in (("drive", drive_file(axis)), ("friction", friction_file(axis)))
        if file in report.found.files
    ]
    return {"set": [*report.subject.overrides, *parts]}


def report_of(report: DriveReport) -> Report:
    """Content of the report."""
    drawn = [picture for comparison in report.comparisons for picture in pictures_of(comparison, report.marks)]
    pictures = with_remark(drawn, f"{report.name}, identified from {report.sources[0].file.name}")
    drives = report.found.drives
    rows = [
        ("Record", report.sources[0].file.name),
        ("Runs of the units", str(sum(one.runs for one in drives.values()))),
        (
            "Simulated, without rests at the ends",
            ", ".join(f"{axis} {one.simulated[0]:.4g} to {one.simulated[1]:.4g} s" for axis, one in drives.items()),
        ),
    ]
    return Report(
        f"Drive of {', '.join(drives)}",
        f"identified from {report.sources[0].file.name}",
        warnings=report.warnings,
        notes=report.notes,
        answer=answers(report),
        next_step=Step(
            "Replay the record on it; another record in its place shows how far it holds",
            "replay",
            {"axes": ",".join(drives), **_machine_of_replay(report)},
        ),
        tiles=[
            *(
                Tile(_value(one.estimates[name]), f"{axis}: {name}, ± {_half(one.estimates[name])}", typeset(what))
                for axis, one in drives.items()
                for name, what in LEADING_PARAMETERS.items()
                if name in one.estimates and one.estimates[name].status == "estimated"
            ),
        ]
        + [
            Tile(tile_value(figure), f"{name.partition('.')[0]}: {LEADING_ERRORS[key]}", typeset(figure.meaning))
            for name, figure in report.figures.items()
            if (key := name.partition(".")[2]) in LEADING_ERRORS
        ],
        main=[
            *(
                [comparison_section(report.subject.machine, _compared_parameters(report))]
                if report.subject is not None
                else []
            ),
            *(_parameters(axis, one) for axis, one in drives.items()),
            *([_limits(report.found.limits)] if report.found.limits else []),
            *pictures,
            *(_parts(axis, one) for axis, one in drives.items() if one.parts),
            *(_structures(axis, one) for axis, one in drives.items() if one.rivals),
            *(_modes(axis, one) for axis, one in drives.items() if one.modes_predicted or one.modes),
            figures_section(report.figures),
            control_section(machine_of(report)),
        ],
        provenance=provenance_section(rows, hash_files(_files(report))),
        footer=figures_footer(
            f"Values in full precision: summary.json; what machines take: {', '.join(report.found.files)}.",
            "docs/replay.md",
        ),
    )


def _compared_parameters(report: DriveReport) -> list[ComparedParameter]:
    """Identified values beside those of the machine that was given."""
    if report.subject is None:
        return []
    return compare_parameters(
        report.subject.machine, {axis: one.estimates for axis, one in report.found.drives.items()}
    )


def _parameters(axis: str, one: DriveFound) -> Section:
    rows: list[tuple[Text, ...]] = []
    for name, estimate in one.estimates.items():
        interval = minus(powers(interval_text(estimate)))
        remark: str = estimate.status if estimate.status != "estimated" else ""
        if estimate.reason:
            remark = f"{remark}: {estimate.reason}"
        rows.append(
            (
                code(name),
                typeset(estimate.meaning),
                minus(powers(value_text(estimate))),
                display_unit(estimate.unit),
                interval,
                remark,
            )
        )
    heads = ("Parameter", "Meaning", "Value", "SI unit", "95 % interval", "Remark")
    return Section(f"Axis {axis}", [Table("ltrlrt", heads, rows)])


def _limits(limits: Mapping[str, AxisLimits]) -> Section:
    """What the control keeps, by the setpoints of moves from rest to rest."""
    rows = [
        (axis, *("-" if value is None else f"{value:.4g}" for value in (own.acceleration, own.jerk, own.speed)),
         own.words)
        for axis, own in limits.items()
    ]  # fmt: skip
    heads = ("Axis", "Acceleration [m/s²]", "Jerk [m/s³]", "Speed [m/s]", "From the setpoints of")
    return Section("Limits of the axes", [Paragraph(LIMITS_TEXT), Table("lrrrl", heads, rows)])


def _parts(axis: str, one: DriveFound) -> Section:
    rows = [
        (
            part,
            "not credible" if gain == -float("inf") else minus(f"{gain:+.1f}"),
            "taken" if part in one.chosen else "",
        )
        for part, gain in one.parts.items()
    ]
    table = Table("lrl", ("Part of the friction law", "Gain", ""), rows)
    return Section(f"What the friction of {axis} needs", [Paragraph(FRICTION_PARTS), table])


def _structures(axis: str, one: DriveFound) -> Section:
    rows = [
        (rival.name, minus(f"{rival.gain:+.1f}"), f"{rival.least:.1f}", "taken" if rival.taken else "")
        for rival in one.rivals
    ]
    heads = ("Structure of the drive", "Gain", "Needed", "")
    return Section(f"What else the drive of {axis} may have", [Paragraph(STRUCTURES), Table("lrrl", heads, rows)])


def _at_others(mode: ElasticMode) -> list[str]:
    """What a mode does at the scales of other axes, over the rigid motion of its own."""
    return [f"{entry.axis} {entry.shape:.2g} (+-{NORMAL_95 * entry.sigma:.2g})" for entry in mode.beside]


def _modes(axis: str, one: DriveFound) -> Section:
    half = [tuple(NORMAL_95 * sigma for sigma in mode.sigma) for mode in one.modes]
    rows = [
        (f"{mode.frequency:.4g} ± {wide[0]:.2g}", f"{100 * mode.damping:.3g} ± {100 * wide[1]:.2g}",
         f"{mode.motor:.3g} ± {wide[2]:.2g}", minus(f"{mode.scale:.3g}") + f" ± {wide[3]:.2g}")
        for mode, wide in zip(one.modes, half, strict=True)
    ]  # fmt: skip
    heads = ("Frequency [Hz]", "Damping [%]", "Shape at the motor [1]", "Shape at the scale [1]")
    parts: list[Paragraph | Table] = [Paragraph(MODES_TEXT)]
    if rows:
        parts.append(Table("rrrr", heads, rows))
    parts += [
        Paragraph(minus(f"The mode at {mode.frequency:.4g} Hz moves the scale of {', '.join(_at_others(mode))}."))
        for mode in one.modes
        if mode.beside
    ]
    if one.modes_predicted:
        remaining = [(str(count), f"{1e6 * value:.3g}") for count, value in one.modes_predicted.items()]
        parts.append(Table("rr", ("Modes", "Position left of unseen quarters [µm]"), remaining))
    return Section(f"Elastic modes of {axis}", parts)


def _files(report: DriveReport) -> list[tuple[str, Path]]:
    result = [("record", source.file) for source in report.sources]
    result += [("mapping", source.mapping) for source in report.sources if source.mapping is not None]
    return [*result, *(report.subject.files if report.subject is not None else ())]


def details(report: DriveReport) -> dict[str, Any]:
    """What summary.json has besides the figures."""
    return {
        "recorded": recording_day(report.sources),
        "temperature": quantity(recording_temperature(report.sources), "degC"),
        "settings": dict(report.settings),
        "axes": {
            axis: {
                "parameters": {
                    name: {
                        "value": estimate.value,
                        "unit": estimate.unit,
                        "sigma": finite(estimate.sigma),
                        "status": estimate.status,
                        "reason": estimate.reason,
                    }
                    for name, estimate in one.estimates.items()
                },
                "parts": {
                    part: {"gain": finite(gain), "taken": part in one.chosen} for part, gain in one.parts.items()
                },
                "structures": {
                    rival.name: {"gain": rival.gain, "needed": rival.least, "taken": rival.taken}
                    for rival in one.rivals
                },
                "predicted": {
                    "position": {"value": one.predicted[0], "unit": "m"},
                    "torque": {"value": finite(one.predicted[1]), "unit": "N.m"},
                },
                "position_cycle": {"value": one.machine.cycles.T_pos, "unit": "s"},
                "modes": [
                    {
                        "frequency": mode.frequency,
                        "damping": mode.damping,
                        "motor": mode.motor,
                        "scale": mode.scale,
                        "sigma": [finite(sigma) for sigma in mode.sigma],
                        **(
                            {
                                "other_axes": {
                                    other.axis: {"shape": other.shape, "sigma": other.sigma} for other in mode.beside
                                }
                            }
                            if mode.beside
                            else {}
                        ),
                    }
                    for mode in one.modes
                ],
                "modes_predicted": {str(count): value for count, value in one.modes_predicted.items()},
                "limits": _limits_part(report.found.limits.get(axis)),
                "runs": one.runs,
                "simulated": {"from": one.simulated[0], "to": one.simulated[1], "unit": "s"},
            }
            for axis, one in report.found.drives.items()
        },
        **({"refused": dict(report.found.refused)} if report.found.refused else {}),
        **(
            {"beside_the_machine_file": comparison_part(_compared_parameters(report))}
            if report.subject is not None
            else {}
        ),
        "inputs": inputs_part(hash_files(_files(report))),
    }


def _limits_part(limits: AxisLimits | None) -> dict[str, Any] | None:
    """Limits of an axis in summary.json; None where no move shows them."""
    if limits is None:
        return None
    return {
        "acceleration": {"value": limits.acceleration, "unit": "m/s^2"},
        "jerk": {"value": limits.jerk, "unit": "m/s^3"},
        "speed": {"value": limits.speed, "unit": "m/s"},
        "moves": len(limits.moves),
        "largest_residual": {"value": max(move.largest for move in limits.moves), "unit": "m"},
    }


# What is named first of a drive, as far as a record determines it.
LEADING_PARAMETERS = {
    "K_v": "gain of the position loop", "T_sym": "symmetry filter", "F_C": "Coulomb friction", "J": "inertia",
}  # fmt: skip


def _value(estimate: Estimate) -> str:
    """To three digits, in the unit that people type."""
    unit = {"1/s": "(m/min)/mm", "s": "ms"}.get(estimate.unit, estimate.unit)
    return f"{three_digits(convert(estimate.value, estimate.unit, unit))} {unit}"


def _half(estimate: Estimate) -> str:
    """Half of the interval of 95 %, as a share of the value."""
    share = 100 * NORMAL_95 * estimate.sigma / abs(estimate.value) if estimate.value else float("inf")
    return "<0.1 %" if share < 0.1 else f"{share:.2g} %"


def answers(report: DriveReport) -> list[str]:
    """How near what was found comes to the record, how far it is to be trusted, and what to do next."""
    lines = []
    for comparison in report.comparisons:
        one = report.found.drives[comparison.axis]
        own = {name.partition(".")[2]: figure for name, figure in comparison.figures.items()}
        torque = f", its torque to {own['torque_rms']}" if "torque_rms" in own else ""
        known = [one.estimates[name] for name in LEADING_PARAMETERS if name in one.estimates]
        known = [estimate for estimate in known if estimate.status == "estimated"]
        values = ", ".join(f"{estimate.name} {_value(estimate)} +-{_half(estimate)}" for estimate in known)
        count = sum(estimate.status == "estimated" for estimate in one.estimates.values())
        lines.append(
            f"{comparison.axis}: {values or 'no value of the drive is determined'} (of {count} that the record "
            f"determines). It meets the position to {own['position_rms']} rms ({own['share_of_lag']} of the lag)"
            f"{torque}, to {1e6 * one.predicted[0]:.3g} um in cross-validation (4 parts)."
        )
    lines.append("Replay another record on it before trusting it with other motion.")
    return lines


def summary_lines(report: DriveReport) -> list[str]:
    """For the terminal: parameters with intervals, and what is left, by axis."""
    lines = []
    for comparison in report.comparisons:
        one = report.found.drives[comparison.axis]
        lines.append(f"  axis {comparison.axis}")
        for name, estimate in one.estimates.items():
            interval = f"{interval_text(estimate)}" if estimate.status == "estimated" else estimate.status
            lines.append(f"    {name:<10} {value_text(estimate):>12} {estimate.unit:<10} {interval}")
        if (setpoints := report.found.limits.get(comparison.axis)) is not None:
            values = ((setpoints.acceleration, "m/s^2"), (setpoints.jerk, "m/s^3"), (setpoints.speed, "m/s"))
            reached = ", ".join(f"{value:.4g} {unit}" for value, unit in values if value is not None)
            lines.append(f"    limits of the setpoints: {reached} ({setpoints.words})")
        own = {name.partition(".")[2]: figure for name, figure in comparison.figures.items()}
        torque = f", torque {own['torque_rms']} rms" if "torque_rms" in own else ""
        unseen = f", torque {one.predicted[1]:.3g} N.m" if torque else ""
        lines.append(
            f"    residual while it moves: position {own['position_rms']} rms{torque}; in cross-validation (4 parts) "
            f"position {1e6 * one.predicted[0]:.3g} um{unseen}"
        )
        lines += [
            f"    mode at {mode.frequency:.4g} Hz (+-{NORMAL_95 * mode.sigma[0]:.2g}), "
            f"damping {100 * mode.damping:.2g} %, motor {mode.motor:.2g}, scale {mode.scale:.2g} of the rigid motion"
            f"{''.join(f', scale of {at_other}' for at_other in _at_others(mode))}"
            for mode in one.modes
        ]
    return [
        *lines,
        *(comparison_lines(report.subject.machine, _compared_parameters(report)) if report.subject is not None else ()),
    ]
