"""The grammar of commands as data: a command, its options, and what the texts of options mean."""

from __future__ import annotations

import argparse
from argparse import ArgumentTypeError, Namespace
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from feedsim.errors import InputError

T = TypeVar("T")


class Option:
    """An option or argument: what is typed, what its value is called, what it is for.

    many: it may be given several times, and is a list. more: what argparse takes besides. With neither a name for the
    value nor anything else it is a switch.
    """

    def __init__(self, typed: str, value: str, help: str, *, many: bool = False, **more: Any) -> None:
        self.typed = typed
        self.words: dict[str, Any] = {"help": help, **more}
        if value:
            self.words["metavar"] = value
        elif not more:
            self.words["action"] = "store_true"
        if many:
            self.words |= {"action": "append", "default": []}

    def add_to(self, parser: argparse._ActionsContainer) -> None:
        """Add it to a parser or a group."""
        parser.add_argument(self.typed, **self.words)


class Group:
    """Options that the help shows under a title; without one: of which one at most can be given."""

    def __init__(self, title: str, *options: Option | Group) -> None:
        self.title, self.options = title, options

    def add_to(self, parser: argparse._ActionsContainer) -> None:
        """Add them to a parser or a group."""
        group: argparse._ActionsContainer
        group = parser.add_argument_group(self.title) if self.title else parser.add_mutually_exclusive_group()
        for option in self.options:
            option.add_to(group)


def flat(options: Sequence[Option | Group]) -> Iterator[Option]:
    """Options and arguments, those of groups included."""
    for option in options:
        yield from flat(option.options) if isinstance(option, Group) else (option,)


WRITES = ("--out", "--report")  # options that name what a command writes
FORCE = Option("--force", "", "replace files that feedsim did not write, and results of another kind; never an input")


@dataclass(frozen=True)
class Command:
    """A command of the command line, or a group of commands.

    action: takes the parsed options, returns an exit code or None for 0. epilog: of a description whose lines are kept.
    needs: the extras without which it is not begun. job: the public function of Python that it calls.
    """

    name: str
    help: str
    action: Callable[[Namespace], int | None] | None = None
    options: Sequence[Option | Group] = ()
    description: str | None = None
    epilog: str | None = None
    commands: Sequence[Command] = ()
    needs: Sequence[str] = ("run",)
    job: str = ""

    def add_to(self, commands: argparse._SubParsersAction[Any]) -> None:
        """Add it to a command line."""
        kept = argparse.RawDescriptionHelpFormatter if self.epilog else argparse.HelpFormatter
        parser = commands.add_parser(
            self.name, help=self.help, description=self.description, epilog=self.epilog, formatter_class=kept
        )
        for option in self.options:
            option.add_to(parser)
        arguments = tuple(option.typed for option in flat(self.options) if not option.typed.startswith("-"))
        if any(option.typed in WRITES for option in flat(self.options)):
            FORCE.add_to(parser)
        if self.commands:
            own = parser.add_subparsers(dest=f"{self.name}_command", metavar="COMMAND", required=True)
            for command in self.commands:
                command.add_to(own)
        else:
            parser.set_defaults(action=self.action, needs=self.needs, called=parser.prog, arguments=arguments)


def folder(text: str) -> Path:
    """Where results go; an empty text is an error of usage."""
    if not text:
        raise ArgumentTypeError("a directory is needed, not an empty text; '.' is the working directory")
    return Path(text)


FMUS = Option("--fmus", "DIR", "folder of the archives (default: $FEEDSIM_FMUS, else those that come along)", type=Path)
QUIET_OPTION = Option("--quiet", "", "no progress bar and no summary")


def out(default: str) -> Option:
    """--out; default: the folder of results/ otherwise."""
    return Option("--out", "DIR", f"where the results go (default: results/{default})", type=folder)


def _kinds(text: str) -> tuple[str, ...]:
    """Kinds of files of figures."""
    from feedsim.report.picture import PICTURE_FORMATS

    asked = names(text)
    if not asked or any(kind not in PICTURE_FORMATS for kind in asked):
        raise ArgumentTypeError(f"{text!r}: of {', '.join(PICTURE_FORMATS)}, one or several, with commas between them")
    return tuple(dict.fromkeys(asked))


FIGURES = Option(
    "--figures", "png,svg", "draw the figures for print, too, into the folder figures: png, svg or both", type=_kinds,
    default=(),
)  # fmt: skip


CONTROL_CHOICES = ("sinumerik", "twincat", "heidenhain", "linuxcnc")
CONTROL = Option(
    "--control", "NAME", f"show parameters in the names and units of a control, too: {', '.join(CONTROL_CHOICES)} "
    "(default: "
    "the one that the machine file names)", choices=CONTROL_CHOICES, default="",
)  # fmt: skip


_COUNT = "(N: 19 or more, 39 hold 95 %%; default: none)"
UNCERTAIN = Option(
    "--uncertain", "N", "repeat with N draws of the machine from the intervals of its identified values; figures get "
    f"intervals, curves bands {_COUNT}", type=int, default=0,
)  # fmt: skip
JUDGED_ON_DRAWS = Option(
    "--uncertain", "N", "find values that suit a few draws of the machine, too, and judge them on N others, from the "
    f"intervals of its identified values; figures get intervals {_COUNT}", type=int, default=0,
)  # fmt: skip


def typed(text: str) -> str:
    """What was typed, also under a locale of few characters, such as C: it is taken for UTF-8 there."""
    try:
        return text.encode("utf-8", "surrogateescape").decode("utf-8")
    except UnicodeDecodeError:
        raise ArgumentTypeError("not UTF-8") from None


def settings(example: str = "machine.axes.Z.friction.F_C='1.8 N.m'") -> Option:
    """--set, with an example of KEY=VALUE."""
    words = f"override one entry, e.g. {example}, or those of a YAML file with a group set; may be given several times"
    return Option("--set", "KEY=VALUE", words, dest="overrides", many=True, type=typed)


@contextmanager
def given(option: str, text: str) -> Iterator[None]:
    """Have a fault that the block finds say which option it is of: "--delay 3 kg: ..."."""
    try:
        yield
    except InputError as error:
        raise InputError(f"--{option} {text}: {error}") from None


def quantity(option: str, text: str, unit: str, example: str = "", *, positive: bool = False) -> float:
    """The value of a text in `unit`; positive: above 0. Raises InputError."""
    with given(option, text):
        return amount(text, unit, example, positive=positive)


def amount(text: str, unit: str, example: str = "", *, positive: bool = False) -> float:
    """As :func:`quantity`, of a text that is a part of what was typed."""
    from feedsim import units

    value = units.parse(text, unit, example)
    if positive and value <= 0:
        raise InputError(f"more than zero is needed, e.g. {example}")
    return value


def halves(option: str, text: str, needed: str) -> tuple[str, str]:
    """What stands before and behind the first "=". needed: of the message of InputError, where a half is missing."""
    left, equals, right = (part.strip() for part in text.partition("="))
    if not (left and equals and right):
        raise InputError(f"--{option} {text}: {needed}")
    return left, right


def by_name(
    option: str, texts: Sequence[str], needed: str, read: Callable[[str, str], T], *, common: bool = False
) -> dict[str, T]:
    """Name -> what `read` makes of name and value, of texts NAME=VALUE, such as AXIS=POSITION.

    needed: as for :func:`halves`. common: a value without a name is allowed, and stands under "".
    Raises InputError, which names the option and the text: no such form, a name twice, what `read` finds.
    """
    result: dict[str, T] = {}
    for text in texts:
        name, value = ("", text) if common and "=" not in text else halves(option, text, needed)
        with given(option, text):
            if name in result:
                raise InputError(f"{name or 'that of all axes'} is given twice")
            result[name] = read(name, value)
    return result


def pairs(option: str, texts: Sequence[str], needed: str, *, common: bool = False) -> dict[str, str]:
    """Name -> text of texts NAME=TEXT; needed, common, errors: as of :func:`by_name`."""
    return by_name(option, texts, needed, lambda _, text: text, common=common)


def lengths(option: str, texts: Sequence[str], value: str, example: str, *, positive: bool = False) -> dict[str, float]:
    """Axis -> length [m] of texts such as X=800mm; value: what it is called. Raises InputError as :func:`by_name`."""
    needed = f"AXIS={value} is needed, e.g. X={example}"
    return by_name(option, texts, needed, lambda _, text: amount(text, "m", example, positive=positive))


def names(text: str) -> tuple[str, ...]:
    """What stands between the commas."""
    return tuple(part.strip() for part in text.split(",") if part.strip())
