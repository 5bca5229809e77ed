"""The page's linear system against feedsim.linear, with what drives can be set to: judged loops, and x_a/x_s."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from feedsim import scenario
from feedsim.linear.judgement import judge
from feedsim.linear.loops import position_reference
from feedsim.linear.system import LinearSystem
from feedsim.report.live_page.content import content
from feedsim.simulation import nc
from feedsim.simulation.cosim import fmus_directory
from feedsim.structure import checked_modes
from page_helpers import NODE, answers

pytestmark = [
    pytest.mark.skipif(NODE is None, reason="no node on this machine (Debian: apt install nodejs)"),
    pytest.mark.skipif(
        not (fmus_directory() / "machine.wasm").is_file(), reason="no module of the machine (make page-module)"
    ),
]
SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
X, Z = "machine.axes.X", "machine.axes.Z"
OPTIONS: dict[str, list[str]] = {
    "as written": [],
    "ideal current loop, no model, a lag": [
        f"{X}.drive.ideal_current_loop=true", f"{Z}.drive.reference_model=false", f"{X}.drive.symmetry_lag=true",
        f"{Z}.drive.T_dyn=1.3 ms", f"{Z}.drive.ramp_speed_setpoint=false",
    ],
    "speed from the position, low-pass, no integrator": [
        f"{X}.drive.speed_window=3", f"{Z}.drive.speed_integrator=false",
        f"{Z}.drive.filter_2={{type: low_pass, f: 700 Hz, D_den: 0.7}}", f"{X}.drive.T_ref=0.4 ms",
    ],
    "motor encoder": [f"{X}.drive.measuring={{indirect: true}}", f"{X}.friction.W=0 rad"],
    "unstable and thin": [f"{Z}.drive.K_p=90 N.m.s/rad", f"{X}.drive.K_v=500 1/s"],
}  # fmt: skip


@pytest.mark.parametrize("name", OPTIONS)
def test_loops_are_judged_as_by_a_run(name: str, tmp_path: Path) -> None:
    given = scenario.load(SCENARIOS / "xz_circle.yaml", OPTIONS[name])
    data = content(given, nc.plan(given)).data
    state, frequency = [knob["value"] for knob in data["knobs"]], 0.53
    page = answers(data, [{"state": state, "frequency": frequency}], tmp_path)[0]
    modes = checked_modes(given.machine)
    for mine, loop in zip(page["loops"], judge(given.machine, modes), strict=True):
        its = asdict(loop) | {"thin": loop.thin}
        for key, value in its.items():
            assert _same(mine[key], value), (name, key, mine, its)
    system = LinearSystem(given.machine, modes)
    for axis in given.machine.axes:
        its_gain = position_reference(system, axis, np.array([frequency]), feedforward=True)[0]
        # The last bits of exp and of sums over modes; a wrong block shows in the third digit.
        assert complex(*page["gain"][axis]) == pytest.approx(its_gain, rel=1e-9), (name, axis)
        its_drag = system.closing({axis: "position"}).transfer(np.array([frequency]), f"{axis}.x_a", f"{axis}.M_add")[0]
        assert complex(*page["drag"][axis]) == pytest.approx(its_drag, rel=1e-7), (name, axis)


def _same(mine: Any, value: Any) -> bool:
    if isinstance(value, float):
        return bool(np.isclose(float(mine), value, rtol=1e-7))
    return bool(mine == value)
