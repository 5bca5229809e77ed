"""How a job declares its parameters: one annotation a parameter, from which all else follows.

The annotation of a parameter says what its option on the command line is called, what its value is called, what it is
for and which values it may have. Parser, ``--help``, completion, the page of the reference and the section of arguments
of the docstring follow from it. May use: arguments. Start reading at Option, then at the signature of a job, such as
circle().
"""

from __future__ import annotations

import ast
import inspect
import os
import re
import shlex
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from functools import cache, wraps
from numbers import Real
from pathlib import Path
from typing import Annotated, Any, TypeVar

from feedsim.foundation.arguments import Call, Changes, Pairs, Value, call_context, settings
from feedsim.foundation.errors import Finding

F = TypeVar("F", bound=Callable[..., Any])
File = str | Path


@dataclass(frozen=True)
class Option:
    """An option of a command, and the parameter of a job.

    Attributes:
        value: what its value is called; "": a switch.
        help: what it is for, with the default where that is not the parameter's own.
        choices: that there are; none: any text.
        many: it may be given several times. several: with several values behind it, too.
        typed: how it is typed, where that is not the parameter's name.
        short: a short form, such as "-o".
        complete: the function that lists what a shell may offer, as "module:function".
        group: the title that the help lists it under.
        writes: its value is a file or folder that the job makes.
        default: of the command line alone, a name of a file with the names of other parameters, "circle_{records}".
    """

    value: str = ""
    help: str = ""
    choices: Sequence[str] = ()
    many: bool = False
    several: bool = False
    typed: str = ""
    short: str = ""
    complete: str = ""
    group: str = ""
    writes: bool = False
    default: str = ""


@dataclass(frozen=True)
class Argument(Option):
    """A parameter that has no name on the command line."""


@dataclass(frozen=True)
class Parameter:
    """A parameter of a job: name, type as text, option (None: Python alone has it), default as text (None: needed)."""

    name: str
    type: str
    option: Option | None
    default: str | None

    @property
    def typed(self) -> str:
        """How it is typed on the command line; "" of an argument."""
        assert self.option is not None
        return "" if isinstance(self.option, Argument) else self.option.typed or f"--{self.name.replace('_', '-')}"


@dataclass(frozen=True)
class Declaration:
    """A job as its source declares it.

    help: a few words, for the list of commands. description, examples: of its docstring. needs: extras without which it
    is not begun.
    """

    name: str
    help: str
    needs: Sequence[str]
    description: str
    examples: str
    parameters: Sequence[Parameter]


Names = Pairs[str]  # axis of the machine -> that of the control, or texts X1 and X=X1
Positions = Pairs[Value]  # axis -> position [m] or a text with a unit, or texts AXIS=POSITION

PACKAGE = Path(__file__).resolve().parents[1]
# What stands behind "feedsim" -> the function that does it, in the order of --help of the program.
COMMANDS = {
    "example": "jobs.tools:example",
    "run": "jobs.run:run",
    "check": "jobs.check:check",
    "circle": "jobs.circle:circle",
    "identify friction": "jobs.identify:identify_friction",
    "identify drive": "jobs.identify_drive:identify_drive",
    "identify modes": "jobs.identify_modes:identify_modes",
    "identify mounts": "jobs.identify_mounts:identify_mounts",
    "replay": "jobs.replay:replay",
    "frf": "jobs.frf:frf",
    "tune drive": "jobs.tune_drive:tune_drive",
    "tune compensation": "jobs.tune_compensation:tune_compensation",
    "tune feedforward": "jobs.tune_feedforward:tune_feedforward",
    "tune proposals": "jobs.tune_drive:tune_proposals",
    "diff": "jobs.diff:diff",
    "history": "jobs.history:history",
    "compare": "jobs.compare:compare",
    "export": "jobs.export:export",
    "sweep": "jobs.sweep:sweep",
    "machine build": "jobs.machine:machine_build",
    "machine info": "jobs.machine:machine_info",
    "machine view": "jobs.machine:machine_view",
    "machine import": "jobs.machine_import:machine_import",
    "machine export": "jobs.machine_export:machine_export",
    "docs": "jobs.tools:docs",
    "tools schema": "jobs.tools:schema",
    "tools convert": "jobs.tools:convert",
    "tools completion": "jobs.tools:completion",
}
Archives = Annotated[
    File | None,
    Option("DIR", "folder of the units' archives (default: $FEEDSIM_FMUS, else those that come along)"),
]
Settings = Annotated[
    Changes,
    Option(
        "KEY=VALUE",
        "override one entry of the file, such as machine.axes.Z.friction.F_C='1.8 N.m', or the entries of a YAML file "
        "with a group set; may be given several times",
        many=True,
    ),
]
MachineChoice = Annotated[
    File | None, Option("MACHINE", "machine file or folder in place of the scenario's; an NC program needs one")
]
FigureKinds = Annotated[Sequence[str], Option("png,svg", "draw the figures as files, too, into the folder figures")]
Force = Annotated[
    bool, Option("", "replace files that feedsim did not write, and results of another kind; never an input")
]
CONTROL_CHOICES = ("sinumerik", "twincat", "heidenhain", "linuxcnc")
ControlName = Annotated[
    str,
    Option(
        "NAME",
        f"show parameters in the names and units of a control, too: {', '.join(CONTROL_CHOICES)} (default: the "
        "one that the machine file names)",
        choices=CONTROL_CHOICES,
    ),
]
Draws = Annotated[
    int,
    Option(
        "N",
        "draws of the machine from the intervals of its identified values, 19 or more (39 hold 95 %): figures get "
        "intervals, curves bands; tuning judges its values on them; 0: none",
    ),
]

SubjectArgument = Annotated[File, Argument("SCENARIO-or-MACHINE", "scenario file, machine file or machine folder")]
RecordArgument = Annotated[
    File, Argument("RECORD", "CSV or MAT file, or a capture of a SINUMERIK (.json) (docs/traces.md)")
]
RecordAxes = Annotated[
    str | Sequence[str] | None,
    Option("NAMES", "axes, separated by commas, such as X,Y (default: all of the machine)"),
]
RecordColumns = Annotated[File | None, Option("MAPPING.yaml", "which columns of the record are what (docs/traces.md)")]
RecordWindow = Annotated[
    str | None,
    Option(
        "BEGIN..END",
        "the part of the record that counts, by times or by blocks of its program, e.g. '0.5 "
        "s..2 s', 'N7..N20', 'N7' (default: all of it)",
    ),
]
StructureArgument = Annotated[
    File,
    Argument(
        "MACHINE",
        "machine file with the key structure, structure file, or a folder with a machine.yaml or structure.yaml",
    ),
]
AxisPositions = Annotated[
    Positions,
    Option(
        "AXIS=POSITION",
        "axis positions, e.g. X=800mm Z=100mm; axes that are not named stay at the machine's pose",
        several=True,
    ),
]
Cutoff = Annotated[Value | None, Option("FREQUENCY", "drop modes above, e.g. 1500Hz (default: the structure's)")]
StaticCorrection = Annotated[
    bool, Option("", "append pseudo-modes that make up for the static compliance of the dropped modes")
]
CouplingStep = Annotated[
    Value | None, Option("TIME", "exchange step h of the coupling limit (default: the machine's control cycle)")
]
ControlAxes = Annotated[
    Names,
    Option(
        "NAMES",
        "axes of the control, X1,Y1; with the machine's name ahead where it is another one, "
        "X=X1,Y=Y1 (default: the axes of the machine)",
    ),
]
ControlDrives = Annotated[
    Names, Option("AXIS=LIST", "which drive object or list is that of an axis, such as X=PS000003,Y=PS000004")
]
AssumedValues = Annotated[
    Names,
    Option(
        "NAME=VALUE",
        "value of a parameter that the files do not have, such as FFW_MODE=3; may be given several times",
        many=True,
    ),
]
CheckedUnits = Annotated[
    str | Sequence[str],
    Option("NUMBERS", "numbers whose unit you have checked at the control, such as MD32810,MD32000, or all"),
]


def output_option(default: str) -> Option:
    """The option for the folder of a result. default: below results/, where a command does not name one."""
    return Option(
        "DIR",
        f"where the result goes (default: results/{_template_text(default)})",
        short="-o",
        writes=True,
        default=default,
    )


def out_file(value: str, help: str) -> Option:
    """The option for a file that a job makes."""
    return Option(value, help, short="-o", writes=True)


def _template_text(template: str) -> str:
    """A name of a folder as the help shows it: "circle_{records}" is circle_RECORDS."""
    return re.sub(r"{(\w+)}", lambda match: match[1].upper(), template)


def job(help: str, *, needs: Sequence[str] = ("run",)) -> Callable[[F], F]:
    """Mark a function as a job; its docstring gets the section of arguments from the annotations.

    help, needs: as of :class:`Declaration`.
    """

    def documented(function: F) -> F:
        signature = inspect.signature(function)

        @wraps(function)
        def called(*given: Any, **named: Any) -> Any:
            try:
                arguments = signature.bind(*given, **named).arguments
            except TypeError:  # the function says itself what it was not given
                return function(*given, **named)
            own = Call({key: value for key, value in arguments.items() if key != "watch"}, command_line)
            with call_context(own), _one_thread_of_algebra() if needs else nullcontext():
                return function(*given, **named)

        lines = [_argument_line(entry) for entry in _parameters(inspect.signature(function))]
        summary, *rest = inspect.cleandoc(function.__doc__ or "").split("\n\n")
        sections = [text for text in rest if not text.startswith("Command line:")]
        at = next((i for i, text in enumerate(sections) if text.startswith(("Raises", ">>>"))), len(sections))
        sections.insert(at, "Args:\n" + "\n".join(lines))
        # Options belong to the command line: help() and editors show types alone.
        plain = [
            entry.replace(
                annotation=_UnquotedText(read_annotation(str(entry.annotation))[0].replace("File", "str | Path"))
            )
            for entry in signature.parameters.values()
        ]
        called.__signature__ = signature.replace(  # type: ignore[attr-defined]
            parameters=plain, return_annotation=_UnquotedText(signature.return_annotation)
        )
        called.__doc__ = function.__doc__ = "\n\n".join([summary, *sections])
        return called  # type: ignore[return-value]

    return documented


def _one_thread_of_algebra() -> AbstractContextManager[Any]:
    """A block in which linear algebra has one thread: the same bits on any number of cores, and small matrices by the
    thousand, for which several threads only wait for one another. Whoever says how many there are is obeyed."""
    if "OPENBLAS_NUM_THREADS" in os.environ:
        return nullcontext()
    from feedsim.foundation.installation import require_module  # a command sets the variable, and does without

    library = require_module("threadpoolctl", "limiting linear algebra to one thread")
    limits: AbstractContextManager[Any] = library.threadpool_limits(1, user_api="blas")
    return limits


class _UnquotedText(str):
    """A type as text, which signatures show without quotation marks."""

    def __repr__(self) -> str:
        return str(self)


def _parameters(signature: inspect.Signature) -> list[Parameter]:
    return [
        Parameter(name, *read_annotation(str(entry.annotation)), None)
        for name, entry in signature.parameters.items()
    ]  # fmt: skip


def _argument_line(entry: Parameter) -> str:
    if entry.option is None:
        return (
            f"    {entry.name}: who hears how far the job is."
            if entry.name == "watch"
            else f"    {entry.name}: {entry.type}"
        )
    choices = f"; {', '.join(entry.option.choices)}" if entry.option.choices and not entry.option.value else ""
    amount = "; a number in SI units, or a text with a unit" if "Value" in entry.type else ""
    words = f"{entry.name}: {entry.option.help}{choices}{amount}."
    return textwrap.fill(words, 110, initial_indent="    ", subsequent_indent="        ")


def read_annotation(text: str) -> tuple[str, Option | None]:
    """Type and option of an annotation, given as text; of a name of this module, such as Archives, what that is."""
    node = ast.parse(text, mode="eval").body
    if isinstance(node, ast.Name):
        node = _shared_annotations().get(node.id, node)
    if not (isinstance(node, ast.Subscript) and ast.unparse(node.value) == "Annotated"):
        return text, None
    assert isinstance(node.slice, ast.Tuple)
    kind, option = node.slice.elts
    return ast.unparse(kind), eval(compile(ast.Expression(option), text, "eval"), globals())


@cache
def _shared_annotations() -> dict[str, ast.expr]:
    """Annotations that several jobs share, by the name that this module gives them, such as Archives."""
    return {
        node.targets[0].id: node.value
        for node in ast.parse(Path(__file__).read_text(encoding="utf-8")).body
        if isinstance(node, ast.Assign)
        and isinstance(node.targets[0], ast.Name)
        and ast.unparse(node.value).startswith("Annotated[")
    }


def _text(node: ast.expr | None) -> str | None:
    return None if node is None else ast.unparse(node)


def declaration(file: Path, name: str) -> Declaration:
    """The job `name` as the file declares it; nothing of the file is executed, so that no library is loaded for it."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    node = [n for n in tree.body if isinstance(n, ast.FunctionDef) and n.name == name][-1]  # behind its overloads
    mark = next(d for d in node.decorator_list if isinstance(d, ast.Call) and ast.unparse(d.func) == "job")
    words: Mapping[str, Any] = {key.arg or "": ast.literal_eval(key.value) for key in mark.keywords}
    sections = (ast.get_docstring(node) or "").split("\n\n")
    ends = next(
        (i for i, text in enumerate(sections) if text.startswith(("Command line:", "Raises", ">>>"))), len(sections)
    )
    examples = next((text for text in sections if text.startswith("Command line:")), "")
    arguments = [*node.args.args, *node.args.kwonlyargs]
    defaults: list[ast.expr | None] = [None] * (len(node.args.args) - len(node.args.defaults))
    defaults += [*node.args.defaults, *node.args.kw_defaults]
    parameters = [
        Parameter(
            a.arg, *read_annotation(ast.unparse(a.annotation) if a.annotation else ""), ast.unparse(d) if d else None
        )
        for a, d in zip(arguments, defaults, strict=True)
    ]
    if node.args.vararg is not None and node.args.vararg.annotation is not None:
        several = node.args.vararg
        kind, option = read_annotation(ast.unparse(several.annotation or ast.Constant("")))
        parameters.insert(0, Parameter(several.arg, f"*{kind}", option, None))
    return Declaration(
        name,
        ast.literal_eval(mark.args[0]),
        words.get("needs", ("run",)),
        "\n\n".join(sections[:ends]),
        textwrap.dedent(examples.partition("\n")[2]),
        parameters,
    )


def job_of_command(command: str) -> Declaration:
    """The job of a command, such as "machine info"."""
    module, _, function = COMMANDS[command].partition(":")
    return declaration(PACKAGE / f"{module.replace('.', '/')}.py", function)


# --- The command line that goes on from a call ------------------------------------------------------------------------


# What belongs to the call itself: a further one writes elsewhere, and says for itself what it leaves.
OWN_ARGUMENTS = ("out", "figures", "force", "page", "uncertain", "kind", "name", "note", "report", "junit")


def command_line(call: Call, command: str, arguments: Mapping[str, Any]) -> str:
    """A command as it is typed, with the arguments of a call that it has, too, and with those that are its own.

    "" where an argument cannot be typed: a result at a prompt, in place of its folder.
    """
    given = {key: value for key, value in call.arguments.items() if key not in OWN_ARGUMENTS and key not in arguments}
    plan = given.get("scenario", given.get("subject"))
    if plan is not None and hasattr(plan, "overrides"):  # a scenario that is loaded
        given |= {"set": plan.overrides, "scenario": plan.file}
    given |= arguments
    places: list[str] = []
    options: list[str] = []
    for parameter in job_of_command(command).parameters:
        value = given.get(parameter.name)
        if parameter.option is None or value is None:
            continue
        words = [*_words(parameter, parameter.option, value, call.units.get(parameter.name, ""))]
        if None in words:
            return ""
        (places if isinstance(parameter.option, Argument) else options).extend(map(str, words))
    return " ".join(["feedsim", *command.split(), *map(shlex.quote, [*places, *options])])


def _words(parameter: Parameter, option: Option, value: Any, unit: str) -> Iterator[str | None]:
    """An argument as words of a command line; None in place of what cannot be typed."""
    if isinstance(value, bool):
        if value != (parameter.default == "True"):
            yield parameter.typed if value else parameter.typed.replace("--", "--no-", 1)
        return
    if parameter.name == "set":
        value = settings(value)
    values: list[str | None]
    if isinstance(value, Mapping):
        values = [f"{key}={_word(entry, unit)}" for key, entry in value.items()]
    elif isinstance(value, str | Path) or not isinstance(value, Sequence):
        values = [_word(value, unit)]
    else:
        values = [_word(entry, unit) for entry in value]
    if not values:
        return
    if isinstance(option, Argument):
        yield from values
    elif option.several:
        yield from (parameter.typed, *values)
    elif option.many:
        for text in values:
            yield from (parameter.typed, text)
    else:
        yield from (parameter.typed, None if None in values else ",".join(map(str, values)))


def _word(value: Any, unit: str) -> str | None:
    if isinstance(value, Path):
        inside = value.is_absolute() and value.is_relative_to(Path.cwd())
        return (value.relative_to(Path.cwd()) if inside else value).as_posix()
    if isinstance(value, Real):  # of numpy, too
        return f"{value} {unit}".strip()
    return value if isinstance(value, str) else None


# --- Who watches a job: hears how far it is, and what is to be known before it begins ---------------------------------


class Watch:
    """Nobody: every word is lost. The command line has one that shows them.

    command: the command line that was given, for records; empty in Python.

    >>> Watch().progress("reading", 1, 3)
    """

    command: Sequence[str] = ()

    def __repr__(self) -> str:
        return f"{type(self).__name__}()"

    def progress(self, what: str, done: int, total: int, before: int = 0, note: str = "") -> None:
        """`done` of `total` steps of `what`; before: steps that an earlier call of the job has done."""

    def of(self, what: str) -> Callable[[int, int], None]:
        """The same for work that reports (done, total) and not what it is."""
        return lambda done, total: self.progress(what, done, total)

    def announce(self, sentence: str) -> None:
        """Whose programs the job executes besides those of feedsim."""

    def note(self, sentence: str) -> None:
        """What the job will replace."""

    def warn(self, findings: Iterable[Finding]) -> None:
        """What is the matter with the files that the job begins with."""

    def say(self, sentence: str) -> None:
        """What takes longer, and why."""


NO_WATCH = Watch()
