"""SI values of a table in the units that people read: um, ms, mm/min."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from feedsim.report.style import Array
from feedsim.report.words import display_unit, minus

# SI unit -> (largest magnitude up to which the unit is taken, factor, unit), from small to large.
_SCALES: dict[str, tuple[tuple[float, float, str], ...]] = {
    "m": ((0.999e-3, 1e6, "um"), (10.0, 1e3, "mm")),
    "s": ((0.999e-3, 1e6, "us"), (0.999, 1e3, "ms")),
    "m/s": ((np.inf, 60e3, "mm/min"),),
    "1/s": ((np.inf, 0.06, "(m/min)/mm"),),  # the position controller's gain
    "H": ((0.999, 1e3, "mH"),),
    "J": ((0.999, 1e3, "mJ"),),
}


@dataclass(frozen=True)
class Scale:
    """A unit for people and the factor from SI to it."""

    factor: float
    unit: str

    @property
    def shown_unit(self) -> str:
        """The unit as it is printed: µm; nothing for a plain number."""
        return display_unit(self.unit)


def scale(unit: str, values: Array) -> Scale:
    """The unit in which values of an SI unit read best, by the largest of them."""
    finite = np.abs(values[np.isfinite(values)])
    largest = float(finite.max()) if len(finite) else 0.0
    fitting = ((factor, shown) for limit, factor, shown in _SCALES.get(unit, ()) if largest <= limit)
    return Scale(*next(fitting, (1.0, unit)))


def number(value: float, digits: int = 4) -> str:
    """A number of a table; a dash where there is none."""
    return minus(f"{value:.{digits}g}") if np.isfinite(value) else "–"


def plain(text: str) -> str:
    """A name of the user's as text of a picture, in which a $ would begin a formula."""
    return text.replace("$", r"\$")
