"""Friction laws compared, in and out of sample: Coulomb, Stribeck, LuGre, generalised Maxwell slip (GMS).

Every law is fitted to one part of what there is of an axis, and judged by the torque of the other part, which no fit
has seen. LuGre and Maxwell slip are identified as feedsim does it; Coulomb and Stribeck are functions of the
speed, fitted by least squares with the inertia and the delay that LuGre's fit has.

    make friction-laws                                       simulated axes; measured ones where these are named:
    FEEDSIM_EMPS=DATA_EMPS.mat FEEDSIM_CAPTURE=capture.json make friction-laws
    python benchmarks/friction_laws.py TRACE.csv --axes Z --machine MACHINE [--columns MAPPING.yaml]
                                                             a record of your own: fitted to its first half
    make friction-laws ARGS='--intervals 60'                 whether intervals of Maxwell slip hold the truth, on so
                                                             many drawn axes (gms_intervals.py; ten seconds of one core
                                                             an axis); what is in build/friction-laws is not drawn again

Prints the table; `make friction-laws` writes its summary into docs/trust.md.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command does, ahead of numpy

import gms_intervals
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

import feedsim
from feedsim.estimation.identify import AxisRequest, Options, Record, identify, read_traces
from feedsim.estimation.identify.motion import RecordTorque, motion
from feedsim.estimation.identify.parameters import torque as torque_over_speed
from feedsim.estimation.identify.read import RecordedAxis
from feedsim.estimation.identify.stages import with_structure
from feedsim.files.columns import load_columns
from feedsim.scenario import Friction, Machine, load_machine
from feedsim.scenario.roles import FRICTION_ROLE, FRICTION_UNITS, GMS
from feedsim.simulation.cosim.friction_law import FrictionLaw

Array = NDArray[np.float64]
ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "trust.md"
MACHINES = ROOT / "scenarios" / "machines"
LAWS = {"LuGre": (Friction.law, FRICTION_ROLE.shipped), "GMS": (GMS, FRICTION_UNITS[GMS])}
MOVES = 0.01  # of the highest speed: above, an axis moves
SLOW = 0.05  # of the highest speed: below, a row is slow
STATES = [(z, c) for z in (-1.0, -0.5, 0.0, 0.5, 1.0) for c in (-0.5, 0.0, 0.5)]  # shares, tried at a record's begin
NOISE = "logging.noise.i_q=1 %"
TRUE_GMS = (
    "{law: gms, sigma_0: 300 N.m/rad, sigma_1: 0.8 N.m.s/rad, sigma_2: 0.006 N.m.s/rad, F_C: 1.6 N.m, F_S: 2.1 N.m, "
    "v_s: 0.6 rad/s, F_log: 0.4 N.m, spread: 35, skew: 0.4}"
)


@dataclass(frozen=True, eq=False)
class Case:
    """Records of an axis to fit to and to judge by, and what is known of the axis."""

    name: str
    fitted: Sequence[Record]
    judged: Sequence[Record]
    options: Callable[[str], Options]  # of a law


@dataclass(frozen=True)
class Row:
    """Of a law on a case: residual rms of the torque over its own, in sample, out of sample, and of its slow rows."""

    case: str
    law: str
    parameters: int
    inside: float
    outside: float
    slow: float


def _options(law: str, axis: str | None, recorded: Sequence[RecordedAxis], machine: Machine | None) -> Options:
    """Without the friction of the machine file, which may be identified from what is judged."""
    known = AxisRequest(axis=axis, law=law).with_traces([each.provenance for each in recorded], machine)
    return replace(known, fallback={})


def halves(name: str, recorded: Sequence[RecordedAxis], machine: Machine | None, axis: str) -> Case:
    """A case that is fitted to the first half of what moves in each record, and judged by the rest."""
    records = [record for each in recorded for record in each.records]
    cuts = []
    for record in records:
        speed = np.abs(motion(record).coarse())
        moving = np.cumsum(speed > MOVES * np.max(speed))
        cuts.append(int(np.searchsorted(moving, moving[-1] / 2)))
    return Case(
        name,
        [record.between(0, at) for record, at in zip(records, cuts, strict=True)],
        [record.between(at, len(record)) for record, at in zip(records, cuts, strict=True)],
        lambda law: _options(law, axis, recorded, machine),
    )


def measured(axes: Sequence[str] = "XY") -> Iterator[Case]:
    """The published EMPS record and the capture of a machining centre, where the environment names them."""
    if path := os.environ.get("FEEDSIM_EMPS"):
        machine = load_machine(MACHINES / "emps")
        read = read_traces([Path(path)], load_columns(MACHINES / "emps" / "columns.yaml"), "X", machine)
        yield halves("EMPS, measured", read, machine, "X")
    if path := os.environ.get("FEEDSIM_CAPTURE"):
        machine = load_machine(MACHINES / "sinumerik_840d")
        for axis in axes:
            read = read_traces([Path(path)], None, axis, machine)
            yield halves(f"840D {axis}, measured", read, machine, axis)


def simulated(folder: Path, fmus: Path | None) -> Iterator[Case]:
    """Axis Z of the synthetic default machine by both laws: strokes and sines are fitted, a circle is judged."""
    machine = load_machine(MACHINES / "test_centre")
    for name, friction in (("LuGre", ()), ("GMS", (f"machine.axes.Z.friction={TRUE_GMS}",))):
        logs = {}
        for scenario in ("identify_z_constant", "identify_z_sine", "xz_circle"):
            out = folder / name / scenario
            logged = ("logging.interval=2 ms",) if scenario == "xz_circle" else ()
            feedsim.run(ROOT / "scenarios" / f"{scenario}.yaml", set=[*friction, *logged, NOISE], fmus=fmus, out=out)
            logs[scenario] = out / "log.csv"
        read = read_traces([logs["identify_z_constant"], logs["identify_z_sine"]], None, "Z", machine)
        circle = read_traces([logs["xz_circle"]], None, "Z", machine)
        yield Case(
            f"Z, simulated by {name}",
            [record for each in read for record in each.records],
            [record for each in circle for record in each.records],
            lambda law, read=read: _options(law, "Z", read, machine),
        )


def rows_of(case: Case, fmus: Path | None) -> Iterator[Row]:
    """Coulomb, Stribeck, LuGre and GMS on a case."""
    found: list[Row] = []
    with_lugre: Mapping[str, float] = {}
    for name, (law_name, unit) in LAWS.items():
        with FrictionLaw(fmus, unit) as law:
            options = case.options(law_name)
            result = identify(case.fitted, law, options)
            values = {**{n: each.value for n, each in result.estimates.items()}}
            values.setdefault("delay", 0.0)
            estimated = sum(each.status == "estimated" for each in result.estimates.values())
            sides = []
            for records in (case.fitted, case.judged):
                models = [RecordTorque(_seen(record, options), law) for record in records]
                sides.append(_shares(models, [_best(model, values) for model in models if len(model.rows)]))
            found.append(Row(case.name, name, estimated, sides[0][0], sides[1][0], sides[1][1]))
            if name == "LuGre":
                with_lugre = values
                inside, outside = (
                    [RecordTorque(_seen(record, options), law) for record in records]
                    for records in (case.fitted, case.judged)
                )
                statics = [
                    _static(case.name, kind, inside, outside, with_lugre, free_inertia=options.J is None)
                    for kind in ("Coulomb", "Stribeck")
                ]
    yield from (*statics, *found)


def _seen(record: Record, options: Options) -> Record:
    """With what the machine's structure takes of the torque, as identification takes it off."""
    return record if options.modes is None else with_structure(record, options.modes, options.axes)


def _best(model: RecordTorque, values: Mapping[str, float]) -> Array:
    """(rows,) residual [N.m] with the first state, which no record tells, that fits best."""
    return min((model.residual(values, z, c) for z, c in STATES), key=lambda residual: float(np.sum(residual**2)))


def _shares(models: Sequence[RecordTorque], residuals: Sequence[Array]) -> tuple[float, float]:
    """Residual rms over the torque's, of all rows and of slow ones."""
    models = [model for model in models if len(model.rows)]
    residual = np.concatenate(residuals)
    measured = np.concatenate([model.measured for model in models])
    speed = np.abs(np.concatenate([model.moved(0.0)[1] for model in models]))
    slow = speed < SLOW * np.max(speed)
    whole = float(np.sqrt(np.mean(measured**2)))
    return tuple(float(np.sqrt(np.mean(each**2))) / whole for each in (residual, residual[slow]))  # type: ignore[return-value]


def _static(
    case: str,
    kind: str,
    inside: Sequence[RecordTorque],
    outside: Sequence[RecordTorque],
    start: Mapping[str, float],
    *,
    free_inertia: bool,
) -> Row:
    """A torque that is a function of the speed: F_C and sigma_2, with Stribeck F_S, v_s and F_log too."""
    names = ["F_C", "sigma_2", "M_0", *(["excess", "v_s", "F_log"] if kind == "Stribeck" else [])]
    names += ["J"] if free_inertia else []
    scale = {
        **{name: start["F_C"] for name in ("F_C", "M_0", "excess", "F_log")},
        "sigma_2": max(start["sigma_2"], 1e-3 * start["F_C"]), "v_s": start["v_s"], "J": start["J"],
    }  # fmt: skip
    begin = {**start, "excess": 0.1 * start["F_C"], "F_log": 0.1 * start["F_C"]}

    def residuals(models: Sequence[RecordTorque], x: Array) -> list[Array]:
        moved = dict(zip(names, x * [scale[name] for name in names], strict=True))
        values = {**start, "F_S": moved["F_C"] + moved.get("excess", 0.0), "F_log": 0.0, "asymmetry": 0.0, **moved}
        values["F_S"] = values["F_C"] + moved.get("excess", 0.0)
        found = []
        for model in models:
            if len(model.rows):
                _, speed, acceleration, load = model.moved(start["delay"])
                found.append(torque_over_speed(values, speed) + values["J"] * acceleration + load - model.measured)
        return found

    low = [0.05 if name == "v_s" else -np.inf if name == "M_0" else 0.0 for name in names]
    fit = least_squares(
        lambda x: np.concatenate(residuals(inside, x)),
        [max(begin[name] / scale[name], 1e-3 if name != "M_0" else -np.inf) for name in names],
        bounds=(low, [20.0 if name == "v_s" else np.inf for name in names]),
        x_scale="jac",
    )
    first, second = (_shares(models, residuals(models, fit.x)) for models in (inside, outside))
    return Row(case, kind, len(names), first[0], second[0], second[1])


def table(rows: Sequence[Row]) -> str:
    """As Markdown, the smallest residual out of sample of each record in bold."""
    lines = [
        "| record | law | parameters | in sample | out of sample | of slow rows |",
        "|---|---|---|---|---|---|",
    ]
    for row in rows:
        best = min(each.outside for each in rows if each.case == row.case) == row.outside
        outside = f"{100 * row.outside:.2f} %"
        lines.append(
            f"| {row.case} | {row.law} | {row.parameters} | {100 * row.inside:.2f} % | "
            f"{f'**{outside}**' if best else outside} | {100 * row.slow:.2f} % |"
        )
    return "\n".join(lines)


def summary(rows: Sequence[Row]) -> str:
    """A line per record: of each law what is left out of sample, and of its slow rows, in %; the least in bold."""
    laws = list(dict.fromkeys(row.law for row in rows))
    lines = [f"| record | {' | '.join(laws)} |", f"|---|{'---|' * len(laws)}"]
    for case in dict.fromkeys(row.case for row in rows):
        own = [row for row in rows if row.case == case]
        best = min(row.outside for row in own)
        cells = [f"{100 * row.outside:.2f}, {100 * row.slow:.2f}" for row in own]
        cells = [f"**{cell}**" if row.outside == best else cell for row, cell in zip(own, cells, strict=True)]
        lines.append(f"| {case} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _page(name: str) -> tuple[str, str, str]:
    """The page up to its table of that name, the table, and what follows it."""
    begin, end = f"<!-- {name}: begin -->", f"<!-- {name}: end -->"
    head, _, rest = PAGE.read_text(encoding="utf-8").partition(begin)
    before, _, rest = rest.partition(end)
    return f"{head}{begin}", before, f"{end}{rest}"


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description="Compare friction laws in and out of sample.")
    parser.add_argument(
        "traces", nargs="*", type=Path, metavar="TRACE", help="records of one axis; default: the page's"
    )
    parser.add_argument("--axes", help="axis of the records")
    parser.add_argument("--machine", type=Path, help="machine that gives pitch, torque constant and inertia")
    parser.add_argument("--columns", type=Path, help="which columns of the records are what")
    parser.add_argument("--fmus", type=Path, help="folder of the archives")
    parser.add_argument("--write", action="store_true", help=f"write the table into {PAGE.relative_to(ROOT)}")
    parser.add_argument("--intervals", type=int, metavar="AXES", help="judge intervals of Maxwell slip on drawn axes")
    parser.add_argument("--seed", type=int, default=1, help="of the drawn axes")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="processes of the drawn axes")
    parser.add_argument("--out", type=Path, default=Path("build/friction-laws"), help="folder of the drawn axes")
    options = parser.parse_args(arguments)
    if options.intervals:
        counted = gms_intervals.study(options.intervals, options.seed, options.jobs, options.out, options.fmus)
        shown = gms_intervals.table(counted)
        print("", shown, sep="\n")
        if options.write:
            head, _, rest = _page("intervals")
            PAGE.write_text(f"{head}\n\n{shown}\n\n{rest}", encoding="utf-8")
        return 0
    with TemporaryDirectory(prefix="friction-laws-") as folder:
        if options.traces:
            machine = load_machine(options.machine) if options.machine else None
            mapping = load_columns(options.columns) if options.columns else None
            read = read_traces(options.traces, mapping, options.axes, machine)
            cases: Iterator[Case] = iter([halves(options.traces[0].name, read, machine, options.axes)])
        else:
            cases = (case for source in (measured(), simulated(Path(folder), options.fmus)) for case in source)
        rows: list[Row] = []
        for case in cases:
            rows += rows_of(case, options.fmus)
            print(table([row for row in rows if row.case == case.name]), flush=True)
    if options.write:
        head, before, rest = _page("laws")
        own = {row.case for row in rows}
        kept = [line for line in before.strip().splitlines()[2:] if line.split("|")[1].strip() not in own]
        titles, line, *made = summary(rows).splitlines()
        whole = "\n".join([titles, line, *kept, *made])
        PAGE.write_text(f"{head}\n\n{whole}\n\n{rest}", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
