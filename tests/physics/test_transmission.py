"""Play with contact between motor and structure: joined where it is stiff, hunting as describing functions say."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import fmi2Error
from plant_unit import write_modes
from scipy.optimize import brentq

from feedsim import scenario
from feedsim.foundation.errors import InputError
from feedsim.linear.judgement import judge
from feedsim.simulation import cosim
from feedsim.simulation.cosim import Run
from feedsim.structure import Modes, checked_modes
from feedsim.structure.modes import joined
from fmi_helpers import Archive

SCENARIO = Path(__file__).resolve().parents[2] / "scenarios" / "z_positioning.yaml"
Z = "machine.axes.Z"
T_C = 125e-6
FREE = [f"{Z}.friction.{each}" for each in ("F_C=1e-3 N.m", "F_S=1e-3 N.m", "F_log=0 N.m", "sigma_2=0 N.m.s/rad")]


def contact(stiffness: float, damping: float, play: float = 0.0) -> list[str]:
    """Settings of Z: stiffness [N/m], damping [N.s/m], play [m]."""
    values = (f"stiffness={stiffness!r} N/m", f"damping={damping!r} N.s/m", f"play={play!r} m", "inertia=0.004 kg.m^2")
    return [f"{Z}.transmission.{each}" for each in values]


def run(fmus: Path, *settings: str) -> Run:
    return cosim.run(scenario.load(SCENARIO, ["recording.interval=125 us", *settings]), fmus=fmus)


def test_two_masses_have_their_frequency() -> None:
    J, rest, c = 0.004, 0.01, 900.0
    whole = np.array([1 / np.sqrt(J + rest)])
    one = Modes(Path("modes.csv"), np.zeros(1), np.zeros(1), {"n_A": whole, "x_A": 0.003 * whole})
    found = joined(one, (("A", c, 0.3, J),))
    omega = np.sqrt(c * (1 / J + 1 / rest))
    np.testing.assert_allclose(2 * np.pi * found.frequency, [0, omega], rtol=1e-12)
    assert found.damping[1] == pytest.approx(0.3 * omega / (2 * c), rel=1e-12)
    assert found.J_inf("A") == pytest.approx(J, rel=1e-12)
    assert found.J_tot("A") == pytest.approx(J + rest, rel=1e-12)


def test_a_stiff_contact_leaves_the_structure_as_it_is(fmus: Path) -> None:
    """1e11 N/m gives 0.1 nm to the 10 N that a um asks for; the axis goes as without, slides with friction, too."""
    for guide in ([], [f"{Z}.guide.share=60 %"]):
        joined_run, own = run(fmus, *contact(1e11, 1e6), *guide), run(fmus, *guide)
        apart = joined_run.trace["Z.x_a"] - own.trace["Z.x_a"]
        assert np.max(np.abs(apart)) < 1e-7
        assert np.max(np.abs(joined_run.trace["Z.transmission.way"])) < 1e-6
    modes = checked_modes(own.scenario.machine)
    with_contact = checked_modes(joined_run.scenario.machine)
    few = len(modes.frequency) // 2
    np.testing.assert_allclose(with_contact.frequency[:few], modes.frequency[:few], rtol=1e-3)


@pytest.mark.parametrize(
    ("stiffness", "damping", "changes"),
    [(200e6, 3e4, ["drive.K_p=2.5 N.m.s/rad"]), (400e6, 5e4, ["drive.K_p=4 N.m.s/rad", "drive.K_v=3 (m/min)/mm"])],
)
def test_a_directly_measured_axis_hunts_as_describing_functions_say(
    stiffness: float, damping: float, changes: list[str], fmus: Path
) -> None:
    """The dead zone of half the play D lets a swing of amplitude A have a share N of its stiffness:

    N = 1 - 2/pi (asin(D/A) + D/A sqrt(1 - (D/A)^2))

    (Gelb, Vander Velde, Multiple-Input Describing Functions, 1968). It stays where the linear loop is marginal with
    that share; the linear loop knows nothing of play. Waves three times as fast, left out, are a fifth of it here.
    """
    settings = [*FREE, *(f"{Z}.{each}" for each in changes)]

    def grows(share: float) -> bool:
        machine = scenario.load(SCENARIO, [*settings, *contact(share * stiffness, share * damping)]).machine
        loops = judge(machine, checked_modes(machine))
        return any(each.growing for each in loops if each.axis == "Z" and each.state == "moving")

    low, high = 1e-3, 1.0
    assert grows(low)
    assert not grows(high)
    while high > 1.002 * low:
        middle = (low * high) ** 0.5
        low, high = (middle, high) if grows(middle) else (low, middle)
    D = 4e-6
    foretold = brentq(
        lambda A: 1 - 2 / np.pi * (np.arcsin(D / A) + D / A * np.sqrt(1 - (D / A) ** 2)) - low, 1.0001 * D, 100 * D
    )
    trace = run(fmus, *settings, *contact(stiffness, damping, 2 * D), "motions.1.duration=2 s").trace
    last = trace.time > trace.time[-1] - 0.5
    time, way = trace.time[last], trace["Z.transmission.way"][last]

    def swing(f: float) -> tuple[float, float]:
        waves = np.stack([np.ones_like(time), np.sin(2 * np.pi * f * time), np.cos(2 * np.pi * f * time)], axis=1)
        (_, a, b), rest, *_ = np.linalg.lstsq(waves, way, rcond=None)
        return float(rest[0]), float(np.hypot(a, b))

    near = np.fft.rfftfreq(8 * len(way), T_C)[np.abs(np.fft.rfft(way - way.mean(), 8 * len(way))).argmax()]
    f = min(np.linspace(near - 0.5, near + 0.5, 51), key=lambda f: swing(f)[0])
    assert swing(f)[1] == pytest.approx(foretold, rel=0.1)
    assert np.ptp(trace["Z.x_a"][last]) > 2 * D  # and the scale sees it


def test_one_unit_gives_the_same_bits(fmus: Path) -> None:
    changes = [*contact(200e6, 3e4, 5e-6), f"{Z}.guide.share=30 %", "motions.1.duration=0.1 s"]
    own, one = run(fmus, *changes), run(fmus, *changes, "coupling.units=one")
    for name in ("Z.x_a", "Z.n_a", "Z.transmission.F", "Z.transmission.way"):
        assert np.array_equal(own.trace[name], one.trace[name]), name


def test_a_step_that_does_not_settle_fails(fmus: Path, tmp_path: Path) -> None:
    """Two motors on one mass, each with 0.6 of its inertia: the rest would be less than none."""
    shapes = [8.0, 8.0, 0.0], [0.0, 0.0, 8.0]
    rows = [[i, 0, 0, *n, *(0.003 * each for each in n), *(0.003 * each for each in n)] for i, n in enumerate(shapes)]
    table = write_modes(tmp_path / "modes.csv", rows)
    archive = Archive.unpack(fmus / "plant.fmu", tmp_path / "plant")
    own: dict[str, float | str] = {"modes_file": str(table)}
    for axis in "XY":
        own |= {f"{axis}.transmission.stiffness": 2e8, f"{axis}.transmission.inertia": 0.6 / 8**2}
    with archive.instance(own, inputs={"X.M_a": 3.0}) as plant:
        with pytest.raises(FMICallException):
            plant.step(T_C)
        assert "do not settle over this step of 0.000125 s" in plant.texts(fmi2Error)


def test_faults_are_refused(fmus: Path) -> None:
    with pytest.raises(InputError, match=r"below 0\.95 of the inertia"):
        run(fmus, *contact(200e6, 0.0), f"{Z}.transmission.inertia=0.01 kg.m^2")
    with pytest.raises(InputError, match="stiffness is missing"):
        run(fmus, f"{Z}.transmission.play=8 um")
