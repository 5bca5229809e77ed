"""The grammar of commands as data: a command, its options, and what the texts of options mean."""

from __future__ import annotations

import argparse
import inspect
from argparse import ArgumentTypeError, BooleanOptionalAction, Namespace
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from feedsim.errors import InputError


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
TERMINALS = Option(
    "--terminals",
    "",
    "with terminals and icons (default: yes; --no-terminals for importers with FMI Library 3, which refuses them)",
    action=BooleanOptionalAction,
    default=True,
)
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
    return Option("--set", "KEY=VALUE", words, many=True, type=typed)


def arguments(job: Callable[..., Any], options: Namespace) -> dict[str, Any]:
    """What the options of a command say of the parameters of its job, which have their names."""
    said = vars(options)
    parameters = inspect.signature(job).parameters.values()
    return {each.name: said[each.name] for each in parameters if each.name in said and each.kind != each.VAR_POSITIONAL}


def halves(option: str, text: str, needed: str) -> tuple[str, str]:
    """What stands before and behind the first "=". needed: of the message of InputError, where a half is missing."""
    left, equals, right = (part.strip() for part in text.partition("="))
    if not (left and equals and right):
        raise InputError(f"--{option} {text}: {needed}")
    return left, right


def pairs(option: str, texts: Sequence[str], needed: str, *, common: bool = False) -> dict[str, str]:
    """Name -> text of texts NAME=TEXT, such as AXIS=POSITION.

    needed: as for :func:`halves`. common: a text without a name is allowed, and stands under "".
    Raises InputError, which names the option and the text: no such form, a name twice.
    """
    result: dict[str, str] = {}
    for text in texts:
        name, value = ("", text) if common and "=" not in text else halves(option, text, needed)
        if name in result:
            raise InputError(f"--{option} {text}: {name or 'that of all axes'} is given twice")
        result[name] = value
    return result


def names(text: str) -> tuple[str, ...]:
    """What stands between the commas."""
    return tuple(part.strip() for part in text.split(",") if part.strip())
