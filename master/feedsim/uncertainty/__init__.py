"""What identification leaves open, carried along: draws of a machine, and bands and intervals of what they do.

May use analysis, cosim, estimation and scenario.
Start with draws.py; spread.py makes intervals of the draws, runs.py runs them.
"""

from feedsim.uncertainty.draws import Cloud, Known, cloud_of, drawn_friction, known_of, known_values, torque_scale
from feedsim.uncertainty.runs import Band, Uncertainty, of_compensation, of_run
from feedsim.uncertainty.spread import MIN_DRAWS, check_count, interval, share_of

__all__ = [
    "MIN_DRAWS", "Band", "Cloud", "Known", "Uncertainty", "check_count", "cloud_of", "drawn_friction", "interval",
    "known_of", "known_values", "of_compensation", "of_run", "share_of", "torque_scale",
]  # fmt: skip
