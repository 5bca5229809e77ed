"""feedsim identify-modes: elastic modes of an axis from measured responses."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from feedsim.cli.options import FIGURES, QUIET, Command, Option, out, quantity, settings
from feedsim.cli.terminal import finish, progress_bar, results_in

DESCRIPTION = """Elastic modes of an axis from a measured response: time signals (--input, --motor) or a file of
frequency responses (--motor). Rigid motion, delays and modes, whose number cross-validation decides; written as the
machine's table of modes, beside the measured lines and the machine's own response."""
EPILOG = """examples:
  feedsim example test_centre
  feedsim identify-modes bench.mat --machine machines/test_centre --axis X --input iq_adx:A --motor theta_mx:rad \\
    --scale theta_my:rad --interval 0.4ms
  feedsim identify-modes responses.uff --machine machines/test_centre --axis Z --motor "n/M:(rad/s)/(N.m)" --modes 2
"""


def identify_modes(options: Namespace) -> None:
    """Read, estimate, fit, write."""
    from feedsim.errors import InputError
    from feedsim.fields import no_axis
    from feedsim.modal.identified import identify_modes as identify
    from feedsim.modal.measured import Channel, from_responses, from_signals
    from feedsim.report.modal import report
    from feedsim.scenario import load_subject
    from feedsim.structure import checked_modes
    from feedsim.trace.response_files import read_response

    subject = load_subject(options.machine, options.overrides)
    machine = subject.machine
    axis = options.axis or next(iter(machine.axes))
    if axis not in machine.axes:
        raise InputError(f"--axis {axis}: {no_axis(axis, machine.axes)}")
    motor = options.motor
    if motor is None:
        if options.input is not None:
            raise InputError("--input without --motor: which signal is the motor's? For example --motor n_act:rpm")
        if len(names := read_response(options.response).names) != 1:
            raise InputError(f"{options.response}: which response is the motor's? --motor NAME; there is {names}")
        motor = names[0]
    outputs = {"motor": Channel.of(motor, "--motor")}
    if options.scale is not None:
        outputs["scale"] = Channel.of(options.scale, "--scale")
    for text in options.sensors:
        sensor = Channel.of(text, "--sensor")
        outputs[sensor.names[0]] = sensor
    modes = _modes(options.modes)
    given = [f"{name}={value}" for name in ("axis", "input", "motor", "scale", "modes", "band", "period", "interval")
             if (value := getattr(options, name)) is not None]  # fmt: skip
    directory: Path = options.out or Path("results") / f"modes_{options.response.stem}"
    inputs = [options.response, *(file for _, file in subject.files)]
    with (
        progress_bar(options.quiet) as progress,
        results_in(directory, report.check_writable, inputs, [*options.overrides, *given]),
    ):
        progress("reading", 0, 2)
        if options.input is not None:
            interval = quantity("interval", options.interval, "s", "0.4 ms") if options.interval else None
            time = Channel.of(options.time, "--time") if options.time else None
            measured = from_signals(options.response, Channel.of(options.input, "--input"), outputs, time=time,
                                    interval=interval, period=options.period)  # fmt: skip
        else:
            measured = from_responses(options.response, outputs)
        if options.band is not None:
            measured = measured.between(*_band(options.band))
        progress("fit", 1, 2)
        found = identify(measured, checked_modes(machine), axis, modes)
        done = report.ModesReport(found, options.response, subject, dict(text.split("=", 1) for text in given))
        report.write(done, directory, drawn=options.figures)
    finish(options.quiet, done.warnings, *report.summary_lines(done, directory))


def _modes(text: str) -> int | None:
    from feedsim.errors import InputError
    from feedsim.modal.rational import MOST_MODES

    if text == "auto":
        return None
    if not (text.isdecimal() and int(text) <= MOST_MODES):
        raise InputError(f"--modes {text}: 0 to {MOST_MODES}, or auto")
    return int(text)


def _band(text: str) -> tuple[float, float]:
    from feedsim.errors import InputError

    low, dots, high = text.partition("..")
    if not dots:
        raise InputError(f"--band {text}: LOW..HIGH is needed, such as 11Hz..250Hz")
    ends = quantity("band", low, "Hz", "11 Hz"), quantity("band", high, "Hz", "250 Hz")
    if not 0 < ends[0] < ends[1]:
        raise InputError(f"--band {text}: the lower end is not below the upper one")
    return ends


COMMAND = Command(
    "identify-modes",
    "elastic modes of an axis from measured responses",
    identify_modes,
    (
        Option("response", "RESPONSE", "time signals (CSV, MAT, a trace), or frequency responses (CSV, UFF58, XML)",
               type=Path),
        Option("--machine", "MACHINE-or-SCENARIO", "whose axis it is", type=Path, required=True),
        Option("--axis", "NAME", "the axis (default: the first one)"),
        Option("--input", "NAME[:UNIT]", "of time signals: torque or current; of several runs NAME,NAME:UNIT"),
        Option("--motor", "NAME[:UNIT]", "angle, speed or acceleration of the motor (default: the only response)"),
        Option("--scale", "NAME[:UNIT]", "position, speed or acceleration at the scale, or at the load"),
        Option("--sensor", "NAME[:UNIT]", "a further sensor; may be given several times", many=True, dest="sensors"),
        Option("--modes", "0..5|auto", "how many modes (default: auto, by cross-validation)", default="auto"),
        Option("--band", "LOW..HIGH", "lines that are used, e.g. 11Hz..250Hz (default: all that are excited)"),
        Option("--period", "SAMPLES", "period of the excitation (default: looked for)", type=int),
        Option("--time", "NAME[:UNIT]", "column of the time (default: time or t)"),
        Option("--interval", "VALUE", "of the samples, in place of a time, e.g. 0.4ms"),
        out("modes_<name of the file>"), FIGURES, settings("axes.Z.drive.K_v='2 (m/min)/mm'"), QUIET,
    ),
    DESCRIPTION,
    EPILOG,
)  # fmt: skip
