"""Which columns are held between rows: flags of the reference, and what is asked for, not ramps of whole numbers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from feedsim.cli import main
from feedsim.comparison import Comparison, Options, Tolerances, compare, tolerances_of
from feedsim.files.trace import Series

TIME = np.arange(101) * 0.1
RAMP = np.minimum(100.0 * np.arange(101), 4500.0)


def of(values: object, unit: str = "") -> Series:
    return Series(TIME, {"n": np.asarray(values, dtype=float)}, {"n": unit})


def early(values: object) -> Series:
    """One row early."""
    array = np.asarray(values, dtype=float)
    return of(np.r_[array[1:], array[-1]])


def held(found: Comparison) -> bool:
    return any("n: held between rows" in note for note in found.notes)


@pytest.mark.parametrize("scale", [1.0, 0.01, 2 / 4500], ids=["rpm", "counts", "fractions"])
def test_a_ramp_of_whole_numbers_has_no_row_of_room(scale: float) -> None:
    """100 rpm in 0.1 s: 1 us of tolerance in time forgives 1e-3 rpm of the 100 that a row is."""
    found = compare(early(scale * RAMP), of(scale * RAMP), Tolerances.parse(["1e-6,1 us"]))
    assert found.verdict == "different"
    assert not held(found)
    assert found.worst is not None
    assert found.worst.outside == 45
    assert found.worst.deviation == pytest.approx(scale * (100 - 1e-3), rel=1e-9)


def test_flags_of_the_reference_are_held_and_it_is_told() -> None:
    """The result does not count: a real value in it is off, and does not make the reference a ramp."""
    flag = (TIME > 3).astype(float)
    found = compare(early(flag), of(flag), Tolerances.parse(["0,1 us"]))
    assert found.same
    assert held(found)
    half = of(np.where(np.arange(101) == 50, 0.5, flag))
    found = compare(half, of(flag), Tolerances.parse(["0.1,1 us"]))
    assert found.verdict == "different"
    assert held(found)
    assert not held(compare(of(0 * flag), of(0 * flag)))  # at rest there is nothing to hold
    assert not held(compare(of(2 * flag), of(2 * flag)))


def test_what_is_asked_for_counts_more(tmp_path: Path) -> None:
    file = tmp_path / "tolerances.yaml"

    def asked(hold: str, **options: object) -> Tolerances:
        file.write_text(f"time: 1 us\nvalue: 1e-6\nvariables:\n  n: {{hold: {hold}}}\n")
        return tolerances_of(tmp_path / "reference.csv", None, ())

    flag = (TIME > 3).astype(float)
    assert compare(early(flag), of(flag), asked("false")).verdict == "different"
    assert compare(early(flag), of(flag), asked("false"), Options(hold=["n"])).verdict == "different"
    for found in (
        compare(early(RAMP), of(RAMP), asked("true")),
        compare(early(RAMP), of(RAMP), Tolerances.parse(["1e-6,1 us"]), Options(hold=["n"])),
    ):
        assert found.same
        assert held(found)


def test_on_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name, values in (("a", early(RAMP)["n"]), ("b", RAMP)):
        rows = "\n".join(f"{t:.1f},{v:.0f}" for t, v in zip(TIME, values, strict=True))
        (tmp_path / f"{name}.csv").write_text(f"time [s],n [rpm]\n{rows}\n")
    command = ["compare", str(tmp_path / "a.csv"), str(tmp_path / "b.csv"), "--tol", "1e-6,1 us"]
    assert main(command) == 1
    assert main([*command, "--hold", "n"]) == 0
    assert "note: n: held between rows, as asked for" in capsys.readouterr().out
