"""What a person calls: each of them takes files as people write them, and returns what a prompt can show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from feedsim import cosim
from feedsim.analysis import linear, responses
from feedsim.arguments import Changes, settings
from feedsim.cosim import Progress
from feedsim.cosim.friction_law import FrictionLaw
from feedsim.cosim.plant import plant_modes
from feedsim.errors import InputError
from feedsim.files.columns import load_columns
from feedsim.files.source import is_ssp
from feedsim.front.result import Result
from feedsim.scenario import Machine, Scenario, load_subject
from feedsim.scenario import load as load_scenario
from feedsim.scenario.study import load_study
from feedsim.sweep.study import run as run_study
from feedsim.sweep.table import Table
from feedsim.trace.response import FrequencyResponse

if TYPE_CHECKING:
    from feedsim.identify.result import Identification

File = str | Path


def load(file: File, set: Changes = None) -> Scenario:
    """A scenario file, checked, with changes such as ``{"machine.axes.Z.friction.F_C": "1.8 N.m"}``.

    >>> import feedsim as fs
    >>> fs.load("xz_circle.yaml", {"motions.0.radius": "20 mm"}).motions[0].radius
    0.02
    """
    return load_scenario(file, settings(set))


def run(scenario: File | Scenario, *, set: Changes = None, progress: Progress | None = None, **options: Any) -> Result:
    """Run a scenario: a file, an SSP file, or what :func:`load` has returned.

    set: changes, as behind ``--set`` of the command line. progress: called now and then with (cycles done, cycles in
    all). options: as of :func:`feedsim.cosim.run`.

    >>> import feedsim as fs
    >>> stiff = fs.run("z_positioning.yaml", set={"machine.axes.Z.drive.K_v": "5 (m/min)/mm"})
    >>> stiff.figures["Z.settling_time"].unit
    'ms'
    """
    if isinstance(scenario, Scenario):
        if set:
            raise InputError("set: changes are for a file; a scenario that is loaded has its own (feedsim.load)")
        return _run(scenario, progress, options)
    if is_ssp(Path(scenario)):
        from feedsim import ssp

        with ssp.opened(Path(scenario), settings(set)) as found:
            made = {"program": found.program, "fmus": found.fmus}
            result = _run(found.scenario, progress, made | options)
            return replace(result, warnings=found.told(result.warnings))
    return _run(load(scenario, set), progress, options)


def _run(scenario: Scenario, progress: Progress | None, options: Mapping[str, Any]) -> Result:
    return Result.of(cosim.run(scenario, progress=progress, **options))


def identify(
    traces: File | Sequence[File],
    axis: str | None = None,
    machine: File | Machine | None = None,
    columns: File | None = None,
    **asked: Any,
) -> Identification:
    """Friction parameters of an axis from recorded traces.

    machine: file or folder; columns: mapping file of the traces' columns; asked: as of :class:`feedsim.identify.Asked`,
    all in SI units (``delay=0.0``, ``hold={"beta": 1.0}``).

    >>> import feedsim as fs
    >>> found = fs.identify("log.csv", axis="Z", machine="machines/test_centre", stages=(1,))
    >>> 1.0 < found.estimates["F_C"].value < 3.0
    True
    """
    # Most of a second, which those who lay results over each other need not wait for.
    from feedsim.identify.options import Asked
    from feedsim.identify.read import named_apart, read_traces
    from feedsim.identify.stages import identify as identified_from

    described = machine if isinstance(machine, Machine) or machine is None else load_subject(machine).machine
    mapping = load_columns(columns) if columns is not None else None
    files = [Path(each) for each in ([traces] if isinstance(traces, str | Path) else traces)]
    recorded = read_traces(files, mapping, axis, described)
    known = Asked(axis=axis, **asked).with_traces(tuple(each.provenance for each in recorded), described)
    with FrictionLaw() as law:
        return identified_from(named_apart(recorded), law, known)


def sweep(study: File, directory: File, *, set: Changes = None, runs: int | None = None, **options: Any) -> Table:
    """Make the runs of a study file; `directory` keeps them, and what it has is not made again.

    runs: in place of the file's. options: as of :func:`feedsim.sweep.study.run`, such as ``workers=2``.

    >>> import feedsim as fs
    >>> table = fs.sweep("studies/z_stop.yaml", "study", runs=2, workers=1)
    >>> len(table), int(table.ok.sum())
    (2, 2)
    """
    return run_study(load_study(study, settings(set), runs=runs), Path(directory), **options)


def frf(
    subject: File | Machine,
    axes: Sequence[str] | None = None,
    *,
    set: Changes = None,
    band: tuple[float, float] = (1.0, 1000.0),
    tool: bool = True,
) -> FrequencyResponse:
    """Frequency responses of drives and structure in closed form, over a band [Hz]; of a machine or a scenario.

    The names say what of what, such as "Z.n_a/Z.M_a". ``feedsim frf`` measures them on the units besides.

    >>> import feedsim as fs
    >>> response = fs.frf("machines/test_centre", axes=["Z"], band=(1.0, 300.0))
    >>> any(name.startswith("Z.n_a/") for name in response)
    True
    """
    machine = subject if isinstance(subject, Machine) else load_subject(subject, settings(set)).machine
    if isinstance(subject, Machine) and set:
        raise InputError("set: changes are for a file; a machine that is loaded has its own")
    if unknown := [axis for axis in axes or () if axis not in machine.axes]:
        raise InputError(f"axes: no axis {unknown[0]!r}; there is {', '.join(machine.axes)}")
    chosen = tuple(axis for axis in machine.axes if axes is None or axis in axes)
    modes, _ = plant_modes(machine)
    system = linear.LinearSystem(machine, modes)
    return responses.closed_form(system, linear.names(chosen, tool=tool), responses.frequencies(machine, modes, band))
