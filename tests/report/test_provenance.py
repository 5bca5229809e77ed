"""Where the numbers of a report come from: archives, coupling, inputs, parameters."""

from __future__ import annotations

import hashlib
import json
from dataclasses import replace
from pathlib import Path

from feedsim.report.page import html
from feedsim.report.provenance import archives, input_files
from feedsim.report.run.files import details
from feedsim.report.run.report import report_of
from feedsim.scenario import load
from report_helpers import FakeRun, Page, positioning_run, small_run, write_run
from scenario_helpers import MACHINE


def test_each_archive_stands_once() -> None:
    units = {
        "plant": {"guid": "p", "version": "1"},
        "controller_X": {"guid": "c", "version": "1"},
        "controller_Z": {"guid": "c", "version": "1"},
        "friction_X": {"guid": "f", "version": "1"},
        "friction_Z": {"guid": "other", "version": "1"},
    }
    found = [(a.name, a.guid, a.instances) for a in archives(units)]
    assert found == [
        ("plant", "p", ("plant",)),
        ("controller", "c", ("controller_X", "controller_Z")),
        ("friction", "f", ("friction_X",)),
        ("friction", "other", ("friction_Z",)),
    ]


def test_coupling_is_one_table_with_the_share(tmp_path: Path) -> None:
    coupling = {"Z.residual": -2e-5, "Z.residual_peak": 3e-5, "Z.friction_work": 80.0, "X.residual": 0.0}
    write_run(replace(positioning_run(), coupling=coupling), {}, tmp_path)
    words = " ".join(Page((tmp_path / "report.html").read_text(encoding="utf-8")).words)
    assert "Z 80 −2×10⁻⁵ 2.5×10⁻⁷" in words
    assert "X – 0 –" in words


def test_inputs_are_named_and_hashed(tmp_path: Path) -> None:
    (tmp_path / "positions.csv").write_text("time [s],Z.x_s [mm]\n0,0\n1,0\n", encoding="utf-8")
    (tmp_path / "soft.yaml").write_text("interval: 1 ms\n", encoding="utf-8")
    (tmp_path / "test.yaml").write_text(
        f"name: t\nmachine: {MACHINE}\nset: {{machine.axes.Z.friction.W: 0.1 rad}}\n"
        "motions: [{kind: setpoints, file: positions.csv, columns: {Z: Z.x_s}, relative: true}]\n"
        "recording: soft.yaml\n",
        encoding="utf-8",
    )
    described = load(tmp_path / "test.yaml", ["machine.axes.Z.friction.gamma=0.5"])
    content = details(FakeRun(described, positioning_run().program, positioning_run().trace), {}, {}, [])
    paths = {
        "scenario": tmp_path / "test.yaml",
        "machine": MACHINE / "machine.yaml",
        "recording": tmp_path / "soft.yaml",
        "modes": MACHINE / "modes.csv",
        "recorded setpoints": tmp_path / "positions.csv",
    }
    found = {item["role"]: (item["name"], item["sha256"]) for item in content["inputs"]}
    assert found == {r: (p.name, hashlib.sha256(p.read_bytes()).hexdigest()) for r, p in paths.items()}
    assert content["scenario"]["set"] == ["machine.axes.Z.friction.W=0.1 rad"]
    assert content["scenario"]["overrides"] == ["machine.axes.Z.friction.gamma=0.5"]
    assert str(tmp_path) not in json.dumps(content)
    (tmp_path / "positions.csv").unlink()
    assert [f.sha256 for f in input_files(described) if f.name == "positions.csv"] == [None]
    page = html(report_of(FakeRun(described, positioning_run().program, positioning_run().trace), {}, [], {}, []))
    assert "machine.axes.Z.friction.W=0.1 rad" in page
    assert str(tmp_path) not in page


def test_parameters_of_every_axis_are_in_si_under_the_names_of_the_units() -> None:
    run = small_run()
    axes = details(run, {}, {}, [])["machine"]["axes"]
    assert list(axes) == ["X", "Y", "Z"]
    for name, axis in run.scenario.machine.axes.items():
        assert axes[name]["pitch"] == {"value": axis.pitch, "unit": "m"}
        assert axes[name]["M_0"] == {"value": axis.M_0, "unit": "N.m"}
        for group, parameters in (("drive", axis.drive.parameters()), ("friction", axis.friction.parameters())):
            listed = {n: v["value"] if isinstance(v, dict) else v for n, v in axes[name][group].items()}
            assert listed == parameters
            bare = {n for n, v in axes[name][group].items() if isinstance(v, float)}
            assert not bare, f"{bare} without unit"
    assert axes["Z"]["drive"]["K_v"]["unit"] == "1/s"
    assert axes["Z"]["drive"]["filter_1.f"]["unit"] == "Hz"
    assert axes["Z"]["drive"]["current.K_p"]["unit"] == "V/A"
    assert axes["Z"]["friction"]["sigma_0"]["unit"] == "N.m/rad"
