"""Whether a result can be trusted: control loops, the exchange of the units, loads, limits, the pose of the plant.

May use cosim, linear, structure and what is below them. It judges a finished run, or a scenario before its first step.
Start with run.py: ``judged``; each of the other files judges one thing.
"""

from feedsim.judge.run import JudgedRun, PoseUse, check, judged

__all__ = ["JudgedRun", "PoseUse", "check", "judged"]
