"""What size, shape, orientation and thickness of a piezo patch make of the amplitude of a plate.

Each patch loads the plate with its mass and stiffness and acts by its own closed form (feeder_sim.plate.actuators). The
figure of every case is the amplitude at the middle of the patch over that of a reference patch, mode by mode, at the
same voltage or at the same field in the ceramic. Damping is the same for all, so that it drops out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from feeder_sim.plate.actuators import SHEAR_LAG, Actuator, moment_of_strain
from feeder_sim.plate.modes import PlateModes, plate_modes
from feeder_sim.plate.rectangle import RectangularPlate
from feeder_sim.plate.ritz.attachments import Layer

SAME_SHAPE = 0.8  # of the correlation of two deflections that belong to the same mode of both plates


@dataclass(frozen=True)
class PatchCase:
    """One patch of the study.

    Attributes:
        name: for people.
        layer: the patch.
        strain: that it would have if it were free [1].
        shear_lag: by which it is shorter at each edge for its action [m].
    """

    name: str
    layer: Layer
    strain: float
    shear_lag: float


@dataclass(frozen=True)
class PatchAmplitudes:
    """Amplitudes of a case, for the modes of the reference.

    Attributes:
        case: the patch.
        frequency: of the modes, with the reference patch [Hz].
        ratio: amplitude at the middle of the patch over that of the reference, shape (n_modes,).
    """

    case: PatchCase
    frequency: NDArray[np.float64]
    ratio: NDArray[np.float64]


def compare_patches(
    plate: RectangularPlate, cases: Sequence[PatchCase], *, highest_frequency: float, n_modes: int
) -> list[PatchAmplitudes]:
    """Compare patches with the first one, on the modes that this one moves most.

    Raises:
        ValueError: a mode of the reference has no counterpart on the plate with another patch.
    """
    modes, amplitude = _resonant_amplitudes(plate, cases[0], highest_frequency)
    chosen = np.sort(np.argsort(-amplitude)[:n_modes])
    found = []
    for case in cases:
        others, theirs = _resonant_amplitudes(plate, case, 1.05 * highest_frequency)
        same = [_counterpart(modes, int(index), others) for index in chosen]
        found.append(PatchAmplitudes(case, modes.natural_frequency[chosen], theirs[same] / amplitude[chosen]))
    return found


def _resonant_amplitudes(
    plate: RectangularPlate, case: PatchCase, highest_frequency: float
) -> tuple[PlateModes, NDArray[np.float64]]:
    """The modes of a plate with a patch, and 2 zeta times the amplitude of each at its middle [m], (n_modes,)."""
    modes = plate_modes(plate, highest_frequency=highest_frequency, attachments=[case.layer])
    moment = moment_of_strain(plate, case.layer) * case.strain
    force = Actuator(case.name, case.layer, moment, case.shear_lag).force_per_volt(modes)
    at_patch = modes.evaluate_whole(np.array([case.layer.centre]))[:, 0, 0]
    stiffness = modes.modal_mass * (2.0 * math.pi * modes.natural_frequency) ** 2
    return modes, np.abs(force * at_patch) / stiffness


def _counterpart(modes: PlateModes, index: int, others: PlateModes) -> int:
    """Index of the mode in `others` with the shape of a mode."""
    own = modes.coefficients[index, 0].ravel()
    theirs = others.coefficients[:, 0].reshape(len(others), -1)
    likeness = np.abs(theirs @ own) / (np.linalg.norm(theirs, axis=1) * np.linalg.norm(own))
    best = int(likeness.argmax())
    if likeness[best] < SAME_SHAPE:
        raise ValueError(f"the mode at {modes.natural_frequency[index]:.0f} Hz is another one with this patch")
    return best


def inertial_share(
    plate: RectangularPlate, case: PatchCase, thickness_strain: float, *, highest_frequency: float, n_modes: int
) -> NDArray[np.float64]:
    """Modal force of a patch that grows thicker, by the inertia of its mass, over that of its stretch.

    Args:
        plate: the plate.
        case: the patch.
        thickness_strain: relative growth of its thickness, at the voltage of `case.strain`.
        highest_frequency: of the modes [Hz].
        n_modes: so many of them, those that the patch moves most; in order of frequency.
    """
    modes, amplitude = _resonant_amplitudes(plate, case, highest_frequency)
    chosen = np.sort(np.argsort(-amplitude)[:n_modes])
    squared = (2.0 * math.pi * modes.natural_frequency[chosen]) ** 2
    at_patch = modes.evaluate_whole(np.array([case.layer.centre]))[chosen, 0, 0]
    stretch = amplitude[chosen] / np.abs(at_patch) * modes.modal_mass[chosen] * squared
    rise = 0.5 * thickness_strain * case.layer.thickness  # of its centre of mass
    return np.asarray(case.layer.mass * squared * rise * np.abs(at_patch) / stretch)


def square(
    reference: PatchCase, side: float, *, thickness: float | None = None, shear_lag: float | None = None
) -> PatchCase:
    """The reference with another side and thickness [m]; the field in the ceramic, and with it the strain, stays."""
    layer = replace(reference.layer, size=(side, side), thickness=thickness or reference.layer.thickness)
    lag = reference.shear_lag if shear_lag is None else shear_lag
    return PatchCase(f"{1e3 * side:g} mm, {1e3 * layer.thickness:g} mm thick", layer, reference.strain, lag)


def reference_case(plate: RectangularPlate, layer: Layer, strain: float) -> PatchCase:
    """A patch with the shear lag of a perfect bond."""
    return PatchCase("reference", layer, strain, SHEAR_LAG * plate.thickness)
