"""Jobs without a report: what is valid, what files must look like, recordings as CSV traces."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat
from threadpoolctl import threadpool_info, threadpool_limits

import feedsim as fs
from feedsim.cli import main
from feedsim.jobs.parameters import job
from feedsim.scenario.schema import json_schema

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
UNSTABLE = {"machine.axes.Z.drive.K_v": "29 (m/min)/mm"}
RECORD = SCENARIOS / "recordings" / "z_setpoint.csv"


def test_a_valid_scenario_is_said_to_be_so(capsys: pytest.CaptureFixture[str]) -> None:
    """The same words as the command prints, of a file and of what is loaded."""
    file = SCENARIOS / "z_positioning.yaml"
    done = fs.check(file)
    assert done.findings == ()
    assert done.answers == [f"{file}: valid; 2 motions, 2.448 s on Test centre"]
    assert main(["check", str(file)]) == 0
    assert capsys.readouterr().out == f"{done.answers[0]}\n"
    assert fs.check(fs.load(file)).answers == ["Z positioning: valid; 2 motions, 2.448 s on Test centre"]


def test_what_a_run_warns_of_is_told_ahead() -> None:
    done = fs.check(SCENARIOS / "z_positioning.yaml", set=UNSTABLE)
    assert isinstance(done.findings, tuple)
    first = done.findings[0]
    assert isinstance(first, fs.Finding)
    assert (first.code, first.severity, first.place) == ("loop-unstable", "wrong", "Z")
    assert str(first) == first.text
    assert repr(done).endswith("see .findings")


def test_what_is_faulty_is_refused() -> None:
    with pytest.raises(fs.InputError, match=r"machine\.axes\.Z\.drive\.K_v"):
        fs.check(SCENARIOS / "z_positioning.yaml", set={"machine.axes.Z.drive.K_v": "5 mm"})


def test_a_study_is_checked() -> None:
    done = fs.check(SCENARIOS / "studies" / "friction_wear.yaml")
    assert "valid; 5632 runs of" in done.answers[0]


@pytest.mark.parametrize("kind", ["scenario", "machine", "structure", "columns", "tolerances", "study"])
def test_schemas(kind: str) -> None:
    assert fs.schema(kind) == json_schema(kind)  # type: ignore[arg-type]


def test_no_such_schema() -> None:
    with pytest.raises(fs.InputError, match="kind is 'report'; allowed: scenario, machine"):
        fs.schema("report")


@pytest.mark.parametrize(("unit", "value"), [("mm", 250.0), ("m", 0.25)])
def test_a_unit_of_the_file_is_converted(unit: str, value: float, tmp_path: Path) -> None:
    """The header says [mm]."""
    fs.convert(RECORD, tmp_path / "out.csv", column=["time=time:s", f"Z.x_s=Z.x_a:{unit}"])
    written = fs.read_trace(tmp_path / "out.csv")
    assert written.unit("Z.x_a") == unit
    assert written["Z.x_a"][0] == value


def test_a_unit_of_another_dimension_is_refused(tmp_path: Path) -> None:
    with pytest.raises(fs.InputError, match=r"z_setpoint.csv: column 'Z.x_s': unit 'mm' is that of a length; one of"):
        fs.convert(RECORD, tmp_path / "out.csv", column="time=time:s, Z.x_s=Z.x_a:rad")
    assert not (tmp_path / "out.csv").exists()


def test_a_file_without_units_is_taken_at_its_word(tmp_path: Path) -> None:
    savemat(tmp_path / "r.mat", {"t": np.arange(4.0), "q": np.arange(4.0)})
    made = fs.convert(tmp_path / "r.mat", column="t=time:ms, q=Z.x_s:mm")
    assert made.content == b"time [s],Z.x_s [mm]\n0,0\n0.001,1\n0.002,2\n0.003,3\n"
    assert made.answers == [f"2 columns from {tmp_path / 'r.mat'}"]


def test_tables_of_others_stay(tmp_path: Path) -> None:
    out = tmp_path / "out.csv"
    out.write_text("mine")
    words = {"column": "time=time:s, Z.x_s=Z.x_a:m"}
    with pytest.raises(fs.OutputError, match="exists already"):
        fs.convert(RECORD, out, **words)
    assert out.read_text() == "mine"
    content = fs.convert(RECORD, out, force=True, **words).content
    assert out.read_bytes() == content
    fs.convert(RECORD, out, **words)  # the same once more
    with pytest.raises(fs.OutputError, match="is an input"):
        fs.convert(out, out, **words)


@pytest.mark.parametrize("asked", [None, "2"])
def test_linear_algebra_of_a_job_has_one_thread(asked: str | None, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its bits do not depend on the number of cores; afterwards it has as many as before. Whoever asks for some has
    them."""
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    if asked is not None:
        monkeypatch.setenv("OPENBLAS_NUM_THREADS", asked)

    def threads() -> list[int]:
        return [library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"]

    @job("count threads")
    def counted() -> list[int]:
        """Threads."""
        return threads()

    with threadpool_limits(2, user_api="blas"):
        before = threads()
        assert set(before) == {2}
        assert set(counted()) == ({1} if asked is None else {2})
        assert threads() == before
