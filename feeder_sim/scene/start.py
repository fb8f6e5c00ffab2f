"""Where the parts of a scene start: at one point, scattered over the plate, or poured in a heap; drawn per seed."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError
from feeder_sim.part.rigid_part import RigidPart
from feeder_sim.scenario import Heap, MeshPart, PartSpec, Placed, Scattered, Start
from feeder_sim.scene.overlap import parts_overlap
from feeder_sim.scene.scene import FREE_TILT, UPRIGHT, Scene

APART = 1e-4  # [m]; smallest distance between the bounding spheres of two parts at the start
WIDEST_HEAP = 500  # parts side by side
MAX_TRIES = 20_000  # places drawn for one part before the rectangle counts as full
MAX_TRIES_OF_ALL = 200_000  # and for all parts of a table


@dataclass(frozen=True)
class Pose:
    """State of a part at its start; it does not spin.

    Attributes:
        position: of the centre of mass, shape (3,) [m].
        quaternion: attitude, shape (4,), w first.
        velocity: of the centre of mass, shape (3,) [m/s].
    """

    position: NDArray[np.float64]
    quaternion: NDArray[np.float64]
    velocity: NDArray[np.float64]


def start_poses(scene: Scene, rng: np.random.Generator) -> list[Pose]:
    """Draw the start of every part; no two overlap.

    A part is turned by a yaw and then tilted about a random horizontal axis. Its lowest point is at drop height over
    the resting plate; the lowest layer of a heap is at the smallest drop height. A part in a guide starts on the axis
    of the guide and is tilted with it.

    Raises:
        InputError: there is no room for the parts.
    """
    poses: list[Pose] = []
    placed = _Spheres(max(kind.size for kind in scene.kinds))
    first = 0
    for i, (spec, kind) in enumerate(zip(scene.scenario.part, scene.kinds, strict=True)):
        tries = [MAX_TRIES_OF_ALL]
        if isinstance(spec.start, Heap):
            centres = _column(spec.start, kind, spec.count, table=i)
        for n in range(spec.count):
            # A heap does not use the height, but the draw is part of its random sequence.
            height, quaternion = _height_and_attitude(scene, first + n, spec, kind, rng, place=n)
            if isinstance(spec.start, Start):
                position = np.array([*(1e-3 * c for c in spec.start.position_mm), height])
                guide = scene.guides[first + n]
                if guide:
                    position[:2] += guide.axis[:2] / guide.axis[2] * height
                if not placed.free(position, kind.size):
                    raise InputError("overlaps another part", key=f"part[{i}].start.position_mm")
            elif isinstance(spec.start, Placed):
                x, y, _ = spec.start.places_mm_deg[n]
                position = np.array([1e-3 * x, 1e-3 * y, height])
                check_apart(scene, first + n, Pose(position, quaternion, np.zeros(3)), poses)
            elif isinstance(spec.start, Scattered):
                place = _free_place(scene, spec.start, kind, height, placed, rng, tries, table=i)
                position = np.array([*place, height])
            else:
                position = centres[n] + [0.0, 0.0, 1e-3 * spec.start.drop_height_mm[0]]
                if not placed.free(position, kind.size):
                    raise InputError("overlaps other parts", key=f"part[{i}].start")
            placed.add(position, kind.size)
            velocity = 1e-3 * np.array(spec.start.velocity_mm_s if isinstance(spec.start, Start) else (0.0, 0.0, 0.0))
            poses.append(Pose(position, quaternion, velocity))
        first += spec.count
    return poses


def _height_and_attitude(
    scene: Scene, part: int, spec: PartSpec, kind: RigidPart, rng: np.random.Generator, *, place: int
) -> tuple[float, NDArray[np.float64]]:
    """Draw the height of the centre [m] over the resting plate and the quaternion (4,) of one part.

    place: number of the part in its table.
    """
    from scipy.spatial.transform import Rotation

    start, guide = spec.start, scene.guides[part]
    yaw_deg = (start.places_mm_deg[place][2],) * 2 if isinstance(start, Placed) else start.yaw_deg
    yaw = np.radians(rng.uniform(*yaw_deg))
    tilt = np.radians(rng.uniform(*(start.tilt_deg or (UPRIGHT if guide else FREE_TILT))))
    direction = rng.uniform(0.0, 2.0 * np.pi)
    drop = 1e-3 * rng.uniform(*start.drop_height_mm)
    lean = tilt * np.array([np.cos(direction), np.sin(direction), 0.0])
    if scene.scenario.run.planar:  # tilted about y, to either side; the outline of the part already has the yaw
        lean, yaw = np.array([0.0, math.copysign(tilt, lean[1]), 0.0]), 0.0
    rotation = Rotation.from_rotvec(lean) * Rotation.from_rotvec([0.0, 0.0, yaw])
    if guide:
        rotation = Rotation.from_rotvec([0.0, guide.tilt, 0.0]) * rotation
    quaternion = np.asarray(rotation.as_quat(scalar_first=True))
    return drop - kind.lowest(quaternion), quaternion


def check_apart(scene: Scene, part: int, pose: Pose, before: Sequence[Pose]) -> None:
    """Refuse a part laid down in another one.

    The hull of a mesh that stands for a concave part may reach into others; see `reaching_hulls`.

    Raises:
        InputError: it overlaps one of those with a pose before it.
    """
    kind, table = scene.parts[part], int(scene.kind_of[part])
    if _is_hull(scene, part):
        return
    for other, placed in enumerate(before):
        if not _is_hull(scene, other) and parts_overlap(
            kind, (pose.position, pose.quaternion), scene.parts[other], (placed.position, placed.quaternion)
        ):
            key = f"part[{table}].start.places_mm_deg[{part - int((scene.kind_of < table).sum())}]"
            raise InputError(f"overlaps {scene.parts[other].name}, allowed is a place of its own", key=key)


def reaching_hulls(scene: Scene, poses: Sequence[Pose]) -> list[tuple[str, str]]:
    """Names of the parts whose hulls overlap in their poses; contact will push them apart."""
    placed = [(pose.position, pose.quaternion) for pose in poses]
    return [
        (scene.parts[a].name, scene.parts[b].name)
        for a, b in itertools.combinations(range(len(poses)), 2)
        if parts_overlap(scene.parts[a], placed[a], scene.parts[b], placed[b])
    ]


def _is_hull(scene: Scene, part: int) -> bool:
    """Whether the hull of a mesh stands for a part, which may be concave."""
    return isinstance(scene.scenario.part[scene.kind_of[part]], MeshPart) and not scene.parts[part].pieces


class _Spheres:
    """Bounding spheres of the parts that already have a place, in cells as wide as the largest."""

    def __init__(self, largest: float) -> None:
        self._cell = 2.0 * largest + APART
        self._held: dict[tuple[int, int, int], list[tuple[list[float], float]]] = {}

    def free(self, position: NDArray[np.float64], radius: float) -> bool:
        """Whether a sphere at a position (3,) [m] with a radius [m] is `APART` or more from all others."""
        wanted = position.tolist()
        x, y, z = self._cell_of(wanted)
        for place in itertools.product((x - 1, x, x + 1), (y - 1, y, y + 1), (z - 1, z, z + 1)):
            for centre, other in self._held.get(place, ()):
                if math.dist(centre, wanted) <= other + radius + APART:
                    return False
        return True

    def add(self, position: NDArray[np.float64], radius: float) -> None:
        centre = position.tolist()
        self._held.setdefault(self._cell_of(centre), []).append((centre, radius))

    def _cell_of(self, centre: list[float]) -> tuple[int, int, int]:
        x, y, z = centre
        return math.floor(x / self._cell), math.floor(y / self._cell), math.floor(z / self._cell)


def _free_place(
    scene: Scene,
    start: Scattered,
    kind: RigidPart,
    height: float,
    placed: _Spheres,
    rng: np.random.Generator,
    tries: list[int],
    *,
    table: int,
) -> NDArray[np.float64]:
    """Draw places (2,) [m] in the rectangle of a scattered start until one is free; `tries` are left for its table.

    Raises:
        InputError: none of `MAX_TRIES` places is free, or none of those that are left; the message names the part table
            of this index.
    """
    plate = np.array([scene.surface.length, scene.surface.width])
    size = 1e-3 * np.array(start.size_mm) if start.size_mm else plate
    half = 0.5 * np.maximum(size - 2.0 * kind.size, 0.0)
    centre = 1e-3 * np.array(start.centre_mm)
    outline = scene.surface.outline
    for _ in range(min(MAX_TRIES, tries[0])):
        tries[0] -= 1
        place = centre + rng.uniform(-half, half)
        if outline is not None and outline.distance(place) < kind.size:
            continue
        if placed.free(np.array([*place, height]), kind.size):
            return np.asarray(place)
    raise InputError(
        f"has no room left for {scene.scenario.part[table].count} parts of {2e3 * kind.size:.3g} mm, allowed are fewer "
        "parts or a larger place",
        key=f"part[{table}].start",
    )


def _column(start: Heap, kind: RigidPart, count: int, *, table: int) -> NDArray[np.float64]:
    """Centres (count, 3) [m] of a column of layers in hexagonal packing, the lowest layer one part size above z = 0.

    Raises:
        InputError: the heap is absurdly wide; the message names the part table of this index.
    """
    widest = 2e3 * WIDEST_HEAP * kind.size
    if start.diameter_mm > widest:
        raise InputError(
            f"is {start.diameter_mm:g}, allowed is up to {WIDEST_HEAP} times the size of a part, {widest:.4g}",
            key=f"part[{table}].start.diameter_mm",
        )
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
