"""A drive tuned on draws of its machine: margins on a drawn inertia, figures and findings, the draw that fails."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from agreement_helpers import assert_numbers_agree
from command_helpers import feedsim
from feedsim.design.tune import compensators as compensation
from feedsim.design.tune import drive
from feedsim.design.tune.circles import Circles, Contour
from feedsim.design.tune.drive import Limits, judges_of, margins_of
from feedsim.design.tune.drive_program import DriveProgram
from feedsim.design.tune.knobs import with_drives
from feedsim.design.uncertainty import cloud_of, torque_scale, typed_on
from feedsim.foundation.errors import SimulationError
from feedsim.linear.judgement import Candidates
from feedsim.scenario import load
from feedsim.structure import Modes, checked_modes
from identified_sets import CIRCLE, write_set

ONE = Path(__file__).resolve().parents[2] / "scenarios" / "one_axis.yaml"


def identified(folder: Path, *, inertia: float = 0.0, friction: float = 0.05) -> Path:
    """A friction file of the axis as identify-drive leaves it: relative standard deviations."""
    own = load(ONE).machine.axes["X"]
    values = {"F_C": (own.friction.F_C, "N.m"), "sigma_0": (own.friction.sigma_0, "N.m/rad")}
    identified: dict[str, object] = {"axis": "X", "parameters": {
        name: {"interval": [f"{value * (1 + sign * 1.959964 * friction)!r} {unit}" for sign in (-1, 1)]}
        for name, (value, unit) in values.items()
    }}  # fmt: skip
    J = checked_modes(load(ONE).machine).J_tot("X")
    if inertia:
        ends = [f"{J * (1 + sign * 1.959964 * inertia)!r} kg.m2" for sign in (-1, 1)]
        identified["inertia"] = {"interval": ends}
    content = yaml.safe_load((ONE.parent / "machines/one_axis/machine.yaml").read_text())["axes"]["X"]["friction"]
    file = folder / "friction.yaml"
    file.write_text(yaml.safe_dump({**content, "identified": identified}))
    return file


def test_margins_on_a_drawn_inertia_are_those_of_a_machine_that_has_it(tmp_path: Path) -> None:
    """All ports over the square root of a factor: every inertia is larger by the factor, frequencies stay."""
    machine = load(ONE, [f"machine.axes.X.friction={identified(tmp_path, inertia=0.1)}"]).machine
    (draw,) = cloud_of(machine).draws(1)
    larger = 1 / torque_scale(machine, draw, "X")
    assert abs(larger - 1) > 0.02
    modes = checked_modes(machine)
    of_motor = {name: 1 / np.sqrt(larger) if name[0] in "nx" else 1.0 for name in modes.ports}
    other = Modes(
        modes.file,
        modes.frequency,
        modes.damping,
        {name: of_motor[name] * shape for name, shape in modes.ports.items()},
    )
    typed = {"K_p": 0.3, "T_n": 0.012, "K_v": 90.0}
    tuned = with_drives(machine, {"X": typed})
    found = margins_of(judges_of(machine, "X", {"pose": modes}, (1.0,), draw, "draw 1 of 1"), tuned.axes["X"].drive)
    own = draw.axes["X"].friction
    as_drawn = own.model_copy(update={
        name: larger * getattr(own, name) for name in ("F_C", "F_S", "F_log", "sigma_0", "sigma_1", "sigma_2")
    })  # fmt: skip
    same = machine.model_copy(update={"axes": {"X": tuned.axes["X"].model_copy(update={"friction": as_drawn})}})
    expected = Candidates(same, other, "X").judge(same.axes["X"].drive)
    assert found.gain == pytest.approx(expected.gain_margin, abs=0.02)
    assert found.phase == pytest.approx(expected.phase_margin, abs=0.1)
    assert found.noise == pytest.approx(expected.noise, rel=1e-3)
    assert found.gain_of.endswith("draw 1 of 1, pose")
    as_it_is = Candidates(machine, modes, "X").judge(tuned.axes["X"].drive)
    assert abs(expected.loops[0].limit / as_it_is.loops[0].limit - 1) > 0.02  # and the inertia makes a difference


def test_typed_values_do_not_vary(tmp_path: Path) -> None:
    machine = load(ONE, [f"machine.axes.X.friction={identified(tmp_path, inertia=0.1)}"]).machine
    (draw,) = cloud_of(machine).draws(1)
    scale = torque_scale(machine, draw, "X")
    typed = typed_on(draw, machine, with_drives(machine, {"X": {"K_p": 0.3, "K_v": 90.0}})).axes["X"].drive
    assert typed.K_p == pytest.approx(scale * 0.3, rel=1e-12)  # type: ignore[union-attr]
    assert typed.K_v == 90.0  # type: ignore[union-attr]
    assert draw.axes["X"].drive.M_max == typed.M_max  # type: ignore[union-attr]
    assert typed_on(draw, machine, machine) == draw


@pytest.mark.extensive
def test_the_command_with_doubt(fmus: Path, tmp_path: Path) -> None:
    changed = ("--set", f"machine.axes.X.friction={identified(tmp_path, inertia=0.02)}")
    command = ("tune", "drive", ONE, "--axes", "X", "--evaluations", "10", *changed, "--out", "r")
    done = feedsim(*command, "--uncertain", "19", fmus=fmus, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "With what identification leaves open: peaks fall by " in done.stdout
    summary = json.loads((tmp_path / "r/summary.json").read_text())
    figures = {name: each["value"] for name, each in summary["figures"].items()}
    assert summary["uncertain"] == {"draws": 19}
    assert summary["settings"]["uncertain"] == "19"
    for name in ("peak_reduction", "gain_margin_after", "phase_margin_after"):
        low, high = figures[f"X.{name}_from"], figures[f"X.{name}_to"]
        assert low < high, name
        assert low - 3 < figures[f"X.{name}"] < high + 3, name
    page = (tmp_path / "r/report.html").read_text()
    assert "What identification leaves open" in page
    assert_numbers_agree(tmp_path / "r")
    assert feedsim(*command, fmus=fmus, cwd=tmp_path).returncode == 0
    plain = json.loads((tmp_path / "r/summary.json").read_text())
    assert set(summary) - set(plain) == {"uncertain"}
    assert not [name for name in plain["figures"] if name.endswith(("_from", "_to"))]


def test_margins_hold_on_draws_that_values_are_found_on(fmus: Path, tmp_path: Path) -> None:
    """A drive at its margin has less on a lighter draw: the search takes the lightest of its draws into account."""
    machine_file = f"machine.axes.X.friction={identified(tmp_path, inertia=0.1)}"
    scenario = load(ONE, [machine_file])
    cloud = cloud_of(scenario.machine)
    limits = Limits(8.0, 40.0, 1e-5)
    search = drive._Search.begin(scenario, "X", limits, {}, fmus, lambda *_: None, 10, cloud)
    present = search.knobs.drive
    nominal = margins_of(search.judges, present)
    assert search.margins(present).gain < nominal.gain - 0.05
    assert "draw" in search.margins(present).gain_of
    assert len(search.parts) == 4 + 2 * drive.RUN_DRAWS
    hopeless = replace(limits, gain_margin=100.0)
    search.limits = hopeless
    assert search.margins(present).gain_of == nominal.gain_of  # no draws where the machine itself does not run


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--uncertain", "39"), "no axis has identified values with intervals"),
        (("--uncertain", "5"), "--uncertain 5: at least 19 draws are needed"),
    ],
)
def test_what_is_refused(words: tuple[str, ...], message: str, fmus: Path, tmp_path: Path) -> None:
    done = feedsim("tune", "drive", ONE, "--axes", "X", *words, "--out", "r", fmus=fmus, cwd=tmp_path)
    assert done.returncode == 2
    assert message in done.stderr
    assert not (tmp_path / "r").exists()


class Fails:
    """Calls a method, but fails from the k-th call on."""

    def __init__(self, method: object, k: int) -> None:
        self.method, self.left = method, k

    def __call__(self, *args: object, **named: object) -> object:
        self.left -= 1
        if self.left < 0:
            raise SimulationError("unit X.friction: no")
        return self.method(*args, **named)  # type: ignore[operator]


def test_the_draw_that_fails_is_named_by_tune_drive(
    fmus: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scenario = load(ONE, [f"machine.axes.X.friction={identified(tmp_path)}"])
    fails = Fails(DriveProgram.errors, 4)  # circles, and moves with three factors on the modes
    monkeypatch.setattr(DriveProgram, "errors", lambda *args, **named: fails(*args, **named))
    with pytest.raises(
        SimulationError,
        match=r"^draw 1 of 4 of the machine, which the values are found on: unit X\.friction: no",
    ):
        drive.tune_drive(
            scenario, "X", Limits(8.0, 40.0, 1e-5), fmus=fmus, progress=lambda *_: None, evaluations=10,
            cloud=cloud_of(scenario.machine), count=19,
        )  # fmt: skip


@pytest.mark.parametrize(
    ("calls", "kind", "which"),
    [
        (1, "pulse", "draw 1 of 4 of the machine, which the values are found on"),
        (3, "pulse", "draw 3 of 4 of the machine, which the values are found on"),
        # Circles tuned on, circles of the practical range, those with 7 effects: without friction, before, after.
        (27, "model", "draw 1 of 19 of the machine"),
        (30, "model", "draw 2 of 19 of the machine"),
    ],
)
def test_the_draw_that_fails_is_named_by_tune_compensation(
    calls: int, kind: str, which: str, fmus: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scenario = load(CIRCLE, [f"machine.axes.Z.friction={write_set(tmp_path)}"])
    turn = Contour(np.linspace(-np.pi, np.pi, 361), np.ones(361))
    fails = Fails(lambda circles, *args, **named: (turn,) * len(circles.pairs), calls)
    monkeypatch.setattr(Circles, "contours", lambda *args, **named: fails(*args, **named))
    with pytest.raises(SimulationError, match=rf"^{which}: unit X\.friction: no"):
        compensation.tune(
            scenario, kind, ("X", "Z"), ("Z",), "ratio", fmus=fmus, progress=lambda *_: None,
            cloud=cloud_of(scenario.machine), count=19,
        )  # fmt: skip
