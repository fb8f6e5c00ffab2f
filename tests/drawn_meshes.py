"""Solid bodies of known volume as polygons, turned outwards: what a mesh file is written from."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from random import Random

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

Floats = NDArray[np.float64]
Face = tuple[int, ...]


@dataclass(frozen=True)
class Body:
    """Corners (n, 3), flat faces counterclockwise from outside, all convex, and the volume."""

    name: str
    corners: Floats
    faces: tuple[Face, ...]
    volume: float

    def triangles(self) -> tuple[Face, ...]:
        return tuple((f[0], f[i], f[i + 1]) for f in self.faces for i in range(1, len(f) - 1))

    def in_triangles(self) -> Body:
        return Body(self.name, self.corners, self.triangles(), self.volume)


def summed_volume(body: Body) -> float:
    """By the divergence theorem, independent of the formula of the body."""
    a, b, c = (body.corners[[t[i] for t in body.triangles()]] for i in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


def _extruded(name: str, outline: Sequence[Sequence[float]], caps: Sequence[Face], height: float, area: float) -> Body:
    """A plane outline, counterclockwise, its caps cut into convex faces."""
    n = len(outline)
    corners = [[*p, 0.0] for p in outline] + [[*p, height] for p in outline]
    sides = [(i, (i + 1) % n, n + (i + 1) % n, n + i) for i in range(n)]
    top = [tuple(n + i for i in cap) for cap in caps]
    bottom = [tuple(reversed(cap)) for cap in caps]
    return Body(name, np.array(corners), (*sides, *top, *bottom), area * height)


def prism(number: int, radius: float, height: float) -> Body:
    outline = [[radius * math.cos(2 * math.pi * i / number), radius * math.sin(2 * math.pi * i / number)]
               for i in range(number)]  # fmt: skip
    area = 0.5 * number * radius**2 * math.sin(2 * math.pi / number)
    return _extruded("prism", outline, [tuple(range(number))], height, area)


def box(a: float, b: float, c: float) -> Body:
    return _extruded("box", [[0, 0], [a, 0], [a, b], [0, b]], [(0, 1, 2, 3)], c, a * b)


def bracket(a: float, b: float, thick: float, height: float) -> Body:
    """An L; its caps are three rectangles, so that no edge ends within another one."""
    outline: list[list[float]] = [
        [0, 0],
        [thick, 0],
        [a, 0],
        [a, thick],
        [thick, thick],
        [thick, b],
        [0, b],
        [0, thick],
    ]
    caps = [(0, 1, 4, 7), (1, 2, 3, 4), (7, 4, 5, 6)]
    return _extruded("bracket", outline, caps, height, thick * (a + b - thick))


def tube(number: int, outer: float, inner: float, height: float) -> Body:
    angle = 2 * np.pi * np.arange(number) / number
    ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(number)])
    up = np.array([0.0, 0.0, height])
    corners = np.concatenate([outer * ring, outer * ring + up, inner * ring, inner * ring + up])
    faces: list[Face] = []
    for i in range(number):
        j, n = (i + 1) % number, number
        faces += [(i, j, n + j, n + i), (2 * n + j, 2 * n + i, 3 * n + i, 3 * n + j)]
        faces += [(n + i, n + j, 3 * n + j, 3 * n + i), (j, i, 2 * n + i, 2 * n + j)]
    area = 0.5 * number * math.sin(2 * math.pi / number) * (outer**2 - inner**2)
    return Body("tube", corners, tuple(faces), area * height)


def hull(rng: np.random.Generator, size: float) -> Body:
    cloud = rng.normal(size=(int(rng.integers(6, 40)), 3))
    cloud *= size / np.linalg.norm(cloud, axis=1, keepdims=True) * rng.uniform(0.8, 1.0, (len(cloud), 1))
    found = ConvexHull(cloud)
    faces = []
    for simplex, equation in zip(found.simplices, found.equations, strict=True):
        a, b, c = cloud[simplex]
        ahead = np.dot(np.cross(b - a, c - a), equation[:3]) > 0
        faces.append(tuple(int(i) for i in (simplex if ahead else simplex[::-1])))
    return Body("hull", cloud, tuple(faces), float(found.volume))


def random_body(rng: Random) -> Body:
    """Of 2 to 60 mm, turned and shifted."""
    size = rng.uniform(2.0, 20.0)
    a, b, c = (size * rng.uniform(0.4, 1.5) for _ in range(3))
    body = rng.choice(
        [
            lambda: box(a, b, c),
            lambda: prism(rng.randint(3, 12), a, b),
            lambda: bracket(a + size, b + size, 0.3 * size, c),
            lambda: tube(rng.randint(6, 24), a, a * rng.uniform(0.3, 0.8), b),
            lambda: hull(np.random.default_rng(rng.randrange(10**9)), size),
        ]
    )()
    turn = Rotation.random(random_state=rng.randrange(2**31)) if rng.random() < 0.7 else Rotation.identity()
    shift = np.array([rng.uniform(-30.0, 30.0) for _ in range(3)])
    return Body(body.name, turn.apply(body.corners) + shift, body.faces, body.volume)
