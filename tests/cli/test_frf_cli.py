"""feedsim frf as a user meets it: what it writes, that it agrees with itself, messages and exit codes."""

from __future__ import annotations

import hashlib
import json
import shutil
import sys
import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from command_helpers import Done, feedsim, summary_of
from feedsim.analysis import Figure
from feedsim.analysis.campaign import Plan, signal_of
from feedsim.analysis.responses import Responses, frequencies, read_overlays
from feedsim.files.trace.response import FrequencyResponse
from feedsim.files.trace.response_files import read_response_csv, write_response
from feedsim.foundation import parallel
from feedsim.foundation.errors import Finding, InputError, OutputError
from feedsim.jobs.frf import MachineResponses, frf, result_of
from feedsim.linear.loops import names, response, unit_of
from feedsim.report import frf as report
from feedsim.report.content import Picture
from feedsim.report.frf import report as report_module
from feedsim.report.frf.bode_plots import curves_of, speed_controlled_pictures
from feedsim.report.frf.report import report_of
from feedsim.report.page import html, script
from feedsim.scenario import load_machine, load_subject
from feedsim.simulation.cosim import excite
from feedsim.structure import checked_modes
from frf_helpers import responses, subject
from report_helpers import Page, contents
from scenario_helpers import MACHINE, default_machine

ROOT = Path(__file__).resolve().parents[2]
SCENARIO = ROOT / "scenarios" / "z_positioning.yaml"


@pytest.mark.skipif(sys.platform != "linux", reason="processes are forked on Linux alone")
def test_axes_and_measurements_side_by_side_have_the_same_bits(fmus: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(threading, "active_count", lambda: 1)
    found = []
    for cores in (1, 3):
        monkeypatch.setattr(parallel, "cores", lambda cores=cores: cores)
        assert parallel.may_fork() == (cores > 1)
        with monkeypatch.context() as here:
            measured_here = []
            here.setattr(excite, "checked_modes", lambda machine, m=measured_here: m.append(machine))
            found.append(frf(MACHINE, "X,Z", band=(5.0, 200.0), settle=1, full_model=False, fmus=fmus).value.responses)
        assert len(measured_here) == (5 if cores == 1 else 0)  # two axes, three directions of the tool
    one, several = found
    assert one.result == several.result
    assert one.campaign is not None
    assert several.campaign is not None
    assert list(one.campaign.response.columns) == list(several.campaign.response.columns)
    for name, column in one.campaign.response.columns.items():
        np.testing.assert_array_equal(column, several.campaign.response.columns[name])
    assert list(map(vars, one.campaign.excited)) == list(map(vars, several.campaign.excited))


@pytest.fixture(scope="module")
def done(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Done, Path]:
    """One run from a scenario with a setting, measured, with a curve laid over."""
    folder = tmp_path_factory.mktemp("frf")
    f = np.array([20.0, 60.0, 180.0])
    bench = FrequencyResponse(f, {"bench": 1e3 / (1j * f)}, {"bench": "rpm/(N.m)"})
    write_response(folder / "bench.csv", bench)
    words = [
        "--axes",
        "Z",
        "--no-tool",
        "--band",
        "2Hz..600Hz",
        "--settle",
        "1",
        "--set",
        "machine.axes.Z.drive.K_v=50 1/s",
    ]
    overlay = ["--overlay", "bench.csv:Z.n_a/Z.M_a"]
    return feedsim("frf", SCENARIO, "--out", "out", "--figures", "png", *words, *overlay, fmus=fmus, cwd=folder), folder


def test_everything_is_written_and_told(done: tuple[Done, Path]) -> None:
    process, folder = done
    assert (process.returncode, process.stderr) == (0, "")
    first, of_axis, trust, *_, last = process.stdout.splitlines()
    assert ": The control loops are stable; least gain margin " in first
    assert first.endswith("All loops meet 6 dB and 30 deg. No gain needs to be reduced.")
    assert "without friction" in trust
    assert "Measured against closed form" in trust
    assert last == f"-> {Path('out') / 'report.html'}"
    assert of_axis.startswith("  Z: speed loop -3 dB first 71.7 Hz, last 208 Hz, margins 64 deg, ")
    files = set(contents(folder / "out"))
    assert {"frf.csv", "frf_measured.csv", "summary.json", "report.html", "figures/speed-reference.png"} <= files
    assert set(summary_of(folder / "out")["files"]) == files


def test_curves_can_be_read_back(done: tuple[Done, Path]) -> None:
    folder = done[1] / "out"
    closed, measured = (read_response_csv(folder / name) for name in ("frf.csv", "frf_measured.csv"))
    assert closed.names == names(("Z",), tool=False)
    assert measured.names == ("Z.n_a/Z.M_a", "Z.x_a/Z.M_a", "Z.n_a/Z.n_s")
    assert 2.0 <= measured.frequency[0] < 2.5
    assert 599 < measured.frequency[-1] <= 600
    assert closed.frequency[-1] == pytest.approx(1200.0)
    assert all(measured.coherence[name].min() > 0.99 for name in measured)
    # From one grid to the other: interpolated over lg f in steps h of a third of the damping ratio. Midway at a peak or
    # dip of ratio zeta, where lg of the magnitude bends by 1/zeta^2, that is off by (h/zeta)^2/8: 0.12 dB.
    limit = 20 / np.log(10) / 9 / 8
    values = closed["Z.n_a/Z.M_a"]
    logarithm = np.log(np.abs(values)) + 1j * np.unwrap(np.angle(values))
    at = np.exp(np.interp(np.log(measured.frequency), np.log(closed.frequency), logarithm))
    assert np.max(np.abs(20 * np.log10(np.abs(at / measured["Z.n_a/Z.M_a"])))) < limit


def test_summary_tells_figures_inputs_and_excitation(done: tuple[Done, Path]) -> None:
    summary = summary_of(done[1] / "out")
    figures = summary["figures"]
    assert figures["Z.speed.bandwidth_first"]["unit"] == "Hz"
    # exact against exact: what is left is rounding, seen through 60 dB of response
    assert figures["Z.n_M.measured_magnitude"]["value"] < 1e-3
    assert figures["Z.n_n.measured_phase"]["value"] < 1e-2
    assert figures["Z.n_M.measured_share"]["value"] == 100
    assert "5 to 500 Hz" in figures["Z.n_M.measured_magnitude"]["meaning"]
    assert not any(name.startswith(("X.", "Y.", "tool.")) for name in figures)
    assert summary["subject"]["overrides"] == ["machine.axes.Z.drive.K_v=50 1/s"]
    assert summary["machine"]["axes"]["Z"]["drive"]["K_v"]["value"] == 50
    assert summary["measurement"]["excited"]["Z.n_add"]["rms"]["unit"] == "rad/s"
    assert summary["measurement"]["friction"] is False
    assert summary["units"]["plant"]["guid"]
    assert {"python", "numpy", "feedsim"} <= set(summary["software"])
    files = {item["role"]: (item["name"], item["sha256"]) for item in summary["inputs"]}
    assert list(files) == ["scenario", "machine", "modes", "overlay"]
    digest = hashlib.sha256((done[1] / "bench.csv").read_bytes()).hexdigest()
    assert files["overlay"] == ("bench.csv", digest)
    assert summary["overlays"] == [{"response": "Z.n_a/Z.M_a", "file": "bench.csv", "unit": "(rad/s)/(N.m)"}]
    assert str(done[1]) not in json.dumps(summary)


def test_truncation_is_told_of_what_is_shown_alone(done: tuple[Done, Path]) -> None:
    summary = summary_of(done[1] / "out")
    told = {name for name in summary["figures"] if "truncation" in name}
    ends = ("truncation_below", "truncation", "truncation_below_corrected", "truncation_corrected")
    assert told == {f"Z.{quantity}.{end}" for quantity in ("n_M", "x_M") for end in ends}
    pictures = {name for name in summary["files"] if "truncation" in name and name.endswith(".png")}
    assert pictures == {"figures/truncation-n_M.png", "figures/truncation-x_M.png"}
    n_M = {end: summary["figures"][f"Z.n_M.{end}"]["value"] for end in ends}
    assert n_M["truncation_below_corrected"] < n_M["truncation_below"] <= n_M["truncation"]


def machine_folder(tmp_path: Path, **replaced: str) -> Path:
    """A copy of the default machine, the values of some keys of its file replaced."""
    folder = tmp_path / "machine"
    shutil.copytree(MACHINE, folder)
    file = folder / "machine.yaml"
    lines = file.read_text(encoding="utf-8").splitlines()
    kept = [line for line in lines if line.partition(":")[0] not in replaced]
    text = [*kept, *(f"{key}: {value}" for key, value in replaced.items())]
    file.write_text("\n".join(text) + "\n", encoding="utf-8")
    return folder


def test_a_faulty_structure_costs_the_comparison_alone(fmus: Path, tmp_path: Path) -> None:
    folder = machine_folder(tmp_path, structure="structure.yaml")
    (folder / "structure.yaml").write_text("bodies: 3\n", encoding="utf-8")
    words = ["--axes", "Z", "--no-tool", "--no-measure", "--out", "out"]
    process = feedsim("frf", folder, *words, fmus=fmus, cwd=tmp_path)
    assert process.returncode == 0, process.stderr
    assert "warning: no comparison with the full model: " in process.stderr
    assert not any("truncation" in name for name in summary_of(tmp_path / "out")["figures"])


@pytest.mark.extensive
def test_a_plant_that_follows_the_pose_agrees_with_the_closed_form(fmus: Path, tmp_path: Path) -> None:
    plant = tmp_path / "machine" / "plant.fmu"
    folder = machine_folder(tmp_path, plant="plant.fmu")
    words = ["machine", "pack", MACHINE, "--poses", "Z=60mm..240mm/60mm", "--out", plant]
    process = feedsim(*words, fmus=fmus, cwd=tmp_path)
    assert process.returncode == 0, process.stderr
    words = ["--axes", "Z", "--no-tool", "--no-full-model", "--settle", "1", "--periods", "1", "--out", "out"]
    process = feedsim("frf", folder, *words, fmus=fmus, cwd=tmp_path)
    assert process.returncode == 0, process.stderr
    assert "the modes are those of the archive's cell about Z 0.09 m; pose: Z 0.1 m" in process.stderr
    figures = summary_of(tmp_path / "out")["figures"]
    # By the table of modes at 100 mm it would be 1.8 dB; what is left is what has not settled.
    assert figures["Z.n_M.measured_share"]["value"] == 100
    assert figures["Z.n_M.measured_magnitude"]["value"] < 1e-3


def test_page_is_self_contained_and_says_that_numbers_are_synthetic(
    done: tuple[Done, Path],
) -> None:
    text = (done[1] / "out" / "report.html").read_text(encoding="utf-8")
    page = Page(text)
    assert page.tags.count("script") == 2  # the curves, and what draws them
    assert text.count(script()) == 1
    assert all(r.startswith(("#", "data:image/png;base64,")) for r in page.references)
    assert len(page.ids) == len(set(page.ids))
    words = " ".join(page.words)
    assert "Synthetic machine" in words
    assert "Measured against closed form" in words
    assert "multisine into n_add" in words
    assert "bench.csv" in words


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--axes", "X,Q"], ["no axis 'Q'", "X, Y, Z"]),
        (["--band", "5"], ["--band 5", "1Hz..1000Hz"]),
        (["--band", "0Hz..100Hz"], ["band 0 to 100 Hz", "above 0"]),
        (["--band", "1Hz..9kHz"], ["9000 Hz", "half the sampling rate"]),
        (["--band", "1Hz..2mm"], ["--band 2mm", "length"]),
        (["--amplitude", "3 N.m"], ["--amplitude 3 N.m", "torque"]),
        (["--offset-speed", "5"], ["--offset-speed 5", "no unit"]),
        (["--periods", "0"], ["--periods 0", "at least 1"]),
        (["--set", "axes.Z.drive.K_q=3"], ["unknown key 'K_q'", "axes.Z.drive"]),
        (["--set", "machine.axes.Z.drive.K_v=-1 1/s"], ["K_v", "-1 1/s", "at least 0"]),
        (["--overlay", "none.csv"], ["none.csv"]),
    ],
)
def test_wrong_input_ends_with_2_and_nothing_written(
    words: list[str], told: list[str], fmus: Path, tmp_path: Path
) -> None:
    process = feedsim("frf", MACHINE, "--out", "out", *words, fmus=fmus, cwd=tmp_path)
    assert process.returncode == 2, process.stderr
    assert "Traceback" not in process.stderr
    for word in told:
        assert word in process.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_written_is_found_before_the_work(fmus: Path, tmp_path: Path) -> None:
    (tmp_path / "out").write_text("mine")
    process = feedsim("frf", MACHINE, "--out", "out", fmus=fmus, cwd=tmp_path)
    assert process.returncode == 4, process.stderr
    assert (tmp_path / "out").read_text() == "mine"


def test_curves_laid_over_are_not_lost(fmus: Path, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    curve = tmp_path / "out" / "frf.csv"
    write_response(curve, responses().closed)
    before = curve.read_bytes()
    words = ["--axes", "Z", "--no-measure", "--out", "out", "--overlay", "out/frf.csv"]
    done = feedsim("frf", MACHINE, *words, fmus=fmus, cwd=tmp_path)
    assert done.returncode == 4, done.stderr
    assert "frf.csv: is an input and would be replaced" in done.stderr
    assert curve.read_bytes() == before
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"frf.csv"}


def test_friction_at_standstill_is_warned_of(fmus: Path, tmp_path: Path) -> None:
    words = ["--axes", "Z", "--no-tool", "--friction", "--realisations", "1", "--settle", "1", "--band", "20Hz..200Hz"]
    process = feedsim("frf", MACHINE, "--out", "out", *words, "--quiet", fmus=fmus, cwd=tmp_path)
    assert (process.returncode, process.stdout) == (0, "")
    assert "warning: axis Z stands still with friction on" in process.stderr
    assert "the coherence says nothing of what is not linear" in process.stderr
    assert "stands still with friction on" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


def test_unstable_loops_are_told_and_not_measured(fmus: Path, tmp_path: Path) -> None:
    words = ["--axes", "Z", "--no-tool", "--set", "axes.Z.drive.K_v=700 1/s", "--out", "out"]
    process = feedsim("frf", MACHINE, *words, fmus=fmus, cwd=tmp_path)
    assert process.returncode == 0, process.stderr
    assert process.stderr.count("unstable with") == 1
    assert "the control loops are unstable" not in process.stderr  # said once, with the gain
    assert "margins" not in process.stdout.splitlines()[2]
    assert "WRONG: axis Z: the position loop is unstable with K_v = 42 (m/min)/mm" in process.stderr
    assert ": The control loops are UNSTABLE (" in process.stdout.splitlines()[1]  # after the gain that is WRONG
    assert summary_of(tmp_path / "out")["answer"][0] in process.stdout
    assert not (tmp_path / "out" / "frf_measured.csv").exists()


def test_thin_margins_are_told_with_the_loop_and_the_gain_that_would_do(fmus: Path, tmp_path: Path) -> None:
    words = ["--axes", "Z", "--no-tool", "--no-measure", "--set", "axes.Z.drive.K_v=300 1/s", "--out", "out"]
    process = feedsim("frf", MACHINE, *words, fmus=fmus, cwd=tmp_path)
    assert "axis Z: the position loop has thin margins with K_v = 18 (m/min)/mm" in process.stderr
    first, _, trust, *_ = process.stdout.splitlines()
    figures = summary_of(tmp_path / "out")["figures"]
    least = 20 * np.log10(figures["Z.position.gain_margin"]["value"])
    assert f"least gain margin {least:.1f} dB (position loop of Z, " in first
    assert "Less than the usual 6 dB and 30 deg: motions ring there." in first
    assert "not measured" in trust
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert '<p class="answer">The control loops are stable; least gain margin' in page


# -- parts -------------------------------------------------------------------------------------------------------------


def test_a_machine_is_told_from_a_scenario_by_its_keys() -> None:
    by_folder, by_file = load_subject(MACHINE), load_subject(MACHINE / "machine.yaml")
    assert by_folder.kind == by_file.kind == "machine"
    assert [role for role, _ in by_file.files] == ["machine", "modes"]
    by_scenario = load_subject(SCENARIO, ["machine.axes.Z.drive.K_p=5 N.m.s/rad"])
    assert (by_scenario.kind, by_scenario.name) == ("scenario", "Z positioning")
    assert by_scenario.machine.axes["Z"].drive.K_p == 5
    assert [role for role, _ in by_scenario.files] == ["scenario", "machine", "modes"]


def test_settings_of_a_machine_file() -> None:
    for key in ("axes.*.drive.K_v", "machine.axes.*.drive.K_v"):
        machine = load_machine(MACHINE, [f"{key}=10 1/s"])
        assert {axis.drive.K_v for axis in machine.axes.values()} == {10.0}
    with pytest.raises(InputError, match=r"2 problems[\s\S]*unknown key 'axis' in the machine[\s\S]*KEY=VALUE"):
        load_machine(MACHINE, ["axis.Z=1", "nothing"])


def test_names_of_responses() -> None:
    machine = default_machine()
    modes = checked_modes(machine)
    assert frequencies(machine, modes, (1.0, 1000.0))[[0, -1]] == pytest.approx([1, 1000])
    assert frequencies(machine, modes, (1.0, 3000.0), beyond=2.0)[-1] == pytest.approx(3996)
    assert unit_of("Z.x_a/Z.M_a") == "m/(N.m)"
    assert unit_of("tool.x_X/tool.F_X") == "m/N"
    assert unit_of("Z.speed_loop") == "1"
    with pytest.raises(InputError, match=r"no frequency response 'Z\.n_a'; there are X\.n_a/X\.M_a"):
        response(responses_system(), "Z.n_a", np.array([1.0]))


def responses_system() -> Any:
    from feedsim.analysis import linear

    machine = default_machine()
    return linear.LinearSystem(machine, checked_modes(machine))


def test_a_binary_sequence_covers_the_band() -> None:
    machine = default_machine()
    signal = signal_of(machine, Plan(signal="prbs", band=(1.0, 1000.0)), 2.0, 1)
    assert signal.frequency[0] <= 1.5
    assert 998 < signal.frequency[-1] <= 1000
    assert np.max(np.diff(signal.frequency)) < 2
    assert signal.rms == pytest.approx(2.0)


def test_curves_laid_over_are_converted_or_taken_as_they_are(tmp_path: Path) -> None:
    known = names(("Z",), tool=True)
    f = np.array([1.0, 10.0])
    write_response(tmp_path / "c.csv", FrequencyResponse(f, {"a": [2.0, 4.0]}, {"a": "um/N"}))
    (overlay,), warnings = read_overlays(f"{tmp_path / 'c.csv'}:tool.x_X/tool.F_X", known)
    assert overlay.response["tool.x_X/tool.F_X"] == pytest.approx([2e-6, 4e-6])
    assert (overlay.file, warnings) == (tmp_path / "c.csv", [])
    write_response(tmp_path / "d.csv", FrequencyResponse(f, {"Z.x_a/Z.M_a": [2.0, 4.0], "other": [1.0, 1.0]}))
    (overlay,), (warning,) = read_overlays(str(tmp_path / "d.csv"), known)
    assert overlay.name == "Z.x_a/Z.M_a"
    assert (warning.code, warning.place) == ("unit-assumed", "Z.x_a/Z.M_a")
    assert "it is taken to be in m/(N.m)" in warning.text
    with pytest.raises(InputError, match=r"holds none of the responses shown, but a\. Say which it is"):
        read_overlays(str(tmp_path / "c.csv"), known)
    with pytest.raises(InputError, match="um/N"):
        read_overlays(f"{tmp_path / 'c.csv'}:Z.n_a/Z.M_a", known)


@pytest.fixture
def one_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    """Drawing is slow, and what is drawn does not matter."""

    def only(found: Responses) -> list[Picture]:
        return speed_controlled_pictures({"Z": curves_of(found, "Z.n_a/Z.M_a")}, None)

    monkeypatch.setattr(report_module, "pictures_of", only)


@pytest.mark.usefixtures("one_picture")
def test_a_report_is_replaced_whole(tmp_path: Path) -> None:
    result_of(MachineResponses(subject(), responses())).save(tmp_path)
    first = contents(tmp_path)
    assert "frf_measured.csv" in first
    (tmp_path / "notes.txt").write_text("mine")
    result_of(MachineResponses(subject(), responses(measured=False))).save(tmp_path)
    second = contents(tmp_path)
    assert "frf_measured.csv" not in second, "the curves of an earlier measurement are left"
    assert set(first) - set(second) == {"frf_measured.csv"}
    assert (tmp_path / "notes.txt").read_text() == "mine"
    result_of(MachineResponses(subject(), responses(measured=False))).save(tmp_path)
    assert contents(tmp_path) == second


@pytest.mark.usefixtures("one_picture")
def test_nothing_is_left_when_a_picture_cannot_be_moved(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    result_of(MachineResponses(subject(), responses())).save(tmp_path)
    before = contents(tmp_path)
    move = Path.replace

    def failing(self: Path, target: Path) -> Path:
        if self.name == "report.html" and "fresh" in self.parts:
            raise OSError(28, "No space left on device")
        return move(self, target)

    monkeypatch.setattr(Path, "replace", failing)
    with pytest.raises(OutputError, match="No space left on device"):
        result_of(MachineResponses(subject(), responses(measured=False))).save(tmp_path)
    assert contents(tmp_path) == before


def test_names_and_warnings_cannot_break_the_page() -> None:
    odd = replace(subject(), name='<script>"&', notes=("a < b",))
    text = html(report_of(odd, responses(warnings=(Finding("not-settled", "doubt", "gain < 1"),)), []))
    plain = Page(html(report_of(subject(), responses(warnings=(Finding("not-settled", "doubt", "gain < 1"),)), [])))
    assert Page(text).tags.count("script") == plain.tags.count("script")  # those of the chart
    assert '<script>"&' not in text
    assert text.index("gain &lt; 1") < text.index("a &lt; b") < text.index('class="keys"')


@pytest.mark.usefixtures("one_picture")
def test_figures_that_are_not_determined_are_null_and_said(tmp_path: Path) -> None:
    found = responses(figures={"Z.speed.bandwidth_first": Figure(float("nan"), "Hz", "m")})
    result_of(MachineResponses(subject(), found)).save(tmp_path)
    summary = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert summary["figures"]["Z.speed.bandwidth_first"]["value"] is None
    assert "not determined" in (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "-3 dB first - Hz" in report.answers(found)[1]


def test_a_rigid_machine_is_measured_without_a_warning_of_numpy(fmus: Path, tmp_path: Path) -> None:
    """Nothing is divided by the compliance at the tool, which is zero."""
    place = ROOT / "scenarios" / "machines" / "emps"
    result = feedsim("frf", place, "--out", tmp_path / "frf", fmus=fmus, cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert "RuntimeWarning" not in result.stderr
    assert "measured n/M within" in result.stdout


@pytest.mark.parametrize("machine", ["sinumerik_840d", "emps", "one_axis"])
def test_every_shipped_machine_is_taken(fmus: Path, tmp_path: Path, machine: str) -> None:
    """Rigid axes have no compliance at the tool, and a slow cycle no response at 1 kHz."""
    place = ROOT / "scenarios" / "machines" / machine
    result = feedsim("frf", place, "--no-measure", "--out", tmp_path / "frf", fmus=fmus, cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    codes = [each["code"] for each in summary_of(tmp_path / "frf")["findings"]]
    assert ("response-zero" in codes) == (machine != "one_axis")
