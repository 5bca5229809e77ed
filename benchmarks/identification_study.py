"""Whether an interval is a promise: identification of logs of known axes, good ones and such with imperfections.

Run by ``make identification-study`` (some half an hour on one core). Every log of identification_logs.py is written
as files, read and identified as feedsim does it, and judged: what is called "estimated" must hold the
truth in its 95 % interval, and where it does not, a warning must name the cause. Leaves study.jsonl, a line per log,
and table.md; what they show is explained in docs/trust.md.
"""

from __future__ import annotations

import argparse
import json
import signal
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from itertools import zip_longest
from math import sqrt
from pathlib import Path
from time import process_time
from types import FrameType

from identification_logs import FLAWS, Log, made, names

from feedsim.estimation.identify import AxisRequest, identify, named_apart, read_traces
from feedsim.estimation.least_squares import NORMAL_95
from feedsim.files.columns import load_columns
from feedsim.foundation.errors import Finding, InputError
from feedsim.simulation.cosim.friction_law import FrictionLaw

LONGEST = 120  # s of one core: a log that takes longer is given up
BY_CHANCE = 3.0  # standard deviations: a value farther off is no matter of chance
CURVE = ("F_C", "F_S", "v_s", "F_log", "sigma_2", "asymmetry", "M_0")


@dataclass(frozen=True)
class Outcome:
    """What became of a log.

    Attributes:
        name, flaws, words: of the log.
        refused: the message, where nothing was offered.
        off: parameter that is called estimated -> standard deviations between it and the truth.
        errors: the same -> error [1] over the truth (sigma over the truth in `sigmas`); of the delay in s.
        states: parameter -> status.
        warnings, advice: what was said. seconds: of one core, that it took.
    """

    name: str
    flaws: tuple[str, ...]
    words: str
    refused: str
    off: dict[str, float]
    errors: dict[str, float]
    sigmas: dict[str, float]
    states: dict[str, str]
    warnings: tuple[Finding, ...]
    advice: tuple[str, ...]
    seconds: float

    @property
    def missed(self) -> dict[str, float]:
        """Parameters whose interval does not hold the truth."""
        return {name: off for name, off in self.off.items() if not abs(off) <= NORMAL_95}

    @property
    def named(self) -> bool:
        """Whether a warning names the cause: a word of each flaw that there is, or of one of them."""
        said = " ".join(map(str, self.warnings)).lower()
        return any(word in said for flaw in self.flaws for word in FLAWS[flaw].words)


@contextmanager
def _given_up(seconds: float) -> Iterator[None]:
    def stop(number: int, frame: FrameType | None) -> None:
        raise TimeoutError(f"no end after {seconds:g} s")

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def judged(log: Log) -> Outcome:
    """Read and identify, as the command does it."""
    off: dict[str, float] = {}
    errors: dict[str, float] = {}
    sigmas: dict[str, float] = {}
    states: dict[str, str] = {}
    warnings: tuple[Finding, ...] = ()
    advice: tuple[str, ...] = ()
    refused = ""
    begun = process_time()
    try:
        with _given_up(LONGEST):
            recorded = read_traces(log.files, load_columns(log.mapping))
            sources = tuple(each.provenance for each in recorded)
            asked = AxisRequest(axis="Z", inertia=log.inertia, delay=log.delay)
            with FrictionLaw() as law:
                found = identify(named_apart(recorded), law, asked.with_traces(sources))
        warnings = (*(finding for source in sources for finding in source.warnings), *found.warnings)
        advice = found.advice
        for name, estimate in found.estimates.items():
            states[name] = estimate.status
            if estimate.status != "estimated" or name not in log.truth:
                continue
            away = estimate.value - log.truth[name]
            size = abs(log.truth[name]) or 1.0
            size = 1.0 if name in ("delay", "asymmetry") else size
            off[name] = away / estimate.sigma if estimate.sigma > 0 else float("inf")
            errors[name], sigmas[name] = away / size, estimate.sigma / size
    except (InputError, TimeoutError) as error:
        refused = f"{type(error).__name__}: {error}"
    seconds = process_time() - begun
    return Outcome(log.name, log.flaws, log.words, refused, off, errors, sigmas, states, warnings, advice, seconds)


def told(each: Outcome) -> str:
    """Lines of a log."""
    lines = [f"== {each.name} ({each.words}), {each.seconds:.1f} s"]
    if each.refused:
        return "\n".join([*lines, f"   refused: {each.refused}"])
    held = [name for name in each.off if name not in each.missed]
    lines.append(f"   holds: {' '.join(held)}")
    for name, off in each.missed.items():
        lines.append(
            f"   MISSED {name}: {100 * each.errors[name]:+.3g} %, says +- {100 * each.sigmas[name]:.2g} % (sigma), "
            f"{off:+.1f} sigmas"
        )
    other = [f"{name} ({status})" for name, status in each.states.items() if status != "estimated"]
    lines.append(f"   not estimated: {', '.join(other)}")
    lines += [f"   warning: {text}" for text in each.warnings]
    lines += [f"   advice: {text}" for text in each.advice]
    return "\n".join(lines)


def summary(outcomes: Sequence[Outcome]) -> list[str]:
    """Lines of Markdown: coverage per parameter, logs per kind, accuracy of the good ones."""
    offered = [each for each in outcomes if not each.refused]
    every = list(dict.fromkeys(name for each in offered for name in each.off))
    lines = ["| parameter | estimated in logs | holds the truth | off by more than 3 sigmas | silent of those |"]
    lines.append("|---" * 5 + "|")
    for name in every:
        of = [each for each in offered if name in each.off]
        holds = sum(name not in each.missed for each in of)
        far = [each for each in of if abs(each.off[name]) > BY_CHANCE]
        silent = sum(not each.named for each in far)
        lines.append(f"| {name} | {len(of)} | {100 * holds / len(of):.1f} % | {len(far)} | {silent} |")
    lines += ["", "| kind of log | logs | refused | without a miss | missed, cause named | missed by chance | silent |"]
    lines.append("|---" * 7 + "|")
    kinds = ["good", *FLAWS, "pairs", "all"]
    for kind in kinds:
        of = [each for each in outcomes if _is(each, kind)]
        if not of:
            continue
        refused = sum(bool(each.refused) for each in of)
        missed = [each for each in of if each.missed]
        named = [each for each in missed if each.named]
        rest = [each for each in missed if not each.named]
        chance = [each for each in rest if max(map(abs, each.missed.values())) <= BY_CHANCE]
        whole = len(of) - refused - len(missed)
        lines.append(
            f"| {kind.replace('_', ' ')} | {len(of)} | {refused} | {whole} | {len(named)} | {len(chance)} | "
            f"{len(rest) - len(chance)} |"
        )
    good = [each for each in offered if not each.flaws]
    if good:
        lines += ["", "| good logs, errors in % | " + " | ".join(every) + " |", "|---" * (len(every) + 1) + "|"]
        for label, power in (("rms", 2), ("largest", 0)):
            cells = []
            for name in every:
                values = [100 * abs(each.errors[name]) for each in good if name in each.errors]
                scale = 10.0 if name == "delay" else 1.0  # from s to ms
                size = 0.0
                if values:
                    size = sqrt(sum(value**2 for value in values) / len(values)) if power else max(values)
                cells.append(f"{scale * size:.2g}")
            lines.append(f"| {label} | {' | '.join(cells)} |")
    slowest = max(outcomes, key=lambda each: each.seconds)
    lines += ["", f"Slowest: {slowest.name}, {slowest.seconds:.1f} s; all: {sum(e.seconds for e in outcomes):.0f} s."]
    return lines


def _is(each: Outcome, kind: str) -> bool:
    if kind in ("all", "good"):
        return kind == "all" or not each.flaws
    return len(each.flaws) > 1 if kind == "pairs" else each.flaws == (kind,)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", default="", help="names that hold this; 'single', 'pairs': logs of one or two flaws")
    parser.add_argument("--count", type=int, help="most logs per kind (default: all)")
    parser.add_argument("--total", type=int, default=320, help="logs in all (default: 320)")
    parser.add_argument("--keep", type=Path, help="folder that the logs' files are left in")
    parser.add_argument("--out", type=Path, default=Path("build/identification"), help="folder of tables")
    options = parser.parse_args()
    chosen: dict[tuple[str, ...], list[tuple[str, tuple[str, ...]]]] = {}
    for name, flaws in names(options.total):
        size = {"single": 1, "pairs": 2}.get(options.only)
        if len(flaws) == size if size else options.only in name:
            chosen.setdefault(flaws, []).append((name, flaws))
    outcomes = []
    options.out.mkdir(parents=True, exist_ok=True)
    with (
        tempfile.TemporaryDirectory() as work,
        (options.out / "study.jsonl").open("w", encoding="utf-8") as lines,
    ):
        # One of each kind after the other: a study that is stopped has seen them all.
        for turn in zip_longest(*(kind[: options.count] for kind in chosen.values())):
            for name, flaws in filter(None, turn):
                log = made(name, flaws, options.keep or Path(work))
                outcomes.append(judged(log))
                print(told(outcomes[-1]), flush=True)
                print(json.dumps(asdict(outcomes[-1])), file=lines, flush=True)
                if options.keep is None:
                    for file in log.files:
                        file.unlink()
    if not outcomes:
        parser.error(f"no log's name holds {options.only!r}")
    table = summary(outcomes)
    print("", *table, sep="\n")
    (options.out / "table.md").write_text("\n".join(table) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
