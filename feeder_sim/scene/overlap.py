"""What parts overlap where they start, by their shapes: each other, the walls of a rim, the plate.

Planes part the convex pieces of two parts. How deep overlapping ones lie in each other is told by the normals of their
faces, which is right or a little too much.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError
from feeder_sim.part.rigid_part import RigidPart
from feeder_sim.scenario import MeshPart
from feeder_sim.scene.scene import Scene

Place = tuple[NDArray[np.float64], NDArray[np.float64]]  # position (3,) [m], attitude (4,), w first
ROUND_OFF = 1e-7  # [m]; parts that touch may lie this deep in each other, or in a wall: places are given in decimals
LEAST_GAP = 1e-9  # [m]; what the solver of linear programs tells from none
TOLERANCE = 1e-10  # of that solver, the least it takes; its own would be 2 nm for parts of 20 mm
LEAST_IN_PLATE = 1e-6  # [m]; round-off of states that are given in decimals


def check_apart(scene: Scene, part: int, place: Place, before: Sequence[Place], key: str) -> None:
    """Refuse a part laid down in another one.

    The hull of a mesh that stands for a concave part may reach into others; see `reaching_hulls`.

    Args:
        scene: has the parts.
        part: number of the part.
        place: of the part.
        before: places of the parts of lower numbers.
        key: of its place.

    Raises:
        InputError: it overlaps one of them.
    """
    if _is_hull(scene, part):
        return
    for other, other_place in enumerate(before):
        if not _is_hull(scene, other) and parts_overlap(scene.parts[part], place, scene.parts[other], other_place):
            raise InputError(f"overlaps {scene.parts[other].name}, must be a place of its own", key=key)


def check_off_rim(scene: Scene, part: int, place: Place, key: str) -> None:
    """Refuse a part that lies in a wall of the rim.

    Raises:
        InputError: it does.
    """
    if not scene.rim:
        return
    depth, axis = _rim_depths(scene, part, place)
    if depth[axis] <= ROUND_OFF:
        return
    x, y = 1e3 * place[0][:2]
    points, radius = _corners(scene, part, place)
    half = 0.5e3 * (scene.surface.length, scene.surface.width)[axis]
    ahead, behind = (1e3 * float((sign * (points - place[0])[:, axis]).max() + radius) for sign in (1.0, -1.0))
    low, high = (math.floor(1e3 * (half - reach)) / 1e3 for reach in (behind, ahead))
    raise InputError(
        f"is [{x:g}, {y:g}], {1e3 * depth[axis]:.3g} mm in the wall of the rim, must be {-low:g} to {high:g} along "
        f"{'xy'[axis]}",
        key=key,
    )


def check_off_fixtures(scene: Scene, part: int, place: Place, key: str) -> None:
    """Refuse a part that starts in a fixture.

    Raises:
        InputError: it does.
    """
    kind = scene.parts[part]
    for fixture in scene.fixtures:
        pairs = itertools.product(_pieces(kind, *place), fixture.in_space)
        if any(not _parted(a, b, kind.corner_radius) for a, b in pairs):
            raise InputError(f"lies in the fixture {fixture.name}, must be a place beside it", key=key)


def check_fixtures(scene: Scene) -> None:
    """Refuse fixtures that are in each other where they stand.

    Raises:
        InputError: two of them are.
    """
    fixtures = scene.fixtures[: len(scene.scenario.fixtures)]  # walls of a rim meet
    for (_, one), (number, other) in itertools.combinations(enumerate(fixtures), 2):
        if any(not _parted(*bodies, 0.0) for bodies in itertools.product(one.in_space, other.in_space)):
            raise InputError(f"is in {one.name}, must be a place beside it", key=f"fixture[{number}].position_mm")


def off_fixtures(scene: Scene, position: NDArray[np.float64], radius: float) -> bool:
    """Whether a sphere [m] is off the boxes around all fixtures."""
    for fixture in scene.fixtures:
        corners = fixture.corners
        place = fixture.attitude.T @ (position - fixture.centre)
        nearest = np.clip(place, corners.min(axis=0), corners.max(axis=0))
        if np.linalg.norm(place - nearest) <= radius:
            return False
    return True


def _rim_depths(scene: Scene, part: int, place: Place) -> tuple[list[float], int]:
    """How deep a part lies in the walls across x and across y [m], negative in front of them; which one is deeper."""
    points, radius = _corners(scene, part, place)
    half = 0.5 * np.array([scene.surface.length, scene.surface.width])
    depth = (np.abs(points[:, :2]).max(axis=0) + radius - half).tolist()
    return depth, int(np.argmax(depth))


def _plate_depth(scene: Scene, part: int, place: Place) -> float:
    """How deep a part lies in the plate as it is at t = 0 [m], negative above it."""
    points, radius = _corners(scene, part, place)
    surface = scene.surface
    on_plate = (np.abs(points[:, 0]) <= 0.5 * surface.length) & (np.abs(points[:, 1]) <= 0.5 * surface.width)
    if surface.outline is not None:
        on_plate &= surface.outline.distance(points[:, :2]) >= 0.0
    if not on_plate.any():
        return -math.inf
    height = surface.displacement(points[on_plate, :2], 0.0)[:, 2]
    return float((height - points[on_plate, 2]).max() + radius)


def overlaps(scene: Scene, places: Sequence[Place | None]) -> dict[str, tuple[float, str]]:
    """What parts lie in at their places: how deep the deepest of them does [m], and its name; None is no place.

    The hulls of parts, the wall of the rim, and the plate, which may be off its rest at the start.
    """
    deepest: dict[str, tuple[float, str]] = {}

    def note(what: str, depth: float, name: str) -> None:
        if depth > max(ROUND_OFF, deepest.get(what, (0.0, ""))[0]):
            deepest[what] = depth, name

    present = [(i, place) for i, place in enumerate(places) if place is not None]
    for i, place in present:
        name = scene.parts[i].name
        if scene.rim:
            note("the wall of the rim", max(_rim_depths(scene, i, place)[0]), name)
        depth = _plate_depth(scene, i, place)
        if depth > LEAST_IN_PLATE:
            note("the plate, which is off its rest then", depth, name)
    return deepest


def reaching_hulls(scene: Scene, places: Sequence[Place]) -> list[tuple[str, str, float]]:
    """Names of the parts whose shapes or hulls overlap at their places, and how deep [m]; contact pushes them apart."""
    return [
        (scene.parts[a].name, scene.parts[b].name, _depth(scene.parts[a], places[a], scene.parts[b], places[b]))
        for a, b in itertools.combinations(range(len(places)), 2)
        if parts_overlap(scene.parts[a], places[a], scene.parts[b], places[b])
    ]


def _is_hull(scene: Scene, part: int) -> bool:
    """Whether the hull of a mesh stands for a part, which may be concave."""
    return isinstance(scene.scenario.part[scene.kind_of[part]], MeshPart) and not scene.parts[part].pieces


def parts_overlap(a: RigidPart, place_a: Place, b: RigidPart, place_b: Place) -> bool:
    """Whether two parts overlap at their places."""
    if np.linalg.norm(place_a[0] - place_b[0]) > a.size + b.size:
        return False
    pieces = itertools.product(_pieces(a, *place_a), _pieces(b, *place_b))
    return any(not _parted(first, second, a.corner_radius + b.corner_radius) for first, second in pieces)


def _pieces(
    part: RigidPart, position: NDArray[np.float64], quaternion: NDArray[np.float64]
) -> list[NDArray[np.float64]]:
    """Corners (n, 3) [m] of its convex pieces in space."""
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_quat(quaternion, scalar_first=True)
    return [turn.apply(piece) + position for piece in part.pieces or (part.corners,)]


def _corners(scene: Scene, part: int, place: Place) -> tuple[NDArray[np.float64], float]:
    """Corners (n, 3) [m] of a part in space, and the radius of the spheres around them [m]."""
    from scipy.spatial.transform import Rotation

    kind = scene.parts[part]
    return Rotation.from_quat(place[1], scalar_first=True).apply(kind.corners) + place[0], kind.corner_radius


def _depth(a: RigidPart, place_a: Place, b: RigidPart, place_b: Place) -> float:
    """How far one of two overlapping parts has to be moved at most for none of their pieces to overlap [m]."""
    pieces = itertools.product(_pieces(a, *place_a), _pieces(b, *place_b))
    return max(_piece_depth(first, second) for first, second in pieces) + a.corner_radius + b.corner_radius


def _piece_depth(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """The same for two sets of corners, (n, 3) and (m, 3) [m], along a face of either or the line of centres."""
    from scipy.spatial import ConvexHull, QhullError

    directions = [np.eye(3), -np.eye(3)]
    between = b.mean(axis=0) - a.mean(axis=0)
    if np.linalg.norm(between) > 0.0:
        directions.append(between[None] / np.linalg.norm(between))
    for points, side in ((a, 1.0), (b, -1.0)):
        try:
            directions.append(side * ConvexHull(points).equations[:, :3])
        except (QhullError, ValueError):  # flat, or a point
            continue
    normals = np.concatenate(directions)
    return float(((a @ normals.T).max(axis=0) - (b @ normals.T).min(axis=0)).min())


def _parted(a: NDArray[np.float64], b: NDArray[np.float64], apart: float) -> bool:
    """Whether a plane parts two sets of corners, (n, 3) and (m, 3) [m], by a distance [m], but for round-off."""
    from scipy.optimize import linprog

    between = b.mean(axis=0) - a.mean(axis=0)
    length = float(np.linalg.norm(between))
    if length > 0.0:  # what touches has no gap, which no plane would part for sure; moved away by so little it has one
        b = b + ROUND_OFF / length * between
    least_gap = apart + LEAST_GAP
    if (a.min(axis=0) - b.max(axis=0) > least_gap).any() or (b.min(axis=0) - a.max(axis=0) > least_gap).any():
        return True
    centre, size = b.mean(axis=0), max(float(np.ptp(np.concatenate([a, b]), axis=0).max()), 1e-9)
    # Unknown are a normal n, |n| <= 1 in each axis, an offset d and half the gap t: n . a <= d - t and n . b >= d + t.
    below = np.column_stack([(a - centre) / size, -np.ones(len(a)), np.ones(len(a))])
    above = np.column_stack([-(b - centre) / size, np.ones(len(b)), np.ones(len(b))])
    bounds = [(-1.0, 1.0)] * 3 + [(None, None), (None, 1.0)]
    plane = linprog(
        [0.0, 0.0, 0.0, 0.0, -1.0],
        np.concatenate([below, above]),
        np.zeros(len(a) + len(b)),
        bounds=bounds,
        options={"primal_feasibility_tolerance": TOLERANCE, "dual_feasibility_tolerance": TOLERANCE},
    )
    if plane.x is None:
        return False
    return bool(2.0 * plane.x[4] * size > least_gap * np.linalg.norm(plane.x[:3]))
