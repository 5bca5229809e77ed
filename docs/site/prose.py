"""What docs/style.md asks of a page, checked: short sentences, lines that an editor shows, no words of the list there.

    python docs/site/prose.py docs/theory.md     # prints what is wrong, with its line; words of each page and of all

Start reading at faults(). Code, tables, headings, pictures and comments are no prose.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from statistics import median

STYLE = Path(__file__).resolve().parents[1] / "style.md"
LONGEST_SENTENCE = 30  # words
LONGEST_LINE = 120  # characters
_FENCE = re.compile(r"^ *(`{3,}|~{3,}|:{3,})")
_ITEM = re.compile(r"^ *(?:[-*+]|\d+\.) +")
_SHORT = re.compile(r"(?<![\w-])(e\.g|i\.e|Figs?|Eqs?|Nos?|vs|approx|[A-Z])\.(?=\s)")
_ENDS = re.compile(r"[.!?][\"')*_\]]*\s+(?=[\"'(*_\[]*[A-Z0-9$])")


@dataclass(frozen=True)
class Block:
    """A paragraph or an entry of a list, and the line where it begins."""

    line: int
    text: str


def blocks(text: str) -> Iterator[Block]:
    """The prose of a Markdown page."""
    fence, math, comment = "", False, False
    begun, lines = 0, list[str]()
    inside = False  # an entry of a list, whose paragraphs are indented
    for number, line in enumerate([*text.splitlines(), ""], start=1):
        opening = _FENCE.match(line)
        inside = bool(_ITEM.match(line)) or (inside and line[:1] in ("", " "))
        code = line.startswith("    ") and not lines and not inside  # a block that is indented, without a fence
        skipped = bool(fence) or math or comment or code
        if opening and not (math or comment):
            if not fence:
                fence = opening[1][:3]
            elif opening[1].startswith(fence) and line.strip().strip(fence[0]) == "":
                fence = ""
            skipped = True
        elif not fence and line.strip().startswith("$$"):
            math, skipped = math != (line.strip().count("$$") % 2 == 1), True
        elif not fence and line.strip().startswith("<!--"):
            comment, skipped = True, True
        if comment and "-->" in line:
            comment = False
        bare = line.strip()
        ends = skipped or not bare or bare[0] in "|#" or bare.startswith("![") or bool(_ITEM.match(line))
        if ends and lines:
            yield Block(begun, " ".join(lines))
            lines = []
        if not skipped and bare and bare[0] not in "|#" and not bare.startswith("!["):
            if not lines:
                begun = number
            lines.append(_ITEM.sub("", line).strip())


def sentences(block: str) -> list[str]:
    """The sentences of a block; code and formulas are one word each, a link is its text."""
    plain = re.sub(r"!?\[((?:[^\[\]]|\[[^\]]*\])*)\](?:\([^)]*\)|\[[^\]]*\])?", r"\1", block)
    plain = re.sub(r"(`+)(?!`).+?\1", "CODE", plain)
    plain = re.sub(r"\$[^$]+\$", "MATH", plain)
    plain = _SHORT.sub(r"\1", plain)  # their full stop ends no sentence
    return [part.strip() for part in _ENDS.split(plain) if part.strip()]


def words(sentence: str) -> int:
    """How many words a sentence has: what has a letter or a digit."""
    return sum(bool(re.search(r"\w", part)) for part in sentence.split())


@cache
def unwanted() -> re.Pattern[str]:
    """The words that no page uses, from the list in docs/style.md."""
    listed = STYLE.read_text(encoding="utf-8").partition("## Words that are not used")[2].partition("\n## ")[0]
    phrases = re.findall(r"^- \*(.+?)\*", listed, re.MULTILINE)
    return re.compile(r"\b(" + "|".join(map(re.escape, phrases)) + r")\b", re.IGNORECASE)


def faults(text: str, *, own: bool = False) -> list[str]:
    """What is wrong with a page, a line each. own: the page is style.md, which may name the words of its list."""
    found = []
    for block in blocks(text):
        for sentence in sentences(block.text):
            if words(sentence) > LONGEST_SENTENCE:
                found.append(f"{block.line}: {words(sentence)} words: {sentence}")
            if not own and (word := unwanted().search(sentence)):
                found.append(f"{block.line}: {word[0]!r} is not used: {sentence}")
    fenced = ""
    for number, line in enumerate(text.splitlines(), start=1):
        if opening := _FENCE.match(line):
            fenced = "" if fenced else opening[1]
        elif not fenced and len(line) > LONGEST_LINE and not line.lstrip().startswith(("|", "![", "$$", "<")):
            found.append(f"{number}: {len(line)} characters in a line")
        elif not fenced and line.lstrip().startswith("%"):
            found.append(f"{number}: the site takes a line that begins with % for a comment")
    return found


def lengths(text: str) -> list[int]:
    """Words of every sentence of a page."""
    return [words(sentence) for block in blocks(text) for sentence in sentences(block.text)]


if __name__ == "__main__":
    wrong, every = 0, list[int]()
    for name in sys.argv[1:]:
        page = Path(name).read_text(encoding="utf-8")
        every += lengths(page)
        listed = faults(page, own=Path(name).resolve() == STYLE)
        wrong += len(listed)
        print(*(f"{name}:{fault}" for fault in listed), sep="\n", end="\n" if listed else "")
        print(f"{name}: {sum(lengths(page))} words, median {median(lengths(page) or [0]):.0f}, {len(listed)} to mend")
    if len(sys.argv) > 2:
        print(f"together: {sum(every)} words, longest {max(every, default=0)}, median {median(every or [0]):.0f}")
    sys.exit(bool(wrong))
