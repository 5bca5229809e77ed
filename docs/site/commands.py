"""Execute the commands of the pages, in their order, and compare what they print with what the page shows.

    python docs/site/commands.py                          # all pages, also slow commands: `make docs-test`
    python docs/site/commands.py docs/tutorials/*.md      # these

May use numpy and yaml. Start reading at execute(). A page is executed in a folder of its own, with the examples in
`scenarios`, the units in `fmus` and the inputs of inputs(). Comments in a page steer it:

    <!-- first: COMMAND -->    done ahead of the next block, not shown to readers
    <!-- slow -->              the next block is executed by `make docs-test` alone
    <!-- not run: REASON -->   the next block is not executed

A YAML block that begins with `# FILE` is that file, where the folder has none of that name. A text block straight
behind commands is what they print; `...` stands for anything.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml

ROOT = Path(__file__).resolve().parents[2]
LIMIT = 600.0  # s, of one command
# Measured data that is not part of the repository: the name in the pages, and the variable that has its place.
MEASURED = {"capture.json": "FEEDSIM_CAPTURE", "DATA_EMPS.mat": "FEEDSIM_EMPS"}
_FENCE = re.compile(r"^(?P<ticks>`{3,})(?P<kind>\w*)\n(?P<text>.*?)^(?P=ticks)\n?", re.MULTILINE | re.DOTALL)
_INDENTED = re.compile(r"(?:^    feedsim .*\n)+", re.MULTILINE)
_MARK = re.compile(r"<!-- (first|slow|not run)(?:: (.*?))? -->", re.DOTALL)


@dataclass(frozen=True)
class Step:
    """Commands that stand together in a page, or a piece of Python, and what the page says that they print."""

    line: int
    commands: tuple[str, ...]
    python: bool = False
    printed: str = ""
    slow: bool = False
    reason: str = ""  # why it is not run


def steps(page: Path) -> list[Step]:
    """What a page asks its reader to type."""
    text = page.read_text(encoding="utf-8")
    found = list(_blocks(text))
    listed = []
    for number, (begin, end, kind, content) in enumerate(found):
        ahead = text[found[number - 1][1] if number else 0 : begin]
        marks = _MARK.findall(ahead)
        python = kind == "python"
        commands = [content] if python else list(_commands(content))
        if not commands or kind not in ("", "sh", "python"):
            continue
        printed = ""
        if number + 1 < len(found):
            behind, _, its_kind, its_content = found[number + 1]
            if its_kind == "text" and not text[end:behind].strip():
                printed = its_content
        listed.append(
            Step(
                line=text.count("\n", 0, begin) + 1,
                commands=(*(what for name, what in marks if name == "first"), *commands),
                python=python,
                printed=printed,
                slow=any(name == "slow" for name, _ in marks),
                reason=next((" ".join(what.split()) for name, what in marks if name == "not run"), ""),
            )
        )
    return listed


def _blocks(text: str) -> Iterator[tuple[int, int, str, str]]:
    """Begin, end, kind and content of every block of code, in the order of the page."""
    fenced = [(each.start(), each.end(), each["kind"], each["text"]) for each in _FENCE.finditer(text)]
    inside = [(begin, end) for begin, end, *_ in fenced]
    plain = [(each.start(), each.end(), "", each[0]) for each in _INDENTED.finditer(text)
             if not any(begin <= each.start() < end for begin, end in inside)]  # fmt: skip
    yield from sorted(fenced + plain)


def written(page: Path) -> Iterator[tuple[str, str]]:
    """Files that the page shows whole, with their names in the first line."""
    for *_, kind, content in _blocks(page.read_text(encoding="utf-8")):
        if kind == "yaml" and (found := re.match(r"# (\S+\.yaml)\n", content)):
            yield found[1], content


def _commands(content: str) -> Iterator[str]:
    """Lines that call feedsim; a line that ends with a backslash goes on in the next."""
    for line in re.sub(r"\\\n\s*", "", content).splitlines():
        command = re.sub(r"\s+#.*", "", line.strip()).removeprefix(".venv/bin/")
        if command.startswith("feedsim ") and not re.search(r"\b[A-Z]{4,}\b|\.\.\.", command.partition(" --set")[0]):
            yield command


def inputs(folder: Path) -> None:
    """Files that a reader has and the pages name: circles of a measuring instrument, logs of a control."""
    radius, feed, rate = 150.0, 1000 / 60, 100.0  # mm, mm/s, 1/s
    turn = 2 * np.pi * radius / feed
    for names, sense in (
        (("ccw.csv", "ballbar_ccw.csv", "record.csv", "scales.csv"), 1),
        (("cw.csv", "ballbar_cw.csv"), -1),
    ):
        time = np.arange(0, 1.2 * turn, 1 / rate)
        angle = sense * 2 * np.pi * time / turn
        since = (time % (turn / 4)) / 0.04  # reversals are a quarter of a turn apart, a peak lasts 40 ms
        off = radius + 5e-3 * since * np.exp(1 - since) + 2e-4 * np.random.default_rng(1).standard_normal(len(time))
        rows = np.column_stack((time, off * np.cos(angle), off * np.sin(angle)))
        for name in names:
            axes = "X [mm],Z [mm]" if name == "scales.csv" else "X [mm],Y [mm]"
            np.savetxt(folder / name, rows, fmt="%.6f", delimiter=",", header=f"time [s],{axes}", comments="")
    machine = yaml.safe_load((folder / "scenarios/machines/test_centre/machine.yaml").read_text(encoding="utf-8"))
    for name, axis in (("friction.yaml", "Z"), ("friction_x.yaml", "X"), ("friction_z.yaml", "Z")):
        (folder / name).write_text(yaml.safe_dump(machine["axes"][axis]["friction"]), encoding="utf-8")
    for name, variable in MEASURED.items():
        if place := os.environ.get(variable):
            shutil.copyfile(place, folder / name)


def prepared(folder: Path, fmus: Path = ROOT / "fmus") -> Path:
    """A folder as the pages expect it."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "fmus").symlink_to(fmus, target_is_directory=True)
    (folder / "ci").symlink_to(ROOT / "ci", target_is_directory=True)
    subprocess.run([*FEEDSIM, "example", "--to", "scenarios"], cwd=folder, check=True, capture_output=True)
    inputs(folder)
    return folder


FEEDSIM = (sys.executable, "-m", "feedsim")


def execute(page: Path, folder: Path, *, slow: bool = True) -> list[str]:
    """Do what the page says; what went wrong, a line each with the line of the page.

    folder: from prepared(). slow: also blocks marked so. Commands on measured data are left out where it is missing.
    """
    for name, content in written(page):
        if not (folder / name).exists() and (folder / name).parent.is_dir():
            (folder / name).write_text(content, encoding="utf-8")
    wrong: list[str] = []
    lost: set[str] = set()  # files that commands left out would have written
    shell = f'feedsim() {{ "{sys.executable}" -m feedsim "$@"; }}; '
    for step in steps(page):
        if step.reason or (step.slow and not slow):
            continue
        output, here = "", f"{page.name}:{step.line}"
        for command in step.commands:
            missing = [name for name in MEASURED if name in command and not (folder / name).exists()]
            if missing or any(name in command for name in lost):
                lost |= set(re.findall(r"--out (\S+)", command))
                output = ""
                continue
            python = step.python and command == step.commands[-1]
            call = [sys.executable, "-c", command] if python else ["bash", "-c", shell + command]
            try:
                done = subprocess.run(
                    call, cwd=folder, capture_output=True, text=True, timeout=LIMIT,
                    env=os.environ | {"MPLBACKEND": "agg", "BROWSER": "true"},
                )  # fmt: skip
            except subprocess.TimeoutExpired:
                wrong.append(f"{here}: not done after {LIMIT:g} s: {command}")
                continue
            output += done.stdout + done.stderr
            if done.returncode:
                wrong.append(
                    f"{here}: status {done.returncode}: {command}\n{(done.stdout + done.stderr).strip()[-800:]}"
                )
        if step.printed and output and not shown(step.printed, output):
            wrong.append(f"{here}: the page shows\n{step.printed}but it prints\n{output.strip()[-1500:]}")
    return wrong


def shown(expected: str, output: str) -> bool:
    """Whether the output has what the page shows; blanks and line breaks do not matter, `...` is anything."""
    parts = re.split(r"\s*\.\.\.\s*", " ".join(expected.split()))
    pattern = ".*?".join(re.escape(part).replace(r"\ ", r"\s+") for part in parts)
    return re.search(pattern, output, re.DOTALL) is not None


def pages() -> list[Path]:
    """All pages with something to type."""
    listed = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
    return [page for page in listed if page.name != "README.md" or page.parent == ROOT if steps(page)]


def main(names: Sequence[str]) -> int:
    """Execute these pages, all where none is named; the number of pages with something wrong."""
    failed = 0
    for page in [Path(name).resolve() for name in names] or pages():
        with tempfile.TemporaryDirectory() as scratch:
            wrong = execute(page, prepared(Path(scratch) / "reader"))
        left_out = [f"{page.name}:{step.line}: not run: {step.reason}" for step in steps(page) if step.reason]
        print(
            f"{page.relative_to(ROOT)}: {len(steps(page))} blocks, {len(wrong)} wrong",
            *left_out,
            *wrong,
            sep="\n  ",
            flush=True,
        )
        failed += bool(wrong)
    return failed


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]) != 0)
