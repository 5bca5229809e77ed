"""Commands that are asked to end at random instants, on one core: each ends by the signal, and leaves nothing behind.

python tests/cli/ends.py [--count 1000] [--seed 7] [--commands run,sweep]
"""

from __future__ import annotations

import argparse
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from command_helpers import PATIENCE
from feedsim.files.trace import write_csv
from feedsim.simulation.cosim.friction_law import FrictionLaw
from identification_helpers import I_P, log_of, strokes
from ssp_helpers import short_scenario

ROOT = Path(__file__).resolve().parents[2]

MACHINE = ROOT / "scenarios" / "machines" / "test_centre"
STUDY = """name: Friction
scenario: short.yaml
sampling: {method: sobol, runs: 16, seed: 7}
parameters:
  F_C: {key: machine.axes.Z.friction.F_C, distribution: uniform, from: 1.2 N.m, to: 2 N.m}
"""
# Words of a command, what an ended one may keep, and how often it is tried.
COMMANDS: dict[str, tuple[list[str], set[str], int]] = {
    "run": (["run", "short.yaml"], {"result.partial.csv"}, 5),
    "identify": (["identify", "log.csv", "--axes", "Z", "--machine", str(MACHINE), "--stages", "1"], set(), 3),
    "sweep": (["sweep", "study.yaml", "--workers", "2"], {"runs.jsonl", "study.json", "table.csv"}, 1),
    "tune drive": (
        ["tune", "drive", str(ROOT / "scenarios" / "one_axis.yaml"), "--axes", "X", "--evaluations", "10"], set(), 1,
    ),
    "tune compensation": (
        ["tune", "compensation", str(ROOT / "scenarios" / "xz_circle.yaml"), "--kind", "pulse"], set(), 1,
    ),
}  # fmt: skip
CAP = 30.0  # s of a command within which it is ended


class Place:
    """A folder where commands are started, ended, and looked after."""

    def __init__(self, folder: Path, fmus: Path, seed: int) -> None:
        self.folder, self.fmus, self.random = folder, fmus, random.Random(seed)
        self.lasted: dict[str, float] = {}
        self.codes: Counter[int] = Counter()
        short_scenario(folder)
        (folder / "study.yaml").write_text(STUDY)
        (folder / "temporary").mkdir()
        with FrictionLaw(fmus) as law:
            feeds = [feed / 60e3 / I_P for feed in (20, 100, 400, 2000, 8000, 20000)]
            write_csv(folder / "log.csv", log_of(law, "Z", strokes(feeds), 5e-4, noise=1e-3))

    def started(self, command: str) -> subprocess.Popen[str]:
        """A process that runs the first line of its program: what comes before it is the interpreter's to end."""
        program = "import os; os.write(1, b'!'); from feedsim.cli import entry; entry()"
        words = [sys.executable, "-c", program, *COMMANDS[command][0]]
        if hasattr(os, "sched_getaffinity") and shutil.which("taskset"):
            words[:0] = ["taskset", "-c", str(self.random.choice([*os.sched_getaffinity(0)]))]
        process = subprocess.Popen(
            [*words, "--out", "out"], cwd=self.folder, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
            start_new_session=True,
            env={**os.environ, "FEEDSIM_FMUS": str(self.fmus), "PYTHONPATH": str(ROOT / "master"),
                 "TMPDIR": str(self.folder / "temporary")},
        )  # fmt: skip
        assert process.stdout is not None
        process.stdout.read(1)
        return process

    def trial(self, command: str, number: int = signal.SIGTERM) -> None:
        """Start it, and end it at a random instant. AssertionError: it does not end so, or leaves something."""
        if command not in self.lasted:
            begun, process = time.monotonic(), self.started(command)
            try:
                _, said = process.communicate(timeout=CAP)
                self.check(command, process.returncode, said, [])
            except subprocess.TimeoutExpired:
                process.send_signal(number)
                _, said = process.communicate(timeout=PATIENCE)
                self.check(command, process.returncode - number - 128, said, [])
            self.lasted[command] = time.monotonic() - begun
        while True:
            process = self.started(command)
            instant = self.random.uniform(0.0, self.lasted[command])
            time.sleep(instant)
            process.send_signal(number)
            _, said = process.communicate(timeout=PATIENCE)
            if process.returncode != 0:
                break
            self.lasted[command] *= 0.95  # it has been quicker than the signal
            shutil.rmtree(self.folder / "out")
        until = time.monotonic() + PATIENCE
        while (running := in_session(process.pid)) and time.monotonic() < until:
            time.sleep(0.05)
        self.codes[process.returncode] += 1
        code = process.returncode
        if code == -number:  # the interpreter itself, before it has read this program or after that has ended
            code, said = number + 128, ""
        try:
            self.check(command, code - number - 128, said, running)
        except AssertionError as error:
            raise AssertionError(f"{command}, after {instant:.3f} s of {self.lasted[command]:.3f} s: {error}") from None

    def check(self, command: str, code: int, said: str, running: list[str]) -> None:
        assert code == 0, f"exit code {code}: {said}"
        assert not running, f"still runs: {running}"
        assert "Traceback" not in said, said
        assert "ignored" not in said, said
        temporary = [*(self.folder / "temporary").iterdir()]
        assert not temporary, f"temporary files: {temporary}"
        out = self.folder / "out"
        if out.exists():
            there = {path.relative_to(out).as_posix() for path in out.rglob("*") if path.is_file()}
            whole = set(json.loads((out / "summary.json").read_text())["files"]) if "summary.json" in there else set()
            assert there, "an empty folder of results"
            assert whole <= there, f"files that are missing: {whole - there}"
            assert there - whole <= COMMANDS[command][1], f"files that are no result: {there - whole}"
            shutil.rmtree(out)


def in_session(session: int) -> list[str]:
    """Processes of a session that run."""
    result = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, _, found = stat.read_text().rpartition(")")[2].split()[:4]
            if int(found) == session and state != "Z":
                result.append(stat.with_name("cmdline").read_text().replace("\0", " "))
        except OSError:
            pass
    return result


def main() -> int:
    parser = argparse.ArgumentParser(description="End commands at random instants.")
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--commands", default=",".join(COMMANDS))
    options = parser.parse_args()
    names = options.commands.split(",")
    failed: list[str] = []
    done: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        place = Place(Path(folder), Path(os.environ.get("FEEDSIM_FMUS", ROOT / "fmus")), options.seed)
        for k in range(options.count):
            (command,) = place.random.choices(names, [COMMANDS[name][2] for name in names])
            try:
                place.trial(command)
            except AssertionError as error:
                failed.append(str(error))
                print(error, flush=True)
                for path in (place.folder / "temporary", place.folder / "out"):
                    shutil.rmtree(path, ignore_errors=True)
                (place.folder / "temporary").mkdir()
            done[command] += 1
            if not (k + 1) % 20 or k + 1 == options.count:
                print(f"{k + 1}: {dict(done)}, exit codes {dict(place.codes)}, {len(failed)} failed", flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
