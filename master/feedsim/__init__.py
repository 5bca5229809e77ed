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


def __getattr__(public: str) -> _Any:
    if public == "__version__":
        from feedsim.installation import version

        return version("feedsim") or "unknown"
    if public not in _HOMES:
        raise AttributeError(f"module 'feedsim' has no attribute '{public}'")
    room, name = _HOMES[public]
    try:
        return getattr(_import_module(room), name)
    except ModuleNotFoundError as error:
        from feedsim.extras import missing

        raise missing(error, f"feedsim.{public}") or error from None


def __dir__() -> list[str]:
    return [*__all__]
