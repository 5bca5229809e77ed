"""Recorded circles whose numbers no instrument shows are refused before anything is calculated with them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from command_helpers import feedsim

T = np.linspace(0, 2 * np.pi, 400)


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize(("factor", "spike"), [(1e300, None), (1.7e308, None), (1.0, 1e308), (1.0, -1e101)])
def test_positions_beyond_all_measure(tmp_path: Path, fmus: Path, factor: float, spike: float | None) -> None:
    with np.errstate(over="ignore"):
        x, y = factor * 0.05 * np.cos(T), factor * 0.05 * np.sin(T)
    if spike is not None:
        x[7] = spike
    rows = "".join(f"{a!r},{b!r}\n" for a, b in zip(x.tolist(), y.tolist(), strict=True))
    (tmp_path / "circle.csv").write_text("X [m],Y [m]\n" + rows)
    done = feedsim("circle", "circle.csv", "--feed", "1000 mm/min", "--out", "out", fmus=fmus, cwd=tmp_path)
    assert done.returncode == 2
    assert "in column 'X' is too large; allowed: up to 1e+100" in done.stderr
    assert not (tmp_path / "out").exists()
