"""Whether parts overlap where they start, by their shapes: planes that part their convex pieces."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from feeder_sim.part.rigid_part import RigidPart

PARTED = 1e-7  # [m]; pieces that a gap of this width parts do not overlap


def parts_overlap(
    a: RigidPart,
    pose_a: tuple[NDArray[np.float64], NDArray[np.float64]],
    b: RigidPart,
    pose_b: tuple[NDArray[np.float64], NDArray[np.float64]],
) -> bool:
    """Whether two parts overlap, each at a position (3,) [m] and an attitude (4,), w first."""
    if np.linalg.norm(pose_a[0] - pose_b[0]) > a.size + b.size:
        return False
    pieces = itertools.product(_pieces(a, *pose_a), _pieces(b, *pose_b))
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
