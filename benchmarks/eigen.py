"""What the modes of a large model cost: time and memory, for machines of brick elements with three free axes.

A bed of steel bricks stands on mounts, hollow with a wall of three bricks (box) or a cube (solid). On it three solid
slides, each guided by springs and driven through a nut's spring by a rotor, move along X, Y and Z. A model for the
solver's sake, of a machine's size and nothing else.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from harness import arguments, digits, table

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_diag, coo_array, csc_array
from watched import memory

from feedsim.scenario.structure import Damping
from feedsim.structure.assembly import Assembly, Geometry
from feedsim.structure.solve import solve

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
from eigen_models import error_bounds

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

MODELS = {"box-10": ("box", 10), "box-30": ("box", 30), "box-100": ("box", 100), "solid-32": ("solid", 32)}
SHAPES = {"box": "hollow bed", "solid": "solid cube"}
EDGE = 0.04  # of a brick [m]
MODULUS, POISSON, DENSITY = 2.1e11, 0.3, 7850.0  # steel
MOUNT, GUIDE, NUT = 5e7, 1e9, 1e9  # [N/m]
ROTOR, LEAD = 0.01, 0.02 / (2 * math.pi)  # [kg.m2], [m/rad]
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])


def brick() -> tuple[Floats, Floats]:
    """Mass and stiffness (24, 24) of a cube with trilinear displacements, 2 x 2 x 2 Gauss points."""
    signs = 2.0 * CORNERS - 1
    lame = MODULUS * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
    shear = MODULUS / (2 * (1 + POISSON))
    elastic = np.diag([2 * shear] * 3 + [shear] * 3)
    elastic[:3, :3] += lame
    mass, stiffness = np.zeros((24, 24)), np.zeros((24, 24))
    volume = EDGE**3 / 8
    for point in signs / math.sqrt(3):
        factors = 1 + signs * point
        shape = factors.prod(axis=1) / 8
        slope = np.stack([signs[:, i] * np.delete(factors, i, 1).prod(axis=1) / (4 * EDGE) for i in range(3)], axis=1)
        strain = np.zeros((6, 8, 3))
        for i in range(3):
            strain[i, :, i] = slope[:, i]
            j = (i + 1) % 3
            strain[3 + i, :, i], strain[3 + i, :, j] = slope[:, j], slope[:, i]
        rows = strain.reshape(6, 24)
        stiffness += volume * rows.T @ elastic @ rows
        displacement = np.kron(shape, np.eye(3))
        mass += volume * DENSITY * displacement.T @ displacement
    return mass, stiffness


class Body:
    """Bricks in a grid from a corner (in elements), the hollow ones left out."""

    def __init__(self, name: str, corner: tuple[int, int, int], size: tuple[int, int, int], wall: int = 0) -> None:
        elements = np.stack(np.meshgrid(*map(np.arange, size), indexing="ij"), axis=-1).reshape(-1, 3)
        if wall:
            inside = (elements[:, 1:] >= wall) & (elements[:, 1:] < np.array(size[1:]) - wall)
            elements = elements[~inside.all(axis=1)]
        points = (elements[:, None, :] + CORNERS).reshape(-1, 3)
        nodes, index = np.unique(points, axis=0, return_inverse=True)
        self.name, self.nodes, self.size = name, EDGE * (nodes + np.array(corner)), 3 * len(nodes)
        dofs = (3 * index.reshape(-1, 8)[:, :, None] + np.arange(3)).reshape(-1, 24)
        rows, columns = np.repeat(dofs, 24, axis=1).ravel(), np.tile(dofs, (1, 24)).ravel()
        self.mass, self.stiffness = (
            csc_array(coo_array((np.tile(part.ravel(), len(dofs)), (rows, columns)), shape=(self.size, self.size)))
            for part in brick()
        )
        low, high = self.nodes.min(axis=0), self.nodes.max(axis=0)
        self.corners = [self.near(low + (high - low) * corner) for corner in CORNERS]

    def near(self, point: Floats) -> int:
        return int(np.argmin(np.linalg.norm(self.nodes - point, axis=1)))


def machine(bed: Body) -> Assembly:
    """The bed with its three slides."""
    top, middle = bed.nodes.max(axis=0)[1], bed.nodes.mean(axis=0)
    at = np.rint(np.array([middle[0], top, middle[2]]) / EDGE).astype(int) + np.array([-3, 1, -3])
    x, y, z = at.tolist()
    slides = [Body("slide X", (x, y, z), (6, 4, 6)), Body("slide Y", (x, y + 5, z), (6, 6, 4))]
    slides.append(Body("slide Z", (x, y + 5, z + 5), (4, 4, 6)))
    bodies = [bed, *slides]
    starts = np.cumsum([0, *(body.size for body in bodies)])
    size = int(starts[-1]) + 3
    springs: list[tuple[float, dict[int, float]]] = []
    for corner in (0, 1, 4, 5):  # the lower ones
        springs += [(MOUNT, {3 * bed.corners[corner] + i: 1.0}) for i in range(3)]
    ports = {}
    for axis, (slide, base) in enumerate(zip(bodies[1:], bodies[:-1], strict=True)):
        pairs = [(node, base.near(slide.nodes[node])) for node in slide.corners]
        joined = [(int(starts[axis + 1]) + 3 * a, int(starts[axis]) + 3 * b) for a, b in pairs]
        springs += [(GUIDE, {a + i: 1.0, b + i: -1.0}) for a, b in joined for i in range(3) if i != axis]
        a, b = joined[0]
        rotor = size - 3 + axis
        springs.append((NUT, {a + axis: 1.0, b + axis: -1.0, rotor: -LEAD}))
        ports["n_" + "XYZ"[axis]], ports["x_" + "XYZ"[axis]] = np.zeros((2, size))
        ports["n_" + "XYZ"[axis]][rotor] = 1.0
        ports["x_" + "XYZ"[axis]][[a + axis, b + axis]] = 1.0, -1.0
    for i in range(3):
        ports["tcp_" + "XYZ"[i]] = np.zeros(size)
        ports["tcp_" + "XYZ"[i]][[int(starts[3]) + i, 3 * bed.corners[7] + i]] = 1.0, -1.0
    stiffness = csc_array(block_diag([*(body.stiffness for body in bodies), csc_array((3, 3))]))
    mass = csc_array(block_diag([*(body.mass for body in bodies), csc_array(ROTOR * np.eye(3))]))
    stiffness = csc_array(stiffness + joints(springs, size))
    return Assembly("bricks", mass, stiffness, ports, ("X", "Y", "Z"), *described(bodies, size), {})


def joints(springs: list[tuple[float, dict[int, float]]], size: int) -> csc_array:
    """Stiffness of springs (stiffness, coefficients of the stretch)."""
    rows = [dof for _, stretch in springs for dof in stretch]
    columns = [i for i, (_, stretch) in enumerate(springs) for _ in stretch]
    values = [math.sqrt(k) * c for k, stretch in springs for c in stretch.values()]
    roots = csc_array(coo_array((values, (rows, columns)), shape=(size, len(springs))))
    return csc_array(roots @ roots.T)


def described(bodies: list[Body], size: int) -> tuple[tuple[str, ...], Geometry]:
    """Labels and geometry; each rotor is a node of its own."""
    nodes = np.vstack([*(body.nodes for body in bodies), np.zeros((3, 3))])
    owners = (*(body.name for body in bodies for _ in body.nodes), *(f"rotor {axis}" for axis in "XYZ"))
    dofs = np.full((len(nodes), 6), -1, dtype=np.int64)
    dofs[:-3, :3] = np.arange(size - 3).reshape(-1, 3)
    dofs[[-3, -2, -1], [3, 4, 5]] = np.arange(size - 3, size)
    names = tuple(f"{owner}[{i}]" for i, owner in enumerate(owners))
    labels = (*(f"{name} {d}" for name in names[:-3] for d in ("ux", "uy", "uz")), *names[-3:])
    return labels, Geometry(nodes, names, owners, dofs, np.empty((0, 2), dtype=np.int64))


def one(kind: str, length: int) -> dict[str, object]:
    """Solve one model."""
    bed = Body("bed", (0, 0, 0), (length, 24, 24), 3) if kind == "box" else Body("bed", (0, 0, 0), (length,) * 3)
    model = machine(bed)
    began = time.monotonic()

    def progress(text: str) -> None:
        print(f"  {time.monotonic() - began:6.1f} s  {text}", file=sys.stderr, flush=True)

    found = solve(model, cutoff=2e3 * math.pi, damping=Damping(ratio=0.02), static_correction=True, progress=progress)
    for i in (3, 4, 5):
        print(f"  {found.modes.frequency[i]:.4g} Hz: {found.moving[i]}", file=sys.stderr)
    peak = memory("VmHWM")
    return {
        "degrees of freedom": model.mass.shape[0],
        "modes": len(found.modes.frequency) - found.corrections,
        "seconds": found.seconds,
        "peak memory GB": None if peak is None else peak / 1e3,
        "largest error bound": float(error_bounds(model, found).max()),
    }


def apart(kind: str, length: int) -> dict[str, Any]:
    """The same in a process of its own: peak memory is the process's."""
    command = [sys.executable, __file__, "--one", kind, str(length)]
    found: dict[str, Any] = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)
    return found


def _options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--model", nargs=2, metavar=("KIND", "LENGTH"), help="box or solid, and its length in bricks, in place of those"
    )


def main(given: Sequence[str] | None = None) -> int:
    words = sys.argv[1:] if given is None else list(given)
    if words[:1] == ["--one"]:
        print(json.dumps(one(words[1], int(words[2]))))
        return 0
    bench = arguments("eigen", __doc__, given, only=tuple(MODELS), more=_options)
    wanted = {name: MODELS[name] for name in bench.only}
    if bench.short:
        wanted = {"box-3": ("box", 3)}
    if bench.given.model:
        kind, length = bench.given.model
        wanted = {f"{kind}-{length}": (kind, int(length))}
    results = {name: apart(*model) for name, model in wanted.items()}
    rows = []
    for name, found in results.items():
        kind, length = wanted[name]
        memory = found["peak memory GB"]
        rows.append([
            f"{SHAPES[kind]}, {length} bricks long", f"{found['degrees of freedom']:,}", found["modes"],
            f"{digits(found['seconds'], 2)} s", "unknown" if memory is None else f"{digits(memory, 2)} GB",
            f"{found['largest error bound']:.0e}",
        ])  # fmt: skip
    header = ["model", "degrees of freedom", "modes to 1000 Hz", "time", "peak memory", "largest error bound"]
    bench.tell(table(header, rows), results)
    return 0


if __name__ == "__main__":
    sys.exit(main())
