"""The engine on a cluster of others: a scheduler and two workers on loopback that share no folder with the client."""

from __future__ import annotations

import os
import signal
import time
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from cluster_helpers import Cluster, scheduler
from engine_helpers import Chores, chore
from feedsim.design.sweep import engine, provenance, trial
from feedsim.design.sweep.design import Outcome, Task
from feedsim.design.sweep.engine import open_engine
from feedsim.foundation.errors import InputError, SimulationError

pytestmark = pytest.mark.extensive


@pytest.fixture
def a_cluster(tmp_path: Path) -> Iterator[Cluster]:
    with scheduler(tmp_path / "cluster") as found:
        yield found


def test_a_killed_worker_costs_no_outcome(a_cluster: Cluster) -> None:
    """Workers without a nanny: the killed one does not come back."""
    workers = [a_cluster.worker(name, "--no-nanny") for name in ("one", "two")]
    outcomes = []
    a_cluster.wait_for(2)
    with open_engine(Chores("cluster"), scheduler=a_cluster.address) as made:
        assert made.workers == 2
        for outcome in made.map(chore(i, data=0.02) for i in range(200)):
            outcomes.append(outcome)
            if len(outcomes) == 30:
                workers[0].kill()
    assert {outcome.run: outcome.figures["square"][0] for outcome in outcomes if outcome.figures} == {
        run: float(run) ** 2 for run in range(200)
    }
    assert len(outcomes) == 200


def test_a_lost_scheduler_is_told(a_cluster: Cluster, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engine, "SCHEDULER_LOSS_TIME", 2.0)
    a_cluster.worker("one")
    with (  # noqa: PT012
        pytest.raises(SimulationError, match="the scheduler is lost; what is done is kept"),
        open_engine(Chores("lost"), scheduler=a_cluster.address) as made,
    ):
        for count, _ in enumerate(made.map(chore(i, data=0.02) for i in range(10_000))):
            if count == 20:
                a_cluster.processes[0].kill()


def test_studies_of_the_same_work_leave_each_other_alone(a_cluster: Cluster) -> None:
    a_cluster.worker("one")
    work = Chores("same")
    with open_engine(work, scheduler=a_cluster.address) as long:
        outcomes = long.map(chore(i, data=0.02) for i in range(100))
        found = [next(outcomes)]
        with open_engine(work, scheduler=a_cluster.address) as short:
            assert len(list(short.map(chore(i) for i in range(5)))) == 5
        found += outcomes
    assert sorted(outcome.run for outcome in found if outcome.error is None) == list(range(100))


@dataclass
class Kept:
    """Work, and its place, that tells how often it was laid out and left."""

    digest: str = "kept"
    opened: int = 0
    closed: int = 0

    def open(self, within: Path | None = None) -> Kept:
        self.opened += 1
        return self

    def run(self, task: Task) -> Outcome:
        return Outcome(task.run, {})

    def close(self) -> None:
        self.closed += 1


def test_a_place_is_kept_as_long_as_anybody_needs_it(tmp_path: Path) -> None:
    work, host = Kept(), SimpleNamespace(address="tcp://here:1", local_directory=str(tmp_path))
    first, second = (engine.Carrier(work, provenance.versions()) for _ in range(2))
    for carrier in (first, second):
        carrier.setup(host)
        assert len(engine.work_batch(carrier.key, (chore(0),), 1.0).outcomes) == 1
    assert work.opened == 1
    for carrier, closed in ((first, 0), (second, 1)):
        carrier.teardown(host)
        engine._clear_place(work.digest)  # as its thread does
        assert work.closed == closed
    assert engine._carriers.keys().isdisjoint({first.key, second.key})


def test_a_result_that_dies_with_its_worker_is_waited_for(a_cluster: Cluster, monkeypatch: pytest.MonkeyPatch) -> None:
    """Dask makes it again, which takes longer than a result has to arrive."""
    for name in ("one", "two"):
        a_cluster.worker(name, "--no-nanny")
    a_cluster.wait_for(2)
    monkeypatch.setattr(engine, "FETCH_TIME", 0.5)
    fetch, killed = engine._Flight._outcomes, list[str]()

    def fetch_too_late(flight: engine._Flight, future: Any) -> list[Outcome]:
        if not killed:
            killed.extend(flight._client.who_has([future])[future.key])
            process = flight._client.run(os.getpid, workers=killed)[killed[0]]
            os.kill(process, signal.SIGKILL)
            time.sleep(0.5)
        return fetch(flight, future)

    monkeypatch.setattr(engine._Flight, "_outcomes", fetch_too_late)
    with open_engine(Chores("late"), scheduler=a_cluster.address) as made:
        found = list(made.map(chore(i, data=2.0) for i in range(3)))
    assert len(killed) == 1
    assert sorted(outcome.run for outcome in found if outcome.error is None) == [0, 1, 2]


OTHER = (
    "import feedsim.design.sweep.provenance as p; own = dict(p.versions(), feedsim='0.0.0'); p.versions = lambda: own"
)
OTHERS = {
    "that says so": OTHER,
    "that takes other batches": f"{OTHER}; import feedsim.design.sweep.engine as worker; worker.work_batch = len",
}


@pytest.mark.parametrize("other", OTHERS)
def test_a_late_worker_that_cannot_take_part_is_left_out(
    a_cluster: Cluster, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, other: str
) -> None:
    monkeypatch.setattr(engine, "WORKER_LOSS_TIME", 2.0)
    able = a_cluster.worker("one", "--no-nanny")
    with open_engine(Chores(other), scheduler=a_cluster.address) as made:
        outcomes = made.map(chore(i, data=0.02) for i in range(100_000))
        found = [next(outcomes)]
        for name in ("two", "three"):
            a_cluster.worker(name, "--no-nanny", "--preload", OTHERS[other])
        a_cluster.wait_for(3)
        end = time.monotonic() + 120
        while len(made.refused) < 2 and time.monotonic() < end:  # type: ignore[attr-defined]
            found.append(next(outcomes))
        found += [next(outcomes) for _ in range(100)]
        assert all(outcome.error is None for outcome in found)
        assert len({outcome.run for outcome in found}) == len(found)
        (warning,) = made.warnings
        assert warning.code == "worker-left-out"
        assert warning.place.startswith("tcp://")
        assert [record.getMessage() for record in caplog.records if record.name == engine.__name__] == [warning.text]

        able.kill()
        with pytest.raises(InputError, match=r"worker tcp://.*: has"):
            deque(outcomes, maxlen=0)


def test_no_workers(a_cluster: Cluster, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trial, "WORKER_JOIN_TIME", 0.5)
    with (
        pytest.raises(InputError, match=r"has no workers .*dask worker tcp://"),
        open_engine(Chores("nobody"), scheduler=a_cluster.address),
    ):
        pass


def test_another_version_is_refused(a_cluster: Cluster, monkeypatch: pytest.MonkeyPatch) -> None:
    a_cluster.worker("one")
    told = dict(provenance.versions())
    for changed, message in (
        ({"feedsim": "9.9.9"}, r"worker tcp://.*: has feedsim .*, here is 9\.9\.9"),
        ({"sources": "0" * 64}, r"worker tcp://.*other sources"),
    ):
        monkeypatch.setattr(provenance, "versions", lambda changed=changed: told | changed)
        with pytest.raises(InputError, match=message), open_engine(Chores("version"), scheduler=a_cluster.address):
            pass


def test_a_worker_without_feedsim_is_refused(a_cluster: Cluster) -> None:
    hidden = "import sys; sys.modules['feedsim'] = None"
    a_cluster.worker("one", "--preload", hidden)
    with (
        pytest.raises(InputError, match=r"worker tcp://.*: has no feedsim"),
        open_engine(Chores("without"), scheduler=a_cluster.address),
    ):
        pass


def test_other_packages_are_warned_of() -> None:
    answer = dict(provenance.versions()) | {"numpy": "1.0"}
    (warning,) = provenance.differences({"tcp://a:1": answer, "tcp://b:2": dict(provenance.versions())})
    assert (warning.code, warning.place) == ("workers-differ", "tcp://a:1")
    assert "numpy 1.0 in place of " in warning.text
