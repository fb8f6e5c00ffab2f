"""What Zener's theory predicts for balls on a plate, and how far its assumptions hold there.

The plate counts as infinite: true while the contact is over before bending waves come back from an edge. At the
frequency f = 1/(2 t_c) of a contact of duration t_c their group velocity is 2 (D / rho h)^(1/4) (2 pi f)^(1/2).

The contact counts as elastic. With a yield strength Y of the softer side and the density rho of the ball it yields
above the speed V with rho V^2 / Y = 26 (Y / E*)^4 (Johnson, Contact Mechanics, 1985, section 11.4).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from feeder_sim.plate.materials import Material
from feeder_sim.plate.rectangle import RectangularPlate
from feeder_sim.plate.zener import contact_stiffness, contact_time, inelasticity, restitution

ELASTIC_CONTACT = 3.218  # duration of an impact without losses, in units of T


@dataclass(frozen=True)
class Prediction:
    """An impact of a ball at one speed.

    Attributes:
        speed: normal [m/s].
        inelasticity: Zener's lambda [1].
        restitution: [1].
        contact_time: of the elastic impact [s].
        reach: how far from the ball an edge is at least whose waves come back after the contact [m].
    """

    speed: float
    inelasticity: float
    restitution: float
    contact_time: float
    reach: float


def predict(ball: Material, diameter: float, plate: RectangularPlate, speeds: Sequence[float]) -> list[Prediction]:
    """Impacts of a ball of a diameter [m] on a plate at normal speeds [m/s]."""
    return [_predicted(ball, 0.5 * diameter, plate, speed) for speed in speeds]


def _predicted(ball: Material, radius: float, plate: RectangularPlate, speed: float) -> Prediction:
    value = inelasticity(ball, radius, plate, speed)
    lasts = ELASTIC_CONTACT * contact_time(ball, radius, plate.material, speed)
    group = 2.0 * (plate.bending_stiffness / plate.mass_per_area) ** 0.25 * math.sqrt(math.pi / lasts)
    return Prediction(speed, value, restitution(value), lasts, 0.5 * group * lasts)


def restitution_over_size(
    ball: Material, plate: RectangularPlate, ratios: NDArray[np.float64], speed: float
) -> NDArray[np.float64]:
    """Restitution (n,) of balls of diameters over the plate's thickness (n,), at one speed [m/s]."""
    return np.array([predict(ball, ratio * plate.thickness, plate, [speed])[0].restitution for ratio in ratios])


def yield_speed(ball: Material, plate: Material, yield_strength: float) -> float:
    """Normal speed [m/s] above which the contact yields, the softer side having this yield strength [Pa]."""
    reduced = 0.75 * contact_stiffness(ball, 1.0, plate)  # E* [Pa]
    return math.sqrt(26.0 * yield_strength / ball.density * (yield_strength / reduced) ** 4)
