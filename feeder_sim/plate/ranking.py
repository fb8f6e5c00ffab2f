"""Which modes of a plate are worth their volts at a place: amplitude, acceleration and hops of a part there.

A part that lands on the plate at its fastest leaves with (1 + e) times the plate's velocity v, so that it hops by
(v (1 + e))^2 / 2 g. Measured and simulated hops of balls agree with that within a fifth (docs/evidence.md).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from feeder_sim.constants import GRAVITY
from feeder_sim.plate.mode_file import ModeFile
from feeder_sim.plate.response import modal_forces, oscillators

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
    acceleration: float
    hop_height: float
    neighbours: tuple[int, ...]


def rank_modes(held: ModeFile, voltage: float, point: tuple[float, float] | None) -> list[RankedMode]:
    """Rank all modes by their amplitude at a point.

    Args:
        held: modes and actuators of a plate.
        voltage: amplitude at the actuator [V].
        point: (x, y) [m]; None: the highest antinode of each mode.
    """
    every, forces = oscillators(held), modal_forces(held)
    ranked = []
    for j, frequency in enumerate(every.natural_frequency):
        best = int(np.abs(forces[j]).argmax())
        omega = 2.0 * math.pi * frequency
        antinode = abs(forces[j, best]) * voltage / (2.0 * every.damping_ratio[j] * every.modal_mass[j] * omega**2)
        share = 1.0 if point is None else abs(float(held.modes.evaluate(j, *point)[0]))
        near = np.flatnonzero(np.abs(every.natural_frequency / frequency - 1.0) < NEIGHBOUR)
        amplitude = share * antinode
        ranked.append(
            RankedMode(
                mode=j,
                frequency=float(frequency),
                actuator=held.actuators[best].name,
                force_per_volt=float(forces[j, best]),
                amplitude=amplitude,
                antinode=antinode,
                acceleration=amplitude * omega**2 / GRAVITY,
                hop_height=(amplitude * omega * (1.0 + RESTITUTION)) ** 2 / (2.0 * GRAVITY),
                neighbours=tuple(int(i) for i in near if i != j),
            )
        )
    return sorted(ranked, key=lambda mode: -mode.amplitude)
