"""Where the parts of a scene start: drawn per seed, on one point, scattered over the plate, or poured in a heap."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError
from feeder_sim.scenario import Heap, PartSpec, Scattered, Start
from feeder_sim.scene.rigid_part import RigidPart
from feeder_sim.scene.scene import FREE_TILT, UPRIGHT, Scene

APART = 1e-4  # [m]; parts start at least this far from each other
MAX_TRIES = 20_000  # to find a free place for a part


@dataclass(frozen=True)
class Pose:
    """How a part starts, without spin.

    Attributes:
        position: of the centre of mass, shape (3,) [m].
        quaternion: shape (4,), w first.
        velocity: of the centre of mass, shape (3,) [m/s].
    """

    position: NDArray[np.float64]
    quaternion: NDArray[np.float64]
    velocity: NDArray[np.float64]


def start_poses(scene: Scene, rng: np.random.Generator) -> list[Pose]:
    """Draw the start of every part; no two overlap.

    Tilt is about a random horizontal axis after a yaw; the lowest point is at drop height, that of a heap at the lowest
    one. A part in a guide starts on the guide's axis, turned with it.

    Raises:
        InputError: there is no room for the parts.
    """
    poses: list[Pose] = []
    placed = _Placed()
    first = 0
    for i, (spec, kind) in enumerate(zip(scene.scenario.part, scene.kinds, strict=True)):
        if isinstance(spec.start, Heap):
            centres = _column(spec.start, kind, spec.count)
        for n in range(spec.count):
            height, quaternion = _turned(scene, first + n, spec, kind, rng)
            if isinstance(spec.start, Start):
                position = np.array([*(1e-3 * c for c in spec.start.position_mm), height])
                guide = scene.guides[first + n]
                if guide:
                    position[:2] += guide.axis[:2] / guide.axis[2] * height
                if not placed.free(position, kind.size):
                    raise InputError("overlaps another part", key=f"part[{i}].start.position_mm")
            elif isinstance(spec.start, Scattered):
                position = np.array([*_free_place(scene, spec.start, kind, height, placed, rng, i), height])
            else:
                position = centres[n] + [0.0, 0.0, 1e-3 * spec.start.drop_height_mm[0]]
                if not placed.free(position, kind.size):
                    raise InputError("overlaps other parts", key=f"part[{i}].start")
            placed.add(position, kind.size)
            velocity = 1e-3 * np.array(spec.start.velocity_mm_s if isinstance(spec.start, Start) else (0.0, 0.0, 0.0))
            poses.append(Pose(position, quaternion, velocity))
        first += spec.count
    return poses


def _turned(
    scene: Scene, part: int, spec: PartSpec, kind: RigidPart, rng: np.random.Generator
) -> tuple[float, NDArray[np.float64]]:
    """Draw height of the centre [m] over the plate, and attitude, of one part."""
    from scipy.spatial.transform import Rotation

    start, guide = spec.start, scene.guides[part]
    yaw = np.radians(rng.uniform(*start.yaw_deg))
    tilt = np.radians(rng.uniform(*(start.tilt_deg or (UPRIGHT if guide else FREE_TILT))))
    direction = rng.uniform(0.0, 2.0 * np.pi)
    drop = 1e-3 * rng.uniform(*start.drop_height_mm)
    lean = tilt * np.array([np.cos(direction), np.sin(direction), 0.0])
    if scene.scenario.run.planar:  # about y, to either side; the yaw is in the outline
        lean, yaw = np.array([0.0, math.copysign(tilt, lean[1]), 0.0]), 0.0
    turned = Rotation.from_rotvec(lean) * Rotation.from_rotvec([0.0, 0.0, yaw])
    if guide:
        turned = Rotation.from_rotvec([0.0, guide.tilt, 0.0]) * turned
    quaternion = np.asarray(turned.as_quat(scalar_first=True))
    return drop - kind.lowest(quaternion), quaternion


class _Placed:
    """Bounding spheres of the parts that have their place."""

    def __init__(self) -> None:
        self._centres = np.empty((0, 3))
        self._radii = np.empty(0)

    def free(self, position: NDArray[np.float64], radius: float) -> bool:
        """Whether a sphere there keeps its distance from all others."""
        distance = np.linalg.norm(self._centres - position, axis=1)
        return bool((distance > self._radii + radius + APART).all())

    def add(self, position: NDArray[np.float64], radius: float) -> None:
        self._centres = np.vstack([self._centres, position])
        self._radii = np.append(self._radii, radius)


def _free_place(
    scene: Scene,
    start: Scattered,
    kind: RigidPart,
    height: float,
    placed: _Placed,
    rng: np.random.Generator,
    table: int,
) -> NDArray[np.float64]:
    """Draw places (2,) [m] in the rectangle until one is free."""
    plate = np.array([scene.surface.length, scene.surface.width])
    size = 1e-3 * np.array(start.size_mm) if start.size_mm else plate
    half = 0.5 * np.maximum(size - 2.0 * kind.size, 0.0)
    centre = 1e-3 * np.array(start.centre_mm)
    for _ in range(MAX_TRIES):
        place = centre + rng.uniform(-half, half)
        if placed.free(np.array([*place, height]), kind.size):
            return np.asarray(place)
    raise InputError(
        f"has no room left for {scene.scenario.part[table].count} parts of {2e3 * kind.size:.3g} mm, allowed are fewer "
        "parts or a larger place",
        key=f"part[{table}].start",
    )


def _column(start: Heap, kind: RigidPart, count: int) -> NDArray[np.float64]:
    """Centres (count, 3) [m] of a column of layers in hexagonal packing, the lowest layer one radius above z = 0."""
    pitch = 2.0 * (kind.size + APART)
    reach = max(0.0, 0.5e-3 * start.diameter_mm - kind.size)
    n = math.ceil(reach / pitch) + 1
    a, b = np.meshgrid(np.arange(-2 * n, 2 * n + 1), np.arange(-2 * n, 2 * n + 1))
    grid = pitch * np.column_stack([(a + 0.5 * b).ravel(), (0.5 * math.sqrt(3.0) * b).ravel()])
    layer = grid[np.hypot(*grid.T) <= reach + 1e-9]
    index = np.arange(count)
    height = kind.size + pitch * (index // len(layer))
    centres = np.column_stack([layer[index % len(layer)], height])
    centres[:, :2] += 1e-3 * np.array(start.centre_mm)
    return centres
