"""What was measured of an axis: responses of accelerations at the motor and the scale to its torque or current.

From time signals (estimate.py) or from a file of frequency responses. Units decide what a channel is: an angle or a
position is differentiated twice, a speed once.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from math import pi
from pathlib import Path

import numpy as np

from feedsim.estimation.modal.estimate import estimate_responses
from feedsim.files.trace import Recording, read_recording
from feedsim.files.trace.response import Complexes, FrequencyResponse
from feedsim.files.trace.response_files import read_response
from feedsim.files.trace.trace import Array
from feedsim.foundation import units
from feedsim.foundation.errors import Finding, InputError

# Units of a channel -> how often it is differentiated in time to be an acceleration.
OUTPUTS = {"rad": 2, "m": 2, "rad/s": 1, "m/s": 1, "rad/s^2": 0, "m/s^2": 0}
ACCELERATIONS = ("rad/s^2", "m/s^2")
INPUTS = ("N.m", "A")
EVEN_INTERVAL_SHARE = 1e-3  # of an interval: by how much sampling may be uneven
OUTSIDE_BRACKETS = r"(?![^()]*\))"  # those within are of a name, data(:,2)
COHERENT = 0.5  # least coherence of a line of a file that is used


@dataclass(frozen=True)
class Channel:
    """A signal as it was named: a column of the file (or several runs of it), and its unit; "" as the file has it."""

    names: tuple[str, ...]
    unit: str = ""

    @classmethod
    def of(cls, text: str, option: str) -> Channel:
        """ "NAME:UNIT" or "NAME"; several runs "NAME,NAME:UNIT". InputError: nothing is named."""
        *ahead, last = re.split(rf":{OUTSIDE_BRACKETS}", text)
        name, unit = (":".join(ahead), last) if ahead else (text, "")
        names = tuple(part.strip() for part in re.split(rf",{OUTSIDE_BRACKETS}", name) if part.strip())
        if not names:
            raise InputError(f"{option} {text!r}: NAME or NAME:UNIT is needed, such as n_act:rpm")
        return cls(names, unit.strip())


@dataclass(frozen=True, eq=False)
class MeasuredResponses:
    """Responses in SI, the motor first.

    Attributes:
        frequency: (N,) [Hz]. values: output -> (N,) acceleration over the input. relative: output -> (N,) relative
            standard deviation. input_unit: "N.m" or "A". linear: output -> whether it is a displacement (m).
        method: how it was estimated. notes: what a reader should know.
    """

    frequency: Array
    values: Mapping[str, Complexes]
    relative: Mapping[str, Array]
    input_unit: str
    linear: Mapping[str, bool]
    method: str
    notes: Sequence[Finding] = field(default_factory=tuple)

    def between(self, low: float, high: float) -> MeasuredResponses:
        """Lines from `low` to `high` [Hz]."""
        kept = (self.frequency >= low) & (self.frequency <= high)
        return MeasuredResponses(
            self.frequency[kept],
            {name: value[kept] for name, value in self.values.items()},
            {name: values[kept] for name, values in self.relative.items()},
            self.input_unit, self.linear, self.method, self.notes,
        )  # fmt: skip


def from_signals(
    path: Path,
    input_: Channel,
    outputs: Mapping[str, Channel],
    *,
    time: Channel | None = None,
    interval: float | None = None,
    period: int | None = None,
) -> MeasuredResponses:
    """Responses from time signals of a file.

    Args:
        outputs: "motor" first, and perhaps "scale". time: the column of the time; None: one called so. interval: of
            the samples [s], in place of a time. period: of the excitation in samples; None: it is looked for.

    Raises InputError: no such column, a unit that is none of torque, current, angle or position and their derivatives,
    uneven samples, what `estimate_responses` refuses.
    """
    recording = read_recording(path)
    runs = len(input_.names)
    for name, channel in outputs.items():
        if len(channel.names) != runs:
            raise InputError(f"{path}: {name} has {len(channel.names)} runs, the input has {runs}")
    factor, unit = _factor(path, "input", input_, INPUTS, recording.units)
    orders, factors, linear = {}, {}, {}
    for name, channel in outputs.items():
        factors[name], own = _factor(path, name, channel, tuple(OUTPUTS), recording.units)
        orders[name], linear[name] = OUTPUTS[own], own.startswith("m")
    h = interval if interval is not None else _interval(recording, time)
    read = recording.read([*input_.names, *(n for channel in outputs.values() for n in channel.names)])
    result = estimate_responses(
        [read[name] for name in input_.names],
        {name: [read[n] for n in channel.names] for name, channel in outputs.items()},
        h,
        period=period,
        orders=orders,
    )
    s = 2j * pi * result.frequency
    values: dict[str, Complexes] = {
        name: np.asarray(value * s ** orders[name] * factors[name] / factor, dtype=np.complex128)
        for name, value in result.values.items()
    }
    return MeasuredResponses(result.frequency, values, result.relative, unit, linear, result.method, recording.notes)


def from_responses(path: Path, outputs: Mapping[str, Channel]) -> MeasuredResponses:
    """Responses of a file of frequency responses. A unit is one of output over input, such as (rad/s)/(N.m).

    Raises InputError: no such response; a unit that is not understood.
    """
    response = read_response(path)
    values: dict[str, Complexes] = {}
    relative: dict[str, Array] = {}
    linear: dict[str, bool] = {}
    inputs: set[str] = set()
    notes = list(response.notes)
    kept = np.ones(len(response), dtype=np.bool_)
    for name, channel in outputs.items():
        if len(channel.names) != 1 or channel.names[0] not in response:
            raise InputError(f"{path}: no response {', '.join(channel.names)!r}; there is {', '.join(response.names)}")
        own = channel.names[0]
        unit = channel.unit or response.unit(own)
        alone = FrequencyResponse(response.frequency, {own: response[own]}, {own: unit})
        for output, input_ in product(ACCELERATIONS, INPUTS):
            try:
                in_unit = alone.converted({own: f"({output})/({input_})"})
            except InputError:
                continue
            inputs.add(input_)
            values[name], linear[name] = in_unit[own], output.startswith("m")
            notes += in_unit.notes
        if name not in values:
            raise InputError(
                f"{path}: response {own!r} is in {unit or 'no unit'}; an angle or a position, its speed or "
                f"acceleration over a torque or a current is needed: {own}:(rad/s)/(N.m)"
            )
        coherence = np.asarray(response.coherence.get(own, np.ones(len(response))))
        kept &= coherence > COHERENT
        relative[name] = np.asarray(np.sqrt((1 - coherence) / (2 * np.maximum(coherence, 1e-12))), dtype=np.float64)
    if len(inputs) > 1:
        raise InputError(f"{path}: one response is over a torque, another over a current")
    return MeasuredResponses(
        np.asarray(response.frequency)[kept],
        {name: value[kept] for name, value in values.items()},
        {name: values[kept] for name, values in relative.items()},
        inputs.pop(), linear, "as in the file, its coherence as scatter", notes,
    )  # fmt: skip


def _factor(
    path: Path, what: str, channel: Channel, allowed: Sequence[str], known: Mapping[str, str]
) -> tuple[float, str]:
    unit = channel.unit or known.get(channel.names[0], "")
    for name in allowed if unit else ():
        try:
            return float(units.factor(unit, name)), name
        except InputError:
            continue
    unit_words = f"is in {unit}" if unit else "has no unit in the file"
    raise InputError(
        f"{path}: the {what} {channel.names[0]!r} {unit_words}; a unit of {', '.join(allowed)} is needed: "
        f"{channel.names[0]}:{allowed[0]}"
    )


def _interval(recording: Recording, channel: Channel | None) -> float:
    path = recording.path
    name = channel.names[0] if channel is not None else next((n for n in ("time", "t") if n in recording.names), "")
    if not name:
        raise InputError(f"{path}: which column is the time? --time NAME:s, or --interval 0.4ms")
    unit = (channel.unit if channel is not None else "") or recording.units.get(name, "")
    if not unit:
        raise InputError(f"{path}: the time {name!r} has no unit in the file: --time {name}:s, or --interval 0.4ms")
    values = recording.read([name])[name] * float(units.factor(unit, "s"))
    steps = np.diff(values)
    h = float(np.median(steps)) if len(steps) else 0.0
    if not h > 0 or float(np.max(np.abs(steps - h))) > EVEN_INTERVAL_SHARE * h:
        raise InputError(
            f"{path}: samples are {1e3 * float(np.min(steps, initial=0)):.6g} to "
            f"{1e3 * float(np.max(steps, initial=0)):.6g} ms apart; a frequency response needs even ones"
        )
    return h
