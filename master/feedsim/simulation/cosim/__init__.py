"""Co-simulation of the units: archives, instances, roles, wiring, what a control cycle is, run, log.

May use nc, structure and what is below them; sole user of fmpy and of the native loop.
Start with run.py: ``run``; then schedule.py, which says once what a control cycle is, and system.py, on which units.
"""

from feedsim.foundation.installation import fmus_directory
from feedsim.simulation.cosim.exchange import describe_archive_programs, describe_programs
from feedsim.simulation.cosim.run import Crossings, Follower, OpenUnits, Run, check, follow, logged, run
from feedsim.simulation.cosim.schedule import Progress

__all__ = [
    "Crossings",
    "Follower",
    "OpenUnits",
    "Progress",
    "Run",
    "check",
    "describe_archive_programs",
    "describe_programs",
    "fmus_directory",
    "follow",
    "logged",
    "run",
]  # fmt: skip
