"""The motion program of the last run, for runs whose motion is the same."""

from __future__ import annotations

from typing import Any

from feedsim.nc import Program, plan
from feedsim.scenario import Scenario

# Of an axis, what its motion does not depend on.
_NO_MOTION = {"M_0", "friction", "drive"}


class Planner:
    """Plans motions; the last program serves again while nothing that it depends on is another."""

    def __init__(self) -> None:
        self._key: Any = None
        self._program: Program | None = None

    def plan(self, scenario: Scenario) -> Program:
        """Like :func:`feedsim.nc.plan`."""
        key = _depends_on(scenario)
        if self._program is None or key != self._key:
            self._program = None
            self._program, self._key = plan(scenario), key
        return self._program


def _depends_on(scenario: Scenario) -> Any:
    machine = scenario.machine
    axes = {
        name: {field: getattr(axis, field) for field in type(axis).model_fields if field not in _NO_MOTION}
        for name, axis in machine.axes.items()
    }
    return scenario.motions, [*machine.axes], axes, machine.pose, machine.cycles, machine.path
