"""The engine with work that misbehaves: workers killed, memory exhausted, interrupts, clusters of others."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from command_helpers import PATIENCE
from engine_helpers import Chore, Chores, chore
from feedsim.design.sweep.design import Outcome
from feedsim.design.sweep.engine import Engine, open_engine
from feedsim.foundation.errors import InputError

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def crowd(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Engine, Path]]:
    """Two local workers, and the folder where runs leave notes."""
    notes = tmp_path_factory.mktemp("notes")
    with open_engine(Chores("crowd", str(notes)), workers=2) as engine:
        yield engine, notes


@pytest.fixture
def notes(crowd: tuple[Engine, Path]) -> Path:
    for note in crowd[1].iterdir():
        note.unlink()
    return crowd[1]


def squares(outcomes: list[Outcome]) -> dict[int, float]:
    assert all(outcome.error is None for outcome in outcomes), [outcome.error for outcome in outcomes]
    assert len({outcome.run for outcome in outcomes}) == len(outcomes)
    return {outcome.run: outcome.figures["square"][0] for outcome in outcomes if outcome.figures}


def expected(count: int) -> dict[int, float]:
    return {run: float(run) ** 2 for run in range(count)}


def test_in_this_process() -> None:
    with open_engine(Chores("here"), workers=0) as engine:
        assert engine.workers == 0
        assert squares(list(engine.map(chore(i) for i in range(20)))) == expected(20)


def test_a_place_in_this_process_is_kept_from_map_to_map(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[str] = []
    opened = Chores.open
    monkeypatch.setattr(Chores, "open", lambda work, within=None: told.append("open") or opened(work, within))
    monkeypatch.setattr(Chore, "close", lambda place: told.append("close"))
    with open_engine(Chores("kept"), workers=0) as engine:
        for _ in range(2):
            assert squares(list(engine.map(chore(i) for i in range(3)))) == expected(3)
        assert told == ["open"]
    assert told == ["open", "close"]


def test_both_workers_make_runs(crowd: tuple[Engine, Path], notes: Path) -> None:
    engine = crowd[0]
    assert engine.workers == 2
    assert squares(list(engine.map(chore(i, data=0.01) for i in range(100)))) == expected(100)
    made = [note.name.split("-")[:2] for note in notes.iterdir()]
    assert sorted(int(run) for run, _ in made) == list(range(100))  # none twice
    processes = {int(process) for _, process in made}
    assert len(processes) == 2
    assert os.getpid() not in processes


def test_no_tasks(crowd: tuple[Engine, Path]) -> None:
    assert list(crowd[0].map([])) == []


def test_tasks_are_taken_as_they_are_needed(crowd: tuple[Engine, Path]) -> None:
    taken = 0

    def tasks() -> Iterator[object]:
        nonlocal taken
        for taken in range(10_000):
            yield chore(taken, data=0.02)

    outcomes = crowd[0].map(tasks())  # type: ignore[arg-type]
    for _ in range(50):
        next(outcomes)
    assert taken < 1000
    outcomes.close()  # type: ignore[attr-defined]


def test_a_worker_killed_from_outside_costs_no_outcome(crowd: tuple[Engine, Path], notes: Path) -> None:
    outcomes = []
    for outcome in crowd[0].map(chore(i, data=0.02) for i in range(150)):
        outcomes.append(outcome)
        if len(outcomes) == 20:
            os.kill(int(next(notes.iterdir()).name.split("-")[1]), signal.SIGKILL)
    assert squares(outcomes) == expected(150)


def test_a_run_that_kills_its_worker_once_is_made_on_another(crowd: tuple[Engine, Path], notes: Path) -> None:
    tasks = [chore(i, "kill once") if i == 7 else chore(i, data=0.02) for i in range(60)]
    assert squares(list(crowd[0].map(tasks))) == expected(60)
    assert len(list(notes.glob("7-*"))) >= 2


@pytest.mark.extensive
@pytest.mark.parametrize("way", ["kill", "segfault"])
def test_a_run_that_always_kills_its_worker_is_a_row(crowd: tuple[Engine, Path], notes: Path, way: str) -> None:
    tasks = [chore(i, way) if i == 11 else chore(i, data=0.02) for i in range(40)]
    outcomes = list(crowd[0].map(tasks))
    bad = [outcome for outcome in outcomes if outcome.error]
    assert [(outcome.run, outcome.error) for outcome in bad] == [(11, "given up: its worker process died, 3 times")]
    assert squares([outcome for outcome in outcomes if not outcome.error]) == {
        run: square for run, square in expected(40).items() if run != 11
    }
    assert len(list(notes.glob("11-*"))) <= 3


@pytest.mark.extensive
def test_exhausted_memory(crowd: tuple[Engine, Path], notes: Path) -> None:
    ways = {3: "exhaust", 5: "exhaust once"}
    tasks = [chore(i, ways.get(i, "sleep"), 0.01) for i in range(30)]
    outcomes = {outcome.run: outcome for outcome in crowd[0].map(tasks)}
    assert sorted(outcomes) == list(range(30))
    assert outcomes[3].error == "given up: its worker ran out of memory, 3 times"
    assert [run for run, outcome in outcomes.items() if outcome.error] == [3]


def test_an_interrupt_delivers_what_is_there(crowd: tuple[Engine, Path]) -> None:
    outcomes: list[Outcome] = []
    timer = threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT))
    with pytest.raises(KeyboardInterrupt):  # noqa: PT012
        for outcome in crowd[0].map(chore(i, data=0.02) for i in range(10_000)):
            outcomes.append(outcome)
            if len(outcomes) == 11:  # while further ones are waited for, however slow the machine is
                timer.start()
    assert 10 < len(squares(outcomes)) < 10_000
    # and the engine goes on working
    assert squares(list(crowd[0].map(chore(i) for i in range(5)))) == expected(5)


SCRIPT = """
import sys
sys.path[:0] = [{tests!r}, {master!r}]
from engine_helpers import Chore, Chores, chore
from feedsim.design.sweep.engine import open_engine
def study():
    with open_engine(Chores("script", {notes!r}), workers=2) as engine:
        print("open", flush=True)
        for outcome in engine.map(chore(i, data={seconds}) for i in range({count})):
            print(outcome.run, flush=True)
"""


def script(folder: Path, *, guarded: bool, count: int = 10, seconds: float = 0.01) -> Path:
    (folder / "notes").mkdir()
    (folder / "temporary").mkdir()
    text = SCRIPT.format(
        tests=str(ROOT / "tests"), master=str(ROOT / "master"), notes=str(folder / "notes"), count=count,
        seconds=seconds,
    )  # fmt: skip
    file = folder / "script.py"
    file.write_text(text + ("if __name__ == '__main__':\n    study()\n" if guarded else "study()\n"))
    return file


def started(file: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, str(file)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=file.parent,
        env={**os.environ, "TMPDIR": str(file.parent / "temporary")}, start_new_session=True,
    )  # fmt: skip


def workers_of(folder: Path) -> set[int]:
    return {int(note.name.split("-")[1]) for note in (folder / "notes").iterdir()}


def alive(process: int) -> bool:
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_a_script(tmp_path: Path) -> None:
    process = started(script(tmp_path, guarded=True))
    out, err = process.communicate(timeout=PATIENCE)
    assert (process.returncode, err) == (0, "")
    assert sorted(map(int, out.split()[1:])) == list(range(10))
    assert list((tmp_path / "temporary").iterdir()) == []


@pytest.mark.extensive
def test_a_script_without_a_guard_is_told_so(tmp_path: Path) -> None:
    process = started(script(tmp_path, guarded=False))
    out, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    assert "if __name__ == '__main__':" in err.splitlines()[-1]
    assert out == ""


@pytest.mark.extensive
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=["SIGINT", "SIGTERM"])
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc")
def test_a_signal_leaves_nothing_running(tmp_path: Path, number: int) -> None:
    """The whole process group gets it, as from a terminal."""
    process = started(script(tmp_path, guarded=True, count=100_000, seconds=0.05))
    assert process.stdout is not None
    while process.stdout.readline().strip() != "20":
        pass
    workers = workers_of(tmp_path)
    assert len(workers) == 2
    os.killpg(process.pid, number)
    _, err = process.communicate(timeout=PATIENCE)
    assert not any(alive(worker) for worker in workers)
    if number == signal.SIGINT:
        assert err.count("Traceback") == 1  # the script's own
        assert err.splitlines()[-1] == "KeyboardInterrupt"
    assert "Error" not in err


@pytest.mark.extensive
def test_a_killed_client_leaves_no_workers(tmp_path: Path) -> None:
    process = started(script(tmp_path, guarded=True, count=100_000, seconds=0.05))
    assert process.stdout is not None
    while process.stdout.readline().strip() != "20":
        pass
    process.kill()
    process.communicate(timeout=PATIENCE)
    end = time.monotonic() + PATIENCE
    while any(alive(worker) for worker in workers_of(tmp_path)) and time.monotonic() < end:
        time.sleep(0.05)
    assert not any(alive(worker) for worker in workers_of(tmp_path))


def test_wrong_requests() -> None:
    with pytest.raises(InputError, match="not both"), open_engine(Chores("wrong"), 2, "tcp://127.0.0.1:1"):
        pass
    with pytest.raises(InputError, match="at least 0"), open_engine(Chores("wrong"), -1):
        pass


def test_no_scheduler(monkeypatch: pytest.MonkeyPatch) -> None:
    from feedsim.design.sweep import trial

    monkeypatch.setattr(trial, "SCHEDULER_ANSWER_TIME", 1.0)
    with pytest.raises(InputError, match=r"no scheduler answers at tcp://127\.0\.0\.1:1: .*tcp://host:8786"):  # noqa: SIM117
        with open_engine(Chores("nobody"), scheduler="tcp://127.0.0.1:1"):
            pass


def test_temporary_folders_go(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with open_engine(Chores("tidy"), workers=1) as engine:
        list(engine.map([chore(0)]))
    assert list(tmp_path.glob("feedsim-*/feedsim-*")) == []  # in the one folder that this process has
