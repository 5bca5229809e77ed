"""The torque at rest ahead of a record's first motion: what friction holds of it, and a way there.

What an axis did before a record is not in it, but for the torque that it rests with: M = M_0 + friction, which is
anything up to the static friction. A run-in leaves the bristles with that torque. The axis slides one way, so that they
are bent all through, and turns back by an angle d. With g = F_S/sigma_0 the LuGre law says at slow motion

    z = g (2 exp(-d/g) - 1)          M_fr = k sigma_0 z,    k by the engaging zone (src/friction_fmu/tem.h)
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from feedsim.scenario import Friction
from feedsim.trace.trace import Array

MAX_SHARE = 0.98  # of the static friction
SLIDES = 6.0  # in g, beyond the engaging zone: bristles are bent all through then
TURN_BACK_ANGLES = 400  # at which the law is evaluated
# Of the time at rest ahead of a record: when the axis slides away, comes back beyond the begin, and turns back to it.
INSTANTS = (0.15, 0.35, 0.6, 0.75)


def run_in(friction: Friction, torque_held: float, time: Array) -> Array:
    """(N,) motor angle [rad] off where the record begins, over `time` (N,), from 0 at its begin to 1 at the first row.

    torque_held: torque [N.m] that friction is to hold in the end.
    """
    g = float(friction.F_S) / float(friction.sigma_0)
    back, slid = _turned_back(friction, g, torque_held), SLIDES * g + float(friction.W)
    angles = 0.0, back - slid, back, 0.0
    s = [np.clip((time - a) / (b - a), 0.0, 1.0) for a, b in pairwise(INSTANTS)]
    steps = (step**3 * (10 - 15 * step + 6 * step**2) for step in s)
    return np.asarray(sum(jump * step for jump, step in zip(np.diff(angles), steps, strict=True)))


def _turned_back(friction: Friction, g: float, torque_held: float) -> float:
    """Angle [rad] by which an axis that has slid forwards turns back, for friction to hold that torque."""
    static, W, gamma = float(friction.F_S), float(friction.W), float(friction.gamma)
    d = np.unique(np.concatenate([np.linspace(0.0, end, TURN_BACK_ANGLES) for end in (SLIDES * g, SLIDES * g + W)]))
    z, c = g * (2 * np.exp(-d / g) - 1), np.maximum(W / 2 - d, -W / 2)
    engaged = (W / 2 + np.where(z >= 0, c, -c)) / W if W > 0 else np.ones_like(d)
    torque = (gamma + engaged * (1 - gamma)) * z * static / g
    share = np.clip(torque_held, -MAX_SHARE * static, MAX_SHARE * static)
    return float(np.interp(-share, -torque, d))
