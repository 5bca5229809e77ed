"""``feedsim machine``: build, info, show, pack."""

from feedsim.cli.machine.commands import add_commands

__all__ = ["add_commands"]
