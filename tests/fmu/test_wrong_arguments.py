"""Arguments that importers get wrong, on the built libraries: refused with a message that names them, nothing changed,
nothing crashed. And callbacks that are missing, as the standard allows or not."""

import ctypes
from ctypes import byref, c_char_p, c_double, c_int, c_size_t, c_void_p
from typing import Any

import pytest

from fmu.apart import apart
from fmu.binary import (
    ALLOCATE,
    ERROR,
    FREE,
    LOGGER,
    OK,
    STEP_FINISHED,
    WARNING,
    Callbacks,
    Slave,
    of,
    reals,
    references,
)
from fmu.unpacked import Archive

H = 125e-6
KINDS: dict[str, Any] = {"Real": c_double, "Integer": c_int, "Boolean": c_int, "String": c_char_p}


def some_life(slave: Slave) -> bytes:
    """Initialise, step, and answer with the state that results."""
    slave.initialized()
    for k in range(3):
        slave.step(k * H, H)
    return slave.state()


def refused(slave: Slave, text: str, name: str, *arguments: Any) -> None:
    before = slave.state()
    slave.messages.clear()
    assert slave.call(name, *arguments) == ERROR, name
    (message,) = slave.messages
    assert message.status == ERROR
    assert message.text.startswith(f"{name}: ")
    assert text in message.text
    assert slave.state() == before


# --- arrays and value references


@apart
def test_arrays_may_be_missing_where_they_have_no_elements(archive: Archive) -> None:
    slave = Slave(archive).initialized()
    for kind in KINDS:
        for name in (f"fmi2Get{kind}", f"fmi2Set{kind}"):
            assert slave.call(name, None, 0, None) == OK
            refused(slave, "NULL", name, None, 1, None)
    one, value, order = references([0]), reals([0.0]), (c_int * 1)(1)
    refused(slave, "NULL", "fmi2GetReal", one, 1, None)
    refused(slave, "NULL", "fmi2SetReal", None, 1, value)
    for name in ("fmi2SetRealInputDerivatives", "fmi2GetRealOutputDerivatives"):
        assert slave.call(name, None, 0, None, None) == OK
        refused(slave, "NULL", name, one, 1, None, value)
        refused(slave, "NULL", name, one, 1, order, None)
        refused(slave, "NULL", name, None, 1, order, value)
    name = "fmi2GetDirectionalDerivative"
    assert slave.call(name, None, 0, None, 0, None, None) == OK
    refused(slave, "NULL", name, None, 1, None, 0, None, value)
    refused(slave, "NULL", name, None, 0, one, 1, None, None)
    slave.free()


@apart
def test_arrays_longer_than_any_can_be(archive: Archive) -> None:
    """-1 where a size is expected comes as the largest number there is."""
    slave = Slave(archive).initialized()
    endless = c_size_t(-1).value
    one, value, order = references([0]), reals([0.0]), (c_int * 1)(1)
    for kind, holder in KINDS.items():
        some = of(archive, "output", kind) or of(archive, "parameter", kind)
        known = references([*some.values(), 0][:1])
        for name in (f"fmi2Get{kind}", f"fmi2Set{kind}"):
            refused(slave, "no array has 18446744073709551", name, known, endless, (holder * 1)())
    for name in ("fmi2SetRealInputDerivatives", "fmi2GetRealOutputDerivatives"):
        refused(slave, "no array has 18446744073709551", name, one, endless, order, value)
    refused(slave, "no array has 18446744073709551", "fmi2GetDirectionalDerivative", one, endless, one, 1, value, value)
    refused(slave, "no array has 18446744073709551", "fmi2GetDirectionalDerivative", one, 0, one, endless, value, value)
    refused(slave, "no array has 18446744073709551", "fmi2SetDebugLogging", 1, endless, (c_char_p * 1)(b"logAll"))
    slave.free()


@apart
def test_every_value_reference_under_every_type(archive: Archive) -> None:
    slave = Slave(archive).initialized()
    kinds = [each[0].tag for each in archive.variables().values()]
    for reference in range(len(kinds)):
        for kind, holder in KINDS.items():
            name, values = f"fmi2Get{kind}", (holder * 1)()
            if kind == kinds[reference]:
                assert slave.call(name, references([reference]), 1, values) == OK
            else:
                refused(slave, f"expected here is type {kind}", name, references([reference]), 1, values)
                refused(slave, f"expected here is type {kind}", f"fmi2Set{kind}", references([reference]), 1, values)
    for reference in (len(kinds), 2**31 - 1, 2**31, 2**32 - 1):
        for kind, holder in KINDS.items():
            text = f"value reference {reference} does not exist; those of this unit run from 0 to {len(kinds) - 1}"
            # good ones ahead of it do not help
            good = [kinds.index(kind)] if kind in kinds else []
            mixed = references([*good, reference])
            refused(slave, text, f"fmi2Get{kind}", mixed, len(mixed), (holder * 2)())
        refused(slave, text, "fmi2GetRealOutputDerivatives", references([reference]), 1, (c_int * 1)(1), reals([0.0]))
    slave.free()


@apart
def test_a_reference_may_come_twice(archive: Archive) -> None:
    slave = Slave(archive).initialized()
    for reference in of(archive, "output").values():
        one = slave.get([reference])
        assert slave.get([reference] * 1000) == one * 1000
    slave.free()


@apart
def test_numbers_that_are_none(archive: Archive) -> None:
    slave = Slave(archive)
    for bad in (float("nan"), float("inf"), float("-inf")):
        for name, reference in (of(archive, "input") | of(archive, "parameter")).items():
            refused(slave, f"'{name}' is not finite", "fmi2SetReal", references([reference]), 1, reals([bad]))
        refused(slave, "not finite", "fmi2SetupExperiment", 0, 0.0, bad, 0, 0.0)
    slave.initialized()
    for bad in (float("nan"), float("inf"), float("-inf")):
        for name, reference in of(archive, "input").items():
            arguments = references([reference]), 1, (c_int * 1)(1), reals([bad])
            refused(slave, f"'{name}' is not finite", "fmi2SetRealInputDerivatives", *arguments)
    slave.free()


@apart
def test_states_that_are_none(archive: Archive) -> None:
    slave = Slave(archive).initialized()
    image, size = slave.state(), c_size_t()
    state = c_void_p()
    refused(slave, "NULL", "fmi2GetFMUstate", None)
    refused(slave, "NULL", "fmi2SetFMUstate", None)
    refused(slave, "NULL", "fmi2SerializedFMUstateSize", None, byref(size))
    refused(slave, "NULL", "fmi2SerializeFMUstate", None, ctypes.create_string_buffer(10), 10)
    refused(slave, "NULL", "fmi2DeSerializeFMUstate", None, 10, byref(state))
    refused(slave, "NULL", "fmi2DeSerializeFMUstate", image, len(image), None)
    assert slave.call("fmi2FreeFMUstate", None) == OK
    assert slave.call("fmi2FreeFMUstate", byref(state)) == OK  # NULL: the standard wants the call to be ignored
    nonsense = ctypes.create_string_buffer(b"anything but a state of ours".ljust(200))
    refused(slave, "not a saved state", "fmi2SetFMUstate", ctypes.addressof(nonsense))
    slave.must("fmi2GetFMUstate", byref(state))
    refused(slave, "NULL", "fmi2SerializedFMUstateSize", state, None)
    refused(slave, "NULL", "fmi2SerializeFMUstate", state, None, len(image))
    refused(slave, "bytes, the state needs", "fmi2SerializeFMUstate", state, ctypes.create_string_buffer(10), 10)
    slave.must("fmi2FreeFMUstate", byref(state))
    assert state.value is None
    slave.free()


@apart
def test_steps_that_are_none(archive: Archive) -> None:
    slave = Slave(archive).initialized()
    slave.step(0.0, H)
    for t, h, text in (
        (H, 0.0, "greater than 0"),
        (H, -H, "greater than 0"),
        (H, float("nan"), "greater than 0"),
        (H, float("inf"), "greater than 0"),
        (float("nan"), H, "communication point is not finite"),
        (0.0, H, f"the communication point is 0 s, but the unit stands at {H!r} s".replace("e-05", "e-05")),
        (2 * H, H, "but the unit stands at"),
        (-1.0, H, "but the unit stands at"),
        (H, 1.7e308, ""),
    ):
        before = slave.state()
        slave.messages.clear()
        status = slave.call("fmi2DoStep", t, h, 1)
        if h == 1.7e308 and status == OK:
            continue  # a unit whose inputs are at rest may well step that far
        assert status == ERROR
        assert text in slave.last
        if h != 1.7e308:
            assert slave.state() == before
            slave_time = c_double()
            slave.must("fmi2GetRealStatus", 2, byref(slave_time))
            assert slave_time.value == H
    slave.free()


# --- instances


@apart
def test_instances_that_cannot_be(archive: Archive) -> None:
    for name in (None, b""):
        slave = Slave(archive, name=name)
        assert slave.component is None
        assert "the instance name is" in slave.last
    for guid in (b"{}", b"\xff\xfe", b"%s%n%d#1#", archive.guid.upper().encode() + b" "):
        slave = Slave(archive, guid=guid)
        assert slave.component is None
        assert slave.last.startswith("fmi2Instantiate: the GUID '")
    library = Slave(archive).library
    for kind in (0, 2, -1):  # model exchange, and nothing
        told: list[bytes] = []
        logger = LOGGER(lambda _environment, _name, _status, _category, text, told=told: told.append(text))
        callbacks = Callbacks(logger=logger)
        arguments = b"x", kind, archive.guid.encode(), None, byref(callbacks), 0, 0
        assert library.fmi2Instantiate(*arguments) is None
        assert b"co-simulation only" in told[0]


@pytest.mark.parametrize(
    "name",
    [
        b"n" * 100_000,
        "Größe 中文 \U0001f6e0".encode(),
        b"a b\tc\nd",
        b"%s%n%d%%#1#",
        b"\xe4\xff\xfe Latin-1",
        b"../../etc/passwd",
    ],
    ids=["long", "unicode", "white", "format", "not UTF-8", "path"],
)
@apart
def test_instance_names(archive: Archive, name: bytes) -> None:
    told: list[tuple[bytes, bytes]] = []
    logger = LOGGER(lambda _environment, instance, _status, _category, text: told.append((instance, text)))
    slave = Slave(archive, name=name, callbacks=Callbacks(logger=logger), logging=True)
    assert slave.component
    some_life(slave)
    assert slave.call("fmi2DoStep", 99.0, H, 1) == ERROR
    slave.free()
    assert len(told) > 3
    assert {instance for instance, _ in told} == {name}  # as it was given
    assert all(text.decode() for _, text in told)  # UTF-8, whatever the name


@apart
def test_callbacks_may_be_missing(archive: Archive) -> None:
    """All of them, the structure itself, or any one; half a pair of memory functions is not used."""
    expected = some_life(Slave(archive))
    libc = ctypes.CDLL(None)
    libc.calloc.restype, libc.calloc.argtypes = c_void_p, [c_size_t, c_size_t]
    libc.free.restype, libc.free.argtypes = None, [c_void_p]
    counts = {"held": 0, "calls": 0}

    def allocate(count: int, size: int) -> int | None:
        counts["held"] += 1
        counts["calls"] += 1
        return libc.calloc(count, size)  # type: ignore[no-any-return]

    def free(memory: int | None) -> None:
        assert memory is not None, "never NULL: an importer's free need not take it"
        counts["held"] -= 1
        libc.free(memory)

    whole = {
        "logger": LOGGER(lambda *_: None),
        "allocateMemory": ALLOCATE(allocate),
        "freeMemory": FREE(free),
        "stepFinished": STEP_FINISHED(lambda *_: pytest.fail("no step is asynchronous")),
        "componentEnvironment": 4711,
    }
    variants: list[dict[str, Any]] = [{}, whole]
    variants += [{key: value for key, value in whole.items() if key != left_out} for left_out in whole]
    variants += [{key: value} for key, value in whole.items()]
    for given in variants:
        counts["calls"] = 0
        slave = Slave(archive, callbacks=Callbacks(**given), logging=True)
        assert slave.component
        assert some_life(slave) == expected
        assert slave.call("fmi2GetReal", references([2**32 - 1]), 1, reals([0.0])) == ERROR
        assert slave.call("fmi2SetDebugLogging", 1, 1, (c_char_p * 1)(b"nonsense")) == WARNING
        assert (counts["calls"] > 0) == ({"allocateMemory", "freeMemory"} <= set(given))
        slave.free()
        assert counts["held"] == 0
    library = Slave(archive).library
    component = library.fmi2Instantiate(b"x", 1, archive.guid.encode(), slave_location(archive), None, 0, 1)
    assert component
    assert library.fmi2GetReal(component, references([2**32 - 1]), 1, reals([0.0])) == ERROR
    library.fmi2FreeInstance(component)
    assert library.fmi2Instantiate(b"x", 1, b"wrong", None, None, 0, 1) is None


def slave_location(archive: Archive) -> bytes:
    return (archive.folder / "resources").as_uri().encode()


@apart
def test_an_environment_comes_back_as_it_was_given(archive: Archive) -> None:
    seen: set[int] = set()
    logger = LOGGER(lambda environment, *_: seen.add(environment))
    slave = Slave(archive, callbacks=Callbacks(logger=logger, componentEnvironment=0x7FFF_1234_5678), logging=True)
    some_life(slave)
    slave.free()
    assert seen == {0x7FFF_1234_5678}


# --- logging


@apart
def test_categories_of_other_tools(archive: Archive) -> None:
    """Unknown ones are told and ignored, those that are known hold."""
    slave = Slave(archive).initialized()
    asked = (c_char_p * 5)(b"logDynamicStateSelection", b"", None, b"%n%s", b"logStatusWarning")
    assert slave.call("fmi2SetDebugLogging", 1, 5, asked) == WARNING
    slave.messages.clear()
    assert slave.call("fmi2GetIntegerStatus", 0, byref(c_int())) == 2
    assert [each.category for each in slave.messages] == ["logStatusWarning"]
    described = {each.attrib["name"] for each in archive.description.iterfind("LogCategories/Category")}
    for each in described:
        assert slave.call("fmi2SetDebugLogging", 1, 1, (c_char_p * 1)(each.encode())) == OK
    assert slave.call("fmi2SetDebugLogging", 0, 5, asked) == OK  # off is off, whatever is listed
    refused(slave, "NULL", "fmi2SetDebugLogging", 1, 1, None)
    slave.free()


@apart
def test_a_logger_may_ask_the_instance_that_tells_it(archive: Archive) -> None:
    slave = Slave(archive, logging=True)
    outputs = list(of(archive, "output").values())
    depth, texts, values = [0], [], []

    def tell(_environment: int, _name: bytes, _status: int, _category: bytes, text: bytes) -> None:
        texts.append(text.decode())
        if depth[0] == 0 and slave.component:
            depth[0] = 1
            known = references(outputs)
            found = reals([0.0] * len(outputs))
            if slave.call("fmi2GetReal", known, len(known), found) == OK:
                values.append(list(found))
            depth[0] = 0

    logger = LOGGER(tell)
    slave = Slave(archive, callbacks=Callbacks(logger=logger), logging=True)
    some_life(slave)
    assert slave.call("fmi2DoStep", 99.0, H, 1) == ERROR
    assert any(text.startswith("fmi2DoStep (t = 99 s, h = 0.000125 s): the communication point") for text in texts)
    assert values
    slave.free()
