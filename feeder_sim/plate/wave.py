"""Modes driven together at one frequency: the wave they make, its still points, and the track of its crest.

With the complex amplitude of every mode, q_j(t) = Re[a_j exp(i w t)], the surface moves by Re[W exp(i w t)],
W(x, y) = sum a_j phi_j(x, y). A standing wave has one phase, or the opposite one, everywhere. Two degenerate modes a
quarter of a period apart make a *quasi-travelling* wave: points where both modes have nodes stay *still*. On a closed
line around a still point the phase increases or decreases by 360 degrees, so that the crest moves round along it.
(D. Shi, EPFL thesis TH7124, 2016.)
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from feeder_sim.plate.surface import Surface

DIRECTIONS = 720  # from a still point, in which the crest is searched
RADIAL_STEP = 2e-4  # [m]; of this search
FIELD_POINTS = 361  # per axis of the grid on which still points are searched
POINTS_AT_ONCE = 20_000  # limits the memory: the interpolation holds a hundred numbers per point and mode
ORDERS = 8  # Fourier components of the amplitude along a track that are counted


@dataclass(frozen=True)
class Wave:
    """Complex displacement amplitude of a surface.

    Attributes:
        surface: has the mode shapes.
        amplitude: a_j of every mode shape [m], shape (n_shapes,).
    """

    surface: Surface
    amplitude: NDArray[np.complex128]

    def at(self, points: NDArray[np.float64]) -> NDArray[np.complex128]:
        """W [m] at points (n, 2) [m], shape (n,)."""
        field = np.zeros(len(points), complex)
        for rows in np.array_split(np.arange(len(points)), 1 + len(points) // POINTS_AT_ONCE):
            field[rows] = self.amplitude @ self.surface.deflections(points[rows])
        return field

    @property
    def standing_share(self) -> float:
        """|int W^2| / int |W|^2 over the plate: 1 for a standing wave, 0 for a purely travelling one."""
        x, y, field = self.on_grid()
        if self.surface.outline is not None:
            field = field * self.surface.outline.holds(np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1))
        return standing_share(field)

    def on_grid(self, n: int = FIELD_POINTS) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.complex128]]:
        """W [m] on n x n points of the plate: x (n,), y (n,) [m] and W (n, n)."""
        x = np.linspace(-0.5, 0.5, n) * self.surface.length
        y = np.linspace(-0.5, 0.5, n) * self.surface.width
        points = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
        return x, y, self.at(points).reshape(n, n)


def standing_share(field: NDArray[np.complex128]) -> float:
    """|sum W^2| / sum |W|^2 of a complex amplitude; NaN where nothing moves."""
    total = float((np.abs(field) ** 2).sum())
    return float(abs((field**2).sum())) / total if total > 0.0 else math.nan


@dataclass(frozen=True)
class Track:
    """A closed line around a still point, counter-clockwise, and the wave along it.

    Attributes:
        points: shape (n, 2) [m], the first one not repeated.
        tangent: unit vectors, shape (n, 2).
        amplitude: complex, shape (n,) [m].
    """

    points: NDArray[np.float64]
    tangent: NDArray[np.float64]
    amplitude: NDArray[np.complex128]

    @property
    def length(self) -> float:
        """[m]."""
        return float(self._steps().sum())

    @property
    def phase_deg(self) -> NDArray[np.float64]:
        """Phase along the track without jumps, from its first point and back to it, shape (n + 1,)."""
        return np.degrees(np.unwrap(np.angle(np.append(self.amplitude, self.amplitude[0]))))

    @property
    def turns(self) -> int:
        """Change of the phase once around [360 degrees]; where it is negative the crest moves counter-clockwise."""
        phase = self.phase_deg
        return round(float(phase[-1] - phase[0]) / 360.0)

    @property
    def amplitude_ratio(self) -> float:
        """Largest over smallest amplitude."""
        modulus = np.abs(self.amplitude)
        return float(modulus.max() / max(modulus.min(), 1e-300))

    @property
    def travelling_ratio(self) -> float:
        """1: the wave only travels counter-clockwise, -1: clockwise, 0: it stands; NaN where nothing moves.

        (f - b) / (f + b), with the effective amplitudes f of all waves that travel counter-clockwise and b of those
        that travel clockwise: the Fourier components of the amplitude over the length of the track.
        """
        steps = self._steps()
        angle = 2.0 * math.pi * (np.cumsum(steps) - steps) / steps.sum()
        orders = np.arange(1, ORDERS + 1)
        forward, backward = (
            math.hypot(*(abs((self.amplitude * np.exp(sign * 1j * n * angle) * steps).sum()) for n in orders))
            for sign in (1.0, -1.0)
        )
        total = forward + backward
        return (forward - backward) / total if total > 0.0 else math.nan

    def _steps(self) -> NDArray[np.float64]:
        """Distance [m] from each point to the next one, shape (n,)."""
        return np.asarray(np.linalg.norm(np.roll(self.points, -1, axis=0) - self.points, axis=1))


def still_points(wave: Wave) -> NDArray[np.float64]:
    """Points at which W = 0, shape (n, 2) [m]: crossings of the zero lines of its real and imaginary part."""
    from contourpy import contour_generator
    from shapely import MultiLineString, get_coordinates, intersection

    x, y, field = wave.on_grid()
    # A common phase is free. This one makes both parts equally large, so that neither vanishes for a standing wave.
    field = field * np.exp(-0.5j * np.angle((field**2).sum()) + 0.25j * math.pi)
    parts = [
        MultiLineString([line for line in contour_generator(x, y, part.T).lines(0.0) if len(line) > 1])
        for part in (field.real, field.imag)
    ]
    points = np.asarray(get_coordinates(intersection(*parts)))
    outline = wave.surface.outline
    return points if outline is None else points[outline.holds(points)]


def crest_track(wave: Wave, centre: NDArray[np.float64]) -> Track:
    """Track of the crest around a still point (2,) [m]: the first maximum of the amplitude in every direction.

    Raises:
        ValueError: in some direction there is no maximum before the plate's edge.
    """
    angle = np.linspace(0.0, 2.0 * math.pi, DIRECTIONS, endpoint=False)
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    half = 0.5 * np.array([wave.surface.length, wave.surface.width])
    reach = float((half - np.abs(centre)).min())
    if wave.surface.outline is not None:
        reach = min(reach, float(wave.surface.outline.distance(centre)))
    radius = np.arange(1.0, reach / RADIAL_STEP) * RADIAL_STEP
    amplitude = np.abs(wave.at((centre + radius[:, None, None] * direction).reshape(-1, 2))).reshape(len(radius), -1)
    falls = amplitude[1:] < amplitude[:-1]
    if not falls.any(axis=0).all():
        raise ValueError("the amplitude has no crest all around this point")
    points = centre + radius[falls.argmax(axis=0)][:, None] * direction
    ahead = np.roll(points, -2, axis=0) - np.roll(points, 2, axis=0)
    return Track(points, ahead / np.linalg.norm(ahead, axis=1, keepdims=True), wave.at(points))
