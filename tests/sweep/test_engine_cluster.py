"""The engine on a cluster of others: a scheduler and two workers on loopback that share no folder with the client."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from cluster_helpers import Cluster, scheduler
from engine_helpers import Chores, chore
from feedsim.errors import InputError, SimulationError
from feedsim.sweep import cluster, engine, same
from feedsim.sweep.engine import open_engine


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
    monkeypatch.setattr(engine, "LOST", 2.0)
    a_cluster.worker("one")
    with (  # noqa: PT012
        pytest.raises(SimulationError, match="the scheduler is lost; what is done is kept"),
        open_engine(Chores("lost"), scheduler=a_cluster.address) as made,
    ):
        for count, _ in enumerate(made.map(chore(i, data=0.02) for i in range(10_000))):
            if count == 20:
                a_cluster.processes[0].kill()


def test_no_workers(a_cluster: Cluster, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "JOIN", 0.5)
    with (
        pytest.raises(InputError, match=r"has no workers .*dask worker tcp://"),
        open_engine(Chores("nobody"), scheduler=a_cluster.address),
    ):
        pass


def test_another_version_is_refused(a_cluster: Cluster, monkeypatch: pytest.MonkeyPatch) -> None:
    a_cluster.worker("one")
    told = dict(same.told())
    for changed, message in (
        ({"feedsim": "9.9.9"}, r"worker tcp://.*: has feedsim .*, here is 9\.9\.9"),
        ({"sources": "0" * 64}, r"worker tcp://.*other sources"),
    ):
        monkeypatch.setattr(same, "told", lambda changed=changed: told | changed)
        with (
            pytest.raises(InputError, match=message),
            open_engine(Chores("version"), scheduler=a_cluster.address),
        ):
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
    answer = dict(same.told()) | {"numpy": "1.0"}
    (warning,) = same.differences({"tcp://a:1": answer, "tcp://b:2": dict(same.told())})
    assert warning.startswith("tcp://a:1: numpy 1.0 in place of ")
