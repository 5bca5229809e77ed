"""How the command line is read: names in full, and the nearest name where one is misspelt.

May use: errors. Start with Parser; command.add_to() in options.py gives it its commands and options.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from typing import Any, NoReturn

from feedsim.errors import nearest


class Parser(argparse.ArgumentParser):
    """A parser of one command. Options have no short forms of their own making: "--ou" is not "--out"."""

    def __init__(self, **words: Any) -> None:
        super().__init__(**{**words, "allow_abbrev": False})

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> tuple[Any, list[str]]:
        """As argparse's. What is not known is an error of the command that it was given to, not of feedsim."""
        given, unknown = super().parse_known_args(args, namespace)
        if unknown:
            self.error(self._unknown(unknown))
        return given, unknown

    def error(self, message: str) -> NoReturn:
        """End with status 2. An option that does not exist is named before what else is missing."""
        if message.startswith("the following arguments are required: ") and (wrong := self._misspelt()):
            message = self._unknown(wrong)
        end = "" if message.endswith("?") else ";"
        self.exit(2, f"{self.prog}: error: {message}{end} {self.prog} --help lists what there is\n")

    def _parse_known_args(self, arg_strings: list[str], *more: Any, **named: Any) -> Any:
        self._typed = arg_strings
        return super()._parse_known_args(arg_strings, *more, **named)

    def _misspelt(self) -> list[str]:
        typed = getattr(self, "_typed", [])
        typed = typed[: typed.index("--")] if "--" in typed else typed
        return [word for word in typed if word.startswith("--") and word.partition("=")[0] not in self.known()]

    def known(self) -> list[str]:
        """Options of this command, as they are typed."""
        return [name for action in self._actions for name in action.option_strings]

    def _unknown(self, words: Sequence[str]) -> str:
        options = [word.partition("=")[0] for word in words if word.startswith("-")]
        return "; ".join(self._sentences(options)) if options else f"not understood: {' '.join(words)}"

    def _sentences(self, options: Sequence[str]) -> Iterator[str]:
        for option in options:
            yield f"no option {option}{_meant(option, [name for name in self.known() if name.startswith('--')])}"

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is None or value in action.choices:
            return
        known = [str(choice) for choice in action.choices]
        what = "command" if isinstance(action, argparse._SubParsersAction) else action.dest
        raise argparse.ArgumentError(None, f"no {what} {value!r}{_meant(str(value), known)}")


def _meant(word: str, known: Sequence[str]) -> str:
    """The tail of a message about a name that there is not."""
    begins = [name for name in known if len(word) > 2 and name.startswith(word)]
    near = begins[0] if len(begins) == 1 else nearest(word, known)
    return f"; did you mean {near}?" if near else f"; there is {', '.join(known)}"
