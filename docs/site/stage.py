"""Lay the pages of the site out in one folder: the documents as they are, and the reference made from its sources.

    python docs/site/stage.py build/site-source

May use feedsim. Start reading at main(): a page is a Markdown text by its place on the site. A link that leads to a
file of the repository that is no page becomes the file's name. The first mention of a glossary term on a page is a
link to its row.
"""

from __future__ import annotations

import os
import re
import shutil
import sys
from pathlib import Path

import feedsim
import reference
from feedsim.foundation.installation import shipped

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
# Documents that lie outside docs/: where they stand on the site.
ELSEWHERE = {
    ROOT / "CONTRIBUTING.md": "contributing.md",
    ROOT / "CHANGELOG.md": "changelog.md",
    ROOT / "README.md": "index.md",
    ROOT / "SECURITY.md": "security.md",
    ROOT / "examples" / "README.md": "reference/gallery.md",
    **{ROOT / "src" / unit / "README.md": f"units/{unit.removesuffix('_fmu')}.md"
       for unit in ("plant_fmu", "controller_fmu", "friction_fmu", "friction_gms_fmu", "setpoint_fmu", "machine_fmu",
                    "exchange", "page")},
}  # fmt: skip
# Sources of pages of the reference: a link to one is a link to the page.
MADE = {
    DOCS / "benchmarks": "reference/benchmarks.md",
    ROOT / "master" / "feedsim" / "files" / "control" / "names.csv": "reference/control-names.md",
    ROOT / "master" / "feedsim" / "estimation" / "identify" / "signals.py": "reference/signal-names.md",
    ROOT / "master" / "feedsim" / "foundation" / "findings.csv": "reference/findings.md",
    ROOT / "scenarios" / "schemas": "reference/files.md",
}
_LINK = re.compile(r"(?P<text>!?\[(?:[^\[\]]|\[[^\]]*\])*\])\((?P<target>[^)#\s]+)(?P<anchor>#[^)\s]*)?\)")


def place(document: Path) -> str | None:
    """Where a document of the repository stands on the site; None: it is no page."""
    if document in ELSEWHERE or document in MADE:
        return ELSEWHERE.get(document) or MADE[document]
    if document.is_relative_to(DOCS) and document.suffix == ".md":
        return document.relative_to(DOCS).as_posix()
    return None


def relinked(text: str, document: Path) -> str:
    """The text with its links as they are on the site."""
    here = Path(place(document) or "")

    def link(found: re.Match[str]) -> str:
        shown, target, anchor = found["text"], found["target"], found["anchor"] or ""
        if "://" in target or target.startswith("mailto:"):
            return found[0]
        file = (document.parent / target).resolve()
        page = place(file)
        if page is None and file.is_relative_to(DOCS / "images"):
            page = file.relative_to(DOCS).as_posix()
        if page is None:
            name = file.relative_to(ROOT).as_posix() if file.is_relative_to(ROOT) else target
            words = shown[1:-1].strip("`")
            return f"`{name}`" if words in (target, file.name, name) else f"{shown[1:-1]} (`{name}`)"
        return f"{shown}({os.path.relpath(page, here.parent)}{anchor})".replace(os.sep, "/")

    parts = re.split(r"(^ *```.*?^ *```)", text, flags=re.DOTALL | re.MULTILINE)
    shown = [part if position % 2 else _LINK.sub(link, part) for position, part in enumerate(parts)]
    return "".join(shown).replace("```csv\n", "```text\n")  # Pygments knows no tables


_ROW = re.compile(r"^\| ([A-Za-z][A-Za-z -]+?) \| ([^|]*?) \|", re.MULTILINE)
# What is no prose: blocks and rows, headings, code, formulas, links, tags.
_NO_PROSE = re.compile(
    r"(^ *(`{3,}|:{3,}).*?^ *\2|^\$\$.*?\$\$|^(?:\||#|    |!\[).*?$|<!--.*?-->|`[^`]*`|\$[^$]*\$"
    r"|!?\[[^\]]*\](?:\([^)]*\))?|<[^>]*>|\*\*[^*]*\*\*)",
    re.DOTALL | re.MULTILINE,
)
# The same with rows let through, but for their heads, and links that stand already left out whole.
_NO_CELL = re.compile(
    r"""(<a class="term".*?</a>|^\|[^\n]*\n(?=\|[-|: ]+\|$)|"""
    + _NO_PROSE.pattern[1:].replace(r"^(?:\||#|    |!\[)", r"^(?:#|    |!\[)"),
    re.DOTALL | re.MULTILINE,
)
_UNLINKED = ("glossary.md", "changelog.md", "contributing.md", "style.md", "index.md")


def terms() -> list[str]:
    """Terms of the glossary, the longest first."""
    text = (DOCS / "glossary.md").read_text(encoding="utf-8")
    return sorted((term for term, _ in _ROW.findall(text) if term != "term"), key=len, reverse=True)


def anchor_of(term: str) -> str:
    """Where the row of a term is on the glossary's page."""
    return "term-" + term.replace(" ", "-")


def _entry(term: str, german: str) -> str:
    """Begin of a term's row: anchor, and entries of the index, which the search ranks first (`!`)."""
    return (
        f'| <a id="{anchor_of(term)}"></a>{{index}}`{term} <!{term}>` | '
        f"{', '.join(f'{{index}}`{each} <!{each}>`' for each in german.split(', '))} |"
    )


def with_terms(text: str, page: str) -> str:
    """The text of a page with the first mention of every glossary term as a link; the glossary with its anchors, and
    with its terms in both languages for the search."""
    if page == "glossary.md":
        return _ROW.sub(lambda row: _entry(row[1], row[2]) if row[1] != "term" else row[0], text)
    if page in _UNLINKED:
        return text
    up, left = "../" * page.count("/"), terms()
    for skipped in (_NO_PROSE, _NO_CELL):  # a term that no prose of the page has, in its tables
        text = _linked(text, skipped, left, up)
    return text


def _linked(text: str, skipped: re.Pattern[str], left: list[str], up: str) -> str:
    """The text with the first mention of the terms in `left` as a link, which are taken out of it; not in `skipped`."""
    parts = []
    at = 0
    for each in [*skipped.finditer(text), None]:
        parts += [text[at : each.start() if each else len(text)], each[0] if each else ""]
        at = each.end() if each else at
    for number in range(0, len(parts), 2):
        found = []  # place, words and term, of this stretch of prose
        for term in list(left):
            if (seen := re.search(rf"(?<![\w-]){term}(?:s|es)?(?![\w-])", parts[number], re.IGNORECASE)) and not any(
                begin < seen.end() and seen.start() < end for begin, end, _ in found
            ):
                found.append((seen.start(), seen.end(), term))
                left.remove(term)
        for begin, end, term in sorted(found, reverse=True):
            words = parts[number][begin:end]
            link = f'<a class="term" href="{up}glossary.html#{anchor_of(term)}">{words}</a>'
            parts[number] = parts[number][:begin] + link + parts[number][end:]
    return "".join(parts)


_KNOBS = re.compile(r"<!-- knobs -->.*?<!-- knobs end -->", re.DOTALL)
KNOBS = (
    '<iframe class="machine" src="machine.html#lesson=1" title="The machine with its knobs: circle, diagnosis, lesson">'
    '</iframe>\n\n<p class="machine"><a href="machine.html">The machine in a window of its own</a>. Its numbers are '
    "<strong>synthetic</strong>: credible for a machining centre of nine tonnes, measured on none.</p>"
)


def first_page(text: str, folder: Path) -> str:
    """The first page, with the machine in place of its picture where there is a module to compute it; no list of its
    sections beside it."""
    if (shipped("fmus") / "machine.wasm").is_file():
        (folder / "beside").mkdir()
        feedsim.export(ROOT / "scenarios" / "xz_circle.yaml", out=folder / "beside" / "machine.html")
        text = _KNOBS.sub(KNOBS, text)
    return f"---\nhide-toc: true\n---\n\n{text}"


def main(folder: Path) -> None:
    """Write the sources of the site into `folder`, which is made anew; its folder `beside` is for beside the pages."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    shutil.copytree(DOCS / "images", folder / "images")
    documents = [path for path in sorted(DOCS.rglob("*.md")) if path.name != "README.md"]
    for document in [*documents, *(path for path in ELSEWHERE if path.is_file() and path.name != "README.md"),
                     *(path for path in ELSEWHERE if path.parent.parent.name == "src" and path.is_file())]:  # fmt: skip
        target = folder / str(place(document))
        target.parent.mkdir(parents=True, exist_ok=True)
        text = with_terms(relinked(document.read_text(encoding="utf-8"), document), str(place(document)))
        text = first_page(text, folder) if document == DOCS / "index.md" else text
        target.write_text(text, encoding="utf-8")
    for name, text in reference.pages().items():
        (folder / "reference").mkdir(exist_ok=True)
        (folder / "reference" / f"{name}.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve())
