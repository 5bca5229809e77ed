"""What the units cannot know of a scenario: motions, evaluation, limits, names; as the text that travels in an SSP.

It has the keys of a scenario file, every quantity with its unit. What a unit has a parameter for is left out: there is
one place for it, the parameter sets.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from types import NoneType
from typing import Annotated, Any, get_args, get_origin

from pydantic import BaseModel

from feedsim.fields import Quantity
from feedsim.scenario import Drive, Scenario
from feedsim.scenario.structure.geometry import GeometryStructure
from feedsim.scenario.structure.load import load_structure

RECORDINGS = "resources/recordings"
STRUCTURE = "resources/structure.yaml"


def text(scenario: Scenario) -> str:
    """The JSON text for `scenario`; recordings it names are where :func:`recordings` puts them."""
    whole = plain(scenario)
    del whole["loads"]  # there are none
    machine = whole["machine"]
    places = {path: name for name, path in recordings(scenario).items()}
    for motion, data in zip(scenario.motions, whole["motions"], strict=True):
        data |= {key: places[path] for key, path in motion.files.items()}
    own = ("pitch", "travel", "max_speed", "max_acceleration", "display_sign")
    axes = {}
    for name, axis in machine["axes"].items():
        axes[name] = {key: axis[key] for key in own}
        for role in ("drive", "friction"):  # of another maker's unit what is recorded, which no connection shows
            kept = {key: axis[role][key] for key in ("identified", "outputs") if axis[role].get(key)}
            axes[name] |= {role: kept} if kept else {}
    # The parameters of a shipped drive show the others.
    shipped = any(isinstance(axis.drive, Drive) for axis in scenario.machine.axes.values())
    reported = ("interpolation",) if shipped else ("control", "position", "interpolation")
    whole["machine"] = {
        "name": machine["name"],
        "note": machine["note"],
        "cycles": {key: machine["cycles"][key] for key in reported},
        "path": machine["path"],
        "axes": axes,
    }
    if structure(scenario) is not None:
        whole["machine"]["structure"] = STRUCTURE
    return json.dumps(whole, indent=1, ensure_ascii=False)


def structure(scenario: Scenario) -> bytes | None:
    """The machine's structure file, where it stands for itself: as geometry. Matrices are too large to travel along."""
    if scenario.machine.structure is None:
        return None
    loaded = load_structure(scenario.machine.structure)
    if not isinstance(loaded, GeometryStructure):
        return None
    return (json.dumps(plain(loaded), indent=1, ensure_ascii=False) + "\n").encode("utf-8")


def recordings(scenario: Scenario) -> dict[str, Path]:
    """Place inside the SSP -> file, of the recorded setpoints that the motions name."""
    files = dict.fromkeys(path for motion in scenario.motions for path in motion.files.values())
    return {f"{RECORDINGS}/{i}.csv": path for i, path in enumerate(files)}


def plain(value: Any, annotation: Any = None) -> Any:
    """A value of a scenario as its file has it: quantities as text with their SI unit, exact; nothing that is None."""
    if isinstance(value, BaseModel):
        fields = type(value).model_fields
        return {
            info.alias or name: plain(inner, Annotated[(info.annotation, *info.metadata, None)])
            for name, info in fields.items()
            if (inner := getattr(value, name)) is not None
        }
    options = list(_options(annotation))
    if isinstance(value, Mapping):
        inner = next((get_args(option)[1] for option in options if get_origin(option) is dict), None)
        return {key: plain(entry, inner) for key, entry in value.items()}
    if isinstance(value, (tuple, list)):
        inner = next((get_args(option)[0] for option in options if get_origin(option) is tuple), None)
        return [plain(entry, inner) for entry in value]
    if isinstance(value, float):
        quantity = next((note for option in options for note in _notes(option)), None)
        return f"{value!r} {quantity.unit}" if quantity is not None and quantity.unit != "1" else value
    return str(value) if isinstance(value, Path) else value


def _options(annotation: Any) -> Any:
    """The alternatives of an annotation; those that are Annotated come as they are and as what they annotate."""
    yield annotation
    arguments = get_args(annotation)
    if get_origin(annotation) is Annotated:
        yield from _options(arguments[0])
    elif arguments and get_origin(annotation) not in (dict, tuple):
        for option in arguments:
            if option is not NoneType:
                yield from _options(option)


def _notes(annotation: Any) -> list[Quantity]:
    arguments = get_args(annotation) if get_origin(annotation) is Annotated else ()
    return [note for note in arguments[1:] if isinstance(note, Quantity)]
