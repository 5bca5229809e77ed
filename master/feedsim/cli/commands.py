"""Which commands there are, and the parser that follows from the declarations of their jobs.

May use: jobs/parameters, whose COMMANDS lists them, errors. Start reading at add_options(), which makes the options of
a command from the signature of its job.
"""

from __future__ import annotations

import argparse
import io
import json
import math
import os
import re
import sys
from argparse import ArgumentTypeError, BooleanOptionalAction, Namespace
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import asdict, dataclass
from functools import cache, cached_property
from importlib import import_module
from pathlib import Path
from typing import Any, NoReturn, TextIO
from unicodedata import category

from feedsim.foundation.errors import WRONG, Finding, InputError, find_nearest_name, no_such_file, rank_findings
from feedsim.jobs.parameters import COMMANDS, Argument, Declaration, Option, Parameter, Watch, job_of_command

GROUPS = {
    "identify": "friction, drives, modes or mounts from records",
    "tune": "values of a drive, or of a friction compensation",
    "machine": "build and view a machine; import it from a control, export it",
    "tools": "schemas of files, conversion of records, completion in shells",
}
# Names of version 0.2 -> words of today. They work for one version more.
OLD_COMMANDS = {
    "validate": "check",
    "identify-drive": "identify drive",
    "identify-modes": "identify modes",
    "compensate": "tune feedforward",
    "show": "diff",
    "pack": "export",
    "ssp": "export",
    "page": "export",
    "machine pack": "export --plant",
    "machine show": "machine view",
    "schema": "tools schema",
    "convert": "tools convert",
    "completion": "tools completion",
}
OLD_OPTIONS = {"--axis": "--axes", "--all": "-v"}
# What every command takes besides the parameters of its job.
COMMON = {
    "quiet": Option("", "print warnings and errors alone", short="-q"),
    "verbose": Option("", "print all figures, too", short="-v"),
    "json": Option("", "print the result as JSON, and nothing else"),
    "strict": Option("", "end with status 1 where a finding is WRONG"),
    "color": Option("WHEN", "auto, always or never (default: auto)", choices=("auto", "always", "never")),
}


@dataclass(frozen=True)
class Command:
    """A command: what stands behind "feedsim", such as "machine info", and where its job is."""

    name: str
    home: str

    @cached_property
    def declared(self) -> Declaration:
        """The job as its source declares it."""
        return job_of_command(self.name)

    @property
    def options(self) -> list[Parameter]:
        """Parameters of the job that the command line has."""
        return [parameter for parameter in self.declared.parameters if parameter.option is not None]

    def job(self) -> Any:
        """The function itself."""
        module, _, function = self.home.partition(":")
        return getattr(import_module(f"feedsim.{module}"), function)

    def missing_file(self, options: Namespace) -> str:
        """A sentence on the first file that is named and is not there; "" where all are."""
        for parameter in self.options:
            option = parameter.option or Option()
            if not _is_path(parameter) or option.writes:
                continue
            value = getattr(options, parameter.name, None)
            for path in value if isinstance(value, list) else [value]:
                if path is not None and not _is_there(path):
                    typed = f"{parameter.typed}: " if parameter.typed else ""
                    return typed + no_such_file(path, "folder" if option.value == "DIR" else "file")
        return ""

    def default_out(self, options: Namespace) -> Path | None:
        """Where the result goes if nobody says so: below results/, by the names of what it is made of."""
        option = next((p.option for p in self.options if p.name == "out"), None)
        if option is None or not option.default:
            return None
        values = {name: _stem(value) for name, value in vars(options).items()}
        return Path("results") / option.default.format_map(_Open(values))


class _Open(dict[str, str]):
    """Names that are not known stay as they are: the axis that a record is of is found by the job."""

    def __missing__(self, name: str) -> str:
        return f"{{{name}}}"


def _stem(value: Any) -> str:
    first = value[0] if isinstance(value, list) and value else value
    path = Path(str(first))
    return path.resolve().name if path.is_dir() else path.stem


@cache
def commands() -> tuple[Command, ...]:
    """All of them."""
    return tuple(Command(name, home) for name, home in COMMANDS.items())


def rename_words(words: Sequence[str]) -> tuple[list[str], list[str]]:
    """Words of the command line in names of today, and a sentence on every name that was another one."""
    result, notes = [*words], []
    plain = next((k for k, word in enumerate(result) if not word.startswith("-")), len(result))
    first, pair = " ".join(result[plain : plain + 1]), " ".join(result[plain : plain + 2])
    old = pair if pair in OLD_COMMANDS else first if first in OLD_COMMANDS else ""
    if old:
        result[plain : plain + len(old.split())] = OLD_COMMANDS[old].split()
        notes.append(f"feedsim {old} is called feedsim {OLD_COMMANDS[old]}")
    elif first == "sweep" and {"--dry-run", "--row"} & {word.partition("=")[0] for word in result}:
        result = [*result[:plain], "check", *_words_of_check(result[plain + 1 :])]
        notes.append("feedsim sweep --dry-run and --row are called feedsim check --trial and --row")
    elif first == "compare" and (file := _file_of_json(result)):
        Parser(prog="feedsim compare").error(f"--json prints the result now: feedsim compare ... --json > {file}")
    elif first == "run" and "--try" in result:
        result.remove("--try")
        result[plain : plain + 1] = ["tune", "proposals"]
        notes.append("feedsim run --try is called feedsim tune proposals")
    elif (
        first == "identify"
        and result[plain + 1 :]
        and result[plain + 1] not in _subcommands("identify") | {"-h", "--help"}
    ):
        result.insert(plain + 1, "friction")
        notes.append("feedsim identify is called feedsim identify friction")
    for k, word in enumerate(result):
        name, equals, value = word.partition("=")
        if name in OLD_OPTIONS:
            result[k] = OLD_OPTIONS[name] + equals + value
            notes.append(f"the option {name} is called {OLD_OPTIONS[name]}")
    return result, [f"{note} now; the old name goes with the next version" for note in dict.fromkeys(notes)]


def _file_of_json(words: Sequence[str]) -> str:
    """The file that ``compare --json FILE`` of version 0.2 wrote; "" where the words are of today."""
    behind = next((words[k : k + 2] for k, word in enumerate(words) if word.partition("=")[0] == "--json"), [])
    named = [*behind[:1][0].split("=")[1:], *behind[1:]] if behind else []
    return next((word for word in named if word.lower().endswith(".json")), "")


def _words_of_check(words: Sequence[str]) -> Iterator[str]:
    """Words behind ``sweep`` of version 0.2 as ``check`` takes them: options that it lacks, such as --out, go."""
    takes_value = {
        command.name: {
            flag: bool(parameter.option.value or parameter.option.choices)
            for parameter in command.options if parameter.option
            for flag in (parameter.typed, parameter.option.short)
        }
        for command in commands() if command.name in ("sweep", "check")
    }  # fmt: skip
    rest = iter(words)
    for word in rest:
        name, equals, _ = word.partition("=")
        if name in takes_value["check"] or name not in takes_value["sweep"]:
            yield "--trial" if word == "--dry-run" else word
        elif takes_value["sweep"][name] and not equals:
            next(rest, None)


def _subcommands(group: str) -> set[str]:
    return {name.split()[1] for name in COMMANDS if name.startswith(f"{group} ")}


def add_commands(top: argparse.ArgumentParser, only: str = "") -> None:
    """Add the commands to the parser; where `only` is the first word of some, their options alone are read."""
    places: dict[str, Any] = {"": top.add_subparsers(dest="command", metavar="COMMAND")}
    chosen = [command for command in commands() if command.name.split()[0] == only] or commands()
    for command in chosen:
        group, _, name = command.name.rpartition(" ")
        if group not in places:
            parser = places[""].add_parser(group, help=GROUPS[group], description=f"{_capital(GROUPS[group])}.")
            places[group] = parser.add_subparsers(dest=f"{group}_command", metavar="COMMAND", required=True)
        declared = command.declared
        parser = places[group].add_parser(
            name,
            help=declared.help,
            description=declared.description,
            epilog=f"examples:\n{_indent_text(declared.examples)}" if declared.examples else None,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        add_options(parser, command)
        parser.set_defaults(chosen=command, called=f"feedsim {command.name}")


def _capital(text: str) -> str:
    return text[0].upper() + text[1:]


def _indent_text(text: str) -> str:
    return "\n".join(f"  {line}" if line else "" for line in text.splitlines())


def add_options(parser: argparse.ArgumentParser, command: Command) -> None:
    """The options of a command from the signature of its job, and those that all commands have."""
    groups: dict[str, Any] = {"": parser}
    for parameter in command.options:
        assert parameter.option is not None
        if parameter.option.group not in groups:
            groups[parameter.option.group] = parser.add_argument_group(parameter.option.group)
        flags, words = _words(parameter, parameter.option)
        action = groups[parameter.option.group].add_argument(*flags, **words)
        if parameter.option.complete:
            action.completer = _completer(parameter.option.complete)
    common = parser.add_argument_group("every command")
    taken = {parameter.name for parameter in command.options}
    for name, option in COMMON.items():
        if name not in taken:
            flags, words = _words(Parameter(name, "", option, ""), option)
            words["default"] = "auto" if option.value else False
            common.add_argument(*flags, **words)


def _completer(home: str) -> Callable[..., list[str]]:
    """What argcomplete asks for the values that a shell offers."""

    def values(**given: object) -> list[str]:
        module, _, function = home.partition(":")
        return list(getattr(import_module(f"feedsim.{module}"), function)())

    return values


def _is_there(path: Path) -> bool:
    """Whether there is a file or folder of that name; of a name that no disk takes the job says what is wrong."""
    try:
        return path.exists()
    except (OSError, ValueError):
        return True


def _is_path(parameter: Parameter) -> bool:
    """Whether its value is the name of a file or folder, or several."""
    return bool(re.search(r"\bFile\b", parameter.type)) and not re.search("Mapping|Pairs", parameter.type)


def _words(parameter: Parameter, option: Option) -> tuple[list[str], dict[str, Any]]:
    """What argparse takes for a parameter."""
    words: dict[str, Any] = {"help": option.help.replace("%", "%%")}
    if option.value:
        words["metavar"] = option.value
    if option.choices:
        words["choices"] = option.choices
    if _is_path(parameter):
        words["type"] = _path
    elif parameter.name == "figures":
        words["type"] = _kinds
    elif "int" in parameter.type.split(" | ") and "str" not in parameter.type:
        words["type"] = int
    else:
        words["type"] = _text
    # What is not typed is not handed over: the defaults are those of the job.
    words["default"] = argparse.SUPPRESS
    needed = parameter.default is None
    if isinstance(option, Argument):
        if option.many:
            words["nargs"] = "+" if needed else "*"
        elif not needed:
            words |= {"nargs": "?", "default": None}  # argparse would take the mark for the value
        return [parameter.name], words
    words |= {"dest": parameter.name, "required": needed or (parameter.name == "out" and not option.default)}
    if not option.value and not option.choices:
        del words["type"]
        words["action"] = BooleanOptionalAction if parameter.default == "True" else "store_true"
    elif option.several:
        words |= {"nargs": "+", "action": "extend"}
    elif option.many:
        words["action"] = "append"
    return [*([option.short] if option.short else []), parameter.typed], words


def _kinds(text: str) -> tuple[str, ...]:
    """Kinds of files of figures."""
    from feedsim.foundation.arguments import split_names
    from feedsim.report.content import PICTURE_FORMATS

    asked = split_names(text)
    if not asked or any(kind not in PICTURE_FORMATS for kind in asked):
        raise ArgumentTypeError(f"{text!r}: of {', '.join(PICTURE_FORMATS)}, one or several, with commas between them")
    return tuple(dict.fromkeys(asked))


def _path(text: str) -> Path:
    if not text:
        raise ArgumentTypeError("a name is needed, not an empty text; '.' is the working directory")
    return Path(text)


def _text(text: str) -> str:
    """What was typed, also under a locale of few characters, such as C: it is taken for UTF-8 there."""
    try:
        return text.encode("utf-8", "surrogateescape").decode("utf-8")
    except UnicodeDecodeError:
        raise ArgumentTypeError("not UTF-8") from None


def arguments(command: Command, options: Namespace) -> dict[str, Any]:
    """Parameter -> value for the job, of what was typed."""
    typed = vars(options)
    result = {p.name: typed[p.name] for p in command.options if typed.get(p.name) is not None}
    if "out" not in result and (place := command.default_out(options)) is not None:
        result["out"] = place
    return result


def files_of_arguments(command: Command, options: Namespace) -> Iterator[tuple[str, Any]]:
    """Arguments of a command that name files: ("", value), and the value of --machine: ("--machine", value)."""
    for parameter in command.options:
        if isinstance(parameter.option, Argument):
            yield "", getattr(options, parameter.name, None)
        elif parameter.name == "machine":
            yield "--machine", getattr(options, parameter.name, None)


def refuse_missing_files(command: Command, options: Namespace) -> None:
    """Raise InputError for a file that is named and is not there: before any library is loaded that would read it."""
    if command.name == "compare":  # a pair without its file is one of its verdicts
        return
    if sentence := command.missing_file(options):
        raise InputError(sentence)


# --- How the command line is read: names in full, and the nearest name where one is misspelt --------------------------


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
        if message.startswith("the following arguments are required: ") and (wrong := self._unknown_options()):
            message = self._unknown(wrong)
        end = "" if message.endswith("?") else ";"
        self.exit(2, f"{self.prog}: error: {message}{end} {self.prog} --help lists what there is\n")

    def _parse_known_args(self, arg_strings: list[str], *more: Any, **named: Any) -> Any:
        self._typed = arg_strings
        return super()._parse_known_args(arg_strings, *more, **named)

    def _unknown_options(self) -> list[str]:
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
            yield f"no option {option}{_suggest_word(option, [name for name in self.known() if name.startswith('--')])}"

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is None or value in action.choices:
            return
        known = [str(choice) for choice in action.choices]
        what = "command" if isinstance(action, argparse._SubParsersAction) else action.dest
        raise argparse.ArgumentError(None, f"no {what} {value!r}{_suggest_word(str(value), known)}")


def _suggest_word(word: str, known: Sequence[str]) -> str:
    """The tail of a message about a name that there is not."""
    begins = [name for name in known if len(word) > 2 and name.startswith(word)]
    near = begins[0] if len(begins) == 1 else find_nearest_name(word, known)
    return f"; did you mean {near}?" if near else f"; there is {', '.join(known)}"


# --- What commands say while they work and in the end: a progress bar, warnings, what has been made -------------------


STANDARD_OUTPUT = "standard output"  # what an error calls it


class TerminalWatch(Watch):
    """Shows what a job reports: a progress bar, and sentences on standard error."""

    def __init__(self, bar: Any, quiet: bool) -> None:
        """bar: of tqdm; None where nobody looks."""
        self._bar, self._quiet = bar, quiet
        self._what: str | None = None
        self.command = ("feedsim", *sys.argv[1:])  # not where it is installed: records are sent to others
        self.done, self.total = 0, 0

    def progress(self, what: str, done: int, total: int, before: int = 0, note: str = "") -> None:
        """How many of its steps are done, of how many. before: done earlier, which do not count for the rate."""
        self.done, self.total = done, total
        if self._bar is None:
            return
        if what != self._what:
            self._what = what
            self._bar.reset(total)
            self._bar.set_description(visible(what), refresh=not before)
            if before:
                self._bar.initial = self._bar.n = before
                self._bar.refresh()
        if note:
            self._bar.set_postfix_str(visible(note), refresh=False)
        self._bar.update(done - self._bar.n)

    def _aside(self) -> AbstractContextManager[Any]:
        """A block that prints beside the bar."""
        return nullcontext() if self._bar is None else self._bar.external_write_mode(file=_plain_error())

    def announce(self, sentence: str) -> None:
        """Whose programs the job executes."""
        with self._aside():
            print(f"feedsim: {sentence}", file=sys.stderr)

    def note(self, sentence: str) -> None:
        """What the job will replace."""
        with self._aside():
            warn([Finding("result-replaced", "note", sentence)])

    def warn(self, findings: Iterable[Finding]) -> None:
        """What is the matter with the files that the job begins with."""
        with self._aside():
            warn(findings)

    def say(self, sentence: str) -> None:
        """What takes longer, and why."""
        if not self._quiet:
            self.announce(sentence)


class _Standard(io.FileIO):
    """Standard output or error. That nobody hears what is said on the latter is no reason to end."""

    def write(self, data: Any) -> int:
        try:
            return super().write(data) or 0
        except OSError as error:
            if self.fileno() == 2:
                return len(data)
            error.filename = STANDARD_OUTPUT
            raise


def prepare_streams() -> None:
    """Make of the standard streams what can be printed to, whatever they are: closed, full, of few characters.

    What cannot be shown comes as an escape. A closed stream is one whose reader has gone: what is printed is lost.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:  # else the next file that is opened has the number, and what prints to that writes into it
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)
    for number, name in ((1, "stdout"), (2, "stderr")):
        stream = getattr(sys, name)
        if stream is None or isinstance(stream, io.TextIOWrapper):
            buffer = io.BufferedWriter(_Standard(number, "w", closefd=False))
            lines = number == 2 or stream is None or stream.line_buffering
            encoding = stream.encoding if stream is not None else "utf-8"
            wrapper = io.TextIOWrapper(buffer, encoding, "backslashreplace", line_buffering=lines)
            setattr(sys, name, SafeStream(wrapper))


def _plain_error() -> Any:
    """Standard error for a progress bar, which moves the cursor."""
    return sys.stderr.stream if isinstance(sys.stderr, SafeStream) else sys.stderr


@contextmanager
def watch_job(quiet: bool) -> Iterator[TerminalWatch]:
    """Who watches a job for the person at the terminal: with a progress bar, unless `quiet` or where nobody looks."""
    if quiet or not sys.stderr.isatty():
        yield TerminalWatch(None, quiet)
        return
    from tqdm import tqdm

    tqdm.monitor_interval = 0  # its thread would keep a process from being forked (foundation/parallel.py)
    with tqdm(unit_scale=True, leave=False, file=_plain_error()) as bar:
        yield TerminalWatch(bar, quiet)


COLOURS = {"red": 31, "yellow": 33}
_COLOUR_MODE = {"colour": "auto"}


def choose_colour(when: str) -> None:
    """Colour what is printed from now on: "always", "never", or "" and "auto" where a terminal shows it."""
    _COLOUR_MODE["colour"] = when or "auto"


class PaintedText(str):
    """Text with the colours of this program, which Shown lets pass."""

    def __str__(self) -> str:
        return self


class SafeStream:
    """A stream that obeys no control character of what is printed to it: text comes from files of other people.

    Line feeds and tabs stay. All that commands print goes through here, tracebacks included; tqdm writes past it.
    """

    def __init__(self, stream: TextIO) -> None:
        self.stream = stream

    def write(self, text: str) -> int:
        if not (isinstance(text, PaintedText) or text.isprintable()):
            text = "\n".join("\t".join(map(visible, line.split("\t"))) for line in text.split("\n"))
        return self.stream.write(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)


@contextmanager
def shown_streams() -> Iterator[None]:
    """Standard output and error as Shown for the block; what they have become in it otherwise stays, such as None."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is not None and not isinstance(stream, SafeStream):
            setattr(sys, name, SafeStream(stream))
            try:
                with shown_streams():
                    yield
            finally:
                if isinstance(getattr(sys, name), SafeStream):
                    setattr(sys, name, stream)
            return
    yield


def visible(line: str) -> str:
    """As the terminal may show it: names come from files, and control characters in them are not obeyed."""
    return "".join(
        c if c.isprintable() or category(c) == "Zs" else c.encode("unicode_escape").decode("ascii") for c in line
    )


def paint_text(text: str, colour: str, stream: Any) -> str:
    """The text in a colour where a stream is a terminal that shows some, and NO_COLOR (no-color.org) is not set."""
    text = "\n".join(visible(line) for line in text.split("\n"))
    plain = bool(os.environ.get("NO_COLOR")) or os.environ.get("TERM") == "dumb" or not stream.isatty()
    if not colour or _COLOUR_MODE["colour"] == "never" or (plain and _COLOUR_MODE["colour"] == "auto"):
        return text
    return PaintedText(f"\x1b[{COLOURS[colour]}m{text}\x1b[0m")


def warn(warnings: Iterable[Finding]) -> None:
    """Say on standard error what the user should know before believing the results; what is wrong first."""
    for finding in rank_findings(warnings):
        kind, colour = {"wrong": (WRONG, "red"), "doubt": ("warning: ", "yellow"), "note": ("note: ", "")}[
            finding.severity
        ]
        print(paint_text(f"feedsim: {kind}{finding}", colour, sys.stderr), file=sys.stderr)


def finish(result: Any, out: Any, options: Namespace) -> int:
    """Print what a job returned, and return the exit code.

    Findings go to standard error. What is wrong is the first line of the output besides, which may be all that is read.
    """
    from feedsim.jobs.result import Result

    if not hasattr(result, "findings"):  # a schema, names of files, a script: what the command is for
        print(*_plain_lines(result), sep="\n")
        return 0
    quiet = bool(options.quiet or options.json is True)
    said = () if quiet or not isinstance(result, Result) else result.in_lines
    findings = rank_findings(finding for finding in result.findings if finding not in said)
    warn(findings)
    code = getattr(result, "exit_code", 0)
    try:
        if options.json is True:
            print(json_of(result, out))
        elif not options.quiet:
            both = sys.stdout is not None and sys.stdout.isatty() and sys.stderr.isatty()  # it stands there already
            wrong = [finding.marked for finding in findings[:1] if finding.severity == "wrong" and not both]
            for line in (
                *(paint_text(text, "red", sys.stdout) for text in wrong),
                *_lines(result, options.verbose, out),
            ):
                print(line)
        if sys.stdout is not None:
            sys.stdout.flush()
    except OSError:
        if not hasattr(result, "exit_code"):
            raise
        sys.stdout = None  # who read has gone, or the disk is full; the verdict still counts
    return code or int(bool(options.strict) and any(finding.severity == "wrong" for finding in result.findings))


def _lines(result: Any, verbose: bool, out: Any) -> Iterator[str]:
    """What a result says, and where it was written."""
    from feedsim.jobs.result import Result

    own = isinstance(result, Result)
    yield from map(visible, (result.all_lines if verbose else result.lines) if own else result.answers)
    if (place := getattr(result, "place", None) or out) is not None:
        if own and (step := _next_step(Path(place))):
            yield from map(visible, (f"Next: {step['words']}:", f"  {step['command']}"))
        yield visible(f"-> {Path(place) / result._kind.main_file if own else place}")


def _next_step(folder: Path) -> dict[str, str]:
    """What the summary of a result says to do next; {} where it says nothing."""
    try:
        content = json.loads((folder / "summary.json").read_bytes())
    except (OSError, ValueError):
        return {}
    return content.get("next", {}) if isinstance(content, dict) else {}


def _plain_lines(result: Any) -> list[str]:
    if isinstance(result, Mapping):
        return [json.dumps(result, indent=2)]
    if isinstance(result, str):
        return [result]
    if not result:
        return ["all there already"]
    if isinstance(result[0], Path):
        return [visible(str(path)) for path in result]
    from feedsim.jobs.examples import table

    return table(result)


def json_of(result: Any, out: Any) -> str:
    """A result as JSON: its summary.json where that was written, else kind, answer, findings and figures."""
    if (place := getattr(result, "place", None) or out) is not None and (Path(place) / "summary.json").is_file():
        return (Path(place) / "summary.json").read_text(encoding="utf-8").rstrip("\n")
    if (own := getattr(result, "json", None)) is not None:
        return str(own).rstrip("\n")
    figures = {
        name: {"value": figure.value if math.isfinite(figure.value) else None, "unit": figure.unit}
        for name, figure in getattr(result, "figures", {}).items()
    }
    entries = [asdict(finding) for finding in rank_findings(result.findings)]
    content = {"kind": result.kind, "answer": [*result.answers], "findings": entries, "figures": figures}
    return json.dumps(content | ({"files": [str(out)]} if out is not None else {}), indent=2, ensure_ascii=False)


# --- What `feedsim` alone says: the four things a person may want, with the command for each --------------------------


START_TEXT = """feedsim simulates the feed drives of a machine tool: control, friction and structure.

See it work
  feedsim example xz_circle z_positioning      copies two scenarios into this folder
  feedsim run xz_circle.yaml                   a circle, why it is not round, and a report

Find out why a measured circle is not round
  feedsim example ballbar log                  copies sample records, synthetic ones
  feedsim circle records/ballbar/before_ccw.csv records/ballbar/before_cw.csv --axes X,Y

Rebuild a machine from its records
  feedsim identify drive records/log/log.csv --columns records/log/columns.yaml --axes Z --out results/my_machine
  feedsim replay records/log/log.csv --columns records/log/columns.yaml --axes Z --machine results/my_machine

Try a change before it is made
  feedsim run xz_circle.yaml --set machine.axes.X.drive.K_v="5 (m/min)/mm" --out results/faster
  feedsim diff results/xz_circle results/faster

feedsim --help lists all commands, feedsim COMMAND --help the options of one; feedsim docs opens the tutorials.
"""
