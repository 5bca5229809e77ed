"""A machine: structure data, cycles, path limits, and per axis its drive and friction. Names of drive and friction
parameters are those of the FMI units; every value is SI."""

from __future__ import annotations

from math import pi
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import numpy as np
from pydantic import (
    Discriminator,
    Field,
    PrivateAttr,
    StrictStr,
    Tag,
    ValidationInfo,
    field_validator,
)

from feedsim.files.fields import AxisName, Content, File, Model, Quantity, fault, is_multiple, parameter
from feedsim.foundation import units
from feedsim.foundation.errors import InputError
from feedsim.motions.planner import Limits
from feedsim.scenario.axis_units import (
    CONTROLLER_TABLE,
    LEAD_POWERS,
    SHARED_WITH_GUIDE,
    Drive,
    ForeignDrive,
    ForeignFriction,
    Friction,
    FrictionParameters,
    GmsFriction,
    Guide,
    Hysteresis,
    Parameter,
    ParameterGroup,
    Transmission,
    friction_filled,
    group,
)
from feedsim.scenario.roles import ANOTHER_LAW, FOREIGN, SHIPPED, ForeignUnit, role_unit_tag


class Axis(Model):
    """A feed axis: rotor, ball screw and slide as the control sees them."""

    pitch: Annotated[float, Quantity("m", minimum=1e-8, example="20 mm")] = Field(description="Travel per motor turn")
    travel: tuple[
        Annotated[float, Quantity("m", example="0 mm")], Annotated[float, Quantity("m", example="685 mm")]
    ] = Field(description="Lowest and highest position")
    max_speed: Annotated[float, Quantity("m/s", above=0, example="30 m/min")] = Field(description="Highest axis speed")
    max_acceleration: Annotated[float, Quantity("m/s^2", above=0)] = Field(description="Highest axis acceleration")
    max_jerk: Annotated[float, Quantity("m/s^3", above=0)] | None = Field(
        default=None, description="Highest axis jerk, in NC programs; without it that of the path"
    )
    limits_from: StrictStr = Field(
        default="", description="Where travel, speed and acceleration come from; messages on these limits say it"
    )
    constant_load: Annotated[float, Quantity("N.m", example="0 N.m")] = Field(
        default=0.0,
        description="Constant load torque M_0, counted against the motor torque (weight on a vertical axis)",
    )
    play: Annotated[float, Quantity("m", minimum=0, maximum=1, example="10 um")] = Field(
        default=0.0, description="Play between motor and slide, without dynamics; for axes measured indirectly"
    )
    hysteresis: Hysteresis | None = Field(
        default=None, description="Elastic hysteresis between motor and slide, without dynamics"
    )
    transmission: Transmission | None = Field(
        default=None, description="Contact with stiffness, damping and play between motor and structure"
    )
    guide: Guide | None = Field(default=None, description="Friction between slide and rail, beside that at the motor")
    display_sign: Literal[1, -1] = Field(default=1, description="Sign of torque and current in figures, nowhere else")
    drive: Annotated[
        Annotated[Drive, Tag(SHIPPED)] | Annotated[ForeignDrive, Tag(FOREIGN)], Discriminator(role_unit_tag)
    ] = Field(description="Parameters of the shipped drive, or another unit (fmu) with its variables")
    friction: Annotated[
        Annotated[Friction, Tag(SHIPPED)]
        | Annotated[GmsFriction, Tag(ANOTHER_LAW)]
        | Annotated[ForeignFriction, Tag(FOREIGN)],
        Discriminator(friction_filled),
    ] = Field(
        description="Parameters of the shipped friction (law: gms for generalised Maxwell slip), or another unit (fmu) "
        "with its variables"
    )

    @field_validator("travel")
    @classmethod
    def _low_before_high(cls, travel: tuple[float, float]) -> tuple[float, float]:
        if travel[0] >= travel[1]:
            raise fault(f"the lowest position {travel[0]:.9g} m is not below the highest, {travel[1]:.9g} m")
        return travel

    @field_validator("friction")
    @classmethod
    def _shared_with_the_guide(cls, friction: Model, info: ValidationInfo) -> Model:
        guide = info.data.get("guide")
        if guide is not None and guide.share and isinstance(friction, GmsFriction):
            raise fault(
                "guide.share gives a share of the axis's friction to the guide, whose law is LuGre; this friction has "
                f"the law {friction.law}: give the guide parameters of its own"
            )
        return friction

    @property
    def I_P(self) -> float:
        """Lead, pitch / (2 pi) [m/rad]."""
        return self.pitch / (2 * pi)

    @property
    def friction_at_motor(self) -> dict[str, Parameter]:
        """Parameters of the shipped friction unit: those of the axis, without what is at the guide."""
        assert isinstance(self.friction, FrictionParameters)
        values = self.friction.parameters()
        share = self.guide.share if self.guide is not None else None
        if share is None:
            return values
        least = {name: variable.minimum for name, variable in units.parameters("friction").items()}
        return values | {name: max(float(values[name]) * (1 - share), least[name]) for name in SHARED_WITH_GUIDE}

    @property
    def friction_at_guide(self) -> dict[str, Parameter]:
        """Parameters of the plant's group `guide`; empty without friction there.

        A share of friction in N.m and rad at a lead I_P [m/rad] is friction in N and m: forces F = M/I_P, stiffness
        and damping over I_P^2, angles and their speeds times I_P; its torque at constant speed is F I_P again.
        """
        if self.guide is None:
            return {}
        if self.guide.share is None:
            return {name: value for name, value in self.guide.parameters().items() if name != "share"}
        if not isinstance(self.friction, Friction) or self.guide.share == 0:
            return {}
        own = {name: float(value) for name, value in self.friction.parameters().items()}
        factor = {name: self.guide.share if name in SHARED_WITH_GUIDE else 1.0 for name in LEAD_POWERS}
        law = {name: own[name] * factor[name] / self.I_P**power for name, power in LEAD_POWERS.items()}
        rest = {name: value for name, value in self.guide.parameters().items() if name not in ("share", *law)}
        return {**law, **rest}

    @property
    def M_0(self) -> float:
        """Constant load torque [N.m]."""
        return self.constant_load


class Cycles(Model):
    """Cycle times, each a whole multiple of the one before."""

    control: float = parameter(CONTROLLER_TABLE["T_c"], text="Cycle of the current and speed controllers, T_c")
    position: float = parameter(
        CONTROLLER_TABLE["T_pos"], text="Cycle of the position controller, T_pos; a whole multiple of the control cycle"
    )
    interpolation: Annotated[float, Quantity("s", minimum=1e-6, maximum=1, example="2 ms")] = Field(
        description="Cycle of the interpolator, T_ipo; a whole multiple of the position cycle"
    )

    @field_validator("position", "interpolation")
    @classmethod
    def _whole_multiple(cls, value: float, info: ValidationInfo) -> float:
        below = {"position": "control", "interpolation": "position"}[str(info.field_name)]
        step = info.data.get(below)
        if step is not None and not is_multiple(value, step):
            raise fault(f"{value:.9g} s is no whole multiple of the {below} cycle, {step:.9g} s")
        return value

    @property
    def T_c(self) -> float:
        """Cycle of the current and speed controllers [s]."""
        return self.control

    @property
    def T_pos(self) -> float:
        """Cycle of the position controller [s]."""
        return self.position

    @property
    def T_ipo(self) -> float:
        """Cycle of the interpolator [s]."""
        return self.interpolation


class PathLimits(Model):
    """Limits along the path."""

    jerk: Annotated[float, Quantity("m/s^3", above=0)] = Field(description="Highest jerk along the path")
    acceleration: Annotated[float, Quantity("m/s^2", above=0)] = Field(
        description="Highest acceleration along the path"
    )


if TYPE_CHECKING:
    Geometry = ParameterGroup
    MountFactors = ParameterGroup
else:
    Geometry = group("plant", "geometry", "Errors of the guides at the tool, zero where the axes start")
    MountFactors = group("plant", "mounts", "Factors on all mounts that are not linear")


class Mounts(MountFactors):
    """Levelling mounts that are not linear: their table, and factors on all of them."""

    table: File = Field(description="Table of these mounts (CSV, feedsim machine build writes it)")

    def parameters(self) -> dict[str, Parameter]:
        """The factors, as :meth:`ParameterGroup.parameters`."""
        return {name: value for name, value in super().parameters().items() if name != "table"}


class Machine(Model):
    """A machine: structure data, pose, cycles, path limits and axes.

    >>> import feedsim as fs
    >>> machine: fs.Machine = fs.load("xz_circle.yaml").machine
    >>> machine
    Machine 'Test centre': axes X, Y, Z
    """

    def __repr__(self) -> str:
        return f"Machine {self.name!r}: axes {', '.join(self.axes)}"

    __str__ = __repr__

    IN_FOLDER: ClassVar[str] = "machine.yaml"

    name: StrictStr = Field(description="Name in reports")
    note: StrictStr = Field(default="", description="Remark shown wherever the machine's numbers are shown")
    control: Literal["sinumerik", "twincat", "heidenhain", "linuxcnc"] | None = Field(
        default=None, description="Control that the machine has; reports show parameters in its names and units, too"
    )
    modes: Content = Field(description="Table of the structure's modes (CSV), relative to this file")
    structure: File | None = Field(
        default=None, description="Structure file that the modes were computed from (feedsim machine build)"
    )
    plant: File | None = Field(
        default=None, description="Plant archive packed for this machine, in place of fmus/plant.fmu"
    )
    pose: dict[AxisName, Annotated[float, Quantity("m", example="800 mm")]] = Field(
        description="Axis positions at the start, to which the modes belong"
    )
    cycles: Cycles
    path: PathLimits
    axes: Annotated[dict[AxisName, Axis], Field(min_length=1)] = Field(
        description="Feed axes in the order of the plant"
    )

    geometry: Geometry | None = Field(default=None, description="Errors of the guides at the tool")
    mounts: Mounts | None = Field(
        default=None, description="Levelling mounts that are not linear; none: the springs of the modes"
    )

    _directory: Path = PrivateAttr(default=Path())
    _files: tuple[tuple[str, Path], ...] = PrivateAttr(default=())

    @property
    def directory(self) -> Path:
        """Folder of the machine file."""
        return self._directory

    @property
    def files(self) -> tuple[tuple[str, Path], ...]:
        """YAML files that it was read from, each with the first key that it gives; "" for the machine file. Empty where
        it was read as part of a scenario, which has them."""
        return self._files

    @property
    def program_limits(self) -> Limits:
        """What NC programs are planned within: those of the axes and of the path, on the cycle of the interpolator."""
        axes = self.axes.values()
        return Limits(
            tuple(self.axes),
            np.array([axis.max_speed for axis in axes]),
            np.array([axis.max_acceleration for axis in axes]),
            np.array([axis.max_jerk or self.path.jerk for axis in axes]),
            self.cycles.T_ipo,
            path_acceleration=self.path.acceleration,
            path_jerk=self.path.jerk,
        )

    @property
    def errors(self) -> dict[str, Parameter]:
        """Parameters of the plant for play, hysteresis, transmissions, friction at the guides, geometry and mounts, as
        far as there are any."""
        play: dict[str, Parameter] = {f"{name}.play": axis.play for name, axis in self.axes.items() if axis.play}
        for name, axis in self.axes.items():
            wound = axis.hysteresis.parameters() if axis.hysteresis is not None else {}
            play |= {f"{name}.hysteresis.{key}": value for key, value in wound.items()}
            joined = axis.transmission.parameters() if axis.transmission is not None else {}
            play |= {f"{name}.transmission.{key}": value for key, value in joined.items()}
            play |= {f"{name}.guide.{key}": value for key, value in axis.friction_at_guide.items()}
        geometry = self.geometry.parameters() if self.geometry is not None else {}
        mounts = self.mounts.parameters() if self.mounts is not None else {}
        return (
            play
            | {f"geometry.{name}": value for name, value in geometry.items()}
            | {f"mounts.{name}": value for name, value in mounts.items()}
        )

    @property
    def mounts_table(self) -> Path | None:
        """Table of the mounts that are not linear; None where all are springs."""
        return self.mounts.table if self.mounts is not None else None

    def shipped_drive(self, axis: str, who: str) -> Drive:
        """The parameters of an axis's drive, which `who` needs. InputError: it is another maker's unit."""
        drive = self.axes[axis].drive
        if isinstance(drive, ForeignUnit):
            raise InputError(_foreign_unit_message(axis, drive, who))
        return drive

    @property
    def foreign_units(self) -> list[tuple[str, ForeignUnit]]:
        """Axis and unit of every role that another maker's unit fills."""
        return [
            (name, unit) for name, axis in self.axes.items() for unit in (axis.drive, axis.friction)
            if isinstance(unit, ForeignUnit)
        ]  # fmt: skip

    @property
    def shipped_frictions(self) -> dict[str, FrictionParameters]:
        """Axis -> parameters of its friction, where that is a shipped unit."""
        return {
            name: axis.friction for name, axis in self.axes.items() if isinstance(axis.friction, FrictionParameters)
        }

    def friction_of(self, axis: str, who: str) -> FrictionParameters:
        """The parameters of an axis's friction, of whatever law. InputError: as :meth:`shipped_drive`."""
        friction = self.axes[axis].friction
        if isinstance(friction, ForeignUnit):
            raise InputError(_foreign_unit_message(axis, friction, who))
        return friction

    def shipped_friction(self, axis: str, who: str) -> Friction:
        """Those of LuGre. InputError: as :meth:`friction_of`, and of another law."""
        friction = self.friction_of(axis, who)
        if not isinstance(friction, Friction):
            raise InputError(f"axis {axis}: its friction has the law {friction.law}; {who} needs LuGre (law: lugre)")
        return friction

    @property
    def guided(self) -> list[str]:
        """Axes with friction at the guide."""
        return [name for name, axis in self.axes.items() if axis.friction_at_guide.get("F_S")]

    @property
    def transmitted(self) -> list[str]:
        """Axes whose motor is joined to the structure by a transmission."""
        return [name for name, axis in self.axes.items() if axis.transmission and axis.transmission.stiffness > 0]

    @field_validator("axes")
    @classmethod
    def _pose_within_travel(cls, axes: dict[str, Axis], info: ValidationInfo) -> dict[str, Axis]:
        pose = info.data.get("pose")
        if pose is None:
            return axes
        if missing := [name for name in axes if name not in pose]:
            raise fault(f"the pose lacks the position of axis {missing[0]}", beside=("pose",))
        if extra := [name for name in pose if name not in axes]:
            message = f"the pose names {extra[0]!r}, which is no axis; axes are {', '.join(axes)}"
            raise fault(message, beside=("pose", extra[0]))
        for name, axis in axes.items():
            low, high = axis.travel
            if not low <= pose[name] <= high:
                message = f"the pose of {name}, {pose[name]:.9g} m, is outside its travel, {low:.9g} to {high:.9g} m"
                raise fault(message, beside=("pose", name))
        return axes


def _foreign_unit_message(axis: str, unit: ForeignUnit, who: str) -> str:
    return (
        f"axis {axis}: its {unit.role.name} is {unit.fmu.name}, a unit of another maker; {who} needs the law of the "
        f"shipped {unit.role.shipped}.fmu with its parameters"
    )
