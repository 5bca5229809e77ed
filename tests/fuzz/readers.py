"""Fuzzer of everything that reads files: each case in a process of its own, forked from one that is warm.

    PYTHONPATH=tests python -m fuzz.readers --seconds 600 --seed 1 [--only mat,uff] [--keep build/fuzz]

Files of every kind are made, and changed at random: bits, bytes, chunks lost, doubled or taken from another file,
numbers that are huge or none; entries of archives likewise, and of archives inside archives. Besides, files of a
megabyte that are nested, long, wide or many of one thing (sizes.py). Allowed is a result, or feedsim's own error. A
finding is any other exception, a crash, more than 5 s of computing or a minute altogether, or more than 1 GB. Findings
are kept, told, and make the exit code 1; those of the past are in corpus/readers, named by what reads them, and are
tried by the test suite.
"""

from __future__ import annotations

import argparse
import faulthandler
import gc
import hashlib
import os
import random
import re
import resource
import select
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path

from feedsim.foundation.errors import FeedsimError
from feedsim.simulation import cosim
from fuzz.changes import changed
from fuzz.kinds import Kind, kinds

ROOT = Path(__file__).resolve().parents[2]
CORPUS = Path(__file__).resolve().parent / "corpus" / "readers"
COMPUTING, WAITING, MEMORY = 5, 60, 1 << 30  # s of a processor, s altogether, bytes


def outcome(read: Callable[[Path], object], path: Path, computing: int = 0) -> str:
    """How a reader ends on a file, in a process of its own: "read", "refused", or what is wrong with its end.

    computing: s of a processor that it may take; 0: COMPUTING.
    """
    computing = computing or COMPUTING
    ours, theirs = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(ours)
        _try(read, path, theirs, computing)
    os.close(theirs)
    try:
        ready, _, _ = select.select([ours], [], [], WAITING)
        if not ready:
            os.kill(child, signal.SIGKILL)
        with os.fdopen(ours, "rb") as pipe:
            said = pipe.read().decode("utf-8", "replace")
    finally:
        _, status = os.waitpid(child, 0)
    if not ready:
        return f"no end within {WAITING} s"
    if os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        return f"more than {computing} s of computing" if number == signal.SIGXCPU else f"crash by signal {number}"
    return said or f"exit code {os.WEXITSTATUS(status)} without a word"


def _try(read: Callable[[Path], object], path: Path, pipe: int, computing: int) -> None:
    said = "read"
    gc.freeze()  # what the parent holds is not looked through again and again in the reader's time
    try:
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_CPU, (computing, computing + 1))
        with suppress(OSError):  # no such page on other systems
            held = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0]) * resource.getpagesize()
            resource.setrlimit(resource.RLIMIT_AS, (held + MEMORY, held + MEMORY))
        nothing = os.open(os.devnull, os.O_RDWR)
        for number in (0, 1, 2):
            os.dup2(nothing, number)
        warnings.simplefilter("ignore")
        faulthandler.disable()
        read(path)
    except FeedsimError as error:
        said = (
            "refused" if str(path) in str(error) or path.name in str(error) else f"a refusal without the file: {error}"
        )
    except BaseException:
        said = traceback.format_exc()
    os.write(pipe, said.encode("utf-8", "replace")[-30_000:])
    os._exit(0)


def cases(all_kinds: Mapping[str, Kind], seed: int) -> Iterator[tuple[str, bytes]]:
    """Kind and content, without end; the same for the same seed."""
    chance = random.Random(seed)
    names = list(all_kinds)
    while True:
        name = chance.choice(names)
        whole = all_kinds[name].whole
        yield name, changed(chance, chance.choice(whole), whole)


def replayed(all_kinds: Mapping[str, Kind], folder: Path) -> dict[str, str]:
    """Kept file -> how it ends."""
    ends = {}
    for kept in sorted(CORPUS.iterdir()):
        kind = all_kinds[kept.name.partition("-")[0]]
        path = folder / f"case{kind.suffix}"
        path.write_bytes(kept.read_bytes())
        ends[kept.name] = outcome(kind.read, path)
    return ends


def fuzz(
    all_kinds: Mapping[str, Kind], folder: Path, seconds: float, seed: int, keep: Path
) -> tuple[Counter[str], list[str]]:
    """Count of cases by kind and end; findings, each once, whose files are left in `keep`."""
    counts: Counter[str] = Counter()
    findings: dict[str, str] = {}
    until = time.monotonic() + seconds
    for name, content in cases(all_kinds, seed):
        if time.monotonic() > until:
            break
        path = folder / f"case{all_kinds[name].suffix}"
        path.write_bytes(content)
        end = outcome(all_kinds[name].read, path)
        counts[f"{name}: {end if end in ('read', 'refused') else 'finding'}"] += 1
        if end in ("read", "refused"):
            continue
        where = name + re.sub(r"[0-9a-fx]{6,}|'[^']*'", "", "".join(end.strip().splitlines()[-3:]))[:120]
        if where not in findings:
            keep.mkdir(parents=True, exist_ok=True)
            kept = keep / f"{name}-{hashlib.sha256(content).hexdigest()[:8]}"
            kept.write_bytes(content)
            findings[where] = f"{kept}: {end}"
            print(findings[where], flush=True)
    return counts, list(findings.values())


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--seconds", type=float, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="kinds, with commas between")
    parser.add_argument("--keep", type=Path, default=ROOT / "build" / "fuzz", help="folder for files that are findings")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="fuzz-") as name:
        folder = Path(name)
        known = kinds(folder, cosim.fmus_directory())
        wanted = [each for each in options.only.split(",") if each]
        if unknown := [each for each in wanted if each not in known]:
            parser.error(f"--only {unknown[0]}: no such kind; there is {', '.join(known)}")
        chosen = {each: known[each] for each in wanted} or known
        old = {kept: end for kept, end in replayed(known, folder).items() if end not in ("read", "refused")}
        counts, found = fuzz(chosen, folder, options.seconds, options.seed, options.keep)
    for kept, end in old.items():
        print(f"{CORPUS / kept}: {end}")
    for each, count in sorted(counts.items()):
        print(f"{count:8d} {each}")
    print(f"{sum(counts.values())} cases, {len(found) + len(old)} findings")
    return 1 if found or old else 0


if __name__ == "__main__":
    sys.exit(main())
