"""Drake with error control: a continuous MultibodyPlant whose integrator chooses its steps.

The setting is how often the plate is placed, and from it follow both the stiffness and the accuracy: a contact lasts a
fixed part of the time between two placements, and the accuracy is a fixed part of how deep a contact gets. The
dissipation of Hunt and Crossley, F = k x (1 + d v), gives the restitution e at the speed of impact v where d v = c
solves c - ln(1 + c) = -c e - ln(1 - c e), whatever the stiffness.
"""

from __future__ import annotations

import functools
import importlib.metadata
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from cases import AT_REST, STATE, Method, Setup
from chart_cases import FRICTION, RESTITUTION
from drake_engine import Contact, DrakeWorld, pydrake, unpack
from numpy.typing import NDArray
from scipy.optimize import brentq


@dataclass(frozen=True)
class Integration:
    """How the equations of motion are integrated.

    Attributes:
        scheme: "cenic" (convex, implicit, first order) or "runge_kutta3" (explicit).
        accuracy: over the depth of a contact.
        contact: half period of mass and stiffness, over the time between two placements of the plate.
        stiction: speed below which friction is viscous, over the speed of impact.
    """

    scheme: str
    accuracy: float
    contact: float = 0.2
    stiction: float = 1e-3

    def depth(self, setup: Setup) -> float:
        """Of a contact without dissipation [m]."""
        return setup.impact_speed * self.contact * setup.dt / math.pi

    def details(self, setup: Setup) -> str:
        return (
            f"continuous, {self.scheme}, accuracy {self.accuracy * self.depth(setup):.3g}; point contact, half period "
            f"{self.contact * setup.dt:.3g} s, hunt_crossley_dissipation={dissipation():.3g}/"
            f"({setup.impact_speed:.3g} m/s), stiction_tolerance={self.stiction * setup.impact_speed:.3g} m/s"
        )


@functools.cache
def dissipation() -> float:
    """Hunt and Crossley's dissipation times the speed of impact, for the wanted restitution."""
    e = RESTITUTION
    return float(brentq(lambda c: c - math.log1p(c) + c * e + math.log1p(-c * e), 1e-3, (1.0 - 1e-9) / e))


class ContinuousWorld(DrakeWorld):
    """The same plate and part; between two placements the plate coasts, as nothing but the part pushes it."""

    def __init__(self, setup: Setup, integration: Integration) -> None:
        self.integration = integration
        super().__init__(setup, Contact())

    def _config(self, hydroelastic: bool) -> Any:
        del hydroelastic
        tolerance = self.integration.stiction * self.setup.impact_speed
        return pydrake.MultibodyPlantConfig(time_step=0.0, contact_model="point", stiction_tolerance=tolerance)

    def _properties(self, *, compliant: bool = False, rigid: bool = False) -> Any:
        """Contact of one side; both are in series, and their dissipations weighted by the other's stiffness."""
        del compliant, rigid
        setup = self.setup
        feels = setup.body.mass if setup.body.radius else setup.body.mass / 6.0
        properties = pydrake.ProximityProperties()
        pydrake.AddContactMaterial(
            dissipation=dissipation() / setup.impact_speed,
            point_stiffness=2.0 * feels * (math.pi / (self.integration.contact * setup.dt)) ** 2,
            friction=pydrake.CoulombFriction(FRICTION, FRICTION),
            properties=properties,
        )
        return properties

    def _start(self) -> None:
        super()._start()
        setup, integration = self.setup, self.integration
        self.simulator = pydrake.Simulator(self.diagram, self.context)
        config = pydrake.SimulatorConfig(
            integration_scheme=integration.scheme,
            max_step_size=setup.dt,
            accuracy=integration.accuracy * integration.depth(setup),
            use_error_control=True,
        )
        pydrake.ApplySimulatorConfig(config, self.simulator)
        self.simulator.Initialize()
        self.done = 0

    def _advance(self, state: NDArray[np.float64]) -> NDArray[np.float64]:
        """State [q, v] after the time between two placements."""
        self.context.SetContinuousState(state)
        self.done += 1
        self.simulator.AdvanceTo(self.done * self.setup.dt)
        return self._now()

    def _now(self) -> NDArray[np.float64]:
        return np.array(self.context.get_continuous_state_vector().CopyToVector(), np.float64)

    def state(self) -> NDArray[np.float64]:
        out = np.zeros((1, STATE))
        unpack(out, self._now()[None], self.joints)
        return np.array(out[0])

    def fall(self, out: NDArray[np.float64]) -> None:
        at_rest = [0.0] * len(out)
        self.piston(at_rest, at_rest, out)

    def piston(self, height: list[float], rate: list[float], out: NDArray[np.float64]) -> None:
        self.shake([[0.0, z] for z in height], [[0.0, v] for v in rate], out)

    def shake(self, place: list[list[float]], rate: list[list[float]], out: NDArray[np.float64]) -> None:
        joints, state = self.joints, self._now()
        rows = np.zeros((len(out), joints + 8))
        for (x, z), (u, w), row in zip(place, rate, rows, strict=True):
            state[:2] = z, x
            state[joints : joints + 2] = w, u
            state = self._advance(state)
            row[:] = state
        unpack(out, rows, joints)

    def ride(self, q: list[float], rate: list[float]) -> None:
        joints, state, strip = self.joints, self._now(), self.setup.strip
        assert strip is not None
        k, rotation, sin, cos = strip.wavenumber, strip.rotation, math.sin, math.cos
        for a, v in zip(q, rate, strict=True):
            x = state[6]
            tilt = rotation * sin(k * x)
            lift = cos(k * x) + tilt * x
            state[:2] = lift * a, tilt * a
            state[joints : joints + 2] = lift * v, tilt * v
            state = self._advance(state)


def method(name: str, integration: Integration, us_per_step: float) -> Method:
    version = importlib.metadata.version("drake")
    return Method(
        name,
        lambda setup: ContinuousWorld(setup, integration),
        lambda setup: f"Drake {version}; {integration.details(setup)}; loop in Python",
        ("bouncing_ball", "drift_8775", *AT_REST),
        us_per_step,
        shakes=True,
    )


METHODS = (
    method("Drake, CENIC", Integration("cenic", 1e-3), 110.0),
    method("Drake, Runge-Kutta", Integration("runge_kutta3", 1e-1), 700.0),
)
