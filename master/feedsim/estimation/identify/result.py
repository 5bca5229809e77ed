"""What identification finds: estimates with their uncertainty, and what they were found from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import nan
from typing import Literal

import numpy as np

from feedsim.estimation.identify.record import Array
from feedsim.estimation.least_squares import ANY_VALUE, half_width, is_determined, reason
from feedsim.foundation.errors import Finding

Status = Literal["estimated", "held", "given", "undetermined"]


@dataclass(frozen=True)
class Estimate:
    """A parameter.

    Attributes:
        value: SI, in `unit`.
        sigma: standard deviation; nan where it was held, given or could not be determined.
        status: estimated; held at a usual value; given by the user; undetermined: the data do not determine.
        reason: why it is held or undetermined.
    """

    name: str
    value: float
    unit: str
    meaning: str
    sigma: float = nan
    status: Status = "estimated"
    reason: str = ""

    @property
    def interval(self) -> tuple[float, float]:
        """Confidence interval of 95 %, from the linearised model."""
        half = half_width(self.sigma)
        return self.value - half, self.value + half

    def judged(self) -> Estimate:
        """The same, undetermined where its interval is too wide; its value stays, as it fits together with the rest."""
        half = half_width(self.sigma)
        if self.status != "estimated" or self.name in ANY_VALUE or is_determined(self.value, half):
            return self
        return replace(self, status="undetermined", reason=reason(self.value, half))


@dataclass(frozen=True, eq=False)
class Correlation:
    """Correlation matrix (P, P) of the estimated parameters `names`."""

    names: tuple[str, ...]
    matrix: Array


@dataclass(frozen=True)
class Plateau:
    """A stretch at constant speed.

    Attributes:
        record: name of the record; begin, end [s].
        speed: mean [rad/s], signed.
        torque: mean motor torque less inertia and known load [N.m], signed.
        sigma: standard deviation of that mean [N.m], from the scatter within the plateau (its correlation included).
        rows: number of samples.
        elapsed: from the begin of all records, one after the other, to the middle of the stretch [s].
    """

    record: str
    begin: float
    end: float
    speed: float
    torque: float
    sigma: float
    rows: int
    elapsed: float = 0.0


@dataclass(frozen=True, eq=False)
class Stationary:
    """Stage 1: friction at constant speed (Eq. 7 plus sigma_2), constant load apart.

    Attributes:
        estimates: F_C, F_S, v_s, beta, F_log, v_log, sigma_2, asymmetry, M_0.
        covariance: of the estimated ones, in the order of correlation.names. drift: the part of it by viscous friction
            that may warm while the plateaus are driven, as far as they do not show it.
        speeds (K,), torque (K,), sigma (K,): the curve |M_fr| over |n| without asymmetry, and its standard deviation.
        range: lowest and highest speed of the plateaus [rad/s].
        rms: residual of the plateaus [N.m].
        worst_curve: largest deviation of a plateau's friction from the curve, over the curve [1].
    """

    plateaus: tuple[Plateau, ...]
    estimates: Mapping[str, Estimate]
    correlation: Correlation
    covariance: Array
    drift: Array
    speeds: Array
    torque: Array
    sigma: Array
    range: tuple[float, float]
    rms: float
    worst_curve: float
    warnings: tuple[Finding, ...] = ()


@dataclass(frozen=True, eq=False)
class Stretch:
    """A stretch of motion that stage 2 was fitted to.

    Attributes:
        kind: "sine" or "motion".
        time [s], angle [rad], speed [rad/s], measured: torque less inertia and load [N.m], model: friction law [N.m].
        amplitude: of the motor angle [rad]; of a sine that of its fundamental, else half the range. frequency: of a
            sine [Hz], else nan.
        weight: standard deviation that the residuals were divided by [N.m].
    """

    record: str
    kind: Literal["sine", "motion"]
    time: Array
    angle: Array
    speed: Array
    measured: Array
    model: Array
    amplitude: float
    frequency: float
    weight: float

    @property
    def rms(self) -> float:
        """Of the residual [N.m]."""
        return float(np.sqrt(np.mean((self.measured - self.model) ** 2)))


@dataclass(frozen=True, eq=False)
class Dynamic:
    """Stage 2: pre-sliding and transition, by output error.

    Attributes:
        estimates: sigma_0, sigma_1, W, gamma; delay of the torque channel [s]; J [kg.m2]; and what was re-estimated of
            stage 1.
        covariance: of the estimated ones, in the order of correlation.names.
        without_delay: standard deviations there would be were the delay known, per name.
        advice: which moves are missing for which parameter, a sentence each.
    """

    stretches: tuple[Stretch, ...]
    estimates: Mapping[str, Estimate]
    correlation: Correlation
    covariance: Array
    rms: float
    without_delay: Mapping[str, float] = field(default_factory=dict)
    advice: tuple[str, ...] = ()
    warnings: tuple[Finding, ...] = ()


@dataclass(frozen=True, eq=False)
class Drift:
    """One record driven in open loop by its torque (open_loop.py).

    Attributes:
        time (N,) [s]; angle (N,): recorded, from the start on [rad].
        before, after: (N,) recorded less reached angle [rad]; after with what was tried where the step was refused.
    """

    record: str
    time: Array
    angle: Array
    before: Array
    after: Array


@dataclass(frozen=True, eq=False)
class Balance:
    """What the position in open loop says of F_C and M_0 (open_loop.py).

    Attributes:
        estimates: all that were given; where it was applied, with the new F_C, F_S and M_0. Their standard deviation is
            no less than what puts the value before at the end of the interval of 95 %: two criteria disagree by that.
        applied: whether the values are new. reason: why not; empty where they are.
        records: names of those that it looked at.
        position: rms of the angle in open loop [rad], before and after; torque: rms of the torque residual [N.m] at the
            rows of stage 2, before and after. After is what was tried where it was refused; nan where nothing was.
        changes: F_C, F_S and M_0 before and after (what was tried where it was refused); empty where nothing was tried.
        drifts: the records in open loop; empty where nothing was tried.
        load_rates: record -> dM_0/dt [N.m/s]; M_0 is that in the middle of a record. Empty where M_0 was not free.
        applies: False where all records are of sines, which the step is not meant for.
    """

    estimates: Mapping[str, Estimate]
    applied: bool
    reason: str
    records: tuple[str, ...] = ()
    position: tuple[float, float] = (nan, nan)
    torque: tuple[float, float] = (nan, nan)
    changes: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    drifts: tuple[Drift, ...] = ()
    load_rates: Mapping[str, Estimate] = field(default_factory=dict)
    applies: bool = True


@dataclass(frozen=True, eq=False, repr=False)
class Identification:
    """All of it, for one axis.

    Attributes:
        I_P: lead [m/rad], for values at the slide.
        estimates: the final set, by name: every friction parameter, M_0, J, delay.
        correlation: of all estimated together.
        seconds: wall time per step ("reading", "inertia", "plateaus", "stage 1", "stage 2", "open loop").
        rigid: the simple model beside it, by inverse dynamics of all records: J, sigma_2, F_C, M_0; empty where the
            records determine no inertia.
        balance: F_C and M_0 from the position in open loop; None where that was not asked for.
        prior: False where both stages are of the same records: then stage 1 did not enter the estimates, and its
            warnings are not among these.
    """

    axis: str
    I_P: float
    estimates: Mapping[str, Estimate]
    correlation: Correlation
    stationary: Stationary | None
    dynamic: Dynamic | None
    warnings: tuple[Finding, ...]
    advice: tuple[str, ...]
    seconds: Mapping[str, float]
    rigid: Mapping[str, Estimate] = field(default_factory=dict)
    balance: Balance | None = None
    prior: bool = True

    def __repr__(self) -> str:
        result = [
            f"{name} {estimate.value:.4g} {estimate.unit}".strip()
            for name, estimate in self.estimates.items()
            if estimate.status == "estimated"
        ]
        reported = f"; {len(self.warnings)} warnings" if self.warnings else ""
        return f"Identification of {self.axis}: {', '.join(result) or 'nothing estimated'}{reported}"
