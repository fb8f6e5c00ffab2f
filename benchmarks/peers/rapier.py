"""Rapier through its own Python package, rapier3d: the plate is a kinematic body placed before every step.

It computes in single precision and in SI: millimetres, grams and milliseconds give the same drift.
"""

from __future__ import annotations

import importlib
import importlib.metadata
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from cases import AT_REST, MOVING, STATE, Method, Setup
from chart_cases import FRICTION, RESTITUTION
from numpy.typing import NDArray

from feeder_sim.constants import GRAVITY

rapier: Any = importlib.import_module("rapier3d")

FOOT = 1e-5  # radius of the spheres at the corners of a nut [m]
MOST_SPEED = 1e9  # [m/s]


@dataclass(frozen=True)
class Contact:
    """How Rapier is to resolve a contact.

    Attributes:
        nut: "feet" (small spheres at the corners) or "hull".
        friction: FrictionModel, "SIMPLIFIED" or "COULOMB".
        corrective: largest velocity at which a penetration is taken away [m/s].
        prediction: how far apart bodies may be that get a contact [m].
        substeps: num_solver_iterations, each of which is a smaller step.
        passes: num_internal_pgs_iterations and num_internal_stabilization_iterations.
    """

    nut: str = "feet"
    friction: str = "COULOMB"
    corrective: float = 0.0
    prediction: float = 1e-9
    substeps: int = 1
    passes: int = 20

    def details(self) -> str:
        return (
            f"nut: {self.nut}; friction_model={self.friction} max_corrective_velocity={self.corrective:g} "
            f"allowed_linear_error=0 prediction_distance={self.prediction:g} num_solver_iterations={self.substeps} "
            f"num_internal_pgs_iterations={self.passes} num_internal_stabilization_iterations={self.passes}, "
            "no contact_recycling, no contact_clustering; single precision"
        )


def new_world(dt: float, contact: Contact) -> Any:
    """An empty world with gravity; its lengths are in metres, so that normalized values are, too."""
    world = rapier.PhysicsWorld(gravity=(0.0, 0.0, -GRAVITY))
    parameters = world.integration_parameters
    parameters.dt = parameters.min_ccd_dt = dt
    parameters.num_solver_iterations = contact.substeps
    parameters.num_internal_pgs_iterations = contact.passes
    parameters.num_internal_stabilization_iterations = contact.passes
    parameters.normalized_prediction_distance = contact.prediction
    parameters.normalized_allowed_linear_error = 0.0
    parameters.normalized_max_corrective_velocity = contact.corrective
    parameters.normalized_max_linear_velocity = MOST_SPEED
    parameters.contact_recycling = parameters.contact_clustering = False
    parameters.friction_model = getattr(rapier.FrictionModel, contact.friction)
    return world


def material(collider: Any) -> Any:
    """A collider without mass of its own; Rapier takes the mean of the values of both sides."""
    return collider.density(0.0).restitution(RESTITUTION).friction(FRICTION)


class RapierWorld:
    """The plate goes where it is put, and its velocity counts in contacts."""

    def __init__(self, setup: Setup, contact: Contact) -> None:
        self.setup, self.contact = setup, contact
        self.half = setup.strip.half_thickness if setup.strip else 0.0
        self.world = new_world(setup.dt, contact)
        self.plate, self.part = self._add_plate(), self._add_part()

    def _add_plate(self) -> Any:
        box = rapier.Collider.cuboid(*(0.5 * side for side in self.setup.sides))
        shape = material(box).translation((0.0, 0.0, self.half - 0.5 * self.setup.sides[2]))
        body = rapier.RigidBody.kinematic_velocity_based().translation((0.0, 0.0, -self.half)).can_sleep(False)
        return self.world.rigid_bodies[self.world.add_body(body, [shape])]

    def _add_part(self) -> Any:
        setup, body = self.setup, self.setup.body
        pose = rapier.Isometry3(
            setup.position.tolist(), rapier.Rotation3.from_quaternion(*(float(x) for x in setup.quaternion))
        )
        properties = rapier.MassProperties((0.0, 0.0, 0.0), body.mass, body.inertia.tolist())
        part = rapier.RigidBody.dynamic().position(pose).linvel(setup.velocity.tolist()).angvel(setup.spin)
        part = part.additional_mass_properties(properties).can_sleep(False).allow_fast_rotation(True)
        if body.radius:
            shapes = [rapier.Collider.ball(body.radius)]
        elif self.contact.nut == "feet":
            shapes = [rapier.Collider.ball(FOOT).translation(corner) for corner in body.corners.tolist()]
        else:
            shapes = [rapier.Collider.convex_hull(body.corners.tolist())]
        return self.world.rigid_bodies[self.world.add_body(part, [material(shape) for shape in shapes])]

    def state(self) -> NDArray[np.float64]:
        row = np.empty(STATE)
        self._read(row)
        return row

    def _read(self, row: NDArray[np.float64]) -> None:
        part = self.part
        place, turn, velocity, spin = part.translation, part.rotation, part.linvel, part.angvel
        row[:] = (
            *(place.x, place.y, place.z),
            *(turn.w, turn.i, turn.j, turn.k),
            *(velocity.x, velocity.y, velocity.z),
            *(spin.x, spin.y, spin.z),
        )

    def fall(self, out: NDArray[np.float64]) -> None:
        for row in out:
            self.world.step()
            self._read(row)

    def piston(self, height: list[float], rate: list[float], out: NDArray[np.float64]) -> None:
        self.shake([[0.0, z] for z in height], [[0.0, v] for v in rate], out)

    def shake(self, place: list[list[float]], rate: list[list[float]], out: NDArray[np.float64]) -> None:
        plate, step, read = self.plate, self.world.step, self._read
        for (x, z), (u, w), row in zip(place, rate, out, strict=True):
            plate.translation = x, 0.0, z - self.half
            plate.linvel = u, 0.0, w
            step()
            read(row)

    def ride(self, q: list[float], rate: list[float]) -> None:
        strip, plate, part, step = self.setup.strip, self.plate, self.part, self.world.step
        assert strip is not None
        k, rotation, below, sin, cos = strip.wavenumber, strip.rotation, self.half, math.sin, math.cos
        turned = rapier.Rotation3.from_quaternion
        centre = plate.local_center_of_mass.z  # whose velocity linvel is: that of the box, not of the mid-plane
        for a, v in zip(q, rate, strict=True):
            x = part.translation.x
            tilt = rotation * sin(k * x)
            lift = cos(k * x) + tilt * x
            plate.translation = 0.0, 0.0, lift * a - below
            plate.rotation = turned(1.0, 0.0, 0.5 * tilt * a, 0.0)
            plate.linvel = centre * tilt * v, 0.0, lift * v
            plate.angvel = 0.0, tilt * v, 0.0
            step()


def method(name: str, contact: Contact) -> Method:
    version = importlib.metadata.version("rapier3d")
    return Method(
        name,
        lambda setup: RapierWorld(setup, contact),
        lambda setup: f"rapier3d {version}; {contact.details()}; loop in Python",
        (*MOVING, *AT_REST, "which_side_up"),
        10.0,
        shakes=True,
    )


METHODS = (method("Rapier", Contact()),)
