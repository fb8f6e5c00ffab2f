"""Guides, which keep a part over one place of the plate.

A *slide* has no play: the part moves along its axis only and does not turn, which leaves one degree of freedom. With
the axis at an angle theta to the vertical, and friction mu between part and guide, the part's height z obeys between
impacts

    z'' = -g cos(theta) (cos(theta) + mu sin(theta))    going up
    z'' = -g cos(theta) (cos(theta) - mu sin(theta))    going down

(weight and friction along the axis, times cos(theta) for the height). A *tube* has play: the part keeps its six degrees
of freedom and can touch a round wall.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from feeder_sim.scenario import Slide, Tube


@dataclass(frozen=True)
class Guide:
    """A guide in SI units; it leans towards +x.

    Attributes:
        slides: True for a slide, False for a tube.
        tilt: theta [rad].
        foot: (x, y) where the axis meets the resting plate [m].
        friction: coefficient between part and guide [1].
        restitution: coefficient between part and wall [1]; None for a slide.
        radius: inner radius [m]; None for a slide.
    """

    slides: bool
    tilt: float
    foot: tuple[float, float]
    friction: float
    restitution: float | None = None
    radius: float | None = None

    @property
    def axis(self) -> NDArray[np.float64]:
        """Unit vector upwards along the guide, shape (3,)."""
        return np.array([math.sin(self.tilt), 0.0, math.cos(self.tilt)])

    def deceleration(self, gravity: float) -> tuple[float, float]:
        """-z'' [m/s^2] of a part on a slide on its way up and on its way down, by the formulas of the module."""
        along, across = math.cos(self.tilt), self.friction * math.sin(self.tilt)
        return gravity * along * (along + across), gravity * along * (along - across)


def build_guide(spec: Slide | Tube, position_mm: tuple[float, float]) -> Guide:
    """Turn the guide of a scenario into SI units."""
    x, y = (1e-3 * c for c in position_mm)
    tilt = math.radians(spec.tilt_deg)
    if isinstance(spec, Slide):
        return Guide(True, tilt, (x, y), spec.friction)
    return Guide(False, tilt, (x, y), spec.friction, spec.restitution, 0.5e-3 * spec.inner_diameter_mm)
