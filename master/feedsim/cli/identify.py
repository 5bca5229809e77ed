"""feedsim identify: friction parameters from recorded traces."""

from __future__ import annotations

import argparse
import shlex
import sys
from argparse import Namespace
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import date
from math import nan, pi
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

from feedsim.cli.options import add_fmus
from feedsim.cli.progress import Progress, progress_bar

if TYPE_CHECKING:
    from feedsim.identify import Options
    from feedsim.identify.read import Provenance, Recorded
    from feedsim.identify.result import Estimate
    from feedsim.scenario import Subject

DESCRIPTION = """Friction parameters of an axis from recorded traces: the Stribeck curve from stretches at constant
speed, pre-sliding from moves that reverse, with confidence intervals. Leaves friction.yaml, which scenarios and machine
files take as it is, a report with figures, and what the figures show as CSV."""
EPILOG = """examples:
  feedsim identify results/identify_z_constant/log.csv results/identify_z_sine/log.csv --axis Z \\
      --machine scenarios/machines/test_centre
  feedsim identify record.mat --columns record.yaml --delay 0
  feedsim identify z.csv --axis Z --machine my_machine --hold "beta=1" --free v_log
  feedsim run scenarios/xz_circle.yaml --set machine.axes.Z.friction=results/identify_z/friction.yaml
"""


def add_command(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add ``identify`` to the commands."""
    command = subparsers.add_parser(
        "identify",
        help="friction parameters from recorded traces, with uncertainties; friction.yaml and a report",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    command.add_argument("traces", type=Path, nargs="+", metavar="TRACE", help="CSV or MAT file (docs/traces.md)")
    command.add_argument("--axis", metavar="NAME", help="axis that is identified (default: the only one)")
    command.add_argument(
        "--machine",
        type=Path,
        metavar="MACHINE-or-SCENARIO",
        help="gives pitch, torque constant and inertia of the axis, and values for what the traces do not tell",
    )
    command.add_argument(
        "--columns", type=Path, metavar="MAPPING.yaml", help="which columns of the traces are what (docs/traces.md)"
    )
    command.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="where the results go (default: results/identify_<axis>, in small letters)",
    )
    known = command.add_argument_group("what is known")
    load = known.add_mutually_exclusive_group()
    load.add_argument(
        "--inertia",
        metavar="VALUE",
        help="all that the motor accelerates, e.g. '0.0164 kg.m^2', or 'estimate' (default: of the mapping, else of "
        "the machine's modes, else estimated)",
    )
    load.add_argument("--mass", metavar="VALUE", help="the same at the slide, e.g. '1600 kg'")
    known.add_argument(
        "--delay",
        metavar="VALUE",
        help="by how much the torque is logged later than the motion, e.g. '0.5 ms' or 0, or 'estimate' (default: of "
        "the mapping, else estimated)",
    )
    known.add_argument(
        "--hold",
        action="append",
        default=[],
        metavar="NAME=VALUE,...",
        help="parameters that keep a value, e.g. beta=1",
    )
    known.add_argument(
        "--free", action="append", default=[], metavar="NAME,...", help="parameters that are else held: beta, v_log"
    )
    known.add_argument(
        "--stages", choices=("1", "2", "both"), default="both", help="1: Stribeck curve, 2: pre-sliding (default: both)"
    )
    add_fmus(command)
    command.add_argument("--quiet", action="store_true", help="no progress bar and no table")
    command.set_defaults(action=identify)


def identify(options: Namespace) -> None:
    """Read, identify, write."""
    from feedsim import report
    from feedsim.cosim.friction_law import FrictionLaw
    from feedsim.identify import Identified
    from feedsim.identify import identify as identified_from
    from feedsim.identify.friction_file import FRICTION, constant_load_hint, open_loop_line
    from feedsim.identify.read import named_apart
    from feedsim.scenario import load_subject

    subject = load_subject(options.machine) if options.machine is not None else None
    with progress_bar(options.quiet) as progress:
        begin = perf_counter()
        recorded = _read(options, subject, progress)
        reading = {"reading": perf_counter() - begin}
        sources = [each.provenance for each in recorded]
        axis = _axis(options, sources)
        directory: Path = options.out or Path("results") / f"identify_{axis.lower()}"
        report.check_identification_writable(directory, _inputs(options, subject))
        records = named_apart(recorded)
        with FrictionLaw(options.fmus) as law:
            known = _options(options, axis, sources, subject)
            found = identified_from(records, law, known, progress, free_axis=law.free_axis)
    found = replace(found, seconds=reading | dict(found.seconds))
    identified = Identified(found, records, tuple(sources), subject, _settings(options), date.today().isoformat())
    report.write_identification(identified, directory)
    # Without the table, all of them: it holds the reasons that some only repeat.
    for warning in identified.warnings if options.quiet else report.identification_warnings(identified):
        print(f"feedsim: warning: {warning}", file=sys.stderr)
    if not options.quiet:
        print(f"axis {axis}: {report.identification_headline(identified)} -> {directory / 'report.html'}")
        print("\n".join(report.identification_table(identified)))
        if line := open_loop_line(found):
            print(f"  open loop: {line}")
        if line := report.rigid_line(identified):
            print(f"  {line}")
        for advice in found.advice:
            print(f"  advice: {advice}")
        if hint := constant_load_hint(found):
            print(f"  {hint}")
        setting = shlex.quote(f"machine.axes.{axis}.friction={directory / FRICTION}")
        print(f"  use: feedsim run SCENARIO.yaml --set {setting}")


def _read(options: Namespace, subject: Subject | None, progress: Progress) -> list[Recorded]:
    from feedsim.identify.read import read_records
    from feedsim.scenario import load_columns

    mapping = load_columns(options.columns) if options.columns is not None else None
    machine = subject.machine if subject is not None else None
    recorded = []
    for k, trace in enumerate(options.traces):
        progress("reading", k, len(options.traces))
        recorded.append(read_records(trace, mapping, options.axis, machine))
    progress("reading", len(options.traces), len(options.traces))
    return recorded


def _inputs(options: Namespace, subject: Subject | None) -> list[Path]:
    """Files that are read."""
    files = [*options.traces]
    files += [options.columns] if options.columns is not None else []
    return files + [file for _, file in subject.files] if subject is not None else files


def _axis(options: Namespace, sources: Sequence[Provenance]) -> str:
    from feedsim.errors import InputError

    named = {source.axis: source.file for source in sources if source.axis}
    if options.axis:
        named.setdefault(options.axis, Path("--axis"))
    if len(named) > 1:
        which = ", ".join(f"{axis} ({file})" for axis, file in named.items())
        raise InputError(f"the traces are of several axes: {which}; --axis names one, and its traces are needed")
    if not named:
        raise InputError("the traces do not tell which axis they are of; give --axis, for example --axis Z")
    return next(iter(named))


def _options(options: Namespace, axis: str, sources: Sequence[Provenance], subject: Subject | None) -> Options:
    """What the command line, the mapping and the machine say, in this order."""
    from feedsim.errors import InputError
    from feedsim.identify import STAGES, Options
    from feedsim.structure.modes import checked_modes

    pitches = {source.pitch: source.file for source in sources if source.pitch is not None}
    if len(pitches) > 1:
        which = ", ".join(f"{1e3 * pitch:.9g} mm ({file})" for pitch, file in pitches.items())
        raise InputError(f"the traces have different pitches: {which}")
    if not pitches:
        raise InputError(
            "the pitch of the axis is needed, for values at the slide: give --machine, or pitch: 20 mm in --columns"
        )
    I_P = next(iter(pitches)) / (2 * pi)
    J = _given_inertia(options, I_P, sources)
    modes = None
    if J is None and options.inertia is None and subject is not None and axis in subject.machine.axes:
        modes = checked_modes(subject.machine)
        reason = f"J_tot of the modes of {subject.machine.name}, whose flexibility is taken off the torque"
        J = _given("J", modes.J_tot(axis), reason)
    return Options(
        axis=axis,
        I_P=I_P,
        J=J,
        modes=modes,
        delay=_delay(options.delay, sources),
        hold=_hold(options.hold),
        free=tuple(name for text in options.free for name in _names(text)),
        fallback=_fallback(axis, subject),
        stages=STAGES if options.stages == "both" else (int(options.stages),),
    )


def _given_inertia(options: Namespace, I_P: float, sources: Sequence[Provenance]) -> Estimate | None:
    """What the command line or else the mapping says; None: neither, or it is to be estimated."""
    if options.mass is not None:
        return _given("J", _quantity("mass", options.mass, "kg") * I_P**2, f"--mass {options.mass}")
    if options.inertia is not None:
        known = options.inertia != "estimate"
        return _given("J", _quantity("inertia", options.inertia, "kg.m^2"), "as given") if known else None
    of_mapping = [source.inertia for source in sources if source.inertia is not None]
    return _given("J", of_mapping[0], "of the mapping") if of_mapping else None


def _given(name: str, value: float, reason: str) -> Estimate:
    from feedsim.identify.parameters import KINDS
    from feedsim.identify.result import Estimate

    kind = KINDS[name]
    return Estimate(name, value, kind.unit, kind.meaning, nan, "given", reason)


def _delay(text: str | None, sources: Sequence[Provenance]) -> float | None:
    if text is None:
        delays = {source.torque_delay for source in sources}
        return delays.pop() if len(delays) == 1 else None
    if text == "estimate":
        return None
    if text.strip() in ("0", "0.0"):
        return 0.0
    return _quantity("delay", text, "s")


def _hold(texts: Sequence[str]) -> dict[str, float]:
    from feedsim.errors import InputError
    from feedsim.identify.parameters import KINDS

    held: dict[str, float] = {}
    for text in (part for whole in texts for part in _names(whole)):
        name, equals, value = text.partition("=")
        if not equals:
            raise InputError(f"--hold {text}: NAME=VALUE is needed, for example beta=1 or v_log='3 rad/s'")
        if name not in KINDS or name in ("J", "delay"):
            known = ", ".join(name for name in KINDS if name not in ("J", "delay"))
            raise InputError(f"--hold {text}: no parameter {name!r}; there are {known}")
        if name in held:
            raise InputError(f"--hold {text}: {name} is given twice; a parameter keeps one value")
        held[name] = _quantity("hold", value, KINDS[name].unit, whole=text)
    return held


def _names(text: str) -> list[str]:
    return [part.strip() for part in text.split(",") if part.strip()]


def _quantity(option: str, text: str, unit: str, whole: str = "") -> float:
    from feedsim import units
    from feedsim.errors import InputError

    try:
        return units.parse(text, unit)
    except InputError as error:
        raise InputError(f"--{option} {whole or text}: {error}") from None


def _fallback(axis: str, subject: Subject | None) -> dict[str, float]:
    """The friction that the machine file has: for parameters that the traces do not tell."""
    if subject is None or axis not in subject.machine.axes:
        return {}
    return {name: float(value) for name, value in subject.machine.axes[axis].friction.parameters().items()}


def _settings(options: Namespace) -> Mapping[str, str]:
    """What was asked for, by option, without paths."""
    given = {
        "inertia": options.inertia,
        "mass": options.mass,
        "delay": options.delay,
        "hold": ",".join(options.hold),
        "free": ",".join(options.free),
        "stages": "" if options.stages == "both" else options.stages,
    }
    return {name: value for name, value in given.items() if value}
