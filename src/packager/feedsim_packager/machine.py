"""What an archive says in words of what is in it: a machine, a motion."""

from dataclasses import dataclass

from .errors import InputError


@dataclass(frozen=True)
class Machine:
    """Name and note of the machine (or of the motion), empty where there is none. `default`: it is the synthetic
    default machine (or belongs to it); `noun`: what the name is one of; `model`: the archive's modelName, where it is
    not the unit's."""

    name: str = ""
    note: str = ""
    default: bool = False
    noun: str = "Machine"
    model: str = ""

    def sentence(self) -> str:
        """The machine as a description ends with it; empty without a name and a note."""
        parts = [f"{self.noun}: {self.name}" if self.name else "", self.note]
        return ". ".join(part.rstrip(".") for part in parts if part)


def named(name: str = "", note: str = "", model: str = "") -> Machine:
    """A machine (or motion) of the user's; white space counts as one. Raises InputError for what no XML can hold."""
    return Machine(_line("name", name), _line("note", note), model=_line("name", model))


def _line(what: str, text: str) -> str:
    line = " ".join(text.split())
    if not line.isprintable():
        raise InputError(f"the machine's {what} {text!r} has characters that cannot be printed")
    return line
