"""In which cycle a control closes its position loop: what a record decides, and what becomes of intervals if not."""

from __future__ import annotations

from math import nan
from pathlib import Path

import numpy as np
import pytest

from drive_helpers import COLUMNS, MACHINES, SCENARIO
from feedsim.estimation.identify.parameters import estimate
from feedsim.estimation.identify.result import Estimate
from feedsim.estimation.least_squares import NORMAL_95
from feedsim.estimation.replay.closed_loop import cut_window, read_axes
from feedsim.estimation.replay.identified import identify_drives
from feedsim.estimation.replay.tuning import OtherCycle, decision, gain_of, with_either
from feedsim.files.columns import load_columns
from feedsim.files.trace import write_csv
from feedsim.scenario import load, load_machine
from feedsim.simulation.cosim import run
from feedsim.structure import checked_modes
from machine_helpers import rigid_copy


def test_records_decide_by_more_than_their_scatter() -> None:
    """Gains of rows that are correlated over some twenty of them: without a mean five of a hundred records decide, give
    or take 4; with a mean of half their scatter all do."""
    rng, decided, better = np.random.default_rng(1), 0, 0
    for _ in range(400):
        noise = np.convolve(rng.standard_normal(1219), np.ones(20) / np.sqrt(20), "valid")
        decided += decision([OtherCycle(2e-3, *gain_of(noise))]) != 0
        better += decision([OtherCycle(2e-3, *gain_of(noise + 0.5))])
    assert 0.01 <= decided / 400 <= 0.09
    assert better / 400 > 0.9


def test_axes_decide_together() -> None:
    """A machine has one cycle: what one axis shows by little, another one may outweigh."""
    little, against = OtherCycle(2e-3, 4.0, 1.5), OtherCycle(2e-3, -30.0, 5.0)
    assert decision([little]) == 1
    assert decision([against]) == -1
    assert decision([little, against]) == -1
    assert decision([little, OtherCycle(2e-3, -3.0, 2.0)]) == 0
    assert decision([]) == 0


def test_values_that_depend_on_an_undecided_cycle() -> None:
    """T_sym with half a cycle more is not determined, and keeps the interval of the cycle that was taken; the interval
    of a friction that moves within it includes that of the other fit."""
    own = {
        "T_sym": Estimate("T_sym", 0.7e-3, "s", "", 0.01e-3),
        "F_C": estimate("F_C", 2.0, 0.1),
        "W": Estimate("W", 0.1, "rad", "", nan, "undetermined", "no zone"),
    }
    other = OtherCycle(2e-3, 0.5, 3.0, {"T_sym": Estimate("T_sym", 1.64e-3, "s", "", 0.01e-3),
                                       "F_C": estimate("F_C", 2.1, 0.2)})  # fmt: skip
    either = with_either(own, other)
    assert either["T_sym"].status == "undetermined"
    assert either["T_sym"].interval == own["T_sym"].interval
    assert either["T_sym"].reason == "with a position cycle of 2 ms, which fits as well, it is 0.00164 s"
    assert either["F_C"].interval[1] == pytest.approx(2.1 + NORMAL_95 * 0.2)
    assert either["F_C"].status == "estimated"
    assert either["W"] == own["W"]


@pytest.mark.extensive
@pytest.mark.parametrize("cycle", ["125 us", "2 ms"])
def test_a_delay_of_half_a_cycle_does_not_hide_it(cycle: str, tmp_path: Path) -> None:
    """T_sym of 0.95 ms: taken for a drive that closes the loop every 125 us, a control that does so every 2 ms has a
    T_sym of about 0, which is no bound, and 3/5 of its inertia, which the rigid line of the torque at one phase of that
    cycle supports. Left to that line, either cycle met the record alike."""
    machine = rigid_copy(MACHINES / "sinumerik_840d", tmp_path / "rigid")
    drive = ["K_p=9 N.m.s/rad", "T_n=5 ms", "T_sym=0.95 ms"]
    changes = [f"machine.cycles.position={cycle}", *(f"machine.axes.X.drive.{each}" for each in drive)]
    (tmp_path / "moves.yaml").write_text(
        SCENARIO.format(machine=machine, axis="X", noise="M_a: 2 %, x_a: 0.1 um", seed=1)
    )
    known = load(tmp_path / "moves.yaml", changes)
    log = run(known).log
    assert log is not None
    write_csv(tmp_path / "log.csv", log)
    (tmp_path / "columns.yaml").write_text(
        COLUMNS + "speed_setpoint: {column: X.n_s}\nfeedforward: {column: X.n_ffw}\n"
    )
    read = read_axes(tmp_path / "log.csv", ["X"], None, load_columns(tmp_path / "columns.yaml"))
    found = identify_drives(read, {"X": cut_window("X", read["X"], None)}, None, [], "made", "by a test")
    one = found.drives["X"]
    assert not found.undecided_cycle
    assert one.machine.cycles.T_pos == pytest.approx(known.machine.cycles.T_pos)
    true = {"J": checked_modes(load_machine(machine)).J_tot("X"), "K_p": 9.0, "T_sym": 0.95e-3}
    for name, value in true.items():
        assert one.estimates[name].status == "estimated", name
        assert one.estimates[name].value == pytest.approx(value, rel=0.03), name
