"""NC programs on the command line: run, check, export, diff and studies take them as scenarios; refusals in words."""

from __future__ import annotations

import csv
import json
import re
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import feedsim as fs
from command_helpers import feedsim, summary_of
from feedsim.analysis import contours

MACHINE = Path("scenarios/machines/test_centre").absolute()
L_PIECE = (
    "; an L, and a circle within it\nN10 G17 G91 G94 G642 CTOL=0.01\n"
    "N20 G1 X5 F3000 M8\nN30 Y5\nN40 G3 X0 Y0 I-2 J0\nN50 M30\n"
)
# A program as each of five dialects writes it.
DIALECTS = {
    "sinumerik.mpf": "%_N_PART_MPF\nN10 G17 G90 G54 G64 G71\nN20 G0 X=IC(0) Z=IC(2) S8000 M3\nDEF REAL STEP\nSTEP=2\n"
    "N30 WHILE R1<2\nG1 X=IC(STEP) F2000 G642 CTOL=0.01\nY=IC(STEP) RND=0.5\nR1=R1+1\nENDWHILE\nX=IC(-1)\nM30\n",
    "fanuc.nc": "%\nO1234 (PART)\nG21 G17 G40 G49 G80 G90\nT1 M06\nG54 G00 X800. Y327. S6000 M03\nG43 H01 Z101. M08\n"
    "G01 X805. F1500.\nG02 X810. Y322. R5.\nG91 G01 Y-2.\nG90\nM30\n%\n",
    "linuxcnc.ngc": "(part)\nG21 G17 G90 G94 G64 P0.01\n#1 = 2\nF2400\nG0 X800 Y327\n"
    "G1 X[800+#1]\nG3 X[800-#1] I[-#1] J0\nM2\n",
    "grbl.gcode": "; part\nG21\nG90\nM3 S10000\nG0 Z101\nG1 X802.5 Y331 F1200\nX805 Y327\nG2 X805 Y323 I0 J-2\nM5\n",
    "heidenhain.h": "0 BEGIN PGM PART MM\n1 TOOL CALL 5 Z S4000\n2 L Z+101 R0 FMAX M3\n3 L X+803 Y+327 R0 F1200\n"
    "4 CC X+803 Y+330\n5 C X+803 Y+333 DR+\n6 L X+800\n7 L Y+330\n8 END PGM PART MM\n",
}


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory, fmus: Path) -> Path:
    """A folder with a program, and its results in out."""
    folder = tmp_path_factory.mktemp("ran")
    (folder / "part.mpf").write_text(L_PIECE)
    done = feedsim("run", "part.mpf", "--machine", MACHINE, "--out", "out", fmus=fmus, cwd=folder)
    assert done.returncode == 0, done.stderr
    (folder / "said").write_text(done.stdout)
    (folder / "noted").write_text(done.stderr)
    return folder


def blocks_of(folder: Path) -> list[dict[str, str]]:
    with (folder / "blocks.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_the_first_sentence_names_deviation_block_and_main_share(ran: Path) -> None:
    first = (ran / "said").read_text().splitlines()[0]
    found = re.fullmatch(
        r"contour: largest deviation from the programmed path ([\d.]+) um, in part.mpf:(\d) \((N\d0 .*)\), "
        r"at [\d.]+ s. "
        r"Main share: (plan|servo|friction), ([\d.]+) um. .*", first,
    )  # fmt: skip
    assert found, first
    summary = summary_of(ran / "out")
    figures = {name: entry["value"] for name, entry in summary["figures"].items()}
    assert float(found[1]) == pytest.approx(figures["contour.largest"], rel=5e-3)
    assert int(found[2]) == figures["contour.line"]
    assert found[3] == L_PIECE.splitlines()[int(found[2]) - 1]
    assert float(found[5]) == pytest.approx(figures[f"contour.{found[4]}"], rel=5e-3)
    assert summary["answer"][0] == first
    assert "M8 (part.mpf:3)" in (ran / "noted").read_text()
    (following,) = re.findall(r"^  feedsim (run .*)", (ran / "said").read_text(), re.MULTILINE)
    assert following.count(str(MACHINE)) == 1  # as --machine, not as a change as well


def test_all_files_say_the_same_of_the_blocks(ran: Path) -> None:
    """blocks.csv, summary.json and the figures; shares add up to the distance, those of axes to the share."""
    summary, rows = summary_of(ran / "out"), blocks_of(ran / "out")
    assert [row["line"] for row in rows] == ["3", "4", "5"]
    assert [row["text"] for row in rows] == L_PIECE.splitlines()[2:5]
    figures = {name: entry["value"] for name, entry in summary["figures"].items()}
    for ahead, by, shares in (("", "", ["plan", "servo", "friction"]),
                              ("tool ", "tool.", ["plan", "servo", "friction", "structure"])):  # fmt: skip
        largest = [float(row[f"{ahead}largest [um]"]) for row in rows]
        assert max(largest) == pytest.approx(figures[f"contour.{by}largest"], rel=1e-8)
        for row in rows:
            parts = [float(row[f"{ahead}{share} [um]"]) for share in shares]
            assert sum(parts) == pytest.approx(float(row[f"{ahead}largest [um]"]), abs=1e-6)
            for share, part in zip(shares, parts, strict=True):
                axes = [float(row[f"{ahead}{share} {axis} [um]"]) for axis in "XYZ"]
                assert sum(axes) == pytest.approx(part, abs=1e-6)
            assert float(row[f"{ahead}rms [um]"]) <= float(row[f"{ahead}largest [um]"])
    worst = summary["contours"]["contour"]["worst"]["scale"]
    assert [entry["line"] for entry in worst] == [
        int(row["line"]) for row in sorted(rows, key=lambda r: -float(r["largest [um]"]))
    ]
    times = [(float(row["begin [s]"]), float(row["end [s]"])) for row in rows]
    assert all(end == pytest.approx(begin, abs=1e-8) for (_, end), (begin, _) in pairwise(times))
    assert times[-1][1] == pytest.approx(figures["contour.duration"], abs=1e-8)
    page = (ran / "out" / "report.html").read_text(encoding="utf-8")
    assert 'id="contour-path"' in page
    assert 'id="contour-course"' in page
    assert "N40 G3 X0 Y0 I-2 J0" in page


def test_python_runs_the_same(ran: Path) -> None:
    result = fs.run(ran / "part.mpf", machine=MACHINE, friction_share=False)
    stored = summary_of(ran / "out")["figures"]
    assert result.figures["contour.largest"].value == pytest.approx(stored["contour.largest"]["value"], rel=1e-12)
    assert "contour.friction" not in result.figures  # it was not run without
    together = stored["contour.servo"]["value"] + stored["contour.friction"]["value"]
    assert result.figures["contour.servo"].value == pytest.approx(together, abs=1e-9)
    assert contours(result)["contour"].axes == ("X", "Y", "Z")


def test_two_settings_lie_side_by_side_block_by_block(ran: Path, fmus: Path) -> None:
    half = ["--set", "motions.0.feed_override=50 %", "--no-friction-share", "--out", "half"]
    assert feedsim("run", "part.mpf", "--machine", MACHINE, *half, fmus=fmus, cwd=ran).returncode == 0
    done = feedsim("diff", "out", "half", "--out", "both", fmus=fmus, cwd=ran)
    assert done.returncode == 0, done.stderr
    assert "differs: scenario.motions: program part.mpf | program part.mpf, feed override 50 %" in done.stdout
    assert "contour: largest deviation from the path" in done.stdout
    page = (ran / "both" / "report.html").read_text(encoding="utf-8")
    assert "Blocks of the NC program" in page
    for row in blocks_of(ran / "out"):
        assert f"{float(row['largest [um]']):.2f}" in page


def test_check_says_what_it_holds(ran: Path, fmus: Path) -> None:
    done = feedsim("check", "part.mpf", "--machine", MACHINE, fmus=fmus, cwd=ran)
    assert (done.returncode, done.stdout[:30]) == (0, "part.mpf: valid; 1 motion, 1.2"[:30]) or "valid" in done.stdout
    assert "passed over, for it moves no axis: M8 (part.mpf:3)" in done.stderr


@pytest.mark.parametrize("ending", ["fmu", "ssp"])
def test_other_simulators_get_its_setpoints(ran: Path, fmus: Path, ending: str) -> None:
    done = feedsim("export", "part.mpf", "--machine", MACHINE, "-o", f"part.{ending}", fmus=fmus, cwd=ran)
    assert done.returncode == 0, done.stderr
    if ending == "ssp":
        again = feedsim("run", "part.ssp", "--no-friction-share", "--out", "from_ssp", fmus=fmus, cwd=ran)
        assert again.returncode == 0, again.stderr
        assert (ran / "from_ssp" / "result.csv").read_bytes() == (ran / "out" / "result.csv").read_bytes()
        assert ", in part.mpf:" in again.stdout


@pytest.mark.parametrize(
    ("text", "machine", "said"),
    [
        (L_PIECE, None, "part.mpf: an NC program needs a machine: --machine MACHINE"),
        ("G91 G1 X5 F1000\nY5\n", "scenarios/machines/one_axis", "part.mpf:2: Y: the machine has no axis Y; it has X"),
        ("G90 G1 X2000 F1000\n", MACHINE, "part.mpf:1: G90 G1 X2000 F1000: axis X reaches 2000 mm; allowed"),
        ("; nothing to do\nM30\n", MACHINE, "part.mpf:.*: no movement is commanded"),
        ("G1 X5 F1000\nFROBNICATE\n", MACHINE, "part.mpf:2: FROBNICATE"),
        ("\x00\x01\x02", MACHINE, "part.mpf:1: byte 0x00: the file is binary"),
    ],
)  # fmt: skip
def test_what_cannot_be_run_is_a_sentence_and_leaves_nothing(
    tmp_path: Path, fmus: Path, text: str, machine: Path | str | None, said: str
) -> None:
    (tmp_path / "part.mpf").write_text(text)
    words = [] if machine is None else ["--machine", Path(machine).absolute()]
    done = feedsim("run", "part.mpf", *words, fmus=fmus, cwd=tmp_path)
    assert done.returncode == 2
    assert re.search(said, done.stderr)
    assert "Traceback" not in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["part.mpf"]


@pytest.mark.parametrize("name", DIALECTS)
def test_programs_of_five_dialects_run(tmp_path: Path, name: str) -> None:
    """As their controls' users write them; the axes end where the program says."""
    (tmp_path / name).write_text(DIALECTS[name])
    ends = {"sinumerik.mpf": (803, 331), "fanuc.nc": (810, 320), "linuxcnc.ngc": (798, 327), "grbl.gcode": (805, 323),
            "heidenhain.h": (800, 330)}  # fmt: skip
    result = fs.run(tmp_path / name, machine=MACHINE, friction_share=False)
    end = [result.program.x_s[axis][-1] * 1e3 for axis in "XY"]
    assert end == pytest.approx(ends[name], abs=1e-9)
    assert 0 < result.figures["contour.largest"].value < 50


def test_a_study_varies_tolerance_feed_and_limits(tmp_path: Path, fmus: Path) -> None:
    (tmp_path / "part.mpf").write_text("G91 G1 G642 CTOL=0.01 X2 F3000\nY2\n")
    (tmp_path / "s.yaml").write_text(
        f"name: s\nscenario: part.mpf\nset: {{machine: {MACHINE}}}\nsampling: {{method: grid}}\nparameters:\n"
        "  tolerance: {key: motions.0.tolerance, values: [2 um, 50 um]}\n"
        "  feed: {key: motions.0.feed_override, values: [50 %, 100 %]}\n"
        "  jerk: {key: machine.axes.*.max_jerk, values: [100 m/s^3]}\n"
        "figures: [contour.largest, contour.plan, contour.duration]\n"
    )
    done = feedsim("sweep", "s.yaml", "--workers", "1", "--out", "swept", fmus=fmus, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    with (tmp_path / "swept" / "table.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 4
    column = next(name for name in rows[0] if name.startswith("contour.duration"))
    durations = np.array([float(row[column]) for row in rows])
    assert len(set(durations)) == 4
    assert json.loads((tmp_path / "swept" / "summary.json").read_text())


def test_examples_of_programs_come_with_a_machine_and_run(tmp_path: Path, fmus: Path) -> None:
    names = [each.name for each in fs_examples() if each.kind == "program"]
    assert names == ["airfoil", "contour_piece", "fan", "square_diamond_circle", "square_four_angles"]
    assert feedsim("example", *names, fmus=fmus, cwd=tmp_path).returncode == 0
    for name in names:
        done = feedsim("check", f"programs/{name}.mpf", "--machine", "machines/test_centre", fmus=fmus, cwd=tmp_path)
        assert done.returncode == 0, done.stderr


def fs_examples() -> list[object]:
    from feedsim.jobs.examples import examples

    return list(examples())
