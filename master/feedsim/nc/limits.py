"""Checks of the planned motion against the axes' limits; every violation is found before any is reported."""

from __future__ import annotations

from feedsim.scenario import Axis

# Limits are compared with results of arithmetic on them: a relative 1e-9, and 1 nm of travel, are rounding.
ROUNDING = 1e-9


def violations(
    name: str, axis: Axis, start: float, low: float, high: float, speed: float, acceleration: float
) -> list[str]:
    """What is wrong with a motion of axis ``name`` between ``low`` and ``high`` [m] with these peaks [m/s, m/s2].

    Where it stands at ``start`` [m] is not its own fault: the motion before it was blamed for that.
    """
    found = []
    least, most = axis.travel
    outside = [x for x in (low, high) if x != start and not least - ROUNDING <= x <= most + ROUNDING]
    if outside:
        reached = " and ".join(f"{x * 1e3:.7g}" for x in dict.fromkeys(outside))
        found.append(f"axis {name} reaches {reached} mm; allowed travel {least * 1e3:.7g} to {most * 1e3:.7g} mm")
    if speed > axis.max_speed * (1 + ROUNDING):
        found.append(
            f"axis {name} reaches a speed of {speed * 60:.5g} m/min; allowed at most {axis.max_speed * 60:.5g} m/min"
        )
    if acceleration > axis.max_acceleration * (1 + ROUNDING):
        found.append(
            f"axis {name} reaches an acceleration of {acceleration:.5g} m/s^2; "
            f"allowed at most {axis.max_acceleration:.5g} m/s^2"
        )
    return found
