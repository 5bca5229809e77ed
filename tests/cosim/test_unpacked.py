"""What archives unpack to is there once for each content, and gone when nobody needs it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import threading
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from command_helpers import PATIENCE
from feedsim import scenario
from feedsim.foundation.errors import InputError
from feedsim.simulation import cosim, nc
from feedsim.simulation.cosim import unpacked
from feedsim.simulation.cosim.archive import Archive
from feedsim.simulation.cosim.unit import Unit
from feedsim.simulation.cosim.unpacked import STORE, Allowance
from ssp_helpers import short_scenario


@pytest.fixture(autouse=True)
def scratch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The folder that archives are unpacked in."""
    folder = tmp_path / "scratch"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    monkeypatch.setattr(STORE, "_contents", {})  # what other tests of this process may still use stays out of it
    yield folder
    STORE.clear()


def altered(archive: Path, out: Path, note: str) -> Path:
    """The archive with one more entry, which nobody reads."""
    shutil.copy(archive, out)
    with zipfile.ZipFile(out, "a") as package:
        package.writestr("documentation/note.txt", note)
    return out


def unpacked_in(scratch: Path) -> list[Path]:
    """What this process has in its one folder there."""
    return [*scratch.glob("feedsim-*/feedsim-*")]


def test_copies_share_a_folder(fmus: Path, tmp_path: Path, scratch: Path) -> None:
    copy = Path(shutil.copy(fmus / "friction.fmu", tmp_path / "other name.fmu"))
    with Archive(fmus / "friction.fmu") as one, Archive(copy) as other:
        assert one.directory == other.directory
        assert (one.path, other.path) == (fmus / "friction.fmu", copy)
    with Archive(copy) as again:
        assert again.directory == one.directory
    assert len(unpacked_in(scratch)) == 1


def test_an_archive_built_anew_under_its_name_is_noticed(fmus: Path, tmp_path: Path) -> None:
    file = Path(shutil.copy(fmus / "friction.fmu", tmp_path / "unit.fmu"))
    before = file.stat()
    with Archive(file) as old:
        altered(fmus / "friction.fmu", file, "new")
        os.utime(file, ns=(before.st_atime_ns, before.st_mtime_ns))
        with Archive(file) as new:
            assert new.directory != old.directory


def test_a_library_is_loaded_once_and_its_instances_are_their_own(fmus: Path) -> None:
    with Archive(fmus / "friction.fmu") as archive:
        one, other = Unit(archive, "one"), Unit(archive, "other")
        assert one.component != other.component
        assert one.library is other.library
        one.set_parameters({"F_C": 3.0})
        other.set_parameters({"F_C": 4.0})
        for unit in (one, other):
            unit.enter_initialisation(0.0, 1.0)
        assert (one.value("F_C"), other.value("F_C")) == (3.0, 4.0)
        one.close()
        assert other.value("F_C") == 4.0
        other.close()


def test_only_the_latest_are_kept(fmus: Path, tmp_path: Path, scratch: Path) -> None:
    with Archive(fmus / "friction.fmu") as in_use:
        for i in range(unpacked.MAX_UNUSED_CONTENTS + 3):
            with Archive(altered(fmus / "friction.fmu", tmp_path / f"{i}.fmu", str(i))) as last:
                assert last.directory.is_dir()
        assert len(unpacked_in(scratch)) == unpacked.MAX_UNUSED_CONTENTS + 1
        assert in_use.directory.is_dir()
        assert last.directory.is_dir()


def test_what_is_large_goes_with_its_last_user(fmus: Path, scratch: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(unpacked, "KEPT_SIZE", 1000)
    one, other = Archive(fmus / "friction.fmu"), Archive(fmus / "friction.fmu")
    one.close()
    one.close()  # once more is nothing
    assert other.directory.is_dir()
    other.close()
    assert not unpacked_in(scratch)


def test_an_allowance_counts_what_is_there_already(fmus: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = fmus / "friction.fmu"
    with Archive(file):
        allowance = Allowance(file)
        monkeypatch.setattr(allowance, "_limit", 10)
        with pytest.raises(InputError, match=r"unpacks to \d+ bytes or more"):
            Archive(file, allowance)
    STORE.clear()
    assert STORE._contents == {}  # the refused one is no user


def test_a_damaged_archive_leaves_nothing(tmp_path: Path, scratch: Path) -> None:
    file = tmp_path / "x.fmu"
    file.write_bytes(b"PK no zip")
    with pytest.raises(InputError, match="not a usable FMI 2"):
        Archive(file)
    assert not unpacked_in(scratch)


def test_threads_share(fmus: Path, scratch: Path) -> None:
    found: list[Path] = []

    def work() -> None:
        for _ in range(5):
            with Archive(fmus / "controller.fmu") as archive:
                unit = Unit(archive, "one")
                found.append(archive.directory)
                unit.close()

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 20
    assert len(set(found)) == len(unpacked_in(scratch)) == 1


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
def test_a_forked_process_has_its_own_and_leaves_its_parents(fmus: Path, scratch: Path) -> None:
    code = f"""
import os, sys, tempfile
from pathlib import Path
from feedsim.simulation.cosim.archive import Archive
from feedsim.simulation.cosim.unpacked import STORE
file = Path({str(fmus / "friction.fmu")!r})
idle = Archive(file).directory
open_one = Archive(file)
child = os.fork()
if child == 0:
    with Archive(file) as own:
        assert own.directory != idle
    open_one.close()
    STORE.clear()
    assert not own.directory.exists()
    sys.exit(0)  # through all that is done at the end of a process
assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
assert (idle / "modelDescription.xml").is_file()
"""
    environment = {**os.environ, "TMPDIR": str(scratch)}
    subprocess.run([sys.executable, "-c", code], check=True, env=environment, timeout=PATIENCE)
    assert not list(scratch.iterdir())  # the parent's went with it, closed or not


@pytest.mark.skipif(not Path("/proc/self/maps").exists(), reason="counts by /proc")
def test_many_runs_leave_no_more_than_one(fmus: Path, tmp_path: Path, scratch: Path) -> None:
    """Files, libraries, folders and memory of runs in one process."""
    loaded = scenario.load(short_scenario(tmp_path), ["motions.1.duration=10 ms"])
    program = nc.plan(loaded)

    def used() -> tuple[int, int, int]:
        maps = Path("/proc/self/maps").read_text(encoding="utf-8")
        return len(list(Path("/proc/self/fd").iterdir())), maps.count(str(scratch)), len(unpacked_in(scratch))

    def resident() -> int:
        return int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[1]) * os.sysconf("SC_PAGE_SIZE")

    for _ in range(20):  # allocators settle
        cosim.run(loaded, program=program, fmus=fmus)
    before, memory = used(), resident()
    for _ in range(200):
        cosim.run(loaded, program=program, fmus=fmus)
    assert used() == before
    # A run's records have some 0.5 MB, its seven instances as much again: one leaked kind would come to tens of MB.
    assert resident() - memory < 8 << 20


def test_the_bytes_of_an_archive_at_rest_are_read_once(
    fmus: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    read: list[int] = []
    real = unpacked.hashlib.file_digest  # type: ignore[attr-defined]

    def spy(file: Any, name: str) -> Any:
        read.append(1)
        return real(file, name)

    monkeypatch.setattr(unpacked.hashlib, "file_digest", spy)  # type: ignore[attr-defined]
    file = Path(shutil.copy(fmus / "friction.fmu", tmp_path / "unit.fmu"))
    for _ in range(2):  # just written: its times do not yet tell its states apart
        Archive(file).close()
    assert len(read) == 2
    monkeypatch.setattr(unpacked, "MIN_FILE_AGE", -(10**12))
    for _ in range(3):
        Archive(file).close()
    assert len(read) == 3
    with Archive(file) as old:
        altered(fmus / "friction.fmu", file, "new")
        with Archive(file) as new:
            assert new.directory != old.directory
    assert len(read) == 4


@pytest.mark.parametrize("lost", ["modelDescription.xml", "everything"])
@pytest.mark.parametrize("in_use", [False, True])
def test_what_a_cleaner_took_away_is_unpacked_anew(fmus: Path, scratch: Path, lost: str, in_use: bool) -> None:
    """A folder for temporary files is emptied of what has been idle for some days; a process may live longer."""
    old = Archive(fmus / "friction.fmu")
    Unit(old, "one").close()
    if not in_use:
        old.close()
    if lost == "everything":
        shutil.rmtree(old.directory)
    else:
        (old.directory / lost).unlink()
    with Archive(fmus / "friction.fmu") as new:
        assert new.directory != old.directory
        assert (new.directory / "modelDescription.xml").is_file()
        unit = Unit(new, "two")
        unit.close()
    old.close()
    del old
    with Archive(fmus / "friction.fmu") as again:
        assert again.directory == new.directory
    assert unpacked_in(scratch) == [new.directory]


def test_a_file_cut_short_is_noticed(fmus: Path) -> None:
    with Archive(fmus / "friction.fmu") as old:
        pass
    (old.directory / "modelDescription.xml").write_bytes(b"")
    with Archive(fmus / "friction.fmu") as new:
        assert new.directory != old.directory


WORKERS = """
import multiprocessing, sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from feedsim.simulation.cosim.archive import Archive
opened = []
def work(file):
    with Archive(file) as archive:
        pass
    opened.append(Archive(file))  # one that nobody closes
    return str(archive.directory)
file = Path(sys.argv[1])
if sys.argv[3] == "before":
    Archive(file).close()
context = multiprocessing.get_context("fork")
if sys.argv[2] == "pool":
    pool = context.Pool(2)
    found = pool.map(work, [file] * 4)
    pool.close()
    pool.join()
else:
    with ProcessPoolExecutor(2, context) as executor:
        found = list(executor.map(work, [file] * 4))
print(*set(found))
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
@pytest.mark.parametrize("kind", ["pool", "executor"])
@pytest.mark.parametrize("begun", ["before", "after"])
def test_forked_workers_leave_nothing(kind: str, begun: str, fmus: Path, scratch: Path) -> None:
    words = [sys.executable, "-c", WORKERS, str(fmus / "friction.fmu"), kind, begun]
    environment = {**os.environ, "TMPDIR": str(scratch)}
    done = subprocess.run(words, check=True, env=environment, timeout=PATIENCE, capture_output=True, text=True)
    assert done.stdout.split()
    assert not list(scratch.iterdir())


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
def test_a_lock_held_while_forking_is_renewed(fmus: Path, scratch: Path) -> None:
    """Another thread of the parent may be loading a library at that moment."""
    code = f"""
import os, signal
from pathlib import Path
from feedsim.simulation.cosim.archive import Archive
from feedsim.simulation.cosim.unit import Unit
from feedsim.simulation.cosim.unpacked import STORE
STORE.loading.acquire()
child = os.fork()
if child == 0:
    signal.alarm(20)
    with Archive(Path({str(fmus / "friction.fmu")!r})) as own:
        Unit(own, "one").close()
    STORE.clear()
    os._exit(0)
assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
"""
    subprocess.run(
        [sys.executable, "-c", code], check=True, timeout=PATIENCE, env={**os.environ, "TMPDIR": str(scratch)}
    )
