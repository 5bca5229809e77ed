"""What a machine's modes and, where it is known, its finite-element model say of its axes at once."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from feedsim.foundation.errors import Finding
from feedsim.scenario import FrictionParameters
from feedsim.structure.assembly import Assembly, Floats, translating_mass
from feedsim.structure.build import Built
from feedsim.structure.modes import Modes
from feedsim.structure.solve import Solution


@dataclass(frozen=True)
class AxisInfo:
    """An axis as its motor sees it.

    Attributes:
        lead: travel per radian of the motor in rigid motion [m/rad].
        J_tot: inertia that a slow torque accelerates [kg.m2].
        J_inf: inertia that a sudden torque meets [kg.m2].
        moving_mass: mass that travels with the axis [kg]; NaN where only modes are known.
        J_moving: share of J_tot that the moving mass makes, mass x lead^2 [kg.m2]; the rest turns (rotor, screw).
        coupling_limit: 2 J_inf/h [N.m.s/rad], above any slope of friction over speed that is exchanged at steps of h.
        friction_slope: sigma_1 + sigma_2 [N.m.s/rad], what a sudden change of speed meets; NaN where it is not known.
    """

    name: str
    lead: float
    J_tot: float
    J_inf: float
    moving_mass: float
    J_moving: float
    coupling_limit: float
    friction_slope: float


def axis_infos(
    modes: Modes,
    axes: Sequence[str],
    h: float,
    friction: Mapping[str, FrictionParameters] | None = None,
    model: tuple[Assembly, Floats] | None = None,
) -> tuple[AxisInfo, ...]:
    """Figures of every axis; h is the exchange step [s].

    friction: axis -> its parameters, where they are known.
    model: the finite-element model and its mode shapes (N, n_modes), columns as in `modes`, where they are at hand.

    Raises:
        InputError: the rigid modes do not move every axis on its own.
    """
    leads = np.diag(modes.leads(axes)) if axes else np.zeros(0)
    infos = []
    for axis, lead in zip(axes, leads.tolist(), strict=True):
        contact = (friction or {}).get(axis)
        mass = moving_mass(*model, modes, axis, axes) if model is not None else math.nan
        infos.append(
            AxisInfo(
                name=axis,
                lead=lead,
                J_tot=modes.J_tot(axis),
                J_inf=modes.J_inf(axis),
                moving_mass=mass,
                J_moving=mass * lead**2,
                coupling_limit=2 * modes.J_inf(axis) / h,
                friction_slope=math.nan if contact is None else contact.sigma_1 + contact.sigma_2,
            )
        )
    return tuple(infos)


def moving_mass(assembly: Assembly, shapes: Floats, modes: Modes, axis: str, axes: Sequence[str]) -> float:
    """Mass that travels with an axis [kg]; NaN without geometry.

    From the translations in the rigid motion that takes this axis's scale along by 1 m and leaves the others.
    """
    if assembly.geometry is None:
        return math.nan
    travel = np.column_stack([modes.ports[f"x_{name}"][modes.rigid] for name in axes])
    unit = np.array([float(name == axis) for name in axes])
    motion = shapes[:, modes.rigid] @ np.linalg.solve(travel.T, unit)
    dofs = assembly.geometry.dofs[:, :3]
    dofs = dofs[dofs >= 0]
    u = np.zeros_like(motion)
    u[dofs] = motion[dofs]
    return float(u @ (assembly.mass @ u))


@dataclass(frozen=True, eq=False)
class MachineInfo:
    """What there is to know of a machine's structure at a pose.

    Attributes:
        pose: axis -> position [m]; empty where it is not known.
        step: exchange step h that the coupling limits belong to [s].
        total_mass: [kg]; NaN where only modes or matrices are known.
        moving: what moves, per mode; "" where only modes are known.
        built: model and solution; None where the modes were read from a table.
    """

    name: str
    note: str
    pose: Mapping[str, float]
    axes: tuple[AxisInfo, ...]
    step: float
    total_mass: float
    modes: Modes
    moving: tuple[str, ...]
    built: Built | None
    warnings: tuple[Finding, ...]

    @property
    def solution(self) -> Solution | None:
        """How the modes were computed and what was dropped."""
        return None if self.built is None else self.built.solution

    @property
    def title(self) -> str:
        """Name and pose, such as "Saw at X 800 mm"."""
        pose = ", ".join(f"{axis} {1e3 * position:.6g} mm" for axis, position in self.pose.items())
        return f"{self.name} at {pose}" if pose else self.name


def info_of_model(
    name: str,
    note: str,
    built: Built,
    step: float,
    friction: Mapping[str, FrictionParameters] | None = None,
    warnings: Sequence[Finding] = (),
) -> MachineInfo:
    """All figures of a machine whose structure was built; `warnings` beside those of the build."""
    assembly, solution = built.assembly, built.solution
    return MachineInfo(
        name=name,
        note=note,
        pose=assembly.pose,
        axes=axis_infos(solution.modes, assembly.axes, step, friction, (assembly, solution.shapes)),
        step=step,
        total_mass=math.nan if assembly.geometry is None else float(translating_mass(assembly)[0]),
        modes=solution.modes,
        moving=tuple(str(motion) for motion in solution.moving),
        built=built,
        warnings=(*built.warnings, *warnings),
    )


def info_of_table(
    name: str,
    note: str,
    modes: Modes,
    pose: Mapping[str, float],
    step: float,
    friction: Mapping[str, FrictionParameters] | None = None,
) -> MachineInfo:
    """The figures that a table of modes gives by itself."""
    return MachineInfo(
        name=name,
        note=note,
        pose=pose,
        axes=axis_infos(modes, modes.axes, step, friction),
        step=step,
        total_mass=math.nan,
        modes=modes,
        moving=("",) * len(modes.frequency),
        built=None,
        warnings=(),
    )
