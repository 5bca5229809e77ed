"""Draw the pictures of README and docs anew, from runs of the shipped examples: `make pictures`.

The same runs give the same pictures, byte for byte. Those of measurements are drawn where these are made: performance
by `make bench`, the grid of poses by `make pose-study`; that of the sweep by `make pictures ARGS=--all` (5632 runs).
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from diagrams import Drawing
from PIL import Image

import feedsim as fs
from feedsim import cli
from feedsim.analysis.circularity import contour as course_of
from feedsim.analysis.evaluate import CircleTask, tasks
from feedsim.report.compare import picture_of

ROOT = Path(__file__).resolve().parents[1]
IMAGES, SCENARIOS = ROOT / "docs" / "images", ROOT / "scenarios"
MACHINE = SCENARIOS / "machines" / "test_centre"
# Once, in less than 5 s, and not for readers who ask for less motion; else the whole curve stands.
MOVES = """
@media screen and (prefers-reduced-motion: no-preference) {
  .run { stroke-dasharray: 1; animation: run 4.8s linear; } .go { animation: go 4.8s linear; }
}
@keyframes run { from { stroke-dashoffset: 1; } to { stroke-dashoffset: 0; } }
@keyframes go { from { offset-distance: 0%; } to { offset-distance: 100%; } }
"""


def command(*words: str | Path) -> None:
    """A command as a person types it; ends this where it fails."""
    if code := cli.main([*map(str, words), "--quiet"]):
        sys.exit(code)


def taken(folder: Path, figure: str, name: str) -> None:
    """A figure that a command has drawn becomes an image of the docs."""
    shutil.copyfile(folder / "figures" / figure, IMAGES / name)


def contour(place: Path) -> None:
    """Of the README: the circle with its quadrant glitches."""
    command("run", SCENARIOS / "xz_circle.yaml", "--figures", "png", "--out", place)
    taken(place, "contour-XZ.png", "contour-XZ.png")


def moving(place: Path) -> None:
    """Of the first page: the same circle, counterclockwise, that draws itself once where the reader allows motion."""
    place.mkdir(parents=True)
    run = fs.run(SCENARIOS / "xz_circle.yaml")
    (task,) = (each for each in tasks(run.scenario, run.program) if isinstance(each, CircleTask))
    turn = course_of(run.trace, task.turns[0])
    middle, radius, magnified = (250.0, 215.0), 120.0, 7.5  # pixels, pixels, pixels per um
    drawing = Drawing(
        500, 430, "A circle with its quadrant glitches",
        "The programmed circle, and around it the simulated one, its deviation magnified: it is round but for a peak "
        "behind each of the four places where an axis reverses. The default machine is synthetic.",
    )  # fmt: skip
    r = radius + magnified * 1e6 * turn.deviation
    points = np.column_stack((middle[0] + r * np.cos(turn.angle), middle[1] - r * np.sin(turn.angle)))[::3]
    course = "M" + " L".join(f"{x:.1f},{y:.1f}" for x, y in (*points, points[0]))
    drawing.shapes += [
        f"<style>{MOVES}</style>",
        f'<circle cx="{middle[0]:g}" cy="{middle[1]:g}" r="{radius:g}" class="thin"/>',
        f'<path d="{course}" pathLength="1" class="curve run"/>',
        f'<circle r="6" class="dot go" style="offset-path: path(\'{course}\')"/>',
    ]
    for (dx, dy), end in (((0, -200), "Z+"), ((0, 200), "Z−"), ((205, 0), "X+"), ((-205, 0), "X−")):
        drawing.text((middle[0] + dx, middle[1] + dy), end, "head")
    drawing.text(middle, f"G {run.figures['XZ.G'].value:.2f} µm, at 3000 mm/min", "")
    (IMAGES / "circle-moves.svg").write_text(drawing.svg(), encoding="utf-8")


def stribeck(place: Path) -> None:
    """Of the README: plateaus and the curve identified through them, from logs with 5 % noise on the current."""
    logs = []
    for motion in ("constant", "sine"):
        scenario = SCENARIOS / f"identify_z_{motion}.yaml"
        command("run", scenario, "--set", "logging.noise.i_q=5 %", "--out", place / motion)
        logs.append(place / motion / "log.csv")
    command("identify", *logs, "--axes", "Z", "--machine", MACHINE, "--figures", "png", "--out", place / "found")
    taken(place / "found", "stribeck.png", "stribeck-Z.png")


def structure(place: Path) -> None:
    """Of README and user's guide: the machine, and its bed rocking."""
    command("machine", "show", MACHINE, "--out", place / "whole")
    taken(place / "whole", "structure.png", "structure.png")
    command("machine", "show", MACHINE, "--mode", "21Hz", "--out", place / "mode")
    taken(place / "mode", "mode_3.png", "mode-21-Hz.png")


def bode(place: Path) -> None:
    """Of the user's guide: speed-controlled system of Z, in closed form and measured."""
    command("frf", MACHINE, "--axes", "Z", "--figures", "png", "--out", place)
    taken(place, "speed-controlled-system.png", "bode-Z.png")


def tube(place: Path) -> None:
    """Of docs/comparing.md: a torque that is 1.25 ms late where 1 ms and 0.2 N.m are allowed."""
    reference = fs.run(SCENARIOS / "z_positioning.yaml").trace.select(["Z.M_a"])
    late = np.interp(reference.time - 1.25e-3, reference.time, reference["Z.M_a"])
    result = replace(reference, columns={"Z.M_a": late})
    picture = picture_of(fs.compare(result, reference, tol="Z.M_a=0.2 N.m,1 ms").comparisons[0], 1)
    if picture is None:
        sys.exit("nothing was compared")
    picture.save(IMAGES / "comparison.png")


def wear(place: Path) -> None:
    """Of docs/sweeps.md: which friction parameter moves the glitches."""
    command("sweep", SCENARIOS / "studies" / "friction_wear.yaml", "--figures", "png", "--out", place)
    taken(place, "distribution-XZ-glitch_Z.png", "friction-wear.png")


def gallery(place: Path) -> None:
    """Of the gallery: every script of examples/, its picture made small."""
    for script in sorted((ROOT / "examples").glob("*.py")):
        folder = place / script.stem
        folder.mkdir(parents=True)
        subprocess.run([sys.executable, script], cwd=folder, check=True, stdout=subprocess.DEVNULL)
        small(folder / f"{script.stem}.png", IMAGES / "gallery" / f"{script.stem}.png")


def small(picture: Path, target: Path) -> None:
    """A picture at most 800 pixels wide, in 64 colours: a tenth of the bytes."""
    with Image.open(picture) as opened:
        shrunk = opened.convert("RGB")
    shrunk.thumbnail((800, 2000), Image.Resampling.LANCZOS)
    shrunk.quantize(64, dither=Image.Dither.NONE).save(target, optimize=True)


DRAWN: tuple[Callable[[Path], None], ...] = (contour, moving, stribeck, structure, bode, tube, gallery)


def main() -> None:
    """Draw them one after another."""
    for draw in (*DRAWN, wear) if "--all" in sys.argv else DRAWN:
        print(f"{draw.__name__}: {str(draw.__doc__).splitlines()[0]}", flush=True)
        with TemporaryDirectory() as place:
            draw(Path(place) / draw.__name__)


if __name__ == "__main__":
    main()
