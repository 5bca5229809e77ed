"""feedsim tune feedforward as a user meets it: what it writes, that it agrees with itself, messages and exit codes."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml

from command_helpers import Done, feedsim, summary_of
from feedsim.analysis import Figure, compensation
from feedsim.cli import main
from feedsim.files.trace import read_csv
from feedsim.foundation.errors import Finding, SimulationError
from feedsim.report.compensate import _um, table_csv
from report_helpers import Page, contents

ROOT = Path(__file__).resolve().parents[2]
SCENARIOS = ROOT / "scenarios"
CIRCLE = SCENARIOS / "xz_circle.yaml"

FRICTION_Z = """
F_C: 1.44 N.m     # 10 % too small
F_S: 1.89 N.m
v_s: 0.6 rad/s
F_log: 0.4 N.m
v_log: 3 rad/s
sigma_0: 300 N.m/rad
sigma_1: 0.8 N.m.s/rad
sigma_2: 0.006 N.m.s/rad
W: 0.040 rad
gamma: 0.35
"""


@pytest.fixture(scope="module")
def done(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Done, Path]:
    """Without the table, with a set and a delay given."""
    folder = tmp_path_factory.mktemp("compensate")
    (folder / "friction_z.yaml").write_text(FRICTION_Z, encoding="utf-8")
    words = ["--friction", "Z=friction_z.yaml", "--delay", "X=3.9417 ms", "--no-table"]
    # what is needed is recorded whatever the scenario leaves out
    words += ["--set", 'recording.variables=["X.x_a"]']
    return feedsim(
        "tune", "feedforward", CIRCLE, "--out", "out", "--figures", "png", *words, fmus=fmus, cwd=folder
    ), folder


def test_everything_is_written_and_told(done: tuple[Done, Path]) -> None:
    process, folder = done
    assert (process.returncode, process.stderr) == (0, "")
    second, _, command, last = process.stdout.splitlines()
    assert last == f"-> {Path('out') / 'report.html'}"
    assert command.startswith("  feedsim tune compensation ")
    assert second.startswith("  G 8.19 -> 0.8")
    numbers = re.findall(r"-> (\S+) um", second)
    assert len(numbers) == 3
    assert all(number == f"{float(number):.3g}" for number in numbers), second
    files = set(contents(folder / "out"))
    assert files == {
        *("result.csv", "uncompensated.csv", "feedforward.csv", "summary.json", "report.html"),
        *(f"figures/compensation-{stem}.png" for stem in ("contour", "reversals", "torque")),
    }
    assert set(summary_of(folder / "out")["files"]) == files


def test_summary_tells_what_was_compensated_with(done: tuple[Done, Path]) -> None:
    summary = summary_of(done[1] / "out")
    axes = summary["compensation"]["axes"]
    assert list(axes) == ["X", "Z"]
    assert axes["X"]["delay"] == {"value": 0.0039417, "unit": "s"}
    assert (axes["X"]["delay_from"], axes["X"]["friction_from"]) == ("given", "the machine")
    assert (axes["Z"]["delay_from"], axes["Z"]["friction_from"]) == ("the drive's parameters", "friction_z.yaml")
    assert axes["Z"]["friction"]["F_C"] == {"value": 1.44, "unit": "N.m"}
    assert summary["machine"]["axes"]["Z"]["friction"]["F_C"]["value"] == 1.6
    assert "made up" in summary["machine"]["note"]
    named = {item["role"]: item["name"] for item in summary["inputs"]}
    assert named["friction of the compensation of Z"] == "friction_z.yaml"
    figures = summary["figures"]
    assert "X.axis_lag" not in figures
    assert figures["Z.delay"]["value"] == pytest.approx(4.191, abs=1e-3)
    assert figures["Z.axis_lag"]["value"] - figures["Z.torque_lag"]["value"] == pytest.approx(
        figures["Z.delay"]["value"]
    )
    assert figures["after.glitch_Z"]["value"] == pytest.approx(0.1 * figures["before.glitch_Z"]["value"], rel=0.05)
    assert figures["after.glitch_X"]["value"] < 0.05
    assert figures["after.G"]["meaning"].startswith("with compensation: ISO 230-4")
    assert all(figure["unit"] and figure["meaning"] for figure in figures.values())


def test_curves_can_be_read_back(done: tuple[Done, Path]) -> None:
    folder = done[1] / "out"
    with_it, without, torque = (read_csv(folder / f"{name}.csv") for name in ("result", "uncompensated", "feedforward"))
    assert set(with_it.columns) == {"X.x_a", "Z.x_a", "X.n_a", "Z.n_a", "X.M_fr", "Z.M_fr"}
    assert np.array_equal(with_it.time, without.time)
    assert list(torque.columns) == ["X.M_ff", "Z.M_ff"]
    assert torque.unit("Z.M_ff") == "N.m"
    assert torque.time[1] == pytest.approx(125e-6)
    assert torque.time[-1] == pytest.approx(with_it.time[-1])
    assert np.abs(torque["Z.M_ff"]).max() == pytest.approx(
        summary_of(done[1] / "out")["figures"]["Z.peak_feedforward"]["value"]
    )


def test_worse_than_without_is_the_first_thing_said(fmus: Path, tmp_path: Path) -> None:
    """Friction of Z 2.5 times too strong; X has the machine's own."""
    strong = re.sub(r"(F_C|F_S|F_log|sigma_[012]): (\S+)", lambda m: f"{m[1]}: {2.5 * float(m[2]):g}", FRICTION_Z)
    (tmp_path / "friction_z.yaml").write_text(strong, encoding="utf-8")
    words = ["--friction", "Z=friction_z.yaml", "--no-table", "--out", "out"]
    process = feedsim("tune", "feedforward", CIRCLE, *words, fmus=fmus, cwd=tmp_path)
    assert process.returncode == 0
    found = "worse with compensation than without: G 8.19 -> 10"
    assert process.stdout.startswith(f"WRONG: {found}")
    first, *_, last = process.stderr.splitlines()
    assert first.startswith(f"feedsim: WRONG: {found}")
    assert "reversal Z+ 7.9 -> 10" in first
    assert "reversal X" not in first
    assert last.startswith("feedsim: note: axis X: model and machine have the same friction and delay")
    findings = summary_of(tmp_path / "out")["findings"]
    assert [(each["code"], each["severity"]) for each in findings] == [
        ("compensation-worse", "wrong"), ("compensation-larger", "doubt"), ("friction-known-exactly", "note"),
    ]  # fmt: skip
    assert "dip_Z -0.288 -> -" in findings[1]["text"]
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert page.index('class="wrong"') < page.index("model and machine have the same") < page.index('class="keys"')


def test_worse_is_judged_figure_by_figure() -> None:
    def told(reversal: float = 0.1e-6, **after: float) -> list[Finding]:
        before = {"G": 8.0, "G_ls": 8.0, "tool.G": 8.2, "glitch_Z": 7.9, "dip_Z": -0.3, "mean": 2.0}
        figures = {f"before.{name}": Figure(value, "um", "") for name, value in before.items()}
        figures |= {f"after.{name}": Figure(after.get(name, 0.05), "um", "") for name in before}
        return compensation._warn_worse_figures(figures, {"Z+": 7.9e-6, "Z-": 7.9e-6}, {"Z+": reversal, "Z-": 0.1e-6})

    assert told() == []
    assert told(dip_Z=-0.37, mean=-2.07) == []  # less than a hundredth of G
    (larger,) = told(dip_Z=-0.76)
    assert (larger.code, larger.severity, larger.place) == ("compensation-larger", "doubt", "dip_Z")
    assert larger.text.endswith("dip_Z -0.3 -> -0.76 um")
    for found in (told(G=8.2), told(**{"tool.G": 9.0}), told(reversal=9e-6), told(G=np.nan)):
        assert [(each.code, each.severity) for each in found] == [("compensation-worse", "wrong")]
    assert "reversal Z+ 7.9 -> 9 um" in told(reversal=9e-6)[0].text
    assert "G 8 -> not determined" in told(G=np.nan)[0].text


def test_without_the_table_there_is_none(done: tuple[Done, Path]) -> None:
    out = done[1] / "out"
    assert not (out / "compensation.csv").exists()
    assert "What errors cost" not in (out / "report.html").read_text(encoding="utf-8")
    assert summary_of(done[1] / "out")["compensation"]["errors"] == []


def test_table_has_both_runs_and_the_errors() -> None:
    made: Any = SimpleNamespace(
        turn=SimpleNamespace(axes=("X", "Z")),
        left_before=compensation.Quality(8e-6, {"X": 4e-6, "Z": 7e-6}, {"X": -1e-6, "Z": -2e-6}),
        left_after=compensation.Quality(4e-9, {"X": 1e-9, "Z": 2e-9}, {"X": -1e-9, "Z": -3e-9}),
    )
    wrong = compensation.Quality(1e-6, {"X": 0.0, "Z": 1e-6}, {"X": 0.0, "Z": 0.0})
    made.table = (compensation.Variation("delay", 0.5, "ms", wrong),)
    rows = list(csv.DictReader(table_csv(made).splitlines()))
    assert [row["compensation"] for row in rows] == ["none", "as computed", "delay"]
    assert [row["error"] for row in rows] == ["0", "0", "0.5"]
    for row, left in zip(rows, (made.left_before, made.left_after, wrong), strict=True):
        assert float(row["G [um]"]) == pytest.approx(1e6 * left.G, rel=1e-5)
        for axis in ("X", "Z"):
            assert float(row[f"peak_{axis} [um]"]) == pytest.approx(1e6 * left.peak[axis], rel=1e-5)
            assert float(row[f"dip_{axis} [um]"]) == pytest.approx(1e6 * left.dip[axis], rel=1e-5)


@pytest.mark.parametrize(
    ("value", "shown"),
    [(8.188, "8.19"), (0.82, "0.82"), (0.0042, "0.004"), (0.01, "0.01"), (0.0, "0.00"), (2e-5, "2×10⁻⁵")],
)
def test_cards_never_round_to_nothing(value: float, shown: str) -> None:
    assert _um(Figure(value, "um", "")) == shown


def test_report_shows_what_counts(done: tuple[Done, Path]) -> None:
    text = (done[1] / "out" / "report.html").read_text(encoding="utf-8")
    page = Page(text)
    assert "Friction compensation: X-Z circle" in text
    assert "8.19 → 0.8" in text
    assert "made up to be credible" in text
    assert "friction_z.yaml" in text
    assert 'id="compensation-contour"' in text
    assert 'id="compensation-errors"' not in text
    assert all(reference.startswith(("#", "data:")) for reference in page.references)
    assert len(page.ids) == len(set(page.ids))


def test_nothing_of_an_earlier_run_is_left(done: tuple[Done, Path], fmus: Path, tmp_path: Path) -> None:
    """Another command that is forced into the same folder takes the files away that it does not write itself."""
    (tmp_path / "out").mkdir()
    for name, data in contents(done[1] / "out").items():
        (tmp_path / "out" / name).parent.mkdir(exist_ok=True)
        (tmp_path / "out" / name).write_bytes(data)
    run = feedsim(
        "run", SCENARIOS / "z_positioning.yaml", "--out", "out", "--quiet", "--force", fmus=fmus, cwd=tmp_path
    )
    assert run.returncode == 0
    assert set(contents(tmp_path / "out")) == set(summary_of(tmp_path / "out")["files"])


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        ([SCENARIOS / "z_positioning.yaml"], 2, "z_positioning.yaml: there is no circle"),
        ([CIRCLE, "--friction", "Z"], 2, "--friction Z: AXIS=FILE.yaml is needed"),
        ([CIRCLE, "--friction", "Y=a.yaml"], 2, "--friction Y=a.yaml: axis Y rests; the axes that move are X, Z"),
        ([CIRCLE, "--friction", "Z=missing.yaml"], 2, "missing.yaml"),
        ([CIRCLE, "--friction", "Z=bad.yaml"], 2, "bad.yaml:1"),
        ([CIRCLE, "--delay", "4"], 2, "--delay 4: 4 has no unit; a time is expected"),
        ([CIRCLE, "--delay", "Q=4 ms"], 2, "--delay Q=4 ms: no axis 'Q'; the axes that move are X, Z"),
        ([CIRCLE, "--delay", "Z=4 ms", "--delay", "Z=5 ms"], 2, "--delay Z=5 ms: Z is given twice"),
        ([CIRCLE, "--delay", "4 ms", "--delay", "5 ms"], 2, "--delay 5 ms: that of all axes is given twice"),
        ([CIRCLE, "--friction", "Z=a.yaml", "--friction", "Z=b.yaml"], 2, "--friction Z=b.yaml: Z is given twice"),
        ([CIRCLE, "--set", "machine.axes.Z.drive.K_v=0 1/s"], 2, "axis Z: K_v is 0"),
        ([CIRCLE, "--set", "machine.axes.Z.drive.K_v=0 1/s"], 2, "give the delay of its compensation (--delay AXIS="),
        (["missing_scenario.yaml"], 2, "missing_scenario.yaml"),
        ([CIRCLE, "--out", "taken"], 4, "taken"),
    ],
    ids=lambda value: " ".join(map(str, value[1:])) or "file" if isinstance(value, list) else None,
)
def test_refusals(words: list[str | Path], code: int, message: str, fmus: Path, tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("a file", encoding="utf-8")
    (tmp_path / "bad.yaml").write_text("F_C: 1.6\n" + FRICTION_Z.replace("F_C: 1.44 N.m", ""), encoding="utf-8")
    process = feedsim("tune", "feedforward", *words, "--no-table", fmus=fmus, cwd=tmp_path)
    assert process.returncode == code
    assert message in process.stderr
    assert process.stderr.startswith("feedsim: ")
    assert process.stdout == ""
    assert set(contents(tmp_path)) == {"taken", "bad.yaml"}


@pytest.mark.parametrize(
    ("words", "lost"),
    [
        (["--friction", "Z=out/summary.json"], "summary.json"),
        (["--set", "machine.axes.Z.friction=out/report.yaml"], ""),
        (["--set", "machine.modes=out/residuals.csv"], "residuals.csv"),
        (["--set", "machine.modes=out/feedforward.csv"], "feedforward.csv"),
    ],
    ids=lambda value: value[-1] if isinstance(value, list) else None,
)
def test_inputs_are_not_lost(words: list[str], lost: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Inputs may lie in the folder of the results where nothing of that name is written or removed."""
    out = tmp_path / "out"
    out.mkdir()
    (out / "report.yaml").write_text(FRICTION_Z, encoding="utf-8")
    for name in ("residuals.csv", "feedforward.csv"):
        (out / name).write_bytes((SCENARIOS / "machines" / "test_centre" / "modes.csv").read_bytes())
    # YAML as much as JSON: the summary of an identification, which an earlier residuals.csv is of
    values = yaml.safe_load(FRICTION_Z) | {"identified": {"axis": "Z"}}
    listed = values if "summary.json" in lost else {"files": ["residuals.csv", "feedforward.csv"]}
    (out / "summary.json").write_text(json.dumps(listed), encoding="utf-8")
    before = contents(out)
    started: list[str] = []

    def no_run(*given: Any, **more: Any) -> Any:
        started.append("run")
        raise SimulationError("far enough")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(compensation, "compensate", no_run)
    told: list[str] = []
    monkeypatch.setattr("builtins.print", lambda text, **more: told.append(str(text)))
    code = main(["tune", "feedforward", str(CIRCLE), "--out", "out", "--quiet", *words])
    assert (code, started) == ((4, []) if lost else (3, ["run"]))
    fate = "removed" if lost == "residuals.csv" else "replaced"
    assert not lost or f"{Path('out') / lost}: is an input and would be {fate}; take another directory" in told[0]
    assert contents(out) == before
