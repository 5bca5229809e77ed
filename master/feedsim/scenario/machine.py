"""A machine: structure data, cycles, path limits, and per axis its drive and friction. Names of drive and friction
parameters are those of the FMI units; every value is SI."""

from __future__ import annotations

from math import pi
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field, PrivateAttr, StrictBool, StrictInt, StrictStr, ValidationInfo, field_validator

from feedsim.fields import AxisName, File, Model, Quantity, Reading, fault, is_multiple

Parameter = float | int | bool | str
FilterType = Literal["off", "second_order", "band_stop", "low_pass"]
FILTER_TYPES: dict[str, int] = {"off": 0, "second_order": 1, "band_stop": 1, "low_pass": 2}


class ParameterGroup(Model):
    """A group of parameters of an FMI unit, in the unit's names."""

    def parameters(self) -> dict[str, Parameter]:
        """FMU parameter name -> SI value. What is not given (and not needed) is left to the unit's start value."""
        values: dict[str, Parameter] = {}
        for name in type(self).model_fields:
            value = getattr(self, name)
            if isinstance(value, ParameterGroup):
                values |= {f"{name}.{key}": part for key, part in value.parameters().items()}
            elif value is not None:
                values[name] = value
        return values


class Friction(ParameterGroup):
    """Friction of an axis on the motor side: LuGre with the transmission engaging model (Eqs. 1-7)."""

    sigma_0: Annotated[float, Quantity("N.m/rad", minimum=1e-6)] = Field(description="Bristle stiffness")
    sigma_1: Annotated[float, Quantity("N.m.s/rad", minimum=0, example="0.8 N.m.s/rad")] = Field(
        description="Bristle damping"
    )
    sigma_2: Annotated[float, Quantity("N.m.s/rad", minimum=0, example="0.006 N.m.s/rad")] = Field(
        description="Viscous friction coefficient"
    )
    F_C: Annotated[float, Quantity("N.m", minimum=1e-9, example="1.6 N.m")] = Field(
        description="Coulomb friction torque"
    )
    F_S: Annotated[float, Quantity("N.m", minimum=1e-9)] = Field(
        description="Static (break-away) friction torque; at least F_C"
    )
    v_s: Annotated[float, Quantity("rad/s", minimum=1e-9, example="0.6 rad/s")] = Field(description="Stribeck speed")
    beta: Annotated[float, Quantity("1", minimum=0.1, maximum=10, example="1")] = Field(
        default=1.0, description="Stribeck exponent"
    )
    F_log: Annotated[float, Quantity("N.m", minimum=0, example="0.4 N.m")] = Field(
        default=0.0, description="Factor of the logarithmic rise with speed"
    )
    v_log: Annotated[float, Quantity("rad/s", minimum=1e-9, example="3 rad/s")] = Field(
        default=3.0, description="Reference speed of the logarithmic rise"
    )
    asymmetry: Annotated[float, Quantity("1", minimum=-0.9, maximum=0.9, example="5 %")] = Field(
        default=0.0, description="Direction dependence: the static level is multiplied by 1 + asymmetry sgn(n)"
    )
    W: Annotated[float, Quantity("rad", minimum=0)] = Field(
        default=0.0, description="Width of the engaging zone; 0 rad switches the engaging model off (pure LuGre)"
    )
    gamma: Annotated[float, Quantity("1", minimum=0, maximum=1)] = Field(
        default=1.0, description="Share of the bristle stiffness that is engaged at once after a reversal"
    )
    identified: dict[str, Any] = Field(
        default={},
        description="Where the parameters come from, as feedsim identify writes it: kept and shown, never calculated "
        "with. Its keys are free, but names of parameters are refused: they would have no effect here",
    )

    @field_validator("identified")
    @classmethod
    def _no_parameters(cls, identified: dict[str, Any]) -> dict[str, Any]:
        if misplaced := [name for name in identified if name != "identified" and name in cls.model_fields]:
            raise fault(
                f"{misplaced[0]!r} has no effect inside 'identified'; parameters stand beside it, not inside: check "
                "the indentation"
            )
        return identified

    def parameters(self) -> dict[str, Parameter]:
        values = super().parameters()
        del values["identified"]
        return values

    @field_validator("F_S")
    @classmethod
    def _static_at_least_coulomb(cls, F_S: float, info: ValidationInfo) -> float:
        F_C = info.data.get("F_C")
        if F_C is not None and F_S < F_C:
            raise fault(
                f"F_S {F_S:.9g} N.m is smaller than F_C {F_C:.9g} N.m; static friction is at least Coulomb friction"
            )
        return F_S


class Filter(ParameterGroup):
    """A current setpoint filter."""

    type: FilterType = Field(default="off", description="off, second_order (band_stop is the same) or low_pass")
    f: Annotated[float, Quantity("Hz", minimum=1e-3)] | None = Field(
        default=None, description="Characteristic frequency, below half the sampling rate"
    )
    D_num: Annotated[float, Quantity("1", minimum=0, example="0.1")] | None = Field(
        default=None, description="Numerator damping ratio (second_order, band_stop)"
    )
    D_den: Annotated[float, Quantity("1", minimum=1e-6, example="1.0")] | None = Field(
        default=None, description="Denominator damping ratio"
    )

    @field_validator("f", "D_num", "D_den")
    @classmethod
    def _sampled(cls, value: float | None, info: ValidationInfo) -> float | None:
        kind = info.data.get("type", "off")
        if value is None and kind != "off" and not (kind == "low_pass" and info.field_name == "D_num"):
            raise fault(f"a filter of type {kind} needs {info.field_name}")
        cycle = info.context.control_cycle if isinstance(info.context, Reading) else None
        if info.field_name == "f" and value is not None and kind != "off" and cycle and value >= 0.5 / cycle:
            raise fault(
                f"{value:.9g} Hz is not below half the sampling rate of the control cycle, {0.5 / cycle:.9g} Hz"
            )
        return value

    model_config = ConfigDict(validate_default=True)

    def parameters(self) -> dict[str, Parameter]:
        return super().parameters() | {"type": FILTER_TYPES[self.type]}


class CurrentController(ParameterGroup):
    """PI current controller, the same on both axes of the rotor frame."""

    K_p: Annotated[float, Quantity("V/A", minimum=0)] = Field(description="Gain")
    T_n: Annotated[float, Quantity("s", minimum=1e-6, example="11.1 ms")] = Field(description="Integral-action time")


class Drive(ParameterGroup):
    """Position, speed and current control of an axis with its synchronous motor."""

    # position loop
    K_v: Annotated[float, Quantity("1/s", minimum=0)] = Field(description="Position controller gain")
    k_ffw: Annotated[float, Quantity("1", minimum=0, maximum=2, example="100 %")] = Field(
        default=1.0, description="Weight of the speed feedforward"
    )
    T_dyn: Annotated[float, Quantity("s", minimum=0, maximum=1, example="1.326 ms")] = Field(
        default=0.0,
        validate_default=False,  # it has no unit, being no text
        description="Dynamic matching: delay of position setpoint and feedforward alike",
    )
    T_sym: Annotated[float, Quantity("s", minimum=0, maximum=1, example="3.528 ms")] = Field(
        description="Symmetry filter: delay of the position setpoint against the feedforward"
    )
    symmetry_lag: StrictBool = Field(
        default=False, description="Symmetry filter as a first-order lag instead of a dead time"
    )
    ramp_speed_setpoint: StrictBool = Field(
        default=True,
        description="Speed setpoint runs linearly to its new value within the position cycle; false: steps and is held",
    )

    # speed loop
    K_p: Annotated[float, Quantity("N.m.s/rad", minimum=0)] = Field(description="Speed controller gain")
    speed_integrator: StrictBool = Field(
        default=True, description="Integral part of the speed controller; false: P controller"
    )
    T_n: Annotated[float, Quantity("s", minimum=1e-6, example="12 ms")] | None = Field(
        default=None, description="Speed controller integral-action time"
    )
    speed_window: Annotated[StrictInt, Field(ge=0, le=1000)] = Field(
        default=0,
        validate_default=False,
        description="Speed from the measured position, over this many control cycles; 0: the motor speed n_a",
    )
    reference_model: StrictBool = Field(
        default=True, description="Reference model; false: the integrator sees the speed setpoint"
    )
    omega_0: Annotated[float, Quantity("rad/s", minimum=1e-3)] | None = Field(
        default=None, description="Reference model: natural frequency"
    )
    D: Annotated[float, Quantity("1", minimum=0, example="1.214")] | None = Field(
        default=None, description="Reference model: damping ratio"
    )
    T_ref: Annotated[float, Quantity("s", minimum=0, maximum=1, example="0 ms")] = Field(
        default=0.0,
        validate_default=False,  # it has no unit, being no text
        description="Reference model: dead time",
    )
    M_max: Annotated[float, Quantity("N.m", minimum=0, example="80 N.m")] = Field(
        description="Limit of the torque setpoint, both directions"
    )

    # current setpoint filters, in series
    filter_1: Filter = Field(default=Filter(), description="Current setpoint filter 1")
    filter_2: Filter = Field(default=Filter(), description="Current setpoint filter 2")
    filter_3: Filter = Field(default=Filter(), description="Current setpoint filter 3")
    filter_4: Filter = Field(default=Filter(), description="Current setpoint filter 4")

    # current loop and motor
    ideal_current_loop: StrictBool = Field(
        default=False,
        description="The torque takes its setpoint at every sample instant and holds it; no motor equations",
    )
    current: CurrentController | None = Field(default=None, description="Current controller")
    u_max: Annotated[float, Quantity("V", minimum=0)] | None = Field(
        default=None, description="Limit of the voltage amplitude"
    )
    R: Annotated[float, Quantity("Ohm", minimum=0)] | None = Field(default=None, description="Stator resistance")
    L_d: Annotated[float, Quantity("H", minimum=1e-9)] | None = Field(
        default=None, description="Inductance on the d axis"
    )
    L_q: Annotated[float, Quantity("H", minimum=1e-9)] | None = Field(
        default=None, description="Inductance on the q axis"
    )
    p: Annotated[StrictInt, Field(ge=1, le=1000)] | None = Field(default=None, description="Pole pairs")
    K_t: Annotated[float, Quantity("N.m/A", minimum=1e-9)] = Field(description="Torque constant 3/2 p psi")

    model_config = ConfigDict(validate_default=True)

    @field_validator("T_n", "omega_0", "D", "current", "u_max", "R", "L_d", "L_q", "p")
    @classmethod
    def _given_where_used(cls, value: object, info: ValidationInfo) -> object:
        name = info.field_name or ""
        switch, used = _SWITCHES.get(name, ("ideal_current_loop", False))
        if value is None and info.data.get(switch, not used) is used:
            raise fault(f"missing key {name!r}; needed as long as {switch} is {str(used).lower()}")
        return value


_SWITCHES = {"T_n": ("speed_integrator", True), "omega_0": ("reference_model", True), "D": ("reference_model", True)}


class Axis(Model):
    """A feed axis: rotor, ball screw and slide as the control sees them."""

    pitch: Annotated[float, Quantity("m", minimum=1e-8, example="20 mm")] = Field(description="Travel per motor turn")
    travel: tuple[
        Annotated[float, Quantity("m", example="0 mm")], Annotated[float, Quantity("m", example="685 mm")]
    ] = Field(description="Lowest and highest position")
    max_speed: Annotated[float, Quantity("m/s", above=0, example="30 m/min")] = Field(description="Highest axis speed")
    max_acceleration: Annotated[float, Quantity("m/s^2", above=0)] = Field(description="Highest axis acceleration")
    constant_load: Annotated[float, Quantity("N.m", example="0 N.m")] = Field(
        default=0.0,
        description="Constant load torque M_0, counted against the motor torque (weight on a vertical axis)",
    )
    display_sign: Literal[1, -1] = Field(default=1, description="Sign of torque and current in figures, nowhere else")
    drive: Drive
    friction: Friction

    @field_validator("travel")
    @classmethod
    def _low_before_high(cls, travel: tuple[float, float]) -> tuple[float, float]:
        if travel[0] >= travel[1]:
            raise fault(f"the lowest position {travel[0]:.9g} m is not below the highest, {travel[1]:.9g} m")
        return travel

    @property
    def I_P(self) -> float:
        """Lead, pitch / (2 pi) [m/rad]."""
        return self.pitch / (2 * pi)

    @property
    def M_0(self) -> float:
        """Constant load torque [N.m]."""
        return self.constant_load


class Cycles(Model):
    """Cycle times, each a whole multiple of the one before."""

    control: Annotated[float, Quantity("s", minimum=1e-6, maximum=1)] = Field(
        description="Cycle of the current and speed controllers, T_c"
    )
    position: Annotated[float, Quantity("s", minimum=1e-6, maximum=1, example="1 ms")] = Field(
        description="Cycle of the position controller, T_pos; a whole multiple of the control cycle"
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


class Machine(Model):
    """A machine: structure data, pose, cycles, path limits and axes."""

    name: StrictStr = Field(description="Name in reports")
    note: StrictStr = Field(default="", description="Remark shown wherever the machine's numbers are shown")
    modes: File = Field(description="Table of the structure's modes (CSV), relative to this file")
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
