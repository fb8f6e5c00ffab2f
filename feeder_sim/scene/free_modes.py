"""How the modes of a plate take impulses: modal mass, natural frequency and damping of every mode shape of a scene."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError
from feeder_sim.plate.mode_shapes import RitzShape
from feeder_sim.scene.driven_plate import DrivenMode


@dataclass(frozen=True)
class FreeModes:
    """The mode shapes of a surface as free oscillators, q(t) = Re[z exp(rate t)].

    Attributes:
        modal_mass: [kg], shape (n_shapes,).
        rate: s = -zeta w_n + i w_n sqrt(1 - zeta^2) [1/s], shape (n_shapes,).
    """

    modal_mass: NDArray[np.float64]
    rate: NDArray[np.complex128]


def free_modes(driven: Sequence[DrivenMode]) -> FreeModes:
    """The mode shapes that a scene drives, in the order of its surface.

    A shape that is driven in several ways has the natural frequency and the damping ratio of the first of them.

    Raises:
        InputError: a mode without modal mass, as of a mode file that does not know it.
    """
    first = {mode.drive.shape: mode for mode in reversed(driven)}
    mass, rate = [], []
    for _, mode in sorted(first.items()):
        zeta, w_n = mode.drive.damping_ratio, 2.0 * math.pi * mode.drive.natural_frequency
        known = float(mode.shape.modes.modal_mass[mode.shape.index]) if isinstance(mode.shape, RitzShape) else math.nan
        if zeta is None or not math.isfinite(known):
            raise InputError(
                f"{mode.label} has no modal mass or no damping, allowed with run.reaction = true are the modes of a "
                "rectangle with both",
                key="plate",
            )
        mass.append(known)
        rate.append(complex(-zeta * w_n, w_n * math.sqrt(1.0 - zeta**2)))
    return FreeModes(np.array(mass), np.array(rate))
