"""Random sequences of legal and illegal calls, against a small model of the standard's state machine: every call gets
the status that the model tells, every value that can be read is finite, and nothing crashes."""

import math
from ctypes import byref, c_char_p, c_double, c_int, c_size_t, c_void_p
from typing import Any

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)

from fmu.apart import apart
from fmu.binary import DISCARD, DO_STEP_STATUS, ERROR, LAST_SUCCESSFUL_TIME, OK, WARNING, Slave, of, reals, references
from fmu.standard_calls import allowed
from fmu.unpacked import Archive

# Finite numbers of all sizes, and what is no number.
NUMBERS = st.one_of(
    st.floats(-10, 10),
    st.floats(allow_nan=False, allow_infinity=False),
    st.sampled_from([math.nan, math.inf, -math.inf]),
)
# Up to 0.02 s: a controller of 1 us cycles works 2e4 instants then.
SIZES = st.one_of(st.floats(1e-7, 0.02), st.sampled_from([125e-6, 0.0, -1.0, math.nan, math.inf, 5e-324, 1e-30]))


class Calls(RuleBasedStateMachine):
    """archive: set by a subclass."""

    archive: Archive

    @initialize(logging=st.booleans(), begun=st.integers(0, 3))
    def instantiate(self, logging: bool, begun: int) -> None:
        self.slave = Slave(self.archive, logging=logging)
        assert self.slave.component
        self.state = "instantiated"
        self.time = 0.0
        self.stop = math.inf
        self.saved: list[tuple[bytes, str, float, float]] = []
        elements = self.archive.variables()
        self.outputs = list(of(self.archive, "output").values())
        self.inputs = list(of(self.archive, "input").values())
        self.parameters = [
            (int(each.attrib["valueReference"]), each[0].attrib, each.attrib["variability"])
            for each in elements.values()
            if each.attrib["causality"] == "parameter" and each[0].tag == "Real"
        ]
        self.count = len(elements)
        if begun == 1:
            self.slave.set_up(2.0)
            self.state, self.time = "initialization mode", 2.0
        elif begun > 1:
            self.begin()

    def teardown(self) -> None:
        if hasattr(self, "slave"):
            self.slave.free()

    # --- the model

    def expect(self, status: int, name: str, *also: int) -> None:
        """OK where the standard allows the call (or one of `also`), else an error."""
        if allowed(name, self.state):
            assert status in (OK, *also), (name, self.state, status, self.slave.last)
        else:
            assert status == ERROR, (name, self.state, status)
            assert "not allowed in state" in self.slave.last

    def failed(self) -> bool:
        """Whether the last step failed on its way: the unit says so itself."""
        told = c_int(-1)
        self.slave.must("fmi2GetStatus", DO_STEP_STATUS, byref(told))
        return told.value == ERROR

    # --- the life

    @rule(start=st.one_of(st.sampled_from([0.0, 1000.0, -1.0]), NUMBERS), stop=st.one_of(st.none(), NUMBERS))
    def set_up(self, start: float, stop: float | None) -> None:
        status = self.slave.call("fmi2SetupExperiment", 0, 0.0, start, int(stop is not None), stop or 0.0)
        sensible = math.isfinite(start) and (stop is None or stop >= start)
        if sensible or self.state != "instantiated":
            self.expect(status, "fmi2SetupExperiment")
        else:
            assert status == ERROR
        if status == OK:
            self.time, self.stop = start, math.inf if stop is None else stop

    @rule()
    def enter(self) -> None:
        status = self.slave.call("fmi2EnterInitializationMode")
        self.expect(status, "fmi2EnterInitializationMode")
        if status == OK:
            self.state = "initialization mode"

    @rule()
    def exit(self) -> None:
        """Parameters that do not go together are refused here; the mode is not left then."""
        status = self.slave.call("fmi2ExitInitializationMode")
        self.expect(status, "fmi2ExitInitializationMode", ERROR)
        if status == OK:
            self.state = "step complete"

    @rule(h=SIZES, repeat=st.integers(1, 3))
    def step(self, h: float, repeat: int) -> None:
        for _ in range(repeat):
            status = self.slave.call("fmi2DoStep", self.time, h, 1)
            if self.state != "step complete":
                self.expect(status, "fmi2DoStep")
                return
            if not (math.isfinite(h) and h > 0):
                assert status == ERROR
            if status == OK:
                self.time += h
                assert self.time <= self.stop + 0.1 * h + 1e-9 * abs(self.stop)
            elif self.failed():
                self.state = "error"

    @rule()
    def begin(self) -> None:
        """What random calls seldom do: everything in its order, from anywhere to the first steps."""
        self.slave.must("fmi2Reset")
        self.slave.initialized(2.0)
        self.state, self.time, self.stop = "step complete", 2.0, math.inf
        self.step(125e-6, 3)

    @rule(data=st.data(), h=st.floats(1e-6, 1e-2))
    def move(self, data: st.DataObject, h: float) -> None:
        """Some steps with inputs of any size; a result that overflows fails the step."""
        for _ in range(3):
            sizes = st.floats(-1e3, 1e3) if data.draw(st.integers(0, 9)) else st.floats(-1.7e308, 1.7e308)
            values = data.draw(st.lists(sizes, min_size=len(self.inputs), max_size=len(self.inputs)))
            self.expect(
                self.slave.call("fmi2SetReal", references(self.inputs), len(values), reals(values)), "fmi2SetReal"
            )
            self.step(h, 1)

    @rule(t=NUMBERS, h=SIZES)
    def step_from_elsewhere(self, t: float, h: float) -> None:
        far = math.isnan(t) or abs(t - self.time) > 1e-9 * (abs(self.time) + abs(h)) + 0.1 * abs(h)
        if not far and math.isfinite(h):
            return
        before = self.slave.state()
        assert self.slave.call("fmi2DoStep", t, h, 1) == ERROR
        assert self.slave.state() == before

    @rule(really=st.integers(0, 3))
    def terminate(self, really: int) -> None:
        if really > 0 and self.state == "step complete":
            return
        status = self.slave.call("fmi2Terminate")
        self.expect(status, "fmi2Terminate")
        if status == OK:
            self.state = "terminated"

    @rule(really=st.integers(0, 3))
    def reset(self, really: int) -> None:
        if really > 0:  # seldom, or nothing else would be far from the start
            return
        self.slave.must("fmi2Reset")
        self.state, self.time, self.stop = "instantiated", 0.0, math.inf

    # --- values

    @rule(data=st.data())
    def set_inputs(self, data: st.DataObject) -> None:
        values = data.draw(st.lists(NUMBERS, min_size=len(self.inputs), max_size=len(self.inputs)))
        before = self.slave.state()
        status = self.slave.call("fmi2SetReal", references(self.inputs), len(values), reals(values))
        if self.state == "instantiated" or all(map(math.isfinite, values)):
            # Inputs have no "initial"; the units take them ahead of the initialisation all the same.
            self.expect(status, "fmi2SetReal", *([] if all(map(math.isfinite, values)) else [ERROR]))
        else:
            assert status == ERROR
        if status == ERROR:
            assert self.slave.state() == before

    @rule(data=st.data())
    def set_slopes(self, data: st.DataObject) -> None:
        values = data.draw(st.lists(NUMBERS, min_size=len(self.inputs), max_size=len(self.inputs)))
        orders = (c_int * len(values))(*[1] * len(values))
        name = "fmi2SetRealInputDerivatives"
        status = self.slave.call(name, references(self.inputs), len(values), orders, reals(values))
        if all(map(math.isfinite, values)):
            self.expect(status, name)
        else:
            assert status == ERROR

    @precondition(lambda self: self.parameters)
    @rule(data=st.data())
    def set_a_parameter(self, data: st.DataObject) -> None:
        reference, attributes, variability = data.draw(st.sampled_from(self.parameters))
        start = float(attributes["start"])
        value = data.draw(
            st.one_of(st.just(start), st.floats(0.5 * start, 2 * start) if start > 0 else NUMBERS, NUMBERS)
        )
        least, most = float(attributes.get("min", "-inf")), float(attributes.get("max", "inf"))
        status = self.slave.call("fmi2SetReal", references([reference]), 1, reals([value]))
        fits = math.isfinite(value) and least <= value <= most
        if self.state == "step complete" and variability == "fixed":
            assert status == ERROR
        elif fits:
            self.expect(status, "fmi2SetReal")
        else:
            assert status == ERROR

    @rule(reference=st.integers(0, 2**32 - 1), kind=st.sampled_from(["Real", "Integer", "Boolean", "String"]))
    def touch_anything(self, reference: int, kind: str) -> None:
        reference = reference % (self.count + 2)
        types: dict[str, Any] = {"Real": c_double, "Integer": c_int, "Boolean": c_int, "String": c_char_p}
        assert self.slave.call(f"fmi2Get{kind}", references([reference]), 1, (types[kind] * 1)()) in (OK, ERROR)

    @invariant()
    def what_can_be_read_is_finite(self) -> None:
        if not hasattr(self, "state"):
            return
        values = reals([math.nan] * len(self.outputs))
        status = self.slave.call("fmi2GetReal", references(self.outputs), len(self.outputs), values)
        if self.state == "initialization mode":
            assert status in (OK, ERROR)  # parameters that do not go together have no results
        else:
            self.expect(status, "fmi2GetReal")
        if status == OK and self.state != "error":
            assert all(map(math.isfinite, values)), list(values)

    @rule(data=st.data())
    def derivatives(self, data: st.DataObject) -> None:
        seeds = data.draw(st.lists(st.floats(-10, 10), min_size=len(self.inputs), max_size=len(self.inputs)))
        found = reals([0.0] * len(self.outputs))
        name = "fmi2GetDirectionalDerivative"
        arguments = references(self.outputs), len(found), references(self.inputs), len(seeds), reals(seeds), found
        status = self.slave.call(name, *arguments)
        self.expect(status, name, ERROR)  # as above, and after a tunable parameter that was refused
        orders = (c_int * len(found))(*[1] * len(found))
        name = "fmi2GetRealOutputDerivatives"
        self.expect(self.slave.call(name, references(self.outputs), len(found), orders, found), name, ERROR)

    # --- states and status

    @rule()
    def save(self) -> None:
        self.saved.append((self.slave.state(), self.state, self.time, self.stop))

    @precondition(lambda self: getattr(self, "saved", None))
    @rule(data=st.data(), damage=st.booleans())
    def restore(self, data: st.DataObject, damage: bool) -> None:
        image, state, time, stop = data.draw(st.sampled_from(self.saved))
        before = self.slave.state()
        if damage:
            at = data.draw(st.integers(0, len(image) - 1))
            image = image[:at] + bytes([image[at] ^ 0x20]) + image[at + 1 :]
            assert self.slave.restore(image) == ERROR
            assert self.slave.state() == before
        else:
            status = self.slave.restore(image)
            # One whose tunable parameters were refused cannot be had back either.
            assert status == OK or self.slave.state() == before
            if status == OK:
                self.state, self.time, self.stop = state, time, stop
                assert self.slave.state() == image

    @rule()
    def status(self) -> None:
        time, state = c_double(), c_void_p()
        name = "fmi2GetRealStatus"
        status = self.slave.call(name, LAST_SUCCESSFUL_TIME, byref(time))
        self.expect(status, name)
        assert status != OK or math.isclose(time.value, self.time, rel_tol=1e-15, abs_tol=1e-300)
        assert self.slave.call("fmi2GetRealStatus", DO_STEP_STATUS, byref(time)) in (DISCARD, ERROR)
        assert self.slave.call("fmi2CancelStep") == ERROR
        assert self.slave.call("fmi2SerializedFMUstateSize", state, byref(c_size_t())) == ERROR

    @rule(on=st.booleans(), names=st.lists(st.sampled_from([b"logAll", b"logEvents", b"logFmi2Call", b"?", None])))
    def log(self, on: bool, names: list[bytes | None]) -> None:
        status = self.slave.call("fmi2SetDebugLogging", int(on), len(names), (c_char_p * len(names))(*names))
        assert status == (WARNING if on and {b"?", None} & set(names) else OK)
        self.slave.must("fmi2SetDebugLogging", int(on), 1, (c_char_p * 1)(b"logStatusError")) if on else None


@apart
def test_random_sequences(archive: Archive) -> None:
    machine = type("CallsOf" + archive.unit, (Calls,), {"archive": archive})
    run_state_machine_as_test(  # type: ignore[no-untyped-call]
        machine,
        settings=settings(
            max_examples=100,
            stateful_step_count=50,
            deadline=None,
            database=None,
            derandomize=True,
            suppress_health_check=list(HealthCheck),
        ),
    )
