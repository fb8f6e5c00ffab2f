"""Steps of a lone part through the air, as MuJoCo would do them: what no contact acts on needs no contact search.

MuJoCo's semi-implicit Euler step of a free body in its principal frame is

    velocity     v += g dt;  w += -I^-1 (w x I w) dt,  w in body axes
    place        x += v dt;  attitude turned by the rotation vector w dt

with the new v and w. A part that is over the crest of the surface is taken through as many such steps as it surely
stays there.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from feeder_sim.constants import GRAVITY
from feeder_sim.machine_code import inlined, uncounted
from feeder_sim.part.rigid_part import CORNER_RADIUS
from feeder_sim.scene.scene import Scene

ABOVE = 1e-6  # [m] over the crest: a part comes down to it in steps of MuJoCo's own, from whose state its solver starts


class Flight(NamedTuple):
    """A lone part.

    corners: (n, 3), none where MuJoCo does all steps; radius: around them; reach: from the centre; inertia: principal
    (3,); crest: height above which nothing can be touched.
    """

    corners: NDArray[np.float64]
    radius: float
    reach: float
    inertia: NDArray[np.float64]
    gravity: float
    crest: float


def flight_of(scene: Scene) -> Flight:
    """The flight of the part of a scene."""
    settings = scene.scenario.mujoco
    alone = len(scene.parts) == 1 and scene.guides[0] is None and not scene.rim and settings.integrator == "euler"
    kind, terms, (antinode, steepest) = scene.kinds[0], scene.surface.terms, scene.surface.extremes[:2]
    # The patch is tangent under the centre, so that it is higher by the slope under a corner.
    per_metre = antinode[terms.shape] + 2.0 * kind.size * steepest[terms.shape]
    crest = float(np.abs(terms.coefficient) @ per_metre) + ABOVE
    return Flight(
        corners=np.asarray(kind.in_principal_axes(kind.corners), float) if alone else np.empty((0, 3)),
        radius=kind.corner_radius or CORNER_RADIUS,
        reach=kind.size,
        inertia=np.asarray(kind.inertia, float),
        gravity=GRAVITY,
        crest=crest,
    )


@uncounted
def leap(place, motion, flight, timestep, most):
    """Take the part through as many steps, `most` at most, as no corner can come below the crest; returns their number.

    Args:
        place: qpos of the part (7,), is changed.
        motion: its qvel (6,), is changed.
        flight: the part.
        timestep: of MuJoCo.
        most: number of steps.
    """
    n = _steps_above(place, motion, flight, timestep, most)
    for _ in range(n):
        _step(place, motion, flight.inertia, flight.gravity, timestep)
    return n


@inlined
def _steps_above(place, motion, flight, timestep, most):
    """How many steps no corner can come below the crest, `most` at most.

    A corner moves at |v| + |w| reach at most and falls; |w| of a free body grows by no more than the ratio of its
    moments of inertia, as its energy stays.
    """
    if flight.corners.shape[0] == 0:
        return 0
    gap = place[2] + _lowest(place, flight.corners) - flight.radius - flight.crest
    if not gap > 0.0:
        return 0
    least = min(flight.inertia[0], flight.inertia[1], flight.inertia[2])
    growth = math.sqrt(max(flight.inertia[0], flight.inertia[1], flight.inertia[2]) / least)
    spin = math.sqrt(motion[3] * motion[3] + motion[4] * motion[4] + motion[5] * motion[5])
    speed = max(-motion[2], 0.0) + growth * spin * flight.reach + flight.gravity * timestep
    time = (math.sqrt(speed * speed + 2.0 * flight.gravity * gap) - speed) / flight.gravity
    return min(int(time / timestep), most)


@inlined
def _lowest(place, corners):
    """Height of the lowest corner over the centre."""
    w, x, y, z = place[3], place[4], place[5], place[6]
    a, b, c = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)
    lowest = np.inf
    for k in range(corners.shape[0]):
        lowest = min(lowest, a * corners[k, 0] + b * corners[k, 1] + c * corners[k, 2])
    return lowest


@inlined
def _step(place, motion, inertia, gravity, timestep):
    """One step of MuJoCo's in free flight."""
    motion[2] -= gravity * timestep
    wx, wy, wz = motion[3], motion[4], motion[5]
    motion[3] = wx + timestep * (inertia[1] - inertia[2]) * wy * wz / inertia[0]
    motion[4] = wy + timestep * (inertia[2] - inertia[0]) * wz * wx / inertia[1]
    motion[5] = wz + timestep * (inertia[0] - inertia[1]) * wx * wy / inertia[2]
    for k in range(3):
        place[k] += timestep * motion[k]
    wx, wy, wz = motion[3], motion[4], motion[5]
    speed = math.sqrt(wx * wx + wy * wy + wz * wz)
    if speed == 0.0:
        return
    half = 0.5 * timestep * speed
    s, c = math.sin(half) / speed, math.cos(half)
    bx, by, bz = s * wx, s * wy, s * wz
    w, x, y, z = place[3], place[4], place[5], place[6]
    w, x, y, z = (
        w * c - x * bx - y * by - z * bz,
        w * bx + x * c + y * bz - z * by,
        w * by - x * bz + y * c + z * bx,
        w * bz + x * by - y * bx + z * c,
    )
    size = math.sqrt(w * w + x * x + y * y + z * z)
    place[3], place[4], place[5], place[6] = w / size, x / size, y / size, z / size
