"""What tests of several areas share."""

import os
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import HealthCheck, settings

# Threads wait for one another over small matrices: the command, the Makefile and the benchmarks do the same. Before
# numpy is loaded.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

if TYPE_CHECKING:
    from feedsim.simulation.cosim.friction_law import FrictionLaw
    from pint_registry import Registry

ROOT = Path(__file__).resolve().parent.parent
UNITS = ("plant", "controller", "friction", "friction_gms", "setpoint", "machine")

# What a test computes, no earlier run has computed for it.
os.environ["FEEDSIM_CACHE"] = ""

# How long an example takes is no verdict, nor how long it takes to be made up.
settings.register_profile("feedsim", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("feedsim")

# A shell's job in the background ignores Ctrl-C, one behind nohup SIGHUP, and so would all that is started here.
for number, handler in ((signal.SIGINT, signal.default_int_handler), (getattr(signal, "SIGHUP", None), signal.SIG_DFL)):
    if number is not None and signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, handler)


@pytest.fixture(autouse=True)
def handlers_of_signals() -> Iterator[None]:
    """They are after a test what they were before: one that ends a block at any line may leave another one."""
    numbers = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
    before = {number: signal.getsignal(number) for number in numbers}
    yield
    for number, handler in before.items():
        if handler is not None:
            signal.signal(number, handler)


def _inputs() -> list[Path]:
    """Everything the archives are made from."""
    modes = ROOT / "scenarios" / "machines" / "test_centre" / "modes.csv"
    references = ROOT / "tests" / "reference"
    folders = [
        ROOT / "src" / "fmi2",
        ROOT / "src" / "packager",
        *(ROOT / "src" / f"{unit}_fmu" for unit in UNITS),
        *(references / u for u in UNITS),
    ]
    kept = (".c", ".h", ".def", ".py", ".md", ".csv", ".svg", ".png", ".opt", ".yaml")
    sources = [path for folder in folders for path in folder.rglob("*") if path.suffix in kept]
    return [modes, ROOT / "pyproject.toml", ROOT / "LICENSE", *sources]


def _up_to_date(archives: list[Path]) -> bool:
    if not all(path.is_file() for path in archives):
        return False
    built = min(path.stat().st_mtime for path in archives)
    return all(path.stat().st_mtime <= built for path in _inputs() if path.is_file())


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """Chromium, which the tests of a file share."""
    import page_browsers

    with page_browsers.chromium() as started:
        yield started


@pytest.fixture(scope="session")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with the archives of all UNITS.

    The one that the environment variable FEEDSIM_FMUS names, else fmus/ where it is newer than its sources, else built
    for this session.
    """
    if given := os.environ.get("FEEDSIM_FMUS"):
        folder = Path(given).resolve()
        missing = [unit for unit in UNITS if not (folder / f"{unit}.fmu").is_file()]
        if missing:
            pytest.fail(f"FEEDSIM_FMUS={given} has no archive of {', '.join(missing)}")
        return folder
    folder = ROOT / "fmus"
    if _up_to_date([folder / f"{unit}.fmu" for unit in UNITS]):
        return folder

    from feedsim_packager import build, native, toolchain

    folder = tmp_path_factory.mktemp("fmus")
    compiler = toolchain.find_compiler()
    for unit in UNITS:
        build.build(build.load(build.unit_directory(unit), compiler), folder / f"{unit}.fmu", compiler)
    for name in native.LIBRARIES:
        native.build(name, folder, compiler)
    return folder


@pytest.fixture(scope="module")
def law(fmus: Path) -> Iterator["FrictionLaw"]:
    """The friction law of the shipped unit, LuGre with the transmission engaging model."""
    from feedsim.simulation.cosim.friction_law import FrictionLaw

    with FrictionLaw(fmus) as opened:
        yield opened


@pytest.fixture(scope="session")
def registry(tmp_path_factory: pytest.TempPathFactory) -> "Registry":
    """pint, with the angle as a dimension."""
    from pint_registry import Registry

    return Registry(tmp_path_factory.mktemp("pint"))
