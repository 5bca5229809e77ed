"""A scenario's machine as one page that computes, with knobs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from feedsim import cosim, nc
from feedsim.analysis import check
from feedsim.arguments import Changes, listed, settings
from feedsim.jobs.made import Kind, Made
from feedsim.jobs.parameters import File
from feedsim.jobs.watch import NO_WATCH, Watch
from feedsim.judge import judged
from feedsim.outputs import begins_with
from feedsim.page.content import content
from feedsim.page.html import MARK, page
from feedsim.report.provenance import input_paths
from feedsim.scenario.load import load

KIND = Kind("page", "page", begins_with(MARK))


def write_page(
    scenario: File,
    out: File | None = None,
    *,
    knobs: str | Sequence[str] = (),
    fmus: File | None = None,
    set: Changes = None,
    force: bool = False,
    watch: Watch = NO_WATCH,
) -> Made:
    """Write one HTML file that holds the scenario's machine, compiled as WebAssembly, and knobs.

    Args:
        scenario: scenario file.
        out: page to write; None: :meth:`Made.save` does it.
        knobs: what can be turned: keys of the scenario or their ends, with * and ?; none: the usual ones.
        fmus: folder of archives and module.
        set: changes of the file, as behind ``--set``.
        force: `out` may be a file that feedsim did not write.
        watch: who hears how far the job is.

    Raises:
        InputError: a faulty file, a machine that a page cannot hold, no such knob.
        SimulationError: a unit failed.
        OutputError: `out` cannot be written.

    >>> import feedsim as fs
    >>> fs.export("z_positioning.yaml", kind="html").name
    'z_positioning.html'
    """
    KIND.check_folder(out)
    file, archives = Path(scenario), None if fmus is None else Path(fmus)
    wanted = listed(knobs)
    asked = load(file, settings(set))
    read = [file, *input_paths(asked)]
    with KIND.checked(out, read, force=force) as path:
        program = nc.plan(asked)
        content(asked, program, wanted, archives)  # what cannot be shown should not be run
        check(asked, program)
        run = judged(cosim.run(asked, program=program, fmus=archives, progress=watch.of("simulation")))
        page_of_run = page(run, wanted, archives)
        line = f"{len(page_of_run) / 1000:.0f} kB; axes {', '.join(asked.machine.axes)}; open it in a browser"
        made = Made(KIND, f"{file.stem}.html", page_of_run, [line], run.warnings, inputs=read)
        if path is not None:
            made.save(path, force=force)
    return made
