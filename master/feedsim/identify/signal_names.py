"""Names that drive traces give their signals, and which signal of an axis each of them is.

A name is compared without case, blanks, underscores and the like, and without the axis before or behind it. Only names
with a source stand here, beside each where it comes from; a unit is never taken from a name.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Alias:
    """A name of a signal: its role in a mapping file, who calls it so, and where it is measured if the name tells."""

    name: str
    role: str
    source: str
    at: Literal["scale", "motor"] | None = None


_S120 = "SINAMICS list manuals"
_NCK = "SINUMERIK trace, servo data"
_EDGE = "SINUMERIK high-frequency data"
_DE = "SINUMERIK and SINAMICS in German"
_TNC = "Heidenhain TNC oscilloscope"
_TWINCAT = "TwinCAT, NCTOPLC_AXIS_REF"
_SERCOS = "sercos IDN (Rexroth, Beckhoff AX5000)"
_CIA = "CiA 402 object"
_HAL = "LinuxCNC, pins of motion"

ALIASES = (
    # --- position -------------------------------------------------------------------------------------------------
    Alias("actual position", "position", "plain words"),
    Alias("position actual value", "position", _CIA),  # 6064h
    Alias("6064h", "position", _CIA),
    Alias("0x6064", "position", _CIA),
    Alias("actual position value", "position", "SINUMERIK, service display of axes"),
    Alias("actual position value measuring system 1", "position", "SINUMERIK, service display of axes"),
    Alias("actual position value measuring system 2", "position", "SINUMERIK, service display of axes"),
    Alias("Lageistwert", "position", _DE),
    Alias("Lageistwert Messsystem 1", "position", _DE),
    Alias("Lageistwert Messsystem 2", "position", _DE),
    Alias("nckServoDataActPos1stEnc", "position", _NCK),
    Alias("nckServoDataActPos2ndEnc", "position", _NCK),
    Alias("ENC_POS", "position", _EDGE),  # the active encoder
    Alias("ENC1_POS", "position", _EDGE),
    Alias("ENC2_POS", "position", _EDGE),
    Alias("Actual pos", "position", _TNC),  # TNC 430
    Alias("S ACTUAL", "position", _TNC, "scale"),  # TNC 407
    Alias("ActPos", "position", _TWINCAT),
    Alias("S-0-0051", "position", _SERCOS),  # position feedback value 1
    Alias("position feedback value 1", "position", _SERCOS),
    Alias("motor-pos-fb", "position", _HAL),
    Alias("pos-fb", "position", _HAL),
    Alias("joint-pos-fb", "position", _HAL),
    # --- speed ----------------------------------------------------------------------------------------------------
    Alias("actual speed", "speed", "plain words"),
    Alias("actual velocity", "speed", "plain words"),
    Alias("actual speed motor", "speed", _NCK, "motor"),
    Alias("Drehzahl-/Geschwindigkeitsistwert Motor", "speed", _DE, "motor"),
    Alias("velocity actual value", "speed", _CIA),  # 606Ch
    Alias("606Ch", "speed", _CIA),
    Alias("0x606C", "speed", _CIA),
    Alias("r0061", "speed", _S120, "motor"),  # actual speed unsmoothed
    Alias("actual speed unsmoothed", "speed", _S120, "motor"),
    Alias("r0063", "speed", _S120, "motor"),  # actual speed smoothed
    Alias("actual speed smoothed", "speed", _S120, "motor"),
    Alias("Drehzahlistwert", "speed", _DE, "motor"),
    Alias("nckServoDataActVelMot", "speed", _NCK, "motor"),
    Alias("Actl. speed", "speed", _TNC, "scale"),  # TNC 430: from the position encoder
    Alias("V (act rpm)", "speed", _TNC, "motor"),  # iTNC 530, in mm/min from the speed encoder
    Alias("ActVelo", "speed", _TWINCAT),
    Alias("S-0-0040", "speed", _SERCOS),  # velocity feedback value
    Alias("velocity feedback value", "speed", _SERCOS),
    # --- torque and current ---------------------------------------------------------------------------------------
    Alias("actual torque", "torque", "plain words"),
    Alias("torque actual value", "torque", f"{_S120}; {_CIA}"),  # r0080; 6077h
    Alias("r0080", "torque", _S120),
    Alias("Drehmomentistwert", "torque", _DE),
    Alias("TORQUE", "torque", _EDGE),
    Alias("M actual", "torque", _TNC),  # iTNC 530
    Alias("ActTorque", "torque", _TWINCAT),
    Alias("6077h", "torque", _CIA),
    Alias("0x6077", "torque", _CIA),
    Alias("S-0-0084", "torque", _SERCOS),  # torque/force feedback value
    Alias("torque/force feedback value", "torque", _SERCOS),
    Alias("torque-generating current", "current", _S120),
    Alias("current actual value torque-generating", "current", _S120),  # r0078
    Alias("torque-generating current actual value", "current", _S120),
    Alias("r0078", "current", _S120),
    Alias("Momentenbildender Stromistwert", "current", _DE),
    Alias("Stromistwert momentenbildend", "current", _DE),
    Alias("nckServoDataActCurr", "current", _NCK),
    Alias("CURRENT", "current", _EDGE),
    Alias("I nominal", "current", _TNC),  # the nominal current that determines torque
    Alias("P-0-0459", "current", "Beckhoff AX5000 IDN"),  # actual torque / force generating current
    Alias("actual torque generating current", "current", "Beckhoff AX5000 IDN"),
    Alias("Iq_measured", "current", "ODrive"),
    # --- setpoint of position -------------------------------------------------------------------------------------
    Alias("DES_POS", "setpoint", _EDGE),
    Alias("SetPos", "setpoint", _TWINCAT),
    Alias("motor-pos-cmd", "setpoint", _HAL),
    Alias("pos-cmd", "setpoint", _HAL),
    Alias("joint-pos-cmd", "setpoint", _HAL),
    Alias("Noml. pos", "setpoint", _TNC),
    Alias("S NOMINAL", "setpoint", _TNC),
    Alias("position setpoint", "setpoint", "SINUMERIK, service display of axes"),
    # --- time -----------------------------------------------------------------------------------------------------
    Alias("time", "time", "plain words"),
    Alias("t", "time", "plain words"),
    Alias("Zeit", "time", "plain words"),
)

# What may stand before the number or the letter of an axis, and letters that axes have.
_AXIS_WORDS = ("axis", "achse", "joint", "drive", "antrieb")
_LETTERS = tuple("xyzabcuvw")


def _tokens(name: str) -> list[str]:
    return re.findall(r"[^\W_]+", name.casefold())


def _key(tokens: Iterable[str]) -> str:
    # Servo data come in two widths, ...32 and ...64.
    return re.sub(r"(?<=[a-z])(?:32|64)$", "", "".join(tokens))


_BY_KEY = {_key(_tokens(alias.name)): alias for alias in ALIASES}


def alias_of(name: str, axis: str = "", axes: Iterable[str] = ()) -> Alias | None:
    """The signal that a column is by its name; None: not known, or that of another axis.

    axis: of the trace, "" where it is not known; axes: all of the machine.
    """
    if found := _BY_KEY.get(_key(_tokens(name))):
        return found
    own = axis.casefold()
    others = {*_LETTERS, *(each.casefold() for each in axes)} - {own}
    for tokens in _without_axis(name, own, others):
        if found := _BY_KEY.get(_key(tokens)):
            return found
    return None


def _without_axis(name: str, own: str, others: set[str]) -> Iterator[list[str]]:
    """The name's words without what names the axis; nothing where that is another one."""
    # Scopes put a path of names before the signal's: "Axis 1.ActPos", "joint.0.motor-pos-fb".
    for part in (name, re.split(r"[./:]", name)[-1]):
        words = _tokens(part)
        before = _tokens(name[: len(name) - len(part)])
        if own and _names_other(before, others):
            continue
        while words:
            if words[0] in _AXIS_WORDS or words[0] == own or words[0].isdecimal():
                words = words[1:]
            elif words[-1] == own or words[-1].isdecimal():
                words = words[:-1]
            elif not own and words[0] in others:
                words = words[1:]
            elif not own and words[-1] in others:
                words = words[:-1]
            else:
                break
            yield words
        if words and part != name:
            yield words


def _names_other(words: list[str], others: set[str]) -> bool:
    return any(word in others for word in words)
