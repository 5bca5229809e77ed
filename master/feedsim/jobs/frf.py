"""Frequency responses of feed drives and structure, in closed form and measured on the units."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

from feedsim.analysis import FigureTable, linear, responses, truncation
from feedsim.analysis.campaign import Plan, run_campaign
from feedsim.analysis.responses import Overlay, Responses, highest_frequency, read_overlays
from feedsim.analysis.truncation import Truncation
from feedsim.files.trace import Array
from feedsim.files.trace.response import Complexes, FrequencyResponse
from feedsim.foundation.arguments import (
    Band,
    Value,
    parse_frequency_band,
    quantity,
    settings,
    spell_argument,
    split_names,
)
from feedsim.foundation.errors import FeedsimError, Finding, InputError
from feedsim.jobs.parameters import (
    NO_WATCH,
    Archives,
    FigureKinds,
    File,
    Force,
    Option,
    Settings,
    SubjectArgument,
    Watch,
    job,
    output_option,
)
from feedsim.jobs.result import Kind, Result, announce_programs, claim_result_folder
from feedsim.linear.judgement import judge
from feedsim.report import frf as page
from feedsim.scenario import Coupling, Machine, Subject, load_subject
from feedsim.scenario.structure_checks import load_structure
from feedsim.simulation.cosim.plant import plant_modes
from feedsim.simulation.judge import warn_control_loops as control_findings
from feedsim.structure.pose_change import table_mismatch

REALISATIONS_WITH_FRICTION = 4
DEFAULT_LOWEST, DEFAULT_HIGHEST = 1.0, 1000.0  # [Hz]; the band where none is given
ONE_REALISATION = Finding(
    "realisations-too-few", "doubt",
    "measured with friction and one realisation: every period is alike, so that the coherence says nothing of what is "
    "not linear; take more realisations",
    "", "take more realisations",
)  # fmt: skip


KIND = Kind("frf", page.FILES)


@dataclass(frozen=True, eq=False)
class MachineResponses(Mapping[str, Complexes]):
    """Frequency responses: a mapping of the closed form, name -> (F,) complex values over ``frequency``.

    Names say what of what, such as "Z.n_a/Z.M_a". subject: what they are of; responses: all that was found.
    """

    subject: Subject
    responses: Responses

    @property
    def response(self) -> FrequencyResponse:
        """The closed form, up to twice the band: gain margins lie above it."""
        return self.responses.closed

    @property
    def measured(self) -> FrequencyResponse | None:
        """What was measured on the units; None where nothing was."""
        return self.responses.campaign.response if self.responses.campaign is not None else None

    @property
    def frequency(self) -> Array:
        """(F,) frequencies of the closed form [Hz]."""
        return self.response.frequency

    def to_control(self, name: str) -> Any:
        """A response of the closed form as `control.FRD` of python-control, over [rad/s]. Needs that package."""
        return self.response.to_control(name)

    def unit(self, name: str) -> str:
        """Unit of a response."""
        return self.response.unit(name)

    def __getitem__(self, name: str) -> Complexes:
        return self.response[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.response)

    def __len__(self) -> int:
        return len(self.response.names)


def result_of(value: MachineResponses) -> Result[MachineResponses]:
    """Frequency responses of a machine: stable or not, bandwidths and margins."""
    subject, responses = value.subject, value.responses
    first, *others = page.answers(responses)
    return Result(
        KIND,
        value,
        lambda: page.report_of(subject, responses, page.draw(responses)),
        figures=FigureTable(responses.figures),
        details=partial(page.details, subject, responses),
        files=partial(page.files_of, responses),
        inputs=[*(file for _, file in subject.files), *(overlay.file for overlay in responses.overlays)],
        lines=[f"{subject.name}: {first}", *(f"  {line}" for line in others)],
    )


@job("frequency responses of drives and structure")
def frf(
    subject: SubjectArgument,
    axes: Annotated[str | Sequence[str] | None, Option("X,Z", "axes to look at (default: all)")] = None,
    *,
    set: Settings = None,
    band: Annotated[
        Band | None,
        Option(
            "LOW..HIGH",
            "frequencies looked at (default: 1Hz..1000Hz, at most to half the sampling rate of the control cycle)",
        ),
    ] = None,
    tool: Annotated[bool, Option("", "with the compliance at the tool (default: yes)")] = True,
    overlay: Annotated[
        Sequence[str],
        Option(
            "FILE[:RESPONSE[=NAME]]",
            "lay a curve from a CSV or UFF58 file over, e.g. measured.csv:Z.n_a/Z.M_a; may be given several times",
            many=True,
        ),
    ] = (),
    mount_amplitude: Annotated[
        Value | None,
        Option(
            "LENGTH",
            "deflection of the mounts that are not linear, '10 um': the closed form has them as their describing "
            "function at this amplitude (default: as they are at rest)",
        ),
    ] = None,
    full_model: Annotated[
        bool,
        Option(
            "",
            "where the machine names its structure: compare with all modes of the finite-element model (default: yes)",
        ),
    ] = True,
    measure: Annotated[
        bool,
        Option(
            "", "on the units besides (default: yes; --no-measure: closed form only)", group="measurement on the units"
        ),
    ] = True,
    excitation: Annotated[
        Literal["multisine", "prbs"],
        Option("", "signal (default: multisine)", choices=("multisine", "prbs"), group="measurement on the units"),
    ] = "multisine",
    inject: Annotated[
        Literal["n_add", "M_add"],
        Option(
            "",
            "where it is added: to the speed setpoint (finds n/M and n_a/n_s) or to the torque "
            "setpoint (finds n/M); default: n_add",
            choices=("n_add", "M_add"),
            group="measurement on the units",
        ),
    ] = "n_add",
    amplitude: Annotated[
        Value | None,
        Option(
            "VALUE",
            "RMS of the signal, e.g. '0.5 rad/s' (default: 5 % of the torque limit)",
            group="measurement on the units",
        ),
    ] = None,
    periods: Annotated[int, Option("N", "recorded periods (default: 2)", group="measurement on the units")] = 2,
    settle: Annotated[int, Option("N", "periods ahead of those (default: 2)", group="measurement on the units")] = 2,
    realisations: Annotated[
        int | None,
        Option(
            "N",
            "signals with other phases, averaged (default: 1, with friction 4: only between "
            "realisations does the coherence see what is not linear)",
            group="measurement on the units",
        ),
    ] = None,
    seed: Annotated[int, Option("N", "of the phases (default: 1)", group="measurement on the units")] = 1,
    friction: Annotated[
        bool, Option("", "with friction; the closed form knows none", group="measurement on the units")
    ] = False,
    offset_speed: Annotated[
        Value | None,
        Option(
            "VALUE", "motor speed at which the excited axis moves, e.g. '5 rad/s'", group="measurement on the units"
        ),
    ] = None,
    fmus: Archives = None,
    out: Annotated[File | None, output_option("frf_{subject}")] = None,
    figures: FigureKinds = (),
    force: Force = False,
    watch: Watch = NO_WATCH,
) -> Result[MachineResponses]:
    """Frequency responses of feed drives and structure, in closed form and, friction off, measured on the units.

    Speed-controlled system n/M, reference frequency response of the speed controller, position loop, loop gains with
    their margins, x/M, and the compliance at the tool.

    Command line:
        feedsim example xz_circle
        feedsim frf machines/test_centre --axes X,Z --out results/frf
        feedsim frf xz_circle.yaml --set "machine.axes.Z.drive.K_p=4 N.m.s/rad" --no-measure
        feedsim frf machines/test_centre --axes Z --friction --offset-speed "5 rad/s" --realisations 4
        feedsim frf machines/test_centre --axes Z --overlay measured.csv:Z.n_a/Z.n_s

    Raises:
        InputError: a faulty file, no such axis, wrong arguments.
        SimulationError: a unit failed.
        OutputError: `out` cannot be written.

    >>> import feedsim as fs
    >>> result = fs.frf("machines/test_centre", "Z", band=(1.0, 300.0), measure=False)
    >>> abs(result["Z.n_a/Z.M_a"]).shape == result.frequency.shape
    True
    """
    texts = settings(set)
    loaded = load_subject(subject, texts)
    machine = loaded.machine
    chosen = _axes(axes, machine)
    times = REALISATIONS_WITH_FRICTION if friction else 1
    plan = Plan(
        signal=excitation,
        inject=inject,
        rms=None if amplitude is None else quantity("amplitude", amplitude, *_unit_of(inject)),
        band=_band(band, machine),
        periods=_count("periods", periods),
        settle=settle,
        realisations=_count("realisations", times if realisations is None else realisations),
        seed=seed,
        friction=friction,
        offset_speed=None if offset_speed is None else quantity("offset_speed", offset_speed, "rad/s", "5 rad/s"),
        tool=tool,
    )
    archives = None if fmus is None else Path(fmus)
    deflection = 0.0
    if mount_amplitude is not None:
        deflection = quantity("mount_amplitude", mount_amplitude, "m", "10 um", positive=True)
        if machine.mounts is None:
            raise InputError(
                f"{spell_argument('mount_amplitude')}: the machine has no mounts that are not linear (key mounts)"
            )
    modes, doubts = plant_modes(machine, deflection)
    frequency = responses.frequencies(machine, modes, plan.band, responses.BAND_RATIO)
    wanted = linear.names(chosen, tool=tool)
    overlays, warnings = _overlays(overlay, wanted)
    warnings += doubts
    if machine.mounts is not None:
        warnings.append(mount_state(machine, deflection))
    inputs = [*(file for _, file in loaded.files), *(overlay.file for overlay in overlays)]
    with claim_result_folder(out, KIND, watch, inputs, texts, force=force):
        watch.progress("closed form", 0, 1)
        system = linear.LinearSystem(machine, modes)
        linear_result = linear.evaluate(system, chosen)
        closed = responses.closed_form(system, wanted, frequency)
        warnings += responses.zero_notes(closed)
        watch.progress("closed form", 1, 1)
        if not doubts and (doubt := table_mismatch(machine)) is not None:
            warnings.append(doubt)
        judged = control_findings(machine, judge(machine, modes))
        if linear_result.unstable_poles and not any(finding.severity == "wrong" for finding in judged):
            judged.append(Finding(
                "closed-loop-unstable", "doubt",
                f"the control loops are unstable: {linear_result.unstable_poles} growing solution(s) of the closed "
                "system. The figures of loops presume stable ones, and nothing was measured",
            ))  # fmt: skip
        warnings += judged
        full = _full_model(machine, watch, warnings) if full_model else None
        campaign = None
        if measure and not linear_result.unstable_poles:
            announce_programs(watch, machine, archives)
            coupling = loaded.scenario.coupling if loaded.scenario is not None else Coupling()
            campaign = run_campaign(
                machine, chosen, plan, fmus=archives, progress=watch.progress, call_limit=coupling.call_limit
            )
        numbers = linear.figures(linear_result)
        if not tool:
            numbers = {name: figure for name, figure in numbers.items() if not name.startswith("tool.")}
        if full is not None:
            numbers |= truncation.figures(full, tuple(machine.axes), frequency, shown=chosen, tool=tool)
        if campaign is not None:
            numbers |= responses.agreement(system, campaign)
            warnings += campaign.warnings
            if plan.friction and plan.realisations == 1:
                warnings.append(ONE_REALISATION)
        done = Responses(
            machine=machine,
            modes=modes,
            axes=chosen,
            band=plan.band,
            result=linear_result,
            closed=closed,
            campaign=campaign,
            overlays=tuple(overlays),
            truncation=full,
            figures=numbers,
            warnings=tuple(warnings),
        )
        result = result_of(MachineResponses(loaded, done))
        if out is not None:
            result.save(out, figures=figures, force=force)
    return result


def _full_model(machine: Machine, watch: Watch, warnings: list[Finding]) -> Truncation | None:
    """The machine's structure with all its modes, where a structure is named; adds to the warnings why there is none.

    The comparison comes on top of what was asked for: where it cannot be had, the rest is still wanted.
    """
    if machine.structure is None:
        return None
    watch.progress("full model", 0, 1)
    result = None
    try:
        result = truncation.truncation(load_structure(machine.structure), machine.pose)
    except FeedsimError as error:
        text = f"no comparison with the full model: {error}"
        warnings.append(Finding("full-model-not-compared", "doubt", text, str(machine.structure)))
    watch.progress("full model", 1, 1)
    return result


def mount_state(machine: Machine, deflection: float) -> Finding:
    """How the closed form has mounts that are not linear."""
    assert machine.mounts is not None
    how = (
        f"at {1e6 * deflection:.4g} um of deflection (describing function)" if deflection
        else f"as they are at rest; {spell_argument('mount_amplitude')} has them at a deflection"
    )  # fmt: skip
    text = f"closed form and margins have the mounts of {machine.mounts.table.name}, which are not linear, {how}"
    return Finding("mounts-linearised", "doubt", text, machine.mounts.table.name)


def _axes(axes: str | Sequence[str] | None, machine: Machine) -> tuple[str, ...]:
    """The axes asked for, in the machine's order."""
    chosen = split_names(axes or ())
    for name in chosen:
        if name not in machine.axes:
            raise InputError(
                f"{spell_argument('axes')} {','.join(chosen)}: no axis {name!r}; there is {', '.join(machine.axes)}"
            )
    return tuple(axis for axis in machine.axes if not chosen or axis in chosen)


def _unit_of(inject: str) -> tuple[str, str]:
    """Unit of the excitation, and an example."""
    return ("rad/s", "0.5 rad/s") if inject == "n_add" else ("N.m", "4 N.m")


def _band(band: Band | None, machine: Machine) -> tuple[float, float]:
    """Lowest and highest frequency [Hz]."""
    if band is None:
        return DEFAULT_LOWEST, min(DEFAULT_HIGHEST, highest_frequency(machine))
    return parse_frequency_band("band", band, "1 Hz", "1000 Hz")


def _count(name: str, number: int) -> int:
    if number < 1:
        raise InputError(f"{spell_argument(name)} {number}: at least 1 is needed")
    return number


def _overlays(texts: Sequence[str], known: Sequence[str]) -> tuple[list[Overlay], list[Finding]]:
    overlays: list[Overlay] = []
    warnings: list[Finding] = []
    for text in texts:
        result, doubts = read_overlays(text, known)
        overlays += result
        warnings += doubts
    return overlays, warnings
