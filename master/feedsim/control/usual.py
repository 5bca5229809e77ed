"""What values of feed axes usually are: a value far outside is read in a wrong unit, more often than it is true."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

RANGES_FILE = Path(__file__).with_name("usual.csv")


@dataclass(frozen=True)
class Usual:
    """A range, both ends included. unit: SI, of both ends; "" of a count."""

    low: float
    high: float
    unit: str

    def holds(self, value: float) -> bool:
        """Whether a value lies within; ends are not exact, and neither is the comparison."""
        return self.low * (1 - 1e-9) <= value <= self.high * (1 + 1e-9)


@cache
def usual_ranges() -> Mapping[str, Usual]:
    """Our parameter -> what it usually is. The ranges are judgement, from axes of tens of grams to tens of tonnes."""
    with RANGES_FILE.open(encoding="utf-8", newline="") as file:
        return {
            row["parameter"]: Usual(float(row["low"]), float(row["high"]), row["unit"]) for row in csv.DictReader(file)
        }
