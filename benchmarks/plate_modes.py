"""Time of the modes of a plate of 200 x 200 x 3 mm up to 20 kHz, by finite elements and by the Ritz method in turn.

    python benchmarks/plate_modes.py

Prints processor time on one core and the largest difference of the frequencies. Takes half a minute.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable

import numpy as np

from feeder_sim.plate.elements.mindlin import element_modes
from feeder_sim.plate.materials import MATERIALS
from feeder_sim.plate.modes import PlateModes, plate_modes
from feeder_sim.plate.outline import rectangle_of
from feeder_sim.plate.rectangle import RectangularPlate

PLATE = RectangularPlate(0.2, 0.2, 0.003, MATERIALS["aluminium"])
HIGHEST_HZ = 20_000.0
ROUNDS = 5


def by_elements() -> PlateModes:
    return element_modes(PLATE, rectangle_of(PLATE.length, PLATE.width), highest_frequency=HIGHEST_HZ)[0]


def by_ritz() -> PlateModes:
    return plate_modes(PLATE, highest_frequency=HIGHEST_HZ)


def main() -> None:
    methods: dict[str, Callable[[], PlateModes]] = {"elements": by_elements, "Ritz": by_ritz}
    modes = {name: method() for name, method in methods.items()}
    times: dict[str, list[float]] = {name: [] for name in methods}
    for _ in range(ROUNDS):
        for name, method in methods.items():
            start = time.process_time()
            method()
            times[name].append(time.process_time() - start)
    for name, each in times.items():
        print(f"{name}: {len(modes[name])} modes, {statistics.median(each):.2f} s")
    one, other = (each.natural_frequency for each in modes.values())
    n = min(len(one), len(other))
    print(f"frequencies differ by up to {np.abs(one[:n] / other[:n] - 1.0).max():.1e}")


if __name__ == "__main__":
    main()
