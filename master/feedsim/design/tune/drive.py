"""A drive tuned within margins: searched on some moves and circles, checked on others, judged on moves never used.

A candidate is judged in closed form first, at every pose and with the frequencies of the modes changed: gain and phase
margin of speed and position loop, moving and at rest, and the torque that encoder noise makes. What keeps to them runs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from feedsim.analysis.figures import Array
from feedsim.design.tune.drive_program import DriveProgram, Errors, circles_of, partner_of, stops_of
from feedsim.design.tune.knobs import Effect, Knobs, effects_of, match_lag
from feedsim.design.uncertainty import (
    JUDGE_SEED,
    SEARCH_DRAWS,
    SEARCH_SEED,
    Cloud,
    draw_named,
    torque_scale,
    typed_drive,
    typed_on,
)
from feedsim.files.fields import FileContent
from feedsim.foundation.arguments import spell_argument
from feedsim.foundation.units import parameters
from feedsim.linear.judgement import Candidates, Loop, judge
from feedsim.scenario import Drive, Machine, Scenario
from feedsim.scenario.axis_units import Parameter
from feedsim.simulation.cosim.plant import plant_modes
from feedsim.structure import Modes
from feedsim.structure.modes import table_of_modes, with_transmissions

# --- A tuned drive: limits, margins, candidates, errors before and after ----------------------------------------------


# --- Parameters of drives that differ between two machines of the same axes: what is to be typed ----------------------


@dataclass(frozen=True)
class ChangedParameter:
    """A parameter of an axis that has another value.

    machine: name of the machine. parameter: below the axis in a machine file, such as "drive.K_v". old, new: SI, a
    switch, or the name of a filter's type; old None: it had none. unit: SI, "1" of a plain number, "" of a switch.
    """

    machine: str
    axis: str
    parameter: str
    old: Parameter | str | None
    new: Parameter | str
    unit: str

    @property
    def key(self) -> str:
        """Of a scenario."""
        return f"machine.axes.{self.axis}.{self.parameter}"

    @property
    def text(self) -> str:
        """The new value as files have it."""
        if isinstance(self.new, bool):
            return str(self.new).lower()
        if isinstance(self.new, str):
            return self.new
        return f"{self.new!r} {self.unit}".removesuffix(" 1").strip()

    @property
    def setting(self) -> str:
        """KEY=VALUE, as behind --set."""
        return f"{self.key}={self.text}"


def changed_values(before: Machine, after: Machine) -> tuple[ChangedParameter, ...]:
    """Parameters of shipped drives whose values differ, by axis, in the order of the unit's table."""
    table = parameters("controller")
    result = []
    for axis in before.axes:
        old, new = before.axes[axis].drive, after.axes[axis].drive
        if not isinstance(old, Drive) or not isinstance(new, Drive):
            continue
        was, now = old.parameters(), new.parameters()
        for name, value in now.items():
            if was.get(name) == value or name not in table:
                continue
            row = table[name]
            if name.endswith(".type"):
                group = name.partition(".")[0]
                types = (getattr(old, group).type, getattr(new, group).type)
                result.append(ChangedParameter(before.name, axis, f"drive.{name}", *types, ""))
            else:
                result.append(ChangedParameter(before.name, axis, f"drive.{name}", was.get(name), value, row.unit))
    return tuple(result)


WORSE_ERROR_RATIO = 1.05  # of an error, from where on it counts as worse
ERROR_FLOOR = 0.05e-6  # [m] of an error: below it nothing counts


@dataclass(frozen=True)
class Limits:
    """What a drive has to keep to: margins [dB], [deg], standard deviation of the encoder's angle [rad]."""

    gain_margin: float
    phase_margin: float
    encoder_noise: float

    def missing(self, margins: Margins) -> float:
        """Shares of the margins asked for that are missing; 0 where both are there, infinite without stability."""
        return max(0.0, 1 - margins.gain / self.gain_margin) + max(0.0, 1 - margins.phase / self.phase_margin)


@dataclass(frozen=True, eq=False)
class Margins:
    """Of a drive, over all poses and modes: least margins [dB], [deg], the loops that have them, and torque noise
    [N.m]."""

    gain: float
    phase: float
    gain_of: str
    phase_of: str
    noise: float


@dataclass(frozen=True, eq=False)
class Point:
    """A candidate that has run: margins, mean ratio of its errors to those of the present drive, largest peak [m]."""

    margins: Margins
    ratio: float
    peak: float
    allowed: bool


@dataclass(frozen=True, eq=False)
class Case:
    """Moves and circles with errors before and after. name: under what."""

    name: str
    program: DriveProgram
    before: Errors
    after: Errors

    @property
    def rows(self) -> Iterator[tuple[str, str, float, float]]:
        """Motion, figure, before and after [m]: the largest distance behind a stop, the peak of a reversal."""
        for k, stop in enumerate(self.program.stops):
            yield stop.text, "miss", float(self.before.miss[k]), float(self.after.miss[k])
        for k, circle in enumerate(self.program.circles):
            yield circle.text, "peak", float(self.before.peak[k]), float(self.after.peak[k])

    @property
    def worse(self) -> list[tuple[str, str, float, float]]:
        """Those that got worse by more than 5 %."""
        return [row for row in self.rows if row[3] > WORSE_ERROR_RATIO * row[2] + ERROR_FLOOR]


@dataclass(frozen=True, eq=False)
class DrawnMachines:
    """What the drive does on draws of the machine from the intervals of its identified values.

    margins: of every draw, over all poses and modes. cases: motions of every draw; none where the drive stays as it is.
    """

    cloud: Cloud
    margins: tuple[Margins, ...]
    cases: tuple[Case, ...]

    @property
    def count(self) -> int:
        """Draws."""
        return len(self.margins)


@dataclass(frozen=True, eq=False)
class TunedDrive:
    """A drive and what it does.

    machine: with it. before, after: margins. searched: what it was searched on. judged: what it was judged on, as the
    machine is first. points: of the search.
    evaluations: closed forms, runs. kept: why the drive stays as it is; "" where it changes. poses: in words.
    drawn: what it does on draws of the machine, where they were asked for.
    """

    scenario: Scenario
    axis: str
    partner: str
    limits: Limits
    machine: Machine
    before: Margins
    after: Margins
    searched: Case
    judged: tuple[Case, ...]
    points: tuple[Point, ...]
    evaluations: tuple[int, int]
    kept: str
    poses: tuple[str, ...]
    elastic: bool
    drawn: DrawnMachines | None = None

    @property
    def changes(self) -> tuple[ChangedParameter, ...]:
        """Parameters that differ."""
        return changed_values(self.scenario.machine, self.machine)


def decibels(value: float) -> str:
    """A gain margin [dB] in words."""
    return f"{value:.3g} dB" if math.isfinite(value) else ("no limit of the gain" if value > 0 else "no stability")


# --- A drive tuned within margins: searched on some moves and circles, checked on others, judged on moves never
#     used


# --- Margins and noise of one axis with other drives: at every pose, with elastic modes changed, on draws of the machin
# A judge closes the loops of the axis on one structure. `Candidates` keeps what drives have in common; `check_margins`
# is the
# judgement that warnings of a run have, and keeps nothing.


FREQUENCY_FACTORS = (1.0, 0.9, 1.1)  # factors on the frequencies of elastic modes
WorstMargins = tuple[
    tuple[float, str], tuple[float, str]
]  # least gain margin [dB] and phase margin [deg], with their loops


@dataclass(frozen=True, eq=False)
class Judge:
    """Judges drives of an axis of a machine on one structure. draw: of the machine, or that machine."""

    candidates: Candidates
    draw: Machine
    machine: Machine
    axis: str

    def least(self, drive: Drive) -> tuple[WorstMargins, float]:
        """Least margins, and torque of noise [N.m/rad] as the machine itself has it."""
        judged = self.candidates.judge(self._on_draw(drive))
        return _least_of(judged.loops), judged.noise / torque_scale(self.machine, self.draw, self.axis)

    def checked(self, machine: Machine) -> WorstMargins:
        """Least margins of the axis of a machine with other drives."""
        changed = typed_on(self.draw, self.machine, machine)
        return _least_of([loop for loop in judge(changed, self.candidates.modes) if loop.axis == self.axis])

    def _on_draw(self, drive: Drive) -> Drive:
        return drive if self.draw is self.machine else typed_drive(self.draw, self.machine, self.axis, drive)


def judges_of(
    machine: Machine, axis: str, poses: Mapping[str, Modes], factors: Sequence[float], draw: Machine | None = None,
    name: str = "",
) -> dict[str, Judge]:  # fmt: skip
    """Name -> judge at every pose with every factor on its modes. poses: name -> modes of structures. name: of a
    draw."""
    own = machine if draw is None else draw
    judges = {}
    for pose, modes in poses.items():
        for factor in factors:
            words = ", ".join(filter(None, [name, pose, "" if factor == 1 else percent("modes", factor)]))
            candidates = Candidates(own, with_transmissions(own, scale_frequencies(modes, factor)), axis)
            judges[words] = Judge(candidates, own, machine, axis)
    return judges


def margins_of(judges: Mapping[str, Judge], drive: Drive) -> Margins:
    """Least margins and largest noise over judges."""
    result = {name: value.least(drive) for name, value in judges.items()}
    return _margins_over(
        {name: worst for name, (worst, _) in result.items()}, max(noise for _, noise in result.values())
    )


def check_margins(judges: Mapping[str, Judge], machine: Machine, axis: str) -> Margins:
    """Margins of a result, by a second judgement that keeps nothing and knows nothing of the search."""
    noise = margins_of(judges, machine.shipped_drive(axis, "tuning")).noise
    return _margins_over({name: value.checked(machine) for name, value in judges.items()}, noise)


def worse_of(one: Margins, two: Margins) -> Margins:
    """The lesser margins and the larger noise of two."""
    gain, phase = min(one, two, key=lambda margins: margins.gain), min(one, two, key=lambda margins: margins.phase)
    return Margins(gain.gain, phase.phase, gain.gain_of, phase.phase_of, max(one.noise, two.noise))


def scale_frequencies(modes: Modes, factor: float) -> Modes:
    """Modes with other frequencies."""
    return modes if factor == 1 else replace(modes, frequency=modes.frequency * factor)


def percent(what: str, factor: float) -> str:
    """A factor in words."""
    return f"{what} {abs(100 * (factor - 1)):.0f} % {'higher' if factor > 1 else 'lower'}"


def _least_of(loops: Sequence[Loop]) -> WorstMargins:
    if any(loop.growing for loop in loops):
        return (-math.inf, "unstable"), (-math.inf, "unstable")
    gain = min(loops, key=lambda loop: loop.gain_margin)
    phase = min(loops, key=lambda loop: loop.phase_margin)
    size = 20 * math.log10(gain.gain_margin) if math.isfinite(gain.gain_margin) else math.inf
    return (size, f"{gain.kind} loop {gain.state}"), (phase.phase_margin, f"{phase.kind} loop {phase.state}")


def _margins_over(result: Mapping[str, WorstMargins], noise: float) -> Margins:
    gain = min(result, key=lambda name: result[name][0][0])
    phase = min(result, key=lambda name: result[name][1][0])
    return Margins(
        result[gain][0][0],
        result[phase][1][0],
        f"{result[gain][0][1]}, {gain}",
        f"{result[phase][1][1]}, {phase}",
        noise,
    )


# --- The least of a function within a box, where some points are forbidden: an evolution strategy with ranks ----------
# Covariance matrix adaptation (N. Hansen, The CMA evolution strategy: a tutorial, arXiv:1604.00772, equations 20 to
# 44).
# Only ranks count. Allowed points stand before forbidden ones, those by the amount of the violation (K. Deb, An
# efficient
# constraint handling method for genetic algorithms, Comput. Methods Appl. Mech. Engrg. 186 (2000)).


# (violation, value): violation 0 of an allowed point. Tuples are compared as they stand.
Rank = tuple[float, float]
LEAST_STEP = 0.004  # of the box: a search whose steps are shorter has come to its end


def minimise_rank(
    rank: Callable[[Array], Rank], start: Array, *, step: float, evaluations: int, seed: int, population: int = 0
) -> tuple[Array, Rank]:
    """The best point of the unit cube (n,) that is met, and its rank.

    start: first mean. step: first standard deviation. The random numbers of a seed are the same in every call.
    """
    n = len(start)
    size = population or 4 + int(3 * math.log(n))
    half = size // 2
    weights = np.log(half + 0.5) - np.log(np.arange(1, half + 1))
    weights /= weights.sum()
    mass = 1 / float((weights**2).sum())
    c_c = (4 + mass / n) / (n + 4 + 2 * mass / n)
    c_s = (mass + 2) / (n + mass + 5)
    c_1 = 2 / ((n + 1.3) ** 2 + mass)
    c_mu = min(1 - c_1, 2 * (mass - 2 + 1 / mass) / ((n + 2) ** 2 + mass))
    damping = 1 + 2 * max(0.0, math.sqrt((mass - 1) / (n + 1)) - 1) + c_s
    length = math.sqrt(n) * (1 - 1 / (4 * n) + 1 / (21 * n**2))

    random = np.random.default_rng(seed)
    mean, sigma, covariance = np.array(start, dtype=np.float64), step, np.eye(n)
    path_c, path_s = np.zeros(n), np.zeros(n)
    best, best_rank, done, generation = mean.copy(), rank(mean), 1, 0
    while done + size <= evaluations and sigma * math.sqrt(float(np.diag(covariance).max())) > LEAST_STEP:
        values, vectors = np.linalg.eigh(covariance)
        root = np.sqrt(np.maximum(values, 1e-20))
        steps = random.normal(size=(size, n)) * root @ vectors.T
        points = 1 - np.abs((mean + sigma * steps) % 2 - 1)  # mirrored at the faces of the cube
        ranks = [rank(point) for point in points]
        done += size
        generation += 1
        order = sorted(range(size), key=lambda k: ranks[k])
        if ranks[order[0]] < best_rank:
            best, best_rank = points[order[0]].copy(), ranks[order[0]]
        taken = (points[order[:half]] - mean) / sigma
        move = weights @ taken
        mean = mean + sigma * move
        white = vectors @ ((vectors.T @ move) / root)
        path_s = (1 - c_s) * path_s + math.sqrt(c_s * (2 - c_s) * mass) * white
        ahead = float(np.linalg.norm(path_s)) / math.sqrt(1 - (1 - c_s) ** (2 * generation))
        moving = 1.0 if ahead < (1.4 + 2 / (n + 1)) * length else 0.0
        path_c = (1 - c_c) * path_c + moving * math.sqrt(c_c * (2 - c_c) * mass) * move
        covariance = (
            (1 - c_1 - c_mu + (1 - moving) * c_1 * c_c * (2 - c_c)) * covariance
            + c_1 * np.outer(path_c, path_c)
            + c_mu * (taken.T * weights) @ taken
        )
        sigma *= math.exp(min(1.0, c_s / damping * (float(np.linalg.norm(path_s)) / length - 1)))
    return best, best_rank


Progress = Callable[[str, int, int], None]

# Moves as distance [m] and feed [m/s], circles as radius [m] and feed [m/s]: to search on, to choose on, to judge on.
_MM, _MPM = 1e-3, 1 / 60
SEARCHED_MOVES = (((1 * _MM, 2 * _MPM), (10 * _MM, 5 * _MPM), (100 * _MM, 10 * _MPM)),
            ((5 * _MM, 1 * _MPM), (15 * _MM, 3 * _MPM), (50 * _MM, 6 * _MPM)))  # fmt: skip
CHOSEN = (((2 * _MM, 4 * _MPM), (20 * _MM, 8 * _MPM), (60 * _MM, 3 * _MPM)),
          ((8 * _MM, 2.5 * _MPM), (25 * _MM, 2 * _MPM), (40 * _MM, 8 * _MPM)))  # fmt: skip
HELD_OUT_MOVES = (((0.5 * _MM, 1 * _MPM), (5 * _MM, 3 * _MPM), (30 * _MM, 10 * _MPM), (100 * _MM, 5 * _MPM)),
        ((10 * _MM, 1.5 * _MPM), (15 * _MM, 3.5 * _MPM), (30 * _MM, 5 * _MPM)))  # fmt: skip
MAX_ERROR_RATIO = 0.95  # of the errors' mean ratio: what gains less is not worth a change
WEIGHT = 4.0  # exponent of the mean of ratios: large ones count more
MARGIN_SHARE = 0.75  # of the margins asked for: candidates from there on run, for the picture
TORQUE = 0.95  # of the torque limit
NOISE = 0.02  # of the torque limit: torque that encoder noise may make [1]
SIMPLEX_STEPS, EVALUATIONS = (0.12, 0.12, 0.05), 130  # of the search's starts; evaluations per start
RETURN_SHARES = (1.0, 0.8, 0.6, 0.4, 0.2)  # ways back to the present drive that are tried
FINALISTS = 4
FASTER = {"K_p": 4.0, "T_n": 0.15, "K_v": 2.0, "omega_0": 3.0}  # direction of the closed-form start
HALVINGS = 5
RUN_DRAWS = 2  # of the draws that values are found on: these run as well, the others have closed forms alone


@dataclass(frozen=True, eq=False)
class Part:
    """A program, the factor on the frequencies of elastic modes with which it is run, and on which draw of the machine,
    from 1; 0: the machine as it is."""

    program: DriveProgram
    factor: float
    draw: int = 0


def tune_drive(
    scenario: Scenario, axis: str, limits: Limits, poses: Mapping[str, Modes] | None = None, *,
    fmus: Path | None, progress: Progress, evaluations: int = EVALUATIONS, cloud: Cloud | None = None, count: int = 0,
) -> TunedDrive:  # fmt: skip
    """Find a better drive of an axis and judge it. poses: further ones, name -> modes. cloud: draws of the machine that
    it is good for; it is found on a few, and judged on `count` other ones.

    Raises InputError, and as :func:`feedsim.simulation.cosim.run`.
    """
    search = _Search.begin(scenario, axis, limits, poses or {}, fmus, progress, evaluations, cloud)
    tuned = search.tuned()
    return tuned if cloud is None else replace(tuned, drawn=search.drawn(tuned, cloud, count))


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
    judges: Mapping[str, Judge]
    structures: Mapping[str, Modes]
    draws: tuple[Machine, ...]
    drawn_judges: Mapping[str, Judge]
    scaled_tables: Mapping[float, FileContent]
    parts: tuple[Part, ...]
    before: tuple[Errors, ...]
    margins_before: Margins
    points: list[Point]
    tried: list[tuple[Rank, Array]]
    seen: list[Margins]
    closed: int = 0
    runs: int = 0

    @classmethod
    def begin(
        cls, scenario: Scenario, axis: str, limits: Limits, poses: Mapping[str, Modes], fmus: Path | None,
        progress: Progress, evaluations: int, cloud: Cloud | None = None,
    ) -> _Search:  # fmt: skip
        """Plan, judge and run the drive as it is."""
        machine = scenario.machine
        own, _ = plant_modes(_without_transmissions(machine))  # tables hold structures; contacts come behind
        partner = partner_of(scenario, axis)
        scaled_tables = {1.0: machine.modes} | {
            factor: table_of_modes(scale_frequencies(own, factor), machine.modes.file)
            for factor in FREQUENCY_FACTORS[1:]
        }
        structures = {"pose of the machine file": own, **poses}
        factors = FREQUENCY_FACTORS if not own.rigid.all() else FREQUENCY_FACTORS[:1]
        judges = judges_of(machine, axis, structures, factors)
        draws = tuple(cloud.draws(SEARCH_DRAWS, SEARCH_SEED)) if cloud is not None else ()
        drawn_judges: dict[str, Judge] = {}
        for k, draw in enumerate(draws, start=1):
            drawn_judges |= judges_of(machine, axis, structures, factors, draw, f"draw {k} of {len(draws)}")
        elastic = not with_transmissions(machine, own).rigid.all()
        knobs = Knobs(machine.shipped_drive(axis, "tuning"), machine.cycles, own.J_tot(axis), elastic)
        search = cls(
            scenario, axis, partner, limits, fmus, progress, evaluations, knobs, judges, structures, draws,
            drawn_judges, scaled_tables, (), (), margins_of(judges, knobs.drive), [], [], [],
        )  # fmt: skip
        search.parts = search.of(SEARCHED_MOVES)
        search.before = search.errors(search.parts, machine)
        return search

    def of(self, wanted: tuple[Sequence[tuple[float, float]], ...]) -> tuple[Part, ...]:
        """Moves with every factor on the modes, which shake most behind a stop, and circles with the modes as they
        are; both on draws of the machine, too."""
        stops, circles = wanted
        moves = _program(self.scenario, self.axis, self.partner, (stops, ()))
        turns = _program(self.scenario, self.axis, self.partner, ((), circles))
        drawn = [
            Part(drive_program, 1.0, k + 1)
            for k in range(min(RUN_DRAWS, len(self.draws)))
            for drive_program in (turns, moves)
        ]
        return (Part(turns, 1.0), *(Part(moves, factor) for factor in self.factors), *drawn)

    @property
    def factors(self) -> tuple[float, ...]:
        """On the frequencies of elastic modes; 1 where there are none."""
        return FREQUENCY_FACTORS if len(self.judges) > len(self.structures) else FREQUENCY_FACTORS[:1]

    def errors(self, parts: Sequence[Part], machine: Machine) -> tuple[Errors, ...]:
        """What a machine makes of every part."""
        result = []
        for part in parts:
            if not part.draw:
                result.append(part.program.errors(self.with_modes(machine, part.factor), fmus=self.fmus))
                continue
            with draw_named(part.draw - 1, len(self.draws), "which the values are found on"):
                result.append(self.errors_on(self.draws[part.draw - 1], part.program, machine))
        return tuple(result)

    def errors_on(self, draw: Machine, program: DriveProgram, machine: Machine) -> Errors:
        """What a draw makes of a program with the drives of `machine`; the torque as the machine itself has it."""
        before = self.scenario.machine
        result = program.errors(typed_on(draw, before, machine), fmus=self.fmus)
        return replace(result, torque=result.torque / torque_scale(before, draw, self.axis))

    # --- a candidate ------------------------------------------------------------------------------------------------

    def machine_with(self, drive: Drive) -> Machine:
        """The scenario's machine with a drive, and the axes of a path matched."""
        before = self.scenario.machine
        own = before.axes[self.axis].model_copy(update={"drive": drive})
        changed = before.model_copy(update={"axes": {**before.axes, self.axis: own}})
        return match_lag(changed, self.axis, before)

    def rank(self, x: Array) -> Rank:
        """Violation of the limits, and mean ratio of errors, of a candidate at places x."""
        drive = self.knobs.drive_at(x)
        result = self._rank(drive, self.margins(drive))
        self.tried.append((result, x))
        return result

    def margins(self, drive: Drive) -> Margins:
        """Of a candidate, which is counted; over draws, too, where the machine itself allows it to run."""
        result = margins_of(self.judges, drive)
        if self.drawn_judges and not self.too_little(result):
            result = worse_of(result, margins_of(self.drawn_judges, drive))
        self.closed += 1
        self.seen.append(result)
        return result

    def _rank(self, drive: Drive, margins: Margins) -> Rank:
        violation = self.violation(margins)
        if violation > 0 and self.too_little(margins):
            return violation, math.inf
        errors = self.errors(self.parts, self.machine_with(drive))
        self.runs += 1
        ratios, ratio = _ratios(self.before, errors)
        torque, before = (max(errors.torque for errors in some) for some in (errors, self.before))
        most = max(TORQUE * drive.M_max, before)
        violation += max(0.0, torque / most - 1) + float(np.maximum(ratios / WORSE_ERROR_RATIO - 1, 0).sum())
        self.points.append(Point(margins, ratio, float(errors[0].peak.max()), violation == 0))
        return violation, ratio

    def too_little(self, margins: Margins) -> bool:
        """Whether a candidate with these margins does not run, not even for the picture."""
        limits = self.limits
        return margins.gain < MARGIN_SHARE * limits.gain_margin or margins.phase < MARGIN_SHARE * limits.phase_margin

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

    def tuned(self) -> TunedDrive:
        """Search, choose, judge."""
        drive, kept = self.chosen(self.searched())
        machine = self.machine_with(drive) if not kept else self.scenario.machine
        after = check_margins(self.judges, machine, self.axis) if not kept else self.margins_before
        return TunedDrive(
            self.scenario, self.axis, self.partner, self.limits, machine, self.margins_before, after,
            self._searched_case(machine),
            tuple(self.judged(machine)), tuple(self.points), (self.closed, self.runs), kept, tuple(self.structures),
            len(self.factors) > 1,
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
            minimise_rank(counted, start(), step=step, evaluations=self.evaluations, seed=seed)
        self.progress("candidates", total, total)
        allowed = sorted((entry for entry in self.tried if entry[0][0] == 0), key=lambda entry: entry[0])
        return [x for _, x in allowed[:FINALISTS]]

    def as_present(self) -> Array:
        """Places of the drive as it is."""
        return self.knobs.present

    def best_yet(self) -> Array:
        """Places of the best candidate that was tried."""
        return min(self.tried, key=lambda entry: entry[0])[1]

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
        total, done = len(RETURN_SHARES) * len(finalists), 0
        for share in RETURN_SHARES:
            best: tuple[float, Drive] | None = None
            for x in finalists:
                self.progress("choosing", done, total)
                done += 1
                drive = self.knobs.drive_at(self.knobs.present + share * (x - self.knobs.present))
                if self.violation(self.margins(drive)) > 0:
                    continue
                ratios, ratio = _ratios(before, self.errors(parts, self.machine_with(drive)))
                self.runs += 1
                if ratios.max() <= WORSE_ERROR_RATIO and ratio < MAX_ERROR_RATIO and (best is None or ratio < best[0]):
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
        within = [margins for margins in self.seen if limits.missing(margins) == 0]
        if not within:
            nearest = min(self.seen, key=limits.missing)
            has = (
                f"the nearest has {decibels(nearest.gain)} and {nearest.phase:.3g} deg"
                if math.isfinite(limits.missing(nearest))
                else "none is stable"
            )
            return (
                f"none of {self.closed} candidates has {asked}; {has}; ask for less or raise "
                f"{spell_argument('evaluations')}"
            )
        if all(self.violation(margins) > 0 for margins in within):
            noise = min(margins.noise for margins in within) * limits.encoder_noise
            return (
                f"the {len(within)} candidates with {asked} turn the encoder's noise into {noise:.3g} N.m of torque or "
                f"more, {self.most_noise:.3g} N.m are allowed; ask for less or correct "
                f"{spell_argument('encoder_noise')}"
            )
        return "no candidate within the margins is better on every move"

    def judged(self, machine: Machine) -> Iterator[Case]:
        """Moves and circles that nothing was chosen by: as the machine is, modes changed, friction changed."""
        program = _program(self.scenario, self.axis, self.partner, HELD_OUT_MOVES)
        cases: dict[str, Callable[[Machine], Machine]] = {"as the machine file has it": lambda own: own}
        if len(self.factors) > 1:
            cases |= {percent("modes", f): partial(self.with_modes, factor=f) for f in FREQUENCY_FACTORS[1:]}
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

    def drawn(self, tuned: TunedDrive, cloud: Cloud, count: int) -> DrawnMachines:
        """Margins and motions on draws that nothing was chosen by; a drive that stays as it is has margins alone."""
        program, before = tuned.judged[0].program, self.scenario.machine
        margins, cases = [], []
        for k, draw in enumerate(cloud.draws(count, JUDGE_SEED)):
            self.progress("draws", k, count)
            name = f"draw {k + 1} of {count}"
            with draw_named(k, count):
                judges = judges_of(before, self.axis, self.structures, self.factors, draw, name)
                margins.append(margins_of(judges, tuned.machine.shipped_drive(self.axis, "tuning")))
                if not tuned.kept:
                    without, with_it = (self.errors_on(draw, program, entry) for entry in (before, tuned.machine))
                    cases.append(Case(name, program, without, with_it))
        self.progress("draws", count, count)
        return DrawnMachines(cloud, tuple(margins), tuple(cases))

    def _searched_case(self, machine: Machine) -> Case:
        circles = self.parts[0].program
        return Case("searched on", circles, self.before[0], circles.errors(machine, fmus=self.fmus))

    def with_modes(self, machine: Machine, factor: float) -> Machine:
        """A machine whose elastic modes have other frequencies."""
        if factor == 1:
            return machine
        return machine.model_copy(update={"modes": self.scaled_tables[factor], "plant": None, "structure": None})


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


def _without_transmissions(machine: Machine) -> Machine:
    axes = {name: axis.model_copy(update={"transmission": None}) for name, axis in machine.axes.items()}
    return machine.model_copy(update={"axes": axes})


def _effect_on(machine: Machine, effect: Effect, axis: str) -> Machine:
    return effect.on(machine, [axis]) or machine
