"""What has become slower since another version: commands of both by turns, from the start of a process to its end.

The other version is a commit or a tag of this repository, which is checked out and built by its own Makefile in
build/bench/versions, or the folder of a checkout that is built. Scenarios are those of each version; records are those
of this one, which both read. A command counts as slower where the median of the ratios is above 1.03, and so is their
first quartile.

    make bench-release AGAINST=v0.2.0
    python benchmarks/release.py --check       whether the figures are of these sources, and nothing is slower
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from harness import RESULTS, ROOT, Contestant, Costs, arguments, digits, measure, progress, table

import provenance

SLOWER = 1.03  # ratio of times above which a command has become slower
RECORDS = ROOT / "scenarios" / "records"
CIRCLE, MACHINE = "scenarios/xz_circle.yaml", "scenarios/machines/test_centre"
# Name -> words of the command by version, newest first: which of them a version knows, its first run shows. OUT: folder
# that it writes to; LOGS: traces of constant speeds and of sines, written before by this version.
CASES: dict[str, tuple[list[str], ...]] = {
    "a file that is not there": (["run", "scenarios/xz_circel.yaml"],),
    "circle in both directions": (["run", CIRCLE, "--quiet", "--out", "OUT"],),
    "circle, 20 turns": (["run", CIRCLE, "--quiet", "--out", "OUT", "--set", "motions.0.turns=20"],),
    "`frf`": (["frf", CIRCLE, "--quiet", "--out", "OUT"],),
    "`identify friction`, two logs": (
        ["identify", "friction", "LOGS", "--axes", "Z", "--machine", MACHINE, "--quiet", "--out", "OUT"],
        ["identify", "LOGS", "--axis", "Z", "--machine", MACHINE, "--quiet", "--out", "OUT"],
    ),
    "`identify drive`": (
        ["identify", "drive", str(RECORDS / "log" / "log.csv"), "--columns", str(RECORDS / "log" / "columns.yaml"),
         "--axes", "Z", "--quiet", "--out", "OUT"],
        ["identify-drive", str(RECORDS / "log" / "log.csv"), "--columns", str(RECORDS / "log" / "columns.yaml"),
         "--axes", "Z", "--quiet", "--out", "OUT"],
    ),
}  # fmt: skip
SHOWN_SHORT = ("a file that is not there",)
LOGGED = ("identify_z_constant", "identify_z_sine")


def checkout(version: str) -> Path:
    """Folder of a built checkout of a commit, tag or folder. SystemExit: there is none, or it cannot be built."""
    if Path(version).is_dir():
        return Path(version).resolve()
    found = subprocess.run(
        ["git", "rev-parse", "--verify", f"{version}^{{commit}}"], cwd=ROOT, capture_output=True, text=True
    )
    if found.returncode:
        raise SystemExit(f"--against {version}: no folder, and no commit or tag of {ROOT}")
    folder = RESULTS / "versions" / found.stdout.strip()[:12]
    if not folder.is_dir():
        subprocess.run(["git", "clone", "--quiet", "--no-checkout", str(ROOT), str(folder)], check=True)
        subprocess.run(["git", "checkout", "--quiet", found.stdout.strip()], cwd=folder, check=True)
    for target in ("fmus", ".venv/.run"):
        progress(f"{version}: make {target}")
        made = subprocess.run(["make", "-s", target], cwd=folder, capture_output=True, text=True)
        if made.returncode:
            raise SystemExit(f"{version}: make {target} in {folder}: {made.stderr.strip()[-2000:]}")
    return folder


def known_words(
    feedsim: Path, folder: Path, choices: Sequence[list[str]], fill: Callable[[str], list[str]]
) -> list[str]:
    """The first of the commands that a version carries out, with files in place of OUT and LOGS."""
    for words in choices:
        filled = [str(feedsim), *(part for word in words for part in fill(word))]
        done = subprocess.run(filled, cwd=folder, capture_output=True, text=True)
        if done.returncode == 0 or choices is CASES["a file that is not there"]:
            return filled
    raise SystemExit(f"{folder}: {' '.join(filled)}: {done.stderr.strip()}")


def timed(words: list[str], folder: Path) -> Callable[[], float]:
    """A command that measures itself: wall time from its start to its end [s]."""

    def run() -> float:
        begun = time.perf_counter()
        subprocess.run(words, cwd=folder, capture_output=True)
        return time.perf_counter() - begun

    return run


def is_slower(costs: Costs, now: str, before: str) -> bool:
    """Whether the ratio is above SLOWER beyond its scatter over the rounds."""
    return costs.ratio(now, before) > SLOWER and costs.quartiles(now, before)[0] > SLOWER


def check() -> int:
    """0: the figures that there are, are of these sources, and no command is slower; else 1, with a reason."""
    file = RESULTS / "release.json"
    if not file.is_file():
        print(f"{file.relative_to(ROOT)}: not there; measure against the last release: make bench-release AGAINST=TAG",
              file=sys.stderr)  # fmt: skip
        return 1
    content = json.loads(file.read_text(encoding="utf-8"))
    if content["short"] or content["sources"] != provenance.sources():
        print(f"{file.relative_to(ROOT)}: is not of these sources; measure again: make bench-release AGAINST=TAG",
              file=sys.stderr)  # fmt: skip
        return 1
    for name in content["results"]["slower"]:
        print(f"slower than {content['results']['against']}: {name}", file=sys.stderr)
    return 1 if content["results"]["slower"] else 0


def main(words: Sequence[str] | None = None) -> int:
    """Measure, and write the table of changes; 1 with --check where a release must not go out."""
    bench = arguments(
        "release", __doc__, words, rounds=7, only=tuple(CASES),
        more=lambda parser: (
            parser.add_argument("--against", metavar="VERSION", help="commit, tag, or folder of a built checkout"),
            parser.add_argument("--check", action="store_true", help="measure nothing; 1: not to be released"),
        ),
    )  # fmt: skip
    if bench.given.check:
        return check()
    if not (bench.given.against or bench.short):
        raise SystemExit("--against VERSION: which version to compare with")
    other = checkout(bench.given.against or str(ROOT))
    rows, results, slower = [], {}, []
    with TemporaryDirectory(prefix="feedsim-bench-") as place:
        logs: list[str] = []
        for name in () if bench.short else LOGGED:
            out = Path(place) / name
            run = [ROOT / ".venv/bin/feedsim", "run", f"scenarios/{name}.yaml", "--quiet", "--out", out]
            subprocess.run([str(word) for word in run], cwd=ROOT, check=True, capture_output=True)
            logs.append(str(out / "log.csv"))
        chosen = [name for name in bench.only if not bench.short or name in SHOWN_SHORT]
        # All of them once, ahead of the first measurement: a command that fails does so at once.
        cases: dict[str, list[Contestant]] = {name: [] for name in chosen}
        for case, (name, contestants) in enumerate(cases.items()):
            for number, folder in enumerate((ROOT, other)):
                # A folder a case: a result of one kind does not replace one of another.
                files = {"OUT": [f"{place}/{number}-{case}"], "LOGS": logs}
                feedsim = folder / ".venv" / "bin" / "feedsim"
                command = known_words(feedsim, folder, CASES[name], lambda word, files=files: files.get(word, [word]))
                force = ["--force"] if "--out" in command else []
                contestants.append(Contestant(("now", "before")[number], timed([*command, *force], folder)))
        for name, contestants in cases.items():
            costs = measure(contestants, bench.rounds, title=name)
            if is_slower(costs, "now", "before"):
                slower.append(name)
            mark = "slower" if name in slower else ""
            rows.append([name, *(f"{digits(costs.median(each))} s" for each in ("before", "now")),
                         costs.ratio_text("now", "before"), mark])  # fmt: skip
            results[name] = costs.as_json("before")
    text = table(["command", "before", "now", "ratio (quartiles)", ""], rows)
    against = bench.given.against or "itself"
    bench.tell(f"Against {against}:\n\n{text}", {"against": against, "commands": results, "slower": slower})
    return 0


if __name__ == "__main__":
    sys.exit(main())
