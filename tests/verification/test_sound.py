"""Sound of a vibrating plate against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.special import j1

from feeder_sim.plate.materials import MATERIALS
from feeder_sim.plate.mode_shapes import standing_wave
from feeder_sim.plate.modes import plate_modes
from feeder_sim.plate.rectangle import RectangularPlate
from feeder_sim.plate.sound import AIR_DENSITY, SPEED_OF_SOUND, a_weighting, level_at_1_m, loudness, radiated_power

RADIUS, SPEED = 0.05, 0.01  # [m], [m/s]


@pytest.mark.parametrize("frequency", [100.0, 500.0, 2000.0, 5000.0, 15_000.0])
def test_a_round_piston_radiates_as_rayleigh_says(frequency: float) -> None:
    """rho c S v^2 / 2 (1 - J1(2 k a) / k a); Pierce, Acoustics (1989), eq. 5-4.8."""
    x = ((np.arange(60) + 0.5) / 60 - 0.5) * 2.0 * RADIUS
    points = np.stack(np.meshgrid(x, x), axis=-1).reshape(-1, 2)
    points = points[np.hypot(*points.T) < RADIUS]
    area = math.pi * RADIUS**2
    k = 2.0 * math.pi * frequency / SPEED_OF_SOUND
    expected = 0.5 * AIR_DENSITY * SPEED_OF_SOUND * area * SPEED**2 * (1.0 - j1(2.0 * k * RADIUS) / (k * RADIUS))
    found = radiated_power(np.full(len(points), SPEED + 0j), points, area, frequency)
    assert found == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize(
    ("frequency", "expected"), [(100.0, -19.1), (1000.0, 0.0), (4000.0, 1.0), (10_000.0, -2.5), (20_000.0, -9.3)]
)
def test_the_weighting_is_that_of_the_standard(frequency: float, expected: float) -> None:
    """IEC 61672-1, table 3."""
    assert a_weighting(frequency) == pytest.approx(expected, abs=0.06)


def test_a_level_is_that_of_its_power() -> None:
    """A milliwatt into the half space is 90 dB over a picowatt, and 8 dB less at 1 m."""
    assert level_at_1_m(1e-3, 1000.0) == pytest.approx(90.0 - 10.0 * math.log10(2.0 * math.pi), abs=0.01)
    assert level_at_1_m(0.0, 1000.0) == -math.inf


def test_a_plate_is_quiet_below_coincidence_and_radiates_as_a_bending_wave_above_it() -> None:
    """Over a piston of the same mean square velocity: 1 / sqrt(1 - f_c / f) above f_c (Cremer, Heckl and Petersson,
    Structure-Borne Sound (2005), ch. 6), and little well below.
    """
    plate = RectangularPlate(0.4, 0.3, 0.004, MATERIALS["aluminium"])
    coincidence = 3000.0  # where the wavelengths in plate and air are the same, for 4 mm of aluminium
    assert standing_wave(plate, coincidence).wavelength == pytest.approx(SPEED_OF_SOUND / coincidence, rel=0.02)
    modes = plate_modes(plate, highest_frequency=6000.0)
    efficiency = []
    for j, f in enumerate(modes.natural_frequency.tolist()):
        omega = 2.0 * math.pi * f
        square = float(modes.modal_mass[j]) / plate.mass_per_area * (1e-6 * omega) ** 2  # of v over the area
        piston = 0.5 * AIR_DENSITY * SPEED_OF_SOUND * square
        power = 10.0 ** (0.1 * (loudness(modes, {j: 1e-6 + 0j}, f) - a_weighting(f))) * 2.0 * math.pi * 1e-12
        efficiency.append((f, power / piston))
    low = [ratio for f, ratio in efficiency if f < 0.3 * coincidence]
    high = [ratio * math.sqrt(1.0 - coincidence / f) for f, ratio in efficiency if f > 1.5 * coincidence]
    assert max(low) < 0.05 and len(high) > 5 and high == pytest.approx([1.0] * len(high), abs=0.12)
