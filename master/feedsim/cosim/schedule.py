"""One control cycle of the coupled system: who steps when, and what each unit is told of its inputs within the step.

The controllers sample at t_k and run first; they add no error. The stiff bond is plant <-> friction; a :class:`Scheme`
says how the two see each other within a step.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from feedsim.cosim.system import System
from feedsim.cosim.unit import Unit


@dataclass(frozen=True)
class Scheme:
    """How the units see each other within a step."""

    name: str
    torque_ramp: bool  # plant: M_a runs linearly from M_a(t_k) to M_a(t_k+1); else M_a(t_k) is held
    friction_ramp: bool  # plant: M_fr is extrapolated with the slope of its last step; else held
    stable_share: float  # of 2 J_inf/h that the friction's slope sigma_1 + sigma_2 may reach; docs/theory.md derives it
    speed: str  # friction: n_fr linear "within" the step, held at its "end" or its "start", or "extrapolated"
    passes: int = 1  # plant and friction go back and take the step again, with the slope of M_fr that they have found
    friction_first: bool = False  # friction steps ahead of the plant, which holds the torque found; else the plant does


SCHEMES = {
    scheme.name: scheme
    for scheme in (
        Scheme("extrapolated", torque_ramp=True, friction_ramp=True, stable_share=0.25, speed="within"),
        Scheme("iterated", torque_ramp=True, friction_ramp=True, stable_share=0.5, speed="within", passes=2),
        Scheme("gauss_seidel", torque_ramp=True, friction_ramp=False, stable_share=0.5, speed="end"),
        Scheme(
            "gauss_seidel_friction_first",
            torque_ramp=True,
            friction_ramp=False,
            stable_share=0.5,
            speed="start",
            friction_first=True,
        ),
        Scheme("jacobi", torque_ramp=True, friction_ramp=False, stable_share=0.25, speed="start"),
        Scheme("jacobi_extrapolated", torque_ramp=True, friction_ramp=True, stable_share=0.1, speed="extrapolated"),
        Scheme("parallel", torque_ramp=False, friction_ramp=False, stable_share=0.25, speed="start"),
    )
}


class Cycle:
    """Executes control cycles on a :class:`System`.

    Attributes:
        residual: (axes,) interface energy residual so far [J]: what the plant gives to the bond less what friction
            takes from it, over the steps' ends (Rodriguez et al., Multibody System Dynamics 55, 2022).
        residual_peak: (axes,) largest absolute residual met [J].
        dissipated: (axes,) friction work so far [J].
    """

    def __init__(self, system: System, scheme: Scheme, cycle: float, substeps: int) -> None:
        self.system = system
        self.scheme = scheme
        self.cycle = cycle
        self.substeps = substeps
        self.step = cycle / substeps
        count = len(system.axes)
        self.M_fr_start = np.zeros(count)  # of the exchange step, where it is taken again
        self.M_a_before = np.zeros(count)  # what an importer without slopes knows of the torque
        self.assumed_torque = np.zeros(count)  # at the end of the exchange step, by the plant
        self.residual = np.zeros(count)
        self.residual_peak = np.zeros(count)
        self.dissipated = np.zeros(count)

    def run(self, k: int) -> None:
        """Advance the whole system from k T_c to (k + 1) T_c."""
        system = self.system
        t = k * self.cycle
        for control in system.controllers:
            control.measured.set()
            control.unit.step(t, self.cycle)
            control.torque.get()
            control.torque.get_slopes()
        if self.scheme.torque_ramp:
            # From the end backwards: a drive whose torque jumps at t_k then acts as it does, without a cycle's delay.
            system.M_a_start[:] = system.M_a_end - self.cycle * system.M_a_slope
        else:
            system.M_a_start[:] = self.M_a_before
            system.M_a_slope[:] = 0.0
            self.M_a_before[:] = system.M_a_end
        for j in range(self.substeps):
            np.multiply(system.M_a_slope, j * self.step, out=system.M_a)
            system.M_a += system.M_a_start
            self._exchange(t + j * self.step)

    def _exchange(self, t: float) -> None:
        """Plant and friction over one exchange step."""
        system, scheme = self.system, self.scheme
        system.n_start[:] = system.n_end
        if scheme.passes > 1:
            self.M_fr_start[:] = system.M_fr
            for unit in self._stepped_again():
                unit.keep()
        self._step(t)
        for _ in range(1, scheme.passes):
            for unit in self._stepped_again():
                unit.go_back()
            system.M_fr[:] = self.M_fr_start
            self._step(t)
        taken = system.M_fr * (system.n + self.step * system.n_slope)
        self.residual += 0.5 * self.step * (self.assumed_torque * system.n_end - taken)
        np.maximum(self.residual_peak, np.abs(self.residual), out=self.residual_peak)
        self.dissipated += self.step * taken

    def _stepped_again(self) -> list[Unit]:
        return [self.system.plant, *(contact.unit for contact in self.system.contacts)]

    def _step(self, t: float) -> None:
        """A pass: the plant, then friction, or the other way round."""
        system, h = self.system, self.step
        if self.scheme.friction_first:
            system.n[:] = system.n_start
            self._step_friction(t)
            self._step_plant(t)
            return
        self._step_plant(t)
        slope = (system.n_end - system.n_start) / h
        if self.scheme.speed == "within":
            system.n[:], system.n_slope[:] = system.n_start, slope
        elif self.scheme.speed == "end":
            system.n[:] = system.n_end
        elif self.scheme.speed == "start":
            system.n[:] = system.n_start
        else:
            system.n[:], system.n_slope[:] = system.n_start, system.n_slope_last
            system.n_slope_last[:] = slope
        self._step_friction(t)

    def _step_plant(self, t: float) -> None:
        """With the friction torque that is at hand: that of the last step's end, or what friction has just found."""
        system, scheme, h = self.system, self.scheme, self.step
        system.plant_inputs.set()
        (system.plant_inputs if scheme.friction_ramp else system.plant_torque).set_slopes()
        system.plant.step(t, h)
        system.plant_outputs.get()
        self.assumed_torque[:] = system.M_fr + h * system.M_fr_slope if scheme.friction_ramp else system.M_fr

    def _step_friction(self, t: float) -> None:
        for contact in self.system.contacts:
            contact.speed.set()
            contact.speed.set_slopes()
            contact.unit.step(t, self.step)
            contact.torque.get()
            contact.torque.get_slopes()
