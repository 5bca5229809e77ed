"""A drive tuned within margins: searched on some moves and circles, checked on others, judged on moves never used.

A candidate is judged in closed form first, at every pose and with the frequencies of the modes changed: gain and phase
margin of speed and position loop, moving and at rest, and the torque that encoder noise makes. What keeps to them runs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from feedsim.analysis.figures import Array
from feedsim.arguments import spelt
from feedsim.cosim.plant import plant_modes
from feedsim.linear.candidates import Candidates, Judged
from feedsim.linear.judgement import Loop, judge
from feedsim.owned import TemporaryFolder
from feedsim.scenario import Drive, Machine, Scenario
from feedsim.structure import Modes
from feedsim.structure.modes import with_transmissions, write_modes
from feedsim.tune.drive_program import DriveProgram, Errors, circles_of, partner_of, stops_of
from feedsim.tune.drive_result import ERROR_FLOOR, WORSE, Case, Limits, Margins, Point, Tuned, decibels
from feedsim.tune.effects import Effect, effects_of
from feedsim.tune.knobs import Knobs, matched
from feedsim.tune.search import Rank, least

Progress = Callable[[str, int, int], None]

FREQUENCY_FACTORS = (1.0, 0.9, 1.1)  # factors on the frequencies of elastic modes
# Moves as distance [m] and feed [m/s], circles as radius [m] and feed [m/s]: to search on, to choose on, to judge on.
_MM, _MPM = 1e-3, 1 / 60
SEARCHED = (((1 * _MM, 2 * _MPM), (10 * _MM, 5 * _MPM), (100 * _MM, 10 * _MPM)),
            ((5 * _MM, 1 * _MPM), (15 * _MM, 3 * _MPM), (50 * _MM, 6 * _MPM)))  # fmt: skip
CHOSEN = (((2 * _MM, 4 * _MPM), (20 * _MM, 8 * _MPM), (60 * _MM, 3 * _MPM)),
          ((8 * _MM, 2.5 * _MPM), (25 * _MM, 2 * _MPM), (40 * _MM, 8 * _MPM)))  # fmt: skip
HELD = (((0.5 * _MM, 1 * _MPM), (5 * _MM, 3 * _MPM), (30 * _MM, 10 * _MPM), (100 * _MM, 5 * _MPM)),
        ((10 * _MM, 1.5 * _MPM), (15 * _MM, 3.5 * _MPM), (30 * _MM, 5 * _MPM)))  # fmt: skip
GAINED = 0.95  # of the errors' mean ratio: what gains less is not worth a change
WEIGHT = 4.0  # exponent of the mean of ratios: large ones count more
MARGIN_SHARE = 0.75  # of the margins asked for: candidates from there on run, for the picture
TORQUE = 0.95  # of the torque limit
NOISE = 0.02  # of the torque limit: torque that encoder noise may make [1]
SIMPLEX_STEPS, EVALUATIONS = (0.12, 0.12, 0.05), 130  # of the search's starts; evaluations per start
BACK = (1.0, 0.8, 0.6, 0.4, 0.2)  # ways back to the present drive that are tried
FINALISTS = 4
FASTER = {"K_p": 4.0, "T_n": 0.15, "K_v": 2.0, "omega_0": 3.0}  # direction of the closed-form start
HALVINGS = 5


@dataclass(frozen=True, eq=False)
class Part:
    """A program, and the factor on the frequencies of elastic modes with which it is run."""

    program: DriveProgram
    factor: float


def tune_drive(
    scenario: Scenario, axis: str, limits: Limits, poses: Mapping[str, Modes] | None = None, *,
    fmus: Path | None, progress: Progress, evaluations: int = EVALUATIONS,
) -> Tuned:  # fmt: skip
    """Find a better drive of an axis and judge it. poses: further ones, name -> modes.

    Raises InputError, and as :func:`feedsim.cosim.run`.
    """
    with _Search.begun(scenario, axis, limits, poses or {}, fmus, progress, evaluations) as search:
        return search.tuned()


@dataclass(eq=False)
class _Search:
    """The search, and all that it has met."""

    scenario: Scenario
    axis: str
    partner: str
    limits: Limits
    fmus: Path | None
    progress: Progress
    evaluations: int
    knobs: Knobs
    judges: Mapping[str, Candidates]
    poses: tuple[str, ...]
    scaled: Mapping[float, Path]
    parts: tuple[Part, ...]
    before: tuple[Errors, ...]
    margins_before: Margins
    points: list[Point]
    tried: list[tuple[Rank, Array]]
    seen: list[Margins]
    closed: int = 0
    runs: int = 0

    @classmethod
    @contextmanager
    def begun(
        cls, scenario: Scenario, axis: str, limits: Limits, poses: Mapping[str, Modes], fmus: Path | None,
        progress: Progress, evaluations: int,
    ) -> Iterator[_Search]:  # fmt: skip
        """Plan, judge and run the drive as it is."""
        machine = scenario.machine
        own, _ = plant_modes(_without_transmissions(machine))  # tables hold structures; contacts come behind
        partner = partner_of(scenario, axis)
        with TemporaryFolder() as folder:
            scaled = {1.0: machine.modes}
            for factor in FREQUENCY_FACTORS[1:]:
                scaled[factor] = folder / f"modes_{factor}.csv"
                write_modes(scaled[factor], _scaled(own, factor))
            judges = {}
            for name, modes in {"pose of the machine file": own, **poses}.items():
                for factor in FREQUENCY_FACTORS if not own.rigid.all() else FREQUENCY_FACTORS[:1]:
                    what = name if factor == 1 else f"{name}, {_percent('modes', factor)}"
                    judges[what] = Candidates(machine, with_transmissions(machine, _scaled(modes, factor)), axis)
            elastic = not with_transmissions(machine, own).rigid.all()
            knobs = Knobs(machine.shipped_drive(axis, "tuning"), machine.cycles, own.J_tot(axis), elastic)
            search = cls(
                scenario, axis, partner, limits, fmus, progress, evaluations, knobs, judges,
                ("pose of the machine file", *poses), scaled, (), (),
                _margins(judges, knobs.drive), [], [], [],
            )  # fmt: skip
            search.parts = search.of(SEARCHED)
            search.before = search.errors(search.parts, machine)
            yield search

    def of(self, wanted: tuple[Sequence[tuple[float, float]], ...]) -> tuple[Part, ...]:
        """Moves with every factor on the modes, which shake most behind a stop, and circles with the modes as they
        are."""
        stops, circles = wanted
        moves = _program(self.scenario, self.axis, self.partner, (stops, ()))
        factors = FREQUENCY_FACTORS if len(self.judges) > len(self.poses) else FREQUENCY_FACTORS[:1]
        turns = _program(self.scenario, self.axis, self.partner, ((), circles))
        return (Part(turns, 1.0), *(Part(moves, factor) for factor in factors))

    def errors(self, parts: Sequence[Part], machine: Machine) -> tuple[Errors, ...]:
        """What a machine makes of every part."""
        return tuple(each.program.errors(self.with_modes(machine, each.factor), fmus=self.fmus) for each in parts)

    # --- a candidate ------------------------------------------------------------------------------------------------

    def machine_with(self, drive: Drive) -> Machine:
        """The scenario's machine with a drive, and the axes of a path matched."""
        before = self.scenario.machine
        own = before.axes[self.axis].model_copy(update={"drive": drive})
        changed = before.model_copy(update={"axes": {**before.axes, self.axis: own}})
        return matched(changed, self.axis, before)

    def rank(self, x: Array) -> Rank:
        """Violation of the limits, and mean ratio of errors, of a candidate at places x."""
        drive = self.knobs.drive_at(x)
        found = self._rank(drive, self.margins(drive))
        self.tried.append((found, x))
        return found

    def margins(self, drive: Drive) -> Margins:
        """Of a candidate, which is counted."""
        found = _margins(self.judges, drive)
        self.closed += 1
        self.seen.append(found)
        return found

    def _rank(self, drive: Drive, margins: Margins) -> Rank:
        violation = self.violation(margins)
        if violation > 0 and (
            margins.gain < MARGIN_SHARE * self.limits.gain_margin
            or margins.phase < MARGIN_SHARE * self.limits.phase_margin
        ):
            return violation, math.inf
        errors = self.errors(self.parts, self.machine_with(drive))
        self.runs += 1
        ratios, ratio = _ratios(self.before, errors)
        torque, before = (max(each.torque for each in some) for some in (errors, self.before))
        most = max(TORQUE * drive.M_max, before)
        violation += max(0.0, torque / most - 1) + float(np.maximum(ratios / WORSE - 1, 0).sum())
        self.points.append(Point(margins, ratio, float(errors[0].peak.max()), violation == 0))
        return violation, ratio

    def violation(self, margins: Margins) -> float:
        """0 where the limits are kept: shares that are missing of the margins, and of the noise that is too much."""
        if not math.isfinite(margins.gain + margins.phase):
            return 10.0 if margins.gain < 0 else 0.0
        noise = margins.noise * self.limits.encoder_noise
        return self.limits.missing(margins) + max(0.0, noise / self.most_noise - 1)

    @property
    def most_noise(self) -> float:
        """Standard deviation of the torque [N.m] that encoder noise may make."""
        return max(NOISE * self.knobs.drive.M_max, self.margins_before.noise * self.limits.encoder_noise)

    # --- the search -------------------------------------------------------------------------------------------------

    def tuned(self) -> Tuned:
        """Search, choose, judge."""
        drive, kept = self.chosen(self.searched())
        machine = self.machine_with(drive) if not kept else self.scenario.machine
        after = self._checked(machine) if not kept else self.margins_before
        return Tuned(
            self.scenario, self.axis, self.partner, self.limits, machine, self.margins_before, after,
            self._searched_case(machine),
            tuple(self.judged(machine)), tuple(self.points), (self.closed, self.runs), kept, self.poses,
            len(self.judges) > len(self.poses),
        )  # fmt: skip

    def searched(self) -> list[Array]:
        """Places of the best candidates within the limits, the best first."""
        done, total = 0, len(SIMPLEX_STEPS) * self.evaluations

        def counted(x: Array) -> Rank:
            nonlocal done
            self.progress("candidates", done, total)
            done += 1
            return self.rank(x)

        starts: tuple[Callable[[], Array], ...] = (self.fast_start, self.as_present, self.best_yet)
        for seed, (start, step) in enumerate(zip(starts, SIMPLEX_STEPS, strict=True), start=1):
            least(counted, start(), step=step, evaluations=self.evaluations, seed=seed)
        self.progress("candidates", total, total)
        allowed = sorted((each for each in self.tried if each[0][0] == 0), key=lambda each: each[0])
        return [x for _, x in allowed[:FINALISTS]]

    def as_present(self) -> Array:
        """Places of the drive as it is."""
        return self.knobs.present

    def best_yet(self) -> Array:
        """Places of the best candidate that was tried."""
        return min(self.tried, key=lambda each: each[0])[1]

    def fast_start(self) -> Array:
        """All gains higher together, as far as the margins allow: by closed forms alone."""
        present = self.knobs.present
        fast = present.copy()
        for k, knob in enumerate(self.knobs.all):
            if knob.name in FASTER:
                fast[k] = knob.place(FASTER[knob.name] * knob.value(float(present[k])))
            elif knob.name in ("fit", "off"):
                fast[k] = knob.place(1.0 if knob.name == "fit" else 0.0)
        low, high = 0.0, 1.0
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            if self.violation(self.margins(self.knobs.drive_at(present + middle * (fast - present)))) == 0:
                low = middle
            else:
                high = middle
        return np.asarray(present + low * (fast - present))

    def chosen(self, finalists: Sequence[Array]) -> tuple[Drive, str]:
        """The best candidate that is worse nowhere on further moves and circles, or why none is.

        Candidates that are worse somewhere are taken back part of the way to the present drive.
        """
        present = self.knobs.drive
        if not finalists:
            return present, self.without()
        parts = self.of(CHOSEN)
        before = self.errors(parts, self.scenario.machine)
        total, done = len(BACK) * len(finalists), 0
        for share in BACK:
            best: tuple[float, Drive] | None = None
            for x in finalists:
                self.progress("choosing", done, total)
                done += 1
                drive = self.knobs.drive_at(self.knobs.present + share * (x - self.knobs.present))
                if self.violation(self.margins(drive)) > 0:
                    continue
                ratios, ratio = _ratios(before, self.errors(parts, self.machine_with(drive)))
                self.runs += 1
                if ratios.max() <= WORSE and ratio < GAINED and (best is None or ratio < best[0]):
                    best = ratio, drive
            if best is not None:
                self.progress("choosing", total, total)
                return best[1], ""
        self.progress("choosing", total, total)
        return present, "no candidate within the margins is better on further moves and circles"

    def without(self) -> str:
        """Why no candidate is left: its margins, its noise, or its errors."""
        limits = self.limits
        asked = f"{limits.gain_margin:g} dB and {limits.phase_margin:g} deg"
        within = [each for each in self.seen if limits.missing(each) == 0]
        if not within:
            nearest = min(self.seen, key=limits.missing)
            has = (
                f"the nearest has {decibels(nearest.gain)} and {nearest.phase:.3g} deg"
                if math.isfinite(limits.missing(nearest))
                else "none is stable"
            )
            return f"none of {self.closed} candidates has {asked}; {has}; ask for less or raise {spelt('evaluations')}"
        if all(self.violation(each) > 0 for each in within):
            noise = min(each.noise for each in within) * limits.encoder_noise
            return (
                f"the {len(within)} candidates with {asked} turn the encoder's noise into {noise:.3g} N.m of torque or "
                f"more, {self.most_noise:.3g} N.m are allowed; ask for less or correct {spelt('encoder_noise')}"
            )
        return "no candidate within the margins is better on every move"

    def judged(self, machine: Machine) -> Iterator[Case]:
        """Moves and circles that nothing was chosen by: as the machine is, modes changed, friction changed."""
        program = _program(self.scenario, self.axis, self.partner, HELD)
        cases: dict[str, Callable[[Machine], Machine]] = {"as the machine file has it": lambda own: own}
        if len(self.judges) > len(self.poses):
            cases |= {_percent("modes", f): partial(self.with_modes, factor=f) for f in FREQUENCY_FACTORS[1:]}
        cases |= {
            effect.words: partial(_effect_on, effect=effect, axis=self.axis)
            for effect, _ in effects_of(self.scenario.machine, [self.axis])
        }
        for k, (name, change) in enumerate(cases.items()):
            self.progress("judging", k, len(cases))
            before = program.errors(change(self.scenario.machine), fmus=self.fmus)
            after = program.errors(change(machine), fmus=self.fmus)
            yield Case(name, program, before, after)
        self.progress("judging", len(cases), len(cases))

    def _searched_case(self, machine: Machine) -> Case:
        circles = self.parts[0].program
        return Case("searched on", circles, self.before[0], circles.errors(machine, fmus=self.fmus))

    def with_modes(self, machine: Machine, factor: float) -> Machine:
        """A machine whose elastic modes have other frequencies."""
        if factor == 1:
            return machine
        return machine.model_copy(update={"modes": self.scaled[factor], "plant": None, "structure": None})

    def _checked(self, machine: Machine) -> Margins:
        """The margins of the result, by a second judgement that keeps nothing and knows nothing of the search."""
        found = {
            name: _least_of([loop for loop in judge(machine, each.modes) if loop.axis == self.axis])
            for name, each in self.judges.items()
        }
        noise = _margins(self.judges, machine.shipped_drive(self.axis, "tuning")).noise
        return _over(found, noise)


def _program(
    scenario: Scenario, axis: str, partner: str, wanted: tuple[Sequence[tuple[float, float]], ...]
) -> DriveProgram:
    stops, circles = wanted
    machine = scenario.machine
    return DriveProgram.of(
        scenario, axis, partner, stops_of(machine, axis, stops), circles_of(machine, axis, partner, circles)
    )


def _ratios(before: Sequence[Errors], after: Sequence[Errors]) -> tuple[Array, float]:
    """After over before, of distances and means behind stops and of peaks, where what is below ERROR_FLOOR
    counts as ERROR_FLOOR;
    and their mean, to which stops and reversals add one half each."""
    groups = []
    for names in (("miss", "tail"), ("peak",)):
        pairs = [(getattr(b, name), getattr(a, name)) for b, a in zip(before, after, strict=True) for name in names]
        groups.append(
            np.concatenate([np.maximum(new, ERROR_FLOOR) / np.maximum(old, ERROR_FLOOR) for old, new in pairs])
        )
    mean = np.mean([np.mean(group**WEIGHT) for group in groups if group.size])
    return np.concatenate(groups), float(mean ** (1 / WEIGHT))


def _margins(judges: Mapping[str, Candidates], drive: Drive) -> Margins:
    found: dict[str, Judged] = {name: each.judge(drive) for name, each in judges.items()}
    noise = max(each.noise for each in found.values())
    return _over({name: _least_of(each.loops) for name, each in found.items()}, noise)


def _least_of(loops: Sequence[Loop]) -> tuple[tuple[float, str], tuple[float, str]]:
    """Least gain margin [dB] and phase margin [deg] of loops, each with the loop."""
    if any(loop.growing for loop in loops):
        return (-math.inf, "unstable"), (-math.inf, "unstable")
    gain = min(loops, key=lambda loop: loop.gain_margin)
    phase = min(loops, key=lambda loop: loop.phase_margin)
    size = 20 * math.log10(gain.gain_margin) if math.isfinite(gain.gain_margin) else math.inf
    return (size, f"{gain.kind} loop {gain.state}"), (phase.phase_margin, f"{phase.kind} loop {phase.state}")


def _over(found: Mapping[str, tuple[tuple[float, str], tuple[float, str]]], noise: float) -> Margins:
    gain = min(found, key=lambda name: found[name][0][0])
    phase = min(found, key=lambda name: found[name][1][0])
    return Margins(
        found[gain][0][0], found[phase][1][0], f"{found[gain][0][1]}, {gain}", f"{found[phase][1][1]}, {phase}", noise
    )


def _scaled(modes: Modes, factor: float) -> Modes:
    return modes if factor == 1 else replace(modes, frequency=modes.frequency * factor)


def _without_transmissions(machine: Machine) -> Machine:
    axes = {name: axis.model_copy(update={"transmission": None}) for name, axis in machine.axes.items()}
    return machine.model_copy(update={"axes": axes})


def _percent(what: str, factor: float) -> str:
    return f"{what} {abs(100 * (factor - 1)):.0f} % {'higher' if factor > 1 else 'lower'}"


def _effect_on(machine: Machine, effect: Effect, axis: str) -> Machine:
    return effect.on(machine, [axis]) or machine
