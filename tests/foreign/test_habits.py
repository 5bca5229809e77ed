"""What exporters do that the standard or an importer does not expect: the run is that of a unit without the habit, to
the last bit, and says what it met; as drive and as friction, wired and out of an SSP file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from feedsim import scenario
from feedsim.files.trace import Trace
from feedsim.foundation.errors import InputError, SimulationError
from feedsim.simulation import cosim, ssp
from foreign import acme
from foreign.conftest import Libraries
from foreign.test_foreign_units import MOTION, ROOT, mapped
from ssp_helpers import run_ssp

SLOPES = {"maxOutputDerivativeOrder": "1"}
# Durations of the dwell [ms] at which the last step, k T_c + T_c, ends behind, at and ahead of the sum's rounding.
DWELLS = (200, 201, 203)


@dataclass(frozen=True)
class Habit:
    """
    Attributes:
        says: what a run warns of.
        macro: what the programs are compiled with (shell.h).
        flags: attributes of the co-simulation element.
        edit: of the description.
        rounding: whether factors of units come from names, which round otherwise than the archive's definitions.
    """

    says: str = ""
    macro: str = ""
    flags: Mapping[str, str] = field(default_factory=dict)
    edit: Callable[[ET.Element], object] | None = None
    units: Mapping[str, Mapping[str, str]] = field(default_factory=lambda: acme.UNITS)
    separator: str = "/"
    rounding: bool = False


def every(tag: str, change: Callable[[ET.Element], object]) -> Callable[[ET.Element], None]:
    def edit(root: ET.Element) -> None:
        for element in root.iter(tag):
            change(element)

    return edit


def without_variability(root: ET.Element) -> None:
    for variable in root.iter("ScalarVariable"):
        del variable.attrib["variability"]


def with_a_mode(root: ET.Element) -> None:
    """An enumeration as input, which says nothing of its variability, and of another type than there is."""
    group = root.find("ModelVariables")
    assert group is not None
    for name, attributes in (("Mode", {"start": "1"}), ("Kind", {"declaredType": "Kinds", "start": "1"})):
        entry = ET.SubElement(group, "ScalarVariable", {"name": name, "valueReference": "0", "causality": "input"})
        ET.SubElement(entry, "Enumeration", attributes)


def with_what_nobody_knows(root: ET.Element) -> None:
    """Attributes and elements of a tool's own, and a display unit that is not defined."""
    root.set("fmiVersion", "2.0.3")
    root.set("exportedBy", "a tool")
    root.insert(0, ET.Element("Toolbox"))
    every("Real", lambda real: real.set("displayUnit", "furlong"))(root)
    every("CoSimulation", lambda element: element.set("canInterpolateInputs", "False"))(root)


def without_radians(root: ET.Element) -> None:
    for base in root.iter("BaseUnit"):
        base.attrib.pop("rad", None)


def twice(root: ET.Element) -> None:
    group = root.find("ModelVariables")
    assert group is not None
    group.append(group[0])


LOOSE = "modelDescription.xml is not what FMI 2.0 demands"
# Who has it: S Simulink, O OpenModelica, H Hopsan, D Dymola, 2 20-sim, . others.
HABITS = {
    "a stop time to the last bit (O)": Habit(macro="HABIT=1"),
    "a stop time by its own clock (.)": Habit(macro="HABIT=2"),
    "no slope before the second step (O)": Habit(
        "(friction of X): gave a slope that is not finite at 1 of its steps", macro="HABIT=3", flags=SLOPES
    ),
    "units that are not defined (H)": Habit(LOOSE, units={}, rounding=True),
    "units without a definition (S)": Habit(units={name: {} for name in acme.UNITS}, rounding=True),
    "units without radians (D)": Habit(edit=without_radians, rounding=True),
    "no variability (2)": Habit(LOOSE, edit=without_variability),
    "an enumeration without variability (H)": Habit(LOOSE, edit=with_a_mode),
    "no start values of inputs (S)": Habit(LOOSE, edit=every("Real", lambda real: real.attrib.pop("start", None))),
    "words of its own (.)": Habit(LOOSE, edit=with_what_nobody_knows),
    "no structure (.)": Habit(LOOSE, edit=lambda root: root.remove(root[-1])),
    "a variable twice (2)": Habit(LOOSE, edit=twice),
    "backslashes in the archive (.)": Habit(separator="\\"),
}


@pytest.fixture(scope="module")
def programs(tmp_path_factory: pytest.TempPathFactory, libraries: Libraries) -> Callable[[str], Libraries]:
    known = {"": libraries}
    folder = tmp_path_factory.mktemp("habits")

    def compiled(macro: str) -> Libraries:
        if macro not in known:
            known[macro] = Libraries(*(acme.compiled(folder, name, macro) for name in ("drive", "friction")))
        return known[macro]

    return compiled


def placed(folder: Path, habit: Habit, programs: Callable[[str], Libraries], dwell: int = 200) -> scenario.Scenario:
    """A scenario whose drive and friction have the habit."""
    libraries = programs(habit.macro)
    given: Any = {"flags": habit.flags, "edit": habit.edit, "units": habit.units, "separator": habit.separator}
    acme.archive(folder / "acme_drive.fmu", "drive", libraries.drive, acme.DRIVE, **given)
    acme.archive(folder / "acme_friction.fmu", "friction", libraries.friction, acme.FRICTION, **given)
    text = MOTION.format(machine=ROOT / "scenarios" / "machines" / "emps").replace("200 ms", f"{dwell} ms")
    settings = "".join(f"  {setting.replace('=', ': ', 1)}\n" for setting in mapped(folder))
    (folder / "s.yaml").write_text(f"{text}set:\n{settings}", encoding="utf-8")
    return scenario.load(folder / "s.yaml")


@pytest.fixture(scope="module")
def usual(tmp_path_factory: pytest.TempPathFactory, programs: Callable[[str], Libraries], fmus: Path) -> Trace:
    return cosim.run(placed(tmp_path_factory.mktemp("usual"), Habit(), programs), fmus=fmus).trace


def same(one: Trace, other: Trace, tolerance: float = 0.0) -> bool:
    """tolerance: of the largest value of a column."""
    return list(one) == list(other) and all(
        np.allclose(one[name], other[name], rtol=0, atol=tolerance * float(np.max(np.abs(other[name])))) for name in one
    )


@pytest.mark.parametrize("name", HABITS)
def test_wired_and_out_of_an_ssp(
    name: str, tmp_path: Path, programs: Callable[[str], Libraries], usual: Trace, fmus: Path
) -> None:
    loaded = placed(tmp_path, HABITS[name], programs)
    done = cosim.run(loaded, fmus=fmus)
    assert HABITS[name].says in "\n".join(map(str, done.notes))
    tolerance = 1e-12 if HABITS[name].rounding else 0.0  # some 500 cycles that round to 1.1e-16, in a loop that forgets
    assert same(done.trace, usual, tolerance)
    ssp.export(loaded, tmp_path / "s.ssp", fmus=fmus)
    assert same(run_ssp(tmp_path / "s.ssp").trace, usual, tolerance)


@pytest.mark.parametrize("native", [True, False])
@pytest.mark.parametrize("dwell", DWELLS)
def test_no_step_ends_behind_the_stop_time(
    dwell: int, native: bool, tmp_path: Path, programs: Callable[[str], Libraries], fmus: Path
) -> None:
    for macro in ("HABIT=1", "HABIT=2"):
        done = cosim.run(placed(tmp_path, Habit(macro=macro), programs, dwell), fmus=fmus, native=native)
        assert done.trace.time[-1] == pytest.approx(done.program.duration)


@pytest.mark.parametrize("native", [True, False])
def test_slopes_that_never_come(native: bool, tmp_path: Path, programs: Callable[[str], Libraries], fmus: Path) -> None:
    """The message names who gives none, and the schemes without; one of them runs."""
    loaded = placed(tmp_path, Habit(macro="HABIT=4", flags=SLOPES), programs)
    with pytest.raises(SimulationError, match=r"^unit controller_X \(drive of X\), t = 0\.011 s: ") as raised:
        cosim.run(loaded, fmus=fmus, native=native)
    assert "not finite 11 times in a row; coupling.scheme parallel needs no slope of it" in str(raised.value)
    chosen = ["coupling.scheme=parallel"]
    done = cosim.run(scenario.load(loaded.file, chosen), fmus=fmus, native=native)
    usual = placed(tmp_path, Habit(), programs)
    assert same(done.trace, cosim.run(scenario.load(usual.file, chosen), fmus=fmus).trace)


def test_a_unit_that_nobody_knows_counts_as_none(
    tmp_path: Path, programs: Callable[[str], Libraries], fmus: Path
) -> None:
    def rename(real: ET.Element) -> None:
        if real.get("unit") == "rpm":
            real.set("unit", "furlongs")

    done = cosim.run(placed(tmp_path, Habit(edit=every("Real", rename)), programs), fmus=fmus)
    said = "\n".join(map(str, done.notes))
    assert "gives no unit for Speed (rad/s, not 'furlongs', which it does not define): taken to be in SI units" in said


@pytest.mark.parametrize(
    ("edit", "words"),
    [
        (lambda root: root.remove(root[0]), "has no co-simulation interface"),
        (lambda root: root.set("fmiVersion", "3.0"), "not a usable FMI 2.0 archive"),
        (lambda root: root.find("CoSimulation").attrib.pop("modelIdentifier"), "modelIdentifier"),
        (every("Real", lambda real: real.set("unit", "kg")), "kg"),
    ],
)
def test_what_cannot_be_run_is_refused(
    edit: Callable[[ET.Element], object], words: str, tmp_path: Path, programs: Callable[[str], Libraries], fmus: Path
) -> None:
    with pytest.raises(InputError, match=words):
        cosim.run(placed(tmp_path, Habit(edit=edit, units={}), programs), fmus=fmus)
