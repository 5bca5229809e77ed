"""feedsim docs: the documentation of this installation, opened in a browser."""

from __future__ import annotations

from argparse import Namespace

from feedsim.cli.options import Command, Option
from feedsim.errors import InputError


def docs(options: Namespace) -> None:
    """Open the first page, or name it."""
    from feedsim.installation import documentation

    page = documentation()
    if page is None:
        raise InputError("this installation has no documentation: a release's wheel brings it, `make docs` builds it")
    if not options.path:
        import webbrowser

        webbrowser.open(page.as_uri())
    print(page)


COMMAND = Command(
    "docs",
    "open the documentation: tutorials, how-to pages, reference, search",
    docs,
    (Option("--path", "", "print the path of its first page, and open nothing"),),
    needs=(),
)
