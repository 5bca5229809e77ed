"""What can go wrong while packing, and the exit code that goes with it."""

from collections.abc import Iterable


class PackagerError(Exception):
    """Base of all errors that the packager reports."""

    exit_code = 1


class InputError(PackagerError):
    """A table, resource file or option is wrong. Lists every problem found, not only the first."""

    exit_code = 2

    def __init__(self, what: str, problems: Iterable[str] = ()) -> None:
        self.problems = tuple(problems)
        count = len(self.problems)
        heading = f"{what}: {count} problem{'s' if count != 1 else ''}" if count else what
        super().__init__("\n".join((heading, *(f"  {problem}" for problem in self.problems))))


class CompilerError(PackagerError):
    """The C compiler is missing or refused the sources."""

    exit_code = 3


class OutputError(PackagerError):
    """The archive cannot be written."""

    exit_code = 4
