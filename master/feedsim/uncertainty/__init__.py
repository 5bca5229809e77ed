"""What identification leaves open, carried along: draws of a machine, and bands and intervals of what they do.

May use analysis, cosim, estimation and scenario.
Start with draws.py; spread.py makes intervals of the draws, runs.py runs them.
"""

from feedsim.uncertainty.draws import (
    JUDGE_SEED,
    MIN_DRAWS,
    SEARCH_DRAWS,
    SEARCH_SEED,
    Band,
    Cloud,
    Known,
    Uncertainty,
    check_count,
    cloud_of,
    draw_named,
    drawn_friction,
    interval,
    known_of,
    known_values,
    of_compensation,
    of_run,
    share_of,
    torque_scale,
    typed_drive,
    typed_on,
)

__all__ = [
    "JUDGE_SEED", "MIN_DRAWS", "SEARCH_DRAWS", "SEARCH_SEED", "Band", "Cloud", "Known", "Uncertainty", "check_count",
    "cloud_of", "draw_named", "drawn_friction", "interval", "known_of", "known_values", "of_compensation", "of_run",
    "share_of", "torque_scale", "typed_drive", "typed_on",
]  # fmt: skip
