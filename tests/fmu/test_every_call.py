"""Every function in every state, on the built libraries: what the standard allows works, what it does not allow is
refused with a message and changes nothing, and nothing crashes."""

import ctypes
import math
import random
from collections.abc import Callable
from ctypes import byref, c_char_p, c_double, c_int, c_size_t, c_void_p
from typing import Any

import pytest

from fmu.apart import apart
from fmu.binary import (
    ARGUMENTS,
    DISCARD,
    DO_STEP_STATUS,
    ERROR,
    LAST_SUCCESSFUL_TIME,
    OK,
    PENDING_STATUS,
    TERMINATED,
    Slave,
    load,
    of,
    reals,
    references,
)
from fmu.standard_calls import ALLOWED, STATES, allowed
from fmu.unpacked import Archive

H = 125e-6
# 'step complete' ahead of the first step and behind it: the first step may not be what makes a function work.
PLACES = ("instantiated", "initialization mode", "step complete", "step complete (stepped)", "terminated", "error")


def state_of(place: str) -> str:
    return place.partition(" (")[0]


def overflow(slave: Slave) -> bool:
    """Make a step fail on its way: finite inputs, results that are not. False where there is no input to do it with."""
    inputs = list(of(slave.archive, "input").values())
    if not inputs:
        return False
    status, rng = OK, random.Random(1)
    for k in range(100):
        slave.set(inputs, [rng.choice((-1.7e308, 1.7e308)) for _ in inputs])
        status = slave.call("fmi2DoStep", (1 + k) * H, H, 1)
        if status != OK:
            break
    assert status == ERROR
    assert slave.last.startswith("fmi2DoStep (t = ")
    assert "finite" in slave.last
    return True


def bring(archive: Archive, place: str) -> Slave | None:
    """A new instance in that state; None where the unit cannot be brought there."""
    slave = Slave(archive)
    assert slave.component, slave.last
    if place == "instantiated":
        return slave
    if place == "error" and archive.unit in ("friction", "friction_gms"):
        slave.set([of(archive, "parameter")["sigma_2"]], [1e300])  # its torque is finite for any speed without
    slave.set_up()
    if place == "initialization mode":
        return slave
    slave.must("fmi2ExitInitializationMode")
    if place == "step complete":
        return slave
    slave.step(0.0, H)
    if place == "terminated":
        slave.must("fmi2Terminate")
    if place == "error" and not overflow(slave):
        slave.free()
        return None
    slave.messages.clear()
    return slave


# --- one call of each function, with arguments that are in order

Call = Callable[[Slave, str, str], int]
TYPES: dict[str, Any] = {"Real": c_double, "Integer": c_int, "Boolean": c_int, "String": c_char_p}


def _plain(*arguments: object) -> Call:
    return lambda slave, name, place: slave.call(name, *arguments)


def _status(kind: int, holder: Any) -> Call:
    return lambda slave, name, place: slave.call(name, kind, byref(holder()))


def _get(kind: str) -> Call:
    def call(slave: Slave, name: str, place: str) -> int:
        """All outputs of that kind, which the standard allows wherever it allows any; there may be none."""
        known = list(of(slave.archive, "output", kind).values())
        values = (TYPES[kind] * len(known))()
        status = slave.call(name, references(known), len(known), values)
        finite = kind != "Real" or all(math.isfinite(each) for each in values)
        assert status != OK or finite or place == "error"  # after an error "usable for debugging only"
        return status

    return call


def _set(kind: str) -> Call:
    def call(slave: Slave, name: str, place: str) -> int:
        """Start values of all parameters ahead of the initialisation, of all inputs from it on; there may be none."""
        causality = "parameter" if place == "instantiated" else "input"
        read: Any = {"Real": float, "Integer": int, "Boolean": ["false", "true"].index, "String": str.encode}[kind]
        elements = slave.archive.variables()
        known = of(slave.archive, causality, kind)
        values = (TYPES[kind] * len(known))(*[read(elements[each][0].attrib["start"]) for each in known])
        return slave.call(name, references(list(known.values())), len(known), values)

    return call


def _derivatives(slave: Slave, name: str, place: str) -> int:
    known = list(of(slave.archive, "input" if "Input" in name else "output").values())
    orders = (c_int * len(known))(*[1] * len(known))
    return slave.call(name, references(known), len(known), orders, reals([0.0] * len(known)))


def _directional(slave: Slave, name: str, place: str) -> int:
    known, unknown = (list(of(slave.archive, each).values()) for each in ("input", "output"))
    found, seed = reals([math.nan] * len(unknown)), reals([1.0] * len(known))
    status = slave.call(name, references(unknown), len(unknown), references(known), len(known), seed, found)
    assert status != OK or place == "error" or all(math.isfinite(each) for each in found)
    return status


def _state(slave: Slave, name: str, place: str) -> int:
    """With a state of another instance: the one under test need not be able to make one."""
    donor = Slave(slave.archive).initialized()
    image = donor.state()
    memory = ctypes.create_string_buffer(len(image))
    state, fresh, size = c_void_p(), c_void_p(), c_size_t()
    donor.must("fmi2GetFMUstate", byref(state))
    arguments: dict[str, tuple[Any, ...]] = {
        "fmi2GetFMUstate": (byref(fresh),),
        "fmi2SetFMUstate": (state,),
        "fmi2FreeFMUstate": (byref(state),),
        "fmi2SerializedFMUstateSize": (state, byref(size)),
        "fmi2SerializeFMUstate": (state, memory, len(image)),
        "fmi2DeSerializeFMUstate": (image, len(image), byref(fresh)),
    }
    status = slave.call(name, *arguments[name])
    for each in (state, fresh):
        donor.must("fmi2FreeFMUstate", byref(each))
    donor.free()
    return status


def _step(slave: Slave, name: str, place: str) -> int:
    return slave.call(name, 0.0 if place == "step complete" else H, H, 1)


def _free(slave: Slave, name: str, place: str) -> int:
    slave.free()
    return OK


def _told(slave: Slave, name: str, place: str) -> int:
    assert getattr(slave.library, name)() == {"fmi2GetVersion": b"2.0", "fmi2GetTypesPlatform": b"default"}[name]
    return OK


CALLS: dict[str, Call] = {
    "fmi2GetTypesPlatform": _told,
    "fmi2GetVersion": _told,
    "fmi2SetDebugLogging": _plain(0, 0, None),
    "fmi2FreeInstance": _free,
    "fmi2SetupExperiment": _plain(0, 0.0, 0.0, 0, 0.0),
    "fmi2EnterInitializationMode": _plain(),
    "fmi2ExitInitializationMode": _plain(),
    "fmi2Terminate": _plain(),
    "fmi2Reset": _plain(),
    **{f"fmi2Get{kind}": _get(kind) for kind in TYPES},
    **{f"fmi2Set{kind}": _set(kind) for kind in TYPES},
    **{name: _state for name in ALLOWED if "FMUstate" in name},
    "fmi2GetDirectionalDerivative": _directional,
    "fmi2SetRealInputDerivatives": _derivatives,
    "fmi2GetRealOutputDerivatives": _derivatives,
    "fmi2DoStep": _step,
    "fmi2CancelStep": _plain(),
    "fmi2GetStatus": _status(DO_STEP_STATUS, c_int),
    "fmi2GetRealStatus": _status(LAST_SUCCESSFUL_TIME, c_double),
    "fmi2GetIntegerStatus": _status(DO_STEP_STATUS, c_int),  # FMI 2.0 has no kind that it could tell
    "fmi2GetBooleanStatus": _status(TERMINATED, c_int),
    "fmi2GetStringStatus": _status(PENDING_STATUS, c_char_p),
}


def test_the_table_is_whole(archive: Archive) -> None:
    """Every function that the library exports has its row, but the one that makes an instance."""
    assert set(CALLS) == set(ALLOWED)
    assert set(ARGUMENTS) == set(ALLOWED) - {"fmi2GetTypesPlatform", "fmi2GetVersion", "fmi2FreeInstance"}
    assert len(ALLOWED) == 25 + 9 - 1
    library = load(archive.library)
    assert all(hasattr(library, name) for name in ALLOWED)


def _refused(slave: Slave, name: str, place: str) -> None:
    before = slave.state()
    assert CALLS[name](slave, name, place) == ERROR, f"{name} in '{place}' is not refused"
    (message,) = slave.messages
    assert (message.instance, message.status, message.category) == ("tried", ERROR, "logStatusError")
    assert message.text.startswith(name)
    if ALLOWED[name]:
        refused, _, allowed_in = message.text.partition("; allowed in: ")
        assert f"not allowed in state '{state_of(place)}'" in refused
        assert {each for each in STATES if f"'{each}'" in allowed_in} == {
            each for each in STATES if allowed(name, each)
        }
    else:
        assert "not allowed in any state" in message.text
    assert slave.state() == before, f"{name} in '{place}' is refused and changes something"


def _granted(slave: Slave, name: str, place: str) -> None:
    expected = DISCARD if name == "fmi2GetIntegerStatus" else OK
    assert CALLS[name](slave, name, place) == expected, f"{name} in '{place}': {slave.last}"
    # Nothing is told with logging off, but what the standard wants told: why something was discarded is a warning.
    assert slave.messages == []


def _goes_on(slave: Slave, place: str) -> None:
    """What a refused call must not have spoilt."""
    match state_of(place):
        case "instantiated":
            slave.initialized().step(0.0, H)
        case "initialization mode":
            slave.must("fmi2ExitInitializationMode")
            slave.step(0.0, H)
        case "step complete":
            slave.step(0.0 if place == "step complete" else H, H)
        case _:
            slave.must("fmi2Reset")
            slave.initialized().step(0.0, H)
    slave.get(list(of(slave.archive, "output").values()))


@pytest.mark.parametrize("name", ALLOWED)
@apart
def test_every_function_in_every_state(archive: Archive, name: str) -> None:
    for place in PLACES:
        slave = bring(archive, place)
        if slave is None:
            assert archive.unit == "setpoint", "a unit with inputs can be brought to 'error'"
            continue
        if allowed(name, state_of(place)):
            _granted(slave, name, place)
        else:
            _refused(slave, name, place)
            _goes_on(slave, place)
        if slave.component:
            slave.free()


@apart
def test_without_an_instance(archive: Archive) -> None:
    """NULL for the component: there is nobody to tell, and nothing to crash on."""
    slave = Slave(archive)
    slave.free()
    assert slave.component is None
    for name, call in CALLS.items():
        expected = OK if call in (_told, _free) else ERROR
        assert call(slave, name, "step complete") == expected, name


@apart
def test_an_instance_is_made_whatever_others_are_at(archive: Archive) -> None:
    for place in PLACES:
        slave = bring(archive, place)
        other = Slave(archive).initialized()
        other.step(0.0, H)
        other.free()
        if slave is not None:
            slave.free()
