"""Fits whose differences are contacts side by side: the bits of one after the other, on however many cores."""

from __future__ import annotations

import numpy as np
import pytest

from feedsim.estimation.identify import search as searched
from feedsim.estimation.identify.motion import models
from feedsim.estimation.identify.parameters import NO_EFFECT
from feedsim.estimation.identify.record import Record
from feedsim.estimation.identify.search import Search, Solution
from feedsim.estimation.parameter import Prior
from feedsim.simulation.cosim.friction_law import FrictionLaw
from identification_helpers import sines

TRUE = {**NO_EFFECT, "sigma_0": 300.0, "sigma_1": 0.8, "sigma_2": 0.006, "F_C": 1.6, "F_S": 2.0, "v_s": 0.6,
        "F_log": 0.3, "v_log": 3.0, "W": 0.04, "gamma": 0.35, "J": 0.0164, "M_0": 0.1, "delay": 0.0}  # fmt: skip
FREE = ("sigma_0", "F_C", "F_S", "v_s", "F_log", "W", "gamma", "J", "M_0", "delay")
INTERVAL = 1e-3


def record(law: FrictionLaw, name: str, moves: tuple[tuple[float, float, int], ...]) -> Record:
    angle = sines(moves, INTERVAL)
    speed = np.gradient(angle, INTERVAL, edge_order=2)
    friction = law({key: TRUE[key] for key in law.names}, speed, INTERVAL)
    torque = friction + TRUE["J"] * np.gradient(speed, INTERVAL, edge_order=2) + TRUE["M_0"]
    return Record(name, np.arange(len(angle)) * INTERVAL, torque, angle=angle, speed=speed)


@pytest.fixture(scope="module")
def search(law: FrictionLaw) -> Search:
    """Of two records, whose first states are parameters of their own."""
    records = [
        record(law, "first", ((100e-6, 2, 4), (20e-6, 5, 6))),
        record(law, "second", ((50e-6, 4, 6),)),
    ]
    fine = models(records, law)
    return Search(fine, Prior((), np.zeros(0), np.zeros((0, 0))), [np.full(len(model.parts), 0.01) for model in fine])


def solved(search: Search, values: dict[str, float]) -> Solution:
    return search.solve(values, np.zeros((2, 2)), FREE, tolerance=1e-6, limit=30)


def test_a_fit_has_the_same_bits_side_by_side(search: Search, monkeypatch: pytest.MonkeyPatch) -> None:
    begin = {**TRUE, "sigma_0": 280.0, "F_C": 1.5, "W": 0.042}
    runs, asked = [], type(search.models[0]).respond
    monkeypatch.setattr(
        type(search.models[0]), "respond", lambda model, fine, at: runs.append(len(at)) or asked(model, fine, at)
    )
    results = []
    for cores in (1, 2, 5):
        monkeypatch.setattr(searched, "cores", lambda cores=cores: cores)
        results.append(solved(search, begin))
        assert max(runs) >= (len(FREE) - 3) // cores  # contacts in one call
        runs.clear()
    monkeypatch.setattr(Search, "_work_ahead", lambda search, points: None)
    results.append(solved(search, begin))
    assert set(runs) == {1}
    for result in results[:-1]:
        assert result.values == results[-1].values
        np.testing.assert_array_equal(result.states, results[-1].states)
        np.testing.assert_array_equal(result.fit.covariance, results[-1].fit.covariance)
    before = search.cost(Solution(begin, np.zeros((2, 2)), results[0].fit))
    assert search.cost(results[0]) < 1e-3 * before


def test_what_the_law_refuses_is_refused_when_it_is_asked_for(search: Search) -> None:
    """And not before: the others of the row are as good as without it."""
    model = search.models[0]
    good, bad = {**TRUE, "sigma_0": 299.0}, {**TRUE, "F_C": 2.2}
    search._work_ahead([(good, np.zeros((2, 2))), (bad, np.zeros((2, 2)))])
    assert np.all(np.isfinite(model.friction(good, 0.0, 0.0)))
    with pytest.raises(searched.InputError, match="F_S"):
        model.friction(bad, 0.0, 0.0)
