"""Drake: a discrete MultibodyPlant whose plate gets its position and velocity before every step.

Contact in Drake is compliant and its steps are implicit. With the stiffness a fixed fraction of mass / dt^2 a contact
lasts a fixed number of steps, and the dissipation that gives the wanted restitution is a fixed number too.
"""

from __future__ import annotations

import functools
import importlib
import importlib.metadata
import logging
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from cases import AT_REST, QUATERNION, SPIN, STATE, VELOCITY, Method, Setup
from chart_cases import FRICTION, RESTITUTION
from numpy.typing import NDArray
from scipy.optimize import brentq

from feeder_sim.constants import GRAVITY

pydrake: Any = importlib.import_module("pydrake.all")
logging.getLogger("drake").setLevel(logging.ERROR)

PLATE_MASS_RATIO = 1e6
LENGTH = 0.12  # from which the plate's moments of inertia follow [m]
PHASES = 20
FOOT = 1e-6  # radius of the spheres at the corners of a nut [m]


@dataclass(frozen=True)
class Contact:
    """How Drake is to resolve a contact.

    Attributes:
        approximation: "sap", "lagged", "similar" or "tamsi".
        nut: "feet" (small spheres at the corners), "convex" (point contact of the hull) or "hydroelastic".
        moving: stiffness of a contact on a plate that vibrates, times dt^2 over the mass that the contact feels.
        at_rest: the same on a plate at rest or at constant speed, at 20 steps per ms; it falls with dt, so that
            contacts get more steps.
    """

    approximation: str = "tamsi"
    nut: str = "feet"
    moving: float = 5.0
    at_rest: float = 0.05

    @property
    def linear(self) -> bool:
        """Whether dissipation is linear in the velocity, so that restitution does not depend on the speed of impact."""
        return self.approximation == "sap"

    def stiffness(self, setup: Setup) -> float:
        return self.at_rest * setup.dt / 5e-5 if setup.plate in ("rest", "floor", "rising") else self.moving

    def details(self, setup: Setup) -> str:
        stiffness = self.stiffness(setup)
        dissipation = calibrated(stiffness, linear=self.linear)
        law = (
            f"relaxation_time={dissipation:.3g} dt"
            if self.linear
            else f"hunt_crossley_dissipation={dissipation:.3g}/({setup.impact_speed:.3g} m/s)"
        )
        nut = "" if setup.body.radius else f"; nut: {self.nut}"
        return f"approximation {self.approximation}; point_stiffness={stiffness:.3g} m/dt^2; {law}{nut}"


@functools.cache
def calibrated(stiffness: float, *, linear: bool) -> float:
    """Dissipation for which a mass that lands in Drake's scheme has the wanted restitution, on average over phases."""

    def excess(dissipation: float) -> float:
        phases = np.arange(0.5 / PHASES, 1.0, 1.0 / PHASES)
        return float(np.mean([_rebound(phase, stiffness, dissipation, linear) for phase in phases])) - RESTITUTION

    return float(brentq(excess, 1e-9, 3.0 / math.sqrt(stiffness) if linear else 60.0, xtol=1e-4))


def _rebound(depth: float, stiffness: float, dissipation: float, linear: bool) -> float:
    """Rebound of unit mass, unit speed and unit time step that is found this deep at first."""
    speed = 1.0
    while depth > 0.0 or speed > 0.0:
        if depth > 0.0:
            if linear:
                after = (speed - stiffness * depth) / (1.0 + stiffness * (1.0 + dissipation))
                pushes = depth + (1.0 + dissipation) * after > 0.0
            else:  # after = speed - stiffness (depth + after) (1 + dissipation after)
                a, b = stiffness * dissipation, 1.0 + stiffness + stiffness * dissipation * depth
                after = (math.sqrt(max(0.0, b * b - 4.0 * a * (stiffness * depth - speed))) - b) / (2.0 * a)
                pushes = depth + after > 0.0 and 1.0 + dissipation * after > 0.0
            speed = after if pushes else speed
        depth += speed
    return -speed


class DrakeWorld:
    """The plate on two joints in its mid-plane, far heavier than the part: up and a turn, or up and along if shaken."""

    def __init__(self, setup: Setup, contact: Contact) -> None:
        self.setup, self.contact = setup, contact
        hydroelastic = contact.nut == "hydroelastic" and not setup.body.radius
        builder = pydrake.DiagramBuilder()
        self.plant, _ = pydrake.AddMultibodyPlant(self._config(hydroelastic), builder)
        self.plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -GRAVITY])
        self._add_plate(hydroelastic)
        self._add_part(hydroelastic)
        self.plant.Finalize()
        self.diagram = builder.Build()
        self.context = self.diagram.CreateDefaultContext()
        self._start()

    def _config(self, hydroelastic: bool) -> Any:
        return pydrake.MultibodyPlantConfig(
            time_step=self.setup.dt,
            discrete_contact_approximation=self.contact.approximation,
            contact_model="hydroelastic" if hydroelastic else "point",
            use_sampled_output_ports=False,
        )

    def _add_plate(self, hydroelastic: bool) -> None:
        plant, setup = self.plant, self.setup
        half = setup.strip.half_thickness if setup.strip else 0.0
        model = plant.AddModelInstance("plate")
        mass = PLATE_MASS_RATIO * setup.body.mass
        inertia = pydrake.SpatialInertia(mass, np.zeros(3), pydrake.UnitInertia(*[LENGTH**2] * 3))
        carrier, plate = plant.AddRigidBody("carrier", model, inertia), plant.AddRigidBody("plate", model, inertia)
        below = pydrake.FixedOffsetFrame("middle", plant.world_frame(), pydrake.RigidTransform([0.0, 0.0, -half]))
        middle = plant.AddFrame(below)
        plant.AddJoint(pydrake.PrismaticJoint("lift", middle, carrier.body_frame(), [0, 0, 1]))
        if setup.plate == "shaken":
            plant.AddJoint(pydrake.PrismaticJoint("along", carrier.body_frame(), plate.body_frame(), [1, 0, 0]))
        else:
            plant.AddJoint(pydrake.RevoluteJoint("tilt", carrier.body_frame(), plate.body_frame(), [0, 1, 0]))
        plant.set_gravity_enabled(model, False)
        top = pydrake.RigidTransform([0.0, 0.0, half])
        if hydroelastic:
            plant.RegisterCollisionGeometry(plate, top, pydrake.HalfSpace(), "plate", self._properties(compliant=True))
        else:
            plant.RegisterCollisionGeometry(plate, top, pydrake.HalfSpace(), "plate", self._properties())

    def _add_part(self, hydroelastic: bool) -> None:
        plant, body, identity = self.plant, self.setup.body, pydrake.RigidTransform()
        unit = pydrake.UnitInertia(*(body.inertia / body.mass))
        model = pydrake.default_model_instance()
        self.part = plant.AddRigidBody("part", model, pydrake.SpatialInertia(body.mass, np.zeros(3), unit))
        if body.radius:
            shapes = [(identity, pydrake.Sphere(body.radius))]
        elif self.contact.nut == "feet":
            shapes = [(pydrake.RigidTransform(corner), pydrake.Sphere(FOOT)) for corner in body.corners]
        else:
            shapes = [(identity, pydrake.Convex(body.corners.T.copy(), "part"))]
        for i, (place, shape) in enumerate(shapes):
            plant.RegisterCollisionGeometry(self.part, place, shape, f"part{i}", self._properties(rigid=hydroelastic))

    def _properties(self, *, compliant: bool = False, rigid: bool = False) -> Any:
        """Contact of one side; both sides are in series, and only one side is soft."""
        setup, contact = self.setup, self.contact
        feels = setup.body.mass if setup.body.radius or contact.nut == "hydroelastic" else setup.body.mass / 6.0
        fraction = contact.stiffness(setup)
        stiffness, dissipation = fraction * feels / setup.dt**2, calibrated(fraction, linear=contact.linear)
        properties = pydrake.ProximityProperties()
        # Point stiffnesses of both sides combine to k1 k2 / (k1 + k2), their dissipations weighted by the other's k.
        pydrake.AddContactMaterial(
            dissipation=dissipation / setup.impact_speed,
            point_stiffness=None if compliant or rigid else 2.0 * stiffness,
            friction=pydrake.CoulombFriction(FRICTION, FRICTION),
            properties=properties,
        )
        # Relaxation times of both sides add up.
        share = 1.0 if compliant else 0.0 if rigid else 0.5
        properties.AddProperty("material", "relaxation_time", share * dissipation * setup.dt)
        if compliant:
            across = 2.0 * float(np.abs(setup.body.corners[:, 1]).max())
            area = 0.5 * math.sqrt(3.0) * across**2
            modulus = stiffness / area  # of a layer 1 m thick
            pydrake.AddCompliantHydroelasticPropertiesForHalfSpace(1.0, modulus, properties)
        if rigid:
            pydrake.AddRigidHydroelasticProperties(1.0, properties)
        return properties

    def _start(self) -> None:
        setup, plant = self.setup, self.plant
        own = plant.GetMyMutableContextFromRoot(self.context)
        attitude = pydrake.RotationMatrix(pydrake.Quaternion(setup.quaternion / np.linalg.norm(setup.quaternion)))
        plant.SetFreeBodyPose(own, self.part, pydrake.RigidTransform(attitude, setup.position))
        motion = pydrake.SpatialVelocity(np.array(setup.spin), setup.velocity)
        plant.SetFreeBodySpatialVelocity(own, self.part, motion)
        self.joints = plant.num_positions()  # where velocities begin
        self.discrete = self.diagram.EvalUniquePeriodicDiscreteUpdate

    def state(self) -> NDArray[np.float64]:
        out = np.zeros((1, STATE))
        unpack(out, self.context.get_discrete_state(0).CopyToVector()[None], self.joints)
        return np.array(out[0])

    def fall(self, out: NDArray[np.float64]) -> None:
        update, context = self.discrete, self.context
        rows = np.zeros((len(out), self.joints + 8))
        for row in rows:
            state = update(context)
            context.SetDiscreteState(state)
            row[:] = state.value(0)
        unpack(out, rows, self.joints)

    def piston(self, height: list[float], rate: list[float], out: NDArray[np.float64]) -> None:
        update, context, joints = self.discrete, self.context, self.joints
        rows = np.zeros((len(out), joints + 8))
        state = context.get_discrete_state(0).CopyToVector()
        for z, v, row in zip(height, rate, rows, strict=True):
            state[0] = z
            state[joints] = v
            context.SetDiscreteState(0, state)
            row[:] = update(context).value(0)
            state[:] = row
        context.SetDiscreteState(0, state)
        unpack(out, rows, joints)

    def shake(self, place: list[list[float]], rate: list[list[float]], out: NDArray[np.float64]) -> None:
        update, context, joints = self.discrete, self.context, self.joints
        rows = np.zeros((len(out), joints + 8))
        state = context.get_discrete_state(0).CopyToVector()
        for (x, z), (u, w), row in zip(place, rate, rows, strict=True):
            state[:2] = z, x
            state[joints : joints + 2] = w, u
            context.SetDiscreteState(0, state)
            row[:] = update(context).value(0)
            state[:] = row
        context.SetDiscreteState(0, state)
        unpack(out, rows, joints)

    def ride(self, q: list[float], rate: list[float]) -> None:
        update, context, joints, strip = self.discrete, self.context, self.joints, self.setup.strip
        assert strip is not None
        k, rotation, sin, cos = strip.wavenumber, strip.rotation, math.sin, math.cos
        state = context.get_discrete_state(0).CopyToVector()
        for a, v in zip(q, rate, strict=True):
            x = state[6]
            tilt = rotation * sin(k * x)
            lift = cos(k * x) + tilt * x
            state[0] = lift * a
            state[1] = tilt * a
            state[joints] = lift * v
            state[joints + 1] = tilt * v
            context.SetDiscreteState(0, state)
            state[:] = update(context).value(0)
        context.SetDiscreteState(0, state)


def unpack(out: NDArray[np.float64], rows: NDArray[np.float64], joints: int) -> None:
    """Drake keeps quaternion before position and spin before velocity."""
    out[:, QUATERNION], out[:, :3] = rows[:, 2:6], rows[:, 6:9]
    out[:, SPIN], out[:, VELOCITY] = rows[:, joints + 2 : joints + 5], rows[:, joints + 5 : joints + 8]


def method(name: str, contact: Contact, cases: tuple[str, ...]) -> Method:
    version = importlib.metadata.version("drake")
    return Method(
        name,
        lambda setup: DrakeWorld(setup, contact),
        lambda setup: f"Drake {version}; {contact.details(setup)}; loop in Python",
        cases,
        60.0,
        shakes=True,
    )


METHODS = (
    method("Drake, TAMSI", Contact(), ("bouncing_ball", "drift_8775", *AT_REST)),
    method("Drake, SAP", Contact("sap", moving=1.0), ("bouncing_ball", *AT_REST)),
)
