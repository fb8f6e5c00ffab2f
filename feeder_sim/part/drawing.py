"""Closed meshes of the solids in solids.py, as they are drawn: vertices (n, 3) [m] and faces (m, 3), seen from outside.

Made here, since a library of meshes takes longer to load than a run of one part takes.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Mesh = tuple[NDArray[np.float64], NDArray[np.int64]]

RIM_CORNERS = 32  # per rim of a cylinder, where it touches with corners: 0.5 % of the radius inside it, at most
SUBDIVISIONS = 3  # of the 20 faces of a ball, each into four: it lies inside the ball by 0.4 % of the radius


def _faces(corners: str) -> NDArray[np.int64]:
    return np.array(corners.split(), np.int64).reshape(-1, 3)


BLOCK_FACES = _faces("0 1 3  0 3 2  4 6 7  4 7 5  0 4 5  0 5 1  2 3 7  2 7 6  0 2 6  0 6 4  1 5 7  1 7 3")
GOLDEN = (1.0 + math.sqrt(5.0)) / 2.0
RECTANGLE = np.array([[-1.0, -GOLDEN], [-1.0, GOLDEN], [1.0, -GOLDEN], [1.0, GOLDEN]])
ICOSAHEDRON = np.concatenate([np.roll(np.insert(RECTANGLE, 0, 0.0, axis=1), turn, axis=1) for turn in range(3)])
ICOSAHEDRON_FACES = _faces(
    "0 2 5  0 4 2  0 5 10  0 8 4  0 10 8  1 3 6  1 6 8  1 7 3  1 8 10  1 10 7  2 4 9  2 9 11  2 11 5  3 7 11"
    "  3 9 6  3 11 9  4 6 9  4 8 6  5 7 10  5 11 7"
)


def circle(radius: float) -> NDArray[np.float64]:
    """Corners of the rim of a cylinder, shape (RIM_CORNERS, 2)."""
    angle = 2.0 * math.pi * np.arange(RIM_CORNERS) / RIM_CORNERS
    return radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def ball_mesh(radius: float) -> Mesh:
    """An icosahedron with each face cut into four, again and again."""
    vertices, faces = ICOSAHEDRON / np.linalg.norm(ICOSAHEDRON[0]), ICOSAHEDRON_FACES
    for _ in range(SUBDIVISIONS):
        sides = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        edges, number = np.unique(sides, axis=0, return_inverse=True)
        middle = vertices[edges].sum(axis=1)
        a, b, c = faces.T
        ab, bc, ca = len(vertices) + number.reshape(-1, 3).T
        vertices = np.concatenate([vertices, middle / np.linalg.norm(middle, axis=1, keepdims=True)])
        faces = np.concatenate([np.column_stack(cut) for cut in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    return radius * vertices, faces


def ring_mesh(rim: NDArray[np.float64], bore_radius: float, height: float, per_side: int = 8) -> Mesh:
    """A prism over a convex outline (n, 2) with a round bore; of radius 0: none."""
    sides = len(rim)
    fraction = np.arange(per_side) / per_side
    outline = np.concatenate([rim[i] + fraction[:, None] * (rim[(i + 1) % sides] - rim[i]) for i in range(sides)])
    n, inner = len(outline), np.zeros((1, 2))
    if bore_radius > 0.0:
        inner = bore_radius * outline / np.linalg.norm(outline, axis=1, keepdims=True)
    rings = [(outline, -height / 2), (outline, height / 2), (inner, height / 2), (inner, -height / 2)]
    vertices = np.concatenate([np.column_stack([ring, np.full(len(ring), z)]) for ring, z in rings])
    first = np.cumsum([0, *(len(ring) for ring, _ in rings)])
    number = [first[k] + np.arange(n) % len(ring) for k, (ring, _) in enumerate(rings)]
    faces = []
    for a, b in zip(number, number[1:] + number[:1], strict=True):
        after_a, after_b = np.roll(a, -1), np.roll(b, -1)
        faces += [np.column_stack([a, after_a, after_b]), np.column_stack([a, after_b, b])]
    triangles = np.concatenate(faces)
    flat = (triangles == np.roll(triangles, 1, axis=1)).any(axis=1)  # at the axis
    return vertices, triangles[~flat]
