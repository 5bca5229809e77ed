"""feedsim compare as a user and a CI server meet it: exit codes, what is told, report, JUnit XML, JSON."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.io import savemat

from compare_helpers import changed, wave, written
from feedsim.cli import main
from feedsim.files.trace import Series

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def reference(tmp_path: Path) -> Path:
    return written(tmp_path / "reference.csv", wave())


@pytest.fixture
def off(tmp_path: Path) -> Path:
    """Position 5 um off around 0.5 s, and no flag."""
    whole = wave()
    near = (whole.time > 0.45) & (whole.time < 0.55)
    bump = changed(whole, Z__x_a=whole["Z.x_a"] + 5e-6 * near * np.cos(10 * np.pi * (whole.time - 0.5)))
    return written(
        tmp_path / "off.csv",
        Series(bump.time, {n: bump[n] for n in ("Z.x_a", "Z.M_a")}, {"Z.x_a": "m", "Z.M_a": "N.m"}),
    )


def run(*words: str | Path) -> int:
    return main(["compare", *map(str, words)])


def test_exit_codes(reference: Path, off: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(reference, reference, "--tol", "0") == 0
    assert "same: 3 variables" in capsys.readouterr().out
    assert run(off, reference, "--common", "--tol", "*.x_a=6 um") == 0
    assert run(off, reference, "--common", "--tol", "*.x_a=4 um") == 1
    out = capsys.readouterr().out
    assert "worst Z.x_a: off by 5e-06 m at 0.5 s, allowed 4e-06 m" in out
    assert run(off, reference) == 1
    assert "missing: Z.limited" in capsys.readouterr().out
    assert run(tmp_path / "nix.csv", reference) == 2
    assert run(off, reference, "--tol", "*.x_a=1 N.m", "--common") == 2
    assert "unit 'N.m' is that of a torque" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--tol", "Z.x_a=2 furlong"], "unknown unit 'furlong'"),
        (["--tol", "Z.x_a="], "no tolerance"),
        (["--tolerances", "nix.yaml"], "nix.yaml"),
        (["--column", "a"], "RESULT=REFERENCE is needed"),
        (["--column", "a=Z.x_a"], "the result has no column 'a'"),
        (["--only", "Y.*"], "the reference has no column 'Y.*'"),
        (["--unit", "Z.x_a=parsec"], "unknown unit"),
        (["--from", "1"], "has no unit"),
        (["--from", "5 s"], "the reference's 0 to 2 s (asked for from 5 s)"),
        (["--tol", "0,1 mm"], "two tolerances in value; write a decimal point, not a comma"),
        (["--axes", "Z"], "--axes Z: is for the record of a drive"),
        (["--machine", "scenarios/machines/test_centre"], "--columns or --reference-columns"),
        (["--shift", "3 mm"], "is a length"),
        (["--time", "clock"], "no column 'clock'"),
    ],
)
def test_options_that_are_wrong(
    reference: Path, words: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """2, and what is wrong is told; never 1."""
    assert run(reference, reference, *words) == 2
    told = capsys.readouterr()
    assert message in told.out + told.err
    assert "Traceback" not in told.err


def test_usage_errors_and_faults_of_our_own_are_unusable(
    reference: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(reference) == 2
    with pytest.raises(SystemExit) as left:
        run(reference, reference, "--nonsense")
    assert left.value.code == 2
    import feedsim.jobs.compare

    def broken(*_: object, **__: object) -> None:
        raise RuntimeError("a fault of our own")

    monkeypatch.setattr(feedsim.jobs.compare, "compare_series", broken)
    assert run(reference, reference) == 2
    assert "a fault of our own" in capsys.readouterr().err


def test_outputs_never_replace_inputs(reference: Path, off: Path, tmp_path: Path) -> None:
    before = reference.read_bytes()
    assert run(off, reference, "--report", reference) == 2
    assert run(off, reference, "--junit", off) == 2
    assert run(off, reference, "--junit", tmp_path / "x", "--report", tmp_path / "x") == 2
    assert run(off, reference, "--report", tmp_path) == 2
    assert reference.read_bytes() == before
    assert not (tmp_path / "x").exists()


def test_a_reader_that_goes_away_does_not_change_the_code(reference: Path, off: Path) -> None:
    reads, writes = os.pipe()
    os.close(reads)
    done = subprocess.run(
        [sys.executable, "-c", "from feedsim.cli import entry; entry()", "compare", str(off), str(reference)],
        env={**os.environ, "PYTHONPATH": str(ROOT / "master")}, stdout=writes, stderr=subprocess.PIPE, check=False,
    )  # fmt: skip
    os.close(writes)
    assert (done.returncode, done.stderr) == (1, b"")


def test_report(reference: Path, off: Path, tmp_path: Path) -> None:
    report = tmp_path / "made" / "out.html"
    assert run(off, reference, "--tol", "*.x_a=4 um", "--report", report, "--quiet") == 1
    text = report.read_text(encoding="utf-8")
    assert "<h1>Comparison: different</h1>" in text
    assert '<figure id="comparison-1" class="chart' in text
    assert "http://" not in text.replace("http://www.w3.org", "")
    tiles = text[text.index('class="keys"') : text.index("</header>")]
    for part in ("Z.x_a", "5×10⁻⁶", "4×10⁻⁶", "0.5"):
        assert part in tiles
    assert "the result has no column &#39;Z.limited&#39;" in text
    same = tmp_path / "same.html"
    assert run(reference, reference, "--report", same) == 0
    assert "<h1>Comparison: same</h1>" in same.read_text(encoding="utf-8")


def test_junit(reference: Path, off: Path, tmp_path: Path) -> None:
    """What GitHub, GitLab and Jenkins read: testsuites, testsuite, testcase with classname and name, failure, error."""
    xml = tmp_path / "out.xml"
    nix = tmp_path / "nix.csv"
    assert run(off, reference, reference, reference, nix, reference, "--tol", "1e-9", "--junit", xml, "--quiet") == 2
    root = ElementTree.parse(xml).getroot()
    assert root.tag == "testsuites"
    assert len(root) == 3
    totals = {"tests": 0, "failures": 0, "errors": 0}
    for suite in root:
        assert suite.tag == "testsuite"
        assert {each.tag for each in suite} <= {"properties", "testcase", "system-out"}
        cases = suite.findall("testcase")
        assert all(case.get("name") and case.get("classname") and float(case.get("time", "x")) >= 0 for case in cases)
        assert len({case.get("name") for case in cases}) == len(cases)
        counts = {
            "tests": len(cases),
            "failures": len(suite.findall("testcase/failure")),
            "errors": len(suite.findall("testcase/error")),
        }
        for name, count in counts.items():
            assert suite.get(name) == str(count)
            totals[name] += count
    assert {name: int(root.get(name, "")) for name in totals} == totals
    assert [suite.get("name") for suite in root] == [f"{r} against {reference}" for r in (off, reference, nix)]
    assert all(case.get("classname") == suite.get("name") for suite in root for case in suite.findall("testcase"))
    assert totals == {"tests": 4 + 4 + 1, "failures": 2, "errors": 1}
    failures = {case.get("name"): case.find("failure") for case in root[0].findall("testcase")}
    worst = failures["Z.x_a"]
    assert worst is not None
    assert "off by 5e-06 m at 0.5 s" in worst.get("message", "")
    assert "outside in" in (worst.text or "")
    assert failures["Z.limited"] is not None
    assert failures["Z.M_a"] is None


def test_json(reference: Path, off: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(off, reference, "--json", "--tol", "0") == 1
    found = json.loads(capsys.readouterr().out)
    assert found["verdict"] == "different"
    (pair,) = found["comparisons"]
    assert pair["worst"] == "Z.x_a"
    x = pair["variables"][0]
    assert (x["name"], x["verdict"], x["time"], x["allowed"]) == ("Z.x_a", "different", 0.5, 0.0)
    assert x["deviation"] == pytest.approx(5e-6, abs=1e-16)
    assert x["ratio"] is None  # infinite


def test_folders(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    results, references = tmp_path / "results", tmp_path / "references"
    for name in ("a.csv", "b.csv", "c.csv"):
        written(references / name, wave())
    written(results / "a.csv", wave())
    written(results / "b.csv", changed(wave(), Z__M_a=wave()["Z.M_a"] + 0.02))
    assert run(results, references) == 2
    assert "3 comparisons: 1 same, 1 different, 1 unusable" in capsys.readouterr().out
    written(results / "c.csv", wave())
    report = tmp_path / "out.html"
    assert run(results, references, "--report", report) == 1
    text = report.read_text(encoding="utf-8")
    assert "3 comparisons: different" in text
    assert text.count("<figure") == 1
    (references / "b.tolerances.yaml").write_text("variables: {'*.M_a': 0.1 N.m}", encoding="utf-8")
    assert run(results, references) == 0


def test_another_tools_columns_units_and_time(reference: Path, tmp_path: Path) -> None:
    whole = wave()
    theirs = Series(
        whole.time * 1e3 + 2.5,
        {"plant::Z.x_a": 1e3 * whole["Z.x_a"], "plant::Z.M_a": whole["Z.M_a"], "plant::Z.limited": whole["Z.limited"]},
    )
    heads = ["k_T", "plant::Z.x_a[REAL]", "plant::Z.M_a[REAL]", "plant::Z.limited[BOOL]"]
    result = written(tmp_path / "tool.csv", theirs, heads=heads, separator=";")
    words = ["--time", "k_T:ms", "--column", "plant::*=*", "--unit", "plant::*.x_a=mm", "--tol", "1e-9"]
    assert run(result, reference, *words) == 1
    assert run(result, reference, *words, "--shift", "-2.5 ms") == 0
    assert run(result, reference, *words, "--ignore", "*.limited", "--shift", "estimate", "--tol", "1e-6") == 0


def test_a_run_against_a_measured_record(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A drive's record with a mapping: scale in mm, current in A, a clock of its own."""
    h, late = 1e-3, 0.0123
    time = np.arange(2001) * h
    x = 0.1 + 0.05 * np.sin(2 * np.pi * (time - late))
    i_q = 3.0 * np.cos(2 * np.pi * (time - late)) / 2.0
    mapping = tmp_path / "columns.yaml"
    mapping.write_text(
        "time: {column: t, unit: ms}\nposition: {column: enc, unit: mm}\ncurrent: {column: iq, unit: A, sign: -1}\n"
        "pitch: 20 mm\ntorque_constant: 2 N.m/A\n",
        encoding="utf-8",
    )
    record = tmp_path / "record.mat"
    savemat(record, {"t": 1e3 * time, "enc": 1e3 * x, "iq": -i_q})
    result = written(tmp_path / "result.csv", wave(4001))
    words = [result, record, "--reference-columns", mapping, "--axes", "Z", "--tol", "1e-4"]
    assert run(*words) == 1
    capsys.readouterr()
    assert run(*words, "--shift", "estimate") == 0
    out = capsys.readouterr().out
    assert "same in 99 % of the rows: 2 variables" in out  # the record is shorter than the run
    assert "shifted by 12.3" in out
    assert run(result, record) == 2
    assert "no column in common: the result has no column 'enc'" in capsys.readouterr().out


def test_rules_that_match_nothing_are_told(reference: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Of the command line as any wrong option; of a file beside references only where the whole of it serves none."""
    assert run(reference, reference, "--tol", "Y.*=1 nm") == 2
    assert "--tol given for 'Y.*', which matches no column; there is Z.x_a, Z.M_a, Z.limited" in capsys.readouterr().out
    whole = wave()
    other = written(tmp_path / "other.csv", Series(whole.time, {"Z.x_a": whole["Z.x_a"]}, {"Z.x_a": "m"}))
    assert run(reference, reference, other, other, "--tol", "*.M_a=1 N.m") == 0  # serves one of the two
    assert run(other, other, reference, reference, "--tol", "*.M_b=1 N.m", "--junit", tmp_path / "out.xml") == 2
    assert len(ElementTree.parse(tmp_path / "out.xml").findall("testsuite/testcase/error")) == 2
    capsys.readouterr()
    file = tmp_path / "tolerances.yaml"
    file.write_text("value: 1e-3\nvariables: {'*.M_a': 1 N.m, 'Y.*': 1 nm}", encoding="utf-8")
    assert run(reference, reference, other, other) == run(other, other) == 0
    out = capsys.readouterr().out
    assert "2 comparisons: 2 same" in out
    assert out.count("note") == 2  # and that a file is compared with itself, where it is alone
    assert "tolerances.yaml: matches no column: '*.M_a', 'Y.*'" in out
    assert run(reference, reference, other, other, "--tolerances", file) == 0  # asked for by its name
    assert "tolerances.yaml: matches no column: 'Y.*'" in capsys.readouterr().out


def test_one_bad_cell(reference: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """File, row and value; on either side it is unusable, and --ignore leaves it out."""
    lines = reference.read_text(encoding="utf-8").splitlines()
    cells = lines[16].split(",")
    lines[16] = ",".join([*cells[:2], "1.2.3", *cells[3:]])
    bad = tmp_path / "bad.csv"
    bad.write_text("\n".join(lines), encoding="utf-8")
    for pair in ((bad, reference), (reference, bad)):
        assert run(*pair) == 2
        out = capsys.readouterr().out
        assert f"cannot be compared: Z.M_a ({bad}:17: '1.2.3' in column 'Z.M_a' is no number)" in out
        assert "missing" not in out
        assert "Then --column" not in out
        assert run(*pair, "--shift", "estimate", "--ignore", "*.M_a") == 0
        capsys.readouterr()
    text = [f"{line},{'run' if i else 'Z.M_b'}" for i, line in enumerate(lines)]
    bad.write_text("\n".join(text), encoding="utf-8")
    assert run(bad, reference, "--ignore", "Z.M_a", "--common") == 0
    assert "columns of text in the result are not compared: Z.M_b" in capsys.readouterr().out
    assert run(bad, reference, "--column", "Z.M_b=Z.M_a") == 2
    assert "the result's column 'Z.M_b' holds text" in capsys.readouterr().out


def test_no_number_as_the_worst(reference: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    values = wave()["Z.x_a"].copy()
    values[7] = np.nan
    report = tmp_path / "out.html"
    assert run(written(tmp_path / "nan.csv", changed(wave(), Z__x_a=values)), reference, "--report", report) == 1
    text = report.read_text(encoding="utf-8")
    assert "no number" in text
    assert not re.search(r"no number (m|of)\b", text)


def test_the_first_line_says_why(reference: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A tolerance for all columns that fits only some of them; and which of them it could be meant for."""
    assert run(reference, reference, "--tol", "2 nm") == 2
    line = capsys.readouterr().out.splitlines()[0]
    assert line.count("unusable") == 1
    assert "cannot be compared: Z.M_a, Z.limited (its tolerance: unit 'nm' is that of a length;" in line
    assert "give it to the columns that it is for, such as '*.x_a=2 nm'" in line
    assert run(reference, reference, "--tol", "2 nm", "--only", "Z.M_a") == 2
    assert re.search(r"unusable: cannot be compared: Z\.M_a \(.", capsys.readouterr().out)


def test_an_estimated_shift_of_nothing_is_0(
    reference: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    late = written(tmp_path / "late.csv", Series(wave().time + 0.3, wave().columns, wave().units))
    assert run(reference, reference, "--shift", "estimate") == 0
    assert run(late, reference, "--shift", "estimate", "--max-shift", "0.4 s", "-v") == 0
    out = capsys.readouterr().out
    assert "shifted by -300 ms" in out
    assert not re.search(r"e-[0-9]+ (s|ns)\b", out)


def simulate(archive: Path, folder: Path) -> subprocess.CompletedProcess[str]:
    words = [str(archive), f"references/{archive.stem}", f"results/{archive.stem}"]
    command = [sys.executable, str(ROOT / "ci" / "simulate.py"), *words]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    "unit",
    [
        *(pytest.param(unit, marks=pytest.mark.extensive) for unit in ("friction", "friction_gms", "controller")),
        "plant",
        "setpoint",
    ],
)
def test_the_script_for_integrators(unit: str, fmus: Path, tmp_path: Path) -> None:
    """The references in an archive through FMPy, with the tolerances that lie beside them."""
    done = simulate(fmus / f"{unit}.fmu", tmp_path)
    assert done.returncode == 0, done.stderr
    assert run(tmp_path / "results", tmp_path / "references") == 0


def test_the_script_for_integrators_wants_references(fmus: Path, tmp_path: Path) -> None:
    """The whole machine has none in its archive; a check of nothing is no success."""
    done = simulate(fmus / "machine.fmu", tmp_path)
    assert done.returncode == 1
    assert done.stderr.endswith("machine.fmu: holds no reference results\n")


def test_names_do_not_command_the_terminal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name, value in (("a", 1), ("b", 2)):
        (tmp_path / f"{name}.csv").write_text(f"time,x\x1b[2J\x9b\n0,{value}\n1,{value}\n", encoding="utf-8")
    for files in (["a.csv", "b.csv"], ["a.csv", "\x1b[31m.csv"]):
        assert main(["compare", *(str(tmp_path / each) for each in files), "-v"]) in (1, 2)
    told = "".join(capsys.readouterr())
    assert "x\\x1b[2J\\x9b" in told
    assert all(c.isprintable() or c == "\n" for c in told)


@pytest.mark.filterwarnings("error")
def test_names_that_the_pictures_font_lacks_are_not_warned_of(tmp_path: Path) -> None:
    for name, value in (("a", 1), ("b", 2)):
        (tmp_path / f"{name}.csv").write_text(f"time,軸位置\n0,{value}\n1,{value}\n", encoding="utf-8")
    report = tmp_path / "report.html"
    assert main(["compare", str(tmp_path / "a.csv"), str(tmp_path / "b.csv"), "--report", str(report)]) == 1
    assert "軸位置" in report.read_text(encoding="utf-8")
