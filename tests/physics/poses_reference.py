"""The machine of poses_machine.py by matrix exponentials: a second way to everything that plant.fmu does with poses."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
from poses_machine import BETA, DOFS, TCP, Grid, N, X, mass, stiffness
from scipy.linalg import expm

from fmi_helpers import Floats


class Reference:
    """M u'' + BETA K u' + K u = b f with K that of the cell, inputs linear over a step; changes cells at its end.

    full: in the physical coordinates, where a change of cells changes nothing but K. Otherwise in the modal coordinates
    of each cell, carried over face by face: what remains of the machine where modes are missing. There the elastic
    displacement of least energy is added that keeps the positions x_a.
    """

    def __init__(self, grid: Grid, x_0: Sequence[float], full: bool = True) -> None:
        self.grid, self.x_0, self.full = grid, np.array(x_0), full
        self.place = [self._start(g) for g in range(len(grid.axes))]
        self.crossings = 0
        self.kinetic_lost = self.elastic_lost = self.held = self.jump_n_a = self.jump_x_a = self.jump_tool = 0.0
        size = DOFS if full else len(grid.cells[self.cell].omega)
        self.u, self.v = np.zeros(size), np.zeros(size)
        self._matrix = cache(self._exponential)

    def _start(self, g: int) -> int:
        axis = self.grid.axes[g]
        return int(np.sum(self.x_0[axis.axis] > axis.boundaries))

    @property
    def cell(self) -> int:
        return int(np.ravel_multi_index(self.place, self.grid.shape))

    def _system(self, cell: int) -> tuple[Floats, Floats, Floats]:
        """K and, as columns and rows, the ports (inputs, outputs) where the mass matrix is 1."""
        if self.full:
            ports = np.vstack([N, TCP, X])
            return (
                np.linalg.solve(mass(), stiffness(self.grid.positions[cell])),
                np.linalg.solve(mass(), ports.T),
                ports,
            )
        modes = self.grid.cells[cell]
        ports = np.vstack([N, TCP, X]) @ modes.phi
        return np.diag(modes.omega**2), ports.T, ports

    def _exponential(self, cell: int, h: float) -> Floats:
        k, b, _ = self._system(cell)
        size = len(k)
        a = np.zeros((2 * size + 18, 2 * size + 18))
        a[:size, size : 2 * size] = np.eye(size)
        a[size : 2 * size, :size] = -k
        a[size : 2 * size, size : 2 * size] = -BETA * k
        a[size : 2 * size, 2 * size : -9] = b
        a[2 * size : -9, -9:] = np.eye(9)
        return expm(a * h)

    def outputs(self) -> Floats:
        """n_a, x_a of the axes, tool.x (9,)."""
        phi = np.eye(DOFS) if self.full else self.grid.cells[self.cell].phi
        return np.concatenate([N @ phi @ self.v, self.x_0 + X @ phi @ self.u, TCP @ phi @ self.u])

    def energies(self) -> tuple[float, float]:
        """Kinetic and elastic [J]."""
        if self.full:
            k = stiffness(self.grid.positions[self.cell])
            return float(self.v @ mass() @ self.v) / 2, float(self.u @ k @ self.u) / 2
        omega = self.grid.cells[self.cell].omega
        return float(self.v @ self.v) / 2, float(np.sum((omega * self.u) ** 2)) / 2

    def step(self, h: float, start: Floats, end: Floats) -> Floats:
        """From inputs `start` to `end` (9,): torques, forces on tool and slides. Returns the outputs."""
        state = np.concatenate([self.u, self.v, start, (end - start) / h])
        state = self._matrix(self.cell, h) @ state
        size = len(self.u)
        self.u, self.v = state[:size], state[size : 2 * size]
        before, energies, cell = self.outputs(), self.energies(), self.cell
        for g, axis in enumerate(self.grid.axes):
            self._follow(g, float(before[3 + axis.axis]))
        if self.cell != cell:
            if not self.full:
                self._hold(before[3:6] - self.outputs()[3:6])
            jump = np.abs(self.outputs() - before)
            self.jump_n_a = max(self.jump_n_a, *jump[:3])
            self.jump_x_a = max(self.jump_x_a, *jump[3:6])
            self.jump_tool = max(self.jump_tool, *jump[6:])
            lost = np.subtract(energies, self.energies())
            self.kinetic_lost += lost[0]
            self.elastic_lost += lost[1]
        return self.outputs()

    def _hold(self, by: Floats) -> None:
        """Move the scales by `by` (3,) [m]: elastic deflections of least |omega q|."""
        cell = self.grid.cells[self.cell]
        elastic = cell.omega > 0
        omega = cell.omega[elastic]
        self.u[elastic] += np.linalg.lstsq((X @ cell.phi)[:, elastic] / omega, by, rcond=1e-9)[0] / omega
        self.held = max(self.held, *np.abs(by))

    def _follow(self, g: int, x: float) -> None:
        axis = self.grid.axes[g]
        b, w = axis.boundaries, axis.hysteresis
        while self.place[g] < len(b) and x > b[self.place[g]] + w:
            self._move(g, 1)
        while self.place[g] > 0 and x < b[self.place[g] - 1] - w:
            self._move(g, -1)

    def _move(self, g: int, by: int) -> None:
        before = self.cell
        self.place[g] += by
        self.crossings += 1
        if not self.full:
            t = self.grid.transfer(before, self.cell)
            self.u, self.v = t @ self.u, t @ self.v
