"""The path of an NC program and the motion along it: corners, limits of every axis, filter. The core is C.

May use part_program, native, findings, errors and installation.
Start with planned.py: ``plan_moves``; the core is ``src/planner``.
"""

from feedsim.motions.planner.planned import Acts, Limits, PlannedPath, plan_moves

__all__ = ["Acts", "Limits", "PlannedPath", "plan_moves"]
