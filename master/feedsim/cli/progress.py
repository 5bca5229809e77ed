"""The progress bar of commands that do several things in a row."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Progress = Callable[[str, int, int], None]  # what is being done, how many of its steps are done, of how many


@contextmanager
def progress_bar(quiet: bool, unit: str = "") -> Iterator[Progress]:
    """A progress bar that names what is being done; none if ``quiet`` or where nobody watches.

    unit: of the steps; with one, large numbers are shortened (12.3k).
    """
    from tqdm import tqdm

    said = ""
    with tqdm(unit=unit, unit_scale=bool(unit), leave=False, disable=quiet or not sys.stderr.isatty()) as bar:

        def progress(what: str, done: int, total: int) -> None:
            nonlocal said
            if what != said:
                said = what
                bar.reset(total)
                bar.set_description(what)
            bar.update(done - bar.n)

        yield progress
