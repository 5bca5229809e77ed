"""``feedsim machine``: build, info, show, pack, import, export: what is done with a machine, not a scenario.

May use what every command may.
Start with show.py, the smallest one; its neighbours share its grammar.
"""

from feedsim.cli.machine.control import EXPORT, IMPORT
from feedsim.cli.machine.figures import BUILD, INFO
from feedsim.cli.machine.pack import PACK
from feedsim.cli.machine.show import SHOW
from feedsim.cli.options import Command

COMMAND = Command(
    "machine",
    "build, look at and pack a machine; import it from a control, export it",
    commands=(BUILD, INFO, SHOW, PACK, IMPORT, EXPORT),
)
