"""Command line: ``feedsim COMMAND``. Commands, messages, progress, exit codes; all else is in the rooms below.

May use every room; sole user of tqdm.
Start with options.py, what a command is, and run.py for one of them.

Exit codes: 0 done; 1 an error of feedsim itself (please report it); 2 bad input or usage; 3 a unit failed during the
simulation; 4 the results could not be written; 130 interrupted (143 and 129: by SIGTERM and SIGHUP). `feedsim compare`
has codes of its own: 0 same, 1 different, 2 unusable for whatever reason.
"""

from __future__ import annotations

import argparse
import gc
import os
import sys
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import Any

from feedsim.cli import (
    circle,
    compare,
    compensate,
    completion,
    docs,
    example,
    files,
    frf,
    identify,
    machine,
    modes,
    pack,
    page,
    replay,
    run,
    show,
    sweep,
    tune,
)
from feedsim.cli.grammar import Parser
from feedsim.cli.kinds import meant
from feedsim.cli.start import START_TEXT
from feedsim.cli.terminal import STANDARD_OUTPUT, painted, prepare_streams
from feedsim.signals import end_program

EPILOG = """exit codes:
  0 done    1 internal error    2 bad input or usage    3 a unit failed    4 results cannot be written
  130 interrupted (143, 129: by SIGTERM, SIGHUP)
  feedsim compare: 0 same    1 different    2 unusable

examples:
  feedsim example xz_circle z_positioning identify_z_constant friction_wear
  feedsim run z_positioning.yaml --out results/z
  feedsim run xz_circle.yaml --set "machine.axes.*.friction.W=0 rad" --out results/lugre
  feedsim validate xz_circle.yaml
  feedsim machine info machines/test_centre
  feedsim machine show machines/test_centre --mode 21Hz --animate --out results/structure
  feedsim machine pack machines/test_centre --out my_plant.fmu
  feedsim frf machines/test_centre --axes X,Z
  feedsim run identify_z_constant.yaml
  feedsim identify results/identify_z_constant/log.csv --axis Z --machine machines/test_centre
  feedsim identify-drive capture.json --axes X,Y --out results/my_machine
  feedsim identify-modes bench.mat --machine machines/test_centre --input iq:A --motor theta_m:rad --interval 0.4ms
  feedsim replay capture.json --machine results/my_machine
  feedsim compensate xz_circle.yaml
  feedsim circle ballbar.csv --axes X,Y --radius "150 mm" --feed "1000 mm/min"
  feedsim pack xz_circle.yaml --out machine.fmu
  feedsim page xz_circle.yaml --out machine.html
  feedsim show results/z results/lugre
  feedsim ssp xz_circle.yaml --out xz_circle.ssp
  feedsim run xz_circle.ssp
  feedsim sweep studies/friction_wear.yaml
  feedsim compare result.csv reference.csv --tol 1e-6 --report compare.html
"""


COMMANDS = (
    example.COMMAND, run.RUN, run.VALIDATE, machine.COMMAND, frf.COMMAND, identify.COMMAND, replay.IDENTIFY_DRIVE,
    modes.COMMAND, replay.REPLAY, compensate.COMMAND, circle.COMMAND, show.COMMAND, pack.COMMAND, page.COMMAND, run.SSP,
    sweep.COMMAND, tune.COMMAND, compare.COMMAND, files.SCHEMA, files.CONVERT, docs.COMMAND,
    completion.COMMAND,
)  # fmt: skip


def parser(only: str = "") -> Parser:
    """The command line's grammar; of `only` one command, where there is one of that name."""
    top = Parser(
        prog="feedsim",
        description="Simulate machine-tool feed drives with non-linear friction.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    top.add_argument("--version", action=_Version, help="show program's version number and exit")
    top.set_defaults(known=COMMANDS)
    commands = top.add_subparsers(dest="command", metavar="COMMAND")
    for command in [command for command in COMMANDS if command.name == only] or COMMANDS:
        command.add_to(commands)
    return top


class _Version(argparse.Action):
    """Prints the version; only then it is asked for, which takes a fiftieth of a short run."""

    def __init__(self, **words: Any) -> None:
        super().__init__(nargs=0, **words)

    def __call__(self, parser: argparse.ArgumentParser, *given: object) -> None:
        from feedsim.installation import version

        print(f"feedsim {version('feedsim') or '(run from its sources, not installed)'}")
        parser.exit()


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    given = sys.argv[1:] if arguments is None else arguments
    options = parser(given[0] if given else "").parse_args(given)
    if options.command is None:
        print(START_TEXT, end="")
        return 0
    # Small matrices by the thousand: threads for linear algebra only wait for one another.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # To look for plugins of pydantic, it reads what all installed packages say of themselves; none is used here.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")

    from feedsim.arguments import as_options
    from feedsim.errors import FeedsimError
    from feedsim.extras import ask, missing
    from feedsim.outputs import replacing

    try:
        drawn = ["figures"] if getattr(options, "figures", ()) else []
        ask(options.called, *options.needs, *drawn)
        spoken = _in_words_of(getattr(options, "control", ""))
        with as_options(), replacing(getattr(options, "force", False)), spoken:
            code = options.action(options)
        if sys.stdout is not None:  # closed by a reader that has gone
            sys.stdout.flush()
    except FeedsimError as error:
        _say(_kind_meant(options) if error.exit_code == 2 else "", error)
        return error.exit_code
    except ModuleNotFoundError as error:
        if (missing_package := missing(error, options.called)) is None:
            raise
        _say("", missing_package)
        return missing_package.exit_code
    except KeyboardInterrupt:
        print("feedsim: interrupted", file=sys.stderr)
        return 130
    except OSError as error:
        sys.stdout = None  # Python would flush into the closed pipe once more
        if isinstance(error, BrokenPipeError) and error.filename == STANDARD_OUTPUT:  # who read it has gone
            return 0
        print(
            f"feedsim: {error.filename or 'a temporary file (TMPDIR names the folder)'}: {error.strerror}",
            file=sys.stderr,
        )
        return 4
    return code if isinstance(code, int) else 0


def _in_words_of(control: str) -> AbstractContextManager[None]:
    """Reports in the names of a control; without one their code is not loaded."""
    if not control:
        return nullcontext()
    from feedsim.report.control import control_names

    return control_names(control)


def _kind_meant(options: argparse.Namespace) -> str:
    """What is to be said in place of a refusal, where the file is of a kind that another command takes."""
    command = options.called.removeprefix("feedsim ")
    said = meant(command, (getattr(options, name) for name in options.arguments))
    return said or meant(f"{command} --machine", [getattr(options, "machine", None)])


def _say(sentence: str, error: object) -> None:
    print(painted(f"feedsim: {sentence or error}", "red", sys.stderr), file=sys.stderr)


def entry() -> None:
    """Entry point of the console script."""
    # Most of what a command makes stays until it ends, so that looking for garbage finds little: with the usual 700
    # some 0.12 s of a run's 1.0 s, with this none. 200,000 objects take some 30 MB. Left alone where main() is called:
    # by a process that is not this program's own.
    gc.set_threshold(200_000, 20, 20)
    end_program(entry)
    prepare_streams()
    try:
        sys.exit(main())
    finally:
        # As it ends, the interpreter would look for garbage among all that there is: 0.15 s of a run's 1.0 s. Files and
        # units are closed by then, and what is to be done at the end is registered for it.
        gc.freeze()
