"""How loud a vibrating plate is: sound power by Rayleigh's integral, and the level at 1 m.

In an infinite baffle every element of area dS with normal velocity v is a small source, so that (Rayleigh, Theory of
Sound, 2nd ed., 1896, par. 278; in the form of radiation modes: Elliott and Johnson, J. Acoust. Soc. Am. 94 (1993) 2194)

    W = rho w^2 / (4 pi c)  sum over i, j of  v_i* v_j sin(k R_ij) / (k R_ij) dS^2,    k = w / c.

The level at 1 m is the mean over the half sphere. Without a baffle the two sides of a plate cancel each other where the
plate is small against the wave of sound in air; there this is an upper bound. Housing, holes and parts are left out.
The A-weighting is that of IEC 61672-1:2013, annex E.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from feeder_sim.plate.mode_shapes import shortest_wavelength
from feeder_sim.plate.modes import PlateModes

AIR_DENSITY, SPEED_OF_SOUND = 1.204, 343.2  # [kg/m^3], [m/s]; dry air at 20 degrees
REFERENCE_POWER = 1e-12  # [W]
PER_WAVE = 6.0  # points per bending wave
FEWEST, MOST = 16, 32  # points per axis
POLES_HZ = (20.598997, 107.65265, 737.86223, 12194.217)  # of the A-weighting
AT_1000_HZ = 2.0  # [dB]


def radiated_power(
    velocity: NDArray[np.complex128], points: NDArray[np.float64], area: float, frequency: float
) -> float:
    """Sound power [W] into the half space above a plate.

    Args:
        velocity: complex normal velocity (n,) [m/s] at points of equal area.
        points: (n, 2) [m].
        area: of all of them together [m^2].
        frequency: [Hz].
    """
    omega = 2.0 * math.pi * frequency
    k = omega / SPEED_OF_SOUND
    distance = np.linalg.norm(points[:, None] - points, axis=-1)
    coupling = np.sinc(k * distance / math.pi)
    total = float(np.real(np.conj(velocity) @ coupling @ velocity)) * (area / len(points)) ** 2
    return AIR_DENSITY * omega**2 / (4.0 * math.pi * SPEED_OF_SOUND) * max(total, 0.0)


def level_at_1_m(power: float, frequency: float) -> float:
    """A-weighted sound pressure level [dB] at 1 m, the mean over the half sphere, of a sound power [W]."""
    if power <= 0.0:
        return -math.inf
    return 10.0 * math.log10(power / REFERENCE_POWER) - 10.0 * math.log10(2.0 * math.pi) + a_weighting(frequency)


def a_weighting(frequency: float) -> float:
    """[dB]; IEC 61672-1, formula E.6."""
    f2 = frequency**2
    a, b, c, d = (pole**2 for pole in POLES_HZ)
    ratio = d * f2**2 / ((f2 + a) * math.sqrt((f2 + b) * (f2 + c)) * (f2 + d))
    return 20.0 * math.log10(ratio) + AT_1000_HZ


def loudness(modes: PlateModes, motion: Mapping[int, complex], frequency: float) -> float:
    """The A-weighted level of a plate at 1 m [dB].

    Args:
        modes: of the plate.
        motion: complex amplitude [m] of every mode that moves, by its 0-based number.
        frequency: at which they all move [Hz].
    """
    plate = modes.plate
    wavelength = shortest_wavelength(plate, frequency)
    places = sound_points(plate.length, plate.width, wavelength)
    inside = np.full(places.shape[:2], True) if modes.outline is None else modes.outline.holds(places)
    x, y = places[:, 0, 0], places[0, :, 1]
    field = sum(
        (amount * modes.evaluate_grid(j, x, y)[0] for j, amount in motion.items()), np.zeros(inside.shape, complex)
    )
    area = plate.length * plate.width * float(inside.mean())
    velocity = 2j * math.pi * frequency * field[inside]
    return level_at_1_m(radiated_power(velocity, places[inside], area, frequency), frequency)


def sound_points(length: float, width: float, wavelength: float) -> NDArray[np.float64]:
    """Middles (n, m, 2) [m] of cells of the plate's box, as fine as a wavelength [m] needs."""
    numbers = [min(max(math.ceil(PER_WAVE * side / wavelength), FEWEST), MOST) for side in (length, width)]
    x, y = (((np.arange(n) + 0.5) / n - 0.5) * side for n, side in zip(numbers, (length, width), strict=True))
    return np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
