"""Whether the intervals of identified drives hold: logs of machines whose parameters are known, by kind of log.

Every draw takes a rigid or elastic axis with drive, friction and load within a factor of 1.5 about the measured axis X
(Y where a weight loads it) of scenarios/machines/sinumerik_840d, simulates moves that it draws, too, and identifies the
drive from the log alone. A parameter that is called estimated must have its true value in the 95 % interval.

    make drive-study                      all kinds of logs
    python benchmarks/drive_study.py --draws 3 --kinds clean,elastic

Draws take turns over the kinds, a process for each core at low priority. Leaves drives.jsonl, a line for each draw, and
table.md in build/drives. What is in drives.jsonl already is not drawn again: a study that was stopped goes on.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, field, replace
from itertools import combinations
from math import isclose
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command does, ahead of numpy

import numpy as np

from feedsim.estimation.identify.result import Estimate
from feedsim.estimation.least_squares import NORMAL_95
from feedsim.estimation.replay.closed_loop import cut_window, read_axes
from feedsim.estimation.replay.identified import identify_drives
from feedsim.estimation.replay.machine_files import ElasticMode, with_modes
from feedsim.estimation.replay.tuning import decision
from feedsim.files.columns import load_columns
from feedsim.files.trace import write_csv
from feedsim.foundation.errors import FeedsimError
from feedsim.scenario import Machine, load, load_machine
from feedsim.simulation.cosim import run
from feedsim.structure import checked_modes
from feedsim.structure.modes import table_of_modes, write_modes

MACHINE = Path(__file__).resolve().parents[1] / "scenarios" / "machines" / "sinumerik_840d"
FACTOR = 1.5  # about the measured value, to either side
DRIVE = {"K_p": "N.m.s/rad", "T_n": "s", "T_sym": "s"}
FRICTION = {"F_C": "N.m", "sigma_2": "N.m.s/rad", "F_log": "N.m"}


@dataclass(frozen=True)
class Kind:
    """A kind of log: what is unlike the clean one."""

    name: str
    axis: str = "X"
    modes: tuple[ElasticMode, ...] = ()
    noise: str = "M_a: 2 %, x_a: 0.1 um"
    one_way: bool = False
    torque_limit: float = 0.0  # share of the largest torque at which the record is cut off
    position_cycle: str = "125 us"
    coupled: float = 0.0  # shape of the first mode at the scale of Y, over the rigid motion of X
    repeats: int = 1  # logs of a machine, each of other moves
    signals: str = "x_s, x_a, x_e, n_s, n_ffw, M_a"
    changes: tuple[str, ...] = ()  # of the axis, as --set has them; {name} is drawn, lognormal about its value in drawn
    drawn: tuple[tuple[str, float], ...] = ()
    limit_of_load: float = 0.0  # torque limit of the drive, over its load
    limit_of_peak: float = 0.0  # the same over the largest torque without it
    encoder: float = 0.0  # step of the recorded position [m]
    asked: bool = True  # modes are looked for

    @property
    def axes(self) -> tuple[str, ...]:
        """That are logged and identified."""
        return ("X", "Y") if self.coupled else (self.axis,)


KINDS = (
    Kind("clean"),
    Kind("5 % noise", noise="M_a: 5 %, x_a: 0.3 um"),
    Kind("one way under a weight", axis="Y", one_way=True),
    Kind("weight both ways", axis="Y"),
    Kind("torque cut off", torque_limit=0.8),
    Kind("position only", signals="x_s, x_a, M_a"),
    Kind("position loop of 2 ms", position_cycle="2 ms"),
    Kind("one mode", modes=(ElasticMode(27.0, 0.04, 0.3, 0.2),), noise="M_a: 5 %, x_a: 0.1 um"),
    Kind("two modes", modes=(ElasticMode(24.0, 0.03, 0.2, 0.2), ElasticMode(47.0, 0.02, 0.35, -0.3)),
         noise="M_a: 5 %, x_a: 0.1 um"),
    Kind("coupled axes", modes=(ElasticMode(24.0, 0.03, 0.2, 0.2),), noise="M_a: 2 %, x_a: 0.05 um", coupled=0.1),
    Kind("repeats", repeats=2),
    Kind("current loop", drawn=(("f", 700.0),), changes=(
        "drive.ideal_current_loop=false", "drive.current={{K_p: {K_p} V/A, T_n: 11.1 ms}}", "drive.u_max=2 kV",
        "drive.R=0.45 Ohm", "drive.L_d=5 mH", "drive.L_q=5 mH", "drive.p=5",
    )),
    Kind("reference model", drawn=(("omega_0", 900.0), ("D", 1.2)), changes=(
        "drive.reference_model=true", "drive.omega_0={omega_0} rad/s", "drive.D={D}",
    )),
    Kind("play behind the encoder", changes=("play=10 um", "drive.measuring={{indirect: true}}")),
    Kind("torque over position", changes=("drive.cogging_1={{order: 0.3, amplitude: 0.2 N.m}}",)),
    Kind("torque limit near the peak", limit_of_peak=1.0),
    Kind("torque limit near the weight", axis="Y", limit_of_load=1.0),
    Kind("encoder of some um", encoder=2.2e-6),
    Kind("a mode that nobody asks for", modes=(ElasticMode(60.0, 0.03, 0.3, 0.2),), asked=False),
    Kind("filter of the torque setpoint", drawn=(("f", 250.0),), changes=(
        "drive.filter_1={{type: low_pass, f: {f} Hz, D_den: 0.7}}",
    )),
)  # fmt: skip


@dataclass
class Outcome:
    """Of a draw.

    within: parameter called estimated -> whether its interval has the truth. undetermined: the others. overlaps:
    parameter -> whether its intervals of all repeats overlap. seconds: of one core. refused: why there is no drive.
    """

    kind: str
    seed: int
    draw: int
    within: dict[str, bool] = field(default_factory=dict)
    undetermined: list[str] = field(default_factory=list)
    overlaps: dict[str, bool] = field(default_factory=dict)
    seconds: float = 0.0
    refused: str = ""

    def __str__(self) -> str:
        if self.refused:
            return f"{self.kind:<24} {self.draw:>4} {self.seconds:5.1f}  refused: {self.refused[:90]}"
        shown = [name if inside else f"{name}!" for name, inside in self.within.items()]
        shown += [f"{name} of repeats!" for name, overlap in self.overlaps.items() if not overlap]
        return f"{self.kind:<24} {self.draw:>4} {self.seconds:5.1f}  {' '.join(shown)}; {' '.join(self.undetermined)}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=20, help="of each kind")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kinds", help="names, separated by commas (default: all)")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="processes")
    parser.add_argument("--out", type=Path, default=Path("build/drives"), help="folder of the draws and the table")
    args = parser.parse_args()
    wanted = [kind.name for kind in KINDS] if args.kinds is None else args.kinds.split(",")
    if unknown := [name for name in wanted if name not in {kind.name for kind in KINDS}]:
        parser.error(f"no such kind: {', '.join(unknown)}; there is {', '.join(kind.name for kind in KINDS)}")
    args.out.mkdir(parents=True, exist_ok=True)
    path = args.out / "drives.jsonl"
    done = [Outcome(**json.loads(line)) for line in path.read_text().splitlines()] if path.is_file() else []
    known = {(each.kind, each.seed, each.draw) for each in done}
    # One of each kind after the other: a study that is stopped has seen them all.
    asked = [(name, args.seed, draw) for draw in range(args.draws) for name in wanted]
    with (
        path.open("a", encoding="utf-8") as lines,
        ProcessPoolExecutor(args.jobs, get_context("spawn"), initializer=os.nice, initargs=(19,)) as processes,
    ):
        for future in as_completed([processes.submit(drawn, *each) for each in asked if each not in known]):
            done.append(future.result())
            print(done[-1], flush=True)
            print(json.dumps(asdict(done[-1])), file=lines, flush=True)
    shown = table(done)
    print("", *shown, sep="\n")
    (args.out / "table.md").write_text("\n".join(shown) + "\n", encoding="utf-8")


def drawn(name: str, seed: int, draw: int) -> Outcome:
    """A draw of the kind of that name."""
    number = next(k for k, kind in enumerate(KINDS) if kind.name == name)
    outcome, begun = Outcome(name, seed, draw), time.process_time()
    try:
        one(KINDS[number], np.random.default_rng((seed, number, draw)), draw + 1, outcome)
    except FeedsimError as error:
        outcome.refused = str(error)
    outcome.seconds = time.process_time() - begun
    return outcome


def table(done: Sequence[Outcome]) -> list[str]:
    """Markdown: by kind of log and parameter, how many of the intervals that are stated have the truth."""
    names = list(dict.fromkeys(name for each in done for name in each.within))
    every = (*KINDS, Kind("all"))
    lines = [
        f"| kind of log | draws | refused | {' | '.join(names)} | repeats overlap |",
        "|---" * (len(names) + 4) + "|",
    ]
    for kind in every:
        own = [each for each in done if kind.name in (each.kind, "all")]
        if not own:
            continue
        stated = [[each.within[name] for each in own if name in each.within] for name in names]
        overlap = [inside for each in own for inside in each.overlaps.values()]
        cells = [f"{sum(inside)}/{len(inside)}" if inside else "-" for inside in (*stated, overlap)]
        refused = sum(bool(each.refused) for each in own)
        lines.append(f"| {kind.name} | {len(own)} | {refused or '-'} | {' | '.join(cells)} |")
    return lines


def one(kind: Kind, random: np.random.Generator, seed: int, outcome: Outcome) -> None:
    """Draw a machine, log and identify it as often as its kind says, and judge that."""
    with TemporaryDirectory() as place:
        folder = Path(place)
        own = load_machine(MACHINE)
        write_table(own, kind, spread(random), folder / "modes.csv")
        changes = [f"machine.modes={folder / 'modes.csv'}", *changed(own, kind, random)]
        intervals: dict[str, list[tuple[float, float]]] = {}
        for repeat in range(kind.repeats):
            (folder / "moves.yaml").write_text(scenario(kind, random, seed + 1000 * repeat))
            known = load(folder / "moves.yaml", changes).machine
            for name, each in identified(kind, known, changes, folder, outcome).items():
                intervals.setdefault(name, []).append(each.interval)
    for name, stated in intervals.items():
        if len(stated) > 1:
            outcome.overlaps[name] = all(a[0] <= b[1] and b[0] <= a[1] for a, b in combinations(stated, 2))


def write_table(own: Machine, kind: Kind, factor: float, path: Path) -> None:
    """The rigid modes of the machine, with so many times the inertia of the axis."""
    table = checked_modes(own)
    rigid = table.rigid
    n = table.ports[f"n_{kind.axis}"]
    scale = np.where(n != 0, 1 / np.sqrt(factor), 1.0)
    ports = {port: (column * scale)[rigid] for port, column in table.ports.items()}
    write_modes(path, replace(table, frequency=table.frequency[rigid], damping=table.damping[rigid], ports=ports))


def identified(
    kind: Kind, known: Machine, changes: Sequence[str], folder: Path, outcome: Outcome
) -> dict[str, Estimate]:
    """Log the machine, identify it and judge that; what is estimated of the axis."""
    if kind.modes:
        elastic = with_modes(known, kind.axis, kind.modes)
        if kind.coupled:
            table = checked_modes(elastic)
            shape = kind.coupled * float(np.max(np.abs(table.ports[f"x_{kind.axis}"][table.rigid])))
            first = len(table.frequency) - len(kind.modes)
            ports = {port: np.array(column) for port, column in table.ports.items()}
            ports["x_Y"][first] = ports["tcp_Y"][first] = shape
            elastic = elastic.model_copy(
                update={"modes": table_of_modes(replace(table, ports=ports), elastic.modes.file)}
            )
        (folder / "elastic.csv").write_bytes(elastic.modes.content or b"")
        changes = [f"machine.modes={folder / 'elastic.csv'}", *changes[1:]]
    log = run(load(folder / "moves.yaml", changes)).log
    assert log is not None
    M, x = f"{kind.axis}.M_a", f"{kind.axis}.x_a"
    if limit := limit_of(kind, known, float(np.max(np.abs(log.columns[M])))):
        log = run(load(folder / "moves.yaml", [*changes, f"machine.axes.{kind.axis}.drive.M_max={limit} N.m"])).log
        assert log is not None
    if kind.encoder:
        step = kind.encoder * spread(np.random.default_rng(len(log.time)))
        log = replace(log, columns={**log.columns, x: step * np.round(log.columns[x] / step)})
    if kind.torque_limit:
        most = kind.torque_limit * float(np.max(np.abs(log.columns[M])))
        log = replace(log, columns={**log.columns, M: np.clip(log.columns[M], -most, most)})
    write_csv(folder / "log.csv", log)
    read = {}
    for axis in kind.axes:
        (folder / "columns.yaml").write_text(columns(kind, axis))
        read |= read_axes(folder / "log.csv", [axis], None, load_columns(folder / "columns.yaml"))
    records = {axis: cut_window(axis, read[axis], None) for axis in kind.axes}
    modes = None if kind.modes and kind.asked else 0
    found = identify_drives(read, records, None, [], "made", "made", modes=modes).drives[kind.axis]
    true, estimated = truth(known, kind.axis), {}
    decided = found.other is not None and decision([found.other]) != 0

    def judge(name: str, holds: bool) -> None:
        outcome.within[name] = outcome.within.get(name, True) and bool(holds)

    if decided:
        judge("cycle", isclose(found.machine.cycles.T_pos, known.cycles.T_pos))
    else:
        outcome.undetermined.append("cycle")
    for name, each in found.estimates.items():
        if name in true and each.status == "estimated":
            estimated[name] = each
            judge(name, each.interval[0] <= true[name] <= each.interval[1])
        elif name in true:
            outcome.undetermined.append(name)
    for k, mode in enumerate(kind.modes if kind.asked else (), 1):
        near = [each for each in found.modes if abs(each.frequency / mode.frequency - 1) < 0.15]
        judge(f"mode {k} f", any(abs(each.frequency - mode.frequency) <= NORMAL_95 * each.sigma[0] for each in near))
        judge(f"mode {k} 2 %", any(abs(each.frequency / mode.frequency - 1) <= 0.02 for each in near))
        if kind.coupled and near and near[0].beside:
            (beside,) = near[0].beside
            judge("shape at Y", abs(beside.shape - kind.coupled) <= NORMAL_95 * beside.sigma)
        elif kind.coupled:
            outcome.undetermined.append("shape at Y")
    return estimated


def limit_of(kind: Kind, known: Machine, peak: float) -> float:
    """Torque limit of the drive [N.m], 0.9 to 1.1 of the load or of the peak; 0: none."""
    shares = np.random.default_rng(round(1e6 * peak)).uniform(0.9, 1.1)
    return float(shares * (kind.limit_of_load * known.axes[kind.axis].M_0 + kind.limit_of_peak * peak))


def spread(random: np.random.Generator) -> float:
    """A factor about 1."""
    return float(FACTOR ** random.uniform(-1, 1))


def changed(own: Machine, kind: Kind, random: np.random.Generator) -> list[str]:
    """Changes of the machine to the axis that is drawn."""
    axis = own.axes[kind.axis]
    prefix = f"machine.axes.{kind.axis}"
    base = {"K_p": 6.5, "T_n": 4.9e-3, "T_sym": axis.drive.T_sym}
    found = [f"{prefix}.drive.{name}={base[name] * spread(random):.9g} {unit}" for name, unit in DRIVE.items()]
    friction = {name: max(float(getattr(axis.friction, name)), 1e-3) * spread(random) for name in FRICTION}
    friction["F_S"] = friction["F_C"]
    found += [f"{prefix}.friction.{name}={value:.9g} {FRICTION.get(name, 'N.m')}" for name, value in friction.items()]
    found.append(f"{prefix}.constant_load={(20.0 if kind.axis == 'Y' else 0.2) * spread(random):.9g} N.m")
    drawn = {name: value * spread(random) for name, value in kind.drawn}
    drawn["K_p"] = 5e-3 * 2 * np.pi * drawn.get("f", 0.0)  # of the current controller, by its bandwidth
    found += [f"{prefix}.{change.format_map(drawn)}" for change in kind.changes]
    return [*found, f"{prefix}.max_acceleration=10 m/s^2", f"machine.cycles.position={kind.position_cycle}"]


def truth(known: Machine, axis: str) -> Mapping[str, float]:
    """True values by name."""
    own = known.axes[axis]
    found = {name: float(getattr(own.drive, name)) for name in ("K_v", "k_ffw", "T_dyn", "T_sym", "K_p", "T_n")}
    found |= {name: float(getattr(own.friction, name)) for name in ("F_C", "sigma_2", "F_log", "sigma_0", "sigma_1")}
    return {**found, "M_0": own.M_0, "J": checked_modes(known).J_tot(axis)}


def scenario(kind: Kind, random: np.random.Generator, seed: int) -> str:
    """Moves of some tens of millimetres at three feeds, in one or both directions."""
    way = random.uniform(12, 30, 3) * ([1, 1, 1] if kind.one_way else [1, -1, 1])
    moves = "".join(
        f"  - {{kind: move, by: {{{kind.axis}: {by:.4g} mm}}, feed: {feed:.5g} mm/min}}\n"
        f"  - {{kind: dwell, duration: {0.2 if kind.modes else 0.12} s}}\n"
        for by, feed in zip(way, random.uniform((8000, 4000, 1500), (12000, 8000, 3000)), strict=True)
    )
    # The other axis moves as well, where the record is of two.
    moves += "".join(
        f"  - {{kind: move, by: {{{axis}: {way} mm}}, feed: 6000 mm/min}}\n"
        for axis in kind.axes[1:]
        for way in (15, -9)
    )
    return (
        f"name: log\nmachine: {MACHINE}\nmotions:\n  - {{kind: dwell, duration: 0.12 s}}\n{moves}"
        f"recording: {{interval: 1 ms}}\nlogging: {{interval: 2 ms, axes: [{', '.join(kind.axes)}], "
        f"signals: [{kind.signals}], noise: {{{kind.noise}}}, seed: {seed}}}\n"
    )


def columns(kind: Kind, axis: str) -> str:
    """The mapping file."""
    roles = {"x_a": "position", "x_s": "setpoint", "M_a": "torque", "x_e": "deviation", "n_s": "speed_setpoint",
             "n_ffw": "feedforward"}  # fmt: skip
    lines = [f"axis: {axis}", "pitch: 10 mm", "time: {column: time}"]
    lines += (f"{roles[name]}: {{column: {axis}.{name}}}" for name in kind.signals.split(", "))
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.exit(main())
