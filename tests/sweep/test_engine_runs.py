"""Runs of a scenario by the engine: the same figures to the last bit, whoever makes them and whatever dies."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

from cluster_helpers import scheduler
from feedsim import analysis
from feedsim.design.sweep.bundle import Bundle
from feedsim.design.sweep.design import Outcome, Task
from feedsim.design.sweep.engine import open_engine
from feedsim.foundation import units
from feedsim.foundation.errors import Finding
from feedsim.scenario import Base, Change, load
from feedsim.simulation import cosim
from feedsim.simulation.judge import judge_run
from feedsim_packager import native, toolchain

ROOT = Path(__file__).resolve().parents[2]
SCENARIOS = ROOT / "scenarios"
SHORT = ["motions.0.by.Z=1 mm", "motions.1.duration=0.05 s", "evaluate.0.band=1 mm"]
F_C = "machine.axes.Z.friction.F_C"
RUNS = 24
# Rows that fail, each in a way of its own: (change, what the row says).
BAD = {
    7: (Change(F_C, "-1 N.m", "-1 N.m"), "outside the allowed range"),
    19: (Change("motions.0.by.Z", "5 m", "5 m"), "allowed travel 0 to 685 mm"),
}
# A run that goes through and warns of what it found.
WILD, WILD_CHANGE = 23, Change("machine.axes.Z.drive.K_p", "1e4 N.m.s/rad", "1e4 N.m.s/rad")


def tasks(count: int = RUNS) -> Iterator[Task]:
    for run in range(count):
        if run in BAD:
            yield Task(run, (BAD[run][0],))
        elif run == WILD:
            yield Task(run, (WILD_CHANGE,))
        else:
            torque = f"{1 + 0.04 * run:.17g} N.m"
            yield Task(run, (Change(F_C, torque, torque),))


Rows = dict[int, tuple[str, str, tuple[Finding, ...]]]


def rows(outcomes: Iterable[Outcome]) -> Rows:
    """What a table shows of them, each once; repr tells doubles apart, and NaN from NaN not."""
    found = {}
    for outcome in outcomes:
        assert outcome.run not in found
        figures = {} if outcome.figures is None else dict(outcome.figures)
        found[outcome.run] = (repr(sorted(figures.items())), repr(outcome.error), outcome.warnings)
    return found


@pytest.fixture(scope="module")
def bundle(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    """Of files that are not there any more when it is used."""
    folder = tmp_path_factory.mktemp("study")
    shutil.copytree(SCENARIOS / "machines", folder / "machines")
    shutil.copy(SCENARIOS / "z_positioning.yaml", folder)
    archives = folder / "fmus"
    archives.mkdir()
    for unit in ("plant", "controller", "friction"):
        shutil.copy(fmus / f"{unit}.fmu", archives)
    native.build("exchange", archives, toolchain.find_compiler())
    base = Base.read(folder / "z_positioning.yaml", SHORT)
    found = Bundle.of_base(base, base.files, archives)
    shutil.rmtree(folder)
    return found


@pytest.fixture(scope="module")
def reference(bundle: Bundle) -> Rows:
    with open_engine(bundle, workers=0) as engine:
        return rows(engine.map(tasks()))


def test_figures_are_those_of_a_run_alone(fmus: Path, reference: Rows) -> None:
    run = 12
    (change,) = next(task for task in tasks() if task.run == run).changes
    result = judge_run(cosim.run(load(SCENARIOS / "z_positioning.yaml", [*SHORT, change.option]), fmus=fmus))
    figures = analysis.evaluate(result)
    expected = {
        name: (units.convert(figure.value, figure.unit, unit), unit)
        for name, figure in figures.items()
        for unit in [{"um": "m", "ms": "s"}.get(figure.unit, figure.unit)]
    }
    assert reference[run] == (repr(sorted(expected.items())), "None", result.warnings)


def test_failures_are_rows(reference: Rows) -> None:
    assert sorted(reference) == list(range(RUNS))
    assert {run for run, (_, error, _) in reference.items() if error != "None"} == set(BAD)
    for run, (_, message) in BAD.items():
        figures, error, _ = reference[run]
        assert figures == "[]"
        assert message in error
        assert "feedsim-" not in error  # no folder of the worker
    # What follows from it is left out.
    assert {finding.code for finding in reference[WILD][2]} == {"loop-unstable"}


def test_two_local_workers(bundle: Bundle, reference: Rows) -> None:
    with open_engine(bundle, workers=2) as engine:
        assert rows(engine.map(tasks())) == reference


@pytest.mark.extensive
def test_a_cluster_that_shares_no_folder(bundle: Bundle, reference: Rows, tmp_path: Path) -> None:
    """A scheduler and two workers; one is killed for good in the middle of the study."""
    with scheduler(tmp_path / "cluster") as cluster:
        workers = [cluster.worker(name, "--no-nanny") for name in ("one", "two")]
        cluster.wait_for(2)
        outcomes = []
        with open_engine(bundle, scheduler=cluster.address) as engine:
            assert engine.workers == 2
            for outcome in engine.map(tasks()):
                outcomes.append(outcome)
                if len(outcomes) == 5:
                    workers[1].kill()
        assert rows(outcomes) == reference
        # Nothing stays with the worker that is left.
        end = time.monotonic() + 120
        while (left := archives_in(cluster.folder / "one")) and time.monotonic() < end:
            time.sleep(0.05)
        assert not left


def archives_in(folder: Path) -> list[str]:
    """In a folder of which parts may just be removed."""
    return [name for *_, names in os.walk(folder) for name in names if name.endswith(".fmu")]


def test_the_digest_tells_bundles_apart(bundle: Bundle) -> None:
    same = Bundle(bundle.base, dict(bundle.files), dict(bundle.fmus), bundle.native)
    assert same.digest == bundle.digest
    name = next(iter(bundle.files))
    other = Bundle(bundle.base, {**bundle.files, name: bundle.files[name] + b"\n"}, bundle.fmus, bundle.native)
    assert other.digest != bundle.digest


def test_a_native_loop_of_another_platform_stays_away(bundle: Bundle) -> None:
    assert bundle.native is not None
    foreign = Bundle(bundle.base, bundle.files, bundle.fmus, (b"no library", "other-platform"))
    with open_engine(foreign, workers=0) as engine:
        (outcome,) = engine.map([next(tasks())])
    with open_engine(bundle, workers=0) as engine:
        (expected,) = engine.map([next(tasks())])
    assert rows([outcome]) == rows([expected])  # Python's loop gives the same bits
