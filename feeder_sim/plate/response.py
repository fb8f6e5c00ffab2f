"""Forced response: what all modes of a plate do together under a harmonic force, and what its actuators take.

With modal force F_j, modal mass m_j, natural frequency w_j and damping ratio zeta_j,

    q_j = F_j / (m_j (w_j^2 - w^2 + 2 i zeta_j w_j w)),    W(x, y) = sum_j phi_j(x, y) q_j.

A patch turns strain back into charge, by reciprocity with the same factor as voltage into force. With the modal force
per volt theta_ja of actuator a, its capacitance C_a and loss tangent d_a, its current is

    I_a = i w (C_a (1 - i d_a) V_a + sum_j theta_ja q_j),    power = 1/2 Re sum_a V_a* I_a.

Of that power the ceramic keeps pi/4 f C d Upp^2 as heat. Driven patches lie in parallel at one voltage: their impedance
is Z = V / I. The plate acts back on it, by the motional branch theta^2 / m_j, and the maxima of its series resistance
Re Z lie beside the resonances, toward those of the open patch (IEEE Std 176-1987, section 6).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from feeder_sim.constants import GRAVITY
from feeder_sim.errors import InputError
from feeder_sim.plate.mode_file import ModeFile
from feeder_sim.plate.modes import PlateModes

# Which modes of a plate are worth their volts at a place: amplitude, acceleration and hops of a part there.
#
# A part that lands on the plate at its fastest leaves with (1 + e) times the plate's velocity v, so that it hops by
# (v (1 + e))^2 / 2 g. Measured and simulated hops of balls agree with that within a fifth (docs/evidence.md).

NEIGHBOUR = 0.02  # relative; modes nearer in frequency than this move together
RESTITUTION = 0.2  # of steel on aluminium


@dataclass(frozen=True)
class RankedMode:
    """One mode at its resonance, driven by the actuator that moves it most.

    Attributes:
        mode: 0-based.
        frequency: measured or else computed [Hz].
        actuator: name.
        force_per_volt: modal force over the voltage [N/V].
        amplitude: at the place [m]; antinode: at the highest antinode [m].
        bounds: least and largest share of both that is possible [1], see `amplitude_bounds`.
        acceleration: peak at the place, over gravity [1].
        hop_height: of a part there [m].
        neighbours: 0-based modes within `NEIGHBOUR`.
    """

    mode: int
    frequency: float
    actuator: str
    force_per_volt: float
    amplitude: float
    antinode: float
    bounds: tuple[float, float]
    acceleration: float
    hop_height: float
    neighbours: tuple[int, ...]


def hop_height(amplitude: ArrayLike, frequency: float) -> NDArray[np.float64]:
    """How high a part hops [m] where the plate moves by an amplitude [m] at a frequency [Hz]."""
    velocity = 2.0 * math.pi * frequency * np.asarray(amplitude, float)
    return np.asarray((velocity * (1.0 + RESTITUTION)) ** 2 / (2.0 * GRAVITY))


def rank_modes(mode_file: ModeFile, voltage: float, point: tuple[float, float] | None) -> list[RankedMode]:
    """Rank all modes by their amplitude at a point.

    Args:
        mode_file: modes and actuators of a plate.
        voltage: amplitude at the actuator [V].
        point: (x, y) [m]; None: the highest antinode of each mode.
    """
    modes, forces = oscillators(mode_file), modal_forces(mode_file)
    ranked = []
    for j, frequency in enumerate(modes.natural_frequency):
        best = int(np.abs(forces[j]).argmax())
        omega = 2.0 * math.pi * frequency
        antinode = abs(forces[j, best]) * voltage / (2.0 * modes.damping_ratio[j] * modes.modal_mass[j] * omega**2)
        share = 1.0 if point is None else abs(float(mode_file.modes.evaluate(j, *point)[0]))
        near = np.flatnonzero(np.abs(modes.natural_frequency / frequency - 1.0) < NEIGHBOUR)
        amplitude = share * antinode
        ranked.append(
            RankedMode(
                mode=j,
                frequency=float(frequency),
                actuator=mode_file.actuators[best].name,
                force_per_volt=float(forces[j, best]),
                amplitude=amplitude,
                antinode=antinode,
                bounds=amplitude_bounds(mode_file, modes, j, [best]),
                acceleration=amplitude * omega**2 / GRAVITY,
                hop_height=float(hop_height(amplitude, frequency)),
                neighbours=tuple(int(i) for i in near if i != j),
            )
        )
    return sorted(ranked, key=lambda mode: -mode.amplitude)


# Used where nothing says better: the middle of the range 0.0009 - 0.0027 measured on a plate of aluminium.
DEFAULT_DAMPING_RATIO = 0.002
DAMPING_RANGE = (0.0009, 0.0027)
NO_FORCE = 1e-9  # of the largest modal force; a smaller one is round-off
ON_NODE = 0.01  # of the antinode; where a mode deflects less, no amplitude can be set
POINTS_PER_RESONANCE = 121  # of a response
BANDWIDTHS = 12.0  # on either side of a resonance over which its points lie
CROWDING = 4.5  # of these points toward the resonance: the middle ones are 0.02 bandwidths apart
COARSE_POINTS = 800  # over the whole range
BELONGS = 0.01  # of the frequency; a peak nearer than this to a natural frequency is that mode's
FIELD_POINTS = 61  # per axis, among which the largest amplitude on the plate is searched


@dataclass(frozen=True)
class Oscillators:
    """The modes of a plate as damped oscillators, each array of shape (n_modes,).

    Attributes:
        natural_frequency: [Hz]; the measured one where there is one.
        damping_ratio: [1].
        modal_mass: [kg].
        assumed: whether nothing says the damping ratio, which then is `DEFAULT_DAMPING_RATIO`.
    """

    natural_frequency: NDArray[np.float64]
    damping_ratio: NDArray[np.float64]
    modal_mass: NDArray[np.float64]
    assumed: NDArray[np.bool_]

    def modal_coordinates(
        self, frequency: NDArray[np.float64], force: NDArray[np.complex128]
    ) -> NDArray[np.complex128]:
        """Complex q_j [m] under modal forces (n_modes,) [N] at frequencies (n,) [Hz], shape (n, n_modes)."""
        omega, omega_n = 2.0 * math.pi * frequency[:, None], 2.0 * math.pi * self.natural_frequency
        stiffness = omega_n**2 - omega**2 + 2j * self.damping_ratio * omega_n * omega
        return np.asarray(force / (self.modal_mass * stiffness))


def oscillators(record: ModeFile, damping_ratio: float | None = None) -> Oscillators:
    """The oscillators of a mode file: what was measured goes before what was computed or said for the whole plate.

    Args:
        record: modes, and what was measured of them.
        damping_ratio: of all modes, instead of what the file says.
    """
    frequency = record.modes.natural_frequency.copy()
    damping = np.full(len(frequency), math.nan) if record.damping_ratio is None else record.damping_ratio.copy()
    for resonance in record.resonances:
        frequency[resonance.mode] = resonance.frequency
        if math.isfinite(resonance.damping_ratio):
            damping[resonance.mode] = resonance.damping_ratio
    if damping_ratio is not None:
        damping[:] = damping_ratio
    assumed = np.isnan(damping)
    return Oscillators(frequency, np.where(assumed, DEFAULT_DAMPING_RATIO, damping), record.modes.modal_mass, assumed)


def assumption(modes: Oscillators) -> str:
    """A line on the damping that is assumed; "" where all of it is known."""
    n = int(modes.assumed.sum())
    if not n:
        return ""
    which = "every mode" if n == len(modes.assumed) else f"{n} of {len(modes.assumed)} modes"
    return (
        f"assumes a damping ratio of {DEFAULT_DAMPING_RATIO:g} for {which}, to which amplitudes at resonance are "
        "inversely proportional; plate.damping_ratio or a measured [[resonance]] says it"
    )


def amplitude_bounds(mode_file: ModeFile, modes: Oscillators, index: int, driven: Sequence[int]) -> tuple[float, float]:
    """Least and largest amplitude that a mode may have at resonance, over the predicted one.

    The moment of a patch is uncertain by its bond and its ceramic, of several by the same factor; a damping ratio that
    nothing says, by `DAMPING_RANGE`. A measured gain is not.

    Args:
        mode_file: modes and actuators of a plate.
        modes: its oscillators.
        index: of the mode.
        driven: indices of the actuators that are driven.
    """
    if any(r.mode == index and r.actuators and math.isfinite(r.gain) for r in mode_file.resonances):
        return 1.0, 1.0
    spread = max((mode_file.actuators[a].moment_spread for a in driven), default=1.0)
    if not modes.assumed[index]:
        return 1.0 / spread, spread
    low, high = DAMPING_RANGE
    return DEFAULT_DAMPING_RATIO / high / spread, DEFAULT_DAMPING_RATIO / low * spread


def modal_forces(mode_file: ModeFile) -> NDArray[np.float64]:
    """Modal force over the voltage [N/V], shape (n_modes, n_actuators).

    The forces of a mode whose gain was measured with known actuators are scaled so that these reach that gain.

    Raises:
        InputError: a gain was measured on a nodal line, or with actuators that do not drive the mode.
    """
    force = mode_file.force_per_volt.copy()
    modes = oscillators(mode_file)
    for resonance in mode_file.resonances:
        if not resonance.actuators or not math.isfinite(resonance.gain):
            continue
        j = resonance.mode
        omega, damping = 2.0 * math.pi * modes.natural_frequency[j], modes.damping_ratio[j]
        volt = voltages(mode_file, resonance.actuators, 0.5, [0.0] * len(resonance.actuators))
        if abs(force[j] @ volt) <= NO_FORCE * np.abs(force).max() * np.abs(volt).sum():
            raise InputError(
                f"is {', '.join(resonance.actuators)}, which by its place does not drive mode {j + 1}, must be "
                "actuators that do",
                key="resonance.actuator",
            )
        computed = abs(force[j] @ volt) / (2.0 * damping * modes.modal_mass[j] * omega**2)
        w = deflection_at(mode_file.modes, j, resonance.driven_point, "resonance.driven_point_mm")
        force[j] *= resonance.gain / (w * computed)
    return force


def deflection_at(modes: PlateModes, index: int, point: tuple[float, float], key: str) -> float:
    """|w| of a mode at a point [m], by which an amplitude there becomes that of the antinode.

    Raises:
        InputError: the point lies beside the plate or on a nodal line; `key` names it in the message.
    """
    x, y = point
    beside = modes.outline is not None and not modes.outline.holds(np.array([x, y]))
    if abs(x) > 0.5 * modes.plate.length or abs(y) > 0.5 * modes.plate.width or beside:
        raise InputError(f"({x * 1e3:g}, {y * 1e3:g}) mm lies outside the plate", key=key)
    w = abs(float(modes.evaluate(index, x, y)[0]))
    if w < ON_NODE:
        raise InputError(
            f"({x * 1e3:g}, {y * 1e3:g}) mm lies on a nodal line of mode {index + 1}, where no amplitude can be set",
            key=key,
        )
    return w


@dataclass(frozen=True)
class Peak:
    """A maximum of a frequency response.

    Attributes:
        mode: 0-based, the one with the largest share of it among those whose bandwidth it lies in, or else among
            those within `BELONGS`, or else among all.
        frequency: [Hz]; amplitude: [m].
        damping_ratio: half the width at 1/sqrt(2) of the height over the frequency; NaN where the response does not
            fall so far on both sides.
        bounds: least and largest amplitude that is possible, over this one, see `amplitude_bounds`.
        resistive: where the series resistance of the driven patches has its maximum beside it [Hz]; NaN where it has
            none within `BELONGS`.
    """

    mode: int
    frequency: float
    amplitude: float
    damping_ratio: float
    bounds: tuple[float, float] = (1.0, 1.0)
    resistive: float = math.nan


@dataclass(frozen=True)
class Response:
    """Response of a plate over the frequency, to given voltages of its actuators.

    Attributes:
        frequency: (n,) [Hz].
        amplitude: (n,) [m], at the point asked for, or the largest on the plate.
        current: (n, n_actuators), complex [A].
        power: (n,) [W]; heat: the part of it that the ceramic keeps (n,) [W].
        impedance: of the driven patches in parallel (n,), complex [ohm]; NaN where their voltages differ.
        peaks: in order of frequency, the highest of each mode.
    """

    frequency: NDArray[np.float64]
    amplitude: NDArray[np.float64]
    current: NDArray[np.complex128]
    power: NDArray[np.float64]
    heat: NDArray[np.float64]
    impedance: NDArray[np.complex128]
    peaks: tuple[Peak, ...]


def frequency_response(
    mode_file: ModeFile,
    voltage: NDArray[np.complex128],
    *,
    low: float,
    high: float,
    point: tuple[float, float] | None = None,
    damping_ratio: float | None = None,
) -> Response:
    """Compute the response between two frequencies [Hz] on a grid that resolves every resonance.

    Args:
        mode_file: modes with their modal masses, actuators, and what was measured.
        voltage: complex amplitude of each actuator (n_actuators,) [V].
        low: lowest frequency [Hz].
        high: highest frequency [Hz].
        point: (x, y) [m] of the amplitude; None: the largest on the plate.
        damping_ratio: of all modes, instead of what the file says.
    """
    modes, coupling = oscillators(mode_file, damping_ratio), modal_forces(mode_file)
    frequency = _resolving_grid(modes, low, high)
    q = modes.modal_coordinates(frequency, coupling @ voltage)
    shapes = _deflections(mode_file, point)
    amplitude = _largest(q, shapes)
    omega = 2.0 * math.pi * frequency[:, None]
    actuators = mode_file.actuators
    capacitance = np.array([a.capacitance * (1.0 - 1j * a.loss_tangent) for a in actuators])
    current = 1j * omega * (capacitance * voltage + q @ coupling)
    power = 0.5 * np.real(current @ np.conj(voltage))
    heat = -0.5 * omega[:, 0] * float((capacitance.imag * np.abs(voltage) ** 2).sum())
    driven = np.flatnonzero(voltage)
    impedance = np.full(len(frequency), complex(math.nan, math.nan))
    if len(set(voltage[driven].tolist())) == 1:
        impedance = voltage[driven[0]] / current[:, driven].sum(axis=1)
    share = np.abs(q) * np.abs(shapes).max(axis=1)
    peaks = tuple(
        replace(
            peak,
            bounds=amplitude_bounds(mode_file, modes, peak.mode, driven.tolist()),
            resistive=_maximum_beside(frequency, impedance.real, peak.frequency),
        )
        for peak in _peaks(frequency, amplitude, share, modes)
    )
    return Response(frequency, amplitude, current, power, heat, impedance, peaks)


def _maximum_beside(frequency: NDArray[np.float64], resistance: NDArray[np.float64], peak: float) -> float:
    """The highest maximum of the resistance within `BELONGS` of a peak [Hz]; NaN where there is none."""
    near = np.flatnonzero(np.abs(frequency / peak - 1.0) < BELONGS)
    best = near[int(resistance[near].argmax())]  # an end of the range is no maximum
    return float(frequency[best]) if near[0] < best < near[-1] else math.nan


def _resolving_grid(modes: Oscillators, low: float, high: float) -> NDArray[np.float64]:
    """Frequencies from low to high [Hz], dense around every resonance."""
    spread = np.sinh(CROWDING * np.linspace(-1.0, 1.0, POINTS_PER_RESONANCE)) / math.sinh(CROWDING)
    steps = BANDWIDTHS * spread
    dense = modes.natural_frequency[:, None] * (1.0 + 2.0 * modes.damping_ratio[:, None] * steps)
    inside = dense[(dense > low) & (dense < high)]
    return np.unique(np.concatenate([np.linspace(low, high, COARSE_POINTS), inside]))


def _deflections(mode_file: ModeFile, point: tuple[float, float] | None) -> NDArray[np.float64]:
    """Deflection of every mode at a point, or on a grid of the plate, shape (n_modes, n_points)."""
    modes, plate = mode_file.modes, mode_file.modes.plate
    if point is not None:
        return np.array([[float(modes.evaluate(i, *point)[0])] for i in range(len(modes))])
    x, y = (np.linspace(-0.5, 0.5, FIELD_POINTS) * side for side in (plate.length, plate.width))
    shapes = np.stack([modes.evaluate_grid(i, x, y)[0].ravel() for i in range(len(modes))])
    if modes.outline is None:
        return shapes
    return shapes[:, modes.outline.holds(np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2))]


def _largest(q: NDArray[np.complex128], shapes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Largest modulus over all points of the motion at every frequency (n,) [m]."""
    return np.concatenate([np.abs(rows @ shapes).max(axis=1) for rows in np.array_split(q, 1 + len(q) // 200)])


def _peaks(
    frequency: NDArray[np.float64],
    amplitude: NDArray[np.float64],
    share: NDArray[np.float64],
    modes: Oscillators,
) -> tuple[Peak, ...]:
    """The highest maximum of each mode; share: amplitude of every mode by itself (n, n_modes).

    The largest amplitude on the plate has several maxima about a resonance: it changes its place there.
    """
    from scipy.signal import find_peaks

    peaks: dict[int, Peak] = {}
    for i in find_peaks(amplitude)[0]:
        level = amplitude[i] / math.sqrt(2.0)
        below = _crossing(frequency[i::-1], amplitude[i::-1], level)
        above = _crossing(frequency[i:], amplitude[i:], level)
        width = (above - below) / (2.0 * frequency[i])
        off = np.abs(modes.natural_frequency / frequency[i] - 1.0)
        near = next((near for near in (off < modes.damping_ratio, off < BELONGS) if near.any()), True)
        mode = int(np.where(near, share[i], 0.0).argmax())
        peak = Peak(mode, float(frequency[i]), float(amplitude[i]), width)
        peaks[mode] = max(peak, peaks.get(mode, peak), key=lambda candidate: candidate.amplitude)
    return tuple(sorted(peaks.values(), key=lambda peak: peak.frequency))


def _crossing(frequency: NDArray[np.float64], amplitude: NDArray[np.float64], level: float) -> float:
    """Frequency [Hz] at which the amplitude, on its way from a peak, first falls to a level; NaN if it rises before."""
    falls = amplitude <= level
    if not falls.any():
        return math.nan
    k = int(falls.argmax())
    if (np.diff(amplitude[: k + 1]) > 0.0).any():
        return math.nan
    share = (amplitude[k - 1] - level) / (amplitude[k - 1] - amplitude[k])
    return float(frequency[k - 1] + share * (frequency[k] - frequency[k - 1]))


def voltages(record: ModeFile, names: Sequence[str], voltage: float, phases: Sequence[float]) -> NDArray[np.complex128]:
    """Complex amplitude of every actuator [V]: `voltage` [V] with its phase [rad] for those named, 0 for the others.

    Raises:
        KeyError: no actuator has that name.
    """
    index = {actuator.name: i for i, actuator in enumerate(record.actuators)}
    amplitudes = np.zeros(len(record.actuators), complex)
    for name, phase in zip(names, phases, strict=True):
        amplitudes[index[name]] += voltage * np.exp(1j * phase)
    return amplitudes
