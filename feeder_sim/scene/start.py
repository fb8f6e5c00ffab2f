"""Where the parts of a scene start: at one point, scattered over the plate, or poured in a heap; drawn per seed."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError
from feeder_sim.part.rigid_part import RigidPart
from feeder_sim.plate.surface import Surface
from feeder_sim.scenario import GivenState, Heap, Placed, RigidPlate, Scattered, Start
from feeder_sim.scene.fits import FREE_TILT, UPRIGHT, check_width
from feeder_sim.scene.overlap import check_apart, check_off_fixtures, check_off_rim, off_fixtures, parts_overlap
from feeder_sim.scene.scene import Guide, Scene

# The column that a heap is poured from: layers in hexagonal packing, one part size apart.

APART = 1e-4  # [m]; smallest distance between the bounding spheres of two parts at the start


def column(start: Heap, size: float, count: int, *, key: str) -> NDArray[np.float64]:
    """Centres (count, 3) [m] of bounding spheres of a radius [m], the lowest layer that much above z = 0.

    Raises:
        InputError: as `check_width`.
    """
    check_width(start, size, key=key)
    pitch = 2.0 * (size + APART)
    reach = max(0.0, 0.5e-3 * start.diameter_mm - size)
    n = math.ceil(reach / pitch) + 1
    a, b = np.meshgrid(np.arange(-2 * n, 2 * n + 1), np.arange(-2 * n, 2 * n + 1))
    grid = pitch * np.column_stack([(a + 0.5 * b).ravel(), (0.5 * math.sqrt(3.0) * b).ravel()])
    layer = grid[np.hypot(*grid.T) <= reach + 1e-9]
    index = np.arange(count)
    height = size + pitch * (index // len(layer))
    centres = np.column_stack([layer[index % len(layer)], height])
    centres[:, :2] += 1e-3 * np.array(start.centre_mm)
    return centres


# The hopper that a plate is filled from: which parts come out of it next.
#
# It holds the kinds in the ratio of their counts. A scene has a fixed number of places for parts of each kind, so that
# one may come only while one of its kind is not on the plate.


def generator(scene: Scene, seed: int, *cycle: int) -> np.random.Generator:
    """Random numbers of a seed, by its index, as `SeedSequence.spawn` gives them.

    The refill at the end of a cycle has its own, so that none before it have to be remembered.
    """
    return np.random.default_rng(np.random.SeedSequence(scene.scenario.run.seed, spawn_key=(seed, *cycle)))


def next_parts(scene: Scene, free: NDArray[np.bool_], number: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Indices of the parts that come next, in this order, shape (number,) or fewer.

    Args:
        scene: has the kinds.
        free: which parts are not on the plate, shape (parts,).
        number: that are wanted.
        rng: draws the kind of each, in proportion to the counts of the kinds of which a part is free.
    """
    counts = np.bincount(scene.kind_of)
    remaining = [np.flatnonzero(free & (scene.kind_of == kind)).tolist() for kind in range(len(counts))]
    parts: list[int] = []
    for _ in range(min(number, int(free.sum()))):
        weight = np.where([bool(of_kind) for of_kind in remaining], counts, 0)
        kind = int(rng.choice(len(counts), p=weight / weight.sum()))
        parts.append(remaining[kind].pop(0))
    return np.array(parts, np.int64)


INTO_PLATE = 1e-6  # [m]; round-off of a state that is given in decimals
MAX_TRIES = 20_000  # places drawn for one part before the rectangle counts as full
MAX_TRIES_OF_ALL = 200_000  # and for all parts of a table


@dataclass(frozen=True)
class Pose:
    """State of a part at its start.

    Attributes:
        position: of the centre of mass, shape (3,) [m].
        quaternion: attitude, shape (4,), w first.
        velocity: of the centre of mass, shape (3,) [m/s].
        present: False for a part that is to come later.
        angular_velocity: in world axes, shape (3,) [rad/s].
    """

    position: NDArray[np.float64]
    quaternion: NDArray[np.float64]
    velocity: NDArray[np.float64]
    present: bool = True
    angular_velocity: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))

    @property
    def place(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Position and attitude."""
        return self.position, self.quaternion


def start_poses(scene: Scene, rng: np.random.Generator) -> list[Pose]:
    """Draw the start of every part; no two overlap, and none that is not drawn lies in the wall of a rim.

    A part is turned by a yaw and then tilted about a random horizontal axis. Its lowest point is at drop height over
    the resting plate; the lowest layer of a heap is at the smallest drop height. Tables that start in the same heap are
    poured together, in random order. A part in a guide starts on the axis of the guide and is tilted with it. Parts
    that are to come with a refill are absent.

    Raises:
        InputError: there is no room for the parts, or one lies in another or in a wall.
    """
    tables, planar = scene.scenario.part, scene.scenario.run.planar
    present = _present(scene, rng)
    centres = _columns(scene, present, rng)
    poses: list[Pose] = []
    placed = Spheres(max(kind.size for kind in scene.kinds))
    tries = [[MAX_TRIES_OF_ALL] for _ in tables]
    kind_begins = np.searchsorted(scene.kind_of, np.arange(len(tables))).tolist()
    for part, i in enumerate(scene.kind_of.tolist()):
        start, kind, guide = tables[i].start, scene.kinds[i], scene.guides[part]
        if not present[part]:
            poses.append(Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3), present=False))
            continue
        if isinstance(start, GivenState):
            key = f"part[{i}].start.position_mm"
            pose = pose_of_state(start, kind, key)
            check_apart(scene, part, pose.place, [p.place for p in poses], key)
            check_off_fixtures(scene, part, pose.place, key)
            placed.add(pose.position, kind.size)
            poses.append(pose)
            continue
        # A heap does not use the height, but the draw is part of its random sequence.
        number = part - kind_begins[i]
        height, quaternion = height_and_attitude(start, kind, rng, guide=guide, planar=planar, number=number)
        velocity = np.zeros(3)
        if isinstance(start, Start):
            position = np.array([*(1e-3 * c for c in start.position_mm), height])
            velocity = 1e-3 * np.array(start.velocity_mm_s)
            if guide:
                position[:2] += guide.axis[:2] / guide.axis[2] * height
            if not is_drawn(start, kind):
                check_off_rim(scene, part, (position, quaternion), f"part[{i}].start.position_mm")
        elif isinstance(start, Placed):
            position = np.array([*(1e-3 * c for c in start.places_mm_deg[number][:2]), height])
            if not is_drawn(start, kind):
                check_off_rim(scene, part, (position, quaternion), f"part[{i}].start.places_mm_deg[{number}]")
        elif isinstance(start, Scattered):
            place = free_place(scene, start, kind, height, placed, rng, tries[i])
            if place is None:
                raise InputError(
                    f"has no room left for {tables[i].count} parts of {2e3 * kind.size:.3g} mm, must be fewer "
                    "parts or a larger place",
                    key=f"part[{i}].start",
                )
            position = np.array([*place, height])
        else:
            position = next(centres[start]) + np.array([0.0, 0.0, 1e-3 * start.drop_height_mm[0]])
            if not placed.free(position, kind.size):
                raise InputError("overlaps other parts", key=f"part[{i}].start")
        if isinstance(scene.scenario.plate, RigidPlate):
            position, quaternion = _on_tray(scene.scenario.plate, scene.surface, position, quaternion)
        before = [pose.place for pose in poses]
        if isinstance(start, Placed):
            check_apart(scene, part, (position, quaternion), before, f"part[{i}].start.places_mm_deg[{number}]")
        elif isinstance(start, Start) and not placed.free(position, kind.size):
            # Their spheres meet. If the attitude is drawn that is refused, so that every seed has room or none.
            pairs = zip(scene.parts, before, strict=False)
            if is_drawn(start, kind) or any(parts_overlap(kind, (position, quaternion), *other) for other in pairs):
                key = f"part[{i}].start.position_mm"
                raise InputError("overlaps another part, must be a place of its own", key=key)
        check_off_fixtures(scene, part, (position, quaternion), f"part[{i}].start")
        placed.add(position, kind.size)
        poses.append(Pose(position, quaternion, velocity))
    return poses


def _on_tray(
    tray: RigidPlate, surface: Surface, position: NDArray[np.float64], quaternion: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A place over a level tray and an attitude, turned with the tray about where the part comes down."""
    from scipy.spatial.transform import Rotation

    if not tray.tilt_deg:
        return position, quaternion
    lean = Rotation.from_euler("y", -tray.tilt_deg, degrees=True)
    foot = np.array([*position[:2], surface.resting_height(position[None, :2])[0]])
    turned = lean * Rotation.from_quat(quaternion, scalar_first=True)
    return foot + lean.apply([0.0, 0.0, position[2]]), np.asarray(turned.as_quat(scalar_first=True))


def _present(scene: Scene, rng: np.random.Generator) -> NDArray[np.bool_]:
    """Which parts are there at the start, shape (parts,); all of them unless a refill is to fewer."""
    number, n_parts = scene.scenario.parts_at_once, len(scene.parts)
    present = np.full(n_parts, number == n_parts)
    if number < n_parts:
        present[next_parts(scene, ~present, number, rng)] = True
    return present


def _columns(
    scene: Scene, present: NDArray[np.bool_], rng: np.random.Generator
) -> dict[Heap, Iterator[NDArray[np.float64]]]:
    """Centres (3,) [m] for the parts that start in each heap, in the order of the parts."""
    tables = scene.scenario.part
    counts = np.bincount(scene.kind_of[present], minlength=len(tables)).tolist()
    columns = {}
    for heap in dict.fromkeys(spec.start for spec in tables if isinstance(spec.start, Heap)):
        members = [i for i, spec in enumerate(tables) if spec.start == heap]
        size = max(scene.kinds[i].size for i in members)
        centres = column(heap, size, sum(counts[i] for i in members), key=f"part[{members[0]}].start")
        if len(members) > 1:  # kinds that are poured together
            centres = centres[rng.permutation(len(centres))]
        columns[heap] = iter(centres)
    return columns


def is_drawn(start: Start | Placed, kind: RigidPart) -> bool:
    """Whether the attitude of a part is drawn; that of a ball says nothing."""
    yaw = (0.0, 0.0) if isinstance(start, Placed) else start.yaw_deg
    tilt = start.tilt_deg or FREE_TILT
    return bool(kind.corners.any()) and (yaw[0] != yaw[1] or tilt != (0.0, 0.0))


def pose_of_state(start: GivenState, kind: RigidPart, key: str) -> Pose:
    """The state that a scenario gives a part.

    Raises:
        InputError: the part reaches into the plate.
    """
    position, quaternion = 1e-3 * np.array(start.position_mm), np.array(start.quaternion)
    quaternion /= np.linalg.norm(quaternion)
    lowest = position[2] + kind.lowest(quaternion)
    if lowest < -INTO_PLATE:
        raise InputError(f"puts its lowest point {-1e3 * lowest:.4g} mm into the plate, must be over it", key=key)
    velocity = 1e-3 * np.array(start.velocity_mm_s)
    return Pose(position, quaternion, velocity, angular_velocity=np.array(start.angular_velocity_rad_s))


def height_and_attitude(
    start: Start | Scattered | Heap | Placed,
    kind: RigidPart,
    rng: np.random.Generator,
    *,
    guide: Guide | None = None,
    planar: bool = False,
    number: int = 0,
) -> tuple[float, NDArray[np.float64]]:
    """Draw the height of the centre [m] over the resting plate and the quaternion (4,) of one part."""
    from scipy.spatial.transform import Rotation

    yaw_deg = (start.places_mm_deg[number][2],) * 2 if isinstance(start, Placed) else start.yaw_deg
    yaw = np.radians(rng.uniform(*yaw_deg))
    tilt = np.radians(rng.uniform(*(start.tilt_deg or (UPRIGHT if guide else FREE_TILT))))
    direction = rng.uniform(0.0, 2.0 * np.pi)
    drop = 1e-3 * rng.uniform(*start.drop_height_mm)
    lean = tilt * np.array([np.cos(direction), np.sin(direction), 0.0])
    if planar:  # tilted about y, to either side; the outline of the part already has the yaw
        lean, yaw = np.array([0.0, math.copysign(tilt, lean[1]), 0.0]), 0.0
    rotation = Rotation.from_rotvec(lean) * Rotation.from_rotvec([0.0, 0.0, yaw])
    if guide:
        rotation = Rotation.from_rotvec([0.0, guide.tilt, 0.0]) * rotation
    quaternion = np.asarray(rotation.as_quat(scalar_first=True))
    return drop - kind.lowest(quaternion), quaternion


class Spheres:
    """Bounding spheres of the parts that already have a place, in cells as wide as the largest."""

    def __init__(self, largest: float) -> None:
        self._cell = 2.0 * largest + APART
        self._spheres: dict[tuple[int, int, int], list[tuple[list[float], float]]] = {}

    def free(self, position: NDArray[np.float64], radius: float) -> bool:
        """Whether a sphere at a position (3,) [m] with a radius [m] is `APART` or more from all others."""
        point = position.tolist()
        x, y, z = self._cell_of(point)
        for place in itertools.product((x - 1, x, x + 1), (y - 1, y, y + 1), (z - 1, z, z + 1)):
            for centre, other_radius in self._spheres.get(place, ()):
                if math.dist(centre, point) <= other_radius + radius + APART:
                    return False
        return True

    def add(self, position: NDArray[np.float64], radius: float) -> None:
        centre = position.tolist()
        self._spheres.setdefault(self._cell_of(centre), []).append((centre, radius))

    def _cell_of(self, centre: list[float]) -> tuple[int, int, int]:
        x, y, z = centre
        return math.floor(x / self._cell), math.floor(y / self._cell), math.floor(z / self._cell)


def free_place(
    scene: Scene,
    start: Scattered,
    kind: RigidPart,
    height: float,
    placed: Spheres,
    rng: np.random.Generator,
    tries: list[int],
) -> NDArray[np.float64] | None:
    """Draw places (2,) [m] in the rectangle of a scattered start until one is free.

    None where none of `MAX_TRIES` is, or none of those that are left; `tries` are left, and are counted down.
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
        position = np.array([*place, height])
        if placed.free(position, kind.size) and off_fixtures(scene, position, kind.size):
            return np.asarray(place)
    return None
