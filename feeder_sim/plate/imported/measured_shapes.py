"""Mode shapes at points, as a file of a measurement or of another program gives them, in SI units."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

MOST_POINTS = 200_000
MOST_MODES = 200
LARGEST_COORDINATE = 100.0  # [m]


@dataclass(frozen=True)
class MeasuredShapes:
    """Modes at points of a plate.

    Attributes:
        points: (n, 2) [m], in the coordinates of the file.
        frequency: natural frequencies [Hz], ascending, shape (modes,).
        deflection: w at the points, real, in any unit (modes, n).
        rotation: (beta_x, beta_y) at the points [1/m of that unit], (modes, 2, n); NaN for a mode without them.
        damping_ratio: (modes,) [1]; NaN where the file has none.
        modal_mass: (modes,) [kg] for the deflection as it stands, if that were in metres; NaN where the file has none.
        collinearity: 1 for a real mode, 0 for one whose points pass at all phases (modes,) [1].
    """

    points: NDArray[np.float64]
    frequency: NDArray[np.float64]
    deflection: NDArray[np.float64]
    rotation: NDArray[np.float64]
    damping_ratio: NDArray[np.float64]
    modal_mass: NDArray[np.float64]
    collinearity: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.frequency)

    def in_order(self) -> MeasuredShapes:
        """The same modes by frequency."""
        order = np.argsort(self.frequency, kind="stable")
        table = (self.frequency, self.deflection, self.rotation, self.damping_ratio, self.modal_mass, self.collinearity)
        return MeasuredShapes(self.points, *(values[order] for values in table))


def real_mode(shape: NDArray[np.complex128]) -> tuple[NDArray[np.float64], complex, float]:
    """The real mode nearest to a complex one (n,): it, the phase factor that makes it, and the collinearity.

    The phase makes the sum of the squares of the real parts largest. The collinearity is the modal phase collinearity
    ((Sxx - Syy)^2 + 4 Sxy^2) / (Sxx + Syy)^2 of real and imaginary parts (Pappa, Elliott and Schenk, J. Guid. Control
    Dyn. 16 (1993) 351), without taking out their means.
    """
    turn = complex(np.exp(-0.5j * np.angle((shape**2).sum())))
    total = float((np.abs(shape) ** 2).sum())
    collinearity = float(abs((shape**2).sum()) / total) ** 2 if total > 0.0 else 1.0
    return np.asarray((shape * turn).real), turn, collinearity
