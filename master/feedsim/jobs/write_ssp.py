"""A scenario as one SSP file, for other people's simulators."""

from __future__ import annotations

from pathlib import Path

from feedsim import ssp
from feedsim.arguments import Changes, settings, spelt
from feedsim.errors import InputError
from feedsim.files.source import is_ssp
from feedsim.jobs.made import Kind, Made
from feedsim.jobs.parameters import File
from feedsim.jobs.watch import NO_WATCH, Watch
from feedsim.outputs import archive_with
from feedsim.owned import TemporaryFolder
from feedsim.report.provenance import input_paths
from feedsim.scenario.load import load
from feedsim.ssp import Exported
from feedsim.ssp.archive import STRUCTURE

KIND = Kind("ssp", "SSP file", archive_with(STRUCTURE, b'generationTool="feedsim'))


def write_ssp(
    scenario: File,
    out: File | None = None,
    *,
    one: bool = False,
    fmus: File | None = None,
    set: Changes = None,
    force: bool = False,
    watch: Watch = NO_WATCH,
) -> Made:
    """Write a scenario as one SSP file (System Structure and Parameterization 1.0): units, parameters, wiring, motion.

    Args:
        scenario: scenario file.
        out: the SSP file to write, which ends in .ssp; None: :meth:`Made.save` does it.
        one: one component, the machine as one unit with its motion inside, for any step size.
        fmus: folder of the archives.
        set: changes of the file, as behind ``--set``.
        force: `out` may be a file that feedsim did not write.
        watch: who hears how far the job is.

    Raises:
        InputError: a faulty file, a motion that violates a limit, loads over time, a name that does not end in .ssp.
        OutputError: `out` cannot be written.

    >>> import feedsim as fs
    >>> made = fs.export("z_positioning.yaml", kind="ssp")
    >>> made.content[:2]
    b'PK'
    """
    if out is not None and not is_ssp(Path(out)):
        raise InputError(f"{spelt('out')} {out}: an SSP file ends in .ssp; simulators recognise it by that")
    file = Path(scenario)
    if is_ssp(file):
        raise InputError(f"{file}: is an SSP file already; a scenario is expected")
    KIND.check_folder(out)
    plan = load(file, [*settings(set), *(["coupling.units=one"] if one else [])])
    read = [file, *input_paths(plan)]
    with KIND.checked(out, read, force=force) as path:
        with TemporaryFolder() as folder:
            done = ssp.export(plan, folder / "machine.ssp", fmus=None if fmus is None else Path(fmus))
            content = done.path.read_bytes()
        line = (
            f"{done.size / 1024:.0f} KiB, {_inside(done, plan.machine.cycles.T_c)}; "
            f"runs on {', '.join(done.platforms) or 'no platform'}"
        )
        made = Made(KIND, f"{file.stem}.ssp", content, [line], done.warnings, inputs=read)
        if path is not None:
            made.save(path, force=force)
    return made


def _inside(done: Exported, T_c: float) -> str:
    if len(done.instances) == 1:
        return f"one instance, {done.duration:.4g} s at any step; parameters in its archive"
    return (
        f"{len(done.instances)} instances, {done.duration:.4g} s at {T_c * 1e6:.6g} us; parameters in resources/*.ssv"
    )
