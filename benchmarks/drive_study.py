"""Whether the intervals of identified drives hold: logs of machines whose parameters are known, by kind of log.

Every draw takes a rigid or elastic axis with drive, friction and load within a factor of 1.5 about the measured axis X
(Y where a weight loads it) of scenarios/machines/sinumerik_840d, simulates moves that it draws, too, and identifies the
drive from the log alone. A parameter that is called estimated must have its true value in the 95 % interval.

    make drive-study                      all kinds of logs
    python benchmarks/drive_study.py --draws 3 --kinds clean,elastic
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from feedsim.cosim import run
from feedsim.errors import FeedsimError
from feedsim.files.columns import load_columns
from feedsim.replay.closed_loop import read_axes, windowed
from feedsim.replay.elastic import ElasticMode, with_modes
from feedsim.replay.identified import identify_drives
from feedsim.scenario import Machine, load, load_machine
from feedsim.structure import checked_modes
from feedsim.structure.modes import write_modes
from feedsim.trace import write_csv

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
    position_only: bool = False
    position_cycle: str = "125 us"


KINDS = (
    Kind("clean"),
    Kind("5 % noise", noise="M_a: 5 %, x_a: 0.3 um"),
    Kind("one way under a weight", axis="Y", one_way=True),
    Kind("weight both ways", axis="Y"),
    Kind("torque cut off", torque_limit=0.8),
    Kind("position only", position_only=True),
    Kind("position loop of 2 ms", position_cycle="2 ms"),
    Kind("one mode", modes=(ElasticMode(27.0, 0.04, 0.3, 0.2),), noise="M_a: 5 %, x_a: 0.1 um"),
    Kind("two modes", modes=(ElasticMode(24.0, 0.03, 0.2, 0.2), ElasticMode(47.0, 0.02, 0.35, -0.3)),
         noise="M_a: 5 %, x_a: 0.1 um"),
)  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=20, help="logs of each kind")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kinds", help="names, separated by commas (default: all)")
    args = parser.parse_args()
    wanted = None if args.kinds is None else args.kinds.split(",")
    within: dict[str, list[bool]] = defaultdict(list)
    print(f"{'kind of log':<24} {'draw':>4} {'s':>5}  estimated: within or outside; not determined", flush=True)
    for number, kind in enumerate(KINDS):
        if wanted is not None and kind.name not in wanted:
            continue
        for draw in range(args.draws):
            begun = time.process_time()
            try:
                holds, undetermined = one(kind, np.random.default_rng((args.seed, number, draw)), draw + 1)
            except FeedsimError as error:
                print(f"{kind.name:<24} {draw:>4} {time.process_time() - begun:5.1f}  refused: {str(error)[:90]}")
                continue
            for name, inside in holds.items():
                within[name].append(inside)
            said = " ".join(name if inside else f"{name}!" for name, inside in holds.items())
            print(
                f"{kind.name:<24} {draw:>4} {time.process_time() - begun:5.1f}  {said}; {' '.join(undetermined)}",
                flush=True,
            )
    print(f"\n{'parameter':<12} {'estimated':>9} {'within':>7}")
    for name, held in within.items():
        print(f"{name:<12} {len(held):>9} {100 * np.mean(held):6.0f}%")


def one(kind: Kind, random: np.random.Generator, seed: int) -> tuple[dict[str, bool], list[str]]:
    """Of a log: parameter -> whether the interval of an estimated one has the truth; those that are not determined."""
    with TemporaryDirectory() as place:
        folder = Path(place)
        own = load_machine(MACHINE)
        table = checked_modes(own)
        J = table.J_tot(kind.axis) * spread(random)
        rigid = table.rigid
        n = table.ports[f"n_{kind.axis}"]
        scale = np.where(n != 0, np.sqrt(table.J_tot(kind.axis) / J), 1.0)
        ports = {port: (column * scale)[rigid] for port, column in table.ports.items()}
        write_modes(
            folder / "modes.csv",
            replace(table, frequency=table.frequency[rigid], damping=table.damping[rigid], ports=ports),
        )
        changes = [f"machine.modes={folder / 'modes.csv'}", *changed(own, kind, random)]
        (folder / "moves.yaml").write_text(scenario(kind, random, seed))
        known = load(folder / "moves.yaml", changes).machine
        true = truth(known, kind.axis)
        if kind.modes:
            elastic = with_modes(known, kind.axis, kind.modes)
            changes = [f"machine.modes={elastic.modes}", *changes[1:]]
        log = run(load(folder / "moves.yaml", changes)).log
        assert log is not None
        M = f"{kind.axis}.M_a"
        if kind.torque_limit:
            most = kind.torque_limit * float(np.max(np.abs(log.columns[M])))
            log = replace(log, columns={**log.columns, M: np.clip(log.columns[M], -most, most)})
        write_csv(folder / "log.csv", log)
        (folder / "columns.yaml").write_text(columns(kind))
        read = read_axes(folder / "log.csv", [kind.axis], None, load_columns(folder / "columns.yaml"))
        records = {kind.axis: windowed(kind.axis, read[kind.axis], None)}
        modes = None if kind.modes else 0
        found = identify_drives(read, records, None, [], "made", "made", modes=modes).drives[kind.axis]
    holds, undetermined = {}, []
    for name, each in found.estimates.items():
        if name not in true:
            continue
        if each.status == "estimated":
            holds[name] = bool(each.interval[0] <= true[name] <= each.interval[1])
        else:
            undetermined.append(name)
    for k, mode in enumerate(kind.modes):
        near = [each for each in found.modes if abs(each.frequency / mode.frequency - 1) < 0.15]
        holds[f"mode {k + 1} f"] = any(abs(each.frequency - mode.frequency) <= 1.96 * each.sigma[0] for each in near)
        holds[f"mode {k + 1} 2 %"] = any(abs(each.frequency / mode.frequency - 1) <= 0.02 for each in near)
    return holds, undetermined


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
    signals = "x_s, x_a, M_a" if kind.position_only else "x_s, x_a, x_e, n_s, n_ffw, M_a"
    return (
        f"name: log\nmachine: {MACHINE}\nmotions:\n  - {{kind: dwell, duration: 0.12 s}}\n{moves}"
        f"recording: {{interval: 1 ms}}\nlogging: {{interval: 2 ms, axes: [{kind.axis}], signals: [{signals}], "
        f"noise: {{{kind.noise}}}, seed: {seed}}}\n"
    )


def columns(kind: Kind) -> str:
    """The mapping file."""
    roles = {"position": "x_a", "setpoint": "x_s", "torque": "M_a"}
    if not kind.position_only:
        roles |= {"deviation": "x_e", "speed_setpoint": "n_s", "feedforward": "n_ffw"}
    lines = [f"axis: {kind.axis}", "pitch: 10 mm", "time: {column: time}"]
    return "\n".join([*lines, *(f"{role}: {{column: {kind.axis}.{name}}}" for role, name in roles.items())]) + "\n"


if __name__ == "__main__":
    sys.exit(main())
