"""``feedsim machine``: build, info, show, pack, import: what is done with a machine rather than with a scenario.

May use what every command may.
Start with show.py, the smallest one; its neighbours share its grammar.
"""

from feedsim.cli.machine.control import IMPORT
from feedsim.cli.machine.figures import BUILD, INFO
from feedsim.cli.machine.pack import PACK
from feedsim.cli.machine.show import SHOW
from feedsim.cli.options import Command

COMMAND = Command("machine", "build, look at, pack and import a machine", commands=(BUILD, INFO, SHOW, PACK, IMPORT))
