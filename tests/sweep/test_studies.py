"""The studies that come along: they load, some of their runs work, and what they claim of the physics holds."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from feedsim import analysis
from feedsim.design.sweep.design import Design, design
from feedsim.scenario.study import load_study
from feedsim.simulation import cosim

ROOT = Path(__file__).resolve().parents[2]
STUDIES = sorted((ROOT / "scenarios" / "studies").glob("*.yaml"))
FRICTION = ROOT / "scenarios" / "studies" / "friction_wear.yaml"


def made(file: Path, fmus: Path, rows: list[int], plan: Design) -> dict[str, list[float]]:
    """Figures of some runs."""
    study = load_study(file)
    found: dict[str, list[float]] = {}
    for row in rows:
        run = cosim.run(study.base.with_changes(plan.changes(row)), fmus=fmus)
        for name, figure in analysis.evaluate(run).items():
            found.setdefault(name, []).append(figure.value)
    return found


@pytest.mark.parametrize("file", STUDIES, ids=lambda file: file.stem)
def test_loads_and_the_document_tells_its_runs(file: Path) -> None:
    study = load_study(file)
    assert not study.warnings
    document = (ROOT / "docs" / "sweeps.md").read_text(encoding="utf-8")
    row = re.search(rf"\| `scenarios/studies/{file.name}` \| (\d+) \|", document)
    assert row, f"docs/sweeps.md does not list {file.name}"
    assert int(row[1]) == design(study).runs
    assert "synthetic" in file.read_text(encoding="utf-8").lower()


def test_the_first_example_of_the_document(tmp_path: Path) -> None:
    document = (ROOT / "docs" / "sweeps.md").read_text(encoding="utf-8")
    block = re.search(r"```yaml\n(.*?)```", document, re.DOTALL)
    assert block
    (tmp_path / "scenarios").symlink_to(ROOT / "scenarios", target_is_directory=True)
    (tmp_path / "my_study.yaml").write_text(block[1], encoding="utf-8")
    study = load_study(tmp_path / "my_study.yaml")
    assert design(study).runs == 64
    assert not study.warnings


@pytest.mark.parametrize("file", STUDIES, ids=lambda file: file.stem)
def test_outermost_runs_have_all_figures(fmus: Path, file: Path) -> None:
    """Runs at the ends of each parameter are the first to fail: all of them are valid, two are made, of the fastest."""
    study = load_study(file)
    plan = design(study)
    ends = {int(pick(plan.values[:, k])) for k in range(plan.values.shape[1]) for pick in (np.argmin, np.argmax)}
    rows = sorted(ends)
    for row in rows:
        study.base.with_changes(plan.changes(row))
    names = [parameter.name for parameter in study.parameters]
    if "feed" in names:
        feed = plan.values[:, names.index("feed")]
        rows = np.flatnonzero(feed == feed.max()).tolist()
    rows = sorted({rows[0], rows[-1]})
    found = made(file, fmus, rows, plan)
    assert study.figures is not None
    for pattern in study.figures:
        assert np.isfinite(found[pattern]).all(), pattern


@pytest.mark.extensive
def test_friction_never_breaks_its_rule() -> None:
    """F_S is at least F_C, in every seventh run looked at: the factors are cut so that it is."""
    study = load_study(FRICTION)
    plan = design(study)
    for row in range(0, plan.runs, 7):
        for axis in "XZ":
            friction = study.base.with_changes(plan.changes(row)).machine.axes[axis].friction
            assert friction.F_S >= friction.F_C
            bristles = (
                2 * (1 + abs(friction.asymmetry)) * friction.F_S / friction.sigma_0
            )  # the engaging zone has to be wider
            assert bristles < friction.W


def test_manufacturing_and_wear_multiply_on_coulomb_and_static_friction() -> None:
    study = load_study(FRICTION)
    plan = design(study)
    names = [parameter.name for parameter in study.parameters]
    row = int(np.argmin(plan.values[:, names.index("X.wear")]))
    new, wear, static = (plan.values[row, names.index(name)] for name in ("X.new", "X.wear", "X.F_S"))
    friction = study.base.with_changes(plan.changes(row)).machine.axes["X"].friction
    np.testing.assert_allclose([friction.F_C, friction.F_S], [2.4 * new * wear, 3.1 * new * wear * static], rtol=1e-15)
