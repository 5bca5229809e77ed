"""The journal: nothing is lost, nothing doubled, whatever ends the process and wherever."""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path
from random import Random

import pytest

from feedsim.design.sweep.design import Outcome
from feedsim.design.sweep.study import JOURNAL_NAME, Journal
from feedsim.foundation.errors import Finding, InputError

HEAD = {"study": "S", "fingerprint": "abc", "parts": {"plant.fmu": "1", "parameters": "2"}}
RUNS = 50
BEWARE = Finding("loop-unstable", "wrong", "beware", "Z", "machine.axes.Z.drive.K_v=4 1/s")


def outcome(run: int) -> Outcome:
    if run % 5 == 4:
        return Outcome(run, None, f"error of {run}:\n  ünit", 0.25)
    return Outcome(run, {"Z.a": (run / 3, "m"), "Z.b": (math.nan, "Hz")}, None, 0.5, (BEWARE,) * (run % 2))


def same(one: Outcome, two: Outcome) -> bool:
    return repr(one) == repr(two)  # NaN is not equal to itself


def test_what_is_written_is_read(tmp_path: Path) -> None:
    order = Random(1).sample(range(RUNS), RUNS)
    with Journal(tmp_path, HEAD, RUNS) as journal:
        assert [journal.add(outcome(run)) for run in order] == [True] * RUNS
        assert not journal.add(outcome(3))
        assert (len(journal.done), journal.failed, list(journal.missing())) == (RUNS, 10, [])
    with Journal(tmp_path, HEAD, RUNS) as journal:
        assert journal.resumed == RUNS
        for found, run in zip(journal.outcomes(), order, strict=True):
            assert same(found, outcome(run))


def test_cut_at_every_byte_of_its_last_lines(tmp_path: Path) -> None:
    with Journal(tmp_path / "whole", HEAD, RUNS) as journal:
        for run in range(6):
            journal.add(outcome(run))
    content = (tmp_path / "whole" / JOURNAL_NAME).read_bytes()
    ends = [i + 1 for i, byte in enumerate(content) if byte == ord("\n")]
    folder = tmp_path / "cut"
    folder.mkdir()
    for cut in range(len(content) + 1):
        if ends[0] < cut < ends[3]:
            continue  # the last lines, and the first one, are enough
        (folder / JOURNAL_NAME).write_bytes(content[:cut])
        with Journal(folder, HEAD, RUNS) as journal:
            whole = sum(end <= cut for end in ends)
            assert journal.resumed == max(whole - 1, 0), cut
            assert not journal.damaged
            for run in range(6):
                assert journal.add(outcome(run)) == (run >= journal.resumed)
        assert (folder / JOURNAL_NAME).read_bytes().splitlines()[1:] == content.splitlines()[1:], cut


def test_a_damaged_line_is_a_run_to_be_made_again(tmp_path: Path) -> None:
    with Journal(tmp_path, HEAD, RUNS) as journal:
        for run in range(5):
            journal.add(outcome(run))
    lines = (tmp_path / JOURNAL_NAME).read_bytes().splitlines(keepends=True)
    lines[2] = b"\0" * (len(lines[2]) - 1) + b"\n"
    (tmp_path / JOURNAL_NAME).write_bytes(b"".join(lines))
    with Journal(tmp_path, HEAD, RUNS) as journal:
        assert journal.damaged == (3,)
        assert sorted(journal.done) == [0, 2, 3, 4]
        assert journal.add(outcome(1))
        assert [found.run for found in journal.outcomes()] == [0, 2, 3, 4, 1]


def test_runs_of_another_study_are_refused(tmp_path: Path) -> None:
    with Journal(tmp_path, HEAD, RUNS) as journal:
        journal.add(outcome(0))
    other = {"study": "S", "fingerprint": "xyz", "parts": {"plant.fmu": "9", "parameters": "2"}}
    with pytest.raises(InputError, match=r"what differs: plant\.fmu .*--restart"):
        Journal(tmp_path, other, RUNS)
    with Journal(tmp_path, other, RUNS, restart=True) as journal:
        assert journal.resumed == 0
    assert len((tmp_path / JOURNAL_NAME).read_bytes().splitlines()) == 1


def test_a_file_that_is_no_journal_is_refused_and_kept(tmp_path: Path) -> None:
    (tmp_path / JOURNAL_NAME).write_text("my notes\n")
    with pytest.raises(InputError, match="not the journal of a study"):
        Journal(tmp_path, HEAD, RUNS)
    assert (tmp_path / JOURNAL_NAME).read_text() == "my notes\n"


@pytest.mark.parametrize("content", [b"my notes", b'{"format": 3', b'{"format": 2, "study": "T'])
def test_a_file_without_a_line_feed_that_is_no_journal_is_kept(tmp_path: Path, content: bytes) -> None:
    (tmp_path / JOURNAL_NAME).write_bytes(content)
    with pytest.raises(InputError, match="not the journal of a study"):
        Journal(tmp_path, HEAD, RUNS)
    assert (tmp_path / JOURNAL_NAME).read_bytes() == content
    with Journal(tmp_path, HEAD, RUNS, restart=True) as journal:
        assert journal.resumed == 0


def test_a_run_that_is_written_is_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An interrupt between the two."""
    write = Journal._write

    def interrupted(self: Journal, content: dict[str, object]) -> None:
        write(self, content)
        if content.get("run") == 2:
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(Journal, "_write", interrupted)
    with Journal(tmp_path, HEAD, RUNS) as journal:
        for run in range(3):
            if run < 2:
                journal.add(outcome(run))
            else:
                with pytest.raises(KeyboardInterrupt):
                    journal.add(outcome(run))
        assert journal.done == {0, 1, 2} == {found.run for found in journal.outcomes()}


def test_one_process_at_a_time(tmp_path: Path) -> None:
    code = f"""
        from pathlib import Path
        from feedsim.design.sweep.study import Journal
        from feedsim.foundation.errors import OutputError
        try:
            Journal(Path({str(tmp_path)!r}), {HEAD!r}, {RUNS})
        except OutputError as error:
            print(error)
    """
    with Journal(tmp_path, HEAD, RUNS):
        told = subprocess.run([sys.executable, "-c", textwrap.dedent(code)], capture_output=True, text=True, check=True)
        assert f"{tmp_path}: another process" in told.stdout
        assert f"process {os.getpid()} on " in told.stdout
    told = subprocess.run([sys.executable, "-c", textwrap.dedent(code)], capture_output=True, text=True, check=True)
    assert told.stdout == ""
    assert [path.name for path in tmp_path.iterdir()] == [JOURNAL_NAME]


@pytest.mark.extensive
@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs SIGKILL")
def test_killed_while_it_is_written(tmp_path: Path) -> None:
    """Five times killed at random moments: what was told to be added is there, once."""
    code = f"""
        import sys
        from pathlib import Path
        sys.path.insert(0, {str(Path(__file__).parent)!r})
        from test_journal import HEAD, outcome
        from feedsim.design.sweep.study import Journal
        with Journal(Path({str(tmp_path)!r}), HEAD, 10**6) as journal:
            for run in journal.missing():
                journal.add(outcome(run))
                print(run, flush=True)
    """
    random, told = Random(5), -1
    for _ in range(5):
        process = subprocess.Popen([sys.executable, "-c", textwrap.dedent(code)], stdout=subprocess.PIPE, text=True)
        assert process.stdout is not None
        told = max(told, int(process.stdout.readline()))
        time.sleep(random.uniform(0, 0.05))
        os.kill(process.pid, signal.SIGKILL)
        rest = [line for line in process.stdout.read().splitlines(keepends=True) if line.endswith("\n")]
        told = max([told, *map(int, rest)])
        process.stdout.close()
        process.wait()
    with Journal(tmp_path, HEAD, 10**6) as journal:
        assert set(range(told + 1)) <= journal.done <= set(range(told + 2))
        assert not journal.damaged
        runs = [found.run for found in journal.outcomes()]
    lines = (tmp_path / JOURNAL_NAME).read_bytes().splitlines()
    assert len(runs) == len(set(runs)) == len(lines) - 1
    assert all(json.loads(line) for line in lines)
