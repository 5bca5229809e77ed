"""The friction law in one call of the friction unit's library: the torque along a given speed, and the motion under a
given torque. No FMI, no instance per run."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping, Sequence
from pathlib import Path
from threading import Lock

import numpy as np
from numpy.typing import ArrayLike

from feedsim.foundation.errors import InputError, SimulationError
from feedsim.foundation.installation import fmus_directory, repair_advice
from feedsim.foundation.outputs import BlockResource
from feedsim.scenario import FrictionParameters
from feedsim.scenario.roles import FRICTION_ROLE
from feedsim.simulation.cosim.archive import Archive
from feedsim.simulation.cosim.unit import Floats, Unit

RESPONSES = "responses"  # src/friction_fmu/response.h, behind the unit's name
FREE_AXIS = "free_axis"  # src/friction_fmu/free_axis.h

_RESPONSES = ctypes.CFUNCTYPE(
    ctypes.c_size_t,
    *(ctypes.c_size_t, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t, ctypes.c_double, ctypes.c_size_t),
    *(ctypes.c_size_t, *5 * (ctypes.c_void_p,)),
)
_FREE_AXIS = ctypes.CFUNCTYPE(
    ctypes.c_size_t,
    *(ctypes.c_void_p, ctypes.c_double, ctypes.c_double, ctypes.c_void_p, ctypes.c_size_t, ctypes.c_double),
    *(ctypes.c_size_t, ctypes.c_double, ctypes.c_double, ctypes.c_void_p, ctypes.c_void_p),
)


class FrictionLaw(BlockResource):
    """The law of a friction unit as a function, for as long as this object is open (a context manager).

    The numbers are those of stepping the unit with the slope of its speed. Calls are independent of each other and may
    come from several threads; the interpreter is free for others while one runs. Not to be closed while one runs.

    Attributes:
        names: the unit's parameters, in the order that the library takes them.
        start_values: start value of each, in the unit's own units.
    """

    def __init__(self, fmus: Path | None = None, unit: str = FRICTION_ROLE.shipped) -> None:
        """Open the archive of `unit` in the folder `fmus` (default:
        :func:`~feedsim.simulation.cosim.exchange.fmus_directory`).

        Raises:
            InputError: no usable archive, or one without the functions.
        """
        self._name = unit
        self._archive = Archive((fmus or fmus_directory()) / f"{unit}.fmu")
        self._load_lock = Lock()
        self._unit: Unit | None = None
        try:
            # The instance holds the library, and its GUID stands for the order of the parameters in it.
            self._unit = Unit(self._archive, unit)
            library = self._unit.library
            responses, free_axis = (f"{unit}_{name}" for name in (RESPONSES, FREE_AXIS))
            for name in (responses, free_axis):
                if not hasattr(library, name):
                    raise InputError(
                        f"{self._archive.path}: its library has no function {name}; it was built from older sources: "
                        f"{repair_advice('it')}"
                    )
            self._responses = _RESPONSES((responses, library))
            self._free_axis = _FREE_AXIS((free_axis, library))
        except BaseException:
            self.close()
            raise
        parameters = [
            model_variable
            for model_variable in self._archive.description.modelVariables
            if model_variable.causality == "parameter"
        ]
        self.start_values: Mapping[str, float] = {parameter.name: float(parameter.start) for parameter in parameters}
        self.names = tuple(self.start_values)
        self._defaults = tuple(self.start_values.items())

    def close(self) -> None:
        if self._unit is not None:
            self._unit.close()
            self._unit = None
        self._archive.close()

    def __call__(
        self,
        parameters: Mapping[str, float],
        n: ArrayLike,
        h: float,
        *,
        z: float = 0.0,
        c: float = 0.0,
        substeps: int = 1,
        every: int = 1,
    ) -> Floats:
        """M_fr (N // every + 1,) [N.m]: the first of what :meth:`states` returns."""
        return self.states(parameters, n, h, z=z, c=c, substeps=substeps, every=every)[0]

    def torques(
        self,
        sets: Sequence[Mapping[str, float]],
        n: ArrayLike,
        h: float,
        *,
        z: Sequence[float],
        c: Sequence[float],
        substeps: int = 1,
        every: int = 1,
    ) -> Floats:
        """M_fr (S, N // every + 1) [N.m] of S contacts that move alike, to the bit that of each of them alone, in less
        time: what their parameters have in common is computed once.

        sets, z, c: of S contacts, as `parameters`, z and c of :meth:`states`; other arguments and errors as there.
        """
        table = self._respond(sets, n, h, z, c, substeps, every, outputs=1)
        return np.asarray(table[0], dtype=np.float64)

    def states(
        self,
        parameters: Mapping[str, float],
        n: ArrayLike,
        h: float,
        *,
        z: float = 0.0,
        c: float = 0.0,
        substeps: int = 1,
        every: int = 1,
    ) -> tuple[Floats, Floats, Floats]:
        """M_fr [N.m], z and c [rad], each (N // every + 1,), at the instants 0, every, 2 every .. of the N + 1 of `n`.

        Args:
            parameters: by the unit's names and in its units; those left out have their start values.
            n: (N + 1,) speed [rad/s] at instants h apart, linear between them.
            h: time between two instants [s].
            z, c: state at the first instant [rad]; a `c` beyond the engaging zone is put to its end.
            substeps: equal steps from one instant to the next; the solution is of second order in h/substeps.
            every: which of the instants are wanted.

        Raises:
            InputError: parameters that the unit refuses, with its own words, or arguments out of range.
            SimulationError: M_fr would be no finite number.
        """
        table = self._respond([parameters], n, h, [z], [c], substeps, every, outputs=3)
        return table[0, 0], table[1, 0], table[2, 0]

    def _respond(
        self,
        sets: Sequence[Mapping[str, float]],
        n: ArrayLike,
        h: float,
        z: Sequence[float],
        c: Sequence[float],
        substeps: int,
        every: int,
        outputs: int,
    ) -> Floats:
        """(outputs, S, N // every + 1): M_fr, or M_fr, z and c."""
        speeds = self._row(n, "speeds", 1)
        self._check_steps(h, "speeds", substeps=substeps, every=every)
        values = np.array([self._order_parameters(one) for one in sets])
        z_0, c_0 = np.array([z, c], dtype=np.float64)
        rows = (speeds.size - 1) // every + 1
        table = np.empty((outputs, len(values), rows))
        done = self._responses(
            *(len(values), values.ctypes.data, speeds.ctypes.data, speeds.size - 1, h, substeps, every),
            *(row.ctypes.data for row in (z_0, c_0, *table)),
            *(3 - outputs) * (None,),
        )
        if done == rows:
            return table
        if done == 0:
            for one in sets:
                self._let_unit_refuse(one)
        starts = "; ".join(f"{one:.6g} and {other:.6g}" for one, other in zip(z, c, strict=True))
        raise SimulationError(
            f"{self._archive.path.name}: M_fr would be no finite number at {done * every * h:.9g} s; speeds are "
            f"{speeds.min():.6g} to {speeds.max():.6g} rad/s, z and c at the start {starts} rad"
        )

    def free_axis(
        self,
        parameters: Mapping[str, float],
        J: float,
        M_0: float,
        M_a: ArrayLike,
        h: float,
        *,
        n: float = 0.0,
        z: float = 0.0,
        substeps: int = 1,
    ) -> tuple[Floats, Floats]:
        """Angle [rad] and speed [rad/s], each (N + 1,), of a rigid axis under a given motor torque.

            J dn/dt = M_a - M_0 - M_fr

        Args:
            parameters: by the unit's names and in its units; those left out have their start values.
            J: inertia [kg.m2]. M_0: constant load against the motor torque [N.m].
            M_a: (N,) motor torque [N.m], each held over its interval of h.
            h: length of an interval [s].
            n, z: speed [rad/s] and bristle deflection [rad] at the start; the angle begins at 0, c at 0.
            substeps: equal steps per interval; the solution is of second order in h/substeps, and stable while
                (sigma_1 + sigma_2) h/substeps is well below J.

        Raises:
            InputError: parameters that the unit refuses, with its own words, or arguments out of range.
            SimulationError: the motion would be no finite number.
        """
        torque = self._row(M_a, "torques", 0)
        if not 0.0 < J < np.inf:
            raise InputError(f"inertia: {J} kg.m2; it must be finite and greater than 0")
        self._check_steps(h, "torques", substeps=substeps)
        values = np.array(self._order_parameters(parameters)).ctypes
        motion = np.empty((2, torque.size + 1))
        angle, speed = (row.ctypes.data for row in motion)
        done = self._free_axis(values.data, J, M_0, torque.ctypes.data, torque.size, h, substeps, n, z, angle, speed)
        if done == motion.shape[1]:
            return motion[0], motion[1]
        if done == 0:
            self._let_unit_refuse(parameters)
        raise SimulationError(
            f"{self._archive.path.name}: the motion would be no finite number at {done * h:.9g} s; torques are "
            f"{torque.min(initial=0.0):.6g} to {torque.max(initial=0.0):.6g} N.m, the load is {M_0:.6g} N.m, speed and "
            f"z at the start {n:.6g} rad/s and {z:.6g} rad"
        )

    def _row(self, given: ArrayLike, what: str, least: int) -> Floats:
        """As the library takes it, while it is there."""
        if self._unit is None:
            raise ValueError("this friction law is closed")
        row = np.ascontiguousarray(given, dtype=np.float64)
        if row.ndim != 1 or row.size < least:
            raise InputError(f"{what}: shape {row.shape}; a row{' of at least one' * least} is needed")
        return row

    def _check_steps(self, h: float, what: str, **counts: int) -> None:
        if not 0.0 < h < np.inf:
            raise InputError(f"time between {what}: {h} s; it must be finite and greater than 0")
        if min(counts.values()) < 1:
            listed = ", ".join(f"{name} = {count}" for name, count in counts.items())
            raise InputError(f"{listed}; {'both' if len(counts) > 1 else 'it'} must be at least 1")

    def _order_parameters(self, parameters: Mapping[str, float]) -> list[float]:
        if not parameters.keys() <= self.start_values.keys():
            unknown = next(name for name in parameters if name not in self.start_values)
            raise InputError(f"{self._archive.path.name}: no parameter '{unknown}'; there are {', '.join(self.names)}")
        for name, value in parameters.items():
            if not hasattr(value, "__float__"):
                raise InputError(f"parameter '{name}' is {value!r}; a number is needed")
        return [float(parameters.get(name, start)) for name, start in self._defaults]

    def _let_unit_refuse(self, parameters: Mapping[str, float]) -> None:
        """Raise InputError with the unit's words where it refuses `parameters`."""
        with self._load_lock:  # loading a library changes the working directory for a moment
            unit = Unit(self._archive, self._name)
            try:
                unit.set_parameters(parameters)
                unit.enter_initialisation(0.0, 1.0)
                unit.check_parameters()
            finally:
                unit.close()


class FrictionLaws(BlockResource):
    """The laws of the shipped friction units, each opened when a set of its parameters first asks for it."""

    def __init__(self, fmus: Path | None = None) -> None:
        """fmus: as of :class:`FrictionLaw`."""
        self._fmus = fmus
        self._open: dict[str, FrictionLaw] = {}

    def __call__(self, friction: FrictionParameters) -> FrictionLaw:
        """The law of a set. Raises InputError: no usable archive of it."""
        unit = FRICTION_ROLE.archive_name(friction)
        if unit not in self._open:
            self._open[unit] = FrictionLaw(self._fmus, unit)
        return self._open[unit]

    def close(self) -> None:
        for law in self._open.values():
            law.close()
        self._open.clear()
