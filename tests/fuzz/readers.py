"""Fuzzer of everything that reads files: each case in a process of its own, forked from one that is warm.

    python tests/fuzz/readers.py --seconds 600 --seed 1 [--only mat,uff] [--keep build/fuzz]

Files of every kind are made, and changed at random: bits, bytes, chunks lost, doubled or taken from another file,
numbers that are huge or none; entries of archives likewise, and of archives inside archives. Allowed is a result, or
feedsim's own error. A finding is any other exception, a crash, more than 5 s of computing or a minute altogether, or
more than 1 GB. Findings are kept, told, and make the exit code 1; those of the past are in corpus/readers, named by
what reads them, and are tried by the test suite.
"""

from __future__ import annotations

import argparse
import faulthandler
import hashlib
import io
import json
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
import zipfile
import zlib
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from feedsim import cosim, scenario, ssp, trace
from feedsim.analysis import check as check_evaluation
from feedsim.cosim.archive import Archive, folders
from feedsim.cosim.roles import foreign
from feedsim.errors import FeedsimError
from feedsim.files.columns import load_columns
from feedsim.files.tolerances import load_tolerances
from feedsim.scenario.load import load_machine, read_friction
from feedsim.scenario.roles import DRIVE
from feedsim.scenario.structure.load import load_structure
from feedsim.scenario.study import load_study
from feedsim.structure.matrices import calculix, market
from feedsim.structure.modes import read_modes
from feedsim.structure.poses_file import read_cell, read_grid
from feedsim.sweep.table import read_table
from feedsim.trace.response_files import read_response
from feedsim.trace.series import read_series

ROOT = Path(__file__).resolve().parents[2]
CORPUS = Path(__file__).resolve().parent / "corpus" / "readers"
COMPUTING, WAITING, MEMORY = 5, 60, 1 << 30  # s of a processor, s altogether, bytes
LONGEST = 300_000  # bytes that text is allowed to grow to
MACHINE = ROOT / "scenarios" / "machines" / "test_centre"
NUMBERS = ("1e308", "1e999", "-1", "0", "nan", "inf", "99999999999999999999", "1e-320", "0x7f", "1_0", "2147483648",
           "9" * 400, "1e-99999999", "٣", "--1", "")  # fmt: skip
WORDS = ("\0", "\ufeff", "\t", "*", "&a ", "!!float ", "[[[[[[[[", "{", "}", "<<: ", "'", '"', ",,,,", ";", "\r", "../",
         "/dev/zero", "\x85", "\u2028", "é", "<!DOCTYPE x>", "]]>", "&lt;", "- ", ": ", "null", "true", "#",
         "x" * 300)  # fmt: skip


@dataclass(frozen=True)
class Kind:
    """How files of a kind are called and read; `whole`: files of it that can be read."""

    suffix: str
    read: Callable[[Path], object]
    whole: Sequence[bytes]


def _all(recording: trace.Recording) -> None:
    with suppress(FeedsimError):
        recording.read(recording.names)
    for name in recording.names[:3]:
        recording.read([name])


def _open_archive(path: Path) -> None:
    with Archive(path) as archive:
        unit = scenario.ForeignUnit.model_construct(
            fmu=path, inputs=_Names({"x_s": "PosSetpoint", "x_a": "PosActual"}), outputs=_Names({"M_a": "Torque"}),
            parameters={"Kv": "40 1/s", "Tn": 30},
        )  # fmt: skip
        _ = archive.unit_definitions, archive.platforms, archive.version
        for name in archive.variables:
            archive.unit_of(name)
        with suppress(FeedsimError):
            archive.library()
        if "x_s" not in archive.variables and "tool.F_X" not in archive.variables:  # not one of ours
            foreign(DRIVE, "Z", unit, archive)


class _Names:
    """What a mapping says, whatever the model."""

    def __init__(self, names: Mapping[str, str]) -> None:
        self._names = names

    def model_dump(self, **_: object) -> Mapping[str, str]:
        return self._names


def _judge(path: Path) -> None:
    with ssp.opened(path) as found:
        check_evaluation(found.scenario, found.program)
        cosim.check(found.scenario, found.program, fmus=found.fmus)


def _poses(path: Path) -> None:
    read_grid(path, ("X", "spindle_2", "W"))
    read_cell(path, ("X", "spindle_2", "W"), {"X": 0.8, "spindle_2": 0.3, "W": 0.1})


def kinds(folder: Path, fmus: Path) -> dict[str, Kind]:
    """Every kind of file that feedsim reads, with files that can be read; made in `folder`."""
    from fmu.pose_file import Grid

    rows = "\n".join(f"{0.001 * i:.3f},{np.sin(0.1 * i):.6g},{i % 7}" for i in range(60))
    commas = "\n".join(f"{i};{0.5 * i:.3f};{np.cos(i):.5f}".replace(".", ",") for i in range(40))
    traces = [
        f"time [s],Z.x_a [mm],Z.M_a [N.m]\n{rows}\n".encode(),
        f"t (ms);x (mm);i_q (A)\n{commas}\n".encode("utf-16"),
    ]
    response = "\n".join(f"{1.5**i:.4g},{1 / (1 + i):.5g},{-10 * i},0.99" for i in range(20))
    responses = [f"frequency [Hz],Z magnitude [m/N],Z phase [deg],Z coherence [1]\n{response}\n".encode()]
    machines = ROOT / "scenarios" / "machines"
    structure = (machines / "one_axis" / "structure.yaml").read_bytes()
    emps = (machines / "emps" / "machine.yaml").read_text(encoding="utf-8")
    machine = re.sub(r"(?m)^modes: .*$", f"modes: {machines / 'emps' / 'modes.csv'}", emps).encode()
    columns = (machines / "emps" / "columns.yaml").read_bytes()
    friction = (b"F_C: 1.8 N.m\nF_S: 2.3 N.m\nv_s: 2 rad/s\nsigma_0: 300 N.m/rad\nsigma_1: 0.3 N.m.s/rad\n"
                b"sigma_2: 0.01 N.m.s/rad\nW: 0 rad\n")  # fmt: skip
    tolerances = (b'name: Z move\nvalue: 1e-6\ntime: 125 us\nvariables:\n  "*.x_a": 2 nm\n  "*.M_a": {value: 1e-3 N.m, '
                  b'time: 1 ms}\n  "*.limited": {hold: true, time: &a 1 ms}\n  "Y.*": ignore\n')  # fmt: skip
    z = (ROOT / "scenarios" / "z_positioning.yaml").read_text(encoding="utf-8")
    plan = re.sub(r"(?m)^machine: .*$", f"machine: {MACHINE}", z).encode()
    (folder / "plan.yaml").write_bytes(plan + b"\nset: {machine.structure: null}\n")
    study = (
        f"name: s\nscenario: {folder / 'plan.yaml'}\nsampling: {{method: latin_hypercube, runs: 5, seed: 1}}\n"
        "parameters:\n  jerk: {key: machine.path.jerk, from: 50 m/s^3, to: 400 m/s^3}\n"
        "  W: {key: machine.axes.*.friction.W, values: [0 rad, 1 rad]}\nfigures: [Z.overshoot]\n"
    ).encode()
    table = "run,seed,Z.F_C [N.m],status,seconds\n" + "\n".join(f"{i},1,{0.1 * i},ok,0.5" for i in range(9))
    matrix = "%%MatrixMarket matrix coordinate real symmetric\n4 4 5\n1 1 2.0\n2 1 -1\n2 2 2\n3 3 1\n4 4 1e3\n"
    dense = "%%MatrixMarket matrix array real general\n2 2\n1\n0\n0\n1\n"
    nodes = "*NODE, NSET=all\n1, 0, 0, 0\n2, 1, 0, 0\n3, 0, 1, 0\n4, 0, 0, 1\n"
    mesh = f"{nodes}*ELEMENT, TYPE=C3D4, ELSET=bed\n1, 1, 2, 3, 4\n"
    return {
        "csv": Kind(".csv", lambda path: _all(trace.read_recording(path)), traces),
        "trace": Kind(".csv", trace.read_csv, traces[:1]),
        "series": Kind(".csv", read_series, traces),
        "setpoints": Kind(".csv", lambda path: trace.read_setpoints(path, {"Z": ("Z.x_a", None)}), traces[:1]),
        "response": Kind(".csv", read_response, responses),
        "mat": Kind(".mat", lambda path: _all(trace.read_recording(path)), _mat()),
        "capture": Kind(".json", lambda path: _all(trace.read_recording(path)), [_capture()]),
        "uff": Kind(".uff", read_response, _uff(folder)),
        "scenario": Kind(".yaml", scenario.load, [plan]),
        "machine": Kind(".yaml", load_machine, [machine]),
        "structure": Kind(".yaml", load_structure, [structure]),
        "study": Kind(".yaml", load_study, [study]),
        "friction": Kind(".yaml", read_friction, [friction]),
        "columns": Kind(".yaml", load_columns, [columns]),
        "tolerances": Kind(".yaml", load_tolerances, [tolerances]),
        "modes": Kind(".csv", lambda path: read_modes(path, ("X", "Y", "Z")), [(MACHINE / "modes.csv").read_bytes()]),
        "poses": Kind(".bin", _poses, [Grid().content()]),
        "matrix": Kind(".mtx", lambda path: market.read_matrix(path, "mass"), [matrix.encode(), dense.encode()]),
        "mesh": Kind(".inp", lambda path: list(calculix._cards(path)), [mesh.encode()]),
        "table": Kind(".csv", read_table, [table.encode()]),
        "fmu": Kind(".fmu", _open_archive, _fmus(fmus)),
        "ssp": Kind(".ssp", _judge, [_ssp(folder, fmus)]),
    }


def _mat() -> list[bytes]:
    from scipy.io import savemat

    content = {"t": np.arange(20) / 500, "n": np.arange(20, dtype=np.int16), "k": 2.5, "q": np.eye(3)}
    more = {
        "s": {"a": np.ones(4), "b": {"c": 1.0}},
        "text": "x",
        "c": np.array([1, "y"], dtype=object),
        "z": np.ones(3) * 1j,
    }
    found = []
    for form, compressed in (("4", False), ("5", False), ("5", True)):
        buffer = io.BytesIO()
        savemat(buffer, content if form == "4" else content | more, format=form, do_compression=compressed)
        found.append(buffer.getvalue())
    return found


def _capture() -> bytes:
    signals = ("CYCLE", "DES_POS|2", "ENC_POS|2", "TORQUE|2", "POWER|2", "CMD_SPEED|2")
    listed = [{"Name": name, "Type": "DOUBLE", "Axis": "Y1", "Address": name} for name in signals]
    rows = [[100 + i, *(float(np.sin(0.2 * i + k)) for k in range(5))] for i in range(30)]
    event = {"HFBlockEvent": {"GCode": "G1 Y10", "HFProbeCounter": 110}}
    return json.dumps(
        {"Header": {"CycleTimeMs": 2, "SignalListHFData": listed}, "Payload": [{"HFData": rows}, event]}
    ).encode()


def _uff(folder: Path) -> list[bytes]:
    import pyuff

    found = []
    for binary in (0, 1):
        file = folder / f"seed{binary}.uff"
        x = np.arange(1.0, 9.0)
        pyuff.UFF(str(file)).write_sets(
            [{
                "type": 58, "func_type": 4, "rsp_node": 12, "rsp_dir": 3, "ref_node": 7, "ref_dir": -1,
                "data": (1 + 1j) / x, "x": x, "binary": binary, "id1": "NONE",
                "rsp_ent_name": "NONE", "ref_ent_name": "NONE",
                "abscissa_spacing": binary, "abscissa_min": 1.0, "abscissa_inc": 1.0, "abscissa_spec_data_type": 18,
                "ordinate_spec_data_type": 8, "ordinate_axis_units_lab": "m", "orddenom_spec_data_type": 13,
                "orddenom_axis_units_lab": "N",
            }], mode="add",
        )  # fmt: skip
        found.append(file.read_bytes())
    return found


def _fmus(fmus: Path) -> list[bytes]:
    """A drive of another maker without a program in it, and shipped archives without theirs."""
    from foreign import acme

    with tempfile.TemporaryDirectory() as folder:
        path = acme.archive(Path(folder) / "acme.fmu", "drive", b"none", acme.DRIVE)
        found = [path.read_bytes()]
    return [*found, *(_without_programs((fmus / f"{name}.fmu").read_bytes()) for name in ("controller", "plant"))]


def _without_programs(content: bytes) -> bytes:
    kept = {
        name: data for name, data in entries(content).items() if name.startswith(("modelDescription", "resources/"))
    }
    return packed({**kept, **{name: b"" for name in entries(content) if name.startswith(f"binaries/{folders()[0]}/")}})


def _ssp(folder: Path, fmus: Path) -> bytes:
    from ssp_helpers import export_short

    (folder / "ssp").mkdir()
    content = entries(export_short(folder / "ssp", fmus).read_bytes())
    return packed({name: _without_programs(data) if name.endswith(".fmu") else data for name, data in content.items()})


# --- changes --------------------------------------------------------------------------------------------------------


def entries(content: bytes) -> dict[str, bytes]:
    with zipfile.ZipFile(io.BytesIO(content)) as package:
        return {name: package.read(name) for name in package.namelist()}


def packed(content: Mapping[str, bytes]) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as package:
        for name, data in content.items():
            package.writestr(zipfile.ZipInfo(name), data)
    return buffer.getvalue()


def changed(chance: random.Random, content: bytes, others: Sequence[bytes]) -> bytes:
    """A file with one to some changes; of archives mostly inside an entry."""
    if content[:2] == b"PK" and chance.random() < 0.9:
        with suppress(zipfile.BadZipFile, ValueError, NotImplementedError, OSError, zlib.error, EOFError):
            inside = entries(content)
            name = chance.choice([name for name in inside if not name.startswith("binaries/")])
            inside[name] = changed(chance, inside[name], [*inside.values()])
            if chance.random() < 0.05:
                inside[chance.choice(["resources/", "../"]) + name] = inside.pop(name)
            return packed(inside)
    for _ in range(chance.choice((1, 1, 1, 2, 3, 8))):
        content = chance.choice(CHANGES)(chance, content, others)[:LONGEST]
    return content


def _place(chance: random.Random, content: bytes) -> int:
    """Heads matter more than what follows."""
    return chance.randrange(min(len(content), chance.choice((64, 300, 10**9))) + 1)


def _flip(chance: random.Random, content: bytes, _: Sequence[bytes]) -> bytes:
    found = bytearray(content or b"\0")
    for _ in range(chance.choice((1, 2, 8))):
        found[_place(chance, found[:-1])] ^= 1 << chance.randrange(8)
    return bytes(found)


def _overwrite(chance: random.Random, content: bytes, _: Sequence[bytes]) -> bytes:
    at = _place(chance, content)
    size = chance.choice((1, 2, 4, 8))
    value = chance.choice((0, 1, 127, 128, 255, 256, 2**15, 2**31 - 1, 2**31, 2**32 - 1, 2**63, 2**64 - 1)) % 256**size
    return content[:at] + value.to_bytes(size, chance.choice(("little", "big"))) + content[at + size :]


def _cut(chance: random.Random, content: bytes, _: Sequence[bytes]) -> bytes:
    return content[: _place(chance, content)]


def _lose(chance: random.Random, content: bytes, _: Sequence[bytes]) -> bytes:
    at = _place(chance, content)
    return content[:at] + content[at + chance.choice((1, 4, 40, 400)) :]


def _double(chance: random.Random, content: bytes, _: Sequence[bytes]) -> bytes:
    at, size = _place(chance, content), chance.choice((1, 8, 80, 800))
    return content[:at] + content[at : at + size] * chance.choice((2, 3, 100)) + content[at + size :]


def _splice(chance: random.Random, content: bytes, others: Sequence[bytes]) -> bytes:
    other = chance.choice(others)
    return content[: _place(chance, content)] + other[_place(chance, other) :]


def _number(chance: random.Random, content: bytes, _: Sequence[bytes]) -> bytes:
    found = list(re.finditer(rb"-?[0-9]+(?:\.[0-9]+)?(?:[eE][-+]?[0-9]+)?", content[:20_000]))
    if not found:
        return _overwrite(chance, content, ())
    match = chance.choice(found)
    return content[: match.start()] + chance.choice(NUMBERS).encode() + content[match.end() :]


def _word(chance: random.Random, content: bytes, _: Sequence[bytes]) -> bytes:
    at = _place(chance, content)
    return content[:at] + chance.choice(WORDS).encode() + content[at:]


def _value(chance: random.Random, content: bytes, _: Sequence[bytes]) -> bytes:
    """What stands behind a colon, in quotes or between commas, in the place of another such text."""
    found = list(re.finditer(rb'(?<=: )[^\n,}]+|(?<=")[^"\n]*(?=")|(?<=,)[^,\n]*', content[:20_000]))
    if len(found) < 2:
        return _word(chance, content, ())
    match, other = chance.choice(found), chance.choice(found)
    return content[: match.start()] + other[0] + content[match.end() :]


CHANGES = (_flip, _overwrite, _cut, _lose, _double, _splice, _number, _number, _word, _value, _value)


# --- cases ----------------------------------------------------------------------------------------------------------


def outcome(read: Callable[[Path], object], path: Path) -> str:
    """How a reader ends on a file, in a process of its own: "read", "refused", or what is wrong with its end."""
    ours, theirs = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(ours)
        _try(read, path, theirs)
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
        return f"more than {COMPUTING} s of computing" if number == signal.SIGXCPU else f"crash by signal {number}"
    return said or f"exit code {os.WEXITSTATUS(status)} without a word"


def _try(read: Callable[[Path], object], path: Path, pipe: int) -> None:
    said = "read"
    try:
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_CPU, (COMPUTING, COMPUTING + 1))
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
        chosen = {each: known[each] for each in options.only.split(",") if each} or known
        old = {kept: end for kept, end in replayed(known, folder).items() if end not in ("read", "refused")}
        counts, found = fuzz(chosen, folder, options.seconds, options.seed, options.keep)
    for kept, end in old.items():
        print(f"{CORPUS / kept}: {end}")
    for each, count in sorted(counts.items()):
        print(f"{count:8d} {each}")
    print(f"{sum(counts.values())} cases, {len(found) + len(old)} findings")
    return 1 if found or old else 0


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT / "tests"))
    sys.exit(main())
