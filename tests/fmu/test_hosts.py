"""Units in C programs that load them as importers do: ten million steps, crowds of instances, threads."""

import platform
import re
import subprocess
from collections.abc import Sequence
from pathlib import Path

import pytest

from feedsim_packager import repack, setpoints
from feedsim_packager.machine import named
from feedsim_packager.resources import File
from fmu.binary import of
from fmu.unpacked import ROOT, Archive, unpack

pytestmark = pytest.mark.extensive

UNIT_C = ROOT / "tests/unit_c"
HEADERS = f"-I{ROOT / 'src/fmi2/standard'}"
FLAGS = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Werror")
LIBRARIES = ("-ldl", "-lm", "-lpthread")
THREAD_SANITIZER = ("-O1", "-g", "-fsanitize=thread")
STEPS = 10_000_000


def _compile(source: str, output: Path, compiler: Sequence[str], *flags: str) -> Path:
    if platform.system() == "Windows":
        pytest.skip("the program loads libraries with dlopen")
    command = [*compiler, *FLAGS, *flags, "-D_POSIX_C_SOURCE=200809L", HEADERS, str(UNIT_C / source)]
    subprocess.run([*command, "-o", str(output), *LIBRARIES], check=True)
    return output


@pytest.fixture(scope="session")
def long_run(compiler: tuple[str, ...], tmp_path_factory: pytest.TempPathFactory) -> Path:
    return _compile("long_run.c", tmp_path_factory.mktemp("host") / "long_run", compiler, "-O2")


@pytest.fixture(scope="session")
def crowd(compiler: tuple[str, ...], tmp_path_factory: pytest.TempPathFactory) -> Path:
    return _compile("crowd.c", tmp_path_factory.mktemp("host") / "crowd", compiler, "-O2")


def _run(program: Path, library: Path, archive: Archive, *arguments: object) -> str:
    resources = (archive.folder / "resources").as_uri()
    command = [str(program), str(library), archive.guid, resources, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def _slow_table(setpoint: Archive, folder: Path) -> Archive:
    """The same unit with a row a second: ten million steps do not come to its end."""
    rows = 1400
    table = setpoints.write([float(k) for k in range(rows)], {"X": ([0.001 * k for k in range(rows)], [0.0] * rows)})
    out = folder / "slow" / "setpoint.fmu"
    repack.repack(setpoint.path, setpoints.check(File("setpoints.csv", table)), named("slow"), out)
    return unpack("setpoint", out.parent, folder / "unpacked")


def test_ten_million_steps_without_drift(archive: Archive, long_run: Path, tmp_path: Path) -> None:
    sampled: list[object] = []
    if archive.unit == "controller":
        # The following error is taken every T_pos = 1 ms and shows x_a; a step that is no part of it.
        sampled = [of(archive, "output")["x_e"], of(archive, "input")["x_a"], 1_000_000, 130_700]
    if archive.unit == "setpoint":
        archive = _slow_table(archive, tmp_path)
        sampled = [of(archive, "output")["X.x_s"], -1, 1_000_000_000, 130_700]
    told = _run(long_run, archive.library, archive, STEPS, *sampled)
    # Only then was the tolerance of the comparison one that a lost or doubled sample would break.
    assert 1e-6 < float(re.findall(r"off by (\S+) cycles", told)[0]) < 1e-2


def test_two_hundred_instances_and_eight_threads(archive: Archive, crowd: Path) -> None:
    told = _run(crowd, archive.library, archive, 200, 8, 200)
    (size,) = re.findall(r"(\d+) bytes an instance", told)
    assert int(size) < 1_000_000  # measured: plant 69 kB, setpoint 31 kB, controller 6 kB, friction 2 kB


def test_threads_under_the_thread_sanitizer(archive: Archive, compiler: tuple[str, ...], tmp_path: Path) -> None:
    """The unit as an importer compiles it from its sources, instrumented like the program."""
    probe = tmp_path / "probe.c"
    probe.write_text("int main(void) { return 0; }\n")
    tried = subprocess.run(
        [*compiler, *THREAD_SANITIZER, str(probe), "-o", str(tmp_path / "probe")], capture_output=True
    )
    if tried.returncode != 0 or subprocess.run([str(tmp_path / "probe")], capture_output=True).returncode != 0:
        pytest.skip("the compiler has no thread sanitizer that runs here")
    sources = archive.folder / "sources"
    library = tmp_path / archive.library.name
    flags = ["-std=c99", "-ffp-contract=off", *THREAD_SANITIZER, "-fPIC", "-shared", "-fvisibility=hidden"]
    files = [str(sources / name) for name in archive.source_files]
    subprocess.run([*compiler, *flags, HEADERS, *files, "-lm", "-o", str(library)], check=True)
    program = _compile("crowd.c", tmp_path / "crowd", compiler, *THREAD_SANITIZER)
    # Few steps and instances: races are found by who touches what, not by chance.
    resources = (archive.folder / "resources").as_uri()
    done = subprocess.run(
        [str(program), str(library), archive.guid, resources, "8", "8", "20"],
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert "ThreadSanitizer" not in done.stdout + done.stderr, done.stderr[:4000]
    assert "bytes an instance" in done.stdout, done.stdout + done.stderr  # it ran to its end
    assert done.stdout.count("failed:") == done.stdout.count("failed: memory of the process after further rounds")
