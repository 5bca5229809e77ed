"""What a newcomer wants to do, from the first page on: found, and done as written."""

from __future__ import annotations

import ast
import os
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from feedsim import cli
from feedsim.jobs import examples

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
sys.path.insert(0, str(DOCS / "site"))
import commands  # noqa: E402  (a tool of the documentation, in no package)

QUICK = [ROOT / "README.md", DOCS / "index.md", DOCS / "circles.md",
         *sorted(DOCS.glob("tutorials/*.md")), *sorted(DOCS.glob("how-to/*.md"))]  # fmt: skip
EVERY = os.environ.get("FEEDSIM_DOCS_ALL") == "1"


def slug(heading: str) -> str:
    """A heading's anchor, as GitHub and the site have it."""
    return re.sub(r"[^\w -]", "", heading).lower().replace(" ", "-")


# --- found ----------------------------------------------------------------------------------------------------------


def tasks() -> dict[str, list[str]]:
    """Every task of the first page -> the links that lead to how it is done."""
    section = (DOCS / "index.md").read_text(encoding="utf-8").partition("## First tasks")[2].partition("\n## ")[0]
    rows = re.findall(r"^\| ([^|]+) \| ([^|]+) \|$", section, re.MULTILINE)[1:]
    return {task: re.findall(r"\]\(([^)]+)\)", links) for task, links in rows if "---" not in task}


def test_every_task_has_a_page() -> None:
    assert len(tasks()) >= 16
    assert all(tasks().values())


@pytest.mark.parametrize("task", tasks())
def test_a_click_leads_to_its_heading(task: str) -> None:
    for link in tasks()[task]:
        page, _, anchor = link.partition("#")
        text = (DOCS / page).read_text(encoding="utf-8")
        assert not anchor or anchor in map(slug, re.findall(r"^#+ (.*)$", text, re.MULTILINE)), link


# --- done as written ------------------------------------------------------------------------------------------------


@pytest.mark.extensive
@pytest.mark.parametrize(
    "page", commands.pages() if EVERY else [page for page in QUICK if commands.steps(page)],
    ids=lambda page: str(page.relative_to(ROOT)),
)  # fmt: skip
def test_commands_do_what_the_page_says(page: Path, fmus: Path, tmp_path: Path) -> None:
    if "feedsim export " in page.read_text(encoding="utf-8") and not (fmus / "machine.wasm").is_file():
        pytest.skip("no module of the machine (make page-module)")
    assert commands.execute(page, commands.prepared(tmp_path / "reader", fmus), slow=EVERY) == []


def test_one_axis_less(fmus: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The edits that docs/how-to/change-the-machine.md lists, in its order."""
    examples.copy(["xz_circle"], tmp_path)
    folder = tmp_path / "machines" / "test_centre"
    files = {name: (folder / name).read_text(encoding="utf-8") for name in ("structure.yaml", "machine.yaml")}
    files = {name: re.sub(r"\n  Y: .*?\n(?=  Z: )", "\n", text, flags=re.DOTALL) for name, text in files.items()}
    for name, old, new, times in (
        ("machine.yaml", ", Y: 327 mm", "", 1),
        ("structure.yaml", "moves_with: [X, Y", "moves_with: [X", 2),
        ("structure.yaml", ", 1320 mm,", ", 1647 mm,", 2),
    ):
        assert files[name].count(old) == times
        files[name] = files[name].replace(old, new)
    held = re.compile(r"(rail: column\.post_\w, .*directions: )\[X, Z\]")
    files["structure.yaml"], count = held.subn(r"\1[X, Y, Z]", files["structure.yaml"])
    assert count == 4
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
    assert cli.main(["machine", "build", str(folder), "--out", str(folder), "--force"]) == 0
    built = capsys.readouterr()
    page = (DOCS / "how-to" / "change-the-machine.md").read_text(encoding="utf-8")
    (printed,) = re.findall(r"```text\n(.*?)```", page, re.DOTALL)
    assert commands.shown(printed, built.out + built.err)
    run = ["run", str(tmp_path / "xz_circle.yaml"), "--out", str(tmp_path / "out"), "--quiet", "--fmus", str(fmus)]
    assert cli.main(run) == 0


# --- messages -------------------------------------------------------------------------------------------------------


def literals() -> Iterator[str]:
    """Texts of the program: what stands in messages between their values."""
    for path in (ROOT / "master" / "feedsim").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.JoinedStr):
                yield "".join(str(part.value) if isinstance(part, ast.Constant) else "\0" for part in node.values)
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                yield node.value


def finding_codes() -> list[str]:
    """Codes of the table of findings."""
    table = (ROOT / "master" / "feedsim" / "foundation" / "findings.csv").read_text(encoding="utf-8")
    return [line.partition(",")[0] for line in table.splitlines()[1:]]


def test_messages_that_the_page_explains_are_those_of_the_program() -> None:
    page = (DOCS / "how-to" / "warnings.md").read_text(encoding="utf-8")
    findings, _, errors = page.partition("## Errors")
    codes, quoted = (
        [quote for row in re.findall(r"^\| (.*?) \|", part, re.MULTILINE) for quote in re.findall(r"`([^`]+)`", row)]
        for part in (findings, errors)
    )
    assert (len(codes), len(quoted)) == (13, 5)
    assert {*codes} <= {*finding_codes()}
    texts = list(literals())
    for quote in quoted:
        parts = [part.strip() for part in quote.split("...") if part.strip()]
        assert any(all(part in text for part in parts) for text in texts), quote


# --- the executor itself --------------------------------------------------------------------------------------------


def test_an_executor_that_finds_what_is_wrong(fmus: Path, tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(
        "```\nfeedsim --version\n```\n\n```text\nfeedsim 99.9\n```\n\n"
        "<!-- not run: never -->\n```\nfeedsim nonsense\n```\n\n"
        "<!-- slow -->\n```\nfeedsim nonsense\n```\n\n"
        "    feedsim run nowhere.yaml\n\n"
        "<!-- first: feedsim example z_positioning -->\n```python\nopen('z_positioning.yaml')\n```\n"
    )
    wrong = commands.execute(page, commands.prepared(tmp_path / "reader", fmus), slow=False)
    assert [each.partition(" ")[0] for each in wrong] == ["page.md:1:", "page.md:19:"]
    assert "feedsim 99.9" in wrong[0]
    assert "status 2" in wrong[1]


@pytest.mark.parametrize(
    ("expected", "output", "same"),
    [
        ("G 8.19 um ...\n... wide", "XZ: G 8.19 um, 40 ms\nwide", True),
        ("a b\nc", "a  b c", True),
        ("G 8.19 um", "G 8.20 um", False),
        ("a ... c", "c a", False),
    ],
)
def test_what_is_shown_is_what_comes_out(expected: str, output: str, same: bool) -> None:
    assert commands.shown(expected, output) is same
