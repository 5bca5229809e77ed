"""What the rows of a study come from: fingerprints of everything that decides them, versions, the machine.

Also whether the feedsim of a worker is the one that sent it the work: only then do its figures belong into one table.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Any

from feedsim.design.sweep.design import Design
from feedsim.foundation.errors import Finding, InputError, no_such_file, shorten_list
from feedsim.foundation.installation import version
from feedsim.scenario import Base, FrictionParameters
from feedsim.scenario.roles import DRIVE, FRICTION_ROLE, FRICTION_UNITS
from feedsim.scenario.study import Parameter, Study

# What a worker is asked, in words that every Python knows, whatever is installed there.
QUESTION = "__import__('feedsim.design.sweep.provenance', fromlist=['versions']).versions()"
UNIT_NAMES = ("plant", DRIVE.shipped, FRICTION_ROLE.shipped)
# Methods of which a study with more runs has those of a smaller one, with the same seed, as its first ones: points of a
# Sobol sequence, and for indices what is made of them sample by sample.
SAMPLEWISE_METHODS = ("sobol", "sensitivity")


def parts(study: Study, design: Design, fmus: Path) -> dict[str, str]:
    """What decides the rows -> SHA-256 of it (of the package: its version). Where the files lie is no part of that, nor
    how many runs there are where more of them begin with the same ones.

    InputError: a file cannot be read.
    """
    hashes = {str(file): _of_bytes(read_content(file)) for file in study.files}
    text = study.base.content(hashes)
    return {
        "version of feedsim": _version("feedsim"),
        "parameters and sampling": _of_bytes(_canonical(_plan(study, hashes)) + _values(study, design)),
        "scenario and machine": _of_bytes(text.encode()),
        **{
            f"{unit}.fmu": _of_bytes(read_content(fmus / f"{unit}.fmu"))
            for unit in units_of(study.base, study.parameters)
        },
    }


def units_of(base: Base, parameters: Iterable[Parameter] = ()) -> tuple[str, ...]:
    """Shipped units that runs of a scenario may need, where `parameters` change it."""
    keys = [key for parameter in parameters for key in parameter.keys]
    axes = base.scenario.machine.axes.values()
    laws = {axis.friction.law for axis in axes if isinstance(axis.friction, FrictionParameters)}
    varied = any(_may_change_law(key.split(".")) for key in keys)
    others = [unit for law, unit in FRICTION_UNITS.items() if varied or law in laws]
    together = base.scenario.coupling.units == "one" or any(key.startswith("coupling") for key in keys)
    return (*UNIT_NAMES, *others, *(["machine"] if together else []))


def _may_change_law(key: list[str]) -> bool:
    """Whether a value may be a friction as a whole: machine, .axes, .Z, .friction, or its law."""
    return key[0] == "machine" and (len(key) <= 3 or key[3:] in (["friction"], ["friction", "law"]))


def fingerprint(result: Mapping[str, str]) -> str:
    """One SHA-256 of all parts."""
    return _of_bytes(_canonical(result))


def first_runs(study: Study, design: Design) -> Callable[[int], str] | None:
    """Number of runs -> SHA-256 of the values of the first so many; None where a study with more runs has others."""
    if study.sampling.method not in SAMPLEWISE_METHODS:
        return None
    return lambda runs: _of_bytes(design.values[:runs].tobytes())


def _values(study: Study, design: Design) -> bytes:
    return b"" if study.sampling.method in SAMPLEWISE_METHODS else design.values.tobytes()


def _plan(study: Study, hashes: Mapping[str, str]) -> Any:
    """Sampling and parameters, files named by what is in them."""

    def told(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: told(inner) for key, inner in value.items() if key != "text"}
        if isinstance(value, (list, tuple)):
            return [told(inner) for inner in value]
        return hashes.get(value, value) if isinstance(value, str) else value

    sampling = asdict(study.sampling)
    if study.sampling.method in SAMPLEWISE_METHODS:
        del sampling["runs"]
    return told({"sampling": sampling, "parameters": [asdict(p) for p in study.parameters]})


def describe_study(study: Study, design: Design, result: Mapping[str, str]) -> dict[str, Any]:
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
        "fingerprint": fingerprint(result),
        "parts": dict(result),
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


@cache
def versions() -> dict[str, str]:
    """Version of feedsim, hash of its Python sources, and what else figures may depend on in the last digit."""
    return {
        "feedsim": _version("feedsim"),
        "sources": _sources(),
        "Python": platform.python_version(),
        "numpy": _version("numpy"),
        "scipy": _version("scipy"),
        "ruckig": _version("ruckig"),
        "machine": f"{sys.platform} {platform.machine()}",
    }


def fault(address: str, answer: Any, here: Mapping[str, str] | None = None) -> str | None:
    """What is wrong with the worker at `address` that answered so; None where nothing is. here: versions of the client,
    by default of this process."""
    here = here or versions()
    if isinstance(answer, ModuleNotFoundError):
        return f"worker {address}: has no feedsim {here['feedsim']} ({answer}); install the same version there"
    if not isinstance(answer, Mapping):
        return f"worker {address}: does not say its version of feedsim: {answer}"
    if answer["feedsim"] != here["feedsim"]:
        return (
            f"worker {address}: has feedsim {answer['feedsim']}, here is {here['feedsim']}; a study needs the same "
            "everywhere"
        )
    if answer["sources"] != here["sources"]:
        return (
            f"worker {address}: its feedsim {here['feedsim']} has other sources than the one that the study was begun "
            "with; install the same there and start the worker anew (or the files have changed meanwhile: begin anew)"
        )
    return None


def differences(answers: Mapping[str, Mapping[str, str]]) -> tuple[Finding, ...]:
    """Findings on workers with other versions of what feedsim calculates with: the last digits may differ."""
    here = versions()
    result: dict[str, list[str]] = {}
    for address, answer in answers.items():
        for name in ("Python", "numpy", "scipy", "ruckig", "machine"):
            if answer.get(name) != here[name]:
                result.setdefault(f"{name} {answer.get(name)} in place of {here[name]}", []).append(address)
    return tuple(
        Finding(
            "workers-differ", "doubt",
            f"{shorten_list(addresses, 3)}: {what}; figures from there may differ in the last digits",
            shorten_list(addresses, 3),
        )
        for what, addresses in result.items()
    )  # fmt: skip


def _canonical(value: Any) -> bytes:
    return json.dumps(value, sort_keys=True, ensure_ascii=False, separators=(",", ":"), default=str).encode()


def _of_bytes(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def read_content(file: Path) -> bytes:
    """Content of a file. InputError: it cannot be read."""
    try:
        return file.read_bytes()
    except FileNotFoundError:
        raise InputError(no_such_file(file)) from None
    except OSError as error:
        raise InputError(f"{file} cannot be read: {error.strerror}") from None


def _version(name: str) -> str:
    return version(name) or ("unknown" if name in sys.modules else "not installed")


def _sources() -> str:
    """SHA-256 over the package's Python files, wherever they lie and however their lines end."""
    root = Path(__file__).resolve().parents[2]
    result = hashlib.sha256()
    for file in sorted(root.rglob("*.py")):
        content = file.read_bytes().replace(b"\r\n", b"\n")
        result.update(f"{file.relative_to(root).as_posix()} {len(content)}\n".encode())
        result.update(content)
    return result.hexdigest()
