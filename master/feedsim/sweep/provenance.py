"""What the rows of a study come from: fingerprints of everything that decides them, versions, the machine."""

from __future__ import annotations

import hashlib
import json
import os
import platform
import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from feedsim.errors import InputError
from feedsim.scenario import Study
from feedsim.sweep.design import Design

UNITS = ("plant", "controller", "friction")
# Methods of which a study with more runs has those of a smaller one, with the same seed, as its first ones: points of a
# Sobol sequence, and for indices what is made of them sample by sample.
PREFIXED = ("sobol", "sensitivity")


def parts(study: Study, design: Design, fmus: Path) -> dict[str, str]:
    """What decides the rows -> SHA-256 of it (of the package: its version). Where the files lie is no part of that, nor
    how many runs there are where more of them begin with the same ones.

    InputError: a file cannot be read.
    """
    hashes = {str(file): _of_bytes(_read(file)) for file in study.files}
    text = study.base.content(hashes)
    return {
        "version of feedsim": _version("feedsim"),
        "parameters and sampling": _of_bytes(_canonical(_plan(study, hashes)) + _values(study, design)),
        "scenario and machine": _of_bytes(text.encode()),
        **{f"{unit}.fmu": _of_bytes(_read(fmus / f"{unit}.fmu")) for unit in UNITS},
    }


def fingerprint(found: Mapping[str, str]) -> str:
    """One SHA-256 of all parts."""
    return _of_bytes(_canonical(found))


def first_runs(study: Study, design: Design) -> Callable[[int], str] | None:
    """Number of runs -> SHA-256 of the values of the first so many; None where a study with more runs has others."""
    if study.sampling.method not in PREFIXED:
        return None
    return lambda runs: _of_bytes(design.values[:runs].tobytes())


def _values(study: Study, design: Design) -> bytes:
    return b"" if study.sampling.method in PREFIXED else design.values.tobytes()


def _plan(study: Study, hashes: Mapping[str, str]) -> Any:
    """Sampling and parameters, files named by what is in them."""

    def told(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: told(inner) for key, inner in value.items() if key != "text"}
        if isinstance(value, (list, tuple)):
            return [told(inner) for inner in value]
        return hashes.get(value, value) if isinstance(value, str) else value

    sampling = asdict(study.sampling)
    if study.sampling.method in PREFIXED:
        del sampling["runs"]
    return told({"sampling": sampling, "parameters": [asdict(p) for p in study.parameters]})


def described(study: Study, design: Design, found: Mapping[str, str]) -> dict[str, Any]:
    """What is the same whenever and wherever the study's runs are made."""
    return {
        "study": study.name,
        "note": study.note,
        "file": study.file.name,
        "scenario": study.scenario.name,
        "written": dict(study.written),
        "set": [*study.settings, *study.overrides],
        "sampling": {"method": study.sampling.method, "runs": design.runs, "seed": study.sampling.seed},
        "parameters": [
            {"name": p.name, "keys": list(p.keys), "unit": p.unit, "factor": p.factor} for p in design.parameters
        ],
        "fingerprint": fingerprint(found),
        "parts": dict(found),
    }


def circumstances(command: Iterable[str]) -> dict[str, Any]:
    """What is another at every time and place."""
    return {
        "command": list(command),
        "machine": {
            "system": platform.platform(),
            "processor": platform.machine(),
            "cores": os.cpu_count(),
            "python": platform.python_version(),
        },
        "versions": {name: _version(name) for name in ("feedsim", "numpy", "scipy", "fmpy", "distributed")},
    }


def now() -> str:
    """The time, in UTC."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def _canonical(value: Any) -> bytes:
    return json.dumps(value, sort_keys=True, ensure_ascii=False, separators=(",", ":"), default=str).encode()


def _of_bytes(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _read(file: Path) -> bytes:
    try:
        return file.read_bytes()
    except FileNotFoundError:
        raise InputError(f"no such file: {file}") from None
    except OSError as error:
        raise InputError(f"{file} cannot be read: {error.strerror}") from None


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "unknown" if name in sys.modules else "not installed"
