"""The NC: a scenario's motions laid end to end, as setpoints at the position cycle; signals that excite a drive.

May use the scenario with its motions, and trace. Sole user of the splines through points.
Start with program.py: ``plan``.
"""

from feedsim.simulation.nc.program import Program, Segment, plan

__all__ = ["Program", "Segment", "plan"]
