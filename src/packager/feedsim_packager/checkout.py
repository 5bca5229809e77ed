"""Where a checkout has what archives are made from."""

from pathlib import Path

PROJECT = Path(__file__).resolve().parents[3]
SOURCES = PROJECT / "src"
SHELL = SOURCES / "fmi2"
STANDARD = SHELL / "standard"  # the headers of FMI 2.0
LOOP = SOURCES / "exchange"  # the native cycle loop
REFERENCES = PROJECT / "tests" / "reference"
DEFAULT_MODES = PROJECT / "scenarios" / "machines" / "test_centre" / "modes.csv"


def unit_folders() -> list[Path]:
    """Folders of the units, by their names."""
    return sorted(SOURCES.glob("*_fmu"))
