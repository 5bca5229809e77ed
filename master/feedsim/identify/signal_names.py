"""Names that drive traces give their signals, and which signal of an axis each of them is.

A name is compared without case, blanks, underscores and the like, and without the axis before or behind it. Only names
with a source stand here, beside each where it comes from; a unit is never taken from a name.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass


@dataclass(frozen=True)
class Alias:
    """A name of a signal: its role in a mapping file, and who calls it so."""

    name: str
    role: str
    source: str


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

# Role, whose names they are, the names.
_NAMES: tuple[tuple[str, str, str], ...] = (
    ("position", "plain words", "actual position"),
    ("position", _CIA, "position actual value | 6064h | 0x6064"),
    ("position", _SERVICE,
     "actual position value | actual position value measuring system 1 | actual position value measuring system 2"),
    ("position", _DE, "Lageistwert | Lageistwert Messsystem 1 | Lageistwert Messsystem 2"),
    ("position", _NCK, "nckServoDataActPos1stEnc | nckServoDataActPos2ndEnc"),
    ("position", _EDGE, "ENC_POS | ENC1_POS | ENC2_POS"),  # ENC_POS: the active encoder
    ("position", _TNC, "Actual pos"),  # TNC 430
    ("position", _TNC, "S ACTUAL"),  # TNC 407
    ("position", _TWINCAT, "ActPos"),
    ("position", _SERCOS, "S-0-0051 | position feedback value 1"),
    ("position", _HAL, "motor-pos-fb | pos-fb | joint-pos-fb"),
    ("speed", "plain words", "actual speed | actual velocity"),
    ("speed", _NCK, "actual speed motor"),
    ("speed", _DE, "Drehzahl-/Geschwindigkeitsistwert Motor"),
    ("speed", _CIA, "velocity actual value | 606Ch | 0x606C"),
    ("speed", _S120, "r0061 | actual speed unsmoothed | r0063 | actual speed smoothed"),
    ("speed", _DE, "Drehzahlistwert"),
    ("speed", _NCK, "nckServoDataActVelMot"),
    ("speed", _TNC, "Actl. speed"),  # TNC 430: from the position encoder
    ("speed", _TNC, "V (act rpm)"),  # iTNC 530, in mm/min from the speed encoder
    ("speed", _TWINCAT, "ActVelo"),
    ("speed", _SERCOS, "S-0-0040 | velocity feedback value"),
    ("torque", "plain words", "actual torque"),
    ("torque", f"{_S120}; {_CIA}", "torque actual value"),  # r0080; 6077h
    ("torque", _S120, "r0080"),
    ("torque", _DE, "Drehmomentistwert"),
    ("torque", _EDGE, "TORQUE"),
    ("torque", _TNC, "M actual"),  # iTNC 530
    ("torque", _TWINCAT, "ActTorque"),
    ("torque", _CIA, "6077h | 0x6077"),
    ("torque", _SERCOS, "S-0-0084 | torque/force feedback value"),
    ("current", _S120, "torque-generating current"),
    ("current", _S120,  # r0078
     "current actual value torque-generating | torque-generating current actual value | r0078"),
    ("current", _DE, "Momentenbildender Stromistwert | Stromistwert momentenbildend"),
    ("current", _NCK, "nckServoDataActCurr"),
    ("current", _EDGE, "CURRENT"),
    ("current", _TNC, "I nominal"),  # the nominal current that determines torque
    ("current", "Beckhoff AX5000 IDN", "P-0-0459 | actual torque generating current"),
    ("current", "ODrive", "Iq_measured"),
    ("setpoint", _EDGE, "DES_POS"),
    ("deviation", _EDGE, "CONT_DEV"),
    ("speed_setpoint", _EDGE, "CMD_SPEED"),
    ("feedforward", _EDGE, "VEL_FFW"),
    ("setpoint", _TWINCAT, "SetPos"),
    ("setpoint", _HAL, "motor-pos-cmd | pos-cmd | joint-pos-cmd"),
    ("setpoint", _TNC, "Noml. pos | S NOMINAL"),
    ("setpoint", _SERVICE, "position setpoint"),
    ("time", "plain words", "time | t | Zeit"),
)  # fmt: skip
ALIASES = tuple(Alias(name, role, source) for role, source, names in _NAMES for name in names.split(" | "))

# What may stand before the number or the letter of an axis, and letters that axes have.
_AXIS_WORDS = ("axis", "achse", "joint", "drive", "antrieb")
_AXIS_LETTERS = tuple("xyzabcuvw")


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
    if alias := _BY_KEY.get(_key(_tokens(name))):
        return alias
    own = axis.casefold()
    others = {*_AXIS_LETTERS, *(axis.casefold() for axis in axes)} - {own}
    for tokens in _without_axis(name, own, others):
        if alias := _BY_KEY.get(_key(tokens)):
            return alias
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
