"""Distance between convex hulls by MuJoCo's collision library, called from compiled code."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from feeder_sim.engines.mujoco_library import load_mujoco_symbols
from feeder_sim.machine_code import compiled, external

TOLERANCE = 1e-9  # [m], of the distance
ITERATIONS = 100

load_mujoco_symbols()
_geom_distance = external("mj_geomDistance", "float64", "voidptr", "voidptr", "int32", "int32", "float64", "voidptr")


class Hulls(NamedTuple):
    """Two copies of every convex piece in a MuJoCo model; one set per thread, since a query moves them.

    model, data: addresses; position (2 pieces, 3), attitude (2 pieces, 9): where the library looks for the hulls;
    offset (pieces, 3), turn (pieces, 3, 3): of the library's frame of a piece in that of its part; witness (6,): a
    point of either hull.
    """

    model: int
    data: int
    position: NDArray[np.float64]
    attitude: NDArray[np.float64]
    offset: NDArray[np.float64]
    turn: NDArray[np.float64]
    witness: NDArray[np.float64]


class HullLibrary:
    """Owns MuJoCo's model and data behind `Hulls`.

    Args:
        corners: of every piece, (n, 3) [m] each; a single corner is a ball.
        radii: around the corner of a ball [m]; not used for hulls.
    """

    def __init__(self, corners: list[NDArray[np.float64]], radii: list[float]) -> None:
        spec = mujoco.MjSpec()
        spec.option.ccd_tolerance, spec.option.ccd_iterations = TOLERANCE, ITERATIONS
        for piece, (points, radius) in enumerate(zip(corners, radii, strict=True)):
            if len(points) > 1:
                spec.add_mesh(
                    name=f"hull_{piece}", uservert=points.ravel(), inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
                )
            for copy in range(2):
                body = spec.worldbody.add_body(name=f"{piece}_{copy}", mocap=True)
                if len(points) > 1:
                    body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"hull_{piece}")
                else:
                    body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[radius, 0.0, 0.0])
        self._model = spec.compile()
        self._data = mujoco.MjData(self._model)
        mujoco.mj_forward(self._model, self._data)
        first = self._data.geom_xmat[::2].reshape(-1, 3, 3)  # every body is at the origin
        self._frames = (self._data.geom_xpos[::2].copy(), first.copy())

    def hulls(self) -> Hulls:
        """What compiled code needs; valid as long as this object lives."""
        data = self._data
        return Hulls(self._model._address, data._address, data.geom_xpos, data.geom_xmat, *self._frames, np.zeros(6))


@compiled
def hull_distance(hulls, a, piece_a, b, piece_b, reach):
    """Signed distance [m] of pieces of two parts (`PART`), or `reach` if larger; points in hulls.witness."""
    first, second = 2 * piece_a, 2 * piece_b + 1
    _place(hulls, first, piece_a, a.position, a.attitude)
    _place(hulls, second, piece_b, b.position, b.attitude)
    return _geom_distance(hulls.model, hulls.data, first, second, reach, hulls.witness.ctypes)


@compiled
def _place(hulls, geom, piece, position, attitude):
    for i in range(3):
        hulls.position[geom, i] = position[i]
        for j in range(3):
            hulls.position[geom, i] += attitude[i, j] * hulls.offset[piece, j]
            value = 0.0
            for k in range(3):
                value += attitude[i, k] * hulls.turn[piece, k, j]
            hulls.attitude[geom, 3 * i + j] = value
