"""Concave parts made of boxes, and how far their pieces are apart."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, cKDTree

from feeder_sim.part.mesh_part import principal_axes
from feeder_sim.part.rigid_part import RigidPart
from feeder_sim.records.trajectory import Frames
from feeder_sim.scene.scene import Scene

STEEL = 7850.0
Box = tuple[tuple[float, float, float], tuple[float, float, float]]  # lowest and highest corner [mm]

# Lying flat, 3 mm thick: a U of 12 x 12 mm with a gap of 6 mm that opens along x, and an S of 12 x 15 mm.
U_HOOK: tuple[Box, ...] = (((0, 0, 0), (3, 12, 3)), ((3, 0, 0), (12, 3, 3)), ((3, 9, 0), (12, 12, 3)))
S_HOOK: tuple[Box, ...] = (
    ((0, 0, 0), (12, 3, 3)),
    ((9, 3, 0), (12, 6, 3)),
    ((0, 6, 0), (12, 9, 3)),
    ((0, 9, 0), (3, 12, 3)),
    ((0, 12, 0), (12, 15, 3)),
)


def of_boxes(boxes: Sequence[Box], name: str = "hook") -> RigidPart:
    """A steel part of boxes that do not overlap; each is a piece of it."""
    low, high = 1e-3 * np.array(boxes, float).transpose(1, 0, 2)
    sides, places = high - low, 0.5 * (low + high)
    mass = STEEL * sides.prod(axis=1)
    centre = mass @ places / mass.sum()
    tensor = np.zeros((3, 3))
    for m, side, place in zip(mass, sides, places - centre, strict=True):
        own = m / 12.0 * ((side @ side) * np.eye(3) - np.diag(side**2))
        tensor += own + m * ((place @ place) * np.eye(3) - np.outer(place, place))
    moments, axes = principal_axes(tensor)
    signs = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))
    pieces = tuple(place - centre + signs * side for side, place in zip(sides, places, strict=True))
    corners = np.concatenate(pieces)
    drawn: Any = trimesh.util.concatenate([trimesh.convex.convex_hull(piece) for piece in pieces])
    return RigidPart(
        name,
        float(mass.sum()),
        moments,
        corners[ConvexHull(corners).vertices],
        0.0,
        np.array(drawn.vertices),
        np.array(drawn.faces),
        principal_axes=axes,
        centre=centre,
        pieces=pieces,
    )


def with_parts(scene: Scene, kind: RigidPart) -> Scene:
    """The scene with parts of another kind in place of its own."""
    n = len(scene.parts)
    parts = tuple(replace(kind, name=part.name) for part in scene.parts)
    return replace(scene, kinds=(kind,), kind_of=np.zeros(n, np.int64), parts=parts)


def piece_distances(scene: Scene, frames: Frames) -> NDArray[np.float64]:
    """The smallest distance of any pieces of two parts at every frame [m], negative where they overlap."""
    spec: Any = mujoco.MjSpec()
    for k, kind in enumerate(scene.kinds):
        for i, piece in enumerate(kind.pieces or (kind.corners,)):
            convex = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
            spec.add_mesh(name=f"{k}_{i}", uservert=piece.ravel(), inertia=convex)
    for n, k in enumerate(scene.kind_of):
        body = spec.worldbody.add_body(name=str(n), mocap=True)
        for i in range(max(1, len(scene.kinds[k].pieces))):
            body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"{k}_{i}", contype=0, conaffinity=0)
    model = spec.compile()
    data, largest = mujoco.MjData(model), 2.0 * max(kind.size for kind in scene.kinds)
    geoms = [np.flatnonzero(model.geom_bodyid == model.body(str(n)).id) for n in range(len(scene.kind_of))]
    found = np.full(len(frames), np.inf)
    for row in range(len(frames)):
        data.mocap_pos[:], data.mocap_quat[:] = frames.position[row], frames.quaternion[row]
        mujoco.mj_kinematics(model, data)
        for a, b in cKDTree(frames.position[row]).query_pairs(largest):
            for one, other in itertools.product(geoms[a], geoms[b]):
                found[row] = min(found[row], mujoco.mj_geomDistance(model, data, one, other, 1e-2, None))
    return found
