"""YAML text -> plain values, with the line of every value.

YAML 1.2 core rules, so that what people write is what they get: `on`, `yes` and `off` are words, `6.5e7` is a number,
dates are words. Stricter than YAML: a duplicate key is an error, a file is one document in UTF-8. Anchors, aliases and
`<<` are fine as long as what they expand to stays small.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from io import BufferedReader
from pathlib import Path
from typing import Any

import yaml

from feedsim.foundation.errors import InputError, no_such_file

# --- Bytes of a file that a user names: of a regular one, up to a size. No pipe or device keeps a command waiting -----
# JSON from such files is read here as well: nested so deep that Python's stack would not hold it, it is refused.


MAX_JSON_DEPTH = 100  # levels of groups and lists
# What else a name may stand for, in words.
_OTHER_FILE_TYPES = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISSOCK, "a socket"),
    (lambda _: True, "a device"),
)
_INSTRUMENT = (
    "a file that its instrument's own program reads",
    ("export the test as text or CSV, with angle and deviation (or radius), or both positions"),
)
_ANSYS = "a file of ANSYS that is not read", "jobname.full of a modal analysis is (kind: ansys)"
_NASTRAN = (
    "a file of Nastran that is not read",
    ("convert its matrices to Matrix Market (kind: matrices), or make a table of modes"),
)
_ABAQUS = (
    "a file of Abaqus that is not read",
    ("write the matrices with *MATRIX GENERATE and convert them to Matrix Market (kind: matrices)"),
)
_RECORDER = "a recorder's file that is not read", "export the signals there as CSV, with a header of names and units"
# Ending of files that nothing here reads -> what they are, and what to do.
UNREAD = {
    **dict.fromkeys((".b5r", ".b20", ".b5s", ".bbx", ".kgm", ".acc"), _INSTRUMENT),
    **dict.fromkeys((".rst", ".rth", ".rfrq", ".emat", ".esav", ".db", ".dbb", ".cdb", ".mechdb"), _ANSYS),
    **dict.fromkeys((".op2", ".op4", ".pch", ".f06", ".bdf", ".nas"), _NASTRAN),
    **dict.fromkeys((".odb", ".cae"), _ABAQUS),
    **dict.fromkeys((".frd", ".rout"), (
        "a result of CalculiX", "store the matrices with *FREQUENCY, SOLVER=MATRIXSTORAGE (kind: calculix)"
    )),
    **dict.fromkeys((".svdx", ".svd", ".tcscopex"), (
        "a project of TwinCAT Scope", "export its data there as CSV, with the header and a time for every channel"
    )),
    **dict.fromkeys((".tdms", ".mf4", ".mdf", ".dxd", ".d7d"), _RECORDER),
    **dict.fromkeys((".slx", ".mdl", ".mldatx", ".fig"), (
        "a file that only MATLAB reads", "save the signals there as vectors: save('record.mat', 't', 'x', '-v7')"
    )),
    **dict.fromkeys((".mph", ".mnf"), (
        "a model that is not read", "export mass and stiffness there as Matrix Market (kind: matrices)"
    )),
}  # fmt: skip
_OPEN_FLAGS = os.O_RDONLY | sum(getattr(os, name, 0) for name in ("O_BINARY", "O_CLOEXEC", "O_NONBLOCK", "O_NOCTTY"))


def refuse_unread(path: Path) -> None:
    """InputError with what to do: a file of a kind that nothing here reads, by its ending."""
    if path.suffix.lower() in UNREAD and path.is_file():
        what, advice = UNREAD[path.suffix.lower()]
        raise InputError(f"{path} is {what}; {advice}")


@contextmanager
def open_file(path: Path, *, pipes: bool = False) -> Iterator[BufferedReader]:
    """A file to be read piece by piece. pipes, errors: as of content(), without its limit."""
    refuse_unread(path)
    try:
        number = os.open(path, _OPEN_FLAGS)
        with os.fdopen(number, "rb") as file:
            result = os.fstat(number)
            if not (stat.S_ISREG(result.st_mode) or (pipes and stat.S_ISFIFO(result.st_mode))):
                what = next(name for is_one, name in _OTHER_FILE_TYPES if is_one(result.st_mode))
                raise InputError(f"{path} is {what}, not a file")
            if hasattr(os, "O_NONBLOCK"):
                os.set_blocking(number, True)
            yield file
    except FileNotFoundError:
        raise InputError(no_such_file(path)) from None
    except IsADirectoryError:
        raise InputError(f"{path} is a folder, not a file") from None
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from None


def content(path: Path, largest: int | None = None, *, pipes: bool = False) -> bytes:
    """What is in a file.

    Args:
        largest: bytes that it may have; None: any number.
        pipes: one that somebody writes to, such as a shell's <(command), will do too; without a writer it is empty.

    Raises:
        InputError: no such file, one that cannot be read, is too large, or is no regular one.
    """
    with open_file(path, pipes=pipes) as file:
        read = file.read() if largest is None else file.read(largest + 1)
        size = max(os.fstat(file.fileno()).st_size, len(read))
    if largest is not None and len(read) > largest:
        raise InputError(f"{path} has {size / 1e6:.4g} MB; a file of this kind may have {largest / 1e6:.4g} MB at most")
    return read


def content_digest(path: Path) -> str:
    """SHA-256 of what is in a file, which may be larger than the memory. InputError: as of content()."""
    with open_file(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def json_file(path: Path, largest: int | None = None) -> Any:
    """What is in a JSON file in UTF-8. InputError: as of content() and json_value()."""
    return json_value(content(path, largest), str(path))


def json_value(text: str | bytes, where: str) -> Any:
    """The value of a JSON text. InputError: it is none, or nested too deep."""
    try:
        value = json.loads(text)
    except RecursionError:
        raise _too_deep(where) from None
    except ValueError as error:  # bytes that are no UTF-8, and whole numbers of thousands of digits, too
        raise InputError(f"{where} is no JSON that can be read: {error}") from None
    check_depth(value, text, where)
    return value


def check_depth(value: Any, text: str | bytes, where: str) -> None:
    """InputError: a value, which JSON text holds, is nested deeper than what works on it could follow."""
    opening = ("[", "{") if isinstance(text, str) else (b"[", b"{")
    if sum(map(text.count, opening)) <= MAX_JSON_DEPTH:  # type: ignore[arg-type]
        return
    level = [value]
    for _ in range(MAX_JSON_DEPTH + 1):
        level = [inner for outer in level if isinstance(outer, list | dict)
                 for inner in (outer.values() if isinstance(outer, dict) else outer)]  # fmt: skip
        if not level:
            return
    raise _too_deep(where)


def _too_deep(where: str) -> InputError:
    return InputError(f"{where}: its values are nested too deep; allowed: up to {MAX_JSON_DEPTH} levels")


# --- Names of files within texts -> the files: relative to the file that names them, and never out of an archive ------


MAX_NAME_BYTES, MAX_PART_BYTES = 4096, 255  # bytes of a name that Linux takes, and of each part of it
_CLOSED_FOLDERS: list[str] = []  # folders that hold what archives were unpacked to


@contextmanager
def confine_references(folder: Path) -> Iterator[None]:
    """For as long as the block lasts, what is written in files of `folder` names no file outside of it."""
    root = _absolute(folder)
    _CLOSED_FOLDERS.append(root)
    try:
        yield
    finally:
        _CLOSED_FOLDERS.remove(root)


def resolve_reference(folder: Path, name: str) -> Path:
    """The file that a text in a file of `folder` names. No file is looked at.

    Raises:
        InputError: it is none that a system can have; `folder` is closed and the name leads out.
    """
    from feedsim.files.fields import brief  # loads pydantic, which who asks for the kind of a file has no need of

    if not _is_possible_name(name):
        raise InputError(f"{brief(name)} is no file name")
    path = folder / name
    root = next((name for name in reversed(_CLOSED_FOLDERS) if _is_inside(_absolute(folder), name)), None)
    if root is not None and not _is_inside(_absolute(path), root):
        raise InputError(f"{brief(name)} leads out of the archive; what is written in one names files in it alone")
    return path


def _absolute(path: Path) -> str:
    """Without looking at it: resolve() follows links."""
    return os.path.abspath(path)  # noqa: PTH100


def _is_possible_name(name: str) -> bool:
    """Whether a system can be asked for such a name: what it answers otherwise is an error of the caller's."""
    try:
        return (
            "\0" not in name
            and len(os.fsencode(name)) < MAX_NAME_BYTES
            and all(len(os.fsencode(part)) <= MAX_PART_BYTES for part in Path(name).parts)
        )
    except UnicodeEncodeError:
        return False


def _is_inside(path: str, root: str) -> bool:
    return path == root or path.startswith(root + os.sep)


# --- YAML text -> plain values, with the line of every value ----------------------------------------------------------


Place = tuple[str | int, ...]

MAX_VALUES = 100_000  # values in a file, aliases expanded
_MANY = (
    f"more than {MAX_VALUES} values, an alias counted as all that it stands for; a long table is a CSV file of its own"
)
LARGEST_FILE = 4_000_000  # bytes; people write some kB, and a long line of text is read at 0.3 MB/s
PROGRAM_ENDINGS = (".mpf", ".spf", ".nc", ".ngc", ".cnc", ".tap", ".h", ".gcode", ".iso", ".eia")  # of NC programs
_FAST_DEPTH = 2000
# Where libyaml has a mind of its own: tabs, tags, byte order marks within a text, directives, "#" at the head of a
# block of text, "?" within braces (which is looked for outside of lines that are comments).
_READ_DIFFERENTLY = re.compile(r"[\t!\ufeff]|^%|[|>][-+0-9]*#|^(?! *#).*[?]", re.MULTILINE)


@dataclass(frozen=True)
class Mark:
    """Where a value comes from: "file:line" or "--set KEY=VALUE", and the folder its file names are relative to."""

    where: str
    folder: Path


@dataclass
class Source:
    """Plain values (dict, list, str, int, float, bool, None) and the origin of each, by its place in the tree."""

    data: Any
    marks: dict[Place, Mark] = field(default_factory=dict)

    def mark(self, place: Place) -> Mark:
        """Origin of the value at `place`, or of what it is missing from."""
        while place not in self.marks and place:
            place = place[:-1]
        return self.marks[place]

    def copy(self) -> Source:
        """An equal one that shares no list or group with this one."""
        return Source(copy_tree(self.data), dict(self.marks))

    def put(self, place: Place, other: Source) -> None:
        """Replace the value at `place` (its parent exists) by another tree, with its marks."""
        parent: Any = self.data
        for key in place[:-1]:
            parent = parent[key]
        parent[place[-1]] = other.data
        self.forget(place)
        self.marks.update({place + inner: mark for inner, mark in other.marks.items()})

    def forget(self, place: Place) -> None:
        """Drop the marks of a value and of all inside it."""
        self.marks = {known: mark for known, mark in self.marks.items() if known[: len(place)] != place}


def value_at(data: Any, place: Place) -> Any:
    """The value at a place of a tree of plain values."""
    for key in place:
        data = data[key]
    return data


def places(data: Any, place: Place = ()) -> Iterator[Place]:
    """`place`, where `data` is, and the places of all that is inside."""
    yield place
    if isinstance(data, dict | list):
        for key, value in data.items() if isinstance(data, dict) else enumerate(data):
            yield from places(value, (*place, key))


def copy_tree(data: Any) -> Any:
    """Plain values with lists and groups of their own."""
    if isinstance(data, dict):
        return {key: copy_tree(value) for key, value in data.items()}
    return [copy_tree(item) for item in data] if isinstance(data, list) else data


def read_yaml(path: Path) -> Source:
    """Read a YAML file.

    InputError (file, line): missing, no regular file, too large, not UTF-8, empty, bad syntax, duplicate key.
    """
    raw = content(path, LARGEST_FILE)
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        raise InputError(f"{path}:{line}: not UTF-8 (byte 0x{raw[error.start]:02x}); save the file as UTF-8") from None
    if not text.strip():
        raise InputError(f"{path}: the file is empty")
    return parse(text, str(path), path.parent)


def parse(text: str, name: str, folder: Path, *, lines: bool = True) -> Source:
    """Read YAML text. `name` stands before the line in messages; with lines=False it stands alone (one-line texts)."""
    builder = _Builder(name, folder, lines)
    try:
        node = _compose_document(text)
    except RecursionError:
        raise InputError(f"{name}: nested too deeply") from None
    except _TooLarge:
        raise InputError(f"{name}: {_MANY}") from None
    except yaml.MarkedYAMLError as error:
        raise builder.error(_describe_yaml_error(error), error.problem_mark or error.context_mark) from None
    except yaml.YAMLError as error:
        raise InputError(f"{name}: {_control_character(error, text)}") from None
    if node is None:
        return Source(None, {(): Mark(name, folder)})
    source = Source(None)
    source.data = builder.build(node, (), source.marks)
    if builder.problems:
        raise InputError.of(name, builder.problems)
    return source


def _compose_document(text: str) -> yaml.Node | None:
    """The document's root, by libyaml where there is one, ten times faster.

    PyYAML's own parser words the faults and has the say where the two differ: a file means the same on every machine.
    """
    # libyaml's binding overruns the stack on text that is nested some ten thousand times. Every level takes a bracket
    # or a column, of which a list and the group that it stands in may share one.
    deepest = _brackets(text) + 2 * max(map(len, text.splitlines()), default=0)
    if _FastLoader is not None and deepest < _FAST_DEPTH and _READ_DIFFERENTLY.search(text) is None:
        with suppress(yaml.YAMLError):
            node = _root(_FastLoader, text)
            if node is None or node.value:  # where nothing stands, the two differ about where
                return node
    return _root(_Loader, text)


def _brackets(text: str) -> int:
    """How deep brackets are nested, or more: all that are opened, unless no quote or remark could hide one."""
    opened = text.count("[") + text.count("{")
    if opened < _FAST_DEPTH or any(mark in text for mark in "\"'#|>"):
        return opened
    depth = deepest = 0
    for bracket in re.findall(r"[\[\]{}]", text):
        depth += 1 if bracket in "[{" else -1
        deepest = max(deepest, depth)
    return deepest


def _root(kind: Any, text: str) -> yaml.Node | None:
    loader = kind(text)
    try:
        node: yaml.Node | None = loader.get_single_node()
        return node
    finally:
        loader.dispose()


class _TooLarge(Exception):
    """More values than a file may have."""


class _Loader(yaml.SafeLoader):
    """Composes nodes and resolves plain scalars by the YAML 1.2 core schema."""

    yaml_implicit_resolvers: dict[str, Any] = {}  # noqa: RUF012  (PyYAML's own name; emptied of the 1.1 rules)

    nodes = 0

    def compose_node(self, parent: Any, index: Any) -> Any:
        """As usual, but a file that is too large is given up as soon as that shows."""
        self.nodes += 1
        if self.nodes > MAX_VALUES:
            raise _TooLarge
        return super().compose_node(parent, index)

    def scan_tag(self) -> Any:
        """As usual, but a `!` alone, which the standard takes for "text" and PyYAML for nothing, is refused."""
        if self.peek(1) in "\0 \t\r\n\x85\u2028\u2029":
            raise yaml.scanner.ScannerError(None, None, "'!' alone says nothing; text needs quotes", self.get_mark())
        return super().scan_tag()


_FastLoader: Any = None
if yaml.__with_libyaml__:
    _FastLoader = type("_FastLoader", (yaml.CSafeLoader,), {"yaml_implicit_resolvers": _Loader.yaml_implicit_resolvers})

for _tag, _pattern, _first in (
    ("null", r"~|null|Null|NULL|", ["~", "n", "N", ""]),
    ("bool", r"true|True|TRUE|false|False|FALSE", list("tTfF")),
    ("int", r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+", list("-+0123456789")),
    ("float", r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?", list("-+.0123456789")),
    ("float", r"[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)", list("-+.")),
    ("merge", r"<<", ["<"]),
):
    _Loader.add_implicit_resolver(f"tag:yaml.org,2002:{_tag}", re.compile(rf"^(?:{_pattern})$"), _first)


class _Builder:
    """Nodes -> plain values and marks; collects duplicate keys and the like instead of stopping at the first."""

    def __init__(self, name: str, folder: Path, lines: bool) -> None:
        self.name, self.folder, self.lines = name, folder, lines
        self.problems: list[str] = []
        self.count = 0
        self.open: set[int] = set()

    def where(self, mark: Any) -> str:
        return f"{self.name}:{mark.line + 1}" if self.lines and mark is not None else self.name

    def error(self, message: str, mark: Any) -> InputError:
        return InputError(f"{self.where(mark)}: {message}")

    def build(self, node: yaml.Node, place: Place, marks: dict[Place, Mark]) -> Any:
        self.count += 1
        if self.count > MAX_VALUES:
            raise InputError(f"{self.name}: {_MANY}")
        if id(node) in self.open:
            raise self.error("an alias refers to the value that it is part of", node.start_mark)
        marks.setdefault(place, Mark(self.where(node.start_mark), self.folder))
        if isinstance(node, yaml.ScalarNode):
            return self.scalar(node)
        self.open.add(id(node))
        try:
            if isinstance(node, yaml.SequenceNode):
                self.refuse_tag(node, "seq")
                return [self.build(item, (*place, i), marks) for i, item in enumerate(node.value)]
            assert isinstance(node, yaml.MappingNode)
            self.refuse_tag(node, "map")
            return self.mapping(node, place, marks)
        finally:
            self.open.discard(id(node))

    def mapping(self, node: yaml.MappingNode, place: Place, marks: dict[Place, Mark]) -> dict[str, Any]:
        values: dict[str, Any] = {}
        lines: dict[str, Any] = {}
        merged: list[yaml.Node] = []
        for key_node, value_node in node.value:
            if key_node.tag == "tag:yaml.org,2002:merge":
                merged += value_node.value if isinstance(value_node, yaml.SequenceNode) else [value_node]
                continue
            if not isinstance(key_node, yaml.ScalarNode):
                self.problems.append(f"{self.where(key_node.start_mark)}: a key must be a word")
                continue
            key = key_node.value
            if key in values:
                first = lines[key].line + 1
                self.problems.append(
                    f"{self.where(key_node.start_mark)}: duplicate key {key!r} (first in line {first})"
                )
                continue
            lines[key] = key_node.start_mark
            marks[(*place, key)] = Mark(self.where(key_node.start_mark), self.folder)
            values[key] = self.build(value_node, (*place, key), marks)
        for base in merged:
            if not isinstance(base, yaml.MappingNode):
                raise self.error("'<<' needs a group of keys", base.start_mark)
            inner: dict[Place, Mark] = {}
            for key, value in self.build(base, place, inner).items():
                if key not in values:
                    values[key] = value
                    start = (*place, key)
                    marks.update({known: mark for known, mark in inner.items() if known[: len(start)] == start})
        return values

    def scalar(self, node: yaml.ScalarNode) -> Any:
        text, kind = node.value, node.tag.removeprefix("tag:yaml.org,2002:")
        if kind == "str" or kind == "merge":
            return text
        if kind == "null":
            return None
        try:
            if kind == "bool" and text.lower() in ("true", "false"):
                return text.lower() == "true"
            if kind == "int":
                return int(text, 0 if text.lower().startswith(("0x", "0o")) else 10)
            if kind == "float":
                return float(re.sub(r"\.(inf|nan)", r"\1", text.lower()))
        except ValueError:
            raise self.error(f"{text[:40]!r} is no {kind}", node.start_mark) from None
        raise self.error(f"tag {node.tag!r} is not known here", node.start_mark)

    def refuse_tag(self, node: yaml.Node, kind: str) -> None:
        if node.tag != f"tag:yaml.org,2002:{kind}":
            raise self.error(f"tag {node.tag!r} is not known here", node.start_mark)


def _describe_yaml_error(error: yaml.MarkedYAMLError) -> str:
    problem = error.problem or error.context or "bad YAML"
    if "'\\t'" in problem:
        return "a tab cannot indent or start a value; use blanks"
    if "could not find expected ':'" in problem:
        return "expected 'key: value'"
    if "mapping values are not allowed here" in problem:
        return "a second ': ' in a line; put text that holds ': ' in quotes, or check the indentation"
    if "expected a single document" in (error.context or ""):
        return "a second document begins ('---'); one file holds one"
    if "alias" in f"{problem} {error.context}":
        return f"{problem}; text that begins with '*' needs quotes"
    return problem + (f" ({error.context})" if error.context and error.context != problem else "")


def _control_character(error: yaml.YAMLError, text: str) -> str:
    if isinstance(error, yaml.reader.ReaderError):
        line = text.count("\n", 0, error.position) + 1
        return f"line {line} holds the control character U+{ord(text[error.position]):04X}"
    return str(error)


def is_ssp(path: Path) -> bool:
    """Whether a file is meant as an SSP, by its name."""
    return path.suffix.lower() == ".ssp"


def is_program(path: Path) -> bool:
    """Whether a file is meant as an NC program, by its name."""
    return path.suffix.lower() in PROGRAM_ENDINGS


def is_study(path: Path) -> bool:
    """Whether a file that can be read is a study, by its keys."""
    try:
        data = None if is_program(path) else read_yaml(path).data
    except InputError:
        return False
    return isinstance(data, dict) and "sampling" in data and "parameters" in data and "machine" not in data
