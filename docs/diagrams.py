"""Draw the block diagrams and sketches of the docs, in one style: `python docs/diagrams.py`, part of `make pictures`.

Start reading at DRAWINGS: a file of docs/images and the function that draws it. An SVG holds both palettes: it follows
the reader's light or dark page, and is dark on white in print. Nothing here is simulated: circles are sketches, and the
figures of the report are those that the first tutorial prints.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from html import escape
from math import cos, exp, radians, sin
from pathlib import Path

IMAGES = Path(__file__).resolve().parent / "images"
STYLE = """
:root { color-scheme: light dark; }
text { font: 14px system-ui, "Segoe UI", "DejaVu Sans", sans-serif; fill: #1b1f23; }
.small { font-size: 12px; } .note { fill: #57606a; font-size: 12px; } .head { font-weight: 600; }
.block { fill: #eaf3fa; stroke: #0060a0; stroke-width: 1.5; }
.frame { fill: none; stroke: #8c959f; stroke-width: 1.5; }
.group { fill: none; stroke: #8c959f; stroke-dasharray: 5 4; }
.sum { fill: #ffffff; stroke: #0060a0; stroke-width: 1.5; }
.wire { fill: none; stroke: #1b1f23; stroke-width: 1.5; } .tip, .dot { fill: #1b1f23; stroke: none; }
.thin { fill: none; stroke: #8c959f; stroke-width: 1; } .curve { fill: none; stroke: #0060a0; stroke-width: 2; }
.second { fill: none; stroke: #b35900; stroke-width: 2; stroke-dasharray: 6 4; }
@media screen and (prefers-color-scheme: dark) {
  text { fill: #e6edf3; } .note { fill: #9da7b1; } .block { fill: #12293a; stroke: #5ab4e6; }
  .sum { fill: #0d1117; stroke: #5ab4e6; } .wire { stroke: #e6edf3; } .tip, .dot { fill: #e6edf3; }
  .curve { stroke: #5ab4e6; } .second { stroke: #f0a050; }
}
"""
Point = tuple[float, float]


class Drawing:
    """Shapes of one picture, in pixels from the upper left corner."""

    def __init__(self, width: int, height: int, title: str, words: str) -> None:
        self.width, self.height, self.title, self.words = width, height, title, words
        self.shapes: list[str] = []

    def text(self, at: Point, text: str, kind: str = "", anchor: str = "middle") -> None:
        """Words with their middle line at `at`; parts behind _ are subscripts: "M_fr|" ends one early."""
        parts = []
        for word in text.split(" "):
            name, _, index = word.partition("_")
            below, _, rest = index.partition("|")
            tail = f'<tspan dy="4" font-size="75%">{escape(below)}</tspan><tspan dy="-4">{escape(rest)}&#8203;</tspan>'
            parts.append(escape(name) + (tail if index else ""))
        x, y = at
        self.shapes.append(
            f'<text x="{x:g}" y="{y + 5:g}" text-anchor="{anchor}" class="{kind}">{" ".join(parts)}</text>'
        )

    def box(self, x: float, y: float, width: float, height: float, *lines: str, kind: str = "block") -> None:
        """A block with its lines of words in the middle."""
        self.shapes.append(f'<rect x="{x:g}" y="{y:g}" width="{width:g}" height="{height:g}" rx="4" class="{kind}"/>')
        for number, line in enumerate(lines):
            middle = y + height / 2 + (number - (len(lines) - 1) / 2) * 18
            self.text((x + width / 2, middle), line, "head" if number == 0 and len(lines) > 1 else "")

    def group(self, x: float, y: float, width: float, height: float, name: str) -> None:
        """A dashed frame around blocks, with its name inside at the upper left."""
        self.shapes.append(f'<rect x="{x:g}" y="{y:g}" width="{width:g}" height="{height:g}" rx="6" class="group"/>')
        self.text((x + 8, y + 13), name, "note", "start")

    def sum(self, x: float, y: float, *signs: tuple[float, float, str]) -> None:
        """A summing point of radius 10; signs: where, from its middle, and which."""
        self.shapes.append(f'<circle cx="{x:g}" cy="{y:g}" r="10" class="sum"/>')
        self.text((x, y), "+", "small")
        for dx, dy, sign in signs:
            self.text((x + dx, y + dy), sign, "small")

    def dot(self, x: float, y: float) -> None:
        """Where a signal branches."""
        self.shapes.append(f'<circle cx="{x:g}" cy="{y:g}" r="3" class="dot"/>')

    def line(self, points: Sequence[Point], kind: str = "wire") -> None:
        """Straight pieces through points."""
        path = " L".join(f"{x:.2f},{y:.2f}" for x, y in points)
        self.shapes.append(f'<path d="M{path}" class="{kind}"/>')

    def arrow(self, *points: Point, label: str = "", at: Point | None = None, anchor: str = "middle") -> None:
        """A wire with its tip at the last point; its label above the first piece, or at `at`."""
        self.line(points)
        (x_0, y_0), (x, y) = points[-2:]
        length = max(abs(x - x_0) + abs(y - y_0), 1e-9)
        dx, dy = (x - x_0) / length * 9, (y - y_0) / length * 9
        corners = ((x, y), (x - dx - dy / 2, y - dy + dx / 2), (x - dx + dy / 2, y - dy - dx / 2))
        self.shapes.append(f'<polygon points="{" ".join(f"{a:g},{b:g}" for a, b in corners)}" class="tip"/>')
        if label:
            first, second = points[:2]
            self.text(at or ((first[0] + second[0]) / 2, first[1] - 12), label, anchor=anchor)

    def svg(self) -> str:
        """The picture as a file."""
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {self.width} {self.height}" width="{self.width}" '
            f'height="{self.height}" role="img" aria-labelledby="t d">\n<title id="t">{escape(self.title)}</title>\n'
            f'<desc id="d">{escape(self.words)}</desc>\n<style>{STYLE}</style>\n'
            + "\n".join(self.shapes)
            + "\n</svg>\n"
        )


def coupling() -> Drawing:
    """Fig. 2 of the paper: three models and what they exchange."""
    it = Drawing(
        800, 300, "Coupling of the models",
        "The numerical control gives position setpoint and speed feedforward to the controller of each axis. The "
        "controller gives the motor torque to the plant, which gives motor speed and position back. The plant gives "
        "the speed at the friction contact to the friction model, which gives the friction torque back.",
    )  # fmt: skip
    it.group(176, 12, 548, 276, "for every axis; one plant for all of them")
    it.box(16, 70, 110, 60, "NC", "every T_pos")
    it.box(220, 70, 150, 60, "controller", "every T_c")
    it.box(520, 70, 150, 60, "plant", "modes")
    it.box(520, 210, 150, 60, "friction", "LuGre")
    it.arrow((126, 88), (220, 88), label="x_s", at=(151, 76))
    it.arrow((126, 112), (220, 112), label="n_ffw", at=(151, 124))
    it.arrow((370, 88), (520, 88), label="M_a", at=(445, 76))
    it.arrow((520, 112), (440, 112), (440, 170), (295, 170), (295, 130), label="n_a , x_a", at=(368, 184))
    it.arrow((560, 130), (560, 210), label="n_fr", at=(538, 170))
    it.arrow((630, 210), (630, 130), label="M_fr", at=(655, 170))
    it.arrow((670, 88), (772, 88), label="tool.x", at=(720, 76))
    it.arrow((772, 112), (670, 112), label="tool.F", at=(725, 126))
    return it


def controller() -> Drawing:
    """Cascade of one axis, as the controller's page writes it."""
    it = Drawing(
        980, 420, "Controller of one axis",
        "Position setpoint, delayed by dynamic matching and symmetry filter, less the position, times the position "
        "gain over the lead, plus the speed feedforward, ramped over the position cycle, is the speed setpoint. The "
        "speed controller has its proportional part on setpoint less speed, its integral part on the reference model's "
        "output less speed. Their sum, limited, is the torque setpoint. It passes four filters, the current "
        "controller and the motor, and becomes the motor torque.",
    )  # fmt: skip
    it.group(8, 8, 964, 118, "position controller, every T_pos")
    it.arrow((24, 60), (70, 60), label="x_s", at=(40, 48))
    it.box(70, 40, 130, 40, "T_dyn + T_sym")
    it.arrow((200, 60), (270, 60))
    it.sum(280, 60, (14, 22, "−"))
    it.arrow((280, 112), (280, 70), label="x_a", at=(260, 100))
    it.arrow((290, 60), (360, 60), label="x_e")
    it.box(360, 40, 90, 40, "K_v / I_P")
    it.arrow((450, 60), (520, 60))
    it.sum(530, 60)
    it.arrow((340, 102), (380, 102), label="n_ffw", at=(322, 102))
    it.box(380, 86, 60, 32, "T_dyn")
    it.arrow((440, 102), (456, 102))
    it.box(456, 86, 56, 32, "k_ffw")
    it.arrow((512, 102), (530, 102), (530, 70))
    it.arrow((540, 60), (620, 60))
    it.box(620, 40, 90, 40, "ramp")
    it.arrow((710, 60), (790, 60))
    it.sum(800, 60)
    it.arrow((800, 112), (800, 70), label="n_add", at=(830, 100))
    it.arrow((810, 60), (900, 60), label="n_s", at=(860, 48))
    it.group(8, 138, 964, 150, "speed controller, every T_c")
    it.arrow((24, 190), (200, 190), label="n_s", at=(40, 178))
    it.dot(80, 190)
    it.sum(210, 190, (14, -18, "−"))
    it.arrow((210, 152), (210, 180), label="n_a", at=(230, 160))
    it.arrow((220, 190), (330, 190))
    it.box(330, 172, 60, 36, "K_p")
    it.arrow((390, 190), (540, 190))
    it.sum(550, 190)
    it.arrow((80, 190), (80, 250), (110, 250))
    it.box(110, 230, 140, 40, "reference model")
    it.arrow((250, 250), (330, 250), label="n_ref", at=(285, 238))
    it.sum(340, 250, (16, 20, "−"))
    it.arrow((340, 282), (340, 260), label="n_a", at=(318, 274))
    it.arrow((350, 250), (400, 250))
    it.box(400, 230, 110, 40, "∫ K_p / T_n")
    it.arrow((510, 250), (550, 250), (550, 200))
    it.arrow((560, 190), (630, 190))
    it.sum(640, 190)
    it.arrow((640, 240), (640, 200), label="M_add", at=(668, 230))
    it.arrow((650, 190), (720, 190))
    it.box(720, 172, 90, 36, "± M_max")
    it.arrow((810, 190), (900, 190), label="M_s", at=(860, 178))
    it.group(8, 300, 964, 112, "current controller and motor")
    it.arrow((24, 350), (70, 350), label="M_s", at=(40, 338))
    it.box(70, 330, 110, 40, "filters 1 … 4")
    it.arrow((180, 350), (220, 350))
    it.box(220, 330, 70, 40, "1 / K_t")
    it.arrow((290, 350), (350, 350))
    it.sum(360, 350, (14, 18, "−"))
    it.arrow((370, 350), (410, 350))
    it.box(410, 324, 190, 52, "PI, decoupling, EMF", "|u| ≤ u_max")
    it.arrow((600, 350), (640, 350))
    it.box(640, 330, 90, 40, "delay T_c")
    it.arrow((730, 350), (770, 350))
    it.box(770, 330, 80, 40, "motor")
    it.arrow((850, 350), (930, 350), label="M_a", at=(905, 338))
    it.dot(872, 350)
    it.arrow((872, 350), (872, 398), (360, 398), (360, 360), label="i_d , i_q", at=(640, 384))
    return it


def friction() -> Drawing:
    """Equations 1 to 7 as blocks, and what they do behind a reversal."""
    it = Drawing(
        980, 400, "LuGre friction with the engaging zone",
        "Left: the speed bends the bristles by equation 6 and moves the position in the engaging zone by equation 4. "
        "The engaged share k of equations 2 and 3 scales the stiffness. Stiffness, bristle damping and viscous "
        "friction add up to the torque. Right: friction torque over the angle behind a reversal. With the engaging "
        "zone it rises more slowly at first than with LuGre alone.",
    )  # fmt: skip
    it.arrow((16, 120), (110, 120), label="n_fr", at=(34, 108))
    it.dot(70, 120)
    it.box(110, 92, 190, 56, "bristles", "ż = n − |n| z / g(n)")
    it.box(110, 188, 190, 56, "engaging zone", "c in ± W/2")
    it.arrow((70, 120), (70, 216), (110, 216))
    it.arrow((300, 216), (350, 216), label="c")
    it.box(350, 188, 130, 56, "engaged share", "k = γ … 1")
    it.arrow((300, 108), (390, 108), label="z", at=(330, 96))
    it.box(390, 90, 80, 36, "σ_0 k z")
    it.dot(330, 108)
    it.arrow((330, 108), (330, 176), (380, 176), (380, 188), label="sign of z", at=(366, 164))
    it.arrow((440, 188), (440, 126), label="k", at=(454, 158))
    it.arrow((205, 92), (205, 48), (390, 48), label="dz/dt", at=(290, 36))
    it.box(390, 30, 80, 36, "σ_1 dz/dt")
    it.dot(70, 216)
    it.arrow((70, 216), (70, 288), (390, 288))
    it.box(390, 270, 80, 36, "σ_2 n")
    it.sum(540, 108)
    it.arrow((470, 108), (530, 108))
    it.arrow((470, 48), (540, 48), (540, 98))
    it.arrow((470, 288), (540, 288), (540, 118))
    it.arrow((550, 108), (610, 108), label="M_fr", at=(585, 96))
    left, right, middle, top = 660.0, 950.0, 200.0, 140.0
    it.line([(left, middle), (right, middle)], "thin")
    it.line([(left + 40, 40), (left + 40, 350)], "thin")
    it.text((right - 30, middle + 16), "angle", "note")
    it.text((left + 58, 44), "M_fr", "", "start")
    span, width, share, g = 250.0, 150.0, 0.35, 30.0

    def torque(engaging: bool) -> list[Point]:
        z, points = -1.0, list[Point]()
        steps = 400
        for step in range(steps + 1):
            angle = span * step / steps
            c = min(-width / 2 + angle, width / 2)
            grip = (width / 2 + c) / width if z >= 0 else (width / 2 - c) / width
            k = share + grip * (1 - share) if engaging else 1.0
            points.append((left + 40 + angle, middle - top * 0.8 * k * z))
            rise = span / steps / g
            z = 1 - (1 - z) * exp(-rise)
        return points

    it.line(torque(True), "curve")
    it.line(torque(False), "second")
    it.line([(left + 40 + width, middle - 6), (left + 40 + width, middle + 6)], "thin")
    it.text((left + 40 + width, middle + 16), "W", "note")
    it.text((left + 100, 316), "LuGre with engaging zone", "note", "start")
    it.line([(left + 60, 316), (left + 90, 316)], "curve")
    it.text((left + 100, 340), "LuGre alone", "note", "start")
    it.line([(left + 60, 340), (left + 90, 340)], "second")
    it.text((805, 380), "behind a reversal (sketch)", "note")
    return it


def _behind(angle: float, at: float, width: float) -> float:
    """A peak behind the angle `at`: a steep rise, and a fall over `width`, all in degrees."""
    past = (angle - at) % 360
    return (past / width) * exp(1 - past / width) if past < 180 else 0.0


def _direction(angle: float) -> float:
    """Sign of the vertical axis's speed: its slide stays behind by half the lost motion."""
    return 1.0 if cos(radians(angle)) >= 0 else -1.0


SHAPES: tuple[tuple[str, str, Callable[[float], float], Callable[[float], float] | None], ...] = (
    ("peaks outwards", "friction at reversals", lambda a: sum(_behind(a, q, 6) for q in (0, 90, 180, 270)), None),
    ("dents inwards", "too much compensation", lambda a: -sum(_behind(a, q, 6) for q in (0, 90, 180, 270)), None),
    ("ellipse at 45°", "turns with the direction: mismatch", lambda a: 0.8 * sin(radians(2 * a)),
     lambda a: -0.8 * sin(radians(2 * a))),
    ("ellipse at 45°", "stays: axes not square", lambda a: 0.8 * sin(radians(2 * a)), None),
    ("ellipse along an axis", "one scale is longer", lambda a: 0.8 * cos(radians(2 * a)), None),
    ("steps where an axis reverses", "lost motion", lambda a: -0.7 * sin(radians(a)) * _direction(a), None),
    ("smaller all round", "path lag, short symmetry filter", lambda a: -0.9, None),
    ("waves along an axis", "screw, scale, motor: periodic",
     lambda a: 0.5 * cos(radians(a)) * sin(14 * cos(radians(a))), None),
)  # fmt: skip


def shapes() -> Drawing:
    """Eight circles of exaggerated deviation, each with its cause."""
    it = Drawing(
        980, 520, "Shapes of circles and their causes",
        "Eight circles with exaggerated deviation: peaks outwards from friction, dents inwards from too much "
        "compensation, an ellipse at 45 degrees that turns with the direction from servo mismatch, one that stays from "
        "axes that are not square, an ellipse along an axis from scales of other length, steps from lost motion, a "
        "smaller circle from path lag, waves along an axis from periodic errors.",
    )  # fmt: skip
    radius, per_unit = 72.0, 18.0
    for number, (name, cause, deviation, other) in enumerate(SHAPES):
        x, y = 122.5 + 245 * (number % 4), 100 + 260 * (number // 4)
        it.shapes.append(f'<circle cx="{x:g}" cy="{y:g}" r="{radius:g}" class="thin"/>')
        for course, kind in ((deviation, "curve"), (other, "second")):
            if course is None:
                continue
            points = [(x + (radius + per_unit * course(a)) * cos(radians(a)),
                       y - (radius + per_unit * course(a)) * sin(radians(a))) for a in _angles()]  # fmt: skip
            it.line([*points, points[0]], kind)
        it.text((x, y + radius + 42), name, "head")
        it.text((x, y + radius + 62), cause, "note")
    return it


ANSWER = ("XZ: G = 8.2 µm. Main cause: reversal peaks of Z (8.1 µm high,",
          "41 ms wide), caused by friction. Remedy: friction compensation",
          "of Z. Change: friction compensation of Z: on.")  # fmt: skip
TILES = (("8.06 µm", "reversal peak of Z"), ("5.00 µm", "reversal peak of X"), ("8.19 µm", "circular deviation G"))
NOTES = (
    (66, ("The answer: how large, the largest", "cause, and what takes it away.", "Doubts stand ahead of it, in red.")),
    (142, ("Whose numbers these are.",)),
    (206, ("One picture: drag to zoom, point at", "a curve to read its values.")),
    (270, ("A peak stands where an axis reverses.", "The clockwise direction is dashed.")),
    (334, ("Three figures; the others stand", "in tables below.")),
    (398, ("The next step, a command to copy.",)),
    (470, ("All else is folded: a click, Enter", "or a link opens it.")),
)  # where in height, and the lines of each note


def report() -> Drawing:
    """First screen of a run's report, with what each part is for."""
    it = Drawing(
        1030, 540, "A report, part by part",
        "The first screen of the report of a circle, with notes: the answer in words, whose numbers these are, "
        "the picture of the contour error with its peaks, three figures, the next step as a command, and folded "
        "sections with everything else.",
    )  # fmt: skip
    it.shapes.append('<rect x="16" y="16" width="640" height="508" rx="8" class="frame"/>')
    it.text((34, 38), "X-Z circle", "head", "start")
    for number, line in enumerate(ANSWER):
        it.text((34, 62 + 20 * number), line, "", "start")
    it.text((34, 142), "Synthetic machine; measured on no machine.", "note", "start")
    middle, radius = (200.0, 290.0), 84.0
    deviation = SHAPES[0][2]
    it.shapes.append(f'<circle cx="{middle[0]:g}" cy="{middle[1]:g}" r="{radius:g}" class="thin"/>')
    for course, kind in ((deviation, "curve"), (lambda a: deviation(-a), "second")):
        points = [(middle[0] + (radius + 18 * course(a)) * cos(radians(a)),
                   middle[1] - (radius + 18 * course(a)) * sin(radians(a))) for a in _angles()]  # fmt: skip
        it.line([*points, points[0]], kind)
    for (dx, dy), end in (((0, -130), "Z+"), ((0, 130), "Z−"), ((130, 0), "X+"), ((-130, 0), "X−")):
        it.text((middle[0] + dx, middle[1] + dy), end, "small")
    for number, (value, what) in enumerate(TILES):
        it.box(392, 166 + 62 * number, 248, 52, value, what)
    it.text((392, 366), "Next", "note", "start")
    it.box(392, 380, 248, 34)
    it.shapes.append(
        '<text x="516" y="402" text-anchor="middle" class="small">feedsim tune feedforward xz_circle.yaml</text>'
    )
    for number, title in enumerate(
        ("Torque and friction torque", "All axes over the whole run", "Why the circle is not round")
    ):
        it.line([(34, 446 + 26 * number), (638, 446 + 26 * number)], "thin")
        it.text((34, 460 + 26 * number), f"▸ {title}", "head", "start")
    places = ((632, 82), (352, 142), (282, 200), (224, 170), (376, 192), (376, 397), (626, 486))
    for number, ((height, lines), place) in enumerate(zip(NOTES, places, strict=True), start=1):
        for x, y in (place, (686, height)):
            it.shapes.append(f'<circle cx="{x:g}" cy="{y:g}" r="10" class="sum"/>')
            it.text((x, y), str(number), "small")
        for row, line in enumerate(lines):
            it.text((704, height + 18 * (row - (len(lines) - 1) / 2)), line, "small", "start")
    return it


def _angles() -> list[float]:
    return [step / 2 for step in range(720)]


DRAWINGS: dict[str, Callable[[], Drawing]] = {
    "coupling.svg": coupling,
    "controller.svg": controller,
    "friction.svg": friction,
    "circle-shapes.svg": shapes,
    "report.svg": report,
}


def main(folder: Path = IMAGES) -> None:
    """Write all drawings into `folder`."""
    for name, draw in DRAWINGS.items():
        (folder / name).write_text(draw().svg(), encoding="utf-8")


if __name__ == "__main__":
    main()
