"""How the modes of a plate take impulses: modal mass, natural frequency and damping of every mode shape of a scene."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError
from feeder_sim.plate.mode_shapes import RitzShape
from feeder_sim.scene.driven_mode import DrivenMode


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
    """The mode shapes that a scene moves, in the order of its surface.

    A shape that is driven in several ways has the natural frequency and the damping ratio of the first of them. One
    that also follows other drives has those of its own.

    Raises:
        InputError: a mode without modal mass, as of a mode file that does not know it.
    """
    moved = [(mode.shape, mode.drive) for mode in driven]
    moved += [(follower.shape, follower.drive) for mode in driven for follower in mode.followers]
    first = {drive.shape: (shape, drive) for shape, drive in reversed(moved)}
    mass, rate = [], []
    for number in sorted(first):
        shape, drive = first[number]
        zeta, w_n = drive.damping_ratio, 2.0 * math.pi * drive.natural_frequency
        known = float(shape.modes.modal_mass[shape.index]) if isinstance(shape, RitzShape) else math.nan
        if zeta is None or not math.isfinite(known):
            raise InputError(
                f"the mode at {drive.natural_frequency:g} Hz has no modal mass or no damping, allowed with "
                "run.reaction = true are modes with both",
                key="plate",
            )
        mass.append(known)
        rate.append(complex(-zeta * w_n, w_n * math.sqrt(1.0 - zeta**2)))
    return FreeModes(np.array(mass), np.array(rate))
