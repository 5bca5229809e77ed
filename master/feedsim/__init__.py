"""Simulation of machine-tool feed drives with non-linear friction: the master of FMI 2.0 co-simulation units.

>>> import feedsim as fs
>>> result = fs.run("xz_circle.yaml", set={"machine.axes.Z.drive.K_v": "5 (m/min)/mm"})
>>> result.figures["XZ.G"].unit
'um'
>>> picture = result.plot()
>>> picture.save("circle.png").name
'circle.png'
"""

from __future__ import annotations

import re as _re
from importlib import import_module as _import_module
from pathlib import Path as _Path
from typing import Any as _Any

# The public names stand in the stub beside this file, where type checkers look. They are loaded on first use:
# `feedsim --help` should not wait for numpy and fmpy.
_STUB = _Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8")
_HOMES = {name: home for *home, name in _re.findall(r"^from (\S+) import (\w+) as (\w+)$", _STUB, _re.MULTILINE)}

__all__ = sorted(_HOMES)
# Names of version 0.2 -> functions of today. They work for one version more.
_OLD_NAMES = {
    "compensate": "feedsim.jobs.tune_feedforward:tune_feedforward",
    "identify": "feedsim.jobs.identify:identify_friction",
    "machine_pack": "feedsim.jobs.export:machine_pack",
    "machine_show": "feedsim.jobs.machine:machine_view",
    "pack": "feedsim.jobs.export:pack",
    "show": "feedsim.jobs.diff:diff",
    "validate": "feedsim.jobs.check:check",
    "write_page": "feedsim.jobs.export:write_page",
    "write_ssp": "feedsim.jobs.export:write_ssp",
}


def __getattr__(public: str) -> _Any:
    if public == "__version__":
        from feedsim.foundation.installation import version

        return version("feedsim") or "unknown"
    if public in _OLD_NAMES:
        return _old_function(public)
    if public not in _HOMES:
        raise AttributeError(f"module 'feedsim' has no attribute '{public}'")
    room, name = _HOMES[public]
    try:
        return getattr(_import_module(room), name)
    except ModuleNotFoundError as error:
        from feedsim.foundation.installation import missing_package_error

        raise missing_package_error(error, f"feedsim.{public}") or error from None


def _old_function(old: str) -> _Any:
    """The function that had this name; calling it says how it is called today."""
    import functools
    import warnings

    room, _, name = _OLD_NAMES[old].partition(":")
    function = getattr(_import_module(room), name)
    today = f"feedsim.{name if name in _HOMES else 'export'}"

    @functools.wraps(function)
    def called(*given: _Any, **named: _Any) -> _Any:
        warnings.warn(
            f"feedsim.{old} is called {today} now; the old name goes with the next version", DeprecationWarning, 2
        )
        if "axis" in named:
            named["axes"] = named.pop("axis")
        return function(*given, **named)

    return called


def __dir__() -> list[str]:
    return [*__all__]
