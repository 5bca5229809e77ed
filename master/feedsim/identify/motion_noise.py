"""What noise and resolution of the recorded motion add to the uncertainty of the parameters.

The fit takes the motion for exact and all scatter for the torque's. A position in steps of 1 um is not exact: the law
answers to motion that was not there, the same way in every fit of the record, so that the residuals do not show it.
The motion is therefore disturbed once more by as much as its samples say that they are disturbed already, and the
linearised fit tells how far the parameters move with that (delta method).
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from feedsim.identify.fit import Fit
from feedsim.identify.motion import motion, noise_of
from feedsim.identify.torque import RecordTorque

Array = NDArray[np.float64]

DRAWS = 8  # their mean square is known to within a half, their root to a quarter: an order of magnitude is wanted


def motion_covariance(
    models: Sequence[RecordTorque], fit: Fit, values: dict[str, float], states: Array, weights: Sequence[Array]
) -> Array:
    """(P, P) covariance of the fit's parameters by noise of the motion; weights: those that the fit was made with."""
    reach = fit.covariance @ fit.jacobian.T
    known = np.all(np.isfinite(reach), axis=1)
    total = np.zeros_like(fit.covariance)
    first = 0
    for k, (model, weight) in enumerate(zip(models, weights, strict=True)):
        rows = slice(first, first + len(model.rows))
        first = rows.stop
        z, c = (float(share) for share in states[k])
        before = model.residual(values, z, c)
        for draw in range(DRAWS):
            moved = _disturbed(model, np.random.default_rng([k, draw]))
            if moved is None:
                break
            change = (moved.residual(values, z, c) - before) / weight[model.stretch]
            shift = np.where(known, reach[:, rows] @ change, 0.0)
            total += np.outer(shift, shift) / DRAWS
    return np.asarray(total, dtype=np.float64)


def _disturbed(model: RecordTorque, rng: np.random.Generator) -> RecordTorque | None:
    """The same rows of the record with as much noise on the motion again; None where it has none."""
    source = model.motion.source
    samples = getattr(model.record, source)
    noise = noise_of(samples)
    if noise == 0:
        return None
    again = replace(model.record, **{source: samples + noise * rng.standard_normal(len(samples))})
    moved = copy(model)
    moved.motion = motion(again, source)
    moved._law, moved._moved = {}, {}
    return moved
