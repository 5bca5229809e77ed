"""The folder that a job writes its result to: checked before the work begins, and claimed until it ends."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from feedsim.jobs.parameters import File
from feedsim.jobs.watch import Watch
from feedsim.outputs import forced, replacing
from feedsim.owned import claimed
from feedsim.report.results import replaced


@contextmanager
def kept(
    out: File | None,
    check: Callable[[Path, Sequence[Path]], None],
    watch: Watch,
    inputs: Sequence[Path],
    settings: Sequence[str] = (),
    *,
    force: bool,
) -> Iterator[None]:
    """A block in which the folder `out` belongs to this job alone. None: nothing is written.

    check: of the report that will be written there. inputs, settings: files that are read, and what was asked for
    besides; where a result of other ones is replaced, the watch hears of it. force: files that feedsim did not write
    may be replaced; inputs never are.

    Raises OutputError: another process has the folder, or the result cannot be written there.
    """
    if out is None:
        yield
        return
    folder = Path(out)
    with replacing(force or forced()), claimed(folder):
        check(folder, inputs)
        if sentence := replaced(folder, inputs, settings):
            watch.note(sentence)
        yield
