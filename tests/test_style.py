"""Pages are written as docs/style.md asks: short sentences, short lines, none of the words listed there."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from statistics import median

import pytest

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "docs" / "site"))
import prose  # noqa: E402  (a tool of the documentation, in no package)

PAGES = sorted(
    path
    for pattern in ("README.md", "CONTRIBUTING.md", "SECURITY.md", "docs/**/*.md", "src/*/README.md")
    for path in ROOT.glob(pattern)
)
MEDIAN = 14  # words of a sentence
TOGETHER = 20_000  # words of prose on all pages: whoever adds a paragraph takes one away
WHOLE = 40_000  # words of README and docs, tables and code included: keys, options and names are the reference's


def named(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_page_keeps_to_the_style(page: Path) -> None:
    assert prose.faults(page.read_text(encoding="utf-8"), own=page == prose.STYLE) == []


def test_sentences_are_short_in_the_middle() -> None:
    lengths = [words for page in PAGES for words in prose.lengths(page.read_text(encoding="utf-8"))]
    assert median(lengths) <= MEDIAN


def test_pages_together_can_be_read() -> None:
    assert sum(words for page in PAGES for words in prose.lengths(page.read_text(encoding="utf-8"))) <= TOGETHER


def test_docs_together_can_be_read() -> None:
    pages = [ROOT / "README.md", *ROOT.glob("docs/**/*.md")]
    assert sum(len(page.read_text(encoding="utf-8").split()) for page in pages) <= WHOLE


def test_readme_fits_on_two_screens() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 120


@pytest.mark.parametrize("page", ["CONTRIBUTING.md", "docs/architecture.md"])
def test_files_of_the_house_are_where_a_page_says(page: str) -> None:
    """By their path from the root, or its end; files of other repositories are none of the house."""
    text = (ROOT / page).read_text(encoding="utf-8")
    paths = re.findall(r"`([\w./*-]+/[\w./*-]+|[\w*-]+\.(?:py|c|h|js|def))`", text)
    places = [path for path in ("master/feedsim", "src", "tests", "docs", ".ci", "ci") if (ROOT / path).is_dir()]
    assert len(paths) > 10
    missing = [
        name
        for name in dict.fromkeys(paths)
        if not any(ROOT.glob(name)) and not any(any((ROOT / place).rglob(name)) for place in places)
    ]
    assert sorted(set(missing) - {"demo/freq_trace.XML"}) == []


LONG = "So it is " + "an ox or a cow " * 6 + "we see."  # 35 words, which fit a line


@pytest.mark.parametrize(
    ("text", "line", "part"),
    [
        (f"# A\n\n{LONG}\n", "3", "words"),
        (f"- short\n- {LONG}\n", "2", "words"),
        ("One.\n\nIt cannot be had here.\n", "3", "'be had'"),
        ("```\ncode\n```\n" + "a " * 61 + "\n", "4", "characters"),
        ("It is off by 3\n% of it.\n", "2", "comment"),
    ],
)
def test_what_is_wrong_is_found_with_its_line(text: str, line: str, part: str) -> None:
    found = prose.faults(text)
    assert [fault for fault in found if fault.startswith(f"{line}:") and part in fault]


@pytest.mark.parametrize(
    "text",
    [
        f"```\n{LONG}\n```\n",
        f"| {LONG} |\n",
        f"# {LONG}\n",
        f"<!-- {LONG} -->\n",
        f"$$\n{LONG}\n$$\n",
        f"`{LONG}`\n",
        "See Fig. 2 of the paper. " * 4,
        "`be had` is code.\n",
    ],
)
def test_what_is_no_prose_is_free(text: str) -> None:
    assert prose.faults(text) == []


def test_sentences_are_told_apart() -> None:
    assert prose.sentences("See Eq. 3, e.g. `a. B`. It says *so.* And [a link. Two](b.md)?") == [
        "See Eq 3, e.g CODE", "It says *so", "And a link", "Two?",
    ]  # fmt: skip
    assert prose.words("a - b, $x$ |") == 3
