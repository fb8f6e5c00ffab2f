"""Tosses of a cube in Bullet through PyBullet: eight small spheres at its corners over a plane."""

from __future__ import annotations

import importlib
import importlib.metadata
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from cube_tosses import FRICTION, RESTITUTION, Toss
from numpy.typing import NDArray
from tosses import INERTIA, MASS, STEPS_PER_MS, corners, start

from feeder_sim.constants import GRAVITY

bullet: Any = importlib.import_module("pybullet")

FOOT = 1e-5  # radius of the spheres [m]
ITERATIONS = 50
SETTINGS = (
    f"PyBullet {importlib.metadata.version('pybullet')}, eight corner spheres, restitution and friction as square "
    "roots on both bodies, restitutionVelocityThreshold=0 contactERP=0 contactSlop=0 contactBreakingThreshold=1e-9 "
    f"numSolverIterations={ITERATIONS}"
)


def final_poses(tosses: Sequence[Toss], *, steps_per_ms: int = STEPS_PER_MS, erp: float = 0.0) -> NDArray[np.float64]:
    """Position [m] and quaternion, w first, at the end of each toss, shape (n, 7)."""
    dt, poses = 1e-3 / steps_per_ms, np.empty((len(tosses), 7))
    if not bullet.isConnected():
        bullet.connect(bullet.DIRECT)
    for i, toss in enumerate(tosses):
        cube = _world(dt, erp)
        bullet.resetBasePositionAndOrientation(cube, start(toss).tolist(), toss.attitude.as_quat().tolist())
        in_world = toss.attitude.apply(toss.angular_velocity)  # the data's is in body axes
        bullet.resetBaseVelocity(cube, toss.velocity.tolist(), in_world.tolist())
        for _ in range(round(toss.duration / dt)):
            bullet.stepSimulation()
        end, end_turn = bullet.getBasePositionAndOrientation(cube)
        poses[i] = [*end, end_turn[3], *end_turn[:3]]
    return poses


def _world(dt: float, erp: float) -> int:
    """A new world with the plane and the cube; returns the cube."""
    bullet.resetSimulation()
    bullet.setGravity(0.0, 0.0, -GRAVITY)
    bullet.setPhysicsEngineParameter(
        fixedTimeStep=dt,
        numSubSteps=1,
        numSolverIterations=ITERATIONS,
        restitutionVelocityThreshold=0.0,
        erp=erp,
        contactERP=erp,
        contactSlop=0.0,
        contactBreakingThreshold=1e-9,
        solverResidualThreshold=1e-14,
        deterministicOverlappingPairs=1,
    )
    plane = bullet.createMultiBody(0.0, bullet.createCollisionShape(bullet.GEOM_PLANE), -1, [0.0, 0.0, -FOOT])
    feet = bullet.createCollisionShapeArray(
        shapeTypes=[bullet.GEOM_SPHERE] * 8, radii=[FOOT] * 8, collisionFramePositions=corners().tolist()
    )
    cube = int(bullet.createMultiBody(MASS, feet))
    for body in (plane, cube):  # Bullet multiplies both values of a pair
        bullet.changeDynamics(
            body,
            -1,
            restitution=math.sqrt(RESTITUTION),
            lateralFriction=math.sqrt(FRICTION),
            spinningFriction=0.0,
            rollingFriction=0.0,
            linearDamping=0.0,
            angularDamping=0.0,
            activationState=bullet.ACTIVATION_STATE_DISABLE_SLEEPING,
        )
    bullet.changeDynamics(cube, -1, localInertiaDiagonal=[INERTIA] * 3, maxJointVelocity=1e9)
    return cube
