"""What a structure takes beyond its inertia, against the equations of motion of two masses on a spring."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from feedsim.estimation.identify.record import Record
from feedsim.estimation.identify.stages import structure_torque, with_structure
from feedsim.foundation.errors import InputError
from feedsim.structure import Modes

J_1, J_2, STIFFNESS = 0.01, 0.006, 180.0  # kg.m2, kg.m2, N.m/rad: resonance at 34.9 Hz, rotor held: 27.6 Hz
RATIO = 0.05
T = 2e-3


def two_masses() -> Modes:
    """Rotor J_1, on which the torque acts and whose speed is seen, and J_2 behind a spring."""
    J = J_1 + J_2
    omega = np.sqrt(STIFFNESS * (1 / J_1 + 1 / J_2))
    rigid, elastic = 1 / np.sqrt(J), np.sqrt(J_2 / (J_1 * J))
    frequency, damping = np.array([0.0, omega / (2 * np.pi)]), np.array([0.0, RATIO])
    return Modes(Path("two"), frequency, damping, {"n_Z": np.array([rigid, elastic])})


def closed_form(f: float) -> complex:
    """Torque per speed of the rotor less J s, with the mode's damping as a damper beside the spring."""
    s = 2j * np.pi * f
    d = 2 * RATIO * np.sqrt(STIFFNESS * J_1 * J_2 / (J_1 + J_2))
    link = STIFFNESS + d * s
    return complex(J_1 * s + link / s - (link / s) * link / (J_2 * s * s + link) - (J_1 + J_2) * s)


@pytest.mark.parametrize("f", [1.0, 5.0, 10.0, 25.0])
def test_torque_of_two_masses(f: float) -> None:
    t = np.arange(0.0, 8.0, T)
    fade = np.clip(np.minimum(t, t[-1] - t) / 1.0, 0, 1) ** 2
    n = 0.1 * fade * np.sin(2 * np.pi * f * t)
    found = structure_torque(n, T, two_masses(), "Z")
    middle = (t > 2.0) & (t < 6.0)
    waves = np.column_stack([np.sin(2 * np.pi * f * t), np.cos(2 * np.pi * f * t)])[middle]
    real, imaginary = np.linalg.lstsq(waves, found[middle], rcond=None)[0] / 0.1
    # what the fading stirs at the resonance (damping 5 %, 1 s on) is left: e^(-0.05 2 pi 35) = 2e-5 of the amplitude
    assert complex(real, imaginary) == pytest.approx(closed_form(f), rel=1e-3)


def test_a_rigid_axis_takes_nothing() -> None:
    modes = Modes(Path("one"), np.zeros(1), np.zeros(1), {"n_Z": np.array([8.0])})
    n = np.random.default_rng(4).normal(size=1000)
    assert np.max(np.abs(structure_torque(n, T, modes, "Z"))) < 1e-12


def test_it_joins_a_known_load() -> None:
    t = np.arange(0.0, 2.0, T)
    n = 0.1 * np.sin(2 * np.pi * 5 * t) * np.sin(np.pi * t / 2) ** 2
    plain = Record("r", t, np.zeros_like(t), speed=n)
    loaded = Record("r", t, np.zeros_like(t), speed=n, load=np.full_like(t, 3.0))
    alone, joined = (with_structure(record, two_masses(), "Z").load for record in (plain, loaded))
    assert alone is not None
    assert joined is not None
    assert np.max(np.abs(alone)) > 1e-4
    np.testing.assert_allclose(joined, alone + 3.0, rtol=0, atol=1e-12)


def test_an_axis_that_the_modes_do_not_know() -> None:
    t = np.arange(0.0, 1.0, T)
    with pytest.raises(InputError, match="two: no mode shapes n_X of axis X"):
        with_structure(Record("r", t, np.zeros_like(t), speed=np.sin(t)), two_masses(), "X")
