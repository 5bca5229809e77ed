"""What is asked of an identification is refused before any work where it cannot be: by its options, by the command."""

from __future__ import annotations

import re
from math import inf, nan
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from feedsim.cli import main
from feedsim.estimation.identify import Estimate, Options
from feedsim.estimation.identify.parameters import DELAYS, FRICTION_NAMES, PARAMETER_KINDS
from feedsim.files.trace import Trace, write_csv
from feedsim.foundation.errors import InputError
from feedsim.scenario import Friction

MACHINE = Path(__file__).resolve().parents[2] / "scenarios" / "machines" / "test_centre"
J_RANGE = r"allowed: more than 0 kg\.m2"
DELAY_RANGE = r"allowed: from -0\.02 s to 0\.02 s"


@pytest.fixture(scope="module")
def trace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Any log will do: it is refused before what is in it is looked at."""
    time = np.arange(200) * 2e-3
    n, i = np.sin(20 * time), np.sign(np.sin(20 * time))
    columns = {"Z.x_a": 3e-3 * (1 - np.cos(20 * time)) / 20, "Z.n_a": n, "Z.i_q": i}
    file = tmp_path_factory.mktemp("trace") / "log.csv"
    write_csv(file, Trace(time, columns, {"Z.x_a": "m", "Z.n_a": "rad/s", "Z.i_q": "A"}))
    return file


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--inertia", "0 kg.m^2"], rf"the inertia is given as 0 kg\.m2; {J_RANGE}"),
        (["--inertia", "-1 kg.m^2"], rf"the inertia is given as -1 kg\.m2; {J_RANGE}"),
        (["--mass", "0 kg"], rf"the inertia is given as 0 kg\.m2; {J_RANGE}"),
        (["--mass", "-5 kg"], rf"the inertia is given as -5\.\d+e-05 kg\.m2; {J_RANGE}"),
        (["--delay", "1000 s"], f"the delay of the torque is given as 1000 s; {DELAY_RANGE}"),
        (["--delay", "-21 ms"], rf"the delay of the torque is given as -0\.021 s; {DELAY_RANGE}"),
        (["--hold", "sigma_0=0 N.m/rad"], r"sigma_0 is held at 0 N\.m/rad; allowed: at least 1e-06 N\.m/rad"),
        (["--hold", "sigma_1=-1 N.m.s/rad"], r"sigma_1 is held at -1 N\.m\.s/rad; allowed: at least 0 N\.m\.s/rad"),
        (["--hold", "sigma_2=-1 N.m.s/rad"], r"sigma_2 is held at -1 N\.m\.s/rad; allowed: at least 0 N\.m\.s/rad"),
        (["--hold", "F_C=0 N.m"], r"F_C is held at 0 N\.m; allowed: at least 1e-09 N\.m"),
        (["--hold", "F_S=-1 N.m"], r"F_S is held at -1 N\.m; allowed: at least 1e-09 N\.m"),
        (["--hold", "v_s=0 rad/s"], r"v_s is held at 0 rad/s; allowed: at least 1e-09 rad/s"),
        (["--hold", "beta=-1"], r"beta is held at -1; allowed: from 0\.1 to 10"),
        (["--hold", "F_log=-1 N.m"], r"F_log is held at -1 N\.m; allowed: at least 0 N\.m"),
        (["--hold", "v_log=0 rad/s"], r"v_log is held at 0 rad/s; allowed: at least 1e-09 rad/s"),
        (["--hold", "asymmetry=3"], r"asymmetry is held at 3; allowed: from -0\.9 to 0\.9"),
        (["--hold", "W=-1 rad"], r"W is held at -1 rad; allowed: at least 0 rad"),
        (["--hold", "gamma=2"], r"gamma is held at 2; allowed: from 0 to 1"),
        (["--hold", "F_S=1 N.m,F_C=2 N.m"], r"F_S is held at 1 N\.m, below F_C at 2 N\.m; allowed: at least F_C"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_the_command_refuses(
    words: list[str],
    message: str,
    trace: Path,
    fmus: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: Any,
) -> None:
    monkeypatch.chdir(tmp_path)
    known = ["--axes", "Z", "--machine", str(MACHINE), "--out", "out", "--fmus", str(fmus)]
    assert main(["identify", "friction", str(trace), *known, *words]) == 2
    said = capsys.readouterr()
    assert not said.out
    assert "Traceback" not in said.err
    assert re.search(message, said.err), said.err
    assert not list(tmp_path.iterdir())


def given(J: float) -> Estimate:
    return Estimate("J", J, "kg.m2", "inertia", status="given")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"J": given(nan)}, "inertia is given as nan"),
        ({"J": given(inf)}, "inertia is given as "),
        ({"delay": nan}, "delay of the torque is given as nan"),
        ({"hold": {"M_0": inf}}, "M_0 is held at "),
        ({"hold": {"M_0": nan}}, r"M_0 is held at nan N\.m; allowed: any finite value"),
        ({"I_P": 0.0}, r"lead I_P is given as 0 m/rad; allowed: more than 0 m/rad"),
    ],
)
def test_options_refuse_what_is_not_finite(changes: dict[str, Any], message: str) -> None:
    known: dict[str, Any] = {"axis": "Z", "I_P": 3e-3}
    with pytest.raises(InputError, match=message):
        Options(**(known | changes))


def test_what_is_possible_is_taken() -> None:
    """The ends of the ranges are possible."""
    for delay in (-20e-3, 0.0, 20e-3):
        assert Options("Z", 3e-3, delay=delay).delay == delay
    hold = {
        "gamma": 0.0,
        "W": 0.0,
        "sigma_1": 0.0,
        "beta": 10.0,
        "asymmetry": -0.9,
        "F_S": 2.0,
        "F_C": 2.0,
        "M_0": -40.0,
    }
    assert Options("Z", 3e-3, J=given(1e-6), hold=hold).hold == hold


def test_ranges_are_those_of_machine_files() -> None:
    """What may be held may be written to friction.yaml, and what may not, may not."""
    start = {"sigma_0": 300.0, "sigma_1": 0.8, "sigma_2": 0.006, "F_C": 1e-9, "F_S": 10.0, "v_s": 0.6}
    for name in FRICTION_NAMES:
        end = PARAMETER_KINDS[name].lower
        beside = start | ({"F_S": 1e-9} if name == "F_S" else {})
        assert Friction.model_validate(beside | {name: end}).parameters()[name] == end
        with pytest.raises(ValueError, match=name):
            Friction.model_validate(beside | {name: end - 1e-3})


def test_the_delay_is_searched_within_what_may_be_given() -> None:
    assert PARAMETER_KINDS["delay"].lower <= DELAYS[0] < DELAYS[1] <= PARAMETER_KINDS["delay"].upper
