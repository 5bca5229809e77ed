"""Exception types, and how their messages list many names and the one that was meant.

Messages say what is wrong, where (file:line if there is one), the actual value, what is allowed.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path


class FeedsimError(Exception):
    """Base of everything that the package raises on purpose. `exit_code` is what the command line ends with.

    >>> import feedsim as fs
    >>> try:
    ...     fs.run("xz_circle.yaml", set={"motions.0.radius": "15 kg"})
    ... except fs.FeedsimError as error:
    ...     error.exit_code
    2
    """

    exit_code = 1


class InputError(FeedsimError):
    """A file, an option or an argument is wrong. `problems` holds one line per fault; the message lists them all.

    >>> import feedsim as fs
    >>> try:
    ...     fs.load("xz_circle.yaml", {"motions.0.radius": "15 kg", "motions.0.feed": "-1 mm/min"})
    ... except fs.InputError as error:
    ...     len(error.problems)
    2
    """

    exit_code = 2

    def __init__(self, message: str, problems: Iterable[str] = ()) -> None:
        self.problems = tuple(problems) or (message,)
        super().__init__(message)

    @classmethod
    def of(cls, what: str, problems: Iterable[str]) -> InputError:
        """One error from several faults: the fault itself if it is alone, else a headline and a line per fault."""
        result = tuple(problems)
        if len(result) == 1:
            return cls(result[0])
        return cls("\n  ".join((f"{what}: {len(result)} problems", *result)), result)


class UnknownName(InputError, KeyError):
    """A figure or a signal that there is not; the message names the nearest one.

    >>> import feedsim as fs
    >>> result = fs.run("z_positioning.yaml")
    >>> for names, wrong in ((result.figures, "Z.overshot"), (result, "Z.x_b")):
    ...     try:
    ...         names[wrong]
    ...     except fs.InputError as error:
    ...         print(type(error).__name__, error)
    UnknownName no figure 'Z.overshot'; did you mean 'Z.overshoot'?
    UnknownName no column 'Z.x_b'; did you mean 'Z.x_s'?
    """

    __str__ = Exception.__str__  # a KeyError would show its message in quotation marks


class SimulationError(FeedsimError):
    """A simulation unit failed or the coupled run is not usable.

    >>> import feedsim as fs
    >>> fs.SimulationError.exit_code
    3
    """

    exit_code = 3


class OutputError(FeedsimError):
    """A result cannot be written.

    >>> import feedsim as fs
    >>> try:
    ...     fs.example("z_positioning", "log.csv")  # a file, no folder
    ... except fs.OutputError as error:
    ...     error.exit_code
    4
    """

    exit_code = 4


def few(names: Sequence[str], most: int) -> str:
    """The first names, and how many there are beyond."""
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")


MAX_WORD, MAX_KNOWN = 200, 500  # characters of a word, and names, that a suggestion is looked for in


def nearest(word: str, known: Sequence[str]) -> str:
    """The name that a word most likely means; "" where it resembles none. Of many names the first are compared."""
    from difflib import get_close_matches  # not for those who make no mistakes

    same = [name for name in known if name.lower() == word.lower()]
    if same or len(word) > MAX_WORD:
        return next(iter(same), "")
    return next(iter(get_close_matches(word, known[:MAX_KNOWN], n=1, cutoff=0.6)), "")


def no_such_file(path: str | Path, what: str = "file") -> str:
    """Message about a file, or folder, that is not there, with the one beside it that was most likely meant."""
    try:
        near = nearest(Path(path).name, [other.name for other in Path(path).parent.iterdir()])
    except (OSError, ValueError):
        near = ""
    return f"no such {what}: {path}" + (f"; did you mean {Path(path).parent / near}?" if near else "")


# --- What there is to say about a result, by its weight: `Wrong`, then a plain text, which is a doubt, then `Note` ----
# Findings go through the house as the warnings that they are; whoever shows them takes them by `ranked`.


class Wrong(str):
    """A figure, a file or a verdict is wrong, or worse than none: nobody may read the result without this.

    setting: KEY=VALUE, as behind ``--set``, with which it would be right; "": not known.
    """

    setting = ""


class Note(str):
    """How a result is to be read; nothing is the matter."""


WRONG = "WRONG: "  # ahead of what is wrong where a finding is mere text: on a console, in the table of a study


def severity(finding: str) -> str:
    """ "wrong", "doubt" (a text that is no more than that) or "note"."""
    return {Wrong: "wrong", Note: "note"}.get(type(finding), "doubt")


def ranked(findings: Iterable[str]) -> list[str]:
    """Each once, the wrong ones first and notes last, else in their order."""
    return sorted(dict.fromkeys(findings), key=lambda text: ("wrong", "doubt", "note").index(severity(text)))
