"""The importers that the units are tried in: what runs a system in each, and why it is not here where it is not."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

from importers import with_cargo, with_container, with_ecos, with_fmpy, with_fmuloader, with_libcosim, with_maestro
from importers.loops import Master
from importers.system import Experiment, Result, System

Run = Callable[[System, Experiment, Path], Result]


@dataclass(frozen=True)
class Importer:
    """A simulator and how it goes about a wired system.

    Attributes:
        how: which of its ways; empty where it has one.
        missing: why it cannot run here; empty where it can.
        master: our imitation of it.
        does: the same in words, for the documents.
    """

    name: str
    how: str
    version: Callable[[], str]
    missing: Callable[[], str]
    run: Run
    master: Master
    does: str

    @property
    def label(self) -> str:
        return f"{self.name} {self.how}".strip()

    @property
    def sequential(self) -> bool:
        return self.master.sequential


def _package(module: str, distribution: str) -> tuple[Callable[[], str], Callable[[], str]]:
    """Version, and reason to be missing, of a Python package."""

    def missing() -> str:
        try:
            if module == "ecospy":
                with_ecos.load()
            importlib.import_module(module)
        except (ImportError, OSError) as error:
            return f"{distribution} cannot be loaded: {error}"
        return ""

    return lambda: metadata.version(distribution), missing


def _cargo(name: str) -> tuple[Callable[[], str], Callable[[], str]]:
    """Version, and reason to be missing, of a program that cargo builds."""
    absent = f"{name} is built by `make test-importers` (Rust's cargo)"
    return lambda: with_cargo.VERSIONS[name], lambda: "" if with_cargo.program(name) else absent


_NO_MAESTRO = "Maestro is installed by `make test-importers` (Java and Maven)"
_FMPY = _package("fmpy", "fmpy")
_CONTAINER = _package("fmu_manipulation_toolbox", "fmu-manipulation-toolbox")

IMPORTERS = (
    Importer(
        "ecos",
        "",
        *_package("ecospy", "ecospy"),
        lambda system, experiment, folder: with_ecos.run(system, experiment),
        Master(),
        "all units in parallel",
    ),
    Importer(
        "libcosim",
        "",
        *_package("libcosimpy", "libcosimpy"),
        lambda system, experiment, folder: with_libcosim.run(system, experiment),
        Master(),
        "all units in parallel; time in whole nanoseconds, so steps differ by rounding",
    ),
    Importer(
        "Maestro",
        "",
        lambda: with_maestro.VERSION,
        lambda: "" if with_maestro.jar() else _NO_MAESTRO,
        with_maestro.run,
        Master(),
        "all units in parallel",
    ),
    Importer(
        "fmucontainer",
        "",
        *_CONTAINER,
        with_container.run,
        Master(settled=False),
        "all units in parallel; units in a loop are initialised with the start values of their inputs",
    ),
    Importer(
        "fmucontainer",
        "`-sequential`",
        *_CONTAINER,
        lambda system, experiment, folder: with_container.run(system, experiment, folder, sequential=True),
        Master(sequential=True, settled=False),
        "one unit after the other in the order of the file",
    ),
    Importer(
        "FMPy",
        "SSP runner",
        *_FMPY,
        with_fmpy.run,
        Master(settled=False, zeros=True),
        "all units in parallel; the first step is made with 0 on every connected input",
    ),
)

SINGLE = (
    Importer(
        "fmi-sim",
        "",
        *_cargo("fmi-sim"),
        with_cargo.run_sim,
        Master(),
        "steps one unit; time as a sum of steps",
    ),
    Importer(
        "fmu-runner",
        "",
        *_cargo("fmu-runner"),
        with_cargo.run_runner,
        Master(),
        "steps one unit",
    ),
    Importer(
        "fmuloader",
        "",
        *_package("fmuloader", "fmuloader"),
        with_fmuloader.run,
        Master(),
        "steps one unit",
    ),
)
"""Those that step one unit and wire none."""
