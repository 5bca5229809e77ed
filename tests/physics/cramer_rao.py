"""Cramer-Rao bound for parameters of an axis in motion, apart from identification's own.

The torque is M(t) = J dn/dt + M_0 + M_fr(n) at t - delay, with the friction unit's law along the cubic spline through
the recorded speeds. Its sensitivities are central differences. White noise of known standard deviation lies on it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from feedsim.estimation.identify.record import Record
from feedsim.simulation.cosim.friction_law import FrictionLaw

Array = NDArray[np.float64]

STEPS = 8  # of the law per row
# Difference, of the value or, for what may be 0, absolute: far above rounding, far below what bends the torque.
SHARE = 5e-4
STEP = {"delay": 5e-5, "M_0": 1e-2, "asymmetry": 1e-2, "z": 5e-2, "c": 5e-2}
# z and c at the record's begin, as shares of F_S/sigma_0 and W: they may lie anywhere within -1..1 and -1/2..1/2.
START = {"z": 1 / 3, "c": 1 / 12}  # variance of the uniform distribution


@dataclass(frozen=True, eq=False)
class Known:
    """What is known of parameters ahead of the record: covariance (K, K) of `names`."""

    names: tuple[str, ...]
    covariance: Array


def torque(law: FrictionLaw, record: Record, values: Mapping[str, float]) -> Array:
    """(N,) [N.m] at the rows; values: friction parameters, J, M_0, delay, z and c as shares (else 0)."""
    assert record.speed is not None
    speed = CubicSpline(record.time, record.speed)
    step = record.interval / STEPS
    fine = record.time[0] + step * np.arange((len(record) - 1) * STEPS + 1) - values["delay"]
    fine = np.clip(fine, record.time[0], record.time[-1])  # as it was at the ends
    friction = law(
        {name: value for name, value in values.items() if name in law.names},
        np.ascontiguousarray(speed(fine)),
        step,
        z=values.get("z", 0.0) * values["F_S"] / values["sigma_0"],
        c=values.get("c", 0.0) * values["W"],
        every=STEPS,
    )
    return np.asarray(friction + values["J"] * speed(fine[::STEPS], 1) + values["M_0"])


def least(
    law: FrictionLaw,
    record: Record,
    values: Mapping[str, float],
    sought: Sequence[str],
    noise: float,
    known: Sequence[Known] = (),
    rows: Array | None = None,
) -> dict[str, float]:
    """Name -> least standard deviation, for `sought` and what is `known`, the start of the bristles unknown.

    Args:
        values: at which it is asked. noise: standard deviation of the torque [N.m]. rows: (N,) true where the torque is
            looked at; default: everywhere.
    """
    names = list(dict.fromkeys([*sought, *(name for each in known for name in each.names), *START]))
    scale = np.array([STEP.get(name) or abs(values[name]) for name in names])
    columns = []
    for name, unit in zip(names, scale, strict=True):
        step = unit if name in STEP else SHARE * unit
        at = values.get(name, 0.0)
        ends = [torque(law, record, {**values, name: at + sign * step}) for sign in (1, -1)]
        columns.append((ends[0] - ends[1]) / (2 * step) * unit)
    sensitivity = np.column_stack(columns)[slice(None) if rows is None else rows] / noise
    information = sensitivity.T @ sensitivity
    for each in (*known, *(Known((name,), np.array([[variance]])) for name, variance in START.items())):
        place = [names.index(name) for name in each.names]
        information[np.ix_(place, place)] += np.linalg.inv(each.covariance / np.outer(scale[place], scale[place]))
    sigma = scale * np.sqrt(np.diag(np.linalg.inv(information)))
    return dict(zip(names, map(float, sigma), strict=True))
