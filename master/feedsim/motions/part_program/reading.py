"""A program file, with the subprograms beside it, as Moves."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from feedsim.foundation.errors import InputError
from feedsim.motions.part_program.recorder import Fault, Recorder
from feedsim.motions.part_program.source import DIALECTS, Folder, Program, detect_dialect, read_text
from feedsim.motions.part_program.words import Moves

TOLERANCE = 100e-6  # [m], the standard value of MD33100


def read_program(
    path: str | Path,
    *,
    axes: Sequence[str],
    start: Sequence[float],
    dialect: str | None = None,
    offsets: Mapping[str, Mapping[str, float]] | None = None,
    tolerance: float = TOLERANCE,
    skip: bool = False,
) -> Moves:
    """Movements and dwells that an NC program commands.

    Args:
        path: file of the program; subprograms lie beside it.
        axes: names of the machine's linear axes.
        start: position of each [m].
        dialect: sinumerik, iso or heidenhain; None: by the file's ending and words.
        offsets: work offsets, G54 ... -> axis -> [m]; what is not given is 0.
        tolerance: [m] of G642, G645 and compressors where the program has no CTOL.
        skip: whether blocks that begin with / are left out.

    Raises:
        InputError: no such file, no program, or a word that is not understood: file, line, word and reason.
    """
    path = Path(path)
    text = read_text(path)
    if dialect is None:
        dialect = detect_dialect(path, text)
    if dialect not in DIALECTS:
        raise InputError(f"dialect {dialect!r} is none of {', '.join(DIALECTS)}")
    if len(set(axes)) != len(axes) or len(axes) != len(start) or not axes:
        raise InputError(f"{len(start)} positions for {len(axes)} axes: each axis has one name and one position")
    folder = Folder(path)

    def find(name: str) -> tuple[str, str] | None:
        other = folder.find(name)
        return None if other is None else (str(other), read_text(other))

    millimetres = {name: {axis: 1e3 * x for axis, x in of.items()} for name, of in (offsets or {}).items()}
    return interpret(
        str(path), text, find, axes=axes, start=[1e3 * x for x in start], dialect=dialect, offsets=millimetres,
        tolerance=1e3 * tolerance, skip=skip,
    )  # fmt: skip


def interpret(
    name: str, text: str, find: Callable[[str], tuple[str, str] | None], *, axes: Sequence[str], start: Sequence[float],
    dialect: str, offsets: Mapping[str, Mapping[str, float]], tolerance: float, skip: bool,
) -> Moves:  # fmt: skip
    """As read_program(), of texts; lengths in mm. find: name -> file and text of a subprogram."""
    # Machine files and results name moves, and load this package; the languages are for those who run programs.
    from feedsim.motions.part_program.conversational import Conversational
    from feedsim.motions.part_program.interpreter import Interpreter

    recorder = Recorder(axes, start)
    programs = [Program(name, text, 0)]
    called: dict[str, Program | None] = {}

    def program(wanted: str) -> Program | None:
        if wanted not in called:
            match = find(wanted)
            same = next((other for other in programs if match and other.name == match[0]), None)
            if match and same is None:
                same = Program(*match, len(programs))
                programs.append(same)
            called[wanted] = same
        return called[wanted]

    try:
        reader: Interpreter | Conversational
        if dialect == "heidenhain":
            reader = Conversational(recorder, program)
        else:
            iso = dialect == "iso"
            reader = Interpreter(recorder, program, iso=iso, skip=skip, tolerance=tolerance, offsets=offsets)
        reader.run(programs[0], 0, 1, len(programs[0].code))
        reader.finish()
        if not recorder.rows and not recorder.count:
            raise Fault("program", "no movement is commanded" if text.strip() else "the file is empty")
        return recorder.finish([file.name for file in programs], [file.text for file in programs])
    except Fault as fault:
        file = programs[recorder.file if fault.file is None else fault.file].name
        line = fault.line or max(recorder.line, 1)
        raise InputError(f"{file}:{line}: {fault.word}: {fault.reason}") from None
