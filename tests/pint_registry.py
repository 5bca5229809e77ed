"""pint as an oracle for units of measurement."""

import re
import shutil
from pathlib import Path

import pint


class Registry:
    """pint's own definitions and none of ours, but for the angle, which is a dimension as FMI has it: pint takes a
    radian for the number 1, and 1 Hz for 1/s."""

    def __init__(self, folder: Path) -> None:
        shipped = Path(pint.__file__).parent
        text = (shipped / "default_en.txt").read_text(encoding="utf-8")
        for line, instead in (
            ("radian = []", "radian = [angle]"),
            ("hertz = 1 / second", "hertz = revolution / second"),
        ):
            assert text.count(line) == 1
            text = text.replace(line, instead)
        (folder / "units.txt").write_text(text, encoding="utf-8")
        shutil.copy(shipped / "constants_en.txt", folder)
        self.registry: pint.UnitRegistry[float] = pint.UnitRegistry(folder / "units.txt")

    def quantity(self, unit: str, value: float = 1.0) -> "pint.Quantity[float]":
        text = re.sub(r"(?<=[A-Za-z)])(?=\d)", "**", unit).replace(".", "*").replace("%", "percent")
        text = re.sub(r"\bNm\b", "N*m", text.replace("Ohm", "ohm").replace("^", "**"))
        text = re.sub(r"\brev\b", "revolution", text)
        return self.registry.Quantity(value, self.registry.parse_units(text) if text != "1" else "dimensionless")
