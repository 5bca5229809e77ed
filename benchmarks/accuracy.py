"""What accuracy costs: the error of every coupling scheme over its exchange step, against the time that it takes.

The truth is the monolithic reference of the tests: continuous plant and friction in one system of equations, without
FMI, integrated by Runge-Kutta steps of 1.25 us (its own error is told beside). Errors are over all axes and instants at
the control cycle: one turn of the circle with its reversals, and the Z positioning move. Time is that of the native
loop, schemes and steps taking turns.
"""

from __future__ import annotations

import statistics
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from harness import ROOT, Contestant, Costs, arguments, digits, measure, progress, table

import numpy as np
from fits import exponent

from feedsim import scenario
from feedsim.scenario.model import SCHEMES
from feedsim.simulation import cosim, nc

sys.path.insert(0, str(ROOT / "tests"))
from reference import monolithic

SUBSTEPS: tuple[int, ...] = (1, 2, 3, 4, 6, 8)
SHOWN: tuple[int, ...] = (1, 2, 4, 8)  # in the table
DEFAULT = "extrapolated"
STEP = 1.25e-6  # s, of the reference
MOTIONS = {
    "circle": """
  - {kind: circle, plane: [X, Z], radius: 15 mm, feed: 3000 mm/min, turns: 1}
  - {kind: dwell, duration: 0.1 s}""",
    "Z move": """
  - {kind: move, by: {Z: 100 mm}, feed: 5000 mm/min}
  - {kind: dwell, duration: 0.5 s}""",
}
SHORT_MOTIONS = {
    "circle": """
  - {kind: circle, plane: [X, Z], radius: 50 um, feed: 3 m/min, turns: 1}""",
    "Z move": """
  - {kind: move, by: {Z: 50 um}, feed: 3 m/min}""",
}
HELD_TORQUE = "parallel"  # its error does not vanish with the exchange step


@dataclass(frozen=True)
class Error:
    """Over all axes and instants: x_a [m], M_fr [N.m]."""

    x_a_max: float
    x_a_rms: float
    M_fr_max: float
    M_fr_rms: float

    @classmethod
    def between(cls, one: cosim.Run | dict[str, np.ndarray], other: dict[str, np.ndarray], axes: list[str]) -> Error:
        signals = one.trace if isinstance(one, cosim.Run) else one
        found = []
        for signal in ("x_a", "M_fr"):
            off = [signals[f"{axis}.{signal}"] - other[f"{axis}.{signal}"] for axis in axes]
            # the rms of the axis that is worst: an axis that stands would dilute a common one
            found += [max(float(np.abs(d).max()) for d in off), max(float(np.sqrt(np.mean(d**2))) for d in off)]
        return cls(*found)


@dataclass(frozen=True)
class Case:
    """A motion with its program and reference."""

    name: str
    file: Path
    program: nc.Program
    expected: dict[str, np.ndarray]
    own_error: Error  # of the reference: what halving its step changes

    def run(self, scheme: str, m: int, interval: str) -> cosim.Run:
        changes = [f"coupling.scheme={scheme}", f"coupling.substeps={m}", f"recording.interval={interval}"]
        return cosim.run(scenario.load(self.file, changes), program=self.program, native=True)

    def error(self, scheme: str, m: int) -> Error:
        run = self.run(scheme, m, "125 us")
        return Error.between(run, self.expected, list(run.scenario.machine.axes))

    def seconds_per_second(self, scheme: str, m: int) -> float:
        """Wall time of the cycle loop per simulated second, recording every millisecond."""
        return self.run(scheme, m, "1 ms").cpu_time / float(self.program.time[-1])


def cases(folder: Path) -> list[Case]:
    found = []
    for name, motions in MOTIONS.items():
        progress(f"reference: {name}")
        file = folder / f"{name}.yaml"
        machine = ROOT / "scenarios" / "machines" / "test_centre"
        file.write_text(f"name: {name}\nmachine: {machine}\nmotions:{motions}\n", encoding="utf-8")
        loaded = scenario.load(file)
        program = nc.plan(loaded)
        duration = float(program.time[-1])
        setpoints = monolithic.Setpoints(program.x_s, program.n_ffw, duration=duration)
        coarse, fine = (
            monolithic.simulate(monolithic.machine(), setpoints, duration=duration, step=step)
            for step in (2 * STEP, STEP)
        )
        found.append(Case(name, file, program, fine, Error.between(coarse, fine, list(loaded.machine.axes))))
    return found


def label(scheme: str, m: int) -> str:
    return f"{scheme}, {m}"


def order(errors: dict[str, Error], scheme: str, what: str) -> float:
    """Fitted over all steps T_c/m."""
    return -exponent(SUBSTEPS, [getattr(errors[label(scheme, m)], what) for m in SUBSTEPS])


def text(errors: dict[str, dict[str, Error]], costs: Costs) -> str:
    """A row per scheme and number of exchange steps."""
    rows = []
    baseline = label(DEFAULT, 1)
    for scheme in SCHEMES:
        for m in SHOWN:
            circle, move = (errors[name][label(scheme, m)] for name in MOTIONS)
            name = label(scheme, m)
            rows.append(
                [
                    f"`{scheme}`{' (default)' if scheme == DEFAULT else ''}" if m == SHOWN[0] else "", m,
                    *(digits(1e9 * value, 2) for value in (circle.x_a_max, circle.x_a_rms)),
                    *(digits(1e3 * value, 2) for value in (circle.M_fr_max, circle.M_fr_rms)),
                    digits(1e9 * move.x_a_max, 2), digits(1e3 * move.M_fr_max, 2),
                    f"{digits(1e3 * costs.median(name), 2)} ms", costs.ratio_text(name, baseline),
                ]
            )  # fmt: skip
    header = ["scheme", "m", "circle: x_a max nm", "rms nm", "M_fr max mN.m", "rms mN.m"]
    header += ["Z move: x_a max nm", "M_fr max mN.m", "time per simulated second", "of the default"]
    return table(header, rows)


def plots(errors: dict[str, Error], costs: Costs, directory: Path) -> None:
    """Errors of the circle over time and over the exchange step."""
    from drawings import Curve, Panel, write_svg

    by_cost, by_step = [], []
    for what, scale, said in (
        ("x_a_max", 1e9, "largest error of x_a [nm]"), ("M_fr_max", 1e3, "largest error of M_fr [mN.m]"),
    ):  # fmt: skip
        costly, fitted = [], []
        for scheme in SCHEMES:
            values = [scale * getattr(errors[label(scheme, m)], what) for m in SUBSTEPS]
            times = [1e3 * costs.median(label(scheme, m)) for m in SUBSTEPS]
            # Numbers beside one curve: the others have theirs in the same order, and would stand on each other.
            marked = scheme == DEFAULT
            labels = [f"{m}" if marked and m in SHOWN else "" for m in SUBSTEPS]
            name = f"{scheme} (ring: default; numbers: m)" if marked else scheme
            costly.append(Curve(name, times, values, labels, ring=SUBSTEPS.index(1) if marked else None))
            # One whose error does not vanish has no order.
            name = scheme if scheme == HELD_TORQUE else f"{scheme}: order {order(errors, scheme, what):.2f}"
            fitted.append(Curve(name, [125 / m for m in SUBSTEPS], values))
        level = (1.0, "1 nm") if what == "x_a_max" else None
        time = "time per simulated second [ms]"
        by_cost.append(
            Panel("circle, 1 to 8 exchange steps per cycle", time, said, costly, (5, 10, 20, 50, 100), level=level)
        )
        by_step.append(Panel("circle", "exchange step [us]", said, fitted, (15.625, 31.25, 62.5, 125), level=level))
    for name, panels in (("accuracy-cost", by_cost), ("accuracy-order", by_step)):
        print(f"{write_svg(name, panels, directory)} written", file=sys.stderr)


def orders_table(orders: dict[str, dict[str, float]]) -> str:
    return table(
        ["order of", "x_a max", "x_a rms", "M_fr max", "M_fr rms"],
        [[f"`{scheme}`", *(f"{value:.2f}" for value in found.values())] for scheme, found in orders.items()],
    )


def main(words: Sequence[str] | None = None) -> int:
    global SUBSTEPS, SHOWN, MOTIONS
    bench = arguments("accuracy", __doc__, words, rounds=7, images=True)
    if bench.short:
        SUBSTEPS = SHOWN = (1, 2)
        MOTIONS = SHORT_MOTIONS
    with TemporaryDirectory(prefix="feedsim-bench-") as folder:
        driven = cases(Path(folder))
        errors: dict[str, dict[str, Error]] = {case.name: {} for case in driven}
        for case in driven:
            for scheme in SCHEMES:
                for m in SUBSTEPS:
                    progress(f"error: {case.name}, {scheme}, {m}")
                    errors[case.name][label(scheme, m)] = case.error(scheme, m)
        circle = driven[0]
        contestants = [
            Contestant(label(scheme, m), lambda scheme=scheme, m=m: circle.seconds_per_second(scheme, m))
            for scheme in SCHEMES
            for m in SUBSTEPS
        ]
        costs = measure(contestants, bench.rounds, title="time")
    orders = {
        scheme: {what: order(errors["circle"], scheme, what) for what in asdict(circle.own_error)} for scheme in SCHEMES
    }
    own = [
        f"Reference of the {case.name}: x_a to {1e9 * case.own_error.x_a_max:.0e} nm, M_fr to "
        f"{1e3 * case.own_error.M_fr_max:.0e} mN.m."
        for case in driven
    ]
    bench.tell(
        "\n\n".join((text(errors, costs), orders_table(orders), *own)),
        {
            "errors": {case: {name: asdict(error) for name, error in found.items()} for case, found in errors.items()},
            "reference": {case.name: asdict(case.own_error) for case in driven},
            "orders": orders,
            "seconds per simulated second": costs.as_json(label(DEFAULT, 1)),
            "spread": statistics.median(max(costs.values(n)) / costs.shortest(n) for n in costs.costs),
        },
    )
    plots(errors["circle"], costs, bench.images)
    return 0


if __name__ == "__main__":
    sys.exit(main())
