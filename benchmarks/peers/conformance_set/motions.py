"""Numbers of the conformance set from a recorded motion: the same for every engine, whatever it records.

Time (n,) [s], position (n, 3) [m], velocity (n, 3) [m/s], spin in axes of the world (n, 3) [rad/s].
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from chart_cases import BALL_HZ, BALL_UM
from numpy.typing import NDArray

from conformance_set.cases import (
    BALL_RADIUS,
    FAST_EARLY_S,
    FAST_S,
    PLATE_DROP,
    PLATE_SPEED,
    REST_S,
    THROW_UM,
    TRAY_FROM_S,
    TRAY_S,
    cube_corner,
)
from feeder_sim.constants import GRAVITY

Array = NDArray[np.float64]
COUNTED = 50  # periods of the plate at the end over which tops are averaged
NUT_HALF_HEIGHT, NUT_CORNER = 1e-3, 5e-3 / math.sqrt(3.0)  # [m]


@dataclass(frozen=True)
class Motion:
    """States of one part; shapes as in the module. With `every_step` gravity has not acted since an impact."""

    time: Array
    position: Array
    velocity: Array
    spin: Array
    every_step: bool = False


def after_impact(motion: Motion, height: float) -> tuple[float, int]:
    """Speed upwards [m/s] with which a part left an impact at this height [m] of its centre, and its row.

    The row is that of the largest upward velocity; what gravity took since the impact is added.
    """
    row = int(np.argmax(motion.velocity[:, 2]))
    upward = float(motion.velocity[row, 2])
    if upward <= 0.0 or motion.every_step:
        return max(upward, 0.0), row
    rise = max(float(motion.position[row, 2]) - height, 0.0)
    return math.sqrt(upward**2 + 2.0 * GRAVITY * rise), row


def rebound(motion: Motion) -> dict[str, float]:
    upward, row = after_impact(motion, NUT_HALF_HEIGHT)
    return {
        "upward_velocity": upward,
        "sideways_velocity": math.hypot(*motion.velocity[row, :2]),
        "corner_velocity_by_spin": NUT_CORNER * float(np.linalg.norm(motion.spin[row])),
    }


def ball_impact(motion: Motion, height: float = BALL_RADIUS) -> dict[str, float]:
    """Both impacts of a ball that flies along x, and that of a cube, whose centre is higher then."""
    upward, row = after_impact(motion, height)
    return {
        "upward_velocity": upward,
        "velocity_along": float(motion.velocity[row, 0]),
        "spin": float(motion.spin[row, 1]),
    }


def slide_to_rest(motion: Motion) -> dict[str, float]:
    """The way that a nut slid along x from x = 0, and the speed [mm/s] at which it creeps once it has stopped."""
    stopped = int(np.searchsorted(motion.time, REST_S - 1e-9))
    crept = math.hypot(*(motion.position[-1, :2] - motion.position[stopped, :2]))
    return {
        "distance": 1e3 * float(motion.position[stopped, 0]),
        "creep": 1e3 * crept / float(motion.time[-1] - motion.time[stopped]),
    }


def rising_plate(motion: Motion) -> dict[str, float]:
    fall = (math.sqrt(PLATE_SPEED**2 + 2.0 * GRAVITY * PLATE_DROP) - PLATE_SPEED) / GRAVITY
    return {"upward_velocity": after_impact(motion, BALL_RADIUS + PLATE_SPEED * fall)[0]}


def tops(motion: Motion, amplitude: float) -> dict[str, float]:
    """Mean height [mm] over the resting plate of the tops of the last flights of a ball.

    Each follows from the highest sample of a period of the plate and its velocity. NaN for a ball that was thrown off.
    """
    height = motion.position[:, 2] - BALL_RADIUS
    period = np.floor(motion.time * BALL_HZ + 1e-6).astype(int)
    last = int(period[-1]) + (1 if period[-1] == period[-2] else 0)
    highest = [
        rows[np.argmax(height[rows])] for k in range(last - COUNTED, last) if len(rows := np.flatnonzero(period == k))
    ]
    top = height[highest] + motion.velocity[highest, 2] ** 2 / (2.0 * GRAVITY)
    thrown = float(np.max(top)) > 100.0 * amplitude
    return {"top": math.nan if thrown else 1e3 * float(np.mean(top))}


def bouncing_ball(motion: Motion) -> dict[str, float]:
    return tops(motion, 1e-6 * BALL_UM)


def throw(motion: Motion) -> dict[str, float]:
    return tops(motion, 1e-6 * THROW_UM)


def way_at(motion: Motion, time: float) -> float:
    """Place along x [mm]."""
    return 1e3 * float(motion.position[min(int(np.searchsorted(motion.time, time - 1e-9)), len(motion.time) - 1), 0])


def two_axes(motion: Motion) -> dict[str, float]:
    """Mean speed [mm/s] once the nut follows the tray."""
    return {"speed": (way_at(motion, TRAY_S) - way_at(motion, TRAY_FROM_S)) / (TRAY_S - TRAY_FROM_S)}


def fast_slip(motion: Motion) -> dict[str, float]:
    return {"early_way": way_at(motion, FAST_EARLY_S), "way": way_at(motion, FAST_S)}


OBSERVERS = {
    "rebound": rebound,
    "slide": ball_impact,
    "oblique_sticking": ball_impact,
    "slide_to_rest": slide_to_rest,
    "rising_plate": rising_plate,
    "throw": throw,
    "bouncing_ball": bouncing_ball,
    "mesh_cube": lambda motion: ball_impact(motion, cube_corner()[1]),
    "two_axes": two_axes,
    "fast_slip": fast_slip,
}
