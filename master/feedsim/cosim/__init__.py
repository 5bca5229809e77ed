"""Co-simulation of the units: instances, wiring, schedule, run (sole user of fmpy, in `unit`)."""

from feedsim.cosim.logging import logged
from feedsim.cosim.loop import Progress
from feedsim.cosim.pose import Crossings, PoseUse
from feedsim.cosim.run import Run, check, fmus_directory, run
from feedsim.cosim.schedule import SCHEMES, Scheme

__all__ = ["SCHEMES", "Crossings", "PoseUse", "Progress", "Run", "Scheme", "check", "fmus_directory", "logged", "run"]
