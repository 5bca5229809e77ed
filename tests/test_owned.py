"""What belongs to one process: who has it, what is left when it is killed, and what others then may."""

from __future__ import annotations

import gc
import os
import subprocess
import sys
import tempfile
import textwrap
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType

import pytest

from command_helpers import PATIENCE
from feedsim.files.trace import written_whole
from feedsim.foundation import outputs
from feedsim.foundation.errors import OutputError
from feedsim.foundation.outputs import TemporaryFolder, claim_folder, remove_orphans

ROOT = Path(__file__).resolve().parents[1]
pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")


@contextmanager
def another_process(code: str, folder: Path, *, kill: bool = False) -> Iterator[subprocess.Popen[str]]:
    """A process that has run `code` and waits; killed before the block if so asked, else ended behind it."""
    text = textwrap.dedent(code) + "\nprint('there', flush=True)\nsys.stdin.readline()\n"
    rooms = "from feedsim.foundation.outputs import *\nfrom feedsim.files.trace import written_whole\n"
    head = f"import sys\nfrom pathlib import Path\n{rooms}"
    process = subprocess.Popen(
        [sys.executable, "-c", head + text], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT / "master"), "TMPDIR": str(folder)},
    )  # fmt: skip
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == "there\n"
        if kill:
            process.kill()
            process.wait(PATIENCE)
        yield process
    finally:
        process.communicate("\n", timeout=PATIENCE)


CLAIM = "claim = claim_folder(Path('out/below'))\nclaim.__enter__()"


def test_a_folder_belongs_to_one_process(tmp_path: Path) -> None:
    folder = tmp_path / "out" / "below"
    with another_process(CLAIM, tmp_path) as process:
        with pytest.raises(OutputError) as told, claim_folder(folder):
            pass
        words = str(told.value)
        assert words.startswith(f"{folder}: another process writes its results there: process {process.pid} on ")
        assert words.endswith("; wait until it has ended, or take another directory")
    with claim_folder(folder):
        pass


def test_a_killed_process_keeps_nobody_waiting(tmp_path: Path) -> None:
    folder = tmp_path / "out" / "below"
    with another_process(CLAIM, tmp_path, kill=True):
        assert [path.name for path in folder.iterdir()] == [outputs.LOCK]
        with claim_folder(folder):
            (folder / "result").touch()
        assert [path.name for path in folder.iterdir()] == ["result"]


def test_what_is_made_goes_where_nothing_comes_of_it(tmp_path: Path) -> None:
    with claim_folder(tmp_path / "a" / "b"):
        assert (tmp_path / "a" / "b").is_dir()
    assert list(tmp_path.iterdir()) == []


def test_blocks_of_a_thread_may_stand_in_one_another_those_of_two_not(tmp_path: Path) -> None:
    told: list[str] = []

    def other() -> None:
        try:
            with claim_folder(tmp_path):
                told.append("had it")
        except OutputError as error:
            told.append(str(error))

    with claim_folder(tmp_path), claim_folder(tmp_path):
        thread = threading.Thread(target=other)
        thread.start()
        thread.join()
    assert len(told) == 1
    assert "another process" in told[0]


def test_many_take_turns_without_a_gap(tmp_path: Path) -> None:
    """The file that tells it is removed and made all the time; nobody may have one that another cannot see."""
    inside, most = [0], [0]
    guard = threading.Lock()

    def work() -> None:
        for _ in range(30):
            with claim_folder(tmp_path / "out", wait=60.0):
                with guard:
                    inside[0] += 1
                    most[0] = max(most[0], inside[0])
                with guard:
                    inside[0] -= 1

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert most == [1]
    assert {*tmp_path.rglob("*")} <= {tmp_path / "out"}  # which goes with who has made it, unless another has it then


def test_a_folder_that_comes_and_goes_is_no_file(tmp_path: Path) -> None:
    """Others make and remove it between any two looks of ours."""
    folder, done = tmp_path / "out", threading.Event()

    def others() -> None:
        while not done.is_set():
            with suppress(OSError):
                folder.mkdir()
            with suppress(OSError):
                folder.rmdir()

    thread = threading.Thread(target=others)
    thread.start()
    try:
        for _ in range(300):
            with claim_folder(folder, wait=60.0):
                pass
    finally:
        done.set()
        thread.join()


@pytest.mark.parametrize("elsewhere", [True, False])
def test_a_file_system_without_locks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, elsewhere: bool) -> None:
    """The folder for temporary files has some, for this machine; another machine's word has to be believed."""
    real, folder = outputs.lock_file, tmp_path / "out"
    (tmp_path / "tmp").mkdir()
    monkeypatch.setattr(outputs.tempfile, "tempdir", str(tmp_path / "tmp"))  # type: ignore[attr-defined]

    def locked(file: int) -> bool | None:
        return None if f"{folder}" in str(Path(f"/proc/self/fd/{file}").resolve()) else real(file)

    if not Path("/proc/self/fd").is_dir():
        pytest.skip("needs /proc")
    monkeypatch.setattr(outputs, "lock_file", locked)
    with claim_folder(folder):
        told: list[str] = []

        def other() -> None:
            with pytest.raises(OutputError) as error, claim_folder(folder):
                pass
            told.append(str(error.value))

        thread = threading.Thread(target=other)
        thread.start()
        thread.join()
        assert "another process" in told[0]
    assert list((tmp_path / "tmp").iterdir()) == []
    folder.mkdir()
    host = "elsewhere" if elsewhere else outputs.platform.node()  # type: ignore[attr-defined]
    (folder / outputs.LOCK).write_text(f"process 7 on {host} since 2020-01-01 00:00:00: feedsim run")
    if elsewhere:
        with pytest.raises(OutputError, match="not at work any more, remove that file"), claim_folder(folder):
            pass
    else:  # it has been killed: its lock on this machine is free
        with claim_folder(folder):
            pass


def test_temporary_folders_go_with_their_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(outputs.tempfile, "tempdir", str(tmp_path))  # type: ignore[attr-defined]
    for name in ("feedsim-another", "feedsim-ab12cd34", "mine"):  # not of ours, older than all this, another's
        (tmp_path / name).mkdir()
        (tmp_path / name / "file").touch()
    (tmp_path / "feedsim-00000000").symlink_to(tmp_path / "mine")
    (tmp_path / "mine" / outputs.LOCK).touch()
    there = set(tmp_path.iterdir())
    make = "folder = TemporaryFolder()\n(folder.path / 'a').mkdir()\n(folder.path / 'a' / 'b').touch()"
    with another_process(make, tmp_path):
        remove_orphans()
        assert len(set(tmp_path.iterdir()) - there) == 1, "its process lives"
    assert set(tmp_path.iterdir()) == there
    with another_process(make, tmp_path, kill=True):
        assert len(set(tmp_path.iterdir()) - there) == 1
        with TemporaryFolder() as own:
            assert set(tmp_path.iterdir()) == {*there, own.parent}, "the first use removes what is left"
    assert list(own.parent.iterdir()) == [own.parent / outputs.LOCK]
    assert (tmp_path / "mine" / "file").exists()


@pytest.mark.parametrize("lock", [False, True])
def test_a_signal_at_any_line_leaves_no_temporary_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lock: bool
) -> None:
    monkeypatch.setattr(outputs.tempfile, "tempdir", str(tmp_path))  # type: ignore[attr-defined]
    gc.collect()  # folders of other tests that go while this one looks at lines would end it
    interrupted, at = True, 0
    while interrupted:
        at, interrupted, left = at + 1, False, at

        def trace(frame: FrameType, event: str, given: object) -> object:
            nonlocal left
            if frame.f_code.co_filename == outputs.__file__ and event == "line":
                left -= 1
                if left < 0:
                    raise SystemExit(143)
            return trace

        sys.settrace(trace)
        try:
            with TemporaryFolder(tmp_path, lock=lock) as folder:
                (folder / "file").touch()
        except SystemExit:
            interrupted = True
        finally:
            sys.settrace(None)
        assert not list(tmp_path.iterdir()), f"interrupted at line {at} of those executed"
    assert at > 15


POOL = """
import multiprocessing, sys, time
from feedsim.foundation.outputs import TemporaryFolder
folders = []

def work(number):
    folders.extend(TemporaryFolder() for _ in range(3))

if __name__ == "__main__":
    multiprocessing.set_start_method(sys.argv[1])
    with multiprocessing.Pool(2) as pool:
        pool.map(work, range(8))
        if sys.argv[2] == "joined":
            pool.close()
            pool.join()
        else:  # at work, and not waiting for more, which they would be told there is none
            pool.map_async(time.sleep, [60.0] * 4)
            time.sleep(0.5)
"""


@pytest.mark.parametrize("method", ["fork", "spawn", "forkserver"])
def test_a_pool_of_processes_leaves_little_and_not_for_long(
    tmp_path: Path, method: str, request: pytest.FixtureRequest
) -> None:
    """`with Pool() as pool:` ends workers by SIGTERM: each leaves one folder, until the next first use."""
    script = tmp_path / "pool.py"
    script.write_text(POOL)
    # multiprocessing binds a socket there, whose path may have some hundred characters.
    short = tempfile.TemporaryDirectory()
    request.addfinalizer(short.cleanup)
    temporary = Path(short.name)
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "master"), "TMPDIR": str(temporary)}

    def left_by(end: str) -> set[Path]:
        subprocess.run([sys.executable, str(script), method, end], env=environment, check=True, timeout=PATIENCE)
        return set(temporary.glob("feedsim-*"))

    assert left_by("joined") == set()
    first = left_by("ended")
    assert 0 < len(first) <= 2
    second = left_by("ended")
    assert 0 < len(second) <= 2
    assert not first & second
    with another_process("folder = TemporaryFolder()", temporary):
        assert len(set(temporary.iterdir())) == 1
    assert not list(temporary.iterdir())


def test_a_file_that_was_not_finished_goes_with_the_next(tmp_path: Path) -> None:
    begin = "writer = written_whole(Path('x.csv'))\nfile = writer.__enter__()\nfile.write(b'half')\nfile.flush()"
    (tmp_path / ".x.csv.original").write_text("mine")
    with another_process(begin, tmp_path):
        with written_whole(tmp_path / "x.csv") as file:
            file.write(b"whole")
        assert len(list(tmp_path.iterdir())) == 3, "its process lives"
    with another_process(begin, tmp_path, kill=True):
        assert len(list(tmp_path.iterdir())) == 3
        with written_whole(tmp_path / "x.csv") as file:
            file.write(b"again")
    assert sorted(path.name for path in tmp_path.iterdir()) == [".x.csv.original", "x.csv"]
    assert (tmp_path / "x.csv").read_bytes() == b"again"
