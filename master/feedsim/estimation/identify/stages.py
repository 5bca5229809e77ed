"""Friction of an axis from its records: which record serves which stage, both stages, and one set of parameters."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from itertools import pairwise
from math import nan, pi
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from feedsim.estimation.identify.clipping import without_clipped
from feedsim.estimation.identify.inertia import Inertia, contradiction, inertia
from feedsim.estimation.identify.motion import Part, motion, parts
from feedsim.estimation.identify.open_loop import balance_loads
from feedsim.estimation.identify.output_error import dynamic
from feedsim.estimation.identify.parameters import (
    CONSTANT_SPEED,
    DEFAULT_SHAPES,
    FIXED_PARAMETERS,
    NO_EFFECT,
    PARAMETER_KINDS,
    PRE_SLIDING,
    Kind,
    check_fixed,
    curve,
    estimate,
)
from feedsim.estimation.identify.plateaus import plateaus
from feedsim.estimation.identify.read import Provenance, check_estimates, check_inertia
from feedsim.estimation.identify.record import Array, Record
from feedsim.estimation.identify.result import Correlation, Dynamic, Estimate, Identification, Plateau, Stationary
from feedsim.estimation.identify.stribeck import FEW_SPEEDS, Points, stationary
from feedsim.estimation.least_squares import NORMAL_95
from feedsim.estimation.parameter import Prior
from feedsim.foundation import units
from feedsim.foundation.errors import Finding, InputError
from feedsim.scenario import Friction, FrictionParameters, Machine
from feedsim.scenario.roles import FRICTION_ROLE, FRICTION_UNITS
from feedsim.structure import Modes
from feedsim.structure.modes import checked_modes

if TYPE_CHECKING:
    from feedsim.simulation.cosim.friction_law import FrictionLaw


# --- What is known of an axis before its identification, and what is wanted of it -------------------------------------


STAGES = (1, 2)
LEAD_KIND = Kind("m/rad", "lead", above=0.0)


@dataclass(frozen=True)
class Options:
    """What is known and what is wanted.

    Attributes:
        axis: its name. I_P: lead [m/rad].
        J: inertia seen at the motor [kg.m2], `given`; None: estimated from accelerating parts.
        modes: of the machine whose J_tot is given: what its structure takes beyond J dn/dt is known then.
        delay: of the torque channel [s]; None: estimated.
        hold: name -> SI value that a parameter keeps. free: names that are estimated although they are usually held.
        fallback: name -> SI value, for what the records do not determine: the friction of the machine so far.
        stages: 1 stationary friction, 2 pre-sliding.
        law: that is fitted.
        fleet: what machines of the same kind have; None: not known.
        seed: of the random starts.

    Raises InputError: a lead or an inertia that is not above 0, a delay or a value of `hold` outside its range
        (`parameters.PARAMETER_KINDS`), F_S held below F_C, a name that is no parameter, or one that is both held and
        free.
    """

    axis: str
    I_P: float
    J: Estimate | None = None
    modes: Modes | None = None
    delay: float | None = None
    hold: Mapping[str, float] = field(default_factory=dict)
    free: tuple[str, ...] = ()
    fallback: Mapping[str, float] = field(default_factory=dict)
    stages: tuple[int, ...] = STAGES
    law: str = Friction.law
    fleet: Prior | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        known = (*units.parameters(FRICTION_UNITS.get(self.law, FRICTION_ROLE.shipped)), "M_0")
        for name in (*self.hold, *self.free):
            if name not in known:
                raise InputError(f"no parameter {name!r}; there are {', '.join(known)}")
            if name in self.hold and name in self.free:
                raise InputError(f"{name} cannot be held and free at once")
        LEAD_KIND.check("the lead I_P is given as", self.I_P)
        if self.J is not None:
            PARAMETER_KINDS["J"].check("the inertia is given as", self.J.value)
        if self.delay is not None:
            PARAMETER_KINDS["delay"].check("the delay of the torque is given as", self.delay)
        check_fixed(self.hold)


@dataclass(frozen=True)
class AxisRequest:
    """What someone says of an axis, ahead of its traces.

    Attributes:
        axis: its name; None: the only one that the traces determine.
        inertia: seen at the motor [kg.m2]; mass: the same at the slide [kg], and in words; None: not said.
        delay: of the torque channel [s]; None: not said.
        estimated: "inertia", "delay", or both: to be estimated, whatever mapping and machine say.
        hold, free, stages, law: as in :class:`Options`.
        fleets: axis -> what machines of the same kind have, as in :class:`Options`.
    """

    axis: str | None = None
    inertia: float | None = None
    mass: float | None = None
    mass_reason: str = ""
    delay: float | None = None
    estimated: tuple[str, ...] = ()
    hold: Mapping[str, float] = field(default_factory=dict)
    free: tuple[str, ...] = ()
    stages: tuple[int, ...] = STAGES
    law: str = Friction.law
    fleets: Mapping[str, Prior] = field(default_factory=dict)

    def with_traces(self, sources: Sequence[Provenance], machine: Machine | None = None) -> Options:
        """What is known when the traces are read: this, else what their mapping says, else the machine.

        Raises InputError: the traces are of several axes or pitches, or determine none; else as :class:`Options`.
        """
        axis = self._axis(sources)
        pitches = {source.pitch: source.file for source in sources if source.pitch is not None}
        if len(pitches) > 1:
            which = ", ".join(f"{1e3 * pitch:.9g} mm ({file})" for pitch, file in pitches.items())
            raise InputError(f"the traces have different pitches: {which}")
        if not pitches:
            raise InputError(
                "the pitch of the axis is needed, for values at the slide: give --machine, or pitch: 20 mm in --columns"
            )
        I_P = next(iter(pitches)) / (2 * pi)
        own = machine.axes.get(axis) if machine is not None else None
        J, modes = self._inertia_from_user(I_P, sources), None
        if J is None and "inertia" not in self.estimated and machine is not None and own is not None:
            modes = checked_modes(machine)
            reason = f"J_tot of the modes of {machine.name}, whose flexibility is taken off the torque"
            J = estimate("J", modes.J_tot(axis), status="given", reason=reason)
        if self.fleets and axis not in self.fleets:
            raise InputError(f"the prior is of the axes {', '.join(self.fleets)}; the traces are of {axis}")
        friction = machine.shipped_frictions.get(axis) if machine is not None else None
        delays = {source.torque_delay for source in sources}
        of_mapping = delays.pop() if len(delays) == 1 and "delay" not in self.estimated else None
        return Options(
            axis=axis,
            I_P=I_P,
            J=J,
            modes=modes,
            delay=of_mapping if self.delay is None else self.delay,
            hold=self.hold,
            free=self.free,
            # The friction that the machine file has: for parameters that the traces do not determine.
            fallback=_of_law(friction, self.law) if friction is not None else {},
            stages=self.stages,
            law=self.law,
            fleet=self.fleets.get(axis),
        )

    def _axis(self, sources: Sequence[Provenance]) -> str:
        named = {source.axis: source.file for source in sources if source.axis}
        if self.axis:
            named.setdefault(self.axis, Path("--axes"))
        if len(named) > 1:
            which = ", ".join(f"{axis} ({file})" for axis, file in named.items())
            raise InputError(f"the traces are of several axes: {which}; --axes names one, and its traces are needed")
        if not named:
            raise InputError("the traces do not say which axis they are of; give --axes, for example --axes Z")
        return next(iter(named))

    def _inertia_from_user(self, I_P: float, sources: Sequence[Provenance]) -> Estimate | None:
        """What is said, else what the mapping says; None: neither, or it is to be estimated."""
        if self.mass is not None:
            return estimate("J", self.mass * I_P**2, status="given", reason=self.mass_reason)
        if self.inertia is not None:
            return estimate("J", self.inertia, status="given", reason="as given")
        of_mapping = [source.inertia for source in sources if source.inertia is not None]
        if not of_mapping or "inertia" in self.estimated:
            return None
        return estimate("J", of_mapping[0], status="given", reason="of the mapping")


def _of_law(friction: FrictionParameters, law: str) -> dict[str, float]:
    """The parameters of a friction that mean the same in a law: of another one the torque over speed."""
    same = friction.law == law
    return {name: float(value) for name, value in friction.parameters().items() if same or name in CONSTANT_SPEED}


# --- Friction of an axis from its records: which record serves which stage, both stages, and one set of parameters ----


# --- What a flexible structure takes from the motor beyond its inertia ------------------------------------------------
# At low frequencies the rotor moves the whole axis: M_a - M_fr = J_tot dn/dt. Towards the first modes (a machine bed
# rocks from 20 Hz on) the structure answers otherwise, and a sine of 10 Hz already meets 4 % more than J_tot, with a
# phase. Bristle stiffness and damping, which are small beside the inertia there, would be off by as much as that.
# With
# the machine's modes the difference is known and is a load like any other:
#     M(f) = [1/P(f) - j 2 pi f J_tot] n(f),    P = sum over the modes of b^2 s/(s^2 + 2 zeta omega_0 s + omega_0^2)
# with P the mobility n/M at the rotor, the other motors without torque (Wiesauer, Bleicher, 18th CIRP CMMO (2021),
# section 2.1).


# [Hz] Friction's harmonics above are small, noise of the speed is not; and there the structure has modes enough for
# the difference to be anything. It fades out over the upper half.
MAX_CORRECTION_FREQUENCY = 60.0
SETTLE = 2.0  # s by which a record is continued to its beginning, as the transform takes it for periodic


def with_structure(record: Record, modes: Modes, axis: str) -> Record:
    """The record with the structure's torque beyond J_tot dn/dt added to its known load.

    The torque belongs to the same instants as the motion. Raises InputError: the modes do not know the axis.
    """
    if f"n_{axis}" not in modes.ports:
        raise InputError(f"{modes.file}: no mode shapes n_{axis} of axis {axis}")
    extra = structure_torque(motion(record).coarse(), record.interval, modes, axis)
    return replace(record, load=extra if record.load is None else record.load + extra)


def structure_torque(n: Array, interval: float, modes: Modes, axis: str) -> Array:
    """(N,) torque [N.m] of the structure beyond J_tot dn/dt, for the rotor's speed n (N,) [rad/s] every `interval` [s].

    Exact for what lies within half of MAX_CORRECTION_FREQUENCY, and below that of Nyquist's frequency.
    """
    rows = len(n)
    more = round(SETTLE / interval)
    # back to the beginning along half a cosine: a jump would ring
    back = n[-1] + (n[0] - n[-1]) * 0.5 * (1 - np.cos(np.pi * (np.arange(more) + 1) / (more + 1)))
    whole = np.concatenate([n, back])
    frequency = np.fft.rfftfreq(len(whole), interval)
    s = np.asarray(2j * np.pi * frequency[1:], dtype=np.complex128)
    beyond = np.zeros(len(frequency), dtype=np.complex128)
    beyond[1:] = 1 / mobility(s, modes, axis) - s * modes.J_tot(axis)
    highest = min(MAX_CORRECTION_FREQUENCY, 0.5 / interval)
    fading = np.clip((frequency / highest - 0.5) / 0.5, 0.0, 1.0)
    beyond *= 0.5 * (1 + np.cos(np.pi * fading))
    return np.fft.irfft(np.fft.rfft(whole) * beyond, len(whole))[:rows]


def mobility(s: NDArray[np.complex128], modes: Modes, axis: str) -> NDArray[np.complex128]:
    """n/M at the rotor of `axis` [(rad/s)/(N.m)] at s (F,) [rad/s], no other torque acting."""
    omega_0 = 2 * np.pi * modes.frequency
    total = np.zeros(len(s), dtype=np.complex128)
    for b, omega, zeta in zip(modes.ports[f"n_{axis}"], omega_0, modes.damping, strict=True):
        total += b**2 / s if omega == 0 else b**2 * s / (s * s + 2 * zeta * omega * s + omega**2)
    return total


Progress = Callable[[str, int, int], None]  # what is being done, how many of its steps are done, of how many

# Pre-sliding of an axis without a word from its records: bristles that give 5 mrad at break-away and relax in 2.5 ms.
USUAL_DEFLECTION, USUAL_RELAXATION = 5e-3, 2.5e-3
# relative, standard deviations: a given inertia that is off by both is worth a warning
INERTIA_MISMATCH, INERTIA_SIGMAS = 0.1, 4.0
NOTHING_TOLD = Correlation((), np.zeros((0, 0)))
FLEET_SHARE = 0.9  # of the fleet's standard deviation, from which on a value is the fleet's rather than the records'
SLIDING_AMPLITUDE = 1.0  # [rad], some 20 times a usual pre-sliding: amplitude above which a sine is mostly sliding


def identify(
    records: Sequence[Record], law: FrictionLaw, options: Options, progress: Progress | None = None
) -> Identification:
    """Friction parameters of one axis.

    law: the friction model. Stage 1 takes every stretch at constant speed; stage 2 takes the records with sines or,
    where there are none, all whose axis reverses. Stage 1 enters stage 2 as a prior, unless both are of the same
    records. Either may be absent; what it would determine is then held, with the reason. Of records of general motion
    F_C and M_0 are then taken from the position in open loop (open_loop.py).

    Raises InputError: no records, neither plateaus nor reversals, or a fit that cannot be made.
    """
    if not records:
        raise InputError("no records to identify from")
    records, said = without_clipped(records, options.J.value if options.J is not None else None)
    if options.modes is not None:
        records = [with_structure(record, options.modes, options.axis) for record in records]
    return _Run(records, law, options, progress or (lambda what, done, total: None), said).result()


class _Run:
    """One identification: steps, how long each took, and what there is to say."""

    def __init__(
        self,
        records: Sequence[Record],
        law: FrictionLaw,
        options: Options,
        progress: Progress,
        said: Sequence[Finding] = (),
    ) -> None:
        self.records, self.law, self.options, self.progress = records, law, options, progress
        self.seconds: dict[str, float] = {}
        self.warnings: list[Finding] = list(said)
        self.advice: list[str] = []
        self.reasons: dict[int, str] = {}  # stage -> why it is absent
        self.prior = True  # whether stage 1 enters stage 2

    def result(self) -> Identification:
        options = self.options
        with self._measure_time("inertia"):
            rigid = self._rigid(self.records)
            J = options.J or (rigid.J if rigid is not None else None)
            self._compare(rigid)
            if rigid is not None:
                check_estimates(rigid.estimates, options.I_P)
        with self._measure_time("plateaus"):
            # J dn/dt hardly matters at constant speed.
            results = self._plateaus(J.value if J is not None else 0.0) if 1 in options.stages else ()
        with self._measure_time("stage 1"):
            first = self._stationary(results)
        with self._measure_time("stage 2"):
            second = self._dynamic(first)
        if first is None and second is None:
            raise InputError(
                "the records determine no friction: " + "; ".join(self.reasons[stage] for stage in sorted(self.reasons))
            )
        with self._measure_time("open loop"):
            estimates: Mapping[str, Estimate] = self._merge_estimates(first, second, J)
            balance = None
            if second is not None and not (first is not None and self.prior):  # the curve is determined by its plateaus
                self.progress("open loop", 0, 1)
                balance = balance_loads(transitions(self.records), self.law, estimates, hold=options.hold)
                estimates = balance.estimates
                self.progress("open loop", 1, 1)
        estimates, believed = self._check_against_rigid(estimates, rigid)
        check_estimates(estimates, options.I_P)
        prior = self.prior or second is None
        # Doubts of a stage 1 that the estimates do not rest on would be doubts about nothing.
        if first is not None and prior:
            # Nor is what stage 1 could not determine, but stage 2 does.
            known = [name for name, value in estimates.items() if value.status == "estimated"]
            self.warnings += [
                finding for finding in first.warnings if finding.code != "parameter-held" or finding.place not in known
            ]
        self.warnings += second.warnings if second is not None else ()
        self.advice += second.advice if second is not None else ()
        return Identification(
            axis=options.axis,
            I_P=options.I_P,
            estimates={name: value.judged() for name, value in estimates.items()},
            correlation=merged_correlation(first if prior else None, second, self.law.names)
            if believed
            else NOTHING_TOLD,
            stationary=first,
            dynamic=second,
            warnings=tuple(dict.fromkeys(self.warnings)),
            advice=tuple(dict.fromkeys(self.advice)),
            seconds=self.seconds,
            rigid=rigid.estimates if rigid is not None else {},
            balance=balance,
            prior=prior,
        )

    def _check_against_rigid(
        self, estimates: Mapping[str, Estimate], rigid: Inertia | None
    ) -> tuple[Mapping[str, Estimate], bool]:
        """The estimates, unless they contradict the rigid axis beyond doubt: then nothing of them is offered, and the
        values are those of the rigid axis."""
        if rigid is None or not self._slides():
            return estimates, True
        reason = contradiction(rigid, estimates)
        if not reason:
            return estimates, True
        reason = f"the fit went astray: it says {reason}"
        remedy = "look at signs, units and known load"
        text = f"no parameter is offered as estimated: {reason}; {remedy}"
        self.warnings.insert(0, Finding("fit-astray", "doubt", text, "", remedy))
        line = {name: entry.value for name, entry in rigid.estimates.items()}
        line |= {"F_S": line["F_C"], "F_log": 0.0, "asymmetry": 0.0, "sigma_0": line["F_C"] / USUAL_DEFLECTION}
        line |= {"sigma_1": line["sigma_0"] * USUAL_RELAXATION, "W": NO_EFFECT["W"], "gamma": NO_EFFECT["gamma"]}
        line["sigma_2"] = max(line["sigma_2"], 0.0)
        doubtful = ("estimated", "undetermined")
        return {
            name: replace(entry, value=line.get(name, entry.value), sigma=nan, status="undetermined", reason=reason)
            if entry.status in doubtful
            else entry
            for name, entry in estimates.items()
        }, False

    def _slides(self) -> bool:
        """Whether anything moves by more than small sines: else the rigid axis's simple friction does not hold, whose
        pre-sliding passes for less inertia."""
        every = (part for record in self.records for part in _parts(record))
        return any(part.kind != "sine" or part.amplitude > SLIDING_AMPLITUDE for part in every)

    def _plateaus(self, J: float) -> tuple[Plateau, ...]:
        result: list[Plateau] = []
        for k, (record, begun) in enumerate(zip(self.records, record_starts(self.records), strict=True)):
            self.progress("plateaus", k, len(self.records))
            result += [replace(plateau, elapsed=begun + plateau.elapsed) for plateau in plateaus(record, J)]
        self.progress("plateaus", len(self.records), len(self.records))
        return tuple(result)

    def _stationary(self, result: tuple[Plateau, ...]) -> Stationary | None:
        if 1 not in self.options.stages:
            self.reasons[1] = "stage 1 was not asked for"
            return None
        if not result:
            self.reasons[1] = "no stretches at constant speed"
            self.advice.append(
                "no stretch at constant speed was found: strokes at 8 or more speeds from 10 mm/min up, in both "
                "directions, determine the Stribeck curve"
            )
            return None
        self.progress("stage 1: Stribeck curve", 0, 1)
        hold, free = self._constant_values(CONSTANT_SPEED)
        try:
            stage = stationary(result, hold=hold, free=free, seed=self.options.seed, I_P=self.options.I_P)
            return stage if self.options.fleet is None else with_fleet(stage, self.options.fleet)
        except InputError as error:
            self.reasons[1] = str(error)
            self.warnings.append(Finding("stribeck-curve-missing", "doubt", f"no Stribeck curve: {error}"))
            return None
        finally:
            self.progress("stage 1: Stribeck curve", 1, 1)

    def _dynamic(self, first: Stationary | None) -> Dynamic | None:
        chosen = transitions(self.records) if 2 in self.options.stages else ()
        if 2 not in self.options.stages:
            self.reasons[2] = "stage 2 was not asked for"
        elif not chosen:
            self.reasons[2] = "no reversals"
            self.advice.append(
                "the axis reverses nowhere in the records: sines of 5 um at 10 Hz, 20 um at 5 Hz, 100 um at 2 Hz and "
                "200 um at 1 Hz determine the pre-sliding"
            )
        if not chosen:
            return None
        # Nothing counts twice: plateaus that a prior is made of are left out of the motion. But where a few speeds
        # among it determine no curve, the motion as a whole determines more than they and the rest apart.
        names = {record.name for record in chosen}
        others = [record for record in self.records if record.name not in names]
        if first is not None and any(plateau.record in names for plateau in first.plateaus):
            self.prior = len(Points.of(first.plateaus).speeds) >= FEW_SPEEDS
        hold, free = self._constant_values((*self.law.names, "M_0"))
        rigid = self._rigid(others) if others and self.options.J is None else None
        try:
            return dynamic(
                chosen,
                self.law,
                prior=first if self.prior else None,
                J=rigid.J if rigid is not None else self.options.J,
                delay=self.options.delay,
                hold=hold,
                free=free,
                fleet=self.options.fleet,
                I_P=self.options.I_P,
                progress=lambda what, share: self.progress(f"stage 2: {what}", round(100 * share), 100),
            )
        except InputError as error:
            if first is None:
                raise
            self.reasons[2] = str(error)
            self.warnings.append(Finding("pre-sliding-missing", "doubt", f"no pre-sliding parameters: {error}"))
            return None

    def _rigid(self, records: Sequence[Record]) -> Inertia | None:
        """Inverse dynamics; None where the records determine no inertia."""
        self.progress("inertia", 0, 1)
        try:
            result = inertia(records)
        except InputError:
            return None
        finally:
            self.progress("inertia", 1, 1)
        if self.options.J is None:
            self.warnings += [finding for finding in result.warnings if finding not in self.warnings]
        return result

    def _compare(self, rigid: Inertia | None) -> None:
        """Warn where the given inertia is not that of the accelerating parts.

        Not by small sines alone: the simple friction of the rigid axis does not hold in and near pre-sliding, whose
        stiffness passes for less inertia.
        """
        given = self.options.J
        if given is None or rigid is None:
            return
        away = rigid.J.value - given.value
        far = abs(away) > max(INERTIA_MISMATCH * given.value, INERTIA_SIGMAS * rigid.J.sigma)
        if far and self._slides():
            check_inertia(given, rigid.J)
            remedy = "check the inertia, the torque constant and the pitch, or let it be estimated"
            self.warnings.append(Finding(
                "inertia-contradicted", "doubt",
                f"the inertia is given as {given.value:.4g} kg.m2, accelerating parts of the records say "
                f"{rigid.J.value:.4g} +- {NORMAL_95 * rigid.J.sigma:.2g} kg.m2: {remedy}",
                "J", remedy,
            ))  # fmt: skip

    def _constant_values(self, names: Collection[str]) -> tuple[dict[str, float], tuple[str, ...]]:
        """What of `names` is held at which value, besides the usual ones, and what is freed."""
        constant = {
            name: self.options.fallback.get(name, NO_EFFECT[name])
            for name in FIXED_PARAMETERS
            if name in self.law.names
        }
        fixed = {name: value for name, value in (constant | dict(self.options.hold)).items() if name in names}
        return fixed, tuple(name for name in self.options.free if name in names)

    def _merge_estimates(
        self, first: Stationary | None, second: Dynamic | None, J: Estimate | None
    ) -> dict[str, Estimate]:
        """One estimate per parameter: stage 2's, which knows stage 1, else stage 1's, else what is held, and why.

        Where stage 2 stands alone its whole set is taken: values of two fits do not make one friction.
        """
        result: dict[str, Estimate] = {"J": J} if J is not None else {}
        for stage in (first, second):
            if stage is not None:
                known = {name for name, value in result.items() if value.status == "estimated" and self.prior}
                result |= {
                    name: value
                    for name, value in stage.estimates.items()
                    if name not in known or value.status == "estimated"
                }
        if "delay" not in result and self.options.delay is not None:
            reason = "not used: stage 2 is absent"
            result["delay"] = estimate("delay", self.options.delay, status="given", reason=reason)
        for name in self.law.names:
            if name not in result:
                result[name] = self._undetermined_estimate(name, result)
        if self.options.fleet is not None:
            result |= _of_fleet(self.options.fleet, result)
        if result["F_S"].value < result["F_C"].value:
            reason = "no rise towards rest is seen: the fit puts it below F_C"
            result["F_S"] = replace(
                result["F_S"], value=result["F_C"].value, sigma=nan, status="undetermined", reason=reason
            )
        return {name: result[name] for name in (*self.law.names, "M_0", "J", "delay") if name in result}

    def _undetermined_estimate(self, name: str, estimates: Mapping[str, Estimate]) -> Estimate:
        """A parameter that no stage determines."""
        options, reason = self.options, self.reasons.get(2 if name in PRE_SLIDING else 1, "")

        def held(value: float, why: str) -> Estimate:
            return estimate(name, value, status="held", reason=f"{reason}; {why}".lstrip("; "))

        if name in options.hold:
            return estimate(name, options.hold[name], status="held", reason="as asked for")
        if name in DEFAULT_SHAPES and name not in options.free:
            return estimate(name, DEFAULT_SHAPES[name], status="held", reason="usual value")
        if options.fleet is not None and name in options.fleet.names:
            at = options.fleet.names.index(name)
            sigma = float(np.sqrt(options.fleet.covariance[at, at]))
            return estimate(name, float(options.fleet.values[at]), sigma)
        if name in options.fallback:
            return held(options.fallback[name], "value of the machine file")
        if name in ("F_C", "F_S"):
            other = estimates.get("F_C" if name == "F_S" else "F_S")
            if other is None:
                raise InputError(f"{name} is not determined by the records: {reason}")
            return held(other.value, f"as {other.name}")
        if name == "sigma_0":
            return held(estimates["F_S"].value / USUAL_DEFLECTION, "usual deflection")
        if name == "sigma_1":
            return held(estimates["sigma_0"].value * USUAL_RELAXATION, "usual relaxation time")
        return held(NO_EFFECT[name], "no effect")

    @contextmanager
    def _measure_time(self, step: str) -> Iterator[None]:
        """Adds the time that a block takes."""
        begin = perf_counter()
        yield
        self.seconds[step] = perf_counter() - begin


def with_fleet(stage: Stationary, fleet: Prior) -> Stationary:
    """Stage 1 with what machines of the same kind have: the Bayesian update of a linear model.

    What may have drifted is in the intervals, not in the weights, as in stage 2: the fleet takes nothing off it.
    """
    names = stage.correlation.names
    own = fleet.restrict(names)
    if not own.names:
        return stage
    at = [names.index(name) for name in own.names]
    weighed = stage.covariance - stage.drift
    gain = weighed[:, at] @ np.linalg.inv(weighed[np.ix_(at, at)] + own.covariance)
    rest = np.eye(len(names))
    rest[:, at] -= gain
    values = np.array([stage.estimates[name].value for name in names])
    values = values + gain @ (own.values - values[at])
    drift = rest @ stage.drift @ rest.T
    covariance = rest @ weighed + drift
    sigma = np.sqrt(np.diag(covariance))
    moved = {
        name: replace(stage.estimates[name], value=float(value), sigma=float(deviation))
        for name, value, deviation in zip(names, values, sigma, strict=True)
    }
    matrix = Correlation(names, covariance / np.outer(sigma, sigma))
    estimates = {**stage.estimates, **moved}
    line = curve({name: one.value for name, one in estimates.items()}, stage.speeds)
    return replace(stage, estimates=estimates, covariance=covariance, drift=drift, correlation=matrix, torque=line)


def _of_fleet(fleet: Prior, estimates: Mapping[str, Estimate]) -> dict[str, Estimate]:
    """Estimates that are the fleet's, as the records add little to them: they are given rather than estimated."""
    sigmas = dict(zip(fleet.names, map(float, np.sqrt(np.diag(fleet.covariance))), strict=True))
    reason = "of the fleet: these records add little"
    return {
        name: replace(estimates[name], status="given", reason=reason)
        for name, sigma in sigmas.items()
        if name in estimates and estimates[name].status == "estimated" and estimates[name].sigma > FLEET_SHARE * sigma
    }


def record_starts(records: Sequence[Record]) -> list[float]:
    """When each record began [s], one after the other: pieces of a trace as its time says, files without a gap."""
    values = [0.0]
    for before, after in pairwise(records):
        gap = float(after.time[0] - before.time[-1])
        values.append(values[-1] + float(before.time[-1] - before.time[0]) + max(gap, 0.0))
    return values


def transitions(records: Sequence[Record]) -> tuple[Record, ...]:
    """Records that stage 2 is fitted to: those with sines, else those in which the axis reverses."""
    result = {id(record): _parts(record) for record in records}
    sines = tuple(r for r in records if any(part.kind == "sine" for part in result[id(r)]))
    if sines:
        return sines
    ways = {id(record): _directions(record, result[id(record)]) for record in records}
    reversing = tuple(r for r in records if len(ways[id(r)]) > 1)
    # Strokes of one direction each, of which one file is up and the other down, determine both together.
    both = len(set().union(*ways.values())) > 1
    return reversing or tuple(r for r in records if both and ways[id(r)])


def merged_correlation(first: Stationary | None, second: Dynamic | None, law: Sequence[str]) -> Correlation:
    """Of all that was estimated; nan between a parameter that stage 1 alone determines and one that stage 2 alone
    does."""
    stages = [stage.correlation for stage in (second, first) if stage is not None]
    names = tuple(dict.fromkeys(name for stage in stages for name in stage.names))
    matrix = np.full((len(names), len(names)), nan)
    for entry in reversed(stages):  # stage 2 last: it knows more
        at = [names.index(name) for name in entry.names]
        matrix[np.ix_(at, at)] = entry.matrix
    np.fill_diagonal(matrix, 1.0)
    known = (*law, "M_0", "J", "delay")
    order = [name for name in known if name in names] + [name for name in names if name not in known]
    at = [names.index(name) for name in order]
    return Correlation(tuple(order), matrix[np.ix_(at, at)])


def _parts(record: Record) -> tuple[Part, ...]:
    try:
        return parts(record, motion(record))
    except InputError:  # too short to separate a motion from noise
        return ()


def _directions(record: Record, result: Sequence[Part]) -> set[float]:
    """Signs of the directions in which the axis moves, within a stretch or from one to the next."""
    if any(part.reversals for part in result):
        return {-1.0, 1.0}
    speed = motion(record).coarse() if result else None
    return set() if speed is None else {float(np.sign(np.sum(speed[part.rows]))) for part in result}
