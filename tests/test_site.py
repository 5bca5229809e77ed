"""The documentation as a site: no warning, opens from disk, asks nobody, every link leads somewhere."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import quote_plus, unquote

import pytest

pytestmark = pytest.mark.extensive

pytest.importorskip("sphinx", reason="Sphinx is not installed (requirements-dev.lock)")
ROOT = Path(__file__).resolve().parents[1]
# What newcomers type, and the page that has to come first; of words that many pages have, among the first eight.
FIRST = {
    "my circle is not round": "circles", "circle not round": "circles",
    "backlash": "glossary#", "settling time": "glossary#", "Kreisformtest": "glossary#",
    "Umkehrspiel": "glossary#", "Drehzahlvorsteuerung": "glossary#",
    "change the machine": "how-to/change-the-machine", "one axis less": "how-to/change-the-machine",
    "mapping file": "traces", "friction from traces": "identification", "frequency responses": "frf",
    "results over each other": "reports", "from a log to your machine": "replay", "performance": "performance",
    "files of a control": "controls", "uncertainty": "uncertainty", "first circle": "tutorials/first-circle",
}  # fmt: skip
SEARCHED = {
    "ballbar": "circles", "K_v": "how-to/change-the-machine", "position gain": "how-to/change-the-machine",
    "another motor": "how-to/change-the-machine", "loads": "scenarios", "another maker drive": "scenarios",
    "FMPy": "importing", "CI": "comparing", "notebook": "python", "study": "sweeps",
    "finite-element": "fe-import", "not believe": "how-to/warnings", "warning": "how-to/warnings", "margins": "tuning",
}  # fmt: skip
# Pages that axe-core looks at, one of each part.
AXED = ("index", "search", "tutorials/first-circle", "circles", "figures", "glossary", "theory",
        "reference/commands", "reference/python", "reference/gallery", "units/plant")  # fmt: skip
LARGEST = 10e6  # bytes of all pages: what a wheel can carry


class Page(HTMLParser):
    """Names of a page's places, its links, and what it would load."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.names: set[str] = set()
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.images_without_text = 0
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {name: value or "" for name, value in attrs}
        self.names |= {values[name] for name in ("id", "name") if name in values}
        if tag == "a" and "href" in values:
            self.links.append(values["href"])
        if tag in ("script", "img", "iframe") and "src" in values:
            self.loaded.append(values["src"])
        if tag == "link" and values.get("rel") in ("stylesheet", "icon", "preload"):
            self.loaded.append(values["href"])
        if tag == "img" and not values.get("alt"):
            self.images_without_text += 1


@pytest.fixture(scope="module")
def site(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    stage = [sys.executable, ROOT / "docs" / "site" / "stage.py", folder / "source"]
    build = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-b", "html", "-c", ROOT / "docs" / "site",
             "-d", folder / "trees", folder / "source", folder / "site"]  # fmt: skip
    for command in (stage, build):
        done = subprocess.run(command, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
    return folder / "site"


@pytest.fixture(scope="module")
def pages(site: Path) -> dict[Path, Page]:
    return {path.resolve(): Page(path) for path in site.rglob("*.html")}


def test_every_document_is_a_page(pages: dict[Path, Page], site: Path) -> None:
    names = {path.relative_to(site.resolve()).as_posix() for path in pages}
    for document in (ROOT / "docs").rglob("*.md"):
        assert document.relative_to(ROOT / "docs").with_suffix(".html").as_posix() in names, document
    assert {"units/plant.html", "contributing.html", "reference/commands.html", "glossary.html"} <= names


def test_links_lead_somewhere(pages: dict[Path, Page]) -> None:
    lost = []
    for path, page in pages.items():
        for link in page.links:
            target, _, anchor = link.partition("#")
            if "://" in target or target.startswith("mailto:"):
                continue
            file = (path.parent / unquote(target)).resolve() if target else path
            if not file.is_file() or (anchor and file in pages and unquote(anchor) not in pages[file].names):
                lost.append(f"{path.name}: {link}")
    assert not lost


def test_terms_lead_to_the_glossary(pages: dict[Path, Page], site: Path) -> None:
    """Every term has its row, and a page links to it once."""
    home = (site / "glossary.html").resolve()
    rows = {name for name in pages[home].names if name.startswith("term-")}
    assert len(rows) > 22
    linked = [
        [link.partition("#")[2] for link in page.links if "glossary.html#term-" in link] for page in pages.values()
    ]
    assert all(len(set(each)) == len(each) for each in linked)
    assert {name for each in linked for name in each} <= rows
    assert sum(bool(each) for each in linked) > 20
    assert len({name for each in linked for name in each}) > 0.7 * len(rows)


def test_terms_are_linked_in_prose_alone() -> None:
    sys.path.insert(0, str(ROOT / "docs" / "site"))
    from stage import with_terms

    text = (
        "# Backlash\n\n| backlash | row |\n\n`jerk` and $jerk$, [jerk](a.md).\n\n```\njerk\n```\n\n"
        "A Jerk, less jerk; backlashes, the quadrant glitches. **jerk**\n"
    )
    linked = with_terms(text, "how-to/a.md")
    assert linked.count("glossary.html#") == 3
    assert 'A <a class="term" href="../glossary.html#term-jerk">Jerk</a>, less jerk' in linked
    assert 'href="../glossary.html#term-quadrant-glitch">quadrant glitches</a>' in linked
    row = with_terms("| lost motion | Umkehrspanne, Lose | um |\n", "glossary.md")
    assert row.startswith('| <a id="term-lost-motion"></a>{index}`lost motion <!lost motion>` | ')
    assert row.endswith("{index}`Umkehrspanne <!Umkehrspanne>`, {index}`Lose <!Lose>` | um |\n")


def test_pages_ask_nobody_and_are_not_too_large(pages: dict[Path, Page], site: Path) -> None:
    assert not [source for page in pages.values() for source in page.loaded if "://" in source or source[:2] == "//"]
    assert sum(path.stat().st_size for path in site.rglob("*") if path.is_file()) < LARGEST


def test_pictures_have_words(pages: dict[Path, Page]) -> None:
    assert not [path.name for path, page in pages.items() if page.images_without_text]


def test_equations_are_set(site: Path) -> None:
    page = (site / "figures.html").read_text(encoding="utf-8")
    assert page.count("<math") > 20
    assert not re.search(r"\\(frac|sum|max|mathrm|left)", re.sub(r"<annotation.*?</annotation>", "", page, flags=re.S))


def test_the_search_finds_pages_from_disk(browser: Any, site: Path) -> None:
    """In a real browser, which asks for nothing but files of the site."""
    asked: list[str] = []
    page = browser.new_page()
    page.on("request", lambda request: asked.append(request.url))
    for words, target, count in [*((*each, 1) for each in FIRST.items()), *((*each, 8) for each in SEARCHED.items())]:
        page.goto((site / "search.html").as_uri() + f"?q={quote_plus(words)}")
        page.wait_for_function("() => document.querySelectorAll('ul.search li > a').length && !Search._queued_query")
        found = page.locator("ul.search li > a").evaluate_all("nodes => nodes.slice(0, 8).map(node => node.href)")
        part = f"/{target}.html" if "#" not in target else f"/{target.replace('#', '.html#')}"
        assert any(part in each for each in found[:count]), (words, found)
    page.close()
    assert not [url for url in asked if not url.startswith(("file:", "data:"))]


SCREENS = {"1366x768": (1366, 768), "phone": (390, 844)}
# Bottom of each part of the machine's page, in the window: circle (without what lies beside or below it), lesson, knob.
BOTTOMS = """() => {
    const bottom = selector => document.querySelector(selector).getBoundingClientRect().bottom;
    const { top, height, width } = document.querySelector("figure[id^=contour-] svg.chart").getBoundingClientRect();
    return { circle: top + Math.min(height, width), marked: document.querySelectorAll(".knob.pointed").length,
             knob: bottom(".knob.pointed"), lesson: bottom("#lesson") };
}"""


@pytest.mark.parametrize("screen", SCREENS)
def test_the_first_page_has_the_machine_on_one_screen(browser: Any, site: Path, screen: str) -> None:
    """Circle, the lesson that says why it is not round, and its one knob, without a scroll."""
    if not (site / "machine.html").is_file():
        pytest.skip("no module of the machine (make page-module)")
    width, height = SCREENS[screen]
    page = browser.new_page(viewport={"width": width, "height": height}, bypass_csp=True)  # to look into it
    page.goto((site / "index.html").as_uri())
    frame = page.frame(url=re.compile("machine.html"))
    assert frame is not None
    frame.wait_for_function("(({ asked, shown, loops }) => asked && asked === shown && asked === loops)"
                            "(document.documentElement.dataset)")  # fmt: skip
    top = page.locator("iframe.machine").bounding_box()["y"]
    bottoms = frame.evaluate(BOTTOMS)
    assert bottoms.pop("marked") == 1
    assert top + max(bottoms.values()) <= height, bottoms
    page.close()


def test_the_gallery_is_a_grid_with_the_circle_first(browser: Any, site: Path) -> None:
    page = browser.new_page(viewport={"width": 1366, "height": 768})
    page.goto((site / "reference" / "gallery.html").as_uri())
    cards = page.locator("nav.gallery a")
    assert cards.count() == len(list((ROOT / "examples").glob("*.py")))
    assert cards.first.get_attribute("href") == "#first-circle"
    tops = cards.evaluate_all("nodes => nodes.slice(0, 3).map(node => node.getBoundingClientRect().top)")
    assert len(set(tops)) == 1
    shown = page.locator("nav.gallery img").evaluate_all("nodes => nodes.map(node => node.getAttribute('src'))")
    assert all((site / "reference" / source).is_file() for source in shown)
    page.close()


@pytest.mark.parametrize("name", ["reference/commands", "reference/files", "circles"])
def test_nothing_is_cut_off_at_the_right(browser: Any, site: Path, name: str) -> None:
    """Options and keys: on a phone too, without a scroll to the side."""
    page = browser.new_page(viewport={"width": 390, "height": 844})
    page.goto((site / f"{name}.html").as_uri())
    wide = "nodes => nodes.filter(each => each.scrollWidth > each.clientWidth + 1).map(each => each.textContent)"
    if name == "reference/commands":
        assert page.locator("article .table-wrapper, article .wrapped pre").evaluate_all(wide) == []
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    page.close()


@pytest.mark.skipif("FEEDSIM_AXE" not in os.environ, reason="FEEDSIM_AXE names axe.min.js of axe-core (make axe)")
def test_axe_core_finds_nothing(browser: Any, site: Path) -> None:
    """Pages of every part, on light and dark screens, wide and narrow."""
    script = Path(os.environ["FEEDSIM_AXE"]).read_text(encoding="utf-8")
    found = []
    for name in AXED:
        for scheme, width in (("light", 1400), ("dark", 390)):
            page = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme)
            page.goto((site / f"{name}.html").as_uri())
            page.evaluate(script)
            violations = page.evaluate("axe.run(document)")["violations"]
            found += [(name, scheme, each["id"], each["nodes"][0]["html"][:160]) for each in violations]
            page.close()
    assert not found
