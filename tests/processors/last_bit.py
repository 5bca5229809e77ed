"""numpy's functions as another processor's would round them: the last bit of about every second value is off by one.

numpy has them several times, by what the processor can do: with AVX-512 from another library, whose values differ from
the C library's in the last bit or two. A plugin of pytest (``-p last_bit``) for processors that this machine is not.
Which bit is off hangs on the value alone: the same sum made twice is the same. Whole numbers stay (exp(0), cos(0)).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

NAMES = (
    "exp", "exp2", "expm1", "log", "log2", "log10", "log1p", "sin", "cos", "tan", "arcsin", "arccos", "arctan",
    "arctan2", "sinh", "cosh", "tanh", "power", "cbrt",
)  # fmt: skip


def off_by_one(function: Callable[..., Any]) -> Callable[..., Any]:
    """The function with the last bit of its values changed, where their own bits say so."""

    def rounded_otherwise(*given: Any, **options: Any) -> Any:
        found = function(*given, **options)
        if getattr(found, "dtype", None) != np.float64 or "out" in options:
            return found
        values = np.asarray(found)
        with np.errstate(over="ignore"):
            bits = values.view(np.int64) * np.int64(0x5DEECE66D) >> 40
        other = np.nextafter(values, np.where(bits & 2, np.inf, -np.inf))
        changed = np.where((bits & 1 == 0) | (values == np.rint(values)) | ~np.isfinite(values), values, other)
        return changed if isinstance(found, np.ndarray) else np.float64(changed)

    return rounded_otherwise


for name in NAMES:
    setattr(np, name, off_by_one(getattr(np, name)))
