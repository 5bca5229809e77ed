"""Command line: ``feedsim COMMAND``. It parses, calls the job of the command, and prints what the job returns.

May use every room; sole user of tqdm and argcomplete.
Start with commands.py, which lists the commands, then main().

Exit codes: 0 done; 1 an error of feedsim itself (please report it), or with --strict a result that is WRONG; 2 bad
input or usage; 3 a unit failed during the simulation; 4 the results could not be written; 130 interrupted (143 and 129:
by SIGTERM and SIGHUP). `feedsim compare` has codes of its own: 0 same, 1 different, 2 unusable for whatever reason.
"""

from __future__ import annotations

import argparse
import gc
import os
import sys
import traceback
from collections.abc import Sequence
from typing import Any

from feedsim.cli.commands import (
    STANDARD_OUTPUT,
    START_TEXT,
    Command,
    Parser,
    add_commands,
    arguments,
    choose_colour,
    files_of_arguments,
    finish,
    paint_text,
    prepare_streams,
    refuse_missing_files,
    rename_words,
    shown_streams,
    watch_job,
)
from feedsim.foundation.outputs import end_program

EPILOG = """exit codes:
  0 done    1 internal error, or with --strict a result that is WRONG    2 bad input or usage
  3 a unit failed    4 results cannot be written    130 interrupted (143, 129: by SIGTERM, SIGHUP)
  feedsim compare: 0 same    1 different    2 unusable

feedsim COMMAND --help has examples; feedsim docs opens the documentation.
"""


def parser(only: str = "") -> Parser:
    """The command line's grammar; of `only` one command, where there is one of that name."""
    top = Parser(
        prog="feedsim",
        description="Simulate machine-tool feed drives with non-linear friction.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    top.add_argument("--version", action=_Version, help="show program's version number and exit")
    add_commands(top, only)
    return top


class _Version(argparse.Action):
    """Prints the version; only then it is asked for, which takes a fiftieth of a short run."""

    def __init__(self, **words: Any) -> None:
        super().__init__(nargs=0, **words)

    def __call__(self, parser: argparse.ArgumentParser, *given: object) -> None:
        from feedsim.foundation.installation import version

        print(f"feedsim {version('feedsim') or '(run from its sources, not installed)'}")
        parser.exit()


def main(arguments_given: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    with shown_streams():
        return _main(sys.argv[1:] if arguments_given is None else [*arguments_given])


def _main(given: Sequence[str]) -> int:
    words, notes = rename_words(given)
    options = parser(words[0] if words else "").parse_args(words)
    if options.command is None:
        print(START_TEXT, end="")
        return 0
    command: Command = options.chosen
    choose_colour(options.color)
    for note in notes:
        print(f"feedsim: note: {note}", file=sys.stderr)
    # Small matrices by the thousand: threads for linear algebra only wait for one another.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # To look for plugins of pydantic, it reads what all installed packages say of themselves; none is used here.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")

    from feedsim.foundation.errors import FeedsimError
    from feedsim.foundation.installation import missing_package_error

    try:
        code = _run_command(command, options)
        if sys.stdout is not None:  # closed by a reader that has gone
            sys.stdout.flush()
        return code
    except FeedsimError as error:
        wrong_kind = error.exit_code == 2 and not command.missing_file(options)
        _print_error(_explain_other_kind(command, options) if wrong_kind else "", error)
        return _code(command, error.exit_code)
    except ModuleNotFoundError as error:
        if (missing_package := missing_package_error(error, options.called)) is None:
            raise
        _print_error("", missing_package)
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
        return _code(command, 4)
    except Exception:
        if command.name != "compare":
            raise
        traceback.print_exc()
        return 2


def _code(command: Command, code: int) -> int:
    """Whatever goes wrong in a comparison is 2: there 1 says that results differ."""
    return 2 if command.name == "compare" else code


def _run_command(command: Command, options: argparse.Namespace) -> int:
    """Do what the command asks for, and print what came out."""
    from feedsim.foundation.arguments import as_options
    from feedsim.foundation.installation import require_extras
    from feedsim.foundation.outputs import allow_replacement

    require_extras(options.called, *command.declared.needs, *(["figures"] if getattr(options, "figures", ()) else []))
    refuse_missing_files(command, options)
    from feedsim.jobs.result import in_words_of  # behind the look at the files: it loads what takes longer

    named = arguments(command, options)
    several = next((p.name for p in command.options if p.type.startswith("*")), None)
    with (
        as_options(),
        allow_replacement(getattr(options, "force", False)),
        in_words_of(getattr(options, "control", "")),
    ):
        job = command.job()
        listed = named.pop(several, ()) if several else ()
        silent = options.quiet or options.json is True
        if any(p.name == "watch" for p in command.declared.parameters):
            with watch_job(silent) as watch:
                result = job(*listed, **named, watch=watch)
        else:
            result = job(*listed, **named)
        return finish(result, named.get("out"), options)


def _explain_other_kind(command: Command, options: argparse.Namespace) -> str:
    """What is to be said in place of a refusal, where the file is of a kind that another command takes."""
    from feedsim.cli.kinds import explain_kind

    sentences = (
        explain_kind(f"{command.name} {option}".strip(), [value])
        for option, value in files_of_arguments(command, options)
    )
    return next(filter(None, sentences), "")


def _print_error(sentence: str, error: object) -> None:
    print(paint_text(f"feedsim: {sentence or error}", "red", sys.stderr), file=sys.stderr)


def entry() -> None:
    """Entry point of the console script."""
    if "_ARGCOMPLETE" in os.environ:  # a shell asks how a command goes on
        import argcomplete

        argcomplete.autocomplete(parser())
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
