"""`import feedsim`: what a person types, what is shown, what completion offers; the examples of the docstrings."""

from __future__ import annotations

import copy
import doctest
import math
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import feedsim as fs
from feedsim.foundation import installation
from feedsim.foundation.errors import InputError
from feedsim.simulation import cosim

ROOT = Path(__file__).resolve().parents[2]
DWELL = {"motions": [{"kind": "dwell", "duration": "20 ms"}], "evaluate": []}
LOGGED = {
    "motions.2.speeds.count": 4,
    "motions.1.duration": "1 s",
    "motions.2.duration": "1 s",
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What a user has who has copied the examples and logged an axis."""
    folder = tmp_path_factory.mktemp("user")
    fs.example(["xz_circle", "z_positioning", "z_stop", "identify_z_constant"], folder)
    logged = fs.run(folder / "identify_z_constant.yaml", set=LOGGED)
    logged.save(folder / "logged")
    (folder / "logged" / "log.csv").rename(folder / "log.csv")
    return folder


@pytest.fixture(scope="module")
def circle(folder: Path) -> fs.Result:
    return fs.run(folder / "xz_circle.yaml")


@pytest.mark.parametrize("module", ["feedsim", "feedsim.jobs.examples", "feedsim.foundation.installation"])
def test_examples_of_docstrings(module: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    found = doctest.testmod(import_module(module))
    assert found.attempted
    assert not found.failed


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(n, marks=pytest.mark.extensive) if n in ("tune_compensation", "tune_drive") else n
        for n in fs.__all__
    ],
)
def test_every_name_of_the_front_door_has_an_example(name: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    example = doctest.DocTestParser().get_doctest(getattr(fs, name).__doc__, {}, name, None, None)
    assert example.examples
    assert not doctest.DocTestRunner().run(example).failed


def test_results_over_each_other(folder: Path, circle: fs.Result, tmp_path: Path) -> None:
    """Of a prompt and of a folder: figures and parameters side by side, a page in a notebook, the same as a report."""
    stiff = fs.run(folder / "xz_circle.yaml", set={"machine.axes.Z.drive.K_v": "5 (m/min)/mm"})
    stiff.save(tmp_path / "stiff")
    over = fs.diff(circle, stiff=tmp_path / "stiff")
    assert over.names == (circle.scenario.name, "stiff")
    first, second = over.side_by_side["XZ.G"]
    assert first is not None
    assert second is not None
    assert (first.value, second.value) == (circle.figures["XZ.G"].value, stiff.figures["XZ.G"].value)
    assert list(over.parameters) == ["machine.axes.Z.drive.K_v"]
    assert over.pictures
    assert repr(over).startswith("Result of diff: XZ: circular deviation G 8.19 -> ")
    changed, differs = over.lines
    assert changed.startswith("XZ: circular deviation G 8.19 -> ")
    assert differs.startswith("differs: machine.axes.Z.drive.K_v")
    html = over._repr_html_()
    assert html.startswith("<iframe")
    assert "&lt;html" in html
    assert {path.name for path in over.save(tmp_path / "over")} >= {"report.html", "summary.json"}
    with pytest.raises(InputError, match="two results are called 'stiff'"):
        fs.diff(tmp_path / "stiff", stiff=stiff)
    with pytest.raises(InputError, match="no result is given"):
        fs.diff()


def test_the_front_door_offers_public_names_and_has_them_all() -> None:
    names = dir(fs)
    assert not [name for name in names if name.startswith("_")]
    assert {"load", "run", "identify_friction", "compare", "sweep", "frf", "example"} <= set(names) == set(fs.__all__)
    assert all(getattr(fs, name) is not None for name in names)
    with pytest.raises(AttributeError, match="no attribute 'plot_all'"):
        fs.plot_all  # noqa: B018


def test_a_file_and_what_was_loaded_give_the_same(folder: Path) -> None:
    file = folder / "z_positioning.yaml"
    by_file = fs.run(file, set=DWELL)
    loaded = fs.run(fs.load(file, DWELL))
    assert by_file["Z.x_a"].tobytes() == loaded["Z.x_a"].tobytes()
    with pytest.raises(InputError, match="set: changes are for a file"):
        fs.run(fs.load(file), set=DWELL)


def test_set_means_what_it_means_on_the_command_line(folder: Path) -> None:
    changes = {"machine.axes.Z.drive.K_v": "5 (m/min)/mm", "coupling.substeps": 2, "evaluate": []}
    texts = ["machine.axes.Z.drive.K_v=5 (m/min)/mm", "coupling.substeps=2", "evaluate=[]"]
    file = folder / "z_positioning.yaml"
    assert fs.load(file, changes) == fs.load(file, texts)
    assert fs.load(file, changes) != fs.load(file)


def test_an_ssp_file_runs(folder: Path) -> None:
    from feedsim.simulation import ssp

    scenario = fs.load(folder / "z_positioning.yaml", DWELL)
    ssp.export(scenario, folder / "dwell.ssp")
    result = fs.run(folder / "dwell.ssp")
    assert np.abs(result["Z.x_a"] - fs.run(scenario)["Z.x_a"]).max() < 1e-9


def test_frequency_responses_cover_the_band_that_is_asked_for(folder: Path) -> None:
    response = fs.frf(folder / "machines" / "test_centre", ["Z"], band=(2.0, 300.0), tool=False, measure=False)
    assert response.frequency[[0, -1]] == pytest.approx([2.0, 600.0], rel=1e-12)  # gain margins lie above the band
    assert repr(response.response).startswith("FrequencyResponse: 2 to 600 Hz; ")


def test_representations_are_short(circle: fs.Result, folder: Path) -> None:
    response = fs.frf(folder / "machines" / "test_centre", ["Z"], tool=False, measure=False)
    shown = [circle, circle.trace, circle.scenario, circle.scenario.machine, circle.plot(), response]
    shown += [cosim.run(fs.load(folder / "z_positioning.yaml", DWELL)), fs.compare(circle, circle)]
    for each in shown:
        text = repr(each)
        assert "\n" not in text
        assert 10 < len(text) < 300, text
        assert len(str(each)) < 300
    assert repr(circle).startswith("Result of run: XZ: G = 8.2 um. Main cause: reversal peaks of Z ")


def test_a_notebook_shows_the_report_and_that_it_is_synthetic(circle: fs.Result) -> None:
    page = circle._repr_html_()
    assert page.startswith("<iframe")
    for shown in ("XZ.G", "contour", "Synthetic machine"):
        assert shown in page


def test_what_the_value_has_the_result_has(circle: fs.Result) -> None:
    """Attributes, items and completion; a name that is nowhere is said to be none of the value."""
    assert circle.value.trace is circle.trace
    assert circle["Z.x_a"] is circle.value["Z.x_a"]
    assert {"trace", "causes", "figures", "findings", "answers", "save", "plot", "kind"} <= set(dir(circle))
    assert not [name for name in dir(circle) if name.startswith("_")]
    assert "resonance" not in dir(circle)
    with pytest.raises(AttributeError, match="resonance"):
        _ = circle.resonance
    assert copy.copy(circle).kind == "run"


def test_figures_are_a_table(circle: fs.Result) -> None:
    """With an interval where one is known."""
    frame = circle.figures.to_pandas()
    assert list(frame.columns) == ["value", "unit", "low", "high", "meaning"]
    assert frame.loc["XZ.G", "value"] == circle.figures["XZ.G"].value
    assert np.isnan(frame.loc["XZ.G", "low"])
    mismatch = frame.loc["XZ.servo_mismatch"]
    half = next(term.half for term in circle.causes["XZ"].terms if term.key == "servo")
    assert (mismatch["high"] - mismatch["low"]) == pytest.approx(2e3 * half, rel=1e-9)  # s, ms
    known = circle.figures.with_intervals({"XZ.G": (8.0, 8.4), "none": (0.0, 1.0), "XZ.H": (math.nan, math.nan)})
    assert known.to_pandas().loc["XZ.G", ["low", "high"]].tolist() == [8.0, 8.4]
    assert known["XZ.H"] == circle.figures["XZ.H"]
    assert known._repr_html_().count("<tr>") == len(known) + 1
    assert "8 to 8.4" in known._repr_html_()


def test_pictures(circle: fs.Result, tmp_path: Path) -> None:
    assert circle.plot().stem.startswith("contour")
    assert circle.plot().save(tmp_path / "circle.png").read_bytes().startswith(b"\x89PNG")
    assert "<svg" in circle.plot().save(tmp_path / "circle.svg").read_text(encoding="utf-8")
    two = circle.plot("Z.x_a", "X.M_*")
    assert two.caption.startswith("Z.x_a, X.M_") or "Z.x_a" in two.caption
    with pytest.raises(InputError, match=r"circle\.bmp: a picture is saved as \.png or \.svg"):
        circle.plot().save(tmp_path / "circle.bmp")
    with pytest.raises(InputError, match="no column"):
        circle.plot("Z.unknown")


def test_saved_is_what_the_command_leaves(circle: fs.Result, folder: Path, tmp_path: Path) -> None:
    names = {path.name for path in circle.save(tmp_path / "saved")}
    assert {"result.csv", "summary.json", "report.html"} <= names
    command = [sys.executable, "-m", "feedsim", "run", "xz_circle.yaml", "--out", str(tmp_path / "command")]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    for name in ("result.csv",):
        assert (tmp_path / "saved" / name).read_bytes() == (tmp_path / "command" / name).read_bytes()


def test_pandas_is_asked_for_only_where_it_is_used(circle: fs.Result, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)  # type: ignore[arg-type]
    said = r'a DataFrame needs .* pandas is not installed: pip install "feedsim\[pandas\]"'
    with pytest.raises(installation.MissingPackage, match=said):
        circle.to_pandas()


def test_a_data_frame_has_signals_over_time_with_their_units(circle: fs.Result) -> None:
    frame = circle.to_pandas()
    assert list(frame.columns) == list(circle.trace.names)
    assert frame.index.name == "time [s]"
    assert np.array_equal(frame["Z.x_a"].to_numpy(), circle["Z.x_a"])
    assert np.array_equal(frame.index.to_numpy(), circle.trace.time)
    assert frame.attrs["units"]["Z.x_a"] == "m"
