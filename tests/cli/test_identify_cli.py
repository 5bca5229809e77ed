"""feedsim identify friction as a user meets it: from traces to a friction that runs, messages and exit codes."""

from __future__ import annotations

import json
import re
import shlex
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from command_helpers import Done, feedsim, summary_of
from feedsim.cli import main
from feedsim.estimation.identify import Options, identify, stages
from feedsim.estimation.identify.friction_file import Line, friction_text
from feedsim.estimation.identify.motion import RecordTorque
from feedsim.estimation.identify.read import distinct
from feedsim.estimation.identify.record import Record
from feedsim.estimation.identify.result import Correlation, Estimate, Plateau
from feedsim.estimation.identify.stages import merged_correlation, record_starts, transitions
from feedsim.files.trace import write_csv
from feedsim.foundation.errors import Finding, InputError
from feedsim.foundation.units import parameters
from feedsim.scenario import load_machine
from feedsim.scenario.load import read_friction
from feedsim.simulation.cosim.friction_law import FrictionLaw
from identification_helpers import (
    I_P,
    TRUE,
    J,
    dynamic,
    estimates,
    identification,
    log_of,
    records,
    sines,
    stationary,
    strokes,
)
from report_helpers import contents

ROOT = Path(__file__).resolve().parents[2]
MACHINE = ROOT / "scenarios" / "machines" / "test_centre"
CIRCLE = ROOT / "scenarios" / "xz_circle.yaml"
MOVES = ((5e-6, 10.0, 20), (20e-6, 5.0, 12), (100e-6, 2.0, 7), (200e-6, 1.0, 5))
FILES = {"friction.yaml", "plateaus.csv", "residuals.csv", "report.html", "summary.json"}
LUGRE = tuple(parameters("friction"))
RESULT_ORDER = (*LUGRE, "M_0", "J", "delay")


@pytest.fixture(scope="module")
def traces(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two logs of the same name: of constant speeds and of sines, of a rigid axis with the true friction."""
    folder = tmp_path_factory.mktemp("traces")
    with FrictionLaw(fmus) as law:
        feeds = np.geomspace(10, 20000, 10) / 60e3 / I_P
        for name, angle in (("constant", strokes(feeds)), ("sine", sines(MOVES))):
            (folder / name).mkdir()
            write_csv(folder / name / "log.csv", log_of(law, "Z", angle, 5e-4, noise=1e-3))
    return folder


@pytest.fixture(scope="module")
def done(fmus: Path, traces: Path) -> Done:
    known = ["--axes", "Z", "--machine", MACHINE, "--inertia", f"{J} kg.m^2"]
    return feedsim("identify", "friction", "constant/log.csv", "sine/log.csv", *known, fmus=fmus, cwd=traces)


def test_everything_is_written_and_told(done: Done, traces: Path) -> None:
    assert done.returncode == 0, done.stderr
    out = traces / "results" / "identify_z"
    assert {path.name for path in out.iterdir() if path.is_file()} == FILES
    lines = done.stdout.splitlines()
    assert lines[0].startswith("axis Z: curve within ")
    assert lines[-1] == f"-> {Path('results') / 'identify_z' / 'report.html'}"
    assert [line.split()[0] for line in lines[2:17]] == list(RESULT_ORDER)
    assert any(line.startswith("  constant load M_0 0.2") for line in lines)
    assert lines[-2].endswith(f"machine.axes.Z.friction={Path('results') / 'identify_z' / 'friction.yaml'}")


def test_a_path_with_blanks_can_be_pasted(
    traces: Path, fmus: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    monkeypatch.chdir(tmp_path)
    words = [str(traces / "constant" / "log.csv"), "--axes", "Z", "--machine", str(MACHINE), "--stages", "1"]
    assert main(["identify", "friction", *words, "--out", "my results", "--fmus", str(fmus)]) == 0
    line = capsys.readouterr().out.splitlines()[-2]
    given = f"machine.axes.Z.friction={Path('my results') / 'friction.yaml'}"
    assert line.startswith("  feedsim example z_positioning && feedsim run z_positioning.yaml --set 'machine")
    assert given in shlex.split(line)


def test_parameters_are_those_of_the_axis(done: Done, traces: Path) -> None:
    """Noise of 1 mN.m (0.05 %) on the torque. What is left besides is the error of splines at 500 Hz, below 1 %."""
    parameters = summary_of(traces / "results" / "identify_z")["parameters"]
    limits = {"F_C": 0.005, "F_S": 0.005, "v_s": 0.03, "F_log": 0.02, "sigma_2": 0.03, "sigma_0": 0.01, "sigma_1": 0.02,
              "W": 0.01, "gamma": 0.01, "M_0": 0.02}  # fmt: skip
    for name, limit in limits.items():
        assert parameters[name]["value"] == pytest.approx(TRUE[name][0], rel=limit), name
    assert parameters["delay"]["value"] == pytest.approx(0.0, abs=1e-4)
    assert parameters["asymmetry"]["value"] == pytest.approx(0.02, abs=2e-3)
    assert parameters["J"]["status"] == "given"


def test_logs_of_one_name_are_told_apart(done: Done, traces: Path) -> None:
    summary = summary_of(traces / "results" / "identify_z")
    assert [trace["file"] for trace in summary["traces"]] == ["constant/log.csv", "sine/log.csv"]
    text = (traces / "results" / "identify_z" / "plateaus.csv").read_text(encoding="utf-8")
    assert {line.split(",")[0] for line in text.splitlines()[1:]} == {"constant/log.csv"}


def test_the_file_runs_as_it_is(done: Done, traces: Path, fmus: Path) -> None:
    given = "machine.axes.Z.friction=results/identify_z/friction.yaml"
    process = feedsim("check", CIRCLE, "--set", given, fmus=fmus, cwd=traces)
    assert process.returncode == 0, process.stderr
    friction = read_friction(traces / "results" / "identify_z" / "friction.yaml")
    assert friction.identified["constant_load"]["value"].endswith(" N.m")


def test_stage_1_alone_holds_the_rest(traces: Path, fmus: Path) -> None:
    words = ["constant/log.csv", "--axes", "Z", "--machine", MACHINE, "--stages", "1", "--out", "one", "--quiet"]
    process = feedsim("identify", "friction", *words, fmus=fmus, cwd=traces)
    assert (process.returncode, process.stdout) == (0, ""), process.stderr
    parameters = summary_of(traces / "one")["parameters"]
    assert parameters["sigma_0"]["status"] == "held"
    assert "stage 2 was not asked for; value of the machine file" in parameters["sigma_0"]["reason"]
    assert parameters["J"]["reason"].startswith("J_tot of the modes of Test centre")
    assert not (traces / "one" / "residuals.csv").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["none.csv"], "no such file"),
        (["sine/log.csv", "--machine", MACHINE, "--axes", "Q"], "no axis 'Q'"),
        (["sine/log.csv", "--axes", "Z"], "its pitch is needed"),
        (["sine/log.csv", "--machine", MACHINE, "--hold", "beta"], "NAME=VALUE is needed"),
        (["sine/log.csv", "--machine", MACHINE, "--hold", "F_C=1"], "--hold F_C=1: .*torque"),
        (["sine/log.csv", "--machine", MACHINE, "--hold", "beta=1", "--hold", "beta=2"], "beta=2: beta is given twice"),
        (["sine/log.csv", "--machine", MACHINE, "--hold", "beta=1,W=0 rad,beta=1"], "beta is given twice"),
        (["sine/log.csv", "--machine", MACHINE, "--hold", "delay=1"], "no parameter 'delay'"),
        (["sine/log.csv", "--machine", MACHINE, "--free", "sigma"], "no parameter 'sigma'"),
        (["sine/log.csv", "--machine", MACHINE, "--free", "beta", "--hold", "beta=1"], "held and free at once"),
        (["sine/log.csv", "--machine", MACHINE, "--delay", "0.5"], "--delay 0.5: .*time"),
        (["sine/log.csv", "--machine", MACHINE, "--inertia", "1 kg"], "--inertia 1 kg: .*moment of inertia"),
        (["sine/log.csv", "sine/log.csv", "--machine", MACHINE], "given twice"),
    ],
)
def test_bad_input_is_told(traces: Path, fmus: Path, words: list[Any], message: str, capfd: Any) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(traces)
        patch.setenv("FEEDSIM_FMUS", str(fmus))
        code = main(["identify", "friction", *map(str, words), "--out", "bad"])
    captured = capfd.readouterr()
    assert code == 2
    assert re.search(message, captured.err), captured.err
    assert not (traces / "bad").exists()


def test_place_is_looked_at_first(traces: Path, fmus: Path) -> None:
    (traces / "taken").write_text("")
    words = ["sine/log.csv", "--machine", MACHINE, "--out", "taken"]
    process = feedsim("identify", "friction", *words, fmus=fmus, cwd=traces)
    assert process.returncode == 4
    assert "is a file" in process.stderr


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["out/log.csv"], "log.csv: is an input and would be removed"),
        (["out/mine/../log.csv"], "log.csv: is an input and would be removed"),
        (["out/plateaus.csv"], "plateaus.csv: is an input and would be replaced"),
        (["linked.csv"], "residuals.csv: is an input and would be replaced"),
        (["sine.csv", "--columns", "out/open_loop.csv"], "open_loop.csv: is an input and would be replaced"),
        (["sine.csv", "--machine", "scenario.yaml"], "friction.yaml: is an input and would be replaced"),
        (["out/mine.csv"], "far enough"),
        (["sine.csv"], "far enough"),
    ],
    ids=lambda value: value[-1] if isinstance(value, list) else None,
)
def test_inputs_are_not_lost(
    traces: Path, tmp_path: Path, fmus: Path, words: list[str], message: str, monkeypatch: Any, capfd: Any
) -> None:
    """The folder of an earlier run, whose log.csv would go with it, and names that the results have."""
    (tmp_path / "out" / "mine").mkdir(parents=True)
    for name in ("sine.csv", "out/log.csv", "out/plateaus.csv", "out/residuals.csv", "out/mine.csv"):
        shutil.copyfile(traces / "sine" / "log.csv", tmp_path / name)
    (tmp_path / "linked.csv").symlink_to(tmp_path / "out" / "residuals.csv")
    (tmp_path / "out" / "open_loop.csv").write_text("axis: Z\ncurrent: {column: Z.i_q}\nposition: {column: Z.x_a}\n")
    (tmp_path / "out" / "summary.json").write_text(
        json.dumps(
            {"files": ["log.csv", "result.csv", "friction.yaml", "residuals.csv", "plateaus.csv", "open_loop.csv"]}
        )
    )
    friction = load_machine(MACHINE).axes["Z"].friction
    lines = {name: Line(value) for name, value in friction.parameters().items()}
    (tmp_path / "out" / "friction.yaml").write_text(friction_text(lines, {}, [], name="friction.yaml"))
    (tmp_path / "scenario.yaml").write_text(
        f"name: s\nmachine: {MACHINE}\nmotions: [{{kind: dwell, duration: 10 ms}}]\n"
        "set: {machine.axes.Z.friction: out/friction.yaml}\n"
    )
    before = contents(tmp_path)

    def far_enough(*given: Any, **more: Any) -> Any:
        raise InputError("far enough")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("FEEDSIM_FMUS", str(fmus))
    monkeypatch.setattr("feedsim.jobs.identify.identified_from", far_enough)
    machine = [] if "--machine" in words else ["--machine", str(MACHINE)]
    code = main(["identify", "friction", *words, *machine, "--axes", "Z", "--out", "out", "--quiet"])
    captured = capfd.readouterr()
    assert re.search(message, captured.err), captured.err
    assert code == (2 if message == "far enough" else 4)
    assert contents(tmp_path) == before


# --- the steps, with stages that are made up -------------------------------------------------------------------------


def options(**changes: Any) -> Options:
    given = Estimate("J", J, "kg.m2", "inertia", status="given")
    return Options(**({"axis": "Z", "I_P": I_P, "J": given} | changes))


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Stages that answer at once with the true values, and what they were asked."""
    asked: dict[str, Any] = {}

    def first(plateaus: Any, **words: Any) -> Any:
        asked["stage 1"] = words
        return stationary(estimates())

    def second(chosen: Any, law: Any, **words: Any) -> Any:
        asked["stage 2"] = words | {"records": [record.name for record in chosen]}
        words["progress"]("half", 0.5)
        return dynamic(estimates())

    monkeypatch.setattr(stages, "stationary", first)
    monkeypatch.setattr(stages, "dynamic", second)
    monkeypatch.setattr(stages, "plateaus", lambda record, J: stationary(estimates()).plateaus[:2])
    return asked


class NoLaw:
    """Has LuGre's parameters, and is not called."""

    names = LUGRE

    def __call__(self, *words: Any, **more: Any) -> Any:
        raise AssertionError("no law is needed")


no_law: Any = NoLaw()


def test_stages_are_merged(calls: dict[str, Any]) -> None:
    told: list[tuple[str, int, int]] = []
    found = identify(records(), no_law, options(hold={"beta": 1.2, "W": 0.0}), lambda *words: told.append(words))
    assert list(found.estimates) == list(RESULT_ORDER)
    assert calls["stage 1"]["hold"] == {"beta": 1.2}
    assert calls["stage 2"]["hold"] == {"beta": 1.2, "W": 0.0}
    assert calls["stage 2"]["records"] == ["sine.csv"]
    assert set(dynamic(estimates()).advice) <= set(found.advice)
    assert set(found.correlation.names) == {
        name for name, each in found.estimates.items() if each.status == "estimated"
    }
    assert ("stage 2: half", 50, 100) in told
    assert {"plateaus", "stage 1", "stage 2"} <= set(found.seconds)


def test_an_estimate_of_stage_1_outlives_a_doubt_of_stage_2(
    calls: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    doubtful = dynamic(estimates())
    vague = replace(estimates()["F_C"], value=9.0, sigma=np.nan, status="undetermined")
    both = replace(doubtful, estimates={**doubtful.estimates, "F_C": vague})
    monkeypatch.setattr(stages, "dynamic", lambda *words, **more: both)
    assert identify(records(), no_law, options()).estimates["F_C"].value == 1.6


@pytest.mark.parametrize(("fallback", "value"), [({}, 2.1 / 5e-3), ({"sigma_0": 123.0}, 123.0)])
def test_without_reversals_pre_sliding_is_held(
    calls: dict[str, Any], monkeypatch: pytest.MonkeyPatch, fallback: dict[str, float], value: float
) -> None:
    monkeypatch.setattr(stages, "transitions", lambda records: ())
    found = identify(records(), no_law, options(fallback=fallback, delay=1e-3))
    assert found.dynamic is None
    assert found.estimates["sigma_0"].value == pytest.approx(value)
    assert found.estimates["sigma_0"].status == "held"
    assert found.estimates["sigma_0"].reason.startswith("no reversals; ")
    assert found.estimates["W"].value == 0.0 or fallback
    assert any("sines of 5 um" in text for text in found.advice)
    assert found.estimates["delay"].status == "given"


def test_without_plateaus_stage_2_stands_alone(calls: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stages, "plateaus", lambda record, J: ())
    alone = replace(dynamic(estimates()), estimates=estimates())
    monkeypatch.setattr(stages, "dynamic", lambda *words, prior, **more: alone if prior is None else None)
    found = identify(records(), no_law, options())
    assert found.stationary is None
    assert found.estimates["F_C"].value == 1.6
    assert any("no stretch at constant speed" in text for text in found.advice)


def test_a_given_inertia_is_held_against_the_records(calls: dict[str, Any]) -> None:
    time = np.arange(5000) * 2e-3
    speed = 20 * np.sin(2 * np.pi * 0.5 * time)
    torque = J * np.gradient(speed, 2e-3) + 1.6 * np.sign(speed) + 0.01 * speed
    moving = Record("general", time, torque, speed=speed)
    found = identify((moving,), no_law, options())
    assert "inertia-contradicted" not in [finding.code for finding in found.warnings]
    assert found.rigid["J"].value == pytest.approx(J, rel=0.01)  # what the window takes of a 0.5 Hz sine is below
    twice = identify((moving,), no_law, options(J=Estimate("J", 2 * J, "kg.m2", "inertia", status="given")))
    assert any(f.code == "inertia-contradicted" and "given as 0.0328" in f.text for f in twice.warnings)


@pytest.mark.parametrize("speeds", [7, 8])
def test_no_row_counts_twice(calls: dict[str, Any], monkeypatch: pytest.MonkeyPatch, speeds: int) -> None:
    """Of the record that stage 2 takes, plateaus of a few speeds are no prior to it; of more they are, and stage 2
    leaves their rows out."""
    own = stationary(estimates())
    shared = replace(
        own,
        plateaus=tuple(replace(p, record="sine.csv") for p in own.plateaus[: 2 * speeds]),
        estimates={**own.estimates, "F_C": replace(own.estimates["F_C"], value=7.0)},
    )
    monkeypatch.setattr(stages, "stationary", lambda *words, **more: shared)
    alone = replace(dynamic(estimates()), estimates=estimates())

    def second(chosen: Any, law: Any, **words: Any) -> Any:
        calls["stage 2"] = words
        return alone

    monkeypatch.setattr(stages, "dynamic", second)
    found = identify(records(), no_law, options())
    assert (calls["stage 2"]["prior"] is None) == (speeds < 8)
    if speeds == 8:
        counted = RecordTorque(records()[1], no_law, without=[Plateau("sine.csv", 0.5, 1.0, 1.0, 1.0, 0.1, 100)])
        whole, left = records()[1].time[RecordTorque(records()[1], no_law).rows], records()[1].time[counted.rows]
        assert np.array_equal(left, whole[(whole < 0.5) | (whole > 1.0)])
        assert len(left) < len(whole)
        return
    assert found.estimates["F_C"].value == 1.6
    assert found.correlation.names == tuple(name for name in RESULT_ORDER if name in alone.correlation.names)


@pytest.mark.parametrize(
    ("record", "speeds", "used"), [("sine.csv", 7, False), ("sine.csv", 8, True), ("constant.csv", 7, True)]
)
def test_doubts_of_stage_1_count_where_it_is_used(
    calls: dict[str, Any], monkeypatch: pytest.MonkeyPatch, record: str, speeds: int, used: bool
) -> None:
    own = stationary(estimates())
    plateaus = tuple(replace(p, record=record) for p in own.plateaus[: 2 * speeds])
    few = Finding("speeds-few", "doubt", "3 speeds only")
    vague = Finding("parameter-undetermined", "doubt", "gamma: vague", "gamma")
    doubtful = replace(own, plateaus=plateaus, warnings=(few,))
    monkeypatch.setattr(stages, "stationary", lambda *words, **more: doubtful)
    alone = replace(dynamic(estimates()), estimates=estimates(), warnings=(vague,))
    monkeypatch.setattr(stages, "dynamic", lambda *words, **more: alone)
    found = identify(records(), no_law, options())
    assert found.prior == used
    assert (few in found.warnings) == found.prior
    assert vague in found.warnings
    assert found.stationary is doubtful
    # Stage 1 alone is what there is: its doubts are those of the result.
    monkeypatch.setattr(stages, "transitions", lambda records: ())
    assert few in identify(records(), no_law, options()).warnings


def test_nothing_to_be_found(calls: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stages, "plateaus", lambda record, J: ())
    monkeypatch.setattr(stages, "transitions", lambda records: ())
    with pytest.raises(InputError, match="no stretches at constant speed; no reversals"):
        identify(records(), no_law, options())
    with pytest.raises(InputError, match="no records"):
        identify((), no_law, options())


def test_records_with_sines_come_first() -> None:
    plain, waves = records()
    assert [record.name for record in transitions((plain, waves))] == ["sine.csv"]
    time = np.arange(2000) * 2e-3
    back = Record("back", time, np.zeros(2000), speed=np.cos(np.pi * time / 4))
    ahead = Record("ahead", time, np.zeros(2000), speed=1 + 0.1 * np.sin(time))
    assert [record.name for record in transitions((ahead, back))] == ["back"]


def test_files_count_one_after_the_other_and_pieces_by_their_time() -> None:
    def record(first: float, last: float) -> Record:
        time = np.linspace(first, last, 101)
        return Record("x", time, np.zeros(101), speed=np.ones(101))

    assert record_starts([record(0.0, 10.0)]) == [0.0]
    # The second begins 5 s after the first; the third is another file.
    assert record_starts([record(2.0, 10.0), record(15.0, 20.0), record(0.0, 4.0), record(0.0, 1.0)]) == [
        0.0,
        13.0,
        18.0,
        22.0,
    ]


def test_correlation_of_both_stages() -> None:
    whole = identification()
    first, second = whole.stationary, whole.dynamic
    merged = merged_correlation(first, second, LUGRE)
    assert first is not None
    assert second is not None
    for part in (first.correlation, second.correlation):
        at = [merged.names.index(name) for name in part.names]
        assert merged.matrix[np.ix_(at, at)] == pytest.approx(part.matrix, abs=1e-15)
    assert np.isnan(merged.matrix[merged.names.index("F_C"), merged.names.index("W")])
    assert merged_correlation(None, None, LUGRE).names == Correlation((), np.eye(0)).names


def test_names_take_as_many_folders_as_needed(tmp_path: Path) -> None:
    files = [tmp_path / "a" / "x" / "log.csv", tmp_path / "b" / "x" / "log.csv", tmp_path / "sine.csv"]
    assert distinct(files) == ("a/x/log.csv", "b/x/log.csv", "sine.csv")
    with pytest.raises(InputError, match="given twice"):
        distinct([*files, tmp_path / "a" / ".." / "sine.csv"])
