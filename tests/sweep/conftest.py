"""A short move of a machine whose structure nobody looks at, as a study's scenario, and studies of it."""

from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SCENARIO = """name: Short move
machine: {machine}
motions:
  - {{kind: move, by: {{Z: 0.8 mm}}, feed: 3000 mm/min}}
  - {{kind: dwell, duration: 60 ms}}
recording: {{variables: [Z.x_a, Z.x_s, Z.M_a, tool.x_Z], interval: 1 ms}}
set: {{machine.structure: null}}
evaluate:
  - {{kind: positioning, axis: Z}}
"""
STUDY = """name: Friction of a short move
scenario: short.yaml
sampling: {method: sobol, runs: 16, seed: 7}
parameters:
  F_C: {key: machine.axes.Z.friction.F_C, distribution: uniform, from: 1.2 N.m, to: 2 N.m}
  W: {key: machine.axes.*.friction.W, factor: true, distribution: normal, mean: 1, deviation: 0.2, from: 0.5, to: 1.5}
  scheme: {key: coupling.scheme, values: [extrapolated, jacobi]}
"""


@pytest.fixture
def short(tmp_path: Path) -> Path:
    """The scenario, in a folder of its own."""
    file = tmp_path / "short.yaml"
    file.write_text(SCENARIO.format(machine=ROOT / "scenarios" / "machines" / "test_centre"))
    return file


@pytest.fixture
def study(short: Path) -> Callable[[str], Path]:
    """Writes a study beside the scenario."""

    def write(text: str = STUDY) -> Path:
        file = short.parent / "study.yaml"
        file.write_text(text)
        return file

    return write
