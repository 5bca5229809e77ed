"""Recorded traces that tests make, and what reading them gives."""

from __future__ import annotations

from collections.abc import Mapping
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from feedsim.estimation.identify.read import RecordedAxis, read_records
from feedsim.files.columns import Columns, load_columns
from feedsim.foundation.errors import InputError

PITCH = 0.02
LEAD = PITCH / (2 * pi)
K_T = 2.0
TIME = np.arange(500) * 0.002
ANGLE = 3 * np.sin(2 * pi * TIME)  # motor [rad]
SPEED = 6 * pi * np.cos(2 * pi * TIME)
TORQUE = 1.5 * np.sign(SPEED) + 0.05 * SPEED + 0.3
# Values are written with 12 digits.
DIGITS = {"rtol": 1e-10, "atol": 1e-10}


def table(path: Path, columns: Mapping[str, Any], separator: str = ",") -> Path:
    rows = [separator.join(columns)]
    rows += [separator.join(f"{value:.12g}" for value in row) for row in zip(*columns.values(), strict=True)]
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return path


def simple(path: Path, **changes: Any) -> Path:
    columns = {"t [s]": TIME, "ActPos [mm]": 1e3 * LEAD * ANGLE, "ActTorque [Nm]": TORQUE}
    return table(path, columns | changes)


def mapped(tmp_path: Path, text: str) -> Columns:
    path = tmp_path / "m.yaml"
    path.write_text(text, encoding="utf-8")
    return load_columns(path)


def only(recorded: RecordedAxis) -> Any:
    assert len(recorded.records) == 1
    return recorded.records[0]


def refusal(*arguments: Any, **options: Any) -> str:
    with pytest.raises(InputError) as caught:
        read_records(*arguments, **options)
    return str(caught.value)
