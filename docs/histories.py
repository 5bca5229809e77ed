"""Writes scenarios/histories/*.csv: what feedsim identify friction makes of logs of a synthetic machine over months.

    python docs/histories.py            (some minutes)

Every date is a pair of simulated logs (constant speeds, sines) with the friction of that date, and an identification of
it. How friction changes is written below. Nothing of it is measured.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from datetime import date, timedelta
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import feedsim as fs
from feedsim.files import sheets

ROOT = Path(__file__).resolve().parents[1] / "scenarios"
OUT = ROOT / "histories"
LOGS = ("identify_z_constant", "identify_z_sine")
FRICTION = {
    "sigma_0": 300.0,
    "sigma_1": 0.8,
    "sigma_2": 0.006,
    "F_C": 1.6,
    "F_S": 2.1,
    "v_s": 0.6,
    "F_log": 0.4,
    "W": 0.04,
    "gamma": 0.35,
}
UNITS = {
    "sigma_0": "N.m/rad",
    "sigma_1": "N.m.s/rad",
    "sigma_2": "N.m.s/rad",
    "F_C": "N.m",
    "F_S": "N.m",
    "v_s": "rad/s",
    "F_log": "N.m",
    "W": "rad",
    "gamma": "",
}
LOG = {"logging.noise.i_q": "0.05 A", "logging.quantisation.i_q": "1 mA", "logging.quantisation.x_a": "10 nm"}
SCATTER = 0.004  # of every value from record to record, besides what the log's noise makes
GREASE = 0.02  # 1/K, by which friction that rises with speed falls with temperature
ROOM = 22.0  # degC
NOTE = "Synthetic: identified from logs of a simulated machine, by docs/histories.py of the sources."


def identified(factors: Mapping[str, float], seed: int) -> list[tuple[str, str, str, str, str]]:
    """Quantity, value, unit, sigma, status of an identification of logs with that friction."""
    change = {
        f"machine.axes.Z.friction.{name}": f"{value * factors.get(name, 1.0):.9g} {UNITS[name]}".strip()
        for name, value in FRICTION.items()
    }
    with TemporaryDirectory() as folder:
        paths = []
        for k, log in enumerate(LOGS):
            run = fs.run(ROOT / f"{log}.yaml", set={**change, **LOG, "logging.seed": 2 * seed + k})
            run.save(f"{folder}/{log}")
            paths.append(f"{folder}/{log}/log.csv")
        found = fs.identify_friction(paths, axes="Z", machine=ROOT / "machines/test_centre")
    return [
        (f"Z.{name}", f"{one.value:.6g}", one.unit, f"{one.sigma:.3g}" if math.isfinite(one.sigma) else "", one.status)
        for name, one in found.estimates.items()
        if one.status in ("estimated", "undetermined")
    ]


def scattered(random: np.random.Generator, factors: Mapping[str, float]) -> dict[str, float]:
    """Factors with the scatter of a record."""
    return {name: factors.get(name, 1.0) * float(np.exp(SCATTER * random.normal())) for name in FRICTION}


def write(name: str, about: str, heads: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """A list with a comment ahead."""
    text = sheets.text_of((heads, *rows))
    OUT.mkdir(exist_ok=True)
    (OUT / f"{name}.csv").write_text(f"# {about}\n# {NOTE}\n{text}", encoding="utf-8")


def months(name: str, about: str, seed: int, factors: Callable[[int], Mapping[str, float]]) -> None:
    """Twelve records, about a month apart, at the temperature of the day."""
    random = np.random.default_rng(seed)
    rows = []
    for month in range(12):
        day = date(2025, 1, 13) + timedelta(days=round(30.4 * month) + int(random.integers(-3, 4)))
        temperature = round(ROOM + 4 * math.sin(2 * math.pi * (month - 3) / 12) + random.normal(), 1)
        thin = math.exp(-GREASE * (temperature - ROOM))
        own = dict(factors(month))
        own |= {each: own.get(each, 1.0) * thin for each in ("F_log", "sigma_2")}
        for row in identified(scattered(random, own), 100 * seed + month):
            rows.append((str(day), *row, f"{temperature:.1f}"))
        print(name, day, flush=True)
    write(name, about, ("date", "quantity", "value", "unit", "sigma", "status", "temperature [degC]"), rows)


def wear(month: int) -> dict[str, float]:
    """Preload and with it friction falls by a tenth in a year; lubrication between the fifth and the sixth record."""
    left = 1 - 0.1 * month / 11
    grease = 1.0 if month < 5 else 0.75
    return {"F_C": left, "F_S": left, "F_log": grease, "sigma_2": grease}


def ball_screw(month: int) -> dict[str, float]:
    """Preload is lost between the eighth and the ninth record."""
    left = 1.0 if month < 8 else 0.62
    return {"F_C": left, "F_S": left, "sigma_0": left ** (1 / 3)}


def fleet() -> None:
    """Six machines of one kind, two records each."""
    random = np.random.default_rng(5)
    rows = []
    for k in range(6):
        preload, grease = (float(np.exp(deviation * random.normal())) for deviation in (0.1, 0.2))
        own = {
            "F_C": preload,
            "F_S": preload,
            "F_log": grease,
            "sigma_2": grease,
            **{name: float(np.exp(0.06 * random.normal())) for name in ("sigma_0", "v_s", "W", "gamma")},
        }
        for record in range(2):
            day = date(2025, 3, 3) + timedelta(days=7 * k + 90 * record)
            for row in identified(scattered(random, own), 900 + 2 * k + record):
                rows.append((str(day), f"machine {k + 1}", *row))
            print("fleet", k + 1, day, flush=True)
    about = "Friction of Z of six machines of one kind, two records each."
    write("fleet", about, ("date", "machine", "quantity", "value", "unit", "sigma", "status"), rows)


if __name__ == "__main__":
    months(
        "z_wear",
        "Friction of Z over twelve months: wear takes a tenth, and the axis is lubricated in month 5.",
        1,
        wear,
    )
    months(
        "ball_screw", "Friction of Z over twelve months: the ball screw loses its preload in month 9.", 2, ball_screw
    )
    fleet()
