"""Commands of feedsim as tests give them: in this process, or in one of their own where that is what is tested; and
what they have left."""

from __future__ import annotations

import contextlib
import csv
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TextIO
from unittest import mock

import pytest

from feedsim.cli import main

MASTER = Path(__file__).resolve().parent.parent / "master"
PATIENCE = 300.0  # s until what hangs is a failure, on a busy machine too
Done = subprocess.CompletedProcess[str]


def feedsim(*words: str | Path, fmus: Path, cwd: Path) -> Done:
    """A command in this process, which has loaded most of what it needs: a second less than in one of its own.

    An error that a command does not tell of is raised, where a process ends with 1.
    """
    arguments = [str(word) for word in words]
    with contextlib.chdir(cwd), mock.patch.dict(os.environ, FEEDSIM_FMUS=str(fmus)), _file() as out, _file() as err:
        with _descriptor(1, out), _descriptor(2, err), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            try:
                code = main(arguments)
            except SystemExit as end:
                code = end.code if isinstance(end.code, int) else int(end.code is not None)
        return Done(arguments, code, _text(out), _text(err))


def feedsim_process(*words: str | Path, fmus: Path, cwd: Path) -> Done:
    """A command in a process of its own, from its start to its end."""
    command = [sys.executable, "-c", "from feedsim.cli import entry; entry()", *map(str, words)]
    environment = {**os.environ, "FEEDSIM_FMUS": str(fmus), "PYTHONPATH": str(MASTER), "PYTHONUTF8": "1"}
    return subprocess.run(command, cwd=cwd, env=environment, capture_output=True, encoding="utf-8", check=False)


def summary_of(folder: Path) -> dict[str, Any]:
    """summary.json of a folder of results, which has no NaN: strict readers refuse that."""
    text = (folder / "summary.json").read_text(encoding="utf-8")
    content: dict[str, Any] = json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))
    return content


def rows_of(folder: Path) -> list[list[str]]:
    """Cells of the table of a study, without those of the seconds."""
    with (folder / "table.csv").open(newline="") as file:
        return [row[:-1] for row in csv.reader(file)]


def _file() -> contextlib.AbstractContextManager[TextIO]:
    return tempfile.TemporaryFile("w+", encoding="utf-8", errors="backslashreplace")


@contextlib.contextmanager
def _descriptor(number: int, file: TextIO) -> Iterator[None]:
    """What libraries print by themselves goes into the file, too."""
    kept = os.dup(number)
    try:
        os.dup2(file.fileno(), number)
        yield
    finally:
        file.flush()
        os.dup2(kept, number)
        os.close(kept)


def _text(file: TextIO) -> str:
    file.seek(0)
    return file.read()
