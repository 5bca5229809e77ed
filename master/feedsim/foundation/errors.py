"""Exception types, how their messages list many names and the one that was meant, and findings about results.

Messages say what is wrong, where (file:line if there is one), the actual value, what is allowed.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args


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


def shorten_list(names: Sequence[str], most: int) -> str:
    """The first names, and how many there are beyond."""
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")


MAX_WORD, MAX_KNOWN = 200, 500  # characters of a word, and names, that a suggestion is looked for in


def find_nearest_name(word: str, known: Sequence[str]) -> str:
    """The name that a word most likely means; "" where it resembles none. Of many names the first are compared."""
    from difflib import get_close_matches  # not for those who make no mistakes

    same = [name for name in known if name.lower() == word.lower()]
    if same or len(word) > MAX_WORD:
        return next(iter(same), "")
    return next(iter(get_close_matches(word, known[:MAX_KNOWN], n=1, cutoff=0.6)), "")


def no_such_file(path: str | Path, what: str = "file") -> str:
    """Message about a file, or folder, that is not there, with the one beside it that was most likely meant."""
    try:
        near = find_nearest_name(Path(path).name, [other.name for other in Path(path).parent.iterdir()])
    except (OSError, ValueError):
        near = ""
    return f"no such {what}: {path}" + (f"; did you mean {Path(path).parent / near}?" if near else "")


# --- What there is to say about a result ------------------------------------------------------------------------------


Severity = Literal["wrong", "doubt", "note"]


@dataclass(frozen=True)
class Finding:
    """A warning or a note about a result. Printed, it is its text.

    Attributes:
        code: what kind it is, in the words of the field; codes stay from version to version. All of them, with their
            meaning: ``foundation/findings.csv``.
        severity: "wrong": a figure, a file or a verdict is wrong, nobody may read the result without this; "doubt": the
            result may be another one than it seems; "note": how it is to be read, nothing is the matter.
        text: the sentence for people.
        place: file and line, axis, signal or run that it is about; "": none in particular.
        remedy: KEY=VALUE, as behind ``--set``, or a sentence: with what it would be right; "": not known.

    >>> import feedsim as fs
    >>> result = fs.check("z_positioning.yaml", set={"machine.axes.Z.drive.K_v": "42 (m/min)/mm"})
    >>> [(finding.code, finding.severity, finding.place) for finding in result.findings]
    [('loop-unstable', 'wrong', 'Z')]
    """

    code: str
    severity: Severity
    text: str
    place: str = ""
    remedy: str = ""

    def __str__(self) -> str:
        return self.text

    @property
    def marked(self) -> str:
        """The text, behind a mark where it is wrong: for a console and the table of a study, which have texts alone."""
        return WRONG * (self.severity == "wrong") + self.text


WRONG = "WRONG: "


def rank_findings(findings: Iterable[Finding]) -> list[Finding]:
    """Each once, the wrong ones first and notes last, else in their order."""
    return sorted(dict.fromkeys(findings), key=lambda finding: get_args(Severity).index(finding.severity))
