"""References, physics and identification under the arithmetic of other processors (`make test-processors`).

OpenBLAS has kernels, numpy has functions and the C library has `exp`, `log`, `sin` and `pow` for each generation of
processors, and no two of them round alike. Each is told here to take another one than this machine's. A test that
passes on one and fails on another hangs on rounding: an adaptive path, a choice by the smaller of two, a tolerance
without reason. Kernels that the machine cannot run are left out, and this says so.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).resolve().parent
TESTS = HERE.parent

# What has an iteration, an order or pinned digits in it, but no statistics. The rest, many minutes: --all.
REFERENCES = ("reference/test_reference.py", "estimation/test_fit.py", "identify/test_stribeck.py")
CORE = (
    "reference/test_reference.py",
    "estimation", "identify",
    "physics/test_closed_forms.py", "physics/test_friction_law.py", "physics/test_linear_blocks.py",
    "physics/test_linear_machine.py", "physics/test_output_error.py", "physics/test_stationary.py",
)  # fmt: skip
ALL = ("reference", "estimation", "identify", "physics")
PROBE = """
import json, math, numpy, scipy.linalg
x = [0.001 * i for i in range(1, 20000)]
print(json.dumps({
    "numpy": numpy.show_config(mode="dicts")["SIMD Extensions"].get("found", []),
    "functions": [numpy.exp(x).tolist(), numpy.sin(x).tolist(), numpy.power(x, 1.5).tolist()],
    "libm": [[f(v) for v in x] for f in (math.exp, math.log, math.sin, lambda v: math.pow(v, 1.5))],
}))
"""


@dataclass(frozen=True)
class Setting:
    """Arithmetic of another processor.

    Attributes:
        name: as it is told. kernel: of OpenBLAS, by the name it is asked for with; None: the machine's.
        old: numpy's functions and the C library's as without AVX2 and FMA. flag: of /proc/cpuinfo that it needs.
        last_bit: numpy's functions off by their last bit, as with AVX-512 (last_bit.py). tests: what it tries.
    """

    name: str
    kernel: str | None
    old: bool = False
    last_bit: bool = False
    flag: str = ""
    tests: tuple[str, ...] = CORE

    def environment(self, extensions: list[str]) -> dict[str, str]:
        """The environment of a process; `extensions`: those that numpy finds here."""
        found = dict(os.environ)
        if self.kernel:
            found["OPENBLAS_CORETYPE"] = self.kernel
        if self.old:
            found["NPY_DISABLE_CPU_FEATURES"] = " ".join(extensions)
            found["GLIBC_TUNABLES"] = "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX512F"
        return found


SETTINGS = (
    # The one that is furthest from any machine tries all; each of the others what hangs on the kernel alone.
    Setting("neither AVX2 nor FMA", "Nehalem", old=True, last_bit=True),
    Setting("SSE3 alone in linear algebra", "Prescott", last_bit=True, tests=REFERENCES),
    Setting("AVX without FMA", "Sandybridge", flag="avx", tests=REFERENCES),
    Setting("AVX2", "Haswell", flag="avx2", tests=REFERENCES),
    Setting("AVX-512", "SkylakeX", flag="avx512bw", tests=REFERENCES),
)


def probed(environment: Mapping[str, str]) -> tuple[list[str], dict[str, list[list[float]]]]:
    """Kernels that OpenBLAS takes under `environment` (numpy's, then SciPy's), and what PROBE finds."""
    told = dict(environment) | {"OPENBLAS_VERBOSE": "2"}
    found = subprocess.run([sys.executable, "-c", PROBE], env=told, capture_output=True, text=True, check=True)
    lines = (found.stdout + found.stderr).splitlines()
    kernels = [line.partition(":")[2].strip() for line in lines if line.startswith("Core:")]
    return kernels, json.loads(next(line for line in lines if line.startswith("{")))


def differing(here: list[list[float]], there: list[list[float]]) -> str:
    """How many values of functions are others."""
    pairs = [(a, b) for one, other in zip(here, there, strict=True) for a, b in zip(one, other, strict=True)]
    return f"{sum(a != b for a, b in pairs)} of {len(pairs)} values other"


def flags() -> set[str]:
    """What the processor can do, by the kernel's names; empty where nobody says."""
    file = Path("/proc/cpuinfo")
    lines = file.read_text().splitlines() if file.exists() else []
    return set(next((line.partition(":")[2].split() for line in lines if line.startswith("flags")), []))


def main(arguments: list[str] | None = None) -> int:
    """Command line; returns the exit code: 1 where a test fails, or where no setting makes a difference."""
    parser = argparse.ArgumentParser(description="Tests under the arithmetic of other processors.")
    parser.add_argument("--all", action="store_true", help=f"all of {', '.join(ALL)}, not only what iterates")
    parser.add_argument("pytest", nargs="*", help="what pytest is given in place of the tests; after --")
    given = parser.parse_args(arguments)
    kernels, here = probed(os.environ)
    extensions, able = here["numpy"], flags()
    print(f"this machine: OpenBLAS {', '.join(kernels)}; numpy {', '.join(map(str, extensions))}", flush=True)
    failed, tried = [], set[str]()
    for setting in SETTINGS:
        if setting.flag and setting.flag not in able:
            print(f"{setting.name}: left out, the processor has no {setting.flag}", flush=True)
            continue
        environment = setting.environment([str(name) for name in extensions])
        found, there = probed(environment)
        if found == kernels and not (setting.old or setting.last_bit):
            print(f"{setting.name}: left out, it is what this machine takes anyway", flush=True)
            continue
        tried |= set(found)
        print(
            f"{setting.name}: OpenBLAS {', '.join(found)}; "
            f"numpy's functions {differing(here['functions'], there['functions'])}"
            f"{', last bits off' if setting.last_bit else ''}; libm {differing(here['libm'], there['libm'])}",
            flush=True,
        )
        plugin = ["-p", "last_bit"] if setting.last_bit else []
        environment["PYTHONPATH"] = os.pathsep.join(filter(None, [str(HERE), os.environ.get("PYTHONPATH", "")]))
        tests = given.pytest or [str(TESTS / place) for place in (ALL if given.all else setting.tests)]
        begun = time.perf_counter()
        spread = ["-n", "auto", "--dist", "loadfile", "-p", "no:cacheprovider", "--durations=5"]
        which = [] if given.all or given.pytest else ["-m", "not statistics"]
        command = [sys.executable, "-m", "pytest", "-q", *spread, *plugin, *which, *tests]
        done = subprocess.run(command, env=environment, check=False)
        print(f"{setting.name}: {time.perf_counter() - begun:.0f} s", flush=True)
        if done.returncode:
            failed.append(setting.name)
    if not tried - set(kernels):
        print("OpenBLAS took the machine's own kernel every time: nothing was tried")
        return 1
    print(f"failed: {', '.join(failed)}" if failed else "the same verdict under each")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
