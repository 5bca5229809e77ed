"""What fills an axis of a machine: drive, friction, guide, transmission, units of other makers.

Names of parameters are those of the FMI units; every value is SI.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import (
    Field,
    StrictBool,
    StrictInt,
    ValidationInfo,
    create_model,
    field_validator,
    model_validator,
)

from feedsim.files.fields import Model, Quantity, ReadingContext, brief, fault, parameter
from feedsim.foundation import units
from feedsim.scenario.roles import (
    ANOTHER_LAW,
    DRIVE,
    FRICTION_ROLE,
    FRICTION_UNITS,
    GMS,
    LUGRE,
    ForeignUnit,
    role_unit_tag,
    signal_mapping,
)

# --- Parameters of a unit in groups, as machine files have them; groups that follow from the unit's table alone -------
# May use: fields, variables. Start reading at effects().


Parameter = float | int | bool | str
_KINDS: dict[str, Any] = {"REAL": float, "INTEGER": StrictInt, "BOOLEAN": StrictBool}


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


def effects(unit: str, groups: Mapping[str, str]) -> type[ParameterGroup]:
    """A model whose fields are groups of parameters of `unit`, name -> description: each with all that the unit's table
    declares of it, at its start value where a file does not give it. A group that is not given is None."""
    fields: dict[str, Any] = {
        name: (group(unit, name, text) | None, Field(default=None, description=text)) for name, text in groups.items()
    }
    globals()["Effects"] = create_model("Effects", __base__=ParameterGroup, __module__=__name__, **fields)
    model: type[ParameterGroup] = globals()["Effects"]
    return model


def group(unit: str, name: str, text: str) -> Any:
    """A model of one group of parameters of `unit`, as :func:`effects` has them."""
    rows = {
        key.removeprefix(f"{name}."): row for key, row in units.parameters(unit).items() if key.startswith(f"{name}.")
    }
    fields: dict[str, Any] = {
        key: (_KINDS[row.kind], parameter(row, bool(row.start) if row.kind == "BOOLEAN" else row.start))
        for key, row in rows.items()
    }
    title = name.title().replace("_", "")
    # A scenario is sent to other processes, where a class is looked up by its name.
    globals()[title] = create_model(title, __base__=ParameterGroup, __module__=__name__, __doc__=f"{text}.", **fields)
    return globals()[title]


# --- What fills an axis of a machine: drive, friction, guide, transmission, units of other makers ---------------------


FilterType = Literal["off", "second_order", "band_stop", "low_pass"]
FILTER_TYPES: dict[str, int] = {"off": 0, "second_order": 1, "band_stop": 1, "low_pass": 2}


# What a friction file must give; and what the friction is without, where it does not give it: no effect. Any other
# parameter of the unit is held at its start value then.
_FRICTION_NEEDED = ("sigma_0", "sigma_1", "sigma_2", "F_C", "F_S", "v_s")
_FRICTION_WITHOUT = {"F_log": 0.0, "W": 0.0, "gamma": 1.0}
_PARAMETERS_BY_LAW = {
    LUGRE: units.parameters(FRICTION_ROLE.shipped),
    **{law: units.parameters(unit) for law, unit in FRICTION_UNITS.items()},
}
_NAMES_OF_LAWS = {name for names in _PARAMETERS_BY_LAW.values() for name in names}
# Over position and with warmth friction changes at the guide alone, which may take all of the axis's friction.
_AT_GUIDE_ALONE = [
    name.removeprefix("guide.") for name in units.parameters("plant/axis")
    if name.startswith(("guide.place_", "guide.warm_"))
]  # fmt: skip
_IDENTIFIED_DESCRIPTION = (
    "Where the parameters come from, as feedsim identify friction writes it: kept and shown, never calculated with. "
    "Its keys are free, but names of parameters are refused: they would have no effect here"
)


class FrictionParameters(ParameterGroup):
    """Friction of an axis on the motor side, by any law of the shipped units: the same torque over speed."""

    if TYPE_CHECKING:
        law: ClassVar[str]
        identified: dict[str, Any]

        def __getattr__(self, parameter: str) -> float: ...

    @model_validator(mode="before")
    @classmethod
    def _of_one_law(cls, data: Any) -> Any:
        """Values of one law say nothing of another: sigma_0 acts at once in one, on a share of the bristles in
        another."""
        if not isinstance(data, Mapping):
            return data
        law = data.get("law", LUGRE)
        if law not in [*_PARAMETERS_BY_LAW]:
            allowed = ", ".join(_PARAMETERS_BY_LAW)
            raise fault(f"{brief(law)} is no friction law; allowed: {allowed}", beside=("friction", "law"))
        if law != getattr(cls, "law", law):  # a file that is read for what has one law alone
            raise fault(f"{law} is not taken here; allowed: {cls.law}", beside=("law",))
        own = _PARAMETERS_BY_LAW[law]
        other = [name for name in data if name not in own and name in _NAMES_OF_LAWS]
        if other:
            instead = [name for name in own if any(name not in names for names in _PARAMETERS_BY_LAW.values())]
            raise fault(
                f"the law {law} has no {', '.join(other)}, but {', '.join(instead)}; another law needs the whole group "
                f"anew, friction: {{law: {law}, {', '.join(f'{name}: ...' for name in _FRICTION_NEEDED)}}} at least",
                beside=("friction", "law" if "law" in data else other[0]),
            )
        # A file may say LuGre as any other law.
        return {key: value for key, value in data.items() if key != "law"} if law == LUGRE else data

    @field_validator("identified", check_fields=False)
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
        return {name: value for name, value in values.items() if name not in ("identified", "law")}

    @field_validator("F_S", check_fields=False)
    @classmethod
    def _static_at_least_coulomb(cls, F_S: float, info: ValidationInfo) -> float:
        F_C = info.data.get("F_C")
        if F_C is not None and F_S < F_C:
            raise fault(
                f"F_S {F_S:.9g} N.m is smaller than F_C {F_C:.9g} N.m; static friction is at least Coulomb friction"
            )
        return F_S


class _Friction(FrictionParameters):
    """Friction of an axis on the motor side: LuGre with the transmission engaging model (Eqs. 1-7)."""

    law: ClassVar[str] = LUGRE
    ELSEWHERE: ClassVar[dict[str, str]] = {
        name: f"guide of the axis, guide: {{share: 100 %, {name}: ...}}" for name in _AT_GUIDE_ALONE
    }


class _GmsFriction(FrictionParameters):
    """Friction of an axis on the motor side: generalised Maxwell slip."""

    TOLD_BY: ClassVar[str] = "law"
    BUT_FOR: ClassVar[tuple[str, ...]] = (LUGRE,)
    not_shown: ClassVar[tuple[str, ...]] = ("c", "lambda")  # it has no engaging zone


def _friction_fields(unit: str) -> dict[str, Any]:
    """The parameters of a friction unit, each with how it is checked, and where they come from."""
    known = units.parameters(unit)
    defaults = dict.fromkeys(_FRICTION_NEEDED, ...) | _FRICTION_WITHOUT
    fields = {
        name: (float, parameter(variable, defaults.get(name, float(variable.start))))
        for name, variable in known.items()
    }
    return {**fields, "identified": (dict[str, Any], Field(default={}, description=_IDENTIFIED_DESCRIPTION))}


if TYPE_CHECKING:
    Friction = _Friction
    GmsFriction = _GmsFriction
else:
    Friction = create_model(
        "Friction", __base__=_Friction, __module__=__name__, __doc__=_Friction.__doc__,
        **_friction_fields("friction"),
    )  # fmt: skip
    GmsFriction = create_model(
        "GmsFriction", __base__=_GmsFriction, __module__=__name__, __doc__=_GmsFriction.__doc__,
        law=(
            Literal[GMS],
            Field(description="Law of the friction; without it LuGre"),
        ),
        **_friction_fields(FRICTION_UNITS[GMS]),
    )  # fmt: skip


def friction_filled(data: Any) -> str:
    """Which friction stands there, as the tag of a pydantic union: the shipped LuGre, another law or another unit."""
    law = data.get("law", LUGRE) if isinstance(data, Mapping) else getattr(data, "law", LUGRE)
    return role_unit_tag(data) if law == LUGRE else ANOTHER_LAW


CONTROLLER_TABLE = units.parameters("controller")


def _drive(name: str, default: Any = ...) -> Any:
    """The field of a parameter of the unit `controller`."""
    return parameter(CONTROLLER_TABLE[name], default)


def _filter(name: str) -> Any:
    """The field of a parameter that each of the four filters has."""
    variable = CONTROLLER_TABLE[f"filter_1.{name}"]
    text = variable.text.removeprefix("Filter 1: ")
    return parameter(variable, None, text=text[:1].upper() + text[1:])


class Filter(ParameterGroup):
    """A current setpoint filter."""

    type: FilterType = Field(default="off", description="off, second_order (band_stop is the same) or low_pass")
    f: float | None = _filter("f")
    D_num: float | None = _filter("D_num")
    D_den: float | None = _filter("D_den")

    @field_validator("f", "D_num", "D_den")
    @classmethod
    def _check_sampling(cls, value: float | None, info: ValidationInfo) -> float | None:
        kind = info.data.get("type", "off")
        if value is None and kind != "off" and not (kind == "low_pass" and info.field_name == "D_num"):
            raise fault(f"a filter of type {kind} needs {info.field_name}")
        cycle = info.context.control_cycle if isinstance(info.context, ReadingContext) else None
        if info.field_name == "f" and value is not None and kind != "off" and cycle and value >= 0.5 / cycle:
            raise fault(
                f"{value:.9g} Hz is not below half the sampling rate of the control cycle, {0.5 / cycle:.9g} Hz"
            )
        return value

    def parameters(self) -> dict[str, Parameter]:
        return super().parameters() | {"type": FILTER_TYPES[self.type]}


class CurrentController(ParameterGroup):
    """PI current controller, the same on both axes of the rotor frame."""

    K_p: float = _drive("current.K_p")
    T_n: float = _drive("current.T_n")


# What a real drive has besides, off where it is not given: groups of the unit's table, and what shows them in results.
EFFECTS = {
    **{f"cogging_{i}": f"Cogging torque {i} of the motor" for i in (1, 2, 3)},
    **{f"ripple_{i}": f"Torque ripple {i} of the motor" for i in (1, 2, 3)},
    "measuring": "Position measuring system: which one, and its errors",
    **{f"periodic_error_{i}": f"Periodic error {i} of the measured position" for i in (1, 2, 3)},
    "measuring_table": "Error of the measured position over position",
    "encoder": "Eccentricity of the motor encoder",
    "backlash_compensation": "Backlash compensation of the control",
    "leadscrew_compensation": "Leadscrew error compensation of the control",
    "leadscrew_compensation_minus": "Leadscrew error compensation in the negative direction",
    "friction_pulse": "Friction compensation by a pulse on the speed setpoint",
    "friction_table": "Friction compensation by a torque over the commanded speed",
}
_MEASURING_KEYS = ("measuring", *(f"periodic_error_{i}" for i in (1, 2, 3)), "measuring_table", "encoder")

if TYPE_CHECKING:
    _Effects = ParameterGroup
else:
    _Effects = effects("controller", EFFECTS)


class Drive(_Effects):
    """Position, speed and current control of an axis with its synchronous motor."""

    @property
    def not_shown(self) -> tuple[str, ...]:
        """Outputs that say nothing that another one does not say: the measured position, where that is x_a."""
        return () if any(getattr(self, name) is not None for name in _MEASURING_KEYS) else ("x_m",)

    @property
    def indirect(self) -> bool:
        """Whether the position is that of the motor encoder."""
        measuring = getattr(self, "measuring", None)
        return measuring is not None and bool(measuring.indirect)

    # position loop
    K_v: float = _drive("K_v")
    k_ffw: float = _drive("k_ffw", 1.0)
    T_dyn: float = _drive("T_dyn", 0.0)
    T_sym: float = _drive("T_sym")
    symmetry_lag: StrictBool = _drive("symmetry_lag", False)
    ramp_speed_setpoint: StrictBool = _drive("ramp_speed_setpoint", True)
    setpoint_resolution: float = _drive("setpoint_resolution", 1e-7)

    # speed loop
    K_p: float = _drive("K_p")
    speed_integrator: StrictBool = _drive("speed_integrator", True)
    T_n: float | None = _drive("T_n", None)
    speed_window: StrictInt = _drive("speed_window", 0)
    reference_model: StrictBool = _drive("reference_model", True)
    omega_0: float | None = _drive("omega_0", None)
    D: float | None = _drive("D", None)
    T_ref: float = _drive("T_ref", 0.0)
    M_max: float = _drive("M_max")

    # current setpoint filters, in series
    filter_1: Filter = Field(default=Filter.model_construct(), description="Current setpoint filter 1")
    filter_2: Filter = Field(default=Filter.model_construct(), description="Current setpoint filter 2")
    filter_3: Filter = Field(default=Filter.model_construct(), description="Current setpoint filter 3")
    filter_4: Filter = Field(default=Filter.model_construct(), description="Current setpoint filter 4")

    # current loop and motor
    ideal_current_loop: StrictBool = _drive("ideal_current_loop", False)
    current: CurrentController | None = Field(default=None, validate_default=True, description="Current controller")
    u_max: float | None = _drive("u_max", None)
    R: float | None = _drive("R", None)
    L_d: float | None = _drive("L_d", None)
    L_q: float | None = _drive("L_q", None)
    p: StrictInt | None = _drive("p", None)
    K_t: float = _drive("K_t")

    @field_validator("T_n", "omega_0", "D", "current", "u_max", "R", "L_d", "L_q", "p")
    @classmethod
    def _check_needed_value(cls, value: object, info: ValidationInfo) -> object:
        name = info.field_name or ""
        switch, used = _SWITCHES.get(name, ("ideal_current_loop", False))
        if value is None and info.data.get(switch, not used) is used:
            raise fault(f"missing key {name!r}; needed as long as {switch} is {str(used).lower()}")
        return value


_SWITCHES = {"T_n": ("speed_integrator", True), "omega_0": ("reference_model", True), "D": ("reference_model", True)}


if TYPE_CHECKING:

    class _GuideParameters(ParameterGroup):
        F_C: float
        F_S: float

else:
    _GuideParameters = group("plant/axis", "guide", "Friction between slide and rail")


if TYPE_CHECKING:
    Hysteresis = ParameterGroup

    class _TransmissionParameters(ParameterGroup):
        stiffness: float
        damping: float
        play: float
        inertia: float

else:
    Hysteresis = group("plant/axis", "hysteresis", "Elastic hysteresis between motor and slide")
    _TransmissionParameters = group("plant/axis", "transmission", "Contact between motor and structure")


class Transmission(_TransmissionParameters):
    """A contact with stiffness, damping and play between a motor and what it drives."""

    @field_validator("damping", "play", check_fields=False)
    @classmethod
    def _stiff(cls, value: float, info: ValidationInfo) -> float:
        if value > 0 and not info.data.get("stiffness", True):
            raise fault("stiffness is missing: without it the motor is joined rigidly, without play")
        return value


class Guide(_GuideParameters):
    """Friction between slide and rail: a share of the axis's friction, or a law of its own in N and m/s; over position
    and with warmth it may change."""

    share: Annotated[float, Quantity("1", minimum=0, maximum=1, example="30 %")] | None = Field(
        default=None, description="Share of the axis's friction that acts at the guide; the rest stays at the motor"
    )

    @field_validator("share")
    @classmethod
    def _check_share_alone(cls, share: float | None, info: ValidationInfo) -> float | None:
        if share is not None and info.data:
            given = [
                name for name in info.data if name in LEAD_POWERS and info.data[name] != cls.model_fields[name].default
            ]
            if given:
                raise fault(f"share goes together with no parameter of its own; {given[0]} is given besides")
        return share

    @field_validator("F_S", check_fields=False)
    @classmethod
    def _static_at_least_coulomb(cls, F_S: float, info: ValidationInfo) -> float:
        F_C = info.data.get("F_C", 0.0)
        if F_S < F_C or (F_S > 0 and F_C <= 0):
            raise fault(
                f"F_S {F_S:.9g} N is smaller than F_C {F_C:.9g} N, or F_C is missing; static friction is at least "
                "Coulomb friction, which is above 0"
            )
        return F_S


# Powers of the lead I_P by which a parameter of friction is divided on its way from motor to guide.
LEAD_POWERS = {
    "sigma_0": 2, "sigma_1": 2, "sigma_2": 2, "F_C": 1, "F_S": 1, "F_log": 1, "v_s": -1, "v_log": -1, "W": -1,
    "beta": 0, "asymmetry": 0, "gamma": 0,
}  # fmt: skip
SHARED_WITH_GUIDE = ("sigma_0", "sigma_1", "sigma_2", "F_C", "F_S", "F_log")


class ForeignDrive(ForeignUnit):
    """Another maker's unit as drive of an axis."""

    role = DRIVE
    shipped = Drive
    inputs: signal_mapping("DriveInputs", DRIVE.inputs)  # type: ignore[valid-type]
    outputs: signal_mapping("DriveOutputs", DRIVE.outputs)  # type: ignore[valid-type]


class ForeignFriction(ForeignUnit):
    """Another maker's unit as friction of an axis."""

    role = FRICTION_ROLE
    shipped = Friction
    inputs: signal_mapping("FrictionInputs", FRICTION_ROLE.inputs)  # type: ignore[valid-type]
    outputs: signal_mapping("FrictionOutputs", FRICTION_ROLE.outputs)  # type: ignore[valid-type]
