"""Write what comparisons found, each file whole or not at all."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from feedsim.compare import Comparison
from feedsim.errors import OutputError
from feedsim.report.compare.machine_readable import junit, to_json
from feedsim.report.compare.page import page
from feedsim.trace import written_whole


def check_comparison_writable(outputs: Sequence[Path], inputs: Sequence[Path]) -> None:
    """OutputError where an output would replace an input or another output."""
    seen: list[Path] = []
    for path in outputs:
        whole = path.resolve()
        if path.is_dir():
            raise OutputError(f"{path}: is a directory; a file name is needed")
        if any(whole == given.resolve() for given in inputs):
            raise OutputError(f"{path}: is an input and would be replaced; take another name")
        if whole in seen:
            raise OutputError(f"{path}: is given for two outputs")
        seen.append(whole)


def write_comparison(
    comparisons: Sequence[Comparison],
    *,
    html: Path | None = None,
    xml: Path | None = None,
    json: Path | None = None,
    durations: Sequence[float] = (),
) -> tuple[Path, ...]:
    """Write the report, JUnit XML and JSON that are asked for; returns the paths. Folders are made. OutputError."""
    contents: list[tuple[Path | None, Callable[[], bytes]]] = [
        (html, lambda: page(comparisons).encode("utf-8")),
        (xml, lambda: junit(comparisons, durations)),
        (json, lambda: to_json(comparisons).encode("utf-8")),
    ]
    written = []
    for path, content in contents:
        if path is None:
            continue
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(f"{path} cannot be written: {error.strerror or error}") from error
        data = content()
        with written_whole(path) as file:
            file.write(data)
        written.append(path)
    return tuple(written)
