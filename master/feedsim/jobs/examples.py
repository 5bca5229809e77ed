"""Scenarios, programs, studies, machines, structures, histories, records and notebooks to copy and to change.

May use: files, installation, signals, errors. Start reading at copy().
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path

from feedsim.files.source import is_program, places, read_yaml, value_at
from feedsim.foundation.errors import InputError, OutputError
from feedsim.foundation.installation import repair_advice, shipped
from feedsim.foundation.outputs import defer_signals

# Kind -> the file that stands for one, in the folder of all of them; of a kind whose files lie in a folder each, that
# folder is the example.
_KINDS = {
    "scenario": "*.yaml",
    "program": "programs/*.mpf",
    "study": "studies/*.yaml",
    "machine": "machines/*/machine.yaml",
    "structure": "structures/*/structure.yaml",
    "history": "histories/*.csv",
    "record": "records/*/columns.yaml",
    "notebook": "notebooks/*.ipynb",
}
_IN_FOLDERS = ("machine", "structure", "record")
MACHINE_OF_PROGRAMS = Path("machines/test_centre/machine.yaml")
_FOR_EDITORS = re.compile(r"# yaml-language-server: \$schema=(\S+)\n")  # a first line


@dataclass(frozen=True)
class Example:
    """Something that can be copied.

    Attributes:
        name: by which it is asked for.
        kind: "scenario", "program", "study", "machine", "structure", "history", "record" or "notebook".
        file: what stands for it.
        about: its first sentence.
    """

    name: str
    kind: str
    file: Path
    about: str


def examples() -> list[Example]:
    """All that there are, by kind and name.

    >>> [each.name for each in examples() if each.kind == "machine"]
    ['emps', 'one_axis', 'sinumerik_840d', 'test_centre']
    """
    root = shipped("scenarios")
    result = [
        Example(file.parent.name if kind in _IN_FOLDERS else file.stem, kind, file, _describe_example(file))
        for kind, pattern in _KINDS.items()
        for file in sorted(root.glob(pattern))
    ]
    if not result:
        raise InputError(f"{root}: has no scenarios; {repair_advice('them')}")
    return result


def table(entries: Sequence[Example]) -> list[str]:
    """The list as a terminal shows it: a heading for each kind, name and sentence in two columns."""
    width = max(len(entry.name) for entry in entries)
    kinds = dict.fromkeys(entry.kind for entry in entries)
    lines = []
    for kind in kinds:
        lines += [f"{kind}:", *(f"  {entry.name:{width}}  {entry.about}" for entry in entries if entry.kind == kind)]
    return [
        *lines,
        "",
        "feedsim example NAME copies one into the working folder, with the files that it names",
        "feedsim example --to scenarios copies all, to where the commands of the documentation have them",
    ]


def names() -> list[str]:
    """Names of all examples."""
    return sorted({example.name for example in examples()})


def copy(names: str | Iterable[str], folder: str | Path = ".") -> list[Path]:
    """Copy examples into a folder, with all files that they name, in the same layout; returns the files written.

    A file that is there with the same content stays; a scenario and the machine of the same name come both.

    >>> import feedsim as fs
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     len(fs.example("xz_circle", folder))
    7

    Raises:
        InputError: there is no such example.
        OutputError: a file is there with another content, or cannot be written. Nothing is written then.
    """
    root, folder = shipped("scenarios"), Path(folder)
    names = [names] if isinstance(names, str) else names
    contents = {
        folder / file.relative_to(root): file.read_bytes() for file in _collect_files(_select_examples(names), root)
    }
    if changed := [path for path in contents if _exists(path) and not _has_content(path, contents[path])]:
        raise OutputError(
            f"{', '.join(map(str, changed))}: there already, with another content; nothing is overwritten, "
            "--to takes another folder"
        )
    written: list[Path] = []
    try:
        with defer_signals():
            for path, content in contents.items():
                if not _exists(path):
                    path.parent.mkdir(parents=True, exist_ok=True)
                    with path.open("xb") as file:
                        written.append(path)
                        file.write(content)
    except OSError as error:
        for path in written:
            with suppress(OSError):
                path.unlink()
        raise OutputError(f"{error.filename or folder}: cannot be written: {error.strerror}") from None
    return written


def _select_examples(names: Iterable[str]) -> list[Example]:
    known = examples()
    result: list[Example] = []
    for name in names:
        plain = re.sub(r"\.(yaml|csv|ipynb|mpf)$", "", name)
        if not (meant := [example for example in known if example.name == plain]):
            others = sorted({example.name for example in known})
            near = "".join(f", did you mean {other}?" for other in get_close_matches(name, others, 1))
            raise InputError(f"{name}: no such example{near} (there are: {', '.join(others)})")
        result += meant
    return result


def _collect_files(asked: Iterable[Example], root: Path) -> list[Path]:
    """What stands for the examples, and every file that one of them names, or that lies in a folder that it names."""
    waiting = [example.file for example in asked]
    result: dict[Path, None] = {}
    while waiting:
        file = waiting.pop()
        if file in result:
            continue
        result[file] = None
        if file.name in ("machine.yaml", "structure.yaml") or file.match(_KINDS["record"]):
            waiting += [other for other in file.parent.iterdir() if other.is_file()]
        if is_program(file):  # names no machine, and needs one
            waiting.append(root / MACHINE_OF_PROGRAMS)
        if file.suffix == ".yaml":
            waiting += _schema(file)
            for named in _named_files(file):
                inside = [named] if named.is_file() else [other for other in named.rglob("*") if other.is_file()]
                waiting += [other for other in inside if other.is_relative_to(root)]
    return sorted(result)


def _named_files(file: Path) -> Iterator[Path]:
    """Files and folders that texts of a YAML file name."""
    data = read_yaml(file).data
    for place in places(data):
        text = value_at(data, place)
        if isinstance(text, str) and re.fullmatch(r"[\w./-]+", text) and (file.parent / text).exists():
            yield (file.parent / text).resolve()


def _schema(file: Path) -> list[Path]:
    """The schema that a YAML file names to editors in its first line."""
    with file.open(encoding="utf-8") as opened:
        said = _FOR_EDITORS.match(opened.readline())
    return [(file.parent / said[1]).resolve()] if said else []


def _describe_example(file: Path) -> str:
    """The first sentence of the comment that a file begins with, or of a notebook's text below its heading."""
    if file.suffix == ".ipynb":
        _, _, text = "".join(json.loads(file.read_text(encoding="utf-8"))["cells"][0]["source"]).partition("\n\n")
        return _sentence(text)
    comment: list[str] = []
    for line in _FOR_EDITORS.sub("", file.read_text(encoding="utf-8")).splitlines():
        if not line.startswith(("# ", "; ")):  # of an NC program
            break
        comment.append(line[2:])
    return _sentence(" ".join(comment))


def _sentence(text: str) -> str:
    return re.split(r"(?<=[.?])\s(?=[A-Z])", text, maxsplit=1)[0]


def _exists(path: Path) -> bool:
    return path.exists() or path.is_symlink()


def _has_content(path: Path, content: bytes) -> bool:
    try:
        return path.read_bytes() == content
    except OSError:
        return False
