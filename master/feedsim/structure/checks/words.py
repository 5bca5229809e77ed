"""Words of the checks' messages."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

SHOWN = 5
DEGREES = ("degree of freedom", "degrees of freedom")


def few(labels: Sequence[str], indices: np.ndarray) -> str:
    """The first labels, and how many there are beyond."""
    text = ", ".join(labels[int(i)] for i in indices[:SHOWN])
    return text + (f" and {len(indices) - SHOWN} more" if len(indices) > SHOWN else "")


def listing(count: int, one: str, several: str) -> str:
    """ "1 degree of freedom has", "3 degrees of freedom have"."""
    return f"{count} {one if count == 1 else several}"
