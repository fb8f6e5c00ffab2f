"""Fixtures of a scenario in SI units: convex bodies over the resting plate."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError
from feeder_sim.plate.surface import Surface
from feeder_sim.scenario import Scenario
from feeder_sim.scenario.fixture import ExtrusionFixture, FixtureTable

FOUNDATION = 1e-3  # [m]
RIM_HEIGHT, RIM_THICKNESS = 0.5, 2e-3  # [m]


@dataclass(frozen=True)
class RigidFixture:
    """What stands on the plate.

    Attributes:
        name: of its table, or its shape and number.
        centre: of its box, where it is at rest [m], shape (3,).
        attitude: columns are its axes, shape (3, 3).
        bodies: corners of its convex bodies from the centre, in its axes [m], (n, 3) each.
        restitution, friction: between parts and it.
        moves: whether it goes with the tray.
        table: of the scenario.
    """

    name: str
    centre: NDArray[np.float64]
    attitude: NDArray[np.float64]
    bodies: tuple[NDArray[np.float64], ...]
    restitution: float
    friction: float
    moves: bool
    table: FixtureTable

    @property
    def axis(self) -> NDArray[np.float64]:
        """That it turns about, through its centre (3,)."""
        return np.asarray(self.attitude[:, "xyz".index(self.table.axis)])

    def pose(self, shift: NDArray[np.float64], angle: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Centre (3,) [m] and attitude (3, 3) after a shift [m] and a turn about its axis [rad]."""
        from scipy.spatial.transform import Rotation

        return self.centre + shift, Rotation.from_rotvec(angle * self.axis).as_matrix() @ self.attitude

    @property
    def corners(self) -> NDArray[np.float64]:
        """Of all its bodies, (n, 3)."""
        return np.concatenate(self.bodies)

    @property
    def mesh(self) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Vertices over the resting plate (n, 3) [m], and triangles of them (m, 3)."""
        from scipy.spatial import ConvexHull

        triangles, first = [], 0
        for body in self.in_space:
            hull = ConvexHull(body)
            outward = np.einsum("ij,ij->i", _normals(body, hull.simplices), hull.equations[:, :3]) > 0.0
            triangles.append(first + np.where(outward[:, None], hull.simplices, hull.simplices[:, ::-1]))
            first += len(body)
        return np.concatenate(self.in_space), np.concatenate(triangles).astype(np.int64)

    @property
    def in_space(self) -> tuple[NDArray[np.float64], ...]:
        """Corners of its bodies over the resting plate [m], (n, 3) each."""
        return tuple(self.centre + body @ self.attitude.T for body in self.bodies)


def build_fixtures(scenario: Scenario, surface: Surface) -> tuple[RigidFixture, ...]:
    """All fixtures of a scenario, on its surface at rest.

    Raises:
        InputError: a body without volume.
    """
    tables = [*scenario.fixtures, *(rim_walls(surface) if scenario.rim_of_fixtures else ())]
    return tuple(_built(table, number, scenario, surface) for number, table in enumerate(tables))


def rim_walls(surface: Surface) -> list[ExtrusionFixture]:
    """A wall along each side of the outer edge of a plate, outside of it; their ends are mitred."""
    half = 0.5 * np.array([surface.length, surface.width])
    rectangle = half * [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
    ring = rectangle if surface.outline is None else surface.outline.rings[0]
    side = np.roll(ring, -1, axis=0) - ring
    if (ring[:, 0] * side[:, 1] - ring[:, 1] * side[:, 0]).sum() < 0.0:  # twice its area
        ring, side = ring[::-1], -np.roll(side[::-1], -1, axis=0)
    length = np.linalg.norm(side, axis=1, keepdims=True)
    normal = np.column_stack([side[:, 1], -side[:, 0]]) / length
    before = np.roll(normal, 1, axis=0)
    mitre = (normal + before) / (1.0 + (normal * before).sum(axis=1, keepdims=True))
    outer = ring + min(RIM_THICKNESS, 0.3 * float(length.min())) * mitre
    walls = []
    for i in range(len(ring)):
        k = (i + 1) % len(ring)
        points = tuple((1e3 * x, 1e3 * y) for x, y in np.array([ring[i], outer[i], outer[k], ring[k]]).tolist())
        walls.append(ExtrusionFixture(shape="extrusion", name=f"rim_{i}", points_mm=points, height_mm=1e3 * RIM_HEIGHT))
    return walls


def _built(table: FixtureTable, number: int, scenario: Scenario, surface: Surface) -> RigidFixture:
    x, y, z = (1e-3 * value for value in table.foot_mm)
    tilt = _tilt(surface)
    attitude = tilt @ _about_z(math.radians(table.turn_deg))
    foot = np.array([x, y, float(surface.resting_height(np.array([[x, y]]))[0])]) + tilt[:, 2] * z
    bodies = [1e-3 * np.array(body, float) for body in table.bodies()]
    if table.foot_mm[2] == 0.0 and not table.moves_itself:
        bodies = [_founded(body) for body in bodies]
    for body in bodies:
        if np.linalg.matrix_rank(body - body[0], tol=1e-9) < 3:
            raise InputError("has no volume", key=f"fixture[{number}]")
    every = np.concatenate(bodies)
    middle = 0.5 * (every.min(axis=0) + every.max(axis=0))
    if table.moves_itself and table.axis == "z":
        middle[:2] = 0.0
    contact = scenario.contact
    restitution = contact.restitution if table.restitution is None else table.restitution
    assert isinstance(restitution, float)  # by the rules of the scenario
    return RigidFixture(
        name=table.label(number),
        centre=foot + attitude @ middle,
        attitude=attitude,
        bodies=tuple(body - middle for body in bodies),
        restitution=restitution,
        friction=contact.friction if table.friction is None else table.friction,
        moves=table.moves == "plate" and scenario.plate.kind == "tray" and not table.moves_itself,
        table=table,
    )


def _founded(body: NDArray[np.float64]) -> NDArray[np.float64]:
    """Corners of a body (n, 3) [m] that goes on below the plate it stands on: nothing gets under it as that bends."""
    is_foot = body[:, 2] <= 0.0
    plain, foot = body[~is_foot], body[is_foot]
    under = np.array([(np.abs(plain[:, :2] - corner[:2]) < 1e-12).all(axis=1).any() for corner in foot], bool)
    return np.concatenate([plain, foot[~under], foot - [0.0, 0.0, FOUNDATION]])


def _normals(points: NDArray[np.float64], triangles: NDArray[np.int32]) -> NDArray[np.float64]:
    a, b, c = (points[triangles[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def _about_z(angle: float) -> NDArray[np.float64]:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _tilt(surface: Surface) -> NDArray[np.float64]:
    """Rotation (3, 3) from a level plate to one that is tilted along x."""
    ends = np.array([[surface.x[0], 0.0], [surface.x[-1], 0.0]])
    low, high = surface.resting_height(ends)
    angle = math.atan2(float(high - low), float(surface.x[-1] - surface.x[0]))
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])
