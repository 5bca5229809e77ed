"""The machine's structure: from geometry or matrices to modes, what they say of the axes, what a pose changes in them.

May use scenario, trace and, to pack a machine, the packager. Modes as a run takes them are at the front door.
Start with modes.py for what a run reads, with build.py for how modes are made.
"""

from feedsim.structure.modes import Modes, checked_modes, read_modes

__all__ = ["Modes", "checked_modes", "read_modes"]
