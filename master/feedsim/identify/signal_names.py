"""Names that drive traces give their signals, and which signal of an axis each of them is.

A name is compared without case, blanks, underscores and the like, and without the axis before or behind it. Only names
with a source stand here, beside each where it comes from; a unit is never taken from a name.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Literal

Place = Literal["scale", "motor"] | None


@dataclass(frozen=True)
class Alias:
    """A name of a signal: its role in a mapping file, who calls it so, and where it is measured if the name tells."""

    name: str
    role: str
    source: str
    at: Place = None


_S120 = "SINAMICS list manuals"
_NCK = "SINUMERIK trace, servo data"
_EDGE = "SINUMERIK high-frequency data"
_DE = "SINUMERIK and SINAMICS in German"
_TNC = "Heidenhain TNC oscilloscope"
_TWINCAT = "TwinCAT, NCTOPLC_AXIS_REF"
_SERCOS = "sercos IDN (Rexroth, Beckhoff AX5000)"
_CIA = "CiA 402 object"
_HAL = "LinuxCNC, pins of motion"
_SERVICE = "SINUMERIK, service display of axes"

# Role, whose names they are, where it is measured if the name tells, the names.
_NAMES: tuple[tuple[str, str, Place, str], ...] = (
    ("position", "plain words", None, "actual position"),
    ("position", _CIA, None, "position actual value | 6064h | 0x6064"),
    ("position", _SERVICE, None,
     "actual position value | actual position value measuring system 1 | actual position value measuring system 2"),
    ("position", _DE, None, "Lageistwert | Lageistwert Messsystem 1 | Lageistwert Messsystem 2"),
    ("position", _NCK, None, "nckServoDataActPos1stEnc | nckServoDataActPos2ndEnc"),
    ("position", _EDGE, None, "ENC_POS | ENC1_POS | ENC2_POS"),  # ENC_POS: the active encoder
    ("position", _TNC, None, "Actual pos"),  # TNC 430
    ("position", _TNC, "scale", "S ACTUAL"),  # TNC 407
    ("position", _TWINCAT, None, "ActPos"),
    ("position", _SERCOS, None, "S-0-0051 | position feedback value 1"),
    ("position", _HAL, None, "motor-pos-fb | pos-fb | joint-pos-fb"),
    ("speed", "plain words", None, "actual speed | actual velocity"),
    ("speed", _NCK, "motor", "actual speed motor"),
    ("speed", _DE, "motor", "Drehzahl-/Geschwindigkeitsistwert Motor"),
    ("speed", _CIA, None, "velocity actual value | 606Ch | 0x606C"),
    ("speed", _S120, "motor", "r0061 | actual speed unsmoothed | r0063 | actual speed smoothed"),
    ("speed", _DE, "motor", "Drehzahlistwert"),
    ("speed", _NCK, "motor", "nckServoDataActVelMot"),
    ("speed", _TNC, "scale", "Actl. speed"),  # TNC 430: from the position encoder
    ("speed", _TNC, "motor", "V (act rpm)"),  # iTNC 530, in mm/min from the speed encoder
    ("speed", _TWINCAT, None, "ActVelo"),
    ("speed", _SERCOS, None, "S-0-0040 | velocity feedback value"),
    ("torque", "plain words", None, "actual torque"),
    ("torque", f"{_S120}; {_CIA}", None, "torque actual value"),  # r0080; 6077h
    ("torque", _S120, None, "r0080"),
    ("torque", _DE, None, "Drehmomentistwert"),
    ("torque", _EDGE, None, "TORQUE"),
    ("torque", _TNC, None, "M actual"),  # iTNC 530
    ("torque", _TWINCAT, None, "ActTorque"),
    ("torque", _CIA, None, "6077h | 0x6077"),
    ("torque", _SERCOS, None, "S-0-0084 | torque/force feedback value"),
    ("current", _S120, None, "torque-generating current"),
    ("current", _S120, None,  # r0078
     "current actual value torque-generating | torque-generating current actual value | r0078"),
    ("current", _DE, None, "Momentenbildender Stromistwert | Stromistwert momentenbildend"),
    ("current", _NCK, None, "nckServoDataActCurr"),
    ("current", _EDGE, None, "CURRENT"),
    ("current", _TNC, None, "I nominal"),  # the nominal current that determines torque
    ("current", "Beckhoff AX5000 IDN", None, "P-0-0459 | actual torque generating current"),
    ("current", "ODrive", None, "Iq_measured"),
    ("setpoint", _EDGE, None, "DES_POS"),
    ("deviation", _EDGE, None, "CONT_DEV"),
    ("speed_setpoint", _EDGE, None, "CMD_SPEED"),
    ("feedforward", _EDGE, None, "VEL_FFW"),
    ("setpoint", _TWINCAT, None, "SetPos"),
    ("setpoint", _HAL, None, "motor-pos-cmd | pos-cmd | joint-pos-cmd"),
    ("setpoint", _TNC, None, "Noml. pos | S NOMINAL"),
    ("setpoint", _SERVICE, None, "position setpoint"),
    ("time", "plain words", None, "time | t | Zeit"),
)  # fmt: skip
ALIASES = tuple(Alias(name, role, source, at) for role, source, at, names in _NAMES for name in names.split(" | "))

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
        if own and not others.isdisjoint(before):
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
