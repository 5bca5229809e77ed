"""The units under a fuzzer: bytes become FMI calls (target.c), with AddressSanitizer and UndefinedBehaviorSanitizer.

    python tests/fuzz/units.py [--seconds N] [--seed S] [--unit UNIT ...]
    python tests/fuzz/units.py --unit UNIT FILE ...      these inputs once: to look at a finding

The inputs of corpus/UNIT.zip, which reach what has been reached, and the findings of the past in corpus/UNIT are run
first, then changed ones, for N seconds of all units together. Where there is a clang
with libFuzzer it drives, else driver.c does. The exit code is 1 where something was found; the input is kept then.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import re
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from feedsim_packager import toolchain
from feedsim_packager.errors import CompilerError

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).resolve().parent
UNITS = ("plant", "controller", "friction", "friction_gms", "setpoint", "machine")
CORPUS = HERE / "corpus"
ALIKE = {"friction_gms": "friction"}  # unit -> another with the same calls, whose inputs it begins with

FLAGS = ("-std=c99", "-ffp-contract=off", "-D_DEFAULT_SOURCE", "-O1", "-g", "-fno-omit-frame-pointer")
STRICT = ("-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Werror")
SANITIZERS = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all")
GUIDED = ("-fsanitize-coverage=trace-pc",)
FOUND = ("crash-*", "leak-*", "timeout-*", "oom-*", "running")  # what drivers leave of an input


@dataclass(frozen=True)
class Engine:
    """How a program is compiled. `probe`: C that links and runs with it; `driver`: whether driver.c is needed."""

    compiler: tuple[str, ...]
    flags: tuple[str, ...]
    guided: tuple[str, ...]  # for the unit's sources alone
    driver: bool
    probe: str


@dataclass(frozen=True)
class Outcome:
    """`calls` of FMI functions made; `finding`: the input that ended the program, `report`: what it said."""

    calls: int
    instances: int
    finding: Path | None
    report: str


def engine(scratch: Path) -> Engine:
    """The best that runs here: libFuzzer, gcc's coverage, sanitisers alone, nothing. `scratch`: for trials."""
    compiler = toolchain.find_compiler()
    target = "int LLVMFuzzerTestOneInput(const unsigned char *data, unsigned long size) { return data == 0 && size; }"
    main = "int main(void) { return 0; }"
    for choice in (
        Engine(("clang",), (*SANITIZERS, "-fsanitize=fuzzer"), (), False, target),
        Engine(compiler, SANITIZERS, GUIDED, True, f"void __sanitizer_cov_trace_pc(void); {main}"),
        Engine(compiler, SANITIZERS, (), True, main),
    ):
        (scratch / "probe.c").write_text(f"{choice.probe}\n")
        try:
            toolchain.run([*choice.compiler, *choice.flags, "probe.c", "-o", "probe"], scratch)
            toolchain.run([*choice.compiler, *choice.flags, *choice.guided, "-c", "probe.c"], scratch)
            toolchain.run([str(scratch / "probe"), "-runs=1"], scratch)
        except CompilerError:
            continue
        return choice
    return Engine(compiler, (), (), True, main)


def build(unit: str, fmus: Path, out: Path) -> Path:
    """Compile the target with the sources in the archive of `unit`; returns the program, which lies in `out`."""
    shutil.rmtree(out / "sources", ignore_errors=True)
    out.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(fmus / f"{unit}.fmu") as archive:
        archive.extractall(out, [name for name in archive.namelist() if name.startswith("sources/")])
    best = engine(out)
    flags = [*FLAGS, f"-I{out / 'sources'}", f"-I{ROOT / 'src/fmi2/standard'}"]
    resources = f'-DRESOURCES="{HERE / "resources" / unit}"'
    objects = []
    for source, own in [(HERE / "target.c", best.flags), *([(HERE / "driver.c", ())] if best.driver else [])]:
        objects.append(str(out / f"{source.stem}.o"))
        toolchain.run([*best.compiler, *flags, *STRICT, *own, resources, "-c", str(source), "-o", objects[-1]], out)
    sources = sorted(map(str, (out / "sources").glob("*.c")))
    program = out / f"fuzz_{unit}"
    command = [*best.compiler, *flags, *best.flags, *best.guided, *sources, *objects]
    toolchain.run([*command, "-lm", "-o", str(program)], out)
    return program


def kept_inputs(unit: str, out: Path) -> list[Path]:
    """Folders of inputs to begin with; the first one, empty, is for those that are found."""
    found, reached = out / "found", out / "reached"
    found.mkdir(exist_ok=True)
    with zipfile.ZipFile(CORPUS / f"{ALIKE.get(unit, unit)}.zip") as archive:
        archive.extractall(reached)
    return [found, reached, CORPUS / ALIKE.get(unit, unit)]


def fuzz(program: Path, inputs: Sequence[Path], seconds: float, seed: int) -> Outcome:
    """Run `inputs` (folders; files are run once, and nothing else) and what becomes of them by changes.

    Inputs that reach new code are written to the first folder.
    """
    for pattern in FOUND:
        for old in program.parent.glob(pattern):
            old.unlink()
    options = [f"-seed={seed}", f"-max_total_time={max(1, round(seconds))}", "-timeout=60", "-max_len=2048"]
    command = [str(program), *options, f"-artifact_prefix={program.parent}/", *map(str, inputs)]
    settings = {"ASAN_OPTIONS": "allocator_may_return_null=1", "UBSAN_OPTIONS": "print_stacktrace=1"}
    environment = os.environ | settings | {"TMPDIR": str(program.parent)}
    done = subprocess.run(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace", env=environment
    )
    told = re.search(r"^calls (\d+) instances (\d+)$", done.stdout, re.MULTILINE)
    calls, instances = map(int, told.groups()) if told else (0, 0)
    if done.returncode == 0:
        return Outcome(calls, instances, None, "")
    left = [each for pattern in FOUND for each in program.parent.glob(pattern)]
    finding = _kept(left[0], program.parent / "findings") if left else program
    return Outcome(calls, instances, finding, done.stdout[-12000:])


def _kept(left: Path, folder: Path) -> Path:
    """What the driver has left, under the name of its content."""
    content = left.read_bytes()
    if left.name == "running":  # driver.c maps the file: the size, then room for the longest input
        size = int.from_bytes(content[:8], sys.byteorder)
        content = content[8 : 8 + size]
    folder.mkdir(exist_ok=True)
    finding = folder / hashlib.sha256(content).hexdigest()[:16]
    finding.write_bytes(content)
    return finding


def main(words: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(description="Fuzz the units: bytes become FMI calls.")
    parser.add_argument("--unit", nargs=1, action="extend", choices=UNITS, help="this unit alone; default all")
    parser.add_argument("--seconds", type=float, default=60.0, help="for all units together (default 60)")
    parser.add_argument("--seed", type=int, default=1, help="of the changes (default 1)")
    parser.add_argument("--fmus", type=Path, default=ROOT / "fmus", help="folder of the archives (default fmus)")
    parser.add_argument("--build", type=Path, default=ROOT / "build/fuzz", help="folder for programs and inputs")
    parser.add_argument("inputs", nargs="*", type=Path, metavar="FILE", help="run these inputs once")
    options = parser.parse_args(words)
    units = options.unit or UNITS
    if options.inputs and len(units) > 1:
        parser.error("files belong to one unit: say --unit")
    cores = min(2, os.cpu_count() or 1, len(units))

    def run(unit: str) -> Outcome:
        out = (options.build / unit).resolve()
        program = build(unit, options.fmus, out)
        inputs = [each.resolve() for each in options.inputs] or kept_inputs(unit, out)
        return fuzz(program, inputs, options.seconds * cores / len(units), options.seed)

    with ThreadPoolExecutor(cores) as pool:
        outcomes = dict(zip(units, pool.map(run, units), strict=True))
    for unit, outcome in outcomes.items():
        if outcome.finding is None:
            print(
                f"{unit}: {outcome.calls:,} calls, {outcome.instances:,} instances, seed {options.seed}: nothing found"
            )
        else:
            print(outcome.report)
            print(f"{unit}: FOUND: {outcome.finding}")
            print(f"  again: python tests/fuzz/units.py --unit {unit} {outcome.finding}")
            print(f"  when it is mended, keep it: cp {outcome.finding} {CORPUS / unit}")
    print(total(outcomes.values()))
    return int(any(outcome.finding for outcome in outcomes.values()))


def total(outcomes: Iterable[Outcome]) -> str:
    """The last line: what all units were called together."""
    told = list(outcomes)
    calls, instances = sum(each.calls for each in told), sum(each.instances for each in told)
    return f"all {len(told)} units: {calls:,} calls, {instances:,} instances"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
