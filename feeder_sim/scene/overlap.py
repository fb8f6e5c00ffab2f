"""Whether parts overlap where they start, by their shapes: planes that part their convex pieces."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError
from feeder_sim.part.rigid_part import RigidPart
from feeder_sim.scenario import MeshPart
from feeder_sim.scene.scene import Scene

Place = tuple[NDArray[np.float64], NDArray[np.float64]]  # position (3,) [m], attitude (4,), w first
PARTED = 1e-7  # [m]; pieces that a gap of this width parts do not overlap


def check_apart(scene: Scene, part: int, place: Place, before: Sequence[Place]) -> None:
    """Refuse a part laid down in another one.

    The hull of a mesh that stands for a concave part may reach into others; see `reaching_hulls`.

    Args:
        scene: has the parts.
        part: number of the part.
        place: of the part.
        before: places of the parts of lower numbers.

    Raises:
        InputError: it overlaps one of them.
    """
    if _is_hull(scene, part):
        return
    table = int(scene.kind_of[part])
    for other, taken in enumerate(before):
        if not _is_hull(scene, other) and parts_overlap(scene.parts[part], place, scene.parts[other], taken):
            key = f"part[{table}].start.places_mm_deg[{part - int((scene.kind_of < table).sum())}]"
            raise InputError(f"overlaps {scene.parts[other].name}, allowed is a place of its own", key=key)


def reaching_hulls(scene: Scene, places: Sequence[Place]) -> list[tuple[str, str]]:
    """Names of the parts whose shapes or hulls overlap at their places; contact will push them apart."""
    return [
        (scene.parts[a].name, scene.parts[b].name)
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


def _parted(a: NDArray[np.float64], b: NDArray[np.float64], apart: float) -> bool:
    """Whether a plane parts two sets of corners, (n, 3) and (m, 3) [m], by a distance [m] and a little."""
    from scipy.optimize import linprog

    wanted = apart + PARTED
    if (a.min(axis=0) - b.max(axis=0) > wanted).any() or (b.min(axis=0) - a.max(axis=0) > wanted).any():
        return True
    centre, size = b.mean(axis=0), max(float(np.ptp(np.concatenate([a, b]), axis=0).max()), 1e-9)
    # Unknown are a normal n, |n| <= 1 in each axis, an offset d and half the gap t: n . a <= d - t and n . b >= d + t.
    below = np.column_stack([(a - centre) / size, -np.ones(len(a)), np.ones(len(a))])
    above = np.column_stack([-(b - centre) / size, np.ones(len(b)), np.ones(len(b))])
    bounds = [(-1.0, 1.0)] * 3 + [(None, None), (None, 1.0)]
    found = linprog(
        [0.0, 0.0, 0.0, 0.0, -1.0], np.concatenate([below, above]), np.zeros(len(a) + len(b)), bounds=bounds
    )
    if found.x is None:
        return False
    return bool(2.0 * found.x[4] * size > wanted * np.linalg.norm(found.x[:3]))
