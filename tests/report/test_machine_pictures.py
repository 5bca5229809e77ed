"""Pictures of structures and modes: made, not empty, and showing what moves."""

from __future__ import annotations

import io
import json
import re
from functools import cache
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from feedsim import cli
from feedsim.foundation.errors import InputError
from feedsim.report.machine import FRAMES, telling_view
from feedsim.report.machine_record import (
    FRONT_VIEW,
    MODE_DEFLECTION,
    OBLIQUE,
    SIDE_VIEW,
    TOP_VIEW,
    Model,
    model,
    motion,
    solids,
    turn_vectors,
    view,
)
from feedsim.scenario.structure import Structure
from feedsim.scenario.structure_checks import load_structure
from feedsim.structure.build import Built, build
from feedsim.structure.geometry.outline import node_motion

ROOT = Path(__file__).resolve().parents[2]
TEST_CENTRE, ONE_AXIS = (ROOT / "scenarios" / "machines" / name for name in ("test_centre", "one_axis"))
MATRICES, CALCULIX = (ROOT / "scenarios" / "structures" / name for name in ("matrix_market", "calculix"))
POSES = {TEST_CENTRE: {"X": 0.8, "Y": 0.327, "Z": 0.1}, ONE_AXIS: {"X": 0.3}, CALCULIX: {}}
Capture = pytest.CaptureFixture[str]


@cache
def ready(folder: Path) -> tuple[Structure, Built, Model]:
    structure = load_structure(folder)
    built = build(structure, POSES[folder])
    return structure, built, model(structure, built.assembly)


def pixels(png: Path) -> NDArray[np.float64]:
    with Image.open(png) as image:
        return np.asarray(image.convert("RGB"), dtype=np.float64) / 255


def painted(image: NDArray[np.float64]) -> float:
    """Share of the pixels that are not paper."""
    return float(np.mean(np.abs(image - image[2, 2]).max(axis=2) > 0.02))


def hue(image: NDArray[np.float64], channel: int) -> float:
    """Share of the pixels in which one colour stands out."""
    others = np.delete(image, channel, axis=2).max(axis=2)
    return float(np.mean(image[..., channel] - others > 0.1))


def test_structure_and_sheet_of_the_default_machine(tmp_path: Path, capsys: Capture) -> None:
    assert cli.main(["machine", "view", str(TEST_CENTRE), "--out", str(tmp_path)]) == 0
    assert str(tmp_path / "report.html") in capsys.readouterr().out
    names = {"structure.png", "structure.svg", "modes.png", "modes.svg"}
    assert {path.name for path in (tmp_path / "figures").iterdir()} == names
    structure = pixels(tmp_path / "figures" / "structure.png")
    assert painted(structure) > 0.2
    # Bed blue, column red, slide green: all of them to be seen.
    assert min(hue(structure, channel) for channel in range(3)) > 0.005
    assert painted(pixels(tmp_path / "figures" / "modes.png")) > 0.2
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    for words in ("9062 kg", "21.085", "rocking about X", "Synthetic machine", "SHA-256"):
        assert words in page
    assert not re.search(r'(src|href)="(?!data:|#)', page)  # self-contained
    summary = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert set(summary["files"]) == {f"figures/{name}" for name in names} | {"report.html", "summary.json"}
    for name in ("structure.svg", "modes.svg"):
        text = (tmp_path / "figures" / name).read_text(encoding="utf-8")
        assert ElementTree.fromstring(text).get("width")
        assert "var(--" not in text


@pytest.mark.extensive
def test_a_mode_by_its_frequency_still_and_in_motion(tmp_path: Path, capsys: Capture) -> None:
    arguments = ["machine", "view", str(TEST_CENTRE), "--mode", "21Hz", "--animate", "--out", str(tmp_path)]
    assert cli.main(arguments) == 0
    said = capsys.readouterr().out
    (row,) = (line for line in said.splitlines() if line.startswith("3 "))
    assert re.match(r"3 +21\.085 +6 +bed 50 % \(moving along Z and rocking about X\)", row)
    figures = tmp_path / "figures"
    assert {path.name for path in figures.iterdir()} == {
        *("structure.png", "structure.svg", "mode_3.png", "mode_3.svg", "mode_3.gif")
    }
    assert painted(pixels(figures / "mode_3.png")) > 0.15
    assert 'aria-label="Mode 3: 21.09 Hz, damping 6 %"' in (figures / "mode_3.svg").read_text(encoding="utf-8")
    with Image.open(figures / "mode_3.gif") as gif:
        assert gif.n_frames == FRAMES
        frames = []
        for k in (0, FRAMES // 4, 3 * FRAMES // 4):
            gif.seek(k)
            frames.append(np.asarray(gif.convert("RGB"), dtype=float))
    # At rest and at both ends there are three different pictures.
    for one, other in ((0, 1), (1, 2), (0, 2)):
        assert np.mean(np.abs(frames[one] - frames[other]).max(axis=2) > 40) > 0.01
    # Another look at the machine leaves nothing of this one behind.
    assert cli.main(["machine", "view", str(ONE_AXIS), "--mode", "9", "--quiet", "--out", str(tmp_path)]) == 0
    assert {path.name for path in figures.iterdir()} == {
        *("structure.png", "structure.svg", "mode_9.png", "mode_9.svg")
    }


def test_the_side_view_is_chosen_that_shows_the_motion() -> None:
    """21 Hz is the bed rocking about X, 25 Hz rocking about Z, 42 Hz turning about Y."""
    _, built, of = ready(TEST_CENTRE)
    assert [telling_view(of, motion(built, of, k)) for k in (3, 4, 6)] == [SIDE_VIEW, FRONT_VIEW, TOP_VIEW]


def test_deflections_are_of_a_size_to_be_seen() -> None:
    _, built, of = ready(TEST_CENTRE)

    def largest(k: int, scale: float = 1.0) -> float:
        displacements, _ = node_motion(of.geometry, motion(built, of, k, scale).shape)
        return float(np.linalg.norm(displacements, axis=1).max())

    # Nearly all of the energy of 21 Hz is in translations of beams.
    assert largest(3) == pytest.approx(MODE_DEFLECTION * of.size, rel=0.05)
    assert largest(3, 2.0) == pytest.approx(2 * largest(3))
    # Rigid motion of an axis is mostly a rotor that turns: the bodies must not fly away.
    assert largest(2) < 0.7 * MODE_DEFLECTION * of.size
    # 46 % of that mode's energy is in the rotor, of 21 Hz 1 %: drawn angles go with the root of it.
    turning, still = (abs(motion(built, of, k).rotors["rotor Z"]) for k in (2, 3))
    assert turning > 0.5
    assert still < 0.2 * turning


def test_solids_have_the_machines_size() -> None:
    _, _, of = ready(TEST_CENTRE)
    corners = np.concatenate([group.corners.reshape(-1, 3) for group in solids(of, None)])
    # The bed's outer beams: 3200 mm long, ends of cross beams (220 mm wide) beyond; 620 mm high about Y 550 mm.
    assert corners[:, 0].min() == pytest.approx(-1.6 - 0.11)
    assert corners[:, 1].min() == pytest.approx(0.55 - 0.31)
    assert corners[:, 2].max() == pytest.approx(1.45 + 0.16)


def test_turning_keeps_lengths() -> None:
    rng = np.random.default_rng(1)
    vectors, rotations = rng.normal(size=(5, 3)), rng.normal(size=(4, 3)) * 2
    found = turn_vectors(vectors, rotations)
    assert np.linalg.norm(found, axis=2) == pytest.approx(np.tile(np.linalg.norm(vectors, axis=1), (4, 1)))
    quarter = turn_vectors(np.array([[1.0, 0, 0]]), np.array([[0, 0, np.pi / 2]]))
    assert quarter[0, 0] == pytest.approx([0, 1, 0], abs=1e-15)
    assert turn_vectors(vectors, np.zeros((1, 3)))[0] == pytest.approx(vectors)


def test_y_is_up_in_every_view_but_from_above() -> None:
    for where in (OBLIQUE, FRONT_VIEW, SIDE_VIEW, view("", (-1, 2, 0.3))):
        x, y = where.flat(np.array([0.0, 1.0, 0.0]))
        assert x == pytest.approx(0, abs=1e-15)
        assert y > 0
    for where in (OBLIQUE, FRONT_VIEW, SIDE_VIEW, TOP_VIEW):
        assert where.basis @ where.basis.T == pytest.approx(np.eye(3), abs=1e-15)
        assert np.linalg.det(where.basis) == pytest.approx(1)
    assert FRONT_VIEW.flat(np.array([1.0, 2.0, 3.0])) == pytest.approx([1, 2])
    assert TOP_VIEW.flat(np.array([1.0, 2.0, 3.0])) == pytest.approx([1, -3])


def test_matrices_with_a_mesh_are_drawn_as_lines(tmp_path: Path, capsys: Capture) -> None:
    assert cli.main(["machine", "view", str(CALCULIX), "--mode", "420 Hz", "--out", str(tmp_path)]) == 0
    assert painted(pixels(tmp_path / "figures" / "mode_2.png")) > 0.01
    assert "moving along Y" in capsys.readouterr().out


def test_matrices_without_nodes_say_what_is_missing(tmp_path: Path, capsys: Capture) -> None:
    out = tmp_path / "out"
    assert cli.main(["machine", "view", str(MATRICES), "--out", str(out)]) == 2
    error = capsys.readouterr().err
    for words in ("where the nodes are", "key nodes", "key lines"):
        assert words in error
    assert not out.exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--mode", "23"], "--mode 23: there are 23 modes, 0 to 22, up to 984.4 Hz"),
        (["--mode", "5 kg"], "--mode 5 kg: the number of a mode or a frequency is needed"),
        (["--mode", "100Hz"], "--mode 100Hz: no mode near; the nearest is 57.5 Hz"),
        (["--mode", "0Hz"], "--mode 0Hz: a frequency above 0 Hz is needed"),
        (["--animate"], "--animate: which mode?"),
        (["--scale", "big"], "--scale big: auto, or a factor"),
        (["--scale", "-1", "--mode", "3"], "--scale -1: auto, or a factor"),
    ],
)
def test_show_refuses(arguments: list[str], words: str, tmp_path: Path, capsys: Capture) -> None:
    out = tmp_path / "out"
    assert cli.main(["machine", "view", str(ONE_AXIS), *arguments, "--out", str(out)]) == 2
    assert words in capsys.readouterr().err
    assert not out.exists()


def test_same_picture_twice(tmp_path: Path) -> None:
    for name in ("a", "b"):
        assert (
            cli.main(["machine", "view", str(ONE_AXIS), "--mode", "9", "--quiet", "--out", str(tmp_path / name)]) == 0
        )
    for file in ("structure.png", "mode_9.png", "mode_9.svg"):
        assert (tmp_path / "a" / "figures" / file).read_bytes() == (tmp_path / "b" / "figures" / file).read_bytes()
    assert io.BytesIO((tmp_path / "a" / "figures" / "mode_9.png").read_bytes()).read(4) == b"\x89PNG"


def test_model_without_geometry_is_refused() -> None:
    structure = load_structure(MATRICES)
    built = build(structure, {})
    with pytest.raises(InputError, match="where the nodes are"):
        model(structure, built.assembly)
