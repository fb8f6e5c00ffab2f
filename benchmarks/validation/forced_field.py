"""The motion of a plate that one force drives at one frequency, as two shapes: its parts in phase and in quadrature.

Off resonance many modes move together. In the stationary state they all have the frequency of the drive, so that their
sum is one complex field, W(x, y) e^(i w t). An engine that takes its real and its imaginary part as two shapes moves
the plate as all its modes would, at the price of two.

A force at a point also moves the plate as a whole, by -F / (M w^2), and rocks it where the point is not its middle. A
bonded patch only bends it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from feeder_sim.plate.drive import ModalTerms
from feeder_sim.plate.mode_shapes import RitzShape, shortest_wavelength
from feeder_sim.plate.modes import PlateModes
from feeder_sim.plate.ritz.matrices import orthonormal_legendre
from feeder_sim.plate.surface import Surface, tabulate

FIELD_POINTS = 201  # per axis, among which the largest amplitude is searched, the corners with them
SLOPE_STEP = 1e-4  # of the side of the plate, over which differences are taken
RAMP_GROWTH = 1e-4  # of the exponential that stands for a straight line; it is bent by a quarter of that


@dataclass(frozen=True)
class Force:
    """What drives the modes at one frequency.

    Attributes:
        modal: force on every mode, shape (n_modes,) [N] or in proportion to it.
        whole: force on the plate as a whole, through its middle, in the same unit; 0 of a patch.
    """

    modal: NDArray[np.float64]
    whole: float = 0.0


def force_in_the_middle(modes: PlateModes) -> Force:
    """A unit force at the middle of a plate."""
    return Force(modes.evaluate_whole(np.zeros((1, 2)))[:, 0, 0], 1.0)


@dataclass(frozen=True)
class ForcedField:
    """A plate at one frequency, as large as 1 where it moves most.

    Attributes:
        parts: W as two `modes`, its real part, which is the larger one, and its imaginary part.
        frequency: of the drive [Hz].
        scale: amplitude [m] for the given force, if that is in N.
    """

    parts: PlateModes
    frequency: float
    scale: float

    @property
    def shapes(self) -> tuple[RitzShape, RitzShape]:
        """Both parts, as a surface takes them."""
        return RitzShape(self.parts, 0), RitzShape(self.parts, 1)

    def at(self, points: NDArray[np.float64]) -> NDArray[np.complex128]:
        """W [1] at points (n, 2) [m], shape (n,)."""
        real, imaginary = (self.parts.evaluate(i, points[:, 0], points[:, 1])[0] for i in range(2))
        return np.asarray(real + 1j * imaginary)

    def gradient(self, points: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Slope of W [1/m] at points (n, 2) [m], shape (n, 2); its modulus is that of grad |W| for a standing wave."""
        plate = self.parts.plate
        slope = np.empty((len(points), 2), complex)
        for axis, side in enumerate((plate.length, plate.width)):
            step = np.zeros(2)
            step[axis] = SLOPE_STEP * side
            slope[:, axis] = (self.at(points + step) - self.at(points - step)) / (2.0 * step[axis])
        return slope

    def downhill(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """-grad |W|^2 [1/m] at points (n, 2) [m], which points to the nodes, shape (n, 2)."""
        return np.asarray(-2.0 * np.real(np.conj(self.at(points))[:, None] * self.gradient(points)))

    def surface(self, terms: ModalTerms) -> Surface:
        """A surface that moves as the field does; the terms are those of both `shapes`."""
        plate = self.parts.plate
        return tabulate(
            self.shapes,
            terms,
            length=plate.length,
            width=plate.width,
            thickness=plate.thickness,
            wavelength=shortest_wavelength(plate, self.frequency),
        )


def forced_field(modes: PlateModes, force: Force, frequency: float, damping_ratio: float) -> ForcedField:
    """The stationary motion under a force at a frequency [Hz]; all modes have the same damping ratio."""
    plate = modes.plate
    omega, omega_n = 2.0 * math.pi * frequency, 2.0 * math.pi * modes.natural_frequency
    q = force.modal / (modes.modal_mass * (omega_n**2 - omega**2 + 2j * damping_ratio * omega_n * omega))
    summed = np.einsum("m,mfij->fij", q, modes.coefficients)
    constant = orthonormal_legendre(np.zeros(1), modes.coefficients.shape[-1])[0, 0]
    summed[0, 0, 0] -= force.whole / (plate.mass_per_area * plate.length * plate.width * omega**2) / constant**2
    x, y = (np.linspace(-0.5, 0.5, FIELD_POINTS) * side for side in (plate.length, plate.width))

    def parts(of: NDArray[np.complex128]) -> PlateModes:
        return replace(
            modes,
            natural_frequency=np.full(2, frequency),
            coefficients=np.stack([of.real, of.imag]),
            parity=np.full((2, 2), -1),
            modal_mass=np.full(2, np.nan),
            local=(),
        )

    whole = parts(summed)
    w = whole.evaluate_grid(0, x, y)[0] + 1j * whole.evaluate_grid(1, x, y)[0]
    turned = np.exp(-0.5j * np.angle((w**2).sum()))  # the phase in which most of it moves
    scale = float(np.abs(w).max())
    return ForcedField(parts(summed * turned / scale), frequency, scale)


def triangle_terms(amplitude: float, frequency: float, duration: float) -> ModalTerms:
    """Terms of a field whose amplitude rises to `amplitude` [m] and falls again in straight lines, in `duration` [s].

    A straight line is the limit of (exp(a t) - 1) / a, two terms that the engines know. The plate follows as if every
    moment were stationary, which holds where it rings up in much less time than it takes to rise.
    """
    half, rate = 0.5 * duration, 2j * math.pi * frequency
    growth = RAMP_GROWTH / half
    # In units of the amplitude: (start, constant term, growing term) of the rise and of the fall.
    legs = ((0.0, -1.0 / RAMP_GROWTH, 1.0 / RAMP_GROWTH), (half, 1.0 + 1.0 / RAMP_GROWTH, -1.0 / RAMP_GROWTH))
    terms = [
        (shape, start, start + half, amplitude * phase * share * np.exp(rate * start), rate + slope)
        for shape, phase in ((0, 1.0), (1, 1j))  # Re[W e^(i w t)] = Re W cos w t - Im W sin w t
        for start, constant, growing in legs
        for share, slope in ((constant, 0.0), (growing, growth))
    ]
    shape, start, stop, coefficient, rates = zip(*terms, strict=True)
    return ModalTerms(
        np.array(shape, np.int64), np.array(start), np.array(stop), np.array(coefficient, complex), np.array(rates)
    )
