"""Elastic modes of an axis from measured responses."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Literal

from feedsim.analysis import FigureTable
from feedsim.estimation.modal.measured import Channel, from_responses, from_signals
from feedsim.estimation.modal.rational import MOST_MODES
from feedsim.estimation.modal.rational import identify_modes as identified
from feedsim.files.fields import no_axis
from feedsim.files.trace.response_files import read_response
from feedsim.foundation.arguments import Band, Value, parse_frequency_band, quantity, settings, spell_argument
from feedsim.foundation.errors import InputError
from feedsim.jobs.parameters import (
    NO_WATCH,
    Argument,
    FigureKinds,
    File,
    Force,
    Option,
    Settings,
    Watch,
    job,
    output_option,
)
from feedsim.jobs.result import Kind, Result, claim_result_folder
from feedsim.report import modal as page
from feedsim.scenario import Machine, load_subject
from feedsim.structure import checked_modes

KIND = Kind("identify-modes", page.FILES, keeps=(page.MODES_FILE,))


def result_of(identified: page.ModesReport) -> Result[page.ModesReport]:
    """Modes of an axis: what was found, and what it rests on."""
    return Result(
        KIND,
        identified,
        partial(page.report_of, identified),
        figures=FigureTable(identified.figures),
        details=partial(page.details, identified),
        files=partial(page.files_of, identified),
        inputs=[identified.file, *(file for _, file in identified.subject.files)],
        lines=partial(page.summary_lines, identified),
    )


@job("elastic modes of an axis from measured responses")
def identify_modes(
    response: Annotated[
        File, Argument("RESPONSE", "time signals (CSV, MAT, a trace), or frequency responses (CSV, UFF58, XML)")
    ],
    machine: Annotated[File, Option("MACHINE-or-SCENARIO", "whose axis it is")],
    axes: Annotated[str | None, Option("NAME", "the axis (default: the first one)")] = None,
    *,
    input: Annotated[
        str | None, Option("NAME[:UNIT]", "of time signals: torque or current; of several runs NAME,NAME:UNIT")
    ] = None,
    motor: Annotated[
        str | None, Option("NAME[:UNIT]", "angle, speed or acceleration of the motor (default: the only response)")
    ] = None,
    scale: Annotated[
        str | None, Option("NAME[:UNIT]", "position, speed or acceleration at the scale, or at the load")
    ] = None,
    sensor: Annotated[
        Sequence[str], Option("NAME[:UNIT]", "a further sensor; may be given several times", many=True)
    ] = (),
    modes: Annotated[
        int | Literal["auto"] | str, Option("0..5|auto", "how many modes (default: auto, by cross-validation)")
    ] = "auto",
    band: Annotated[
        Band | None, Option("LOW..HIGH", "lines that are used, e.g. 11Hz..250Hz (default: all that are excited)")
    ] = None,
    period: Annotated[int | None, Option("SAMPLES", "period of the excitation (default: looked for)")] = None,
    time: Annotated[str | None, Option("NAME[:UNIT]", "column of the time (default: time or t)")] = None,
    interval: Annotated[Value | None, Option("VALUE", "of the samples, in place of a time, e.g. 0.4ms")] = None,
    set: Settings = None,
    out: Annotated[File | None, output_option("modes_{response}")] = None,
    figures: FigureKinds = (),
    force: Force = False,
    watch: Watch = NO_WATCH,
) -> Result[page.ModesReport]:
    r"""Elastic modes of an axis from a measured response: time signals, or a file of frequency responses.

    Rigid motion, delays and modes, whose number cross-validation decides; written as the machine's table of modes,
    beside the measured lines and the machine's own response.

    Command line:
        feedsim example test_centre
        feedsim identify modes bench.mat --machine machines/test_centre --axes X --input iq_adx:A \
          --motor theta_mx:rad --scale theta_my:rad --interval 0.4ms
        feedsim identify modes responses.uff --machine machines/test_centre --axes Z --modes 2

    Raises:
        InputError: a faulty file, no such axis or signal, wrong arguments, a response that is none of an axis.
        OutputError: `out` cannot be written.

    >>> import feedsim as fs
    >>> fs.identify_modes("z_positioning.yaml", "machines/test_centre", "B")
    Traceback (most recent call last):
    feedsim.foundation.errors.InputError: axes B: the machine has no axis 'B'; it has X, Y, Z
    """
    texts = settings(set)
    subject = load_subject(machine, texts)
    chosen = _axis(axes, subject.machine)
    path = Path(response)
    outputs = {"motor": Channel.of(_motor(motor, input, path), spell_argument("motor"))}
    if scale is not None:
        outputs["scale"] = Channel.of(scale, spell_argument("scale"))
    for text in sensor:
        more = Channel.of(text, spell_argument("sensor"))
        outputs[more.names[0]] = more
    count = _count(modes)
    asked = {
        "axes": axes, "input": input, "motor": motor, "scale": scale, "modes": modes, "band": band, "period": period,
        "interval": interval,
    }  # fmt: skip
    given = {name: str(value) for name, value in asked.items() if value is not None}
    inputs = [path, *(file for _, file in subject.files)]
    named = [f"{name}={text}" for name, text in given.items()]
    with claim_result_folder(out, KIND, watch, inputs, [*texts, *named], force=force):
        watch.progress("reading", 0, 2)
        if input is not None:
            step = quantity("interval", interval, "s", "0.4 ms") if interval else None
            column = Channel.of(time, spell_argument("time")) if time else None
            measured = from_signals(
                path, Channel.of(input, spell_argument("input")), outputs, time=column, interval=step, period=period
            )
        else:
            measured = from_responses(path, outputs)
        if band is not None:
            measured = measured.between(*_band(band))
        watch.progress("fit", 1, 2)
        axis_modes = identified(measured, checked_modes(subject.machine), chosen, count)
        result = result_of(page.ModesReport(axis_modes, path, subject, given))
        if out is not None:
            result.save(out, figures=figures, force=force)
    return result


def _axis(axis: str | None, machine: Machine) -> str:
    chosen = axis or next(iter(machine.axes))
    if chosen not in machine.axes:
        raise InputError(f"{spell_argument('axes')} {chosen}: {no_axis(chosen, machine.axes)}")
    return chosen


def _motor(motor: str | None, input: str | None, response: Path) -> str:
    """The motor's signal, or the only response of the file."""
    if motor is not None:
        return motor
    if input is not None:
        raise InputError(
            f"{spell_argument('input')} without {spell_argument('motor')}: which signal is the motor's? For example "
            f"{spell_argument('motor')} n_act:rpm"
        )
    if len(names := read_response(response).names) != 1:
        raise InputError(f"{response}: which response is the motor's? {spell_argument('motor')} NAME; there is {names}")
    return names[0]


def _count(modes: int | str) -> int | None:
    """How many modes; None: cross-validation decides."""
    text = str(modes)
    if text == "auto":
        return None
    if not (text.isdecimal() and int(text) <= MOST_MODES):
        raise InputError(f"{spell_argument('modes')} {text}: 0 to {MOST_MODES}, or auto")
    return int(text)


def _band(band: Band) -> tuple[float, float]:
    low, high = parse_frequency_band("band", band, "11 Hz", "250 Hz")
    if not 0 < low < high:
        raise InputError(f"{spell_argument('band')} {band}: the lower end is not below the upper one")
    return low, high
