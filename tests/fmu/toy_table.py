"""A unit for tests that is a table and nothing else."""

from pathlib import Path

from feedsim_packager import checkout, table

HEAD = "/* toy: a unit for tests. Second sentence. */\n"
GOOD = HEAD + (
    'REAL(v, input, discrete, 0, "m", "mm", NO_MIN, NO_MAX, "", "Other in")\n'
    'REAL(u, input, continuous, 0, "m", "mm", NO_MIN, NO_MAX, "", "In")\n'
    'REAL_OF(group, y, output, continuous, 0, "m", "um", NO_MIN, NO_MAX, "u (v)", "Out \\"quoted\\", with comma")\n'
    'REAL(k, parameter, tunable, 125e-6, "1", "%", -1, 2.5, "", "Gain; " "in two pieces")\n'
    'INTEGER_OF(group, n, parameter, fixed, -3, -5, 7, "", "Count")\n'
    'BOOLEAN(on, parameter, fixed, 1, "", "Switch")\n'
    'BOOLEAN(lit, output, discrete, 0, "u", "Lamp")\n'
    'STRING(path, parameter, fixed, "a|b \\\\ c", "File")\n'
)


def toy(folder: Path, rows: str) -> Path:
    folder.mkdir(exist_ok=True)
    kind = "#define UNIT_RESOURCES machine\n" if "AXIS_" in rows else ""
    identity = f"#ifndef ID_H\n#define ID_H\n#define UNIT_NAME toy\n{kind}#endif\n"
    (folder / "identity.h").write_text(identity, encoding="utf-8")
    (folder / "variables.def").write_text(rows, encoding="utf-8")
    return folder


def read(folder: Path, rows: str, compiler: tuple[str, ...]) -> table.Table:
    return table.read(toy(folder, rows), (checkout.SHELL, checkout.STANDARD), compiler)
