"""Ensemble means that tests hold the package to, each with where it comes from.

A mean of `n` seeds with standard deviation `sd` between seeds is compared with that of a test's own `seeds` seeds:

    SE = sd sqrt(1/n + 1/seeds),    allowed: mean +- errors x SE

Contact motion is chaotic: one bit of arithmetic draws all seeds anew, and a right engine then leaves an interval of
4 SE once in 16 000 times, one of 3 SE once in 370. To pin again: run the command, put in what it prints, say why.
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Pinned:
    """A mean, what it comes from, and the seeds of the test that looks at it."""

    command: str
    mean: float
    sd: float
    n: int
    seeds: int
    errors: float = 4.0

    @property
    def bound(self) -> float:
        """How far the mean of the test's seeds may be off."""
        return self.errors * self.sd * math.sqrt(1.0 / self.n + 1.0 / self.seeds)

    def holds(self, mean: float) -> bool:
        return abs(mean - self.mean) < self.bound

    def catches(self, loss: float) -> bool:
        """Whether an engine that has lost such a share of the mean fails, but for one time in 700 (3 SE)."""
        return (1.0 - loss) * self.mean + 3.0 * self.sd / math.sqrt(self.seeds) < self.mean - self.bound


@dataclass(frozen=True)
class Near:
    """A mean over so much that its own spread is hard to tell: what it comes from, and how far one may be off."""

    command: str
    mean: float
    within: float


# Transport speed [mm/s], by scenario and engine; the impulse engine without a step. In percent of the mean: the bound,
# what a loss of 8 % is beyond it, and how surely that fails.
#
#                      SD    SE of the test     with that of the mean   bound         a loss of 8 % is beyond it by
#   4750 Hz, impulse   4.4   4.4 / 8 = 0.55     0.57                    4 SE = 2.3    5.7 = 10.4 SE of the test
#   8775 Hz, impulse   8.2   8.2 / 8 = 1.03     1.06                    4 SE = 4.2    3.8 =  3.6 SE of the test
DRIFT = {
    ("drift_4750hz", "impulse"): Pinned(
        "feeder-sim run scenarios/drift_4750hz.toml --seeds 1024", 1.551, 0.068, 1024, seeds=64
    ),
    ("drift_8775hz", "impulse"): Pinned(
        "feeder-sim run scenarios/drift_8775hz.toml --seeds 1024", 4.069, 0.335, 1024, seeds=64
    ),
    ("drift_4750hz", "mujoco"): Pinned(
        "feeder-sim run scenarios/drift_4750hz.toml --engine mujoco --seeds 12", 1.460, 0.0485, 12, seeds=12
    ),
    ("drift_8775hz", "mujoco"): Pinned(
        "feeder-sim run scenarios/drift_8775hz.toml --engine mujoco --seeds 96", 3.907, 0.4115, 96, seeds=12
    ),
    ("drift_2797hz_plate", "impulse"): Pinned(
        "feeder-sim run scenarios/drift_2797hz_plate.toml --seeds 48", 1.752, 0.235, 48, seeds=12
    ),
    ("drift_2797hz_plate", "mujoco"): Pinned(
        "feeder-sim run scenarios/drift_2797hz_plate.toml --engine mujoco --seeds 12", 1.740, 0.242, 12, seeds=4
    ),
}

# Nuts picked and lost in the first cycle, by how many there were. 3 SE on either side:
#
#    30 nuts   12.8 to 20.5 picked, 1.5 to 5.5 lost
#   100 nuts   12.3 to 22.1 picked, 6.0 to 14.8 lost
_ONE_CYCLE = "one cycle of scenarios/separation_third_mode.toml with {} nuts, {} seeds"
PICKED = {
    30: Pinned(_ONE_CYCLE.format(30, 32), 16.66, 3.24, 32, seeds=8, errors=3.0),
    100: Pinned(_ONE_CYCLE.format(100, 24), 17.17, 4.01, 24, seeds=8, errors=3.0),
}
LOST = {
    30: Pinned(_ONE_CYCLE.format(30, 32), 3.47, 1.70, 32, seeds=8, errors=3.0),
    100: Pinned(_ONE_CYCLE.format(100, 24), 10.42, 3.57, 24, seeds=8, errors=3.0),
}

# Carried over 75 mm: time [s], 29.2 to 37.8, and the stations at which the stages end [mm], +- 0.03 to 0.1. One
# nut of the 48 hops in a periodic orbit for 18 s on its way, and takes 51 s; the others 31 to 38.
_STRIP = "feeder-sim run scenarios/transport_strip.toml --seeds 256"
ARRIVAL_TIME = Pinned(_STRIP, 33.13, 1.72, 256, seeds=8)
STATIONS = [
    Pinned(_STRIP, mean, sd, 256, seeds=8)
    for mean, sd in ((-44.697, 0.016), (-35.907, 0.057), (-23.403, 0.050), (-14.652, 0.065), (-0.263, 0.059))
]

# Mean bounce interval [ms] of the ball, by frequency [Hz] and amplitude [um]: each is a mean over amplitudes nearby,
# since it depends on which phases of rest recur. SE 2 %, allowed 4 SE.
_BOUNCES = "python benchmarks/bounce_intervals.py, column `around`"
BOUNCE_INTERVAL = {
    row: Near(_BOUNCES, mean, within=0.08 * mean)
    for row, mean in {
        (558.0, 90.0): 68.3,
        (558.0, 18.0): 13.9,
        (2797.0, 12.0): 46.3,
        (6199.0, 4.62): 38.1,
        (6199.0, 1.54): 13.1,
    }.items()
}
BOUNCE_RATIO = Near(_BOUNCES + " over `estimate`, mean of these five rows", 0.885, within=0.03)

# The same of the cylinder in its tube, by the tilt of the tube [deg].
_CYLINDER = "python benchmarks/guided_cylinder.py"
CYLINDER_INTERVAL = {tilt: Near(_CYLINDER, mean, within=0.1 * mean) for tilt, mean in {0.0: 72.1, 2.0: 55.8}.items()}
