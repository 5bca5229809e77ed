"""Programs of other platforms: how each is compiled and run on this machine, or why it cannot be."""

from __future__ import annotations

import os
import platform
import shlex
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from fmpy import read_model_description
from numpy.typing import NDArray

from feedsim_packager import targets
from platforms.cases import STEPS, Case, H

HERE = Path(__file__).parent
HEADERS = HERE.parents[1] / "src" / "fmi2" / "standard"
SYSROOT = Path("/usr/aarch64-linux-gnu")  # Debian's libc6-arm64-cross
# s, against what hangs: a run takes some seconds, but the first under Wine makes its folders, and zig what a platform's
# programs need; on a busy machine minutes.
TIMEOUT = 1800

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Host:
    """A platform whose programs run here: its folder under binaries/, the words ahead of a program's own."""

    folder: str
    runner: tuple[str, ...]
    environment: tuple[tuple[str, str], ...] = ()

    @property
    def target(self) -> targets.Target:
        return targets.ALL[self.folder]

    def path(self, path: Path) -> str:
        """The path as programs of this platform see it; Wine has the root directory as drive Z."""
        return "Z:" + str(path).replace("/", "\\") if self.folder == "win64" else str(path)

    def uri(self, path: Path) -> str:
        return path.as_uri().replace("file:///", "file:///Z:/" if self.folder == "win64" else "file:///")


def why_not(folder: str) -> str | None:
    """The reason why programs of this platform do not run here; None where they do."""
    if platform.system() != "Linux" or platform.machine() != "x86_64":
        return "programs of other platforms are run on Linux x86-64 only"
    if folder == "win64" and not shutil.which("wine"):
        return "Wine is not installed (Debian: wine, wine64)"
    if folder == "aarch64-linux" and not shutil.which("qemu-aarch64"):
        return "qemu-aarch64 is not installed (Debian: qemu-user)"
    if folder == "aarch64-linux" and not SYSROOT.is_dir():
        return f"no C library for ARM in {SYSROOT} (Debian: libc6-arm64-cross)"
    return None


def host(folder: str, scratch: Path) -> Host:
    """How to run programs of this platform; Wine's own files go to the folder `scratch`."""
    if folder == "win64":
        environment = {"WINEPREFIX": str(scratch / "wine"), "WINEDEBUG": "-all", "WINEDLLOVERRIDES": "mscoree,mshtml="}
        return Host(folder, ("wine",), tuple(environment.items()))
    return Host(folder, ("qemu-aarch64", "-L", str(SYSROOT)) if folder == "aarch64-linux" else ())


def zig() -> list[str]:
    """The compiler that the environment variable ZIG names."""
    return shlex.split(os.environ["ZIG"])


FLAGS = ("-std=c99", "-D_POSIX_C_SOURCE=200809L", "-O1", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Werror")


def compile_program(where: Host, folder: Path) -> Path:
    """drive.c for this platform, by zig."""
    program = folder / f"drive-{where.folder}{'.exe' if where.folder == 'win64' else ''}"
    last = ["-municode"] if where.folder == "win64" else ["-ldl"]
    command = [*zig(), "-target", where.target.zig[0], *FLAGS, f"-I{HEADERS}", str(HERE / "drive.c")]
    subprocess.run([*command, "-o", str(program), *last], check=True, timeout=TIMEOUT)
    return program


def _bits(values: Floats) -> str:
    return " ".join(f"{value:016x}" for value in np.atleast_1d(values).astype(np.float64).view(np.uint64))


def write_script(path: Path, case: Case, unpacked: Path, resources: str) -> list[str]:
    """The script for drive.c; names of what is read. `unpacked` is the folder of the archive's files."""
    description = read_model_description(str(unpacked))
    reference = {variable.name: variable.valueReference for variable in description.modelVariables}
    read = [
        variable.name
        for variable in description.modelVariables
        if variable.type == "Real" and variable.causality in ("output", "local")
    ]
    lines = [f"{case.unit} {description.guid} {resources}", f"{_bits(np.array(H))} {STEPS}", str(len(case.parameters))]
    lines += [f"{reference[name]} {_bits(np.array(value))}" for name, value in case.parameters.items()]
    lines += [" ".join(map(str, (len(names), *(reference[name] for name in names)))) for names in (case.inputs, read)]
    if case.inputs:
        lines += [_bits(row) for row in np.column_stack(list(case.inputs.values()))]
    path.write_text("\n".join(lines) + "\n", encoding="ascii", newline="\n")
    return read


def read_result(path: Path, names: list[str]) -> dict[str, Floats]:
    """What drive.c wrote, by name (STEPS + 1,)."""
    rows = [[int(word, 16) for word in line.split()] for line in path.read_text(encoding="ascii").splitlines()]
    values = np.array(rows, dtype=np.uint64).view(np.float64)
    assert values.shape == (STEPS + 1, len(names))
    return dict(zip(names, values.T, strict=True))


def drive(where: Host, program: Path, library: Path, unpacked: Path, case: Case, scratch: Path) -> dict[str, Floats]:
    """Every Real output and local of the case, by name (STEPS + 1,). `unpacked` holds description and resources."""
    resources = where.uri(unpacked / "resources") if (unpacked / "resources").is_dir() else "-"
    script, result = scratch / "script.txt", scratch / "result.txt"
    names = write_script(script, case, unpacked, resources)
    command = [*where.runner, str(program), *(where.path(path) for path in (library, script, result))]
    environment = os.environ | dict(where.environment)
    done = subprocess.run(
        command, env=environment, capture_output=True, text=True, errors="replace", timeout=TIMEOUT, check=False
    )
    assert done.returncode == 0, f"{shlex.join(command)}\n{done.stdout}\n{done.stderr}"
    return read_result(result, names)
