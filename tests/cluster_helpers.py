"""Clusters for the tests of the engine."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from distributed import Client

ROOT = Path(__file__).resolve().parents[1]


@dataclass
class Cluster:
    folder: Path
    address: str = ""
    processes: list[subprocess.Popen[bytes]] = field(default_factory=list)

    def start(self, name: str, *command: str, **environment: str) -> subprocess.Popen[bytes]:
        """In a folder of its own, with temporary files of its own."""
        folder = self.folder / name
        (folder / "temporary").mkdir(parents=True)
        environment = {
            **os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT / "master"), str(ROOT / "tests")]),
            "TMPDIR": str(folder / "temporary"), "FEEDSIM_FMUS": str(folder / "none"), **environment,
        }  # fmt: skip
        with (folder / "log").open("wb") as log:
            process = subprocess.Popen(
                [sys.executable, "-m", *command], cwd=folder, env=environment, stdout=log, stderr=log,
                start_new_session=True,
            )  # fmt: skip
        self.processes.append(process)
        return process

    def worker(self, name: str, *options: str, **environment: str) -> subprocess.Popen[bytes]:
        return self.start(
            name, "distributed.cli.dask_worker", self.address, "--nthreads", "1", "--no-dashboard", "--name", name,
            "--host", "127.0.0.1", *options, **environment,
        )  # fmt: skip

    def wait_for(self, workers: int) -> None:
        with Client(self.address, set_as_default=False) as client:
            client.wait_for_workers(workers, timeout=120)

    def close(self) -> None:
        for process in self.processes:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()


@contextmanager
def scheduler(folder: Path) -> Iterator[Cluster]:
    """A scheduler on loopback, without workers; `folder`: for what its processes write."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    found = Cluster(folder, f"tcp://127.0.0.1:{port}")
    try:
        found.start(
            "scheduler", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard",
            "--no-show", "--dashboard-address", "127.0.0.1:0",
        )  # fmt: skip
        end = time.monotonic() + 120
        while time.monotonic() < end:
            try:
                socket.create_connection(("127.0.0.1", port), timeout=1).close()
                break
            except OSError:
                time.sleep(0.05)
        yield found
    finally:
        found.close()
