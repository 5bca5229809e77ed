"""feedsim frf: frequency responses in closed form and measured on the units."""

from __future__ import annotations

from argparse import ArgumentTypeError, BooleanOptionalAction, Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from feedsim.cli.options import FIGURES, FMUS, QUIET, Command, Group, Option, names, out, quantity, settings
from feedsim.cli.terminal import Progress, announce, finish, progress_bar, results_in

if TYPE_CHECKING:
    from feedsim.analysis.campaign import Plan
    from feedsim.analysis.responses import Overlay
    from feedsim.analysis.truncation import Truncation
    from feedsim.scenario import Machine

DESCRIPTION = """Frequency responses of a machine's feed drives: speed-controlled system n/M, reference frequency
response of the speed controller, position loop, loop gains with their margins, x/M, and the compliance at the tool. In
closed form and, friction off, measured on the units with a multisine or a binary sequence."""
REALISATIONS_WITH_FRICTION = 4
LOWEST, HIGHEST = 1.0, 1000.0  # Hz; the band where none is given
ONE_REALISATION = (
    "measured with friction and one realisation: every period is alike, so that the coherence says nothing of what is "
    "not linear; take more realisations"
)
UNSTABLE = (
    "the control loops are unstable: {} growing solution(s) of the closed system. The figures of loops presume stable "
    "ones, and nothing was measured"
)
EPILOG = """examples:
  feedsim example xz_circle
  feedsim frf machines/test_centre --axes X,Z --out results/frf
  feedsim frf xz_circle.yaml --set "machine.axes.Z.drive.K_p=4 N.m.s/rad" --no-measure
  feedsim frf machines/test_centre --axes Z --friction --offset-speed "5 rad/s" --realisations 4
  feedsim frf machines/test_centre --axes Z --overlay measured.csv:Z.n_a/Z.n_s
"""


def frf(options: Namespace) -> None:
    """Read, calculate, measure, write."""
    from feedsim.analysis import linear, responses, truncation
    from feedsim.analysis.campaign import run_campaign
    from feedsim.cosim.plant import plant_modes
    from feedsim.cosim.trust import control
    from feedsim.findings import severity
    from feedsim.linear.judgement import judge
    from feedsim.report import frf as report
    from feedsim.scenario import Coupling, load_subject
    from feedsim.structure.table_check import table_mismatch

    subject = load_subject(options.subject, options.overrides)
    machine = subject.machine
    axes = _axes(options.axes, machine)
    plan = _plan(options, machine)
    named = options.subject.stem if options.subject.is_file() else options.subject.resolve().name
    directory: Path = options.out or Path("results") / f"frf_{named}"
    modes, doubts = plant_modes(machine)
    frequency = responses.frequencies(machine, modes, plan.band, responses.BEYOND)
    wanted = linear.names(axes, tool=options.tool)
    overlays, warnings = _overlays(options.overlays, wanted)
    warnings += doubts
    inputs = [*(file for _, file in subject.files), *(overlay.file for overlay in overlays)]

    with (
        results_in(directory, report.check_writable, inputs, options.overrides),
        progress_bar(options.quiet, " cycles", shortened=True) as progress,
    ):
        progress("closed form", 0, 1)
        system = linear.LinearSystem(machine, modes)
        result = linear.evaluate(system, axes)
        closed = responses.closed_form(system, wanted, frequency)
        warnings += responses.zero_notes(closed)
        progress("closed form", 1, 1)
        if not doubts and (doubt := table_mismatch(machine)) is not None:
            warnings.append(doubt)
        told = control(machine, judge(machine, modes))
        if result.unstable_poles and not any(severity(each) == "wrong" for each in told):
            told.append(UNSTABLE.format(result.unstable_poles))
        warnings += told
        full = _full_model(machine, progress, warnings) if options.full_model else None
        campaign = None
        if not (options.no_measure or result.unstable_poles):
            announce(machine, options.fmus)
            coupling = subject.scenario.coupling if subject.scenario is not None else Coupling()
            campaign = run_campaign(
                machine, axes, plan, fmus=options.fmus, progress=progress, call_limit=coupling.call_limit
            )
        figures = linear.figures(result)
        if not options.tool:
            figures = {name: figure for name, figure in figures.items() if not name.startswith("tool.")}
        if full is not None:
            figures |= truncation.figures(full, tuple(machine.axes), frequency, shown=axes, tool=options.tool)
        if campaign is not None:
            figures |= responses.agreement(system, campaign)
            warnings += campaign.warnings
            if plan.friction and plan.realisations == 1:
                warnings.append(ONE_REALISATION)
        found = responses.Responses(
            machine=machine,
            modes=modes,
            axes=axes,
            band=plan.band,
            result=result,
            closed=closed,
            campaign=campaign,
            overlays=tuple(overlays),
            truncation=full,
            figures=figures,
            warnings=tuple(warnings),
        )
        report.write(subject, found, directory, drawn=options.figures)
    first, *further = report.answers(found)
    lines = [f"{subject.name}: {first}", *(f"  {line}" for line in further), f"-> {directory / 'report.html'}"]
    finish(options.quiet, warnings, *lines)


def _full_model(machine: Machine, progress: Progress, warnings: list[str]) -> Truncation | None:
    """The machine's structure with all its modes, where a structure is named; adds to the warnings why there is none.

    The comparison comes on top of what was asked for: where it cannot be had, the rest is still wanted.
    """
    from feedsim.analysis.truncation import truncation
    from feedsim.errors import FeedsimError
    from feedsim.scenario.structure.load import load_structure

    if machine.structure is None:
        return None
    progress("full model", 0, 1)
    found = None
    try:
        found = truncation(load_structure(machine.structure), machine.pose)
    except FeedsimError as error:
        warnings.append(f"no comparison with the full model: {error}")
    progress("full model", 1, 1)
    return found


def _names(text: str) -> tuple[str, ...]:
    if not (found := names(text)):
        raise ArgumentTypeError("names of axes are needed, such as X,Z")
    return found


def _axes(chosen: Sequence[str] | None, machine: Machine) -> tuple[str, ...]:
    """The axes asked for, in the machine's order."""
    from feedsim.errors import InputError

    for name in chosen or ():
        if name not in machine.axes:
            raise InputError(f"--axes {','.join(chosen or ())}: no axis {name!r}; there is {', '.join(machine.axes)}")
    return tuple(axis for axis in machine.axes if not chosen or axis in chosen)


def _plan(options: Namespace, machine: Machine) -> Plan:
    """What the options say about the measurement."""
    from feedsim.analysis.campaign import Plan
    from feedsim.analysis.responses import highest_frequency
    from feedsim.errors import InputError

    if options.band is None:
        band = (LOWEST, min(HIGHEST, highest_frequency(machine)))
    else:
        low, dots, high = options.band.partition("..")
        if not dots:
            raise InputError(f"--band {options.band}: LOW..HIGH is needed, such as 1Hz..1000Hz")
        band = (quantity("band", low, "Hz", "1 Hz"), quantity("band", high, "Hz", "1000 Hz"))
    realisations = options.realisations
    if realisations is None:
        realisations = REALISATIONS_WITH_FRICTION if options.friction else 1
    for name, number in (("periods", options.periods), ("realisations", realisations)):
        if number < 1:
            raise InputError(f"--{name} {number}: at least 1 is needed")
    unit, example = ("rad/s", "0.5 rad/s") if options.inject == "n_add" else ("N.m", "4 N.m")
    amplitude, speed = options.amplitude, options.offset_speed
    return Plan(
        signal=options.excitation,
        inject=options.inject,
        rms=None if amplitude is None else quantity("amplitude", amplitude, unit, example),
        band=band,
        periods=options.periods,
        settle=options.settle,
        realisations=realisations,
        seed=options.seed,
        friction=options.friction,
        offset_speed=None if speed is None else quantity("offset-speed", speed, "rad/s", "5 rad/s"),
        tool=options.tool,
    )


def _overlays(texts: Sequence[str], known: Sequence[str]) -> tuple[list[Overlay], list[str]]:
    from feedsim.analysis.responses import read_overlays

    overlays: list[Overlay] = []
    warnings: list[str] = []
    for text in texts:
        found, doubts = read_overlays(text, known)
        overlays += found
        warnings += doubts
    return overlays, warnings


COMMAND = Command(
    "frf",
    "frequency responses of the drives, in closed form and measured; Bode plots",
    frf,
    (
        Option("subject", "SCENARIO-or-MACHINE", "scenario file, machine file or machine folder", type=Path),
        out("frf_<name of the file>"), FIGURES,
        Option("--axes", "X,Z", "axes to look at (default: all)", type=_names),
        settings("machine.axes.Z.drive.K_p='4 N.m.s/rad'"),
        FMUS,
        Option("--band", "LOW..HIGH",
               "frequencies looked at (default: 1Hz..1000Hz, at most to half the sampling rate of the control cycle)"),
        Option("--tool", "", "with the compliance at the tool (default: yes)",
               action=BooleanOptionalAction, default=True),
        Option("--overlay", "FILE[:RESPONSE[=NAME]]",
               "lay a curve from a CSV or UFF58 file over, e.g. measured.csv:Z.n_a/Z.M_a; may be given several times",
               many=True, dest="overlays"),
        Option("--full-model", "",
               "where the machine names its structure: compare with all modes of the finite-element model "
               "(default: yes)", action=BooleanOptionalAction, default=True),
        QUIET,
        Group(
            "measurement on the units",
            Option("--no-measure", "", "closed form only"),
            Option("--excitation", "", "signal (default: multisine)",
                   choices=("multisine", "prbs"), default="multisine"),
            Option("--inject", "",
                   "where it is added: to the speed setpoint (finds n/M and n_a/n_s) or to the torque setpoint (finds "
                   "n/M); default: n_add", choices=("n_add", "M_add"), default="n_add"),
            Option("--amplitude", "VALUE",
                   "RMS of the signal, e.g. '0.5 rad/s' (default: 5 %% of the torque limit)"),
            Option("--periods", "N", "recorded periods (default: 2)", type=int, default=2),
            Option("--settle", "N", "periods ahead of those (default: 2)", type=int, default=2),
            Option("--realisations", "N",
                   "signals with other phases, averaged (default: 1, with friction 4: only between realisations does "
                   "the coherence see what is not linear)", type=int),
            Option("--seed", "N", "of the phases (default: 1)", type=int, default=1),
            Option("--friction", "", "with friction; the closed form knows none"),
            Option("--offset-speed", "VALUE", "motor speed at which the excited axis moves, e.g. '5 rad/s'"),
        ),
    ),
    DESCRIPTION,
    EPILOG,
)  # fmt: skip
