"""``feedsim machine``: build, info, show, pack: what is done with a machine rather than with a scenario.

May use what every command may.
Start with show.py, the smallest one; its neighbours share its grammar.
"""

from feedsim.cli.machine.figures import BUILD, INFO
from feedsim.cli.machine.pack import PACK
from feedsim.cli.machine.show import SHOW
from feedsim.cli.options import Command

COMMAND = Command("machine", "build, look at and pack a machine", commands=(BUILD, INFO, SHOW, PACK))
