"""Throws of steel blocks of which the share with a square face up was measured (conformance/blocks.csv)."""

from __future__ import annotations

import math
import sys
import time
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1] / "validation"))

import numpy as np
from blocks import blocks, rms_beyond_chance
from cases import QUATERNION, SPIN, STATE, VELOCITY, Body, Method, Outcome, Setup
from scipy.spatial.transform import Rotation

from feeder_sim.constants import GRAVITY
from feeder_sim.part.rigid_part import RigidPart
from feeder_sim.studies.drops import INTERVAL_S, LONGEST, LOOKS, STILL, Starts, Throw


def which_side_up(method: Method, steps: int, throws: int) -> Outcome:
    """Difference of the shares with a square face up to those of blocks that were rolled: rms, percentage points."""
    total, shares = Outcome(), []
    rolled = [block for block in blocks() if block.share is not None]
    for block in rolled:
        outcome = _of_block(method, steps, throws, block.part())
        shares.append(float(np.mean(outcome.values)) if outcome.values else math.nan)
        total.wall_s += outcome.wall_s
        total.simulated_s += throws  # the cost is one of a throw
        total.failures += outcome.failures
        total.details = outcome.details
    rms, total.se = (100.0 * each for each in rms_beyond_chance(rolled, shares, throws))
    if math.isfinite(rms):
        total.values.append(rms)
    return total


def _of_block(method: Method, steps: int, throws: int, part: RigidPart) -> Outcome:
    """Whether a square face is up after each throw, 1 or 0."""
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
        outcome.values.append(1.0 if abs(up) > 0.5 else 0.0)
    else:
        outcome.failures.append("does not come to rest" if np.isfinite(end).all() else "not finite")
