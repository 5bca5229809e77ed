"""Whether the control loops of a machine are stable, and by what margins."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from feedsim import linear, units
from feedsim.cache import cached
from feedsim.findings import Wrong
from feedsim.linear.judgement import GAIN_MARGIN, PHASE_MARGIN, Loop, judge
from feedsim.nc import Program
from feedsim.scenario import ForeignUnit, Machine
from feedsim.structure import Modes

GAIN = {"speed": ("K_p", "N.m.s/rad", "N.m.s/rad"), "position": ("K_v", "1/s", "(m/min)/mm")}
STATE = {"moving": "while the axis slides", "at rest": "at rest, where friction holds it like a spring"}

CODE = (Path(linear.__file__).parent, Path(__file__))


def loops_of(machine: Machine, modes: Modes) -> tuple[Loop, ...]:
    """The loops as :func:`feedsim.linear.judgement.judge` has them, kept from one process to the next."""
    state = hashlib.sha256(repr((list(modes.ports), modes.frequency.shape)).encode())
    for column in (modes.frequency, modes.damping, *modes.ports.values()):
        state.update(column.tobytes())
    described = repr((machine.axes, machine.cycles))

    def find() -> list[dict[str, Any]]:
        return [asdict(loop) | {"growing": int(loop.growing)} for loop in judge(machine, modes)]

    return tuple(Loop(**loop) for loop in cached("loops", [described, state.hexdigest()], CODE, find))


def control(machine: Machine, loops: Sequence[Loop], program: Program | None = None) -> list[str]:
    """Loops that are unstable or have less than the usual margins, with the gain that would do, and those not judged.

    A loop is wrong where it is unstable in a state that the motion brings about: axes that do not move rest. Without a
    program every axis moves.
    """
    result: list[str] = []
    for axis, kind in dict.fromkeys((loop.axis, loop.kind) for loop in loops):
        states = [loop for loop in loops if (loop.axis, loop.kind) == (axis, kind)]
        unstable, thin = [loop for loop in states if loop.unstable], [loop for loop in states if loop.thin]
        if not (unstable or thin):
            continue
        now = _gain(kind, states[0].gain)
        advised = [loop.advised for loop in unstable or thin]
        nearest = None if None in advised else _gain(kind, min(filter(None, advised)))
        usual = f"the usual {_decibels(GAIN_MARGIN):.0f} dB and {PHASE_MARGIN:g} deg"
        better = f"; with {nearest} it has" if nearest else f"; no {GAIN[kind][0]} was found with which it has"
        if not unstable:
            margins = "; ".join(
                f"gain {_decibels(loop.gain_margin):.1f} dB, phase {loop.phase_margin:.0f} deg {STATE[loop.state]}"
                for loop in thin
            )
            result.append(f"axis {axis}: the {kind} loop has thin margins with {now}: {margins}{better} {usual}")
            continue
        where = "; ".join(map(_where, states))
        text = (
            f"axis {axis}: the {kind} loop is unstable with {now}: {where}{better} {usual}. A run shows this "
            "instability, whatever coupling.substeps are"
        )
        met = any(loop.growing and (loop.state == "at rest" or _moves(program, axis)) for loop in unstable)
        result.append(Wrong(text) if met else text)
    if unknown := [name for name, axis in machine.axes.items() if isinstance(axis.drive, ForeignUnit)]:
        others = "; the other axes are judged with its motor free" if loops else ""
        result.append(
            f"axis {', '.join(unknown)}: whether the loops are stable is not judged, the drive is another maker's"
            + others
        )
    return result


def _moves(program: Program | None, axis: str) -> bool:
    if program is None:
        return True
    low, high = program.reached(axis)
    return low < high


def _where(loop: Loop) -> str:
    """In which state a loop is stable, and from which gain on it is not."""
    if loop.limit is None:
        bound = ""
    elif loop.unstable:
        bound = f", stable {'below' if loop.limit < loop.gain else 'above'} {_gain(loop.kind, loop.limit)}"
    else:
        bound = f" {'up' if loop.limit > loop.gain else 'down'} to {_gain(loop.kind, loop.limit)}"
    return f"{'un' * loop.unstable}stable {STATE[loop.state]}{bound}"


def _decibels(factor: float) -> float:
    return 20 * math.log10(factor)


def _gain(kind: str, value: float) -> str:
    name, unit, shown = GAIN[kind]
    return f"{name} = {units.convert(value, unit, shown):.4g} {shown}"
