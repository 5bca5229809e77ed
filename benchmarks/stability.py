"""How much contact damping a coupling scheme carries: where the exchange of plant and friction leaves the stable range.

The default machine's Z axis goes there and back by 2 mm. A scheme has left the range where its friction torque is off
by more than 2 F_S, all that a reversal can change, from the same motion with 32 exchange steps per cycle.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from harness import ROOT, arguments, digits, progress, table

import numpy as np

from feedsim import scenario
from feedsim.scenario.model import SCHEMES
from feedsim.simulation import cosim
from feedsim.structure import checked_modes

MOTIONS = """
name: there and back
machine: {machine}
motions:
  - {{kind: move, by: {{Z: 2 mm}}, feed: 3000 mm/min}}
  - {{kind: move, by: {{Z: -2 mm}}, feed: 3000 mm/min}}
  - {{kind: dwell, duration: 0.1 s}}
recording: {{interval: 125 us, variables: [Z.M_fr]}}
"""
FINE = 32
CLOSE = 0.5  # N.m.s/rad, how close a limit is told


def limit(file: Path, scheme: str, least: float, most: float, close: float) -> float:
    """Largest sigma_1 [N.m.s/rad] with which `scheme` is stable, between `least` and `most`."""

    def torque(sigma_1: float, name: str, substeps: int) -> np.ndarray:
        changes = [f"machine.axes.Z.friction.sigma_1={sigma_1!r} N.m.s/rad"]
        changes += [f"coupling.scheme={name}", f"coupling.substeps={substeps}"]
        run = cosim.run(scenario.load(file, changes))
        return np.asarray(run.trace["Z.M_fr"])

    F_S = scenario.load(file).machine.axes["Z"].friction.F_S
    while most - least > close:
        progress(f"{scheme}: between {least:.3g} and {most:.3g}")
        sigma_1 = (least + most) / 2
        off = np.abs(torque(sigma_1, scheme, 1) - torque(sigma_1, "extrapolated", FINE)).max()
        least, most = (least, sigma_1) if off > 2 * F_S else (sigma_1, most)
    return least


def main(given: Sequence[str] | None = None) -> int:
    bench = arguments("stability", __doc__, given, only=tuple(SCHEMES))
    with TemporaryDirectory() as folder:
        file = Path(folder) / "scenario.yaml"
        file.write_text(MOTIONS.format(machine=ROOT / "scenarios" / "machines" / "test_centre"), encoding="utf-8")
        machine = scenario.load(file).machine
        bound = 2 * checked_modes(machine).J_inf("Z") / machine.cycles.T_c
        sigma_2 = machine.axes["Z"].friction.sigma_2
        derived = {name: SCHEMES[name].stable_share * bound - sigma_2 for name in bench.only}
        found = {
            name: limit(file, name, 0.5 * value, 2 * value, 100 * CLOSE if bench.short else CLOSE)
            for name, value in derived.items()
        }
    progress("")
    header = ["scheme", "share of 2 J_inf/h", "sigma_1 derived", "sigma_1 measured"]
    rows = [
        [f"`{name}`", f"{SCHEMES[name].stable_share:g}", digits(derived[name], 2), digits(found[name], 2)]
        for name in bench.only
    ]
    text = f"Z axis, 2 J_inf/h = {digits(bound)} N.m.s/rad; sigma_1 in N.m.s/rad.\n\n{table(header, rows)}"
    bench.tell(text, {"2 J_inf/h": bound, "derived": derived, "measured": found})
    return 0


if __name__ == "__main__":
    sys.exit(main())
