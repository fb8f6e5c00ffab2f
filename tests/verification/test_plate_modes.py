"""Plate modes against closed forms."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import brentq

from feeder_sim.plate.materials import MATERIALS, Material
from feeder_sim.plate.mode_shapes import standing_wave
from feeder_sim.plate.modes import PlateModes, plate_modes
from feeder_sim.plate.rectangle import RectangularPlate

# Free square Kirchhoff plate, nu = 0.30: omega a^2 sqrt(rho h / D) (after A. W. Leissa, J. Sound Vib. 31 (1973) 257).
SQUARE = [13.46820, 19.59614, 24.27020, 34.80089, 34.80089, 61.09323, 61.09323, 63.68613, 69.26541, 77.17170]


def dimensionless(modes: PlateModes) -> np.ndarray:
    plate = modes.plate
    return (
        2 * np.pi * modes.natural_frequency * plate.length**2 * np.sqrt(plate.mass_per_area / plate.bending_stiffness)
    )


def square(thickness: float) -> RectangularPlate:
    return RectangularPlate(1.0, 1.0, thickness, Material(2700.0, 70e9, 0.30))


def test_thin_square_plate_agrees_to_five_digits() -> None:
    modes = plate_modes(square(1e-4), highest_frequency=30.0, theory="kirchhoff")
    assert dimensionless(modes)[:10] == pytest.approx(SQUARE, rel=5e-6)


def test_mindlin_approaches_the_thin_plate_as_the_thickness_falls() -> None:
    errors = []
    for thickness in (8e-3, 4e-3, 2e-3, 1e-3):
        modes = plate_modes(square(thickness), highest_frequency=300 * thickness / 1e-3)
        errors.append(np.abs(dimensionless(modes)[:10] / SQUARE - 1).max())
    assert errors[-1] < 1.5e-4
    assert all(fine < 0.6 * coarse for coarse, fine in pairwise(errors))


def test_plate_without_poisson_effect_bends_like_the_free_free_beam() -> None:
    plate = RectangularPlate(1.0, 0.4, 1e-4, Material(2700.0, 70e9, 0.0))
    modes = plate_modes(plate, highest_frequency=20.0, theory="kirchhoff")
    y = np.array([0.0, 0.2])
    bending = [i for i in range(len(modes)) if np.ptp(modes.evaluate(i, 0.5, y)[0]) < 1e-6]
    roots = [
        brentq(lambda kl: np.cos(kl) * np.cosh(kl) - 1, (n - 0.1) * np.pi, (n + 0.1) * np.pi)
        for n in (1.5, 2.5, 3.5, 4.5)
    ]
    radius_of_gyration = 1e-4 / np.sqrt(12)
    expected = np.array(roots) ** 2 / (2 * np.pi) * np.sqrt(70e9 / 2700.0) * radius_of_gyration
    assert modes.natural_frequency[bending[:4]] == pytest.approx(expected, rel=5e-6)


def test_thin_rotations_are_the_slopes_of_the_deflection() -> None:
    modes = plate_modes(square(1e-4), highest_frequency=10.0, theory="kirchhoff")
    x, y, d = 0.13, -0.31, 1e-6
    for index in range(len(modes)):
        _, bx, by = modes.evaluate(index, x, y)
        assert bx == pytest.approx(
            (modes.evaluate(index, x + d, y)[0] - modes.evaluate(index, x - d, y)[0]) / (2 * d), rel=1e-5
        )
        assert by == pytest.approx(
            (modes.evaluate(index, x, y + d)[0] - modes.evaluate(index, x, y - d)[0]) / (2 * d), rel=1e-5
        )


def test_modes_are_normalised_signed_and_split_by_symmetry() -> None:
    plate = RectangularPlate(0.18, 0.18, 0.003, MATERIALS["aluminium"])
    modes = plate_modes(plate, highest_frequency=13000.0)
    grid = np.linspace(-0.09, 0.09, 181)
    for index, (odd_x, odd_y) in enumerate(modes.parity):
        w = modes.evaluate_grid(index, grid, grid)[0]
        assert np.abs(w).max() == pytest.approx(1.0, abs=1e-9)
        side = w[-1, ::-1]  # from the corner on
        assert side[np.argmax(np.abs(side) > 1e-6)] > 0
        assert np.abs(w[::-1] - (-1.0) ** odd_x * w).max() < 1e-12
        assert np.abs(w[:, ::-1] - (-1.0) ** odd_y * w).max() < 1e-12


def test_ritz_series_is_converged() -> None:
    plate = RectangularPlate(0.18, 0.18, 0.003, MATERIALS["aluminium"])
    coarse, fine = (plate_modes(plate, highest_frequency=13000.0, terms_per_axis=n).natural_frequency for n in (20, 24))
    assert len(coarse) == len(fine)
    assert coarse == pytest.approx(fine, rel=5e-4)


def test_standing_wave_is_kirchhoffs_for_long_waves_and_softer_for_short_ones() -> None:
    plate = RectangularPlate(1.0, 1.0, 0.003, MATERIALS["aluminium"])

    def thin_wavenumber(frequency: float) -> float:
        omega = 2 * np.pi * frequency
        return float((plate.mass_per_area * omega**2 / plate.bending_stiffness) ** 0.25)

    assert standing_wave(plate, 10.0).wavenumber == pytest.approx(thin_wavenumber(10.0), rel=1e-4)
    assert standing_wave(plate, 10.0).rotation == pytest.approx(thin_wavenumber(10.0), rel=2e-4)
    at_12_khz = standing_wave(plate, 12000.0)
    assert 1.01 < at_12_khz.wavenumber / thin_wavenumber(12000.0) < 1.02
    assert at_12_khz.rotation < at_12_khz.wavenumber


def test_standing_wave_satisfies_the_equations_of_motion() -> None:
    """Insert w = cos kx, beta = -B sin kx into both Mindlin equations."""
    plate = RectangularPlate(1.0, 1.0, 0.003, MATERIALS["aluminium"])
    wave = standing_wave(plate, 8775.0)
    k, b, squared = wave.wavenumber, wave.rotation, (2 * np.pi * 8775.0) ** 2
    transverse = plate.shear_stiffness * k * (k - b) - plate.mass_per_area * squared
    moment = plate.bending_stiffness * k**2 * b - plate.shear_stiffness * (k - b) - plate.rotary_inertia * squared * b
    assert transverse == pytest.approx(0.0, abs=1e-9 * plate.mass_per_area * squared)
    assert moment == pytest.approx(0.0, abs=1e-9 * plate.bending_stiffness * k**2 * b)
