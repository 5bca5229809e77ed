"""A run as the report sees it, made of the plan alone, and a page as its reader does."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np

from feedsim.analysis import Figure, FigureTable, diagnoses
from feedsim.analysis.proposals import of_run
from feedsim.files.trace import Trace
from feedsim.foundation.errors import Finding
from feedsim.jobs.run import result_of
from feedsim.motions import Circle, Dwell, Move
from feedsim.report.page import Partial
from feedsim.scenario import CircleTest, Positioning, Scenario
from feedsim.simulation.cosim.loads import Work
from feedsim.simulation.judge import PoseUse
from feedsim.simulation.nc import Program, plan
from scenario_helpers import scenario


@dataclass(frozen=True)
class FakeRun:
    """A run as the report sees it; its trace is the plan with a delay, a ring-down and a friction step."""

    scenario: Scenario
    program: Program
    trace: Trace
    coupling: Mapping[str, float] = field(default_factory=lambda: {"Z.residual": 1.4e-5})
    wall_time: float = 0.5
    units: Mapping[str, Mapping[str, str]] = field(
        default_factory=lambda: {"plant": {"guid": "0011223344556677-8899aabbccddeeff", "version": "0.1.0"}}
    )
    pose: PoseUse | None = None
    warnings: tuple[Finding, ...] = ()
    loads: tuple[Work, ...] = ()
    log: Trace | None = None
    native: bool = True


def write_run(
    run: Any, figures: Mapping[str, Figure], folder: Path, recorded: Partial | None = None, *, drawn: Sequence[str] = ()
) -> tuple[Path, ...]:
    """What the job leaves of a run with these figures."""
    evaluated, causes = copy.copy(run), diagnoses(run)
    own = {"figures": FigureTable(figures), "causes": causes, "changes": of_run(run, causes, figures)}
    vars(evaluated).update(own, page="", uncertainty=None)
    return result_of(evaluated, recorded).save(folder, figures=drawn)


def run_of(described: Scenario, **changes: Any) -> FakeRun:
    program = plan(described)
    t = program.time
    columns: dict[str, Any] = {}
    for axis, x_s in program.x_s.items():
        n = program.n_ffw[axis]
        friction = 2.0 * np.tanh(n)
        ringing = 3e-6 * np.exp(-8 * t) * np.sin(130 * t)
        columns |= {
            f"{axis}.x_s": x_s,
            f"{axis}.x_a": x_s + ringing,
            f"{axis}.n_a": n,
            f"{axis}.M_fr": friction,
            f"{axis}.M_a": friction + 0.01 * np.gradient(n, t),
            f"{axis}.x_e": -ringing,
            f"tcp.x_{axis}": x_s + 1.2 * ringing,
        }
    return FakeRun(described, program, Trace(t, columns, dict.fromkeys(columns, "m")), **changes)


def positioning_run(**changes: Any) -> FakeRun:
    motions = (Move(by={"Z": 0.05}, feed=5 / 60), Dwell(duration=1.2))
    return run_of(scenario(*motions, evaluate=(Positioning(axis="Z"),), **changes))


def circle_run(**changes: Any) -> FakeRun:
    motions = (Circle(plane=("X", "Z"), radius=0.015, feed=0.1, turns=3), Dwell(duration=0.25))
    return run_of(scenario(*motions, evaluate=(CircleTest(),), **changes))


def small_run(**changes: Any) -> FakeRun:
    return run_of(scenario(Move(by={"X": 0.01}, feed=0.1)), **changes)


def contents(directory: Path) -> dict[str, bytes]:
    return {p.relative_to(directory).as_posix(): p.read_bytes() for p in sorted(directory.rglob("*")) if p.is_file()}


class Page(HTMLParser):
    """Ids, references and text of a page; fails on tags that are not closed."""

    VOID = ("meta", "img", "br", "link")

    def __init__(self, text: str) -> None:
        super().__init__()
        self.ids: list[str] = []
        self.references: list[str] = []
        self.tags: list[str] = []
        self.open: list[str] = []
        self.words: list[str] = []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        if tag not in self.VOID:
            self.open.append(tag)
        for name, value in attributes:
            if name == "id":
                self.ids.append(str(value))
            if name in ("src", "href", "xlink:href", "data", "action"):
                self.references.append(str(value))

    def handle_startendtag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attributes)
        if tag not in self.VOID:
            self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words.append(data)
