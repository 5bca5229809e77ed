"""The machine's structure as modes: the mode table, what it says of the axes, whether it fits the machine file."""

from feedsim.structure.modes import Modes, checked_modes, read_modes

__all__ = ["Modes", "checked_modes", "read_modes"]
