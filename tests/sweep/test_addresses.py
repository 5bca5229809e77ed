"""Addresses of schedulers, and a scheduler whose workers are still to come."""

from __future__ import annotations

import distributed
import pytest

from feedsim.design.sweep import trial
from feedsim.foundation.errors import InputError


@pytest.mark.parametrize(
    "address",
    ["127.0.0.1", "tcp://node1", "tcp://node1:", "node1:0", "tcp://node1:99999", "tcp://:8786", "a b:8786", ""],
)
def test_no_address_is_told_at_once(
    address: str, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nobody is asked: Dask itself would wait for 20 s."""
    monkeypatch.setattr(distributed, "Client", lambda *_, **__: pytest.fail("somebody was asked"))
    with pytest.raises(InputError, match="an address reads tcp://host:8786"), trial.remote(address):
        pass
    assert "Traceback" not in capfd.readouterr().err


@pytest.mark.parametrize(
    "address", ["tcp://node1:8786", "node1:8786", "tls://10.0.0.1:1", "tcp://[::1]:8786", "ws://a-b.c:80/"]
)
def test_addresses(address: str) -> None:
    trial._check_address(address)


def test_waiting_for_workers_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    from distributed import LocalCluster

    monkeypatch.setattr(trial, "WORKER_JOIN_TIME", 0.5)
    told: list[str] = []
    with LocalCluster(
        n_workers=0, processes=False, protocol="tcp", host="127.0.0.1", dashboard_address="127.0.0.1:0", silence_logs=50
    ) as made:
        with pytest.raises(InputError, match="has no workers"), trial.remote(made.scheduler_address, told.append):
            pass
        assert len(told) == 1
        assert "waiting for workers" in told[0]
        made.scale(1)
        made.wait_for_workers(1, timeout=120)
        with trial.remote(made.scheduler_address, told.append):
            assert len(told) == 1  # not where there is one
