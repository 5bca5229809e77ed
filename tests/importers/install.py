"""Fetch what `make test-importers` needs beyond pip, into FOLDER: Maestro and VDMCheck2 by Maven, fmi-sim and
fmu-runner by cargo.

    python tests/importers/install.py [--system] [--rust] FOLDER

Java and Maven must be there, and for --rust, which takes minutes, cargo and libclang. With --system Java, Maven and
libclang are installed first where they are not (apt, as root); without it nothing is installed on the machine itself.
What is missing is said, and is no failure: its tests are skipped with the reason.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from zipfile import ZipFile

POM = Path(__file__).with_name("pom.xml")
JAVA = "Maestro and VDMCheck2"
MAESTRO = "maestro-3.1.1-jar-with-dependencies.jar"
# VDMCheck2 looks for its parts beside itself, under names without versions.
VDMCHECK = ("vdmcheck2-1.1.3", "vdmj-4.5.0", "annotations-4.5.0", "xsd2vdm-1.1.3", "fmuReader-1.1.3")
UNPACKED = {
    "rule-model-1.1.3": "fmi2-rule-model/",
    "static-model-1.1.3": "fmi2-static-model/",
    "vdmcheck2-1.1.3": "fmi2schema/",
}
# What cargo builds, and how. Without optimisation: they are built once and run for seconds.
RUST = {
    "fmi-sim": ("fmi-sim", "--version", "0.7.0", "--locked"),
    "fmu-runner-program": ("--path", str(Path(__file__).with_name("rust"))),
}
LONGEST = 900  # s; fmi-sim, with 150 crates, takes minutes
PACKAGES = {"java": "default-jre-headless", "mvn": "maven", "libclang": "libclang-dev"}
LIBCLANG = (
    "llvm-*/lib/libclang*.so*",
    "*/libclang*.so*",
    "libclang*.so*",
)  # below the system's lib; fmi-sim reads C by it


def main(words: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(description="Fetch what make test-importers needs beyond pip.")
    parser.add_argument("--system", action="store_true", help="install Java, Maven and libclang too, with apt, as root")
    parser.add_argument("--rust", action="store_true", help="build fmi-sim and fmu-runner too, with cargo")
    parser.add_argument("folder", type=Path, metavar="FOLDER")
    options = parser.parse_args(words)
    fetch(options.folder, system=options.system)
    if options.rust:
        build(options.folder / "cargo", system=options.system)
    return 0


def build(folder: Path, *, system: bool = False) -> None:
    """The programs in Rust, into `folder`/bin. `system`: whether the machine's package manager may be used."""
    if system and not _has_libclang():
        _apt(["libclang"])
    for name, words in RUST.items():
        if shutil.which(name, path=str(folder / "bin")):
            continue
        if not shutil.which("cargo"):
            _left_out(name, "cargo not found (Rust 1.85 or newer: rustup)")
            continue
        print(f"building {name} (some minutes)", flush=True)
        command = ["cargo", "install", "--quiet", "--debug", "--root", str(folder.resolve()), *words]
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=LONGEST)
        except subprocess.TimeoutExpired:
            _left_out(name, f"cargo did not build it within {LONGEST} s")
            continue
        if done.returncode:
            told = (done.stdout + done.stderr).strip()[-500:]
            if "libclang" in told:
                told = f"libclang not found (Debian: {PACKAGES['libclang']}; LIBCLANG_PATH names its folder):\n{told}"
            _left_out(name, f"cargo could not build it: {told}")


def _has_libclang() -> bool:
    folders = (Path("/usr/lib"), Path("/usr/lib64"), Path("/usr/local/lib"))
    return "LIBCLANG_PATH" in os.environ or any(
        path for folder in folders for name in LIBCLANG for path in folder.glob(name)
    )


def fetch(folder: Path, *, system: bool) -> None:
    """Maestro and VDMCheck2. `system`: whether the machine's package manager may be used."""
    jars, vdmcheck = folder / "jars", folder / "vdmcheck"
    needed = ["java"] if _complete(folder) else ["java", "mvn"]
    if system and any(not shutil.which(program) for program in needed):
        _apt(needed)
    if missing := [program for program in needed if not shutil.which(program)]:
        packages = " ".join(PACKAGES[name] for name in missing)
        _left_out(JAVA, f"{' and '.join(missing)} not found (Debian: {packages}; --system installs them, as root)")
        return
    if not _complete(folder):
        jars.mkdir(parents=True, exist_ok=True)
        goal = ("dependency:copy-dependencies", f"-DoutputDirectory={jars.resolve()}")
        done = subprocess.run(["mvn", "-q", "-B", "-f", str(POM), *goal], capture_output=True, text=True)
        if done.returncode:
            _left_out(JAVA, "Maven could not fetch them:\n" + (done.stdout + done.stderr).strip()[-500:])
            return
        _lay_out(jars, vdmcheck)
        shutil.move(jars / MAESTRO, folder / MAESTRO)


def _complete(folder: Path) -> bool:
    return (folder / MAESTRO).is_file() and all((folder / "vdmcheck" / part).is_dir() for part in UNPACKED.values())


def _apt(programs: list[str]) -> None:
    """Debian's packages, where they may be installed."""
    if shutil.which("apt-get") and hasattr(os, "geteuid") and os.geteuid() == 0:
        wanted = [package for program, package in PACKAGES.items() if program in programs]
        subprocess.run(["apt-get", "-qq", "update"], check=False)
        subprocess.run(["apt-get", "-qq", "install", "-y", "--no-install-recommends", *wanted], check=False)


def _lay_out(jars: Path, vdmcheck: Path) -> None:
    vdmcheck.mkdir(exist_ok=True)
    for name in VDMCHECK:
        shutil.copy(jars / f"{name}.jar", vdmcheck / f"{name.rpartition('-')[0]}.jar")
    for name, part in UNPACKED.items():
        with ZipFile(jars / f"{name}.jar") as archive:
            archive.extractall(vdmcheck, [member for member in archive.namelist() if member.startswith(part)])


def _left_out(what: str, reason: str) -> None:
    print(f"left out: {what}: {reason}", flush=True)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
