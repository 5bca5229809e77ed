"""Where a checkout has what archives are made from."""

from pathlib import Path

from .errors import InputError

PROJECT = Path(__file__).resolve().parents[3]
SOURCES = PROJECT / "src"
SHELL = SOURCES / "fmi2"
STANDARD = SHELL / "standard"  # the headers of FMI 2.0
REFERENCES = PROJECT / "tests" / "reference"
DEFAULT_MODES = PROJECT / "scenarios" / "machines" / "test_centre" / "modes.csv"


def check_there(command: str) -> None:
    """Raise InputError where there are no sources, as in an installed package."""
    if not SHELL.is_dir():
        raise InputError(
            f"{command} is of C sources, which an installed feedsim does not have; a checkout or the source archive has"
            " them. repack puts other machines and motions into an archive without"
        )


def unit_folders() -> list[Path]:
    """Folders of the units, by their names."""
    return sorted(SOURCES.glob("*_fmu"))
