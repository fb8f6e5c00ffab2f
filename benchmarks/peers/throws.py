"""Throws of a steel block of which the share with a square face up was measured (benchmarks/validation/blocks.csv)."""

from __future__ import annotations

import math
import sys
import time
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1] / "validation"))

import numpy as np
from blocks import blocks
from cases import QUATERNION, SPIN, STATE, VELOCITY, Body, Method, Outcome, Setup
from scipy.spatial.transform import Rotation

from feeder_sim.constants import GRAVITY
from feeder_sim.studies.drops import INTERVAL_S, LONGEST, LOOKS, STILL, Starts, Throw

BLOCK_RATIO = 0.75


def which_side_up(method: Method, steps: int, throws: int) -> Outcome:
    """Whether a block with sides y, y, 0.75 y has a square face up, 100 or 0 for each throw [%]."""
    part = next(block for block in blocks() if block.ratio == BLOCK_RATIO).part()
    throw, body = Throw.of(part), Body(float(part.mass), part.inertia, 0.0, part.corners)
    starts, dt = Starts.drawn(part, throw, throws, 0), 1e-3 / steps
    fall = math.sqrt(2.0 * GRAVITY * throw.height[1])
    outcome = Outcome()
    for i in range(throws):
        spin = (float(starts.spin[i, 0]), float(starts.spin[i, 1]), float(starts.spin[i, 2]))
        turn = starts.attitude[i].as_quat(scalar_first=True)
        setup = Setup(dt, body, starts.place[i], turn, starts.velocity[i], "floor", impact_speed=fall, spin=spin)
        outcome.details = method.settings(setup)
        _throw(method, setup, part.size, LONGEST * fall / GRAVITY, outcome)
    return outcome


def _throw(method: Method, setup: Setup, size: float, longest: float, outcome: Outcome) -> None:
    """Step one throw until the block lies still; add which side is up."""
    world, looks, elapsed = method.build(setup), 0, 0.0
    out = np.zeros((round(INTERVAL_S / setup.dt), STATE))
    started = time.perf_counter()
    while looks < LOOKS and elapsed < longest:
        world.fall(out)
        elapsed += INTERVAL_S
        end = out[-1]
        if not np.isfinite(end).all() or end[2] < 0.0:
            break
        looks = looks + 1 if np.linalg.norm(end[VELOCITY]) + size * np.linalg.norm(end[SPIN]) < STILL else 0
    outcome.wall_s += time.perf_counter() - started
    outcome.simulated_s += elapsed
    if looks == LOOKS:
        up = Rotation.from_quat(end[QUATERNION], scalar_first=True).as_matrix()[2, 2]  # of the axis of the square faces
        outcome.values.append(100.0 if abs(up) > 0.5 else 0.0)
    else:
        outcome.failures.append("does not come to rest" if np.isfinite(end).all() else "not finite")
