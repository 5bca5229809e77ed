"""Where output goes when its place is no plain file: links stay, pipes and devices are written to, the rest refused."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from feedsim.files.trace import written_whole
from feedsim.foundation.errors import OutputError
from feedsim.simulation.ssp import archive as ssp_archive
from feedsim_packager import archive
from feedsim_packager import errors as packager_errors

pytestmark = pytest.mark.skipif(os.name != "posix", reason="pipes and links of POSIX")
CONTENT = b"what is written"


def whole(path: Path, content: bytes) -> None:
    with written_whole(path) as file:
        file.write(content)


WRITERS = [whole, archive.write]
REFUSED = (OutputError, packager_errors.OutputError)
of_both = pytest.mark.parametrize("write", WRITERS, ids=["master", "packager"])
Write = Callable[[Path, bytes], None]


def received(pipe: Path, write: Callable[[], object]) -> bytes:
    found: list[bytes] = []
    reader = threading.Thread(target=lambda: found.append(pipe.read_bytes()), daemon=True)
    reader.start()
    write()
    reader.join(10)
    return found[0]


@of_both
def test_a_pipe_is_written_to(write: Write, tmp_path: Path) -> None:
    pipe, link = tmp_path / "pipe", tmp_path / "link"
    os.mkfifo(pipe)
    link.symlink_to(pipe)
    for path in (pipe, link):
        assert received(pipe, lambda path=path: write(path, CONTENT)) == CONTENT
    assert pipe.is_fifo()
    assert link.is_symlink()
    assert len(list(tmp_path.iterdir())) == 2


@of_both
def test_what_a_link_leads_to_is_replaced(write: Write, tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    target, link, new = tmp_path / "there" / "target", tmp_path / "link", tmp_path / "new"
    target.write_bytes(b"old")
    link.symlink_to(Path("there", "target"))
    new.symlink_to(Path("there", "made"))  # leads to nothing yet
    for path in (link, new):
        write(path, CONTENT)
        assert path.is_symlink()
        assert path.read_bytes() == CONTENT
    assert sorted(path.name for path in target.parent.iterdir()) == ["made", "target"]


@of_both
def test_sockets_and_circles_of_links_are_refused(
    write: Write, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)  # names of sockets are short
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind("socket")
        Path("circle").symlink_to("circle")
        for name in ("socket", "circle"):
            with pytest.raises(REFUSED, match=rf"{name}.* cannot be written|cannot write {name}"):
                write(Path(name), CONTENT)
        assert Path("socket").is_socket()
        assert Path("circle").is_symlink()
        assert len(list(Path().iterdir())) == 2


def test_an_ssp_file_into_a_pipe(tmp_path: Path) -> None:
    """Zip files are written with jumps back, which a pipe cannot do."""
    pipe, plain = tmp_path / "pipe.ssp", tmp_path / "plain.ssp"
    os.mkfifo(pipe)
    files = {"SystemStructure.ssd": b"x" * 100_000}
    size = ssp_archive.write(plain, files)
    assert received(pipe, lambda: ssp_archive.write(pipe, files)) == plain.read_bytes()
    assert size == plain.stat().st_size


def test_nothing_goes_into_a_pipe_when_the_block_fails(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)

    def half() -> None:
        with written_whole(pipe) as file:  # nobody reads: opening the pipe would wait for ever
            file.write(CONTENT)
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        half()


@pytest.mark.skipif(not Path("/proc/self/fd").is_dir(), reason="open files have no names here")
@pytest.mark.parametrize("kind", ["pipe", "file"])
def test_standard_output(kind: str, tmp_path: Path) -> None:
    """By a link, as /dev/stdout is one. What the command prints itself stays, in its order."""
    link = tmp_path / "stdout"
    link.symlink_to("/proc/self/fd/1")
    code = (
        "import sys; from pathlib import Path; from feedsim.files.trace import written_whole\nprint('before')\n"
        "with written_whole(Path(sys.argv[1])) as file: file.write(b'content\\n')\nprint('after')"
    )
    command = [sys.executable, "-c", code, str(link)]
    if kind == "pipe":
        text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    else:
        with (tmp_path / "out").open("w") as out:
            subprocess.run(command, stdout=out, check=True)
        text = (tmp_path / "out").read_text()
    assert text.split() == ["before", "content", "after"]
