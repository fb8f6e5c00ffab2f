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


# Transport speed [mm/s], by scenario and engine. Its arithmetic in percent of the mean: bound, and what a loss of 8 %
# is beyond it, which in SE of the test is how surely that fails.
#
#   4750 Hz, impulse   SD  4.1, SE of 64 seeds 0.51, with that of the mean 0.53: bound 2.1, beyond it 5.9 = 11 SE
#   8775 Hz, impulse   SD  8.0, SE of 64 seeds 1.00, with that of the mean 1.03: bound 4.1, beyond it 3.9 = 3.9 SE
DRIFT = {
    ("drift_4750hz", "impulse"): Pinned(
        "feeder-sim run scenarios/drift_4750hz.toml --seeds 1024", 1.5190, 0.0626, 1024, seeds=64
    ),
    ("drift_4750hz", "mujoco"): Pinned(
        "feeder-sim run scenarios/drift_4750hz.toml --engine mujoco --seeds 12", 1.460, 0.0485, 12, seeds=12
    ),
    ("drift_8775hz", "impulse"): Pinned(
        "feeder-sim run scenarios/drift_8775hz.toml --seeds 1024", 4.0195, 0.3314, 1024, seeds=64
    ),
    ("drift_8775hz", "mujoco"): Pinned(
        "feeder-sim run scenarios/drift_8775hz.toml --engine mujoco --seeds 96", 3.907, 0.4115, 96, seeds=12
    ),
    ("drift_2797hz_plate", "impulse"): Pinned(
        "feeder-sim run scenarios/drift_2797hz_plate.toml --seeds 48", 1.771, 0.283, 48, seeds=12
    ),
    ("drift_2797hz_plate", "mujoco"): Pinned(
        "feeder-sim run scenarios/drift_2797hz_plate.toml --engine mujoco --seeds 12", 1.740, 0.242, 12, seeds=4
    ),
}

# Nuts picked and lost in the first cycle, by how many there were. 3 SE on either side:
#
#    30 nuts   12.7 to 20.1 picked, 1.4 to 5.2 lost
#   100 nuts   12.3 to 22.1 picked, 6.0 to 14.8 lost
_ONE_CYCLE = "one cycle of scenarios/separation_third_mode.toml with {} nuts, {} seeds"
PICKED = {
    30: Pinned(_ONE_CYCLE.format(30, 32), 16.41, 3.11, 32, seeds=8, errors=3.0),
    100: Pinned(_ONE_CYCLE.format(100, 24), 17.17, 4.01, 24, seeds=8, errors=3.0),
}
LOST = {
    30: Pinned(_ONE_CYCLE.format(30, 32), 3.31, 1.62, 32, seeds=8, errors=3.0),
    100: Pinned(_ONE_CYCLE.format(100, 24), 10.42, 3.57, 24, seeds=8, errors=3.0),
}

# Carried over 75 mm: time [s], 34.2 to 35.9, and the stations at which the stages end [mm], +- 0.03 to 0.1.
_STRIP = "feeder-sim run scenarios/transport_strip.toml --seeds 48"
ARRIVAL_TIME = Pinned(_STRIP, 35.04, 0.58, 48, seeds=8)
STATIONS = [
    Pinned(_STRIP, mean, sd, 48, seeds=8)
    for mean, sd in ((-44.684, 0.017), (-35.915, 0.047), (-23.402, 0.051), (-14.640, 0.060), (-0.321, 0.069))
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
CYLINDER_INTERVAL = {tilt: Near(_CYLINDER, mean, within=0.1 * mean) for tilt, mean in {0.0: 71.5, 2.0: 55.0}.items()}
