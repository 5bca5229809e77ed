"""What there is to say about a result, by its weight: `Wrong`, then a plain text, which is a doubt, then `Note`.

Findings go through the house as the warnings that they are; whoever shows them takes them by `ranked`.
"""

from __future__ import annotations

from collections.abc import Iterable


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
