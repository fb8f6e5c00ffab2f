"""A motion that has no period, from a record of it or from a spectrum of its accelerations.

    t_ms, x_um, z_um, ry_mrad           t_ms, x_g, z_g, ry_rad_s2           frequency_hz, x_g2_hz, z_g2_hz
    0, 0, 0, 0                          0, 0.02, -0.01, 0                   10, 0.001, 0.002
    0.5, 31, 12, 0.1                    0.5, 0.41, 0.13, 0.2                200, 0.001, 0.002
    ...                                 ...                                 ...

A record is cut off above a limit of its band: its end is bridged to its begin by harmonics within the band, by least
squares, and of the Fourier series of the whole what is above the limit fades out. Displacements count from their first
value. Accelerations are integrated twice from rest, term by term.

A spectrum is a sum over frequencies one over the duration apart: amplitudes sqrt(2 S df), with S of the table,
interpolated between its lines in both logarithms, and random phases. The mean square of the accelerations over the
duration is that of the spectrum. As it is, the motion also starts with a speed.

Engines take few terms at a time. So the motion is divided into segments, each with a Fourier series of twice its
length, which is fitted to the motion on the segment and a quarter of it on both sides. Of all that fit as well the one
with the least accelerations is taken: engines bound a motion by the sum of the moduli of its terms.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np
from numpy.polynomial.polynomial import polyder, polyval
from numpy.typing import NDArray

from feeder_sim.constants import GRAVITY
from feeder_sim.errors import InputError
from feeder_sim.plate.drive import ModalTerms
from feeder_sim.plate.waveform import COLUMNS, TO_SI, read_table

ACCELERATIONS = ("x_g", "y_g", "z_g", "rx_rad_s2", "ry_rad_s2", "rz_rad_s2")
DENSITIES = ("x_g2_hz", "y_g2_hz", "z_g2_hz")
MOST_LINES = 1_000_000
HIGHEST = 1.0 / 3.0  # of the rate of samples: limit of the band
WHOLE, FADE = 1.2, 1.5  # times the limit: up to where all is taken, and from where on nothing
BRIDGE = 10.0  # periods of the limit, from the end of a record to its begin; fitted to twice as much on both sides
BRIDGE_CUTS = 1e-10, 1e-8, 1e-6, 1e-4, 1e-2  # of the largest singular value: less follows noise into the bridge
HIGH_BRIDGE = 5.0  # times the largest sample beside it
SHORTEST, PERIODS = 0.1, 15.0  # [s], and in periods of the end of the band: length of a segment
FINE = 6.0  # samples of a segment in a period of the end of the band
MARGIN = 0.1  # of a segment, on both of its sides
BEYOND = 6  # harmonics of a segment above its band
SEGMENT_CUT = 1e-13  # of the largest singular value
CALM = 30.0  # weight of the highest harmonic of a segment is the square of that
NEGLIGIBLE = 1e-12  # of the largest displacement and of the largest acceleration: a term that is left out
OVERLAP = 1e-6  # [s]
MISSED, MISSED_SPEED = 0.01, 0.1  # of the largest: a sample or a speed that makes a jump
STANDS_OUT = 6.0  # times the root mean square: a jump, and no noise
AT_REST = 0.01  # of the largest speed


@dataclass(frozen=True)
class Record:
    """A motion in time: terms of six directions, with times from its start.

    Attributes:
        terms: their shapes are the directions: moves along x, y, z [m] and turns about them [rad]; after the last
            segment the motion stays where it is.
        duration: [s].
        largest: displacement, speed and acceleration of every direction [m, rad; over s, s^2], shape (3, 6).
        largest_time: of the displacement [s], shape (6,).
        final_speed: over the largest of the direction [1].
        missed: root mean square of what is left out of a record, over that of the record [1].
    """

    terms: ModalTerms
    duration: float
    largest: NDArray[np.float64]
    largest_time: NDArray[np.float64]
    final_speed: float
    missed: float

    @property
    def handed_over(self) -> ModalTerms:
        """The terms as engines take them, which at the end of a window know none that begins there.

        So every segment lasts a little longer, and terms that begin with the next one take it away. Engines also make
        one term of those of one rate, until the first of them ends: every second segment has rates one bit higher.
        """
        terms, ends = self.terms, np.isfinite(self.terms.stop)
        longer = replace(terms, stop=terms.stop + OVERLAP)
        shape, start, stop, coefficient, rate = (getattr(terms, entry.name)[ends] for entry in fields(terms))
        cancelling = -coefficient * np.exp(rate * (stop - start))
        return longer.joined(ModalTerms(shape, stop, stop + OVERLAP, cancelling, rate))


@dataclass(frozen=True)
class _Curve:
    """x(t) = Re sum over k of spectrum[k] exp(2 pi i k t / period) + sum over j of powers[j] t^j.

    Attributes:
        spectrum: of a motion in six directions [m, rad], shape (n, 6).
        period: [s].
        powers: shape (3, 6).
    """

    spectrum: NDArray[np.complex128]
    period: float
    powers: NDArray[np.float64]

    @classmethod
    def from_zero(cls, spectrum: NDArray[np.complex128], period: float) -> _Curve:
        """A curve that begins at 0."""
        powers = np.zeros((3, 6))
        powers[0] = -spectrum.real.sum(axis=0)
        return cls(spectrum, period, powers)

    @classmethod
    def from_rest(cls, acceleration: NDArray[np.complex128], period: float) -> _Curve:
        """The curve from rest with the accelerations [m/s^2, rad/s^2] of a spectrum (n, 6)."""
        curve = cls.from_zero(_twice_integrated(acceleration, period), period)
        curve.powers[1] = -curve.derivative.at(0.0)
        curve.powers[2] = 0.5 * acceleration[0].real
        return curve

    @property
    def rate(self) -> NDArray[np.float64]:
        """Circular frequencies [rad/s], shape (n, 1)."""
        return np.asarray(2.0 * math.pi / self.period * np.arange(len(self.spectrum))[:, None], np.float64)

    @property
    def derivative(self) -> _Curve:
        """Its rate of change."""
        powers = np.zeros((3, 6))
        powers[:2] = polyder(self.powers)
        return _Curve(1j * self.rate * self.spectrum, self.period, powers)

    def at(self, t: float) -> NDArray[np.float64]:
        """At a time [s], shape (6,)."""
        return np.asarray((self.spectrum * np.exp(1j * self.rate * t)).real.sum(axis=0) + polyval(t, self.powers))

    def place(self, number: NDArray[np.int64], n: int) -> NDArray[np.float64]:
        """At some of n even times of the period and of the next ones [m, rad], shape (..., 6)."""
        t = self.period / n * number[..., None]
        smooth = (self.powers[2] * t + self.powers[1]) * t + self.powers[0]
        return np.asarray(_sampled(self.spectrum, n)[number % n] + smooth, np.float64)


def read_record(text: str, path: Path, limit: float) -> Record:
    """Read a table of displacements or accelerations; `path` names it in messages, `limit` of the band [Hz].

    Raises:
        InputError: a line that is broken, times that are not even, a limit too high for them, or a jump.
    """
    names, table = read_table(text, path, (COLUMNS, ACCELERATIONS), MOST_LINES)
    spacing = 1e-3 * float(table[-1, 0]) / (len(table) - 1)
    if limit > HIGHEST / spacing * (1.0 + 1e-9):
        raise InputError(
            f"has lines {1e3 * spacing:g} ms apart, allowed with frequency_hz = {limit:g} are up to "
            f"{1e3 * HIGHEST / limit:g} ms",
            file=path,
        )
    accelerated = names[1] in ACCELERATIONS
    values = np.zeros((len(table), 6))
    for name, column in zip(names[1:], table.T[1:], strict=True):
        number = (ACCELERATIONS if accelerated else COLUMNS).index(name)
        values[:, number] = column * ((GRAVITY if number < 3 else 1.0) if accelerated else TO_SI[number])
    from scipy.special import erfc

    cyclic = np.concatenate([values, _bridge(values, limit * spacing)])
    spectrum = np.fft.rfft(cyclic, axis=0) * (2.0 / len(cyclic))
    spectrum[0] *= 0.5
    frequency = np.arange(len(spectrum)) / (spacing * len(cyclic))
    middle, width = 0.5 * (WHOLE + FADE) * limit, (FADE - WHOLE) * limit
    spectrum *= 0.5 * erfc(10.0 * (frequency - middle) / width)[:, None]
    spectrum = spectrum[frequency <= FADE * limit]
    missed = _missed(values - _sampled(spectrum, len(cyclic))[: len(values)], values, spacing, path)
    curve_of = _Curve.from_rest if accelerated else _Curve.from_zero
    return _segmented(curve_of(spectrum, spacing * len(cyclic)), 1e-3 * table[-1, 0], FADE * limit, missed)


def random_motion(text: str, path: Path, limit: float, duration: float, seed: int) -> Record:
    """One motion of a duration [s] with a spectrum up to a limit [Hz]; `path` names the table in messages.

    Raises:
        InputError: a line that is broken, frequencies that do not rise, densities that are not above 0.
    """
    names, table = read_table(text, path, (DENSITIES,), MOST_LINES, first="frequency_hz")
    frequency, density = table[:, 0], table[:, 1:]
    if frequency[0] <= 0.0 or (np.diff(frequency) <= 0.0).any() or (density <= 0.0).any():
        raise InputError("must be frequencies that rise from above 0, and densities above 0", file=path)
    k = np.arange(math.floor(min(limit, frequency[-1]) * duration) + 1)
    inside = k >= frequency[0] * duration
    if not inside.any():
        raise InputError(f"has no multiple of {1.0 / duration:g} Hz up to frequency_hz = {limit:g}", file=path)
    generator = np.random.default_rng(seed)
    spectrum = np.zeros((len(k), 6), complex)
    for name, column in zip(names[1:], density.T, strict=True):
        at = np.log(np.maximum(k, 1) / duration)
        level = np.exp(np.interp(at, np.log(frequency), np.log(column)))
        phase = generator.uniform(0.0, 2.0 * math.pi, len(k))
        amplitude = GRAVITY * np.sqrt(2.0 * level / duration) * np.exp(1j * phase)
        spectrum[:, DENSITIES.index(name)] = np.where(inside, amplitude, 0.0)
    curve = _Curve.from_zero(_twice_integrated(spectrum, duration), duration)
    return _segmented(curve, duration, k[-1] / duration, 0.0)


def _bridge(values: NDArray[np.float64], limit: float) -> NDArray[np.float64]:
    """Samples (n, 6) from the end of a record to its begin within a band; `limit` in cycles per sample."""
    gap = math.ceil(BRIDGE / limit)
    known = min(len(values) // 2, 2 * gap)
    n = 2 * (known + gap)
    at = np.concatenate([np.arange(-known, 0), np.arange(gap, gap + known)])
    harmonic = np.arange(math.ceil(WHOLE * limit * n) + 1)
    samples = np.concatenate([values[-known:], values[:known]])
    beside, between = _waves(at / n, harmonic), _waves(np.arange(gap) / n, harmonic)
    for cut in BRIDGE_CUTS:
        bridge = between @ np.linalg.lstsq(beside, samples, cut)[0]
        if (np.abs(bridge).max(axis=0) <= HIGH_BRIDGE * np.abs(samples).max(axis=0)).all():
            break
    return np.asarray(bridge)


def _waves(turns: NDArray[np.float64], harmonic: NDArray[np.int64]) -> NDArray[np.float64]:
    """Cosines and minus sines of harmonics at times in periods, shape (n, 2 harmonics - 1)."""
    angle = 2.0 * math.pi * turns[:, None] * harmonic
    return np.concatenate([np.cos(angle), -np.sin(angle[:, 1:])], axis=1)


def _missed(apart: NDArray[np.float64], values: NDArray[np.float64], spacing: float, path: Path) -> float:
    """Root mean square of what a curve misses of samples (n, 6), over that of the samples [1]; refuses jumps."""
    speed = np.diff(apart, axis=0)
    for off, largest, share in (
        (apart, np.abs(values - values[0]).max(axis=0), MISSED),
        (speed, np.abs(np.diff(values, axis=0)).max(axis=0), MISSED_SPEED),
    ):
        least = np.maximum(share * largest, STANDS_OUT * np.sqrt(np.square(off).mean(axis=0)))
        over = np.where(largest > 0.0, np.abs(off) / np.where(least > 0.0, least, 1.0), 0.0)
        if over.max() > 1.0:
            line = int(over.max(axis=1).argmax())
            direction = COLUMNS[over[line].argmax()].partition("_")[0]
            raise InputError(
                f"jumps near {1e3 * spacing * line:.6g} ms, in {direction}, must be a motion within frequency_hz",
                file=path,
            )
    size = np.square(values - values.mean(axis=0)).mean(axis=0)
    return float(np.sqrt(np.square(apart).mean(axis=0) / np.where(size > 0.0, size, 1.0)).max())


def _twice_integrated(acceleration: NDArray[np.complex128], period: float) -> NDArray[np.complex128]:
    """The spectrum (n, 6) of displacements, without a mean, to that of accelerations."""
    rate = 2.0 * math.pi / period * np.arange(1, len(acceleration))[:, None]
    return np.concatenate([np.zeros((1, 6)), -acceleration[1:] / rate**2])


def _sampled(spectrum: NDArray[np.complex128], n: int) -> NDArray[np.float64]:
    """A series at n even times of its period, shape (n, 6)."""
    halved = 0.5 * spectrum
    halved[0] = spectrum[0]
    return np.asarray(np.fft.irfft(halved, n, axis=0) * n)


def _segmented(curve: _Curve, duration: float, band: float, missed: float) -> Record:
    """The terms of a curve whose band ends at a frequency [Hz]."""
    n = math.ceil(FINE * band * curve.period)
    spacing = curve.period / n
    steps = math.ceil(duration / max(1, math.floor(duration / max(SHORTEST, PERIODS / band))) / spacing)
    count, margin = math.ceil(duration / (steps * spacing) - 1e-9), math.ceil(MARGIN * steps)
    points = np.arange(-margin, steps + margin + 1)
    samples = curve.place(steps * np.arange(count)[:, None] + points, n)
    harmonic = np.arange(math.ceil(2.0 * steps * spacing * band) + BEYOND + 1)
    rate = math.pi / (steps * spacing) * harmonic
    weight = 1.0 + np.square(CALM / harmonic[-1] * np.concatenate([harmonic, harmonic[1:]]))
    left, size, right = np.linalg.svd(_waves(points / (2.0 * steps), harmonic) / weight, full_matrices=False)
    significant = size > SEGMENT_CUT * size[0]
    # Factor by factor: their product would have errors of round-off over the smallest singular value.
    fitted = np.einsum("spd,pk->skd", samples, left[:, significant], optimize=True) / size[significant, None]
    fitted = np.einsum("skd,kh->shd", fitted, right[significant] / weight, optimize=True)
    coefficient = fitted[:, : len(harmonic)].astype(complex)
    coefficient[:, 1:] += 1j * fitted[:, len(harmonic) :]
    counts = np.zeros(coefficient.shape, bool)
    for amount in (np.abs(coefficient), np.abs(coefficient) * rate[:, None] ** 2):
        counts |= amount > NEGLIGIBLE * amount.max()
    segment, k, shape = np.nonzero(counts)
    start = np.append(steps * spacing * np.arange(count), duration)

    final = curve.at(duration)
    moved = np.flatnonzero(final)
    number, every_rate = np.append(segment, np.full(len(moved), count)), np.append(rate[k], np.zeros(len(moved)))
    terms = ModalTerms(
        np.concatenate([shape, moved]),
        np.concatenate([start[segment], np.full(len(moved), duration)]),
        np.concatenate([start[segment + 1], np.full(len(moved), math.inf)]),
        np.concatenate([coefficient[counts], final[moved]]),
        1j * np.where(number % 2, np.nextafter(every_rate, math.inf), every_rate),
    )
    rates = curve.derivative, curve.derivative.derivative
    inside = np.arange(math.floor(duration / spacing) + 1)
    place = np.abs(curve.place(inside, n))
    largest = np.stack([place.max(axis=0), *(np.abs(rate_of.place(inside, n)).max(axis=0) for rate_of in rates)])
    speed = np.abs(rates[0].at(duration)) / np.where(largest[1] > 0.0, largest[1], 1.0)
    return Record(terms, duration, largest, spacing * place.argmax(axis=0), float(speed.max()), missed)
