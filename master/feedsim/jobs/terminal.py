"""What belongs to a terminal: the documentation in a browser, completion in a shell."""

from __future__ import annotations

from typing import Annotated

from feedsim.errors import InputError
from feedsim.jobs.parameters import Argument, Option, job


@job("open the documentation", needs=())
def docs(
    path: Annotated[bool, Option("", "print the path of its first page, and open nothing")] = False,
) -> str:
    """Open the documentation of this installation in a browser.

    Raises:
        InputError: this installation has none.
    """
    from feedsim.installation import documentation

    page = documentation()
    if page is None:
        raise InputError("this installation has no documentation: a release's wheel brings it, `make docs` builds it")
    if not path:
        import webbrowser

        webbrowser.open(page.as_uri())
    return str(page)


@job("print the completion for bash, zsh or fish", needs=())
def completion(shell: Annotated[str, Argument("", "the shell", choices=("bash", "zsh", "fish"))]) -> str:
    """Print a script that completes commands, options and choices.

    In ~/.bashrc, or in ~/.zshrc behind compinit: eval "$(feedsim tools completion bash)", or zsh. For fish, once:
    feedsim tools completion fish > ~/.config/fish/completions/feedsim.fish
    """
    from argcomplete.shell_integration import shellcode

    return str(shellcode(["feedsim"], shell=shell)).rstrip("\n")
