"""Mode shapes: the protocol they follow, one mode of a rectangular plate, closed forms of strip and rigid plate.

A straight-crested standing wave w = cos(k x) in a Mindlin plate has beta_x = -B sin(k x) with

    (S k^2 - rho h omega^2) (D k^2 + S - rho h^3/12 omega^2) = S^2 k^2,    B = k - rho h omega^2 / (S k)

(Mindlin, J. Appl. Mech. 18 (1951) 31, the lower branch of the dispersion relation); B -> k for a thin plate. The
symbols D, S, rho and h are those of feeder_sim.plate.modes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from feeder_sim.plate.modes import PlateModes
from feeder_sim.plate.rectangle import RectangularPlate


class ModeShape(Protocol):
    """Deflection and rotations of the plate's mid-plane per unit modal coordinate."""

    def evaluate_grid(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return (w [1], beta_x [1/m], beta_y [1/m]) on the product grid of x (nx,), y (ny,): shape (3, nx, ny)."""
        ...


@dataclass(frozen=True)
class RitzShape:
    """One mode of a free rectangular plate.

    Attributes:
        modes: the plate's modes.
        index: 0-based.
    """

    modes: PlateModes
    index: int

    def evaluate_grid(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        return self.modes.evaluate_grid(self.index, x, y)


@dataclass(frozen=True)
class StandingWave:
    """w = cos(k x): antinode at x = 0, nodes at odd multiples of a quarter wavelength.

    Attributes:
        wavenumber: k [1/m].
        rotation: B [1/m], amplitude of beta_x per unit deflection.
    """

    wavenumber: float
    rotation: float

    @property
    def wavelength(self) -> float:
        """[m]."""
        return 2.0 * math.pi / self.wavenumber

    def evaluate_grid(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        values = np.zeros((3, len(x), len(y)))
        values[0] = np.cos(self.wavenumber * x)[:, None]
        values[1] = -self.rotation * np.sin(self.wavenumber * x)[:, None]
        return values


@dataclass(frozen=True)
class Rigid:
    """The plate moves as one rigid body, by small amounts: a piston has w = 1.

    The top moves along x by -h/2 beta_x, so that beta_x = -2/h is a move along x by 1; a turn about z has
    beta = (2 y / h, -2 x / h), a turn about y has w = -x.

    Attributes:
        move: along x, y, z [1].
        turn: about x, y, z [1/m], per unit of the coordinate that is a length.
        thickness: h [m]; only of a move along the plate or a turn about z.
    """

    move: tuple[float, float, float] = (0.0, 0.0, 1.0)
    turn: tuple[float, float, float] = (0.0, 0.0, 0.0)
    thickness: float = 1.0

    def evaluate_grid(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        x, y = np.meshgrid(x, y, indexing="ij")
        along = self.move[0] - self.turn[2] * y, self.move[1] + self.turn[2] * x
        up = self.move[2] + self.turn[0] * y - self.turn[1] * x
        return np.stack([up, *(-2.0 / self.thickness * component for component in along)])


def standing_wave(plate: RectangularPlate, frequency: float) -> StandingWave:
    """Return the standing bending wave of an infinite plate at a frequency [Hz].

    Of `plate` only the thickness and the material count.

    Raises:
        ValueError: the frequency lies above the thickness-shear cut-off sqrt(S / (rho h^3/12)) / 2 pi.
    """
    d, s, m, j = plate.bending_stiffness, plate.shear_stiffness, plate.mass_per_area, plate.rotary_inertia
    squared_omega = (2.0 * math.pi * frequency) ** 2
    cut_off = math.sqrt(s / j) / (2.0 * math.pi)
    if frequency >= cut_off:
        raise ValueError(f"bending waves of this plate exist below {cut_off:.0f} Hz only")
    a = s * d
    b = -squared_omega * (s * j + m * d)
    c = -m * squared_omega * (s - j * squared_omega)
    k = math.sqrt((-b + math.sqrt(b * b - 4.0 * a * c)) / (2.0 * a))
    return StandingWave(wavenumber=k, rotation=k - m * squared_omega / (s * k))


def shortest_wavelength(plate: RectangularPlate, frequency: float) -> float:
    """The shorter bending wavelength [m] of a plate at a frequency [Hz], of those along x and along y.

    Raises:
        ValueError: as for `standing_wave`.
    """
    return min(standing_wave(along, frequency).wavelength for along in (plate, plate.turned))
