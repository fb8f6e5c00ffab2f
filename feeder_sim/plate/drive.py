"""Modal coordinates in time: each driven mode is a damped oscillator that starts from rest.

    q'' + 2 zeta w_n q' + w_n^2 q = 2 zeta w_n^2 A cos(w (t - t_on) + phase),    t_on <= t < t_off

The force is scaled so that at resonance (w = w_n) q -> A sin(w (t - t_on) + phase), with the envelope
A (1 - exp(-zeta w t)) of the ring-up. After t_off no force acts and the motion decays as exp(-zeta w_n t). Off
resonance the same equation gives a smaller amplitude, a phase lag and beats at the start.

The exact solution, stationary motion plus transient, is a sum of terms Re[c exp(s (t - t_start))], each over an
interval of its own. The engines evaluate this list of terms (`ModalTerms`).
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterable
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

# A free decay ends when it has fallen to exp(-DECAY_LENGTH) of its start, 4e-18, which is below round-off.
DECAY_LENGTH = 40.0
MOST_AT_ONCE = 10_000_000  # terms at times
STRONG_DAMPING = 0.02  # ratio from which on a free motion may swing visibly beyond its start


@dataclass(frozen=True)
class ModalDrive:
    """One mode driven by one harmonic force.

    Attributes:
        shape: index of the mode shape on the surface.
        drive_frequency, natural_frequency: [Hz].
        amplitude: A [m], the modal coordinate reached at resonance.
        phase: [rad].
        damping_ratio: zeta [1]; with None there is no ring-up and no ring-down: the motion starts and stops at once.
        start, stop: t_on and t_off [s]; `stop` may be infinite.
    """

    shape: int
    drive_frequency: float
    natural_frequency: float
    amplitude: float
    phase: float = 0.0
    damping_ratio: float | None = None
    start: float = 0.0
    stop: float = math.inf

    @property
    def ring_up_time(self) -> float:
        """Time constant 1 / (zeta w_n) of the envelope [s]; 0 without ring-up."""
        if self.damping_ratio is None:
            return 0.0
        return 1.0 / (self.damping_ratio * 2.0 * math.pi * self.natural_frequency)

    @property
    def steady(self) -> complex:
        """Complex amplitude [m] of the stationary motion, for q = Re[steady exp(i w (t - t_on))]."""
        if self.damping_ratio is None:
            return -1j * self.amplitude * cmath.exp(1j * self.phase)
        omega, omega_n = 2.0 * math.pi * self.drive_frequency, 2.0 * math.pi * self.natural_frequency
        zeta = self.damping_ratio
        force = 2.0 * zeta * omega_n**2 * self.amplitude * cmath.exp(1j * self.phase)
        return force / (omega_n**2 - omega**2 + 2j * zeta * omega_n * omega)

    @property
    def steady_amplitude(self) -> float:
        """Amplitude [m] of the stationary motion: `amplitude` at resonance, else what the oscillator leaves of it."""
        return abs(self.steady)

    @property
    def largest_speed(self) -> float:
        """Bound on the rate of the motion [m/s]; the transient moves at the natural frequency."""
        return 2.0 * math.pi * max(self.drive_frequency, self.natural_frequency) * self.largest

    @property
    def largest(self) -> float:
        """Bound on the motion [m]: the stationary one, and the transient, which starts with its place and speed.

        After a stop both go on at the natural frequency, slower drives from their place, faster ones from their speed.
        With strong damping a free motion may overshoot its start by `slack`.
        """
        if self.damping_ratio is None:
            return self.amplitude
        zeta = self.damping_ratio
        slack = math.sqrt((1.0 + zeta) / (1.0 - zeta)) if zeta > STRONG_DAMPING else 1.0
        faster = max(1.0, self.drive_frequency / self.natural_frequency)
        return min(slack * self.amplitude, (1.0 + slack) * faster * self.steady_amplitude)


@dataclass(frozen=True)
class ModalTerms:
    """q_shape(t) = sum of Re[coefficient exp(rate (t - start))] over the terms with start <= t < stop.

    Attributes, all of shape (n_terms,):
        shape: index of the mode shape.
        start, stop: [s].
        coefficient: [m].
        rate: [1/s]; its real part is the decay, its imaginary part the circular frequency.
    """

    shape: NDArray[np.int64]
    start: NDArray[np.float64]
    stop: NDArray[np.float64]
    coefficient: NDArray[np.complex128]
    rate: NDArray[np.complex128]

    def phasor(self, t: ArrayLike, n_shapes: int) -> NDArray[np.complex128]:
        """Complex modal coordinates [m] at times t (n,) [s], shape (n, n_shapes).

        The real part is q. For a single drive the modulus is the envelope of the oscillation.
        """
        t = np.atleast_1d(np.asarray(t, float))[:, None]
        if len(t) > 1 and len(t) * len(self.start) > MOST_AT_ONCE:  # of many terms few act at times that are near
            halves = np.array_split(t[:, 0], 2)
            return np.concatenate([self._acting(half.min(), half.max()).phasor(half, n_shapes) for half in halves])
        active = (t >= self.start) & (t < self.stop)
        age = np.where(active, t - self.start, 0.0)
        values = np.where(active, self.coefficient * np.exp(self.rate * age), 0.0)
        q = np.zeros((len(t), n_shapes), complex)
        for shape in range(n_shapes):
            q[:, shape] = values[:, self.shape == shape].sum(axis=1)
        return q

    def jumps(self, n_shapes: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Times (n,) [s] at which terms begin or end, and by how much each coordinate jumps there (n, n_shapes) [m]."""
        ends = np.isfinite(self.stop)
        last = self.coefficient[ends] * np.exp(self.rate[ends] * (self.stop[ends] - self.start[ends]))
        times, number = np.unique(np.concatenate([self.start, self.stop[ends]]), return_inverse=True)
        jump = np.zeros((len(times), n_shapes))
        shapes = np.concatenate([self.shape, self.shape[ends]])
        np.add.at(jump, (number, shapes), np.concatenate([self.coefficient.real, -last.real]))
        return times, jump

    def since(self, time: float) -> ModalTerms:
        """The terms that act at a time [s] or later."""
        return self._acting(time, math.inf)

    def _acting(self, first: float, last: float) -> ModalTerms:
        """The terms that act between two times [s]."""
        acting = (self.stop > first) & (self.start <= last)
        return ModalTerms(*(getattr(self, entry.name)[acting] for entry in fields(self)))

    def between(self, start: float, stop: float, shapes: NDArray[np.int64]) -> ModalTerms:
        """These terms from a time on and up to another one [s]; `shapes` are the numbers of theirs."""
        acting = self.start < stop - start
        begins, ends = self.start[acting] + start, np.minimum(self.stop[acting] + start, stop)
        return ModalTerms(shapes[self.shape[acting]], begins, ends, self.coefficient[acting], self.rate[acting])

    def joined(self, added: ModalTerms) -> ModalTerms:
        """These terms and others."""
        names = [entry.name for entry in fields(self)]
        return ModalTerms(*(np.concatenate([getattr(self, name), getattr(added, name)]) for name in names))


def silent_terms(drives: Iterable[ModalDrive]) -> ModalTerms:
    """Terms of drives that move nothing at any time, but tell their frequencies."""
    terms = modal_terms(drives)
    return ModalTerms(
        terms.shape, np.zeros(len(terms.start)), np.zeros(len(terms.start)), 0.0 * terms.coefficient, terms.rate
    )


def modal_terms(drives: Iterable[ModalDrive]) -> ModalTerms:
    """Solve the oscillator of every drive; the terms of drives of the same mode add up."""
    terms = [term for drive in drives for term in _terms_of(drive)]
    return ModalTerms(
        shape=np.array([term[0] for term in terms], np.int64),
        start=np.array([term[1] for term in terms], float),
        stop=np.array([term[2] for term in terms], float),
        coefficient=np.array([term[3] for term in terms], complex),
        rate=np.array([term[4] for term in terms], complex),
    )


def _terms_of(drive: ModalDrive) -> list[tuple[int, float, float, complex, complex]]:
    """Terms (shape, start, stop, coefficient, rate): forced motion and transient until `stop`, free decay after it."""
    omega, omega_n = 2.0 * math.pi * drive.drive_frequency, 2.0 * math.pi * drive.natural_frequency
    zeta = drive.damping_ratio
    if zeta is None:
        return [(drive.shape, drive.start, drive.stop, drive.steady, 1j * omega)]
    steady = drive.steady
    free = complex(-zeta * omega_n, omega_n * math.sqrt(1.0 - zeta**2))
    transient = _free_motion(-steady.real, -(1j * omega * steady).real, free)
    decay_time = DECAY_LENGTH / (zeta * omega_n)
    terms = [
        (drive.shape, drive.start, drive.stop, steady, 1j * omega),
        (drive.shape, drive.start, min(drive.stop, drive.start + decay_time), transient, free),
    ]
    if math.isfinite(drive.stop):
        duration = drive.stop - drive.start
        moving, fading = steady * cmath.exp(1j * omega * duration), transient * cmath.exp(free * duration)
        q, velocity = (moving + fading).real, (1j * omega * moving + free * fading).real
        terms.append((drive.shape, drive.stop, drive.stop + decay_time, _free_motion(q, velocity, free), free))
    return terms


def _free_motion(q: float, velocity: float, rate: complex) -> complex:
    """Coefficient c [m] of a free motion that starts with Re[c] = q [m] and Re[rate c] = velocity [m/s]."""
    return complex(q, (rate.real * q - velocity) / rate.imag)
