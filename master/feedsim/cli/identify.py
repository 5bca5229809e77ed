"""feedsim identify: friction parameters from recorded traces."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import date
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

from feedsim.cli.options import FIGURES, FMUS, Command, Group, Option, amount, by_name, names, out, quantity
from feedsim.cli.terminal import announce_archive, finish, progress_bar, results_in

if TYPE_CHECKING:
    from feedsim.identify import Asked
    from feedsim.scenario import Subject

DESCRIPTION = """Friction parameters of an axis from recorded traces: the Stribeck curve from stretches at constant
speed, pre-sliding from moves that reverse, with confidence intervals. Leaves friction.yaml, which scenarios and machine
files take as it is, a report with figures, and what the figures show as CSV."""
EPILOG = """examples:
  feedsim example identify_z_constant identify_z_sine xz_circle
  feedsim run identify_z_constant.yaml && feedsim run identify_z_sine.yaml
  feedsim identify results/identify_z_constant/log.csv results/identify_z_sine/log.csv --axis Z \\
      --machine machines/test_centre
  feedsim identify record.mat --columns record.yaml --delay 0
  feedsim identify z.csv --axis Z --machine my_machine --hold "beta=1" --free v_log
  feedsim run xz_circle.yaml --set machine.axes.Z.friction=results/identify_z/friction.yaml --out results/own
"""
ESTIMATE = "estimate"  # of --inertia and --delay: whatever mapping and machine say


def identify(options: Namespace) -> None:
    """Read, identify, write."""
    from feedsim.cosim.friction_law import FrictionLaw
    from feedsim.files.columns import load_columns
    from feedsim.identify import Identified, named_apart, read_traces
    from feedsim.identify import identify as identified_from
    from feedsim.report import identify as report
    from feedsim.scenario import load_subject

    what = _asked(options)
    subject = load_subject(options.machine) if options.machine is not None else None
    machine = subject.machine if subject is not None else None
    mapping = load_columns(options.columns) if options.columns is not None else None
    with progress_bar(options.quiet) as progress:
        begin = perf_counter()
        recorded = read_traces(options.traces, mapping, options.axis, machine, progress)
        reading = {"reading": perf_counter() - begin}
        sources = tuple(each.provenance for each in recorded)
        known = what.with_traces(sources, machine)
        directory: Path = options.out or Path("results") / f"identify_{known.axis.lower()}"
        records = named_apart(recorded)
        asked = [f"{name}={value}" for name, value in _settings(options).items()]
        with results_in(directory, report.check_writable, _inputs(options, subject), asked):
            announce_archive(options.fmus and options.fmus / "friction.fmu", "friction law")
            with FrictionLaw(options.fmus) as law:
                found = identified_from(records, law, known, progress)
            found = replace(found, seconds=reading | dict(found.seconds))
            identified = Identified(found, records, sources, subject, _settings(options), date.today().isoformat())
            report.write(identified, directory, drawn=options.figures)
    # Without the table, all warnings: it holds the reasons that some only repeat.
    warnings = identified.warnings if options.quiet else report.terminal_warnings(identified)
    finish(options.quiet, warnings, *report.terminal_lines(identified, directory))


def _inputs(options: Namespace, subject: Subject | None) -> list[Path]:
    """Files that are read."""
    files = [*options.traces]
    files += [options.columns] if options.columns is not None else []
    return files + [file for _, file in subject.files] if subject is not None else files


def _asked(options: Namespace) -> Asked:
    """What the options say of the axis, as values."""
    from feedsim.identify import STAGES, Asked

    inertia = mass = delay = None
    if options.mass is not None:
        mass = quantity("mass", options.mass, "kg")
    elif options.inertia not in (None, ESTIMATE):
        inertia = quantity("inertia", options.inertia, "kg.m^2")
    if options.delay not in (None, ESTIMATE):
        # A plain 0 needs no unit.
        delay = 0.0 if options.delay.strip() in ("0", "0.0") else quantity("delay", options.delay, "s")
    return Asked(
        axis=options.axis,
        inertia=inertia,
        mass=mass,
        mass_reason=f"--mass {options.mass}",
        delay=delay,
        estimated=tuple(name for name in ("inertia", "delay") if getattr(options, name) == ESTIMATE),
        hold=_hold(options.hold),
        free=tuple(name for text in options.free for name in names(text)),
        stages=STAGES if options.stages == "both" else (int(options.stages),),
    )


def _hold(texts: Sequence[str]) -> dict[str, float]:
    from feedsim.errors import InputError
    from feedsim.identify.parameters import KINDS

    known = [name for name in KINDS if name not in ("J", "delay")]

    def value_of(name: str, text: str) -> float:
        if name not in known:
            raise InputError(f"no parameter {name!r}; there are {', '.join(known)}")
        return amount(text, KINDS[name].unit)

    parts = [part for whole in texts for part in names(whole)]
    return by_name("hold", parts, "NAME=VALUE is needed, for example beta=1 or v_log='3 rad/s'", value_of)


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


COMMAND = Command(
    "identify",
    "friction parameters from recorded traces, with uncertainties; friction.yaml and a report",
    identify,
    (
        Option("traces", "TRACE", "CSV or MAT file (docs/traces.md)", type=Path, nargs="+"),
        Option("--axis", "NAME", "axis that is identified (default: the only one)"),
        Option("--machine", "MACHINE-or-SCENARIO",
               "gives pitch, torque constant and inertia of the axis, and values for what the traces do not tell",
               type=Path),
        Option("--columns", "MAPPING.yaml", "which columns of the traces are what (docs/traces.md)", type=Path),
        out("identify_<axis>, in small letters"), FIGURES,
        Group(
            "what is known",
            Group(
                "",
                Option("--inertia", "VALUE",
                       "all that the motor accelerates, e.g. '0.0164 kg.m^2', or 'estimate' (default: of the mapping, "
                       "else of the machine's modes, else estimated)"),
                Option("--mass", "VALUE", "the same at the slide, e.g. '1600 kg'"),
            ),
            Option("--delay", "VALUE",
                   "by how much the torque is logged later than the motion, e.g. '0.5 ms' or 0, or 'estimate' "
                   "(default: of the mapping, else estimated)"),
            Option("--hold", "NAME=VALUE,...", "parameters that keep a value, e.g. beta=1", many=True),
            Option("--free", "NAME,...", "parameters that are else held: beta, v_log", many=True),
            Option("--stages", "", "1: Stribeck curve, 2: pre-sliding (default: both)",
                   choices=("1", "2", "both"), default="both"),
        ),
        FMUS,
        Option("--quiet", "", "no progress bar and no table"),
    ),
    DESCRIPTION,
    EPILOG,
)  # fmt: skip
