"""The units against the pinned reference results, and the comparison against itself."""

from __future__ import annotations

import shutil
from pathlib import Path

import check_reference
import make_reference
import numpy as np
import pytest
from reference_files import HERE, UNITS, case_names, read_case

CASES = [(unit, name) for unit in UNITS for name in case_names(unit)]


@pytest.mark.parametrize(("unit", "name"), CASES)
def test_unit(unit: str, name: str, fmus: Path) -> None:
    case = read_case(unit, name)
    result = check_reference.simulate(fmus / f"{unit}.fmu", case)
    different = [row for row in check_reference.compare(case, result) if not row.same]
    assert not different


def test_pinned_files_are_what_is_made(tmp_path: Path) -> None:
    assert sorted(make_reference.make(tmp_path)) == sorted(f"{unit}/{name}" for unit, name in CASES)
    for unit, name in CASES:
        made, pinned = read_case(unit, name, tmp_path), read_case(unit, name)
        assert made.parameters == pinned.parameters
        for key, expected in (pinned.inputs | pinned.reference).items():
            column = (made.inputs | made.reference)[key]
            # another processor's libm and linear algebra round differently, a tenth of the units' own tolerances
            np.testing.assert_allclose(column, expected, rtol=1e-11, atol=1e-12 * max(1e-3, np.max(np.abs(expected))))


def test_files_are_small() -> None:
    for unit in UNITS:
        for path in (HERE / unit).glob("*.csv"):
            assert path.stat().st_size < 300_000, path
            assert len(path.read_text().split("\n", 1)[0].split(",")) <= 10, path


@pytest.fixture
def one_case(tmp_path: Path) -> Path:
    """A tree of cases with a single friction case."""
    (tmp_path / "friction").mkdir()
    for path in (HERE / "friction").glob("constant_speed_*"):
        shutil.copy(path, tmp_path / "friction")
    return tmp_path


def test_same(one_case: Path, fmus: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert check_reference.main(["--cases", str(one_case), "--fmus", str(fmus)]) == 0
    assert "all the same" in capsys.readouterr().out


def test_different(one_case: Path, fmus: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = one_case / "friction" / "constant_speed_ref.csv"
    header, *rows = path.read_text().splitlines()
    time, torque, rest = rows[700].split(",", 2)
    rows[700] = f"{time},{float(torque) + 40e-6!r},{rest}"
    path.write_text("\n".join([header, *rows]) + "\n")
    assert check_reference.main(["--cases", str(one_case), "--fmus", str(fmus)]) == 1
    assert "1 variables differ" in capsys.readouterr().out


def test_not_a_number_differs() -> None:
    assert not check_reference.Deviation("friction", "reversal", "M_fr", float("nan"), 1.0).same


def test_unusable(one_case: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert check_reference.main(["--cases", str(one_case), "--fmus", str(tmp_path)]) == 2
    assert "friction.fmu" in capsys.readouterr().err
