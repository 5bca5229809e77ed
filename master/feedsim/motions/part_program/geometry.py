"""Frames, arcs and rounded corners of NC programs. Lengths in mm, angles in rad; what is impossible is a ValueError."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

Vector = tuple[float, float, float]
Point = tuple[float, float]

# Two points nearer than this are one: a circle that ends there is a full one. Programs have 1e-3 to 1e-5 mm.
MIN_DISTANCE = 1e-6
# Radii at start and end of an arc may differ by as much, as MD21000 and MD21010 of a SINUMERIK have it.
RADIUS_TOLERANCE, RELATIVE_RADIUS_TOLERANCE = 0.01, 0.001
IDENTITY = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def dot(a: Sequence[float], b: Sequence[float]) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def add(a: Vector, b: Vector, factor: float = 1.0) -> Vector:
    """a + factor b."""
    return a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]


def unit(a: Vector) -> Vector:
    length = math.hypot(*a)
    return a[0] / length, a[1] / length, a[2] / length


def turn(vector: Vector, normal: Vector, angle: float) -> Vector:
    """A vector turned about a unit vector by the right-hand rule (Rodrigues)."""
    c, s, along = math.cos(angle), math.sin(angle), dot(normal, vector) * (1 - math.cos(angle))
    side = cross(normal, vector)
    return tuple(c * v + s * w + along * n for v, w, n in zip(vector, side, normal, strict=True))  # type: ignore[return-value]


# --- Frames: a point of the program, in the frame that is active, and the machine's ---------------------------------


@dataclass(frozen=True)
class Frame:
    """machine = matrix point + offset. matrix: of X, Y, Z, rows. offset [mm]: of all axes; others are shifted only."""

    matrix: tuple[Vector, Vector, Vector]
    offset: tuple[float, ...]

    @property
    def plain(self) -> bool:
        """Whether it shifts and does nothing else."""
        return self.matrix == IDENTITY

    def linear(self, vector: Sequence[float]) -> Vector:
        """A direction of the program in the machine's frame."""
        a, b, c = self.matrix
        return dot(a, vector), dot(b, vector), dot(c, vector)

    def machine(self, point: Sequence[float]) -> list[float]:
        moved = point if self.plain else [*self.linear(point[:3]), *point[3:]]
        return [x + shift for x, shift in zip(moved, self.offset, strict=True)]

    def unlinear(self, vector: Sequence[float]) -> Vector:
        """The direction of the program that is a given one of the machine: the adjugate over the determinant."""
        a, b, c = self.matrix
        columns = cross(b, c), cross(c, a), cross(a, b)
        determinant = dot(a, columns[0])
        return tuple(dot([column[i] for column in columns], vector) / determinant for i in range(3))  # type: ignore[return-value]

    def program(self, position: Sequence[float]) -> list[float]:
        """The point of the program at a position of the machine."""
        shifted = [x - shift for x, shift in zip(position, self.offset, strict=True)]
        return shifted if self.plain else [*self.unlinear(shifted[:3]), *shifted[3:]]

    def then(self, inner: Frame) -> Frame:
        """This frame, in which another one is set up: a point passes through the inner one first."""
        columns = list(zip(*inner.matrix, strict=True))
        rows = tuple(tuple(dot(row, column) for column in columns) for row in self.matrix)
        return Frame(rows, tuple(self.machine(inner.offset)))  # type: ignore[arg-type]


def rotation(x: float, y: float, z: float) -> tuple[Vector, Vector, Vector]:
    """About Z, then the turned Y, then the turned X (RPY, the default of a SINUMERIK): Rz Ry Rx. Angles in degrees."""
    (sx, cx), (sy, cy), (sz, cz) = ((sine(angle), sine(angle + 90.0)) for angle in (x, y, z))
    return (
        (cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx),
        (sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx),
        (-sy, cy * sx, cy * cx),
    )


def sine(degrees: float) -> float:
    """Exact at multiples of 90 degrees."""
    turned = math.remainder(degrees, 360.0)
    if turned % 90.0 == 0.0:
        return (0.0, 1.0, 0.0, -1.0)[round(turned / 90.0) % 4]
    return math.sin(math.radians(turned))


# --- Arcs in a plane: x along its first axis, y along its second one -------------------------------------------------


@dataclass(frozen=True)
class Arc:
    """centre, sense: 1 counter-clockwise, -1 clockwise; angle: swept, positive."""

    centre: Point
    sense: int
    angle: float


def swept(start: Point, end: Point, centre: Point, sense: int) -> float:
    """Angle from start to end about the centre; of one and the same point a full turn."""
    if math.dist(start, end) < MIN_DISTANCE:
        return 2 * math.pi
    first = math.atan2(start[1] - centre[1], start[0] - centre[0])
    last = math.atan2(end[1] - centre[1], end[0] - centre[0])
    return (sense * (last - first)) % (2 * math.pi)


def allowed_difference(radius: float) -> float:
    return max(RADIUS_TOLERANCE, RELATIVE_RADIUS_TOLERANCE * radius)


def arc_about(start: Point, end: Point, centre: Point, sense: int) -> Arc:
    """Arc about a programmed centre, which is moved along the chord until both radii are equal, as controls do."""
    at_start, at_end = math.dist(start, centre), math.dist(end, centre)
    if at_start < MIN_DISTANCE:
        raise ValueError("the centre of the arc is its start: radius 0 mm")
    chord = math.dist(start, end)
    moved = (at_start**2 - at_end**2) / (2 * chord) if chord >= MIN_DISTANCE else 0.0
    if max(abs(at_start - at_end), abs(moved)) > allowed_difference(at_start):
        raise ValueError(
            f"the centre of the arc is off: radius {at_start:.6g} mm at the start and {at_end:.6g} mm at the end; "
            f"they may differ by {allowed_difference(at_start):.3g} mm"
        )
    if moved:
        centre = (centre[0] + moved * (start[0] - end[0]) / chord, centre[1] + moved * (start[1] - end[1]) / chord)
    return Arc(centre, sense, swept(start, end, centre, sense))


def arc_of_radius(start: Point, end: Point, radius: float, sense: int) -> Arc:
    """Arc of a radius: of up to half a turn, or beyond where it is negative."""
    chord = math.dist(start, end)
    if chord < MIN_DISTANCE:
        raise ValueError("an arc given by its radius ends where it starts; a full circle needs its centre")
    size = abs(radius)
    if chord / 2 - size > min(allowed_difference(size), size / 2):
        raise ValueError(f"the radius {size:.6g} mm is below half the chord, {chord / 2:.6g} mm")
    height = math.sqrt(max(size**2 - (chord / 2) ** 2, 0.0))
    # Of a counter-clockwise arc of less than half a turn the centre is left of the chord.
    side = height * sense * (1 if radius > 0 else -1) / chord
    centre = (
        (start[0] + end[0]) / 2 - side * (end[1] - start[1]),
        (start[1] + end[1]) / 2 + side * (end[0] - start[0]),
    )
    return Arc(centre, sense, swept(start, end, centre, sense))


def arc_of_angle(start: Point, end: Point, angle: float, sense: int) -> Arc:
    """Arc from start to end that sweeps an angle below a full turn."""
    chord = math.dist(start, end)
    if chord < MIN_DISTANCE:
        raise ValueError("an arc given by its angle ends where it starts; a full circle needs its centre")
    side = sense / (2 * math.tan(angle / 2))
    centre = (
        (start[0] + end[0]) / 2 - side * (end[1] - start[1]),
        (start[1] + end[1]) / 2 + side * (end[0] - start[0]),
    )
    return Arc(centre, sense, angle)


def arc_tangent(start: Point, end: Point, direction: Point) -> Arc | None:
    """Arc that leaves the start in a direction (unit vector) and ends at the end; None: a straight line does."""
    x, y = end[0] - start[0], end[1] - start[1]
    chord = math.hypot(x, y)
    if chord < MIN_DISTANCE:
        raise ValueError("a tangent arc ends where it starts")
    side = direction[0] * y - direction[1] * x  # > 0: the end is on the left
    along = direction[0] * x + direction[1] * y
    if abs(side) < MIN_DISTANCE:
        if along > 0:
            return None
        raise ValueError("a tangent arc cannot end straight behind its start")
    radius = chord**2 / (2 * side)
    centre = (start[0] - radius * direction[1], start[1] + radius * direction[0])
    return Arc(centre, 1 if side > 0 else -1, 2 * math.atan2(abs(side), along))


def arc_through(start: Vector, middle: Vector, end: Vector) -> tuple[Vector, Vector, float]:
    """Centre, normal and angle of the arc in space from start by way of a point to the end."""
    a, b = add(middle, start, -1.0), add(end, start, -1.0)
    normal = cross(a, b)
    size = math.hypot(*normal)
    if min(math.hypot(*a), math.hypot(*b), math.dist(middle, end)) < MIN_DISTANCE or size < 1e-9 * dot(b, b):
        raise ValueError("start, intermediate point and end of the arc lie on a line, or two of them are one")
    normal = unit(normal)
    # Circumcentre: (|a|^2 b - |b|^2 a) x (a x b) / (2 |a x b|^2), about the start.
    mixed = tuple(dot(a, a) * y - dot(b, b) * x for x, y in zip(a, b, strict=True))
    outward = cross(mixed, normal)  # type: ignore[arg-type]
    centre = add(start, outward, 1 / (2 * size))
    first, last = add(start, centre, -1.0), add(end, centre, -1.0)
    angle = math.atan2(dot(cross(first, last), normal), dot(first, last)) % (2 * math.pi)
    return centre, normal, angle


# --- Corners: a rounding or a chamfer between two elements of a plane ------------------------------------------------


@dataclass(frozen=True)
class Element:
    """A line, or an arc where `arc` is given, from start to end."""

    start: Point
    end: Point
    arc: Arc | None = None

    @property
    def length(self) -> float:
        """Of a line its length [mm], of an arc its angle [rad]."""
        return self.arc.angle if self.arc else math.dist(self.start, self.end)

    def point(self, at: float) -> Point:
        """The point at a length (line) or angle (arc) from the start."""
        if self.arc is None:
            share = at / self.length
            return tuple(a + share * (b - a) for a, b in zip(self.start, self.end, strict=True))  # type: ignore[return-value]
        (x, y), c, s = self.arc.centre, math.cos(at), self.arc.sense * math.sin(at)
        u, v = self.start[0] - x, self.start[1] - y
        return x + c * u - s * v, y + s * u + c * v

    def place(self, point: Point) -> float:
        """Inverse of point(); of a point beyond the ends below 0 or above length."""
        if self.arc is None:
            size = self.length
            return sum((b - a) * (p - a) for a, b, p in zip(self.start, self.end, point, strict=True)) / size
        centre = self.arc.centre
        first = math.atan2(self.start[1] - centre[1], self.start[0] - centre[0])
        last = math.atan2(point[1] - centre[1], point[0] - centre[0])
        return (self.arc.sense * (last - first)) % (2 * math.pi)

    def direction(self, point: Point) -> Point:
        """Unit vector of the motion at a point."""
        if self.arc is None:
            return tuple((b - a) / self.length for a, b in zip(self.start, self.end, strict=True))  # type: ignore[return-value]
        x, y = point[0] - self.arc.centre[0], point[1] - self.arc.centre[1]
        size = math.hypot(x, y) * self.arc.sense
        return -y / size, x / size


def _intersections(first: Element, second: Element, offset: float) -> list[Point]:
    """Points that have both elements, each prolonged, at a distance to their right (left < 0: to their left)."""
    lines, circles = [], []
    for element in (first, second):
        if element.arc is None:
            u, v = element.direction(element.start)
            lines.append(((element.start[0] - offset * v, element.start[1] + offset * u), (u, v)))
        else:
            circles.append(
                (element.arc.centre, math.dist(element.start, element.arc.centre) - element.arc.sense * offset)
            )
    if any(radius <= 0 for _, radius in circles):
        return []
    if len(lines) == 2:
        (p, d), (q, e) = lines
        determinant = d[0] * e[1] - d[1] * e[0]
        if abs(determinant) < 1e-12:
            return []
        share = ((q[0] - p[0]) * e[1] - (q[1] - p[1]) * e[0]) / determinant
        return [(p[0] + share * d[0], p[1] + share * d[1])]
    (x, y), radius = circles[0]
    if lines:
        p, d = lines[0]
        along = (x - p[0]) * d[0] + (y - p[1]) * d[1]
        foot = (p[0] + along * d[0], p[1] + along * d[1])
        half = radius**2 - math.dist(foot, (x, y)) ** 2
    else:
        other, size = circles[1]
        apart = math.dist((x, y), other)
        if apart < MIN_DISTANCE:
            return []
        u, v = (other[0] - x) / apart, (other[1] - y) / apart
        along = (apart**2 + radius**2 - size**2) / (2 * apart)
        foot, d = (x + along * u, y + along * v), (-v, u)
        half = radius**2 - along**2
    if half < 0:
        return []
    half = math.sqrt(half)
    return [(foot[0] + sign * half * d[0], foot[1] + sign * half * d[1]) for sign in (1, -1)]


def corner_angle(first: Element, second: Element) -> float:
    """Angle by which the path turns from one element to the next: 0 where they are tangent, positive to the left."""
    a, b = first.direction(first.end), second.direction(second.start)
    return math.atan2(a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1])


def rounding_arc(first: Element, second: Element, radius: float) -> tuple[Point, Point, Arc]:
    """Arc of a radius tangent to both elements: its ends, on the first and the second one, and itself."""
    arcs = []
    for sense in (1, -1):
        for centre in _intersections(first, second, sense * radius):
            ends = []
            for element in (first, second):
                if element.arc is None:
                    at = element.place(centre)
                    inside = 0 <= at <= element.length
                    foot = element.point(at)
                else:
                    x, y = centre[0] - element.arc.centre[0], centre[1] - element.arc.centre[1]
                    share = math.dist(element.start, element.arc.centre) / math.hypot(x, y) if x or y else 0.0
                    foot = (element.arc.centre[0] + share * x, element.arc.centre[1] + share * y)
                    inside = share > 0 and element.place(foot) <= element.length
                ends.append((foot, inside))
            if all(inside for _, inside in ends):
                a, b = ends[0][0], ends[1][0]
                arc = Arc(centre, sense, swept(a, b, centre, sense))
                arcs.append((math.dist(a, first.end) + math.dist(b, second.start), a, b, arc))
    if not arcs:
        raise ValueError(f"a rounding of {radius:.6g} mm does not fit between the two movements")
    return min(arcs, key=lambda arc: arc[0])[1:]


def chamfer(first: Element, second: Element, leg: float, length: float) -> tuple[Point, Point]:
    """Ends of a straight chamfer, equally far from the corner. leg (CHR) or length of itself (CHF); the other is 0."""

    def ends(size: float) -> tuple[Point, Point]:
        at = []
        for element, backwards in ((first, True), (second, False)):
            if element.arc is None:
                cut = size
            else:
                radius = math.dist(element.start, element.arc.centre)
                cut = 2 * math.asin(min(size / (2 * radius), 1.0))
            at.append(element.point(element.length - cut if backwards else cut))
        return at[0], at[1]

    reach = min(
        element.length if element.arc is None
        else 2 * math.dist(element.start, element.arc.centre) * math.sin(min(element.arc.angle, math.pi) / 2)
        for element in (first, second)
    )  # fmt: skip
    if length:
        low, high = 0.0, reach
        if math.dist(*ends(high)) < length:
            raise ValueError(f"a chamfer of {length:.6g} mm does not fit between the two movements")
        for _ in range(200):
            middle = (low + high) / 2
            low, high = (middle, high) if math.dist(*ends(middle)) < length else (low, middle)
        leg = high
    if leg > reach:
        raise ValueError(f"a chamfer with legs of {leg:.6g} mm does not fit between the two movements, {reach:.6g} mm")
    return ends(leg)
