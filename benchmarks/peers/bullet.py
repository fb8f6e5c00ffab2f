"""Bullet through PyBullet, DIRECT mode: the plate is a fixed body that gets its place and velocity before every step.

A plate of mass 0 keeps the velocity it is given in contacts as long as it is one of Bullet's multi-bodies, which is
what PyBullet makes unless told otherwise (`useMaximalCoordinates`).
"""

from __future__ import annotations

import importlib
import importlib.metadata
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from cases import AT_REST, MOVING, Method, Setup
from chart_cases import FRICTION, RESTITUTION
from numpy.typing import NDArray

from feeder_sim.constants import GRAVITY

bullet: Any = importlib.import_module("pybullet")

FOOT = 1e-5  # radius of the spheres at the corners of a nut [m]


@dataclass(frozen=True)
class Contact:
    """How Bullet is to resolve a contact.

    Attributes:
        nut: "feet" (small spheres at the corners), "hull" (convex hull), or "sat" (the hull by separating axes).
        erp: contactERP, the share of a penetration that a step takes away, and adds to the velocity.
        slop: contactSlop, how deep a contact may be without being one [m].
        breaking: contactBreakingThreshold, how far apart bodies may be that keep a contact [m].
        iterations: of the solver.
    """

    nut: str = "feet"
    erp: float = 0.0
    slop: float = 0.0
    breaking: float = 1e-9
    iterations: int = 50

    def details(self) -> str:
        return (
            f"nut: {self.nut}; "
            f"contactERP={self.erp:g} contactSlop={self.slop:g} contactBreakingThreshold={self.breaking:g} "
            f"numSolverIterations={self.iterations} "
            f"restitutionVelocityThreshold=0"
        )


class BulletWorld:
    """A fixed base as the plate: it goes where it is put, and the velocity it is given counts in contacts."""

    def __init__(self, setup: Setup, contact: Contact) -> None:
        self.setup, self.contact = setup, contact
        if not bullet.isConnected():
            bullet.connect(bullet.DIRECT)
        bullet.resetSimulation()
        bullet.setGravity(0.0, 0.0, -GRAVITY)
        bullet.setPhysicsEngineParameter(
            fixedTimeStep=setup.dt,
            numSubSteps=1,
            numSolverIterations=contact.iterations,
            restitutionVelocityThreshold=0.0,
            erp=contact.erp,
            contactERP=contact.erp,
            contactSlop=contact.slop,
            contactBreakingThreshold=contact.breaking,
            solverResidualThreshold=1e-14,
            enableSAT=int(contact.nut == "sat"),
            deterministicOverlappingPairs=1,
        )
        self.half = setup.strip.half_thickness if setup.strip else 0.0
        self.plate = self._add_plate()
        self.part = self._add_part()
        for body in (self.plate, self.part):  # Bullet multiplies both values of a pair
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
        bullet.changeDynamics(self.part, -1, maxJointVelocity=1e9)

    def _add_plate(self) -> int:
        extents = [0.5 * side for side in self.setup.sides]
        centre = [0.0, 0.0, self.half - extents[2]]
        box = bullet.createCollisionShape(bullet.GEOM_BOX, halfExtents=extents, collisionFramePosition=centre)
        place = [0.0, 0.0, -self.half]
        return int(bullet.createMultiBody(0.0, box, -1, place))

    def _add_part(self) -> int:
        setup, contact = self.setup, self.contact
        body = setup.body
        if body.radius:
            shape = bullet.createCollisionShape(bullet.GEOM_SPHERE, radius=body.radius)
        elif contact.nut == "feet":
            n = len(body.corners)
            shape = bullet.createCollisionShapeArray(
                shapeTypes=[bullet.GEOM_SPHERE] * n,
                radii=[FOOT] * n,
                collisionFramePositions=body.corners.tolist(),
            )
        else:
            vertices = body.corners.tolist()
            shape = bullet.createCollisionShape(bullet.GEOM_MESH, vertices=vertices)
        position, turn = setup.position.tolist(), np.roll(setup.quaternion, -1).tolist()
        flags = bullet.URDF_INITIALIZE_SAT_FEATURES if contact.nut == "sat" else 0
        part = bullet.createMultiBody(body.mass, shape, -1, position, turn, flags=flags)
        inertia = body.inertia.tolist()
        bullet.changeDynamics(part, -1, localInertiaDiagonal=inertia)
        bullet.resetBaseVelocity(part, setup.velocity.tolist(), setup.spin)
        return int(part)

    def state(self) -> NDArray[np.float64]:
        return np.array(self._row())

    def _row(self) -> list[float]:
        position, turn = bullet.getBasePositionAndOrientation(self.part)
        velocity, spin = bullet.getBaseVelocity(self.part)
        return [*position, turn[3], *turn[:3], *velocity, *spin]

    def fall(self, out: NDArray[np.float64]) -> None:
        step, row = bullet.stepSimulation, self._row
        for i in range(len(out)):
            step()
            out[i] = row()

    def piston(self, height: list[float], rate: list[float], out: NDArray[np.float64]) -> None:
        step, row, place, move = (
            bullet.stepSimulation,
            self._row,
            bullet.resetBasePositionAndOrientation,
            bullet.resetBaseVelocity,
        )
        plate, upright, still = self.plate, (0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0)
        at, speed = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
        below = self.half
        for i, (z, v) in enumerate(zip(height, rate, strict=True)):
            at[2] = z - below
            speed[2] = v
            place(plate, at, upright)
            move(plate, speed, still)
            step()
            out[i] = row()

    def shake(self, place: list[list[float]], rate: list[list[float]], out: NDArray[np.float64]) -> None:
        plate, upright, still = self.plate, (0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0)
        for (x, z), (u, w), row in zip(place, rate, out, strict=True):
            bullet.resetBasePositionAndOrientation(plate, (x, 0.0, z - self.half), upright)
            bullet.resetBaseVelocity(plate, (u, 0.0, w), still)
            bullet.stepSimulation()
            row[:] = self._row()

    def ride(self, q: list[float], rate: list[float]) -> None:
        step, place, move = bullet.stepSimulation, bullet.resetBasePositionAndOrientation, bullet.resetBaseVelocity
        where, strip = bullet.getBasePositionAndOrientation, self.setup.strip
        assert strip is not None
        plate, part, sin, cos = self.plate, self.part, math.sin, math.cos
        k, rotation, below = strip.wavenumber, strip.rotation, self.half
        at, turn, speed, spin = [0.0] * 3, [0.0, 0.0, 0.0, 1.0], [0.0] * 3, [0.0] * 3
        for a, v in zip(q, rate, strict=True):
            x = where(part)[0][0]
            tilt = rotation * sin(k * x)
            lift = cos(k * x) + tilt * x
            at[2] = lift * a - below
            turn[1] = 0.5 * tilt * a
            speed[2] = lift * v
            spin[1] = tilt * v
            place(plate, at, turn)
            move(plate, speed, spin)
            step()


def method(name: str, contact: Contact, cases: tuple[str, ...]) -> Method:
    version = importlib.metadata.version("pybullet")
    return Method(
        name,
        lambda setup: BulletWorld(setup, contact),
        lambda setup: f"PyBullet {version}; {contact.details()}; loop in Python",
        cases,
        8.0,
        shakes=True,
    )


METHODS = (method("Bullet", Contact(), (*MOVING, *AT_REST, "which_side_up")),)
