"""feedsim completion: names of commands, options and choices for the shell, made from the list of commands itself.

The three scripts do the same: they walk through the words up to the cursor to see which command it is, and offer what
that has. Everything else is left to the shell, which offers files.
"""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from feedsim.cli.options import FORCE, WRITES, Command, Option, flat

SHELLS = ("bash", "zsh", "fish")


@dataclass(frozen=True)
class Place:
    """A command as it stands on the command line: "", "run", "machine pack".

    offered: what may come next, with a text for each: commands, or the choices of an argument. options: typed, text.
    values: option -> choices of its value.
    """

    command: str
    offered: Sequence[tuple[str, str]]
    options: Sequence[tuple[str, str]]
    values: Sequence[tuple[str, Sequence[str]]] = ()


def places(commands: Sequence[Command], above: str = "") -> Iterator[Place]:
    """A place of every command, that of `above` first."""
    top = [("--help", "show the help")] if above else [("--help", "show the help"), ("--version", "show the version")]
    yield Place(above, [(command.name, command.help) for command in commands], top)
    for command in commands:
        name = f"{above} {command.name}".strip()
        if command.commands:
            yield from places(command.commands, name)
        else:
            yield _place(name, [*flat(command.options)])


def _place(name: str, options: Sequence[Option]) -> Place:
    named = [option for option in options if option.typed.startswith("-")]
    if any(option.typed in WRITES for option in options):
        named = [*named, FORCE]
    arguments = [str(choice) for option in options if option not in named for choice in option.words.get("choices", ())]
    return Place(
        name,
        [(choice, "") for choice in [*arguments, *(_examples() if name == "example" else ())]],
        [*((option.typed, str(option.words["help"])) for option in named), ("--help", "show the help")],
        [(option.typed, [*map(str, option.words["choices"])]) for option in named if "choices" in option.words],
    )


def _examples() -> list[str]:
    from feedsim.examples import examples

    return sorted({example.name for example in examples()})


def bash(result: Sequence[Place]) -> str:
    """The script for bash."""
    offers = [f"    {_key(place)}) offered={_word(_joined(place.offered))} options={_word(_joined(place.options))} ;;"
              for place in result]  # fmt: skip
    values = [f"    {_word(f'{place.command} {option}')}) options={_word(' '.join(known))} ;;"
              for place in result for option, known in place.values]  # fmt: skip
    return "\n".join([
        "# feedsim completion bash: eval \"$(feedsim completion bash)\" in ~/.bashrc",
        "_feedsim() {",
        "  local i command='' offered='' options='' current=\"${COMP_WORDS[COMP_CWORD]}\"",
        "  for ((i = 1; i < COMP_CWORD; i++)); do",
        "    case \"$command ${COMP_WORDS[i]}\" in",
        *(f"      {_word(walked)}) command={_word(place)} ;;" for walked, place in _walk(result)),
        "    esac",
        "  done",
        "  case \"$command\" in",
        *offers,
        "  esac",
        "  COMPREPLY=()",
        "  case \"$command ${COMP_WORDS[COMP_CWORD-1]}\" in",
        *values,
        "    *) [[ $current == -* ]] || options=$offered ;;",
        "  esac",
        "  [[ -n $options ]] && COMPREPLY=($(compgen -W \"$options\" -- \"$current\"))",
        "}",
        "complete -o bashdefault -o default -F _feedsim feedsim",
        "",
    ])  # fmt: skip


def zsh(result: Sequence[Place]) -> str:
    """The script for zsh."""

    def listed(name: str, pairs: Sequence[tuple[str, str]]) -> str:
        return f"{name}=({' '.join(_word(f'{word}:{text}' if text else word) for word, text in pairs)})"

    values = [f"    {_word(f'{place.command} {option}')}) compadd -- {' '.join(known)}; return ;;"
              for place in result for option, known in place.values]  # fmt: skip
    return "\n".join([
        "#compdef feedsim",
        "# feedsim completion zsh: eval \"$(feedsim completion zsh)\" in ~/.zshrc, behind compinit",
        "_feedsim() {",
        "  local word command=''",
        "  local -a offered options",
        "  for word in \"${(@)words[2,CURRENT-1]}\"; do",
        "    case \"$command $word\" in",
        *(f"      {_word(walked)}) command={_word(place)} ;;" for walked, place in _walk(result)),
        "    esac",
        "  done",
        "  case \"$command\" in",
        *(f"    {_key(place)}) {listed('offered', place.offered)}; {listed('options', place.options)} ;;"
          for place in result),
        "  esac",
        "  case \"$command ${words[CURRENT-1]}\" in",
        *values,
        "  esac",
        "  if [[ ${words[CURRENT]} == -* ]]; then _describe -o option options",
        "  elif (( ${#offered} )); then _describe command offered",
        "  else _files; fi",
        "}",
        "compdef _feedsim feedsim",
        "",
    ])  # fmt: skip


def fish(result: Sequence[Place]) -> str:
    """The script for fish."""
    lines = [
        "# feedsim completion fish > ~/.config/fish/completions/feedsim.fish",
        "function __feedsim_at",
        "  set -l command ''",
        "  for word in (commandline -opc)[2..-1]",
        "    switch \"$command $word\"",
        *(f"      case {_word(walked)}\n        set command {_word(place)}" for walked, place in _walk(result)),
        "    end",
        "  end",
        "  test \"$command\" = \"$argv\"",
        "end",
    ]  # fmt: skip
    for place in result:
        at = f"complete -c feedsim -n {_word(f'__feedsim_at {place.command}'.strip())}"
        lines += [f"{at} -f -a {_word(word)} -d {_word(text)}" for word, text in place.offered]
        known = dict(place.values)
        for option, text in place.options:
            value = f" -x -a {_word(' '.join(known[option]))}" if option in known else ""
            lines.append(f"{at} -l {option.removeprefix('--')}{value} -d {_word(text)}")
    return "\n".join([*lines, ""])


def _walk(result: Sequence[Place]) -> Iterator[tuple[str, str]]:
    """The command so far and the next word -> the command then."""
    for place in result:
        if place.command:
            above, _, last = place.command.rpartition(" ")
            yield f"{above} {last}", place.command


def _key(place: Place) -> str:
    return _word(place.command)


def _joined(pairs: Sequence[tuple[str, str]]) -> str:
    return " ".join(word for word, _ in pairs)


def _word(text: str) -> str:
    """As one word of a shell, which reads nothing else into it; a ":" would part word and text in zsh's lists."""
    from shlex import quote

    return quote(text.replace("'", "’")) if text else "''"


def completion(options: Namespace) -> None:
    """feedsim completion."""
    script = {"bash": bash, "zsh": zsh, "fish": fish}[options.shell]
    print(script([*places(options.known)]), end="")


COMMAND = Command(
    "completion",
    "print the completion of commands and options for bash, zsh or fish",
    completion,
    [Option("shell", "", "bash, zsh or fish", choices=SHELLS)],
    needs=(),
    description="Print a script that completes commands, options and choices. For bash, in ~/.bashrc: "
    'eval "$(feedsim completion bash)". For zsh, in ~/.zshrc behind compinit: eval "$(feedsim completion zsh)". '
    "For fish: feedsim completion fish > ~/.config/fish/completions/feedsim.fish",
)
