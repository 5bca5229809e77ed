"""Friction parameters of an axis from recorded traces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import date
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Annotated

from feedsim.analysis import Figure, FigureTable
from feedsim.estimation.identify import STAGES, AxisRequest, IdentifiedFriction, excerpt, named_apart, read_traces
from feedsim.estimation.identify.friction_file import FRICTION_FILE, read_fleet
from feedsim.estimation.identify.parameters import PARAMETER_KINDS
from feedsim.estimation.identify.stages import identify as identified_from
from feedsim.estimation.parameter import Prior
from feedsim.files.columns import load_columns
from feedsim.foundation.arguments import Pairs, Value, amount, by_name, pairs, quantity, spell_argument, split_names
from feedsim.foundation.errors import InputError
from feedsim.jobs.parameters import (
    NO_WATCH,
    Archives,
    Argument,
    FigureKinds,
    File,
    Force,
    Option,
    Watch,
    job,
    output_option,
)
from feedsim.jobs.result import Kind, Result, claim_result_folder
from feedsim.report import identify as page
from feedsim.scenario import Friction, load_subject
from feedsim.scenario.roles import FRICTION_ROLE, FRICTION_UNITS
from feedsim.simulation import cosim
from feedsim.simulation.cosim.friction_law import FrictionLaw

ESTIMATE = "estimate"  # of inertia and delay: whatever mapping and machine say
AXIS = "{axis}"  # in the name of a folder: the axis, in small letters


KIND = Kind("identify", page.FILES, keeps=(FRICTION_FILE,))


def result_of(
    identified: IdentifiedFriction, inputs: Sequence[Path] = (), place: Path | None = None
) -> Result[IdentifiedFriction]:
    """Friction of an axis, identified. inputs: files that it rests on. place: the folder that it is written to."""
    found = identified.found
    warnings = identified.warnings
    in_table = page.terminal_warnings(warnings, found.estimates.values())
    return Result(
        KIND,
        identified,
        lambda: page.report_of(identified, page.draw(identified)),
        figures=FigureTable(
            (f"{found.axis}.{name}", Figure(one.value, one.unit, one.meaning)) for name, one in found.estimates.items()
        ).with_intervals({f"{found.axis}.{name}": one.interval for name, one in found.estimates.items()}),
        details=partial(page.details, identified),
        files=partial(page.files_of, identified),
        inputs=inputs,
        lines=lambda: page.terminal_lines(identified, place),
        in_lines=[finding for finding in warnings if finding not in in_table],
        place=place,
    )


@job("friction of an axis from recorded traces")
def identify_friction(
    traces: Annotated[File | Sequence[File], Argument("TRACE", "CSV or MAT file (docs/traces.md)", many=True)],
    axes: Annotated[str | None, Option("NAME", "axis that is identified (default: the only one)")] = None,
    machine: Annotated[
        File | None,
        Option(
            "MACHINE-or-SCENARIO",
            "gives pitch, torque constant and inertia of the axis, and values for what the traces do not determine",
        ),
    ] = None,
    *,
    columns: Annotated[
        File | None, Option("MAPPING.yaml", "which columns of the traces are what (docs/traces.md)")
    ] = None,
    inertia: Annotated[
        Value | None,
        Option(
            "VALUE",
            "all that the motor accelerates, e.g. '0.0164 kg.m^2', or 'estimate' (default: of the "
            "mapping, else of the machine's modes, else estimated)",
            group="what is known",
        ),
    ] = None,
    mass: Annotated[
        Value | None, Option("VALUE", "the same at the slide, e.g. '1600 kg'", group="what is known")
    ] = None,
    delay: Annotated[
        Value | None,
        Option(
            "VALUE",
            "by how much the torque is logged later than the motion, e.g. '0.5 ms' or 0, or "
            "'estimate' (default: of the mapping, else estimated)",
            group="what is known",
        ),
    ] = None,
    prior: Annotated[
        File | None,
        Option(
            "FLEET.yaml",
            "what machines of the same kind have (feedsim history --machines): it counts as far as the traces leave a "
            "parameter open",
            group="what is known",
        ),
    ] = None,
    hold: Annotated[
        Pairs[Value],
        Option("NAME=VALUE,...", "parameters that keep a value, e.g. beta=1", many=True, group="what is known"),
    ] = None,
    free: Annotated[
        str | Sequence[str],
        Option("NAME,...", "parameters that are else held: beta, v_log", many=True, group="what is known"),
    ] = (),
    stages: Annotated[
        str | int | Sequence[int],
        Option(
            "", "1: Stribeck curve, 2: pre-sliding (default: both)", choices=("1", "2", "both"), group="what is known"
        ),
    ] = "both",
    law: Annotated[
        str,
        Option(
            "",
            "law of the pre-sliding: LuGre, or generalised Maxwell slip (default: lugre)",
            choices=("lugre", "gms"),
            group="what is known",
        ),
    ] = Friction.law,
    fmus: Archives = None,
    out: Annotated[File | None, output_option("identify_{axis}")] = None,
    figures: FigureKinds = (),
    force: Force = False,
    watch: Watch = NO_WATCH,
) -> Result[IdentifiedFriction]:
    r"""Identify the friction of an axis: the Stribeck curve from constant speeds, pre-sliding from reversals.

    Leaves friction.yaml, which scenarios and machine files take as it is, a report with figures, and what the figures
    show as CSV; every value has a confidence interval.

    Command line:
        feedsim example identify_z_constant identify_z_sine xz_circle
        feedsim run identify_z_constant.yaml && feedsim run identify_z_sine.yaml
        feedsim identify friction results/identify_z_constant/log.csv results/identify_z_sine/log.csv --axes Z \
            --machine machines/test_centre
        feedsim identify friction record.mat --columns record.yaml --delay 0
        feedsim identify friction z.csv --axes Z --machine my_machine --hold "beta=1" --free v_log
        feedsim run xz_circle.yaml --set machine.axes.Z.friction=results/identify_z/friction.yaml --out results/own

    Raises:
        InputError: a faulty file, traces of several axes, wrong arguments, traces that determine nothing.
        OutputError: `out` cannot be written.

    >>> import feedsim as fs
    >>> result = fs.identify_friction("log.csv", axes="Z", machine="machines/test_centre", stages=1)
    >>> 1.0 < result.estimates["F_C"].value < 3.0
    True
    """
    files = [Path(file) for file in ([traces] if isinstance(traces, str | Path) else traces)]
    if law not in (laws := (Friction.law, *FRICTION_UNITS)):
        raise InputError(f"{spell_argument('law')} {law}: {' or '.join(laws)} is needed")
    kept_values = pairs("hold", hold, "NAME=VALUE is needed, for example beta=1 or v_log='3 rad/s'")
    fleets = read_fleet(prior) if prior is not None else {}
    asked = _axis_options(axes, inertia, mass, delay, kept_values, split_names(free), stages, law, fleets)
    settings = _settings(inertia, mass, delay, kept_values, split_names(free), stages)
    if law != Friction.law:
        settings["law"] = law
    if prior is not None:
        settings["prior"] = Path(prior).name
    unit = FRICTION_UNITS.get(law, FRICTION_ROLE.shipped)
    subject = load_subject(machine) if machine is not None else None
    described = subject.machine if subject is not None else None
    mapping = load_columns(columns) if columns is not None else None
    archives = None if fmus is None else Path(fmus)
    begin = perf_counter()
    recorded = read_traces(files, mapping, axes, described, watch.progress)
    reading = {"reading": perf_counter() - begin}
    sources = tuple(entry.provenance for entry in recorded)
    known = asked.with_traces(sources, described)
    records, excerpt_notes = excerpt(named_apart(recorded))
    inputs = [*files, *(Path(file) for file in (columns, prior) if file is not None)]
    inputs += [file for _, file in subject.files] if subject is not None else []
    folder = None if out is None else Path(str(out).replace(AXIS, known.axis.lower()))
    asked_for = [f"{name}={value}" for name, value in settings.items()]
    with claim_result_folder(folder, KIND, watch, inputs, asked_for, force=force):
        for sentence in (
            cosim.describe_archive_programs(archives / f"{unit}.fmu", "friction law") if archives is not None else ()
        ):
            watch.announce(sentence)
        with FrictionLaw(archives, unit) as friction:
            identification = identified_from(records, friction, known, watch.progress)
        identification = replace(
            identification,
            seconds=reading | dict(identification.seconds),
            warnings=(*excerpt_notes, *identification.warnings),
        )
        identified = IdentifiedFriction(identification, records, sources, subject, settings, date.today().isoformat())
        result = result_of(identified, inputs, folder)
        if folder is not None:
            result.save(folder, figures=figures, force=force)
    return result


def _axis_options(
    axis: str | None,
    inertia: Value | None,
    mass: Value | None,
    delay: Value | None,
    hold: Mapping[str, Value],
    free: tuple[str, ...],
    stages: str | int | Sequence[int],
    law: str,
    fleets: Mapping[str, Prior],
) -> AxisRequest:
    """What the arguments say of the axis, as values. Raises InputError."""
    if inertia is not None and mass is not None:
        raise InputError(f"{spell_argument('inertia')} and {spell_argument('mass')}: one of them, not both")
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
    return AxisRequest(
        axis=axis,
        inertia=given,
        mass=None if mass is None else quantity("mass", mass, "kg"),
        mass_reason=f"{spell_argument('mass')} {mass}",
        delay=later,
        estimated=estimated,
        hold=by_name("hold", hold, value_of),
        free=free,
        stages=_stages(stages),
        law=law,
        fleets=fleets,
    )


def _stages(stages: str | int | Sequence[int]) -> tuple[int, ...]:
    if stages == "both":
        return STAGES
    chosen = tuple(int(stage) for stage in ([stages] if isinstance(stages, str | int) else stages))
    if not chosen or any(stage not in STAGES for stage in chosen):
        raise InputError(f"{spell_argument('stages')} {stages}: 1, 2 or 'both' is needed")
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
