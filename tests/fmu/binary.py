"""A unit's shared library through ctypes, as the standard's headers declare it: no importer between test and unit."""

import ctypes
from collections.abc import Sequence
from ctypes import POINTER, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from pathlib import Path
from typing import Any, NamedTuple

from fmu.unpacked import Archive

OK, WARNING, DISCARD, ERROR, FATAL, PENDING = range(6)
CO_SIMULATION = 1
DO_STEP_STATUS, PENDING_STATUS, LAST_SUCCESSFUL_TIME, TERMINATED = range(4)

_REFERENCES, _REALS, _WHOLES, _TEXTS = POINTER(c_uint), POINTER(c_double), POINTER(c_int), POINTER(c_char_p)
_STATE, _BYTES = c_void_p, c_char_p
_GET = {"Real": _REALS, "Integer": _WHOLES, "Boolean": _WHOLES, "String": _TEXTS}

# The callbacks. The logger's further arguments are those of a printf: none of the units has any.
LOGGER = ctypes.CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p)
ALLOCATE = ctypes.CFUNCTYPE(c_void_p, c_size_t, c_size_t)
FREE = ctypes.CFUNCTYPE(None, c_void_p)
STEP_FINISHED = ctypes.CFUNCTYPE(None, c_void_p, c_int)


class Callbacks(ctypes.Structure):
    """fmi2CallbackFunctions."""

    _fields_ = (
        ("logger", LOGGER),
        ("allocateMemory", ALLOCATE),
        ("freeMemory", FREE),
        ("stepFinished", STEP_FINISHED),
        ("componentEnvironment", c_void_p),
    )


# Arguments behind the component, of the functions that begin with it and return a status.
ARGUMENTS: dict[str, list[Any]] = {
    "fmi2SetDebugLogging": [c_int, c_size_t, _TEXTS],
    "fmi2SetupExperiment": [c_int, c_double, c_double, c_int, c_double],
    "fmi2EnterInitializationMode": [],
    "fmi2ExitInitializationMode": [],
    "fmi2Terminate": [],
    "fmi2Reset": [],
    **{f"fmi2Get{kind}": [_REFERENCES, c_size_t, values] for kind, values in _GET.items()},
    **{f"fmi2Set{kind}": [_REFERENCES, c_size_t, values] for kind, values in _GET.items()},
    "fmi2GetFMUstate": [POINTER(_STATE)],
    "fmi2SetFMUstate": [_STATE],
    "fmi2FreeFMUstate": [POINTER(_STATE)],
    "fmi2SerializedFMUstateSize": [_STATE, POINTER(c_size_t)],
    "fmi2SerializeFMUstate": [_STATE, _BYTES, c_size_t],
    "fmi2DeSerializeFMUstate": [_BYTES, c_size_t, POINTER(_STATE)],
    "fmi2GetDirectionalDerivative": [_REFERENCES, c_size_t, _REFERENCES, c_size_t, _REALS, _REALS],
    "fmi2SetRealInputDerivatives": [_REFERENCES, c_size_t, _WHOLES, _REALS],
    "fmi2GetRealOutputDerivatives": [_REFERENCES, c_size_t, _WHOLES, _REALS],
    "fmi2DoStep": [c_double, c_double, c_int],
    "fmi2CancelStep": [],
    "fmi2GetStatus": [c_int, _WHOLES],
    "fmi2GetRealStatus": [c_int, _REALS],
    "fmi2GetIntegerStatus": [c_int, _WHOLES],
    "fmi2GetBooleanStatus": [c_int, _WHOLES],
    "fmi2GetStringStatus": [c_int, _TEXTS],
}


def load(path: Path) -> ctypes.CDLL:
    """The library with its functions' types declared."""
    library = ctypes.CDLL(str(path))
    for name, arguments in ARGUMENTS.items():
        function = getattr(library, name)
        function.restype, function.argtypes = c_int, [c_void_p, *arguments]
    library.fmi2GetTypesPlatform.restype = library.fmi2GetVersion.restype = c_char_p
    library.fmi2Instantiate.restype = c_void_p
    library.fmi2Instantiate.argtypes = [*(c_char_p, c_int, c_char_p, c_char_p, POINTER(Callbacks), c_int, c_int)]
    library.fmi2FreeInstance.restype, library.fmi2FreeInstance.argtypes = None, [c_void_p]
    return library


def references(values: Sequence[int]) -> Any:
    return (c_uint * len(values))(*values)


def reals(values: Sequence[float]) -> Any:
    return (c_double * len(values))(*values)


class Message(NamedTuple):
    instance: str
    status: int
    category: str
    text: str


class Slave:
    """One instance. `call` hands on what is given to it and answers with the status; the other methods assert success.

    component is None where the unit refused to be instantiated; `messages` holds what came through the logger.
    """

    def __init__(
        self,
        archive: Archive,
        *,
        name: bytes | None = b"tried",
        guid: bytes | None = None,
        location: bytes | None = b"",
        logging: bool = False,
        callbacks: Callbacks | None = None,
        library: Path | None = None,
    ) -> None:
        """location: b"" for the archive's resources, None for NULL. callbacks: own logger alone where there are none
        given, which leaves memory to the unit."""
        self.archive = archive
        self.library = load(library or archive.library)
        self.messages: list[Message] = []
        self._logger = LOGGER(self._log)
        self.callbacks = callbacks or Callbacks(logger=self._logger)
        place = (archive.folder / "resources").as_uri().encode() if location == b"" else location
        self.component: int | None = self.library.fmi2Instantiate(
            name, CO_SIMULATION, guid or archive.guid.encode(), place, ctypes.byref(self.callbacks), 0, int(logging)
        )

    def _log(self, _environment: int, name: bytes, status: int, category: bytes, text: bytes) -> None:
        self.messages.append(Message(name.decode(), status, category.decode(), text.decode()))

    @property
    def last(self) -> str:
        """Text of the last message."""
        return self.messages[-1].text if self.messages else ""

    def call(self, name: str, *arguments: Any) -> int:
        status = getattr(self.library, name)(self.component, *arguments)
        assert OK <= status <= PENDING
        return int(status)

    def must(self, name: str, *arguments: Any) -> None:
        status = self.call(name, *arguments)
        assert status == OK, f"{name} answers {status}: {self.last}"

    # --- a life

    def set_up(self, start: float = 0.0, stop: float | None = None) -> "Slave":
        self.must("fmi2SetupExperiment", 0, 0.0, start, int(stop is not None), stop or 0.0)
        self.must("fmi2EnterInitializationMode")
        return self

    def initialized(self, start: float = 0.0, stop: float | None = None) -> "Slave":
        self.set_up(start, stop).must("fmi2ExitInitializationMode")
        return self

    def step(self, t: float, h: float) -> None:
        self.must("fmi2DoStep", t, h, 1)

    def free(self) -> None:
        self.library.fmi2FreeInstance(self.component)
        self.component = None

    # --- values

    def get(self, known: Sequence[int]) -> list[float]:
        values = reals([0.0] * len(known))
        self.must("fmi2GetReal", references(known), len(known), values)
        return list(values)

    def set(self, known: Sequence[int], values: Sequence[float]) -> None:
        self.must("fmi2SetReal", references(known), len(known), reals(values))

    def slope(self, known: Sequence[int], values: Sequence[float]) -> None:
        orders = (c_int * len(known))(*[1] * len(known))
        self.must("fmi2SetRealInputDerivatives", references(known), len(known), orders, reals(values))

    # --- states

    def state(self) -> bytes:
        """Serialised."""
        state, size = c_void_p(), c_size_t()
        self.must("fmi2GetFMUstate", ctypes.byref(state))
        self.must("fmi2SerializedFMUstateSize", state, ctypes.byref(size))
        image = ctypes.create_string_buffer(size.value)
        self.must("fmi2SerializeFMUstate", state, image, size)
        self.must("fmi2FreeFMUstate", ctypes.byref(state))
        return image.raw

    def restore(self, image: bytes) -> int:
        """Status of the first of the calls that does not succeed, else OK."""
        state = c_void_p()
        status = self.call("fmi2DeSerializeFMUstate", image, len(image), ctypes.byref(state))
        if status == OK:
            status = self.call("fmi2SetFMUstate", state)
            self.must("fmi2FreeFMUstate", ctypes.byref(state))
        return status


def of(archive: Archive, causality: str, kind: str = "Real") -> dict[str, int]:
    """Value references by name."""
    return {
        name: int(each.attrib["valueReference"])
        for name, each in archive.variables().items()
        if each.attrib["causality"] == causality and each[0].tag == kind
    }
