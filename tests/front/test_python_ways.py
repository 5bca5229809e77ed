"""Python as people expect it: matplotlib's axes, responses of python-control, one error for an unknown name."""

from __future__ import annotations

import inspect
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import matplotlib as mpl
import numpy as np
import pytest

import feedsim as fs

mpl.use("Agg")
import matplotlib.pyplot as plt

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"


@pytest.fixture(scope="module")
def stop() -> fs.Result:
    return fs.run(SCENARIOS / "z_positioning.yaml", set={"motions.0.by.Z": "5 mm"})


def test_a_picture_is_drawn_on_axes_that_are_there(stop: fs.Result) -> None:
    figure, axes = plt.subplots(2)
    assert stop.plot("Z.x_a", "Z.M_fr", ax=axes) is axes
    assert [one.get_ylabel() for one in axes] == ["position [m]", "torque [N·m]"]
    np.testing.assert_array_equal(axes[0].lines[0].get_ydata(), stop["Z.x_a"])
    one = plt.figure().add_subplot()
    assert stop.plot(ax=one).get_xlabel() == "time [s]"
    assert one.lines
    with pytest.raises(fs.InputError, match="1 panels with axes, 2 are needed"):
        stop.plot("Z.x_a", ax=list(axes))
    plt.close("all")
    assert figure


def test_a_figure_and_a_signal_that_there_are_not_raise_the_same_error(stop: fs.Result) -> None:
    for names, wrong, near in ((stop.figures, "Z.overshot", "Z.overshoot"), (stop, "Z.x_b", "Z.x_")):
        with pytest.raises(fs.InputError, match=f"no .* '{wrong}'; did you mean '{near}") as raised:
            names[wrong]
        assert isinstance(raised.value, KeyError)


def test_signatures_show_types_alone() -> None:
    shown = str(inspect.signature(fs.run))
    assert shown.startswith(
        "(scenario: str | Path | Scenario, *, machine: str | Path | None = None, set: Changes = None"
    )
    assert "Annotated" not in shown
    assert "0x" not in shown


def test_responses_go_to_python_control(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its FRD takes complex values and angular frequencies [rad/s]."""
    result = fs.frf(SCENARIOS / "machines/one_axis", measure=False, set={"structure": "null"})
    name = next(iter(result))
    monkeypatch.setitem(sys.modules, "control", None)
    with pytest.raises(fs.InputError, match="pip install control"):
        result.to_control(name)
    taken = ModuleType("control")
    taken.FRD = lambda values, omega: SimpleNamespace(values=values, omega=omega)  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "control", taken)
    frd = result.to_control(name)
    np.testing.assert_array_equal(frd.values, result[name])
    np.testing.assert_allclose(frd.omega, 2 * np.pi * result.frequency)
