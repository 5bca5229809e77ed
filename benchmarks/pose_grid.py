"""How a grid of poses converges: a move over a whole travel, with coarse and fine grids, against the full model.

Run by ``make pose-study`` (some minutes). The default machine, whose numbers are synthetic. Writes table.md and two
figures; what they show is explained in docs/position-dependence.md.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pose_reference
from numpy.typing import NDArray

from feedsim import scenario
from feedsim.scenario import Machine, Scenario
from feedsim.scenario.structure import GeometryStructure
from feedsim.scenario.structure_checks import load_structure
from feedsim.simulation import cosim
from feedsim.simulation.cosim.archive import Archive
from feedsim.simulation.cosim.operations import DueCycles, Interpreter, do_step, get_row, set_real, set_slopes
from feedsim.simulation.cosim.unit import Log, Port, Unit
from feedsim.structure.modes import TOOL_PORTS, Modes, read_modes
from feedsim.structure.pack import pack
from feedsim.structure.poses import PoseGrid, grid_axis, pose_grid, write_poses
from feedsim.structure.solve import solve

Floats = NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[1]
MACHINE = ROOT / "scenarios" / "machines" / "test_centre"
AXIS = "Z"
TOOL = ("tool.x_X", "tool.x_Y", "tool.x_Z")
ENERGIES = ("pose.E_kin_lost", "pose.E_el_lost")
LARGEST = ("pose.held", "pose.jump_x_a", "pose.jump_n_a", "pose.jump_tool")
SCENARIO = """
name: Over the whole travel
machine: {machine}
motions:
  - {{kind: move, to: {{{axis}: {end} mm}}, feed: {feed} m/min}}
  - {{kind: dwell, duration: {rest} s}}
recording: {{interval: 125 us}}
"""


@dataclass(frozen=True, eq=False)
class Recorded:
    """Torques on the structure (axes, K) [N.m] and positions of the axis (K,) [m] at instants (K,) [s] of the control
    cycle; the motion ends at `stop` [s]."""

    time: Floats
    torque: Floats
    position: Floats
    stop: float


@dataclass(frozen=True, eq=False)
class Driven:
    """A plant driven by recorded torques: x_A less its start, tool_d, n_A, each (K,); monitors at the end; energies
    lost per crossing (crossings, 2) [J]."""

    outputs: Mapping[str, Floats]
    monitors: Mapping[str, float]
    lost: Floats


def load(folder: Path, start: float, end: float, feed: float, rest: float) -> Scenario:
    """The move, from `start` to `end` [m] at feed [m/min], rest [s] afterwards."""
    file = folder / "scenario.yaml"
    file.write_text(SCENARIO.format(machine=MACHINE, axis=AXIS, end=end * 1e3, feed=feed, rest=rest), encoding="utf-8")
    return scenario.load(file, [f"machine.pose.{AXIS}={start!r} m"])


def packed(machine: Machine, grid: PoseGrid, folder: Path, fmus: Path | None = None) -> Path:
    """The plant archive of a machine with a grid of poses, made from the one in the folder `fmus` (default: that of the
    built archives)."""
    out, poses = folder / f"plant{len(grid.cells)}.fmu", folder / "poses.bin"
    write_poses(poses, grid)
    pose = {axis: machine.pose[axis] for axis in machine.axes}
    base = (fmus or cosim.fmus_directory()) / "plant.fmu"
    pack(base, out, modes=machine.modes, pose=pose, poses=poses, trial=False)
    return out


def record(plan: Scenario, plant: Path) -> tuple[Recorded, cosim.Run]:
    """Run the move in co-simulation on a plant archive."""
    plan = plan.model_copy(update={"machine": plan.machine.model_copy(update={"plant": plant})})
    run = cosim.run(plan)
    trace = run.trace
    torque = np.array([trace[f"{axis}.M_a"] - trace[f"{axis}.M_fr"] for axis in plan.machine.axes])
    return Recorded(trace.time, torque, trace[f"{AXIS}.x_a"], run.program.segments[0].end), run


def drive(plant: Path, machine: Machine, recorded: Recorded, modes_file: Path | None = None) -> Driven:
    """The plant archive alone, driven by recorded torques."""
    axes = list(machine.axes)
    count = len(recorded.time)
    h = float(recorded.time[1] - recorded.time[0])
    names = [*(f"{axis}.x_a" for axis in axes), *TOOL, *(f"{axis}.n_a" for axis in axes), *ENERGIES, *LARGEST]
    with Archive(plant) as archive:
        unit = Unit(archive, "plant")
        try:
            unit.set_parameters({f"{axis}.x_0": machine.pose[axis] for axis in axes})
            if modes_file is not None:
                unit.set_parameters({"modes_file": str(modes_file)})
            port = Port(unit, [f"{axis}.M_a" for axis in axes])
            log = Log(unit, names, count)
            unit.enter_initialisation(0.0, count * h)
            unit.exit_initialisation()
            torque, slopes = recorded.torque.T, np.diff(recorded.torque, axis=1).T / h
            rows = get_row(log, DueCycles())
            driven = [*set_real(port, torque), *set_slopes(port, slopes), do_step(unit, 0.0, h)]
            Interpreter([*rows, *driven], h).run(0, count - 1)
            Interpreter(rows, h).run(count - 1, count)
        finally:
            unit.close()
    columns = log.columns()
    outputs = {f"x_{axis}": columns[f"{axis}.x_a"] - machine.pose[axis] for axis in axes}
    outputs |= {f"tool_{name[-1]}": columns[name] for name in TOOL}
    outputs |= {f"n_{axis}": columns[f"{axis}.n_a"] for axis in axes}
    energies = np.column_stack([columns[name] for name in ENERGIES])
    lost = np.diff(energies, axis=0)
    return Driven(outputs, {name: float(columns[name][-1]) for name in LARGEST}, lost[np.any(lost != 0, axis=1)])


def edges(recorded: Recorded, low: float, high: float, fine: float, coarse: float) -> Floats:
    """Where the reference renews its springs: `fine` apart where the axis accelerates, else `coarse` [m]."""
    first, last = recorded.position[0], recorded.position[-1]
    speed = np.gradient(recorded.position, recorded.time)
    steady = recorded.position[np.abs(speed) > 0.999 * np.max(np.abs(speed))]
    marks = [first, float(steady[0]), float(steady[-1]), last]
    parts = [
        np.linspace(a, b, max(1, round((b - a) / width)) + 1)
        for a, b, width in zip(marks[:-1], marks[1:], (fine, coarse, fine), strict=True)
    ]
    inner = np.concatenate([parts[0], parts[1][1:], parts[2][1:]])
    return np.clip(inner, low, high)


def errors(found: Mapping[str, Floats], expected: Mapping[str, Floats], recorded: Recorded) -> dict[str, float]:
    """Errors of x_a of the axis and of the tool point [nm]: largest and rms until the motion ends, largest after it."""
    moving = recorded.time <= recorded.stop
    x = found[f"x_{AXIS}"] - expected[f"x_{AXIS}"]
    tool = np.sqrt(sum((found[f"tool_{d}"] - expected[f"tool_{d}"]) ** 2 for d in pose_reference.DIRECTIONS))
    result = {}
    for name, error in (("x_a", np.abs(x)), ("tool", tool)):
        result[f"{name} max"] = 1e9 * float(error[moving].max())
        result[f"{name} rms"] = 1e9 * float(np.sqrt(np.mean(error[moving] ** 2)))
        result[f"{name} after"] = 1e9 * float(error[~moving].max())
    return result


def response(modes: Modes, force: str, output: str, frequency: Floats) -> Floats:
    """Displacement, or speed for a port n_A, per torque or force; complex (F,)."""
    s = 2j * np.pi * frequency[:, None]
    omega = 2 * np.pi * modes.frequency
    parts = modes.ports[force] * modes.ports[output] / (s**2 + 2 * modes.damping * omega * s + omega**2)
    return np.asarray(parts.sum(axis=1) * (s[:, 0] if output.startswith("n_") else 1.0))


def full_modes(structure: GeometryStructure, pose: Mapping[str, float]) -> Modes:
    """All modes at a pose."""
    from feedsim.structure.geometry.assemble import assemble

    return solve(assemble(structure, pose), cutoff=np.inf, damping=structure.damping).modes


def decibels(found: Floats, expected: Floats) -> float:
    """Largest difference in magnitude [dB]."""
    return float(np.max(np.abs(20 * np.log10(np.abs(found) / np.abs(expected)))))


def frf_rows(
    structure: GeometryStructure, machine: Machine, grids: Mapping[int, PoseGrid], pose: Mapping[str, float]
) -> tuple[list[str], dict[str, Floats]]:
    """Rows of the table of frequency responses at both ends of the travel, and curves for the figure."""
    frequency = np.geomspace(5, 500, 2000)
    one = read_modes(machine.modes.file, list(machine.axes))
    rows, curves = [], {"frequency": frequency}
    ports = {"n/M": (f"n_{AXIS}", f"n_{AXIS}"), "x_a/M": (f"n_{AXIS}", f"x_{AXIS}"), "tool x/F": ("tcp_Z", "tcp_Z")}
    assert all(port in one.ports for pair in ports.values() for port in pair)
    assert set(TOOL_PORTS) <= set(one.ports)
    for end, index in zip(machine.axes[AXIS].travel, (0, -1), strict=True):
        full = full_modes(structure, {**pose, AXIS: end})
        expected = {name: response(full, *pair, frequency) for name, pair in ports.items()}
        candidates = {"one pose": one} | {str(n): grid.cells[index].modes for n, grid in grids.items()}
        for name, modes in candidates.items():
            found = {key: response(modes, *pair, frequency) for key, pair in ports.items()}
            cells = " | ".join(f"{decibels(found[key], expected[key]):.2f}" for key in ports)
            rows.append(f"| {end * 1e3:.0f} mm | {name} | {cells} |")
            curves[f"{end} {name}"] = np.abs(found["n/M"])
        curves[f"{end} full"] = np.abs(expected["n/M"])
    return rows, curves


def study(out: Path, counts: Sequence[int], feed: float, rest: float, fine: float) -> None:
    """The whole study, written to the folder `out`."""
    begun = time.monotonic()
    out.mkdir(parents=True, exist_ok=True)
    structure = load_structure(MACHINE / "structure.yaml")
    assert isinstance(structure, GeometryStructure)
    with tempfile.TemporaryDirectory(prefix="feedsim-") as name:
        folder = Path(name)
        low, high = structure.axes[AXIS].travel
        plan = load(folder, low, high, feed, rest)
        machine = plan.machine
        pose = dict(machine.pose)
        grids, made = {}, {}
        for count in counts:
            start = time.monotonic()
            grids[count] = pose_grid(structure, pose, [grid_axis(AXIS, low, high, (high - low) / count)])
            made[count] = time.monotonic() - start
            print(f"{count} cells: {made[count]:.1f} s", flush=True)
        plants = {count: packed(machine, grid, folder) for count, grid in grids.items()}
        recorded, best = record(plan, plants[counts[-1]])
        print(f"largest torque {np.abs(recorded.torque).max():.1f} N.m", flush=True)

        def full(where: Floats) -> dict[str, Floats]:
            return pose_reference.run(structure, pose, AXIS, recorded.position, recorded.torque, 125e-6, where)

        expected, check = (full(edges(recorded, low, high, width, 10 * width)) for width in (fine, 2 * fine))
        print(f"reference: {time.monotonic() - begun:.0f} s since the start", flush=True)
        lines = table_head()
        own = drive(cosim.fmus_directory() / "plant.fmu", machine, recorded, machine.modes.file)
        lines.append(row("1, at 100 mm", np.nan, own, errors(own.outputs, expected, recorded)))
        by_grid, alone = {}, {}
        for count in counts:
            driven = drive(plants[count], machine, recorded)
            by_grid[count] = errors(driven.outputs, expected, recorded)
            alone[count] = errors(full(np.linspace(low, high, count + 1)), expected, recorded)
            lines.append(row(str(count), (high - low) / count, driven, by_grid[count], alone[count]))
        reference = errors(check, expected, recorded)
        lines.append(row("reference, twice as coarse", np.nan, None, reference))
        closed = closed_loop(plan, best, {"1, at 100 mm": None} | {str(n): plants[n] for n in counts[:-1]})
        rows, curves = frf_rows(structure, machine, grids, pose)
        content = [
            "## Driven by the same torques: error against the full model", *lines,
            "", f"## In co-simulation: difference to {counts[-1]} cells", *closed,
            "", "## Frequency responses at the ends of the travel, 5 to 500 Hz: largest error [dB]",
            "| Z | cells | n/M | x_a/M | tool x/F in Z |", "|---|---|---|---|---|", *rows,
            "", "## Cost", "| cells | poses.bin [MB] | time [s] |", "|---|---|---|",
            *(f"| {n} | {8e-6 * grids[n].size:.2f} | {made[n]:.1f} |" for n in counts),
        ]  # fmt: skip
        (out / "table.md").write_text("\n".join(content) + "\n", encoding="utf-8")
        figures(out, by_grid, alone, {n: (high - low) / n for n in counts}, reference, curves)
    print("\n".join(content))
    print(f"{time.monotonic() - begun:.0f} s; {out}")


def table_head() -> list[str]:
    heads = [
        "cells", "cell [mm]", "E_kin lost mean, max [pJ]", "E_el lost mean, max [nJ]", "held x_a [nm]",
        "jump x_a [nm]", "jump n_a [urad/s]", "jump tool [nm]", "x_a max, rms [nm]", "after [nm]",
        "tool max, rms [nm]", "after [nm]", "with all modes: x_a max, rms [nm]", "tool max, rms [nm]",
    ]  # fmt: skip
    return ["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]


def row(
    name: str, cell: float, driven: Driven | None, error: Mapping[str, float], alone: Mapping[str, float] | None = None
) -> str:
    """A row of the table; alone: the error of the same cells with all modes."""
    width = f"{cell * 1e3:.1f}" if np.isfinite(cell) else "-"
    if driven is None or not len(driven.lost):
        crossing = ["-"] * 6
    else:
        lost, largest = driven.lost, driven.monitors
        crossing = [
            f"{1e12 * lost[:, 0].mean():.3g}, {1e12 * lost[:, 0].max():.3g}",
            f"{1e9 * lost[:, 1].mean():.3g}, {1e9 * np.abs(lost[:, 1]).max():.3g}",
            f"{1e9 * largest['pose.held']:.2f}",
            f"{1e9 * largest['pose.jump_x_a']:.1g}",
            f"{1e6 * largest['pose.jump_n_a']:.2g}",
            f"{1e9 * largest['pose.jump_tool']:.1f}",
        ]
    numbers = [
        f"{error['x_a max']:.1f}, {error['x_a rms']:.1f}", f"{error['x_a after']:.1f}",
        f"{error['tool max']:.1f}, {error['tool rms']:.1f}", f"{error['tool after']:.1f}",
    ]  # fmt: skip
    numbers += [
        f"{alone[f'{of} max']:.1f}, {alone[f'{of} rms']:.1f}" if alone is not None else "-" for of in ("x_a", "tool")
    ]
    return "| " + " | ".join([name, width, *crossing, *numbers]) + " |"


def closed_loop(plan: Scenario, best: cosim.Run, plants: Mapping[str, Path | None]) -> list[str]:
    """The same move in co-simulation: what following the pose changes once the loops are closed."""
    lines = ["| cells | x_a max, rms [nm] | after [nm] | tool max, rms [nm] | after [nm] |", "|---|---|---|---|---|"]
    stop = best.program.segments[0].end
    moving = best.trace.time <= stop
    for name, plant in plants.items():
        run = cosim.run(plan.model_copy(update={"machine": plan.machine.model_copy(update={"plant": plant})}))
        x = np.abs(run.trace[f"{AXIS}.x_a"] - best.trace[f"{AXIS}.x_a"]) * 1e9
        tool = np.sqrt(sum((run.trace[port] - best.trace[port]) ** 2 for port in TOOL)) * 1e9
        cells = [
            text
            for e in (x, tool)
            for text in (f"{e[moving].max():.1f}, {np.sqrt(np.mean(e[moving] ** 2)):.1f}", f"{e[~moving].max():.1f}")
        ]
        lines.append("| " + " | ".join([name, *cells]) + " |")
    return lines


def figures(
    out: Path,
    by_grid: Mapping[int, Mapping[str, float]],
    alone: Mapping[int, Mapping[str, float]],
    width: Mapping[int, float],
    reference: Mapping[str, float],
    curves: Mapping[str, Floats],
) -> None:
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(11, 4.2), layout="constrained")
    cells = [1e3 * width[n] for n in by_grid]
    for key, label, marker in (("x_a", "x_a", "o"), ("tool", "tool point", "s")):
        line = axes[0].loglog(cells, [e[f"{key} max"] for e in by_grid.values()], marker=marker, label=f"{label}, max")
        colour = line[0].get_color()
        axes[0].loglog(cells, [e[f"{key} rms"] for e in by_grid.values()], "--", color=colour, label=f"{label}, rms")
        axes[0].loglog(
            cells, [e[f"{key} rms"] for e in alone.values()], ":", color=colour, label=f"{label}, rms, all modes"
        )
        axes[0].axhline(reference[f"{key} rms"], color=colour, lw=0.8, ls=":")
    axes[0].set_xlabel("size of the cells [mm]")
    axes[0].set_ylabel("error against the full model [nm]")
    axes[0].set_title("Move over the whole Z travel, 20 m/min", fontsize=10)
    axes[0].legend(frameon=False, fontsize=8)
    axes[0].grid(True, which="both", lw=0.3)
    ends = sorted({float(name.split()[0]) for name in curves if " " in name})
    finest = max(by_grid)
    for end, colour in zip(ends, ("tab:blue", "tab:orange"), strict=True):
        label = f"Z at {end * 1e3:.0f} mm"
        axes[1].loglog(
            curves["frequency"], curves[f"{end} full"], color=colour, lw=2.2, alpha=0.45, label=f"{label}, all modes"
        )
        axes[1].loglog(
            curves["frequency"], curves[f"{end} {finest}"], color=colour, lw=0.9, label=f"{label}, cell of {finest}"
        )
    axes[1].loglog(
        curves["frequency"], curves[f"{ends[0]} one pose"], color="0.4", lw=0.9, ls="--", label="one pose, Z at 100 mm"
    )
    axes[1].set_xlabel("frequency [Hz]")
    axes[1].set_ylabel("|n/M| of Z [rad/(s.N.m)]")
    axes[1].set_title("Drive of Z at both ends of its travel", fontsize=10)
    axes[1].legend(frameon=False, fontsize=8)
    axes[1].grid(True, which="both", lw=0.3)
    figure.text(0.995, 0.005, "synthetic machine", ha="right", fontsize=7, color="0.4")
    figure.savefig(out / "pose-grid.png", dpi=110)


def main() -> None:
    command = argparse.ArgumentParser(description=__doc__)
    command.add_argument("--out", type=Path, default=ROOT / "build" / "pose-study")
    command.add_argument("--cells", type=int, nargs="+", default=[1, 4, 9, 18, 35, 69, 137])
    command.add_argument("--feed", type=float, default=20.0, help="[m/min]")
    command.add_argument("--rest", type=float, default=0.5, help="after the move [s]")
    command.add_argument(
        "--fine", type=float, default=0.5, help="width of the reference's cells under acceleration [mm]"
    )
    options = command.parse_args()
    study(options.out, options.cells, options.feed, options.rest, options.fine * 1e-3)


if __name__ == "__main__":
    main()
