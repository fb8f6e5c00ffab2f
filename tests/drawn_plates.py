"""Random plates with holes, patches and feet, as segments whose area is known, for files that others could have drawn.

Points are complex numbers [mm], x + iy. A ring is a closed run of straight segments, arcs of ellipses and Bezier curves
of third degree.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from random import Random
from typing import Any

import numpy as np
import shapely

TURN = 2.0 * math.pi
STEPS = 2048  # of a full circle, whose area is then 2e-6 too small


@dataclass(frozen=True)
class Line:
    begin: complex
    end: complex

    def points(self) -> list[complex]:
        return [self.begin, self.end]

    def mapped(self, by: Map) -> Line:
        return Line(by(self.begin), by(self.end))

    def reverse(self) -> Line:
        return Line(self.end, self.begin)


@dataclass(frozen=True)
class Arc:
    """Of an ellipse with the radii rx, ry, the first one at `turn` from x; from angle `start` over `sweep` [rad]."""

    centre: complex
    rx: float
    ry: float
    turn: float
    start: float
    sweep: float

    def at(self, angle: float) -> complex:
        return self.centre + cmath.rect(1.0, self.turn) * complex(self.rx * math.cos(angle), self.ry * math.sin(angle))

    @property
    def begin(self) -> complex:
        return self.at(self.start)

    @property
    def end(self) -> complex:
        return self.at(self.start + self.sweep)

    @property
    def round(self) -> bool:
        return self.rx == self.ry

    def points(self) -> list[complex]:
        number = max(2, math.ceil(abs(self.sweep) / TURN * STEPS))
        return [self.at(self.start + self.sweep * i / number) for i in range(number + 1)]

    def mapped(self, by: Map) -> Arc:
        size, side = abs(by.factor), -1.0 if by.mirrored else 1.0
        turn = cmath.phase(by.factor) + side * self.turn
        return Arc(by(self.centre), self.rx * size, self.ry * size, turn, side * self.start, side * self.sweep)

    def reverse(self) -> Arc:
        return replace(self, start=self.start + self.sweep, sweep=-self.sweep)

    def pieces(self, number: int) -> list[Arc]:
        part = self.sweep / number
        return [replace(self, start=self.start + i * part, sweep=part) for i in range(number)]


@dataclass(frozen=True)
class Bezier:
    corners: tuple[complex, complex, complex, complex]

    @property
    def begin(self) -> complex:
        return self.corners[0]

    @property
    def end(self) -> complex:
        return self.corners[3]

    def points(self) -> list[complex]:
        a, b, c, d = self.corners
        t = np.linspace(0.0, 1.0, 513)
        s = 1.0 - t
        return [complex(z) for z in s**3 * a + 3 * s * s * t * b + 3 * s * t * t * c + t**3 * d]

    def mapped(self, by: Map) -> Bezier:
        a, b, c, d = self.corners
        return Bezier((by(a), by(b), by(c), by(d)))

    def reverse(self) -> Bezier:
        a, b, c, d = self.corners
        return Bezier((d, c, b, a))


Segment = Line | Arc | Bezier
Ring = tuple[Segment, ...]
Item = Ring | complex  # a closed ring or a point


@dataclass(frozen=True)
class Map:
    """Turns, scales and shifts, z -> factor z + shift; mirrors before that."""

    factor: complex = 1.0 + 0.0j
    shift: complex = 0.0j
    mirrored: bool = False

    def __call__(self, z: complex) -> complex:
        return self.factor * (z.conjugate() if self.mirrored else z) + self.shift

    def inverse(self) -> Map:
        factor, shift = 1.0 / self.factor, -self.shift / self.factor
        if self.mirrored:
            return Map(factor.conjugate(), shift.conjugate(), True)
        return Map(factor, shift)

    def item(self, item: Item) -> Item:
        return self(item) if isinstance(item, complex) else tuple(segment.mapped(self) for segment in item)


@dataclass(frozen=True)
class Truth:
    """What a drawing says: the plate without its holes, patches, places of feet [mm]."""

    plate: Any
    patches: tuple[Any, ...] = ()
    feet: tuple[complex, ...] = ()


@dataclass(frozen=True)
class DrawnPlate:
    outline: Ring
    holes: tuple[Ring, ...] = ()
    patches: tuple[Ring, ...] = ()
    feet: tuple[Item, ...] = ()

    def mapped(self, by: Map) -> DrawnPlate:
        def rings(items: tuple[Any, ...]) -> tuple[Any, ...]:
            return tuple(by.item(item) for item in items)

        outline = by.item(self.outline)
        assert isinstance(outline, tuple)
        return DrawnPlate(outline, rings(self.holes), rings(self.patches), rings(self.feet))

    def items(self, rng: Random) -> Iterator[tuple[str, Item]]:
        """Layer and item of everything; holes are in either layer."""
        yield "outline", self.outline
        for hole in self.holes:
            yield rng.choice(["outline", "holes"]), hole
        for layer, items in (("patches", self.patches), ("feet", self.feet)):
            for item in items:
                yield layer, item

    def truth(self) -> Truth:
        plate = shapely.difference(polygon(self.outline), shapely.union_all([polygon(hole) for hole in self.holes]))
        centres = (foot if isinstance(foot, complex) else middle(foot) for foot in self.feet)
        return Truth(plate, tuple(polygon(patch) for patch in self.patches), tuple(centres))


def polygon(ring: Ring) -> Any:
    """Of a ring, with arcs in short steps."""
    corners = [point for segment in ring for point in segment.points()[:-1]]
    return shapely.Polygon([(z.real, z.imag) for z in corners])


def middle(ring: Ring) -> complex:
    centre = polygon(ring).centroid
    return complex(centre.x, centre.y)


def straight(*corners: complex) -> Ring:
    return tuple(Line(a, b) for a, b in zip(corners, (*corners[1:], corners[0]), strict=True))


def rectangle(centre: complex, width: float, height: float, turn: float = 0.0) -> Ring:
    corners = [complex(x * width, y * height) / 2 for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    return straight(*(centre + cmath.rect(1.0, turn) * z for z in corners))


def ellipse(centre: complex, rx: float, ry: float, turn: float = 0.0) -> Ring:
    return (Arc(centre, rx, ry, turn, 0.0, TURN),)


def rounded(width: float, height: float, radius: float) -> Ring:
    """A rectangle around zero with round corners."""
    x, y = width / 2 - radius, height / 2 - radius
    ring: list[Segment] = []
    for i, centre in enumerate((complex(x, -y), complex(x, y), complex(-x, y), complex(-x, -y))):
        corner = Arc(centre, radius, radius, 0.0, (i - 1) * TURN / 4, TURN / 4)
        if ring:
            ring.append(Line(ring[-1].end, corner.begin))
        ring.append(corner)
    return (*ring, Line(ring[-1].end, ring[0].begin))


def blob(rng: Random, rx: float, ry: float) -> Ring:
    """A closed chain of Bezier curves, smooth where they meet."""
    number = rng.randint(4, 7)
    places = [(rng.uniform(0.95, 1.05), i * TURN / number) for i in range(number)]
    pull = 4.0 / 3.0 * math.tan(TURN / number / 4)

    def knot(i: int, along: float) -> complex:
        size, angle = places[i % number]
        at = size * cmath.rect(1.0, angle) * complex(1.0, along * pull)
        return complex(rx * at.real, ry * at.imag)

    return tuple(Bezier((knot(i, 0), knot(i, 1), knot(i + 1, -1), knot(i + 1, 0))) for i in range(number))


def random_plate(rng: Random, curves: bool = True, straight_only: bool = False) -> DrawnPlate:
    """A plate with up to nine things in the cells of a grid in its middle; `curves` other than arcs if they may be."""
    width, height = rng.uniform(90.0, 160.0), rng.uniform(90.0, 160.0)
    cut = complex(rng.uniform(0.35, 0.45) * width, rng.uniform(0.35, 0.45) * height)
    x, y = width / 2, height / 2
    kinds: list[Callable[[], Ring]] = [
        lambda: rectangle(0j, width, height),
        lambda: straight(-x - 1j * y, x - 1j * y, x + 1j * cut.imag, cut.real + 1j * cut.imag, cut.real + 1j * y,
                         -x + 1j * y),
        lambda: straight(*(complex(x * 1.1 * math.cos(t), y * 1.1 * math.sin(t)) for t in np.arange(9) * TURN / 9)),
    ]  # fmt: skip
    if not straight_only:
        kinds += [lambda: rounded(width, height, rng.uniform(2.0, 0.12 * min(width, height)))]
        kinds += [lambda: ellipse(0j, max(x, y), max(x, y))]
    if curves and not straight_only:
        kinds += [lambda: ellipse(0j, x, y), lambda: blob(rng, 1.1 * x, 1.1 * y)]
    outline = rng.choice(kinds)()
    holes: list[Ring] = []
    patches: list[Ring] = []
    feet: list[Item] = []
    cells = [complex(0.2 * width * i, 0.2 * height * j) for i in (-1, 0, 1) for j in (-1, 0, 1)]
    for centre in rng.sample(cells, rng.randint(2, 9)):
        kind = rng.choice(["hole", "patch", "foot"])
        a, b, turn = rng.uniform(5.0, 11.0), rng.uniform(5.0, 11.0), rng.uniform(0.0, TURN)
        if kind == "patch":
            patches.append(rectangle(centre, a, b, turn))
        elif kind == "foot":
            feet.append(centre if rng.random() < 0.4 or straight_only else ellipse(centre, a / 4, a / 4))
        else:
            shapes = [rectangle(centre, a, b, turn)]
            shapes += [] if straight_only else [ellipse(centre, a / 2, a / 2)]
            shapes += [] if straight_only or not curves else [ellipse(centre, a / 2, b / 2, turn)]
            holes.append(rng.choice(shapes))
    whole = DrawnPlate(outline, tuple(holes), tuple(patches), tuple(feet))
    away = complex(rng.uniform(-50.0, 200.0), rng.uniform(-50.0, 200.0))
    return whole.mapped(Map(cmath.rect(1.0, rng.choice([0.0, 0.0, rng.uniform(0.0, TURN)])), away))
