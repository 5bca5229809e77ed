"""Friction parameters of an axis from recorded traces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path
from time import perf_counter
from typing import Any

from feedsim import cosim
from feedsim.analysis import Figure, Named
from feedsim.arguments import Value, amount, by_name, listed, quantity, spelt
from feedsim.cosim.friction_law import FrictionLaw
from feedsim.errors import InputError
from feedsim.files.columns import load_columns
from feedsim.identify import STAGES, Asked, Estimate, Identification, Identified, named_apart, read_traces
from feedsim.identify.friction_file import FRICTION_FILE
from feedsim.identify.parameters import PARAMETER_KINDS
from feedsim.identify.stages import identify as identified_from
from feedsim.jobs.folder import File, kept
from feedsim.jobs.result import Result
from feedsim.jobs.watch import NO_WATCH, Watch
from feedsim.report import identify as page
from feedsim.report.content import Report
from feedsim.report.results import Content
from feedsim.scenario import Friction, load_subject
from feedsim.scenario.roles import FRICTION_ROLE, FRICTION_UNITS

ESTIMATE = "estimate"  # of inertia and delay: whatever mapping and machine say
AXIS = "{axis}"  # in the name of a folder: the axis, in small letters


@dataclass(frozen=True, eq=False, repr=False)
class IdentifyResult(Result):
    """Friction of an axis, identified.

    identified: what was found, and what it rests on. inputs_read: the files.
    """

    identified: Identified
    inputs_read: Sequence[Path] = ()

    kind = "identify"
    may_write = page.FILES

    @property
    def found(self) -> Identification:
        """Both stages, their estimates and correlations."""
        return self.identified.found

    @property
    def estimates(self) -> Mapping[str, Estimate]:
        """Every friction parameter, M_0, J and delay, by name: value, interval, status."""
        return self.found.estimates

    @property
    def inputs(self) -> Sequence[Path]:
        """Traces, mapping and files of the machine."""
        return self.inputs_read

    @property
    def figures(self) -> Mapping[str, Figure]:
        """The estimates as figures, "Z.F_C"."""
        return Named(
            (f"{self.found.axis}.{name}", Figure(estimate.value, estimate.unit, estimate.meaning))
            for name, estimate in self.estimates.items()
        )

    @property
    def findings(self) -> Sequence[str]:
        """What is to be known before the values are believed."""
        return self.identified.warnings

    @property
    def answers(self) -> Sequence[str]:
        """How well curve and pre-sliding are known."""
        return [f"axis {self.found.axis}: {page.headline(self.identified)}"]

    @property
    def lines(self) -> Sequence[str]:
        """The table of all values with their intervals."""
        return page.terminal_lines(self.identified)

    def report(self) -> Report:
        """Content of report.html."""
        return page.report_of(self.identified, page.draw(self.identified))

    def files(self) -> Mapping[str, Content]:
        """friction.yaml, and what the figures show as CSV."""
        return page.files_of(self.identified)

    @property
    def keeps(self) -> Sequence[str]:
        """friction.yaml."""
        return (FRICTION_FILE,)

    def summary(self, names: Sequence[str]) -> Mapping[str, Any]:
        """Content of summary.json."""
        return page.summary(self.identified, names)

    def __repr__(self) -> str:
        return repr(self.found)


def identify(
    traces: File | Sequence[File],
    axis: str | None = None,
    machine: File | None = None,
    *,
    columns: File | None = None,
    inertia: Value | None = None,
    mass: Value | None = None,
    delay: Value | None = None,
    hold: Mapping[str, Value] | None = None,
    free: str | Sequence[str] = (),
    stages: str | int | Sequence[int] = "both",
    law: str = Friction.law,
    fmus: File | None = None,
    out: File | None = None,
    figures: Sequence[str] = (),
    force: bool = False,
    watch: Watch = NO_WATCH,
) -> IdentifyResult:
    """Identify the friction of an axis: the Stribeck curve from constant speeds, pre-sliding from reversals.

    Args:
        traces: CSV or MAT files.
        axis: that is identified; None: the only one.
        machine: machine or scenario that gives pitch, torque constant and inertia of the axis, and values for what the
            traces do not determine.
        columns: mapping file, which columns of the traces are what.
        inertia: all that the motor accelerates [kg.m2]; "estimate": from the traces, whatever mapping and machine say.
            Values may be texts, "0.0164 kg.m^2". mass: the same at the slide [kg].
        delay: by how much the torque is logged later than the motion [s], or "estimate".
        hold: name -> value that a parameter keeps, SI or a text. free: names of parameters that are else held.
        stages: 1 (Stribeck curve), 2 (pre-sliding) or "both".
        law: of the pre-sliding, "lugre" or "gms" (generalised Maxwell slip).
        fmus: folder of the archives.
        out: folder that the result is written to, "{axis}" in it is the axis in small letters; None:
            :meth:`Result.save` does it.
        figures, force: as of :meth:`Result.save`.
        watch: who hears how far the job is.

    Raises:
        InputError: a faulty file, traces of several axes, wrong arguments, traces that determine nothing.
        OutputError: `out` cannot be written.

    >>> import feedsim as fs
    >>> result = fs.identify("log.csv", axis="Z", machine="machines/test_centre", stages=1)
    >>> 1.0 < result.estimates["F_C"].value < 3.0
    True
    """
    files = [Path(file) for file in ([traces] if isinstance(traces, str | Path) else traces)]
    if law not in (laws := (Friction.law, *FRICTION_UNITS)):
        raise InputError(f"{spelt('law')} {law}: {' or '.join(laws)} is needed")
    asked = _asked(axis, inertia, mass, delay, hold or {}, listed(free), stages, law)
    settings = _settings(inertia, mass, delay, hold or {}, listed(free), stages)
    if law != Friction.law:
        settings["law"] = law
    unit = FRICTION_UNITS.get(law, FRICTION_ROLE.shipped)
    subject = load_subject(machine) if machine is not None else None
    described = subject.machine if subject is not None else None
    mapping = load_columns(columns) if columns is not None else None
    archives = None if fmus is None else Path(fmus)
    begin = perf_counter()
    recorded = read_traces(files, mapping, axis, described, watch.progress)
    reading = {"reading": perf_counter() - begin}
    sources = tuple(entry.provenance for entry in recorded)
    known = asked.with_traces(sources, described)
    records = named_apart(recorded)
    inputs = [*files, *([Path(columns)] if columns is not None else [])]
    inputs += [file for _, file in subject.files] if subject is not None else []
    folder = None if out is None else Path(str(out).replace(AXIS, known.axis.lower()))
    asked_for = [f"{name}={value}" for name, value in settings.items()]
    with kept(folder, IdentifyResult.check_place, watch, inputs, asked_for, force=force):
        for sentence in cosim.executing(archives / f"{unit}.fmu", "friction law") if archives is not None else ():
            watch.announce(sentence)
        with FrictionLaw(archives, unit) as friction:
            identification = identified_from(records, friction, known, watch.progress)
        identification = replace(identification, seconds=reading | dict(identification.seconds))
        identified = Identified(identification, records, sources, subject, settings, date.today().isoformat())
        result = IdentifyResult(identified, inputs)
        if folder is not None:
            result.save(folder, figures=figures, force=force)
    return result


def _asked(
    axis: str | None,
    inertia: Value | None,
    mass: Value | None,
    delay: Value | None,
    hold: Mapping[str, Value],
    free: tuple[str, ...],
    stages: str | int | Sequence[int],
    law: str,
) -> Asked:
    """What the arguments say of the axis, as values. Raises InputError."""
    if inertia is not None and mass is not None:
        raise InputError(f"{spelt('inertia')} and {spelt('mass')}: one of them, not both")
    given = None
    if inertia not in (None, ESTIMATE):
        given = quantity("inertia", inertia, "kg.m^2")
    later = None
    if delay not in (None, ESTIMATE):
        # A plain 0 needs no unit.
        zero = isinstance(delay, str) and delay.strip() in ("0", "0.0")
        later = 0.0 if zero else quantity("delay", delay, "s")
    names = [name for name in PARAMETER_KINDS if name not in ("J", "delay")]

    def value_of(name: str, value: Value) -> float:
        if name not in names:
            raise InputError(f"no parameter {name!r}; there are {', '.join(names)}")
        return amount(value, PARAMETER_KINDS[name].unit)

    estimated = tuple(name for name, value in (("inertia", inertia), ("delay", delay)) if value == ESTIMATE)
    return Asked(
        axis=axis,
        inertia=given,
        mass=None if mass is None else quantity("mass", mass, "kg"),
        mass_reason=f"{spelt('mass')} {mass}",
        delay=later,
        estimated=estimated,
        hold=by_name("hold", hold, value_of),
        free=free,
        stages=_stages(stages),
        law=law,
    )


def _stages(stages: str | int | Sequence[int]) -> tuple[int, ...]:
    if stages == "both":
        return STAGES
    chosen = tuple(int(stage) for stage in ([stages] if isinstance(stages, str | int) else stages))
    if not chosen or any(stage not in STAGES for stage in chosen):
        raise InputError(f"{spelt('stages')} {stages}: 1, 2 or 'both' is needed")
    return chosen


def _settings(
    inertia: Value | None,
    mass: Value | None,
    delay: Value | None,
    hold: Mapping[str, Value],
    free: tuple[str, ...],
    stages: str | int | Sequence[int],
) -> dict[str, str]:
    """What was asked for, by argument, without paths."""
    chosen = _stages(stages)
    given = {
        "inertia": "" if inertia is None else str(inertia),
        "mass": "" if mass is None else str(mass),
        "delay": "" if delay is None else str(delay),
        "hold": ",".join(f"{name}={value}" for name, value in hold.items()),
        "free": ",".join(free),
        "stages": "" if chosen == STAGES else ",".join(map(str, chosen)),
    }
    return {name: value for name, value in given.items() if value}
