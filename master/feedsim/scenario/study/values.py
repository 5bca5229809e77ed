"""Values of a study as they stand behind KEY= on the command line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from feedsim.errors import InputError
from feedsim.files.source import Source, parse


def as_text(written: Source, meant: Any) -> str:
    """A value that means `meant`: the same, or with the files that it names read or relative to the working folder."""
    data = written.data
    if meant != data and isinstance(data, str):
        return _quoted(meant if isinstance(meant, str) else str(written.mark(()).folder / data))
    return _quoted(meant)


def number_text(value: float, unit: str) -> str:
    """An SI value so that it reads back as the same number, bit for bit."""
    return repr(float(value)) if unit == "1" else f"{float(value)!r} {unit}"


def _quoted(value: Any) -> str:
    if isinstance(value, str):
        try:
            same = parse(value, "", Path(), lines=False).data == value
        except InputError:
            same = False
        if same:
            return value
    return json.dumps(value, ensure_ascii=False)
