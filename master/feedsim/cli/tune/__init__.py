"""``feedsim tune``: values of a control, found on a simulated machine.

May use what every command may.
Start with compensation.py and drive.py.
"""

from feedsim.cli.options import Command
from feedsim.cli.tune.compensation import COMPENSATION
from feedsim.cli.tune.drive import DRIVE

COMMAND = Command("tune", "find values of a control on the simulated machine", commands=(COMPENSATION, DRIVE))
