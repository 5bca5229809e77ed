"""Why a parameter is not told: first words that say what matters, each reason once among the warnings."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest

from feedsim.estimation.identify.parameters import EXCESS
from feedsim.estimation.identify.uncertainty import GOES_WITH, verdict, warn_undetermined
from identification_helpers import TRUE, estimates, stationary


class Found(dict[str, float]):
    """Values under the names that the solver moves, and which of them sit at a bound."""

    at_bound: tuple[str, ...] = ()


@dataclass
class Solved:
    """What a verdict is found from."""

    relative: dict[str, float]  # standard deviations over the values; 1 % where there is none
    changes: dict[str, float] = field(default_factory=dict)
    at_bound: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        self.values = {name: value for name, (value, _, _) in TRUE.items()} | self.changes
        self.fit = Found(self.values | {EXCESS: self.values["F_S"] - self.values["F_C"]})
        self.fit.at_bound = self.at_bound

    def sigma(self, name: str) -> float:
        return self.relative.get(name, 0.01) * abs(self.fit[name])


@pytest.mark.parametrize(
    ("solved", "reasons", "held"),
    [
        (Solved({"sigma_1": 0.69}), {"sigma_1": "its 95 % interval is +-135 % of the value"}, {"sigma_1": 0.0}),
        (Solved({EXCESS: 1.43}),
         {"F_S": "the 95 % interval of F_S - F_C is +-280 % of the value", "v_s": f"{GOES_WITH} F_S"},
         {"F_S": 1.6, "v_s": 0.6}),
        (Solved({"gamma": 1.42}), {"gamma": "its 95 % interval is +-278 % of the value", "W": f"{GOES_WITH} gamma"},
         {"gamma": 1.0, "W": 0.0}),
        (Solved({}, {"gamma": 0.999}),
         {"gamma": "no engaging zone shows, the full stiffness", "W": f"{GOES_WITH} gamma"}, {"gamma": 1.0, "W": 0.0}),
        (Solved({}, {"sigma_2": 0.0}), {"sigma_2": "the record fits best without"}, {"sigma_2": 0.0}),
        (Solved({"sigma_0": np.inf}), {"sigma_0": "the record does not answer to it"}, {"sigma_0": 300.0}),
        (Solved({}, at_bound=("v_s",)), {"v_s": "the fit ends at the end of its range (0.6 rad/s)"}, {"v_s": 0.6}),
    ],
)  # fmt: skip
def test_reasons(solved: Any, reasons: dict[str, str], held: dict[str, float]) -> None:
    free = ["sigma_0", "sigma_1", "sigma_2", "F_C", "F_S", "v_s", "W", "gamma"]
    judged = verdict(solved, free)
    assert judged is not None
    assert judged.name == next(iter(reasons))
    for name, words in reasons.items():
        assert judged.reasons[name].startswith(words)
        assert judged.held[name] == held[name]


def test_all_that_is_told_is_let_alone() -> None:
    solved: Any = Solved({})
    assert verdict(solved, ["sigma_0", "sigma_1", "W", "gamma"]) is None


def test_each_reason_is_said_once() -> None:
    held: Any = {
        "sigma_1": ("undetermined", "its 95 % interval is +-135 % of the value"),
        "M_0": ("undetermined", "one direction only"),
        "asymmetry": ("undetermined", "one direction only"),
        "gamma": ("undetermined", "its 95 % interval is +-278 % of the value"),
        "W": ("undetermined", f"{GOES_WITH} gamma"),
        "beta": ("held", "usual value"),
    }
    said = ("sigma_1: its 95 % interval is +-135 % of the value", "M_0 and asymmetry: one direction only",
            "gamma: its 95 % interval is +-278 % of the value")  # fmt: skip
    found = warn_undetermined(held, None)
    assert {finding.code for finding in found} == {"parameter-undetermined"}
    assert tuple(finding.text for finding in found) == said
    assert [finding.place for finding in found] == ["sigma_1", "M_0, asymmetry", "gamma"]
    # What stage 1 hands on it has said itself.
    first = stationary(estimates())
    load = replace(first.estimates["M_0"], status="undetermined", reason="one direction only")
    prior = replace(first, estimates={**first.estimates, "M_0": load})
    left = tuple(finding.text for finding in warn_undetermined(held, prior))
    assert left == (said[0], "asymmetry: one direction only", said[2])
