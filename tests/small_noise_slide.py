"""The mean height of a ball that bounces on a swinging piston: one dimension, no step, and a trace of noise.

Flights are parabolas, and the piston is A sin(w t). Leaps in time never pass a contact: the acceleration of the gap is
at most g + A w^2, and its jerk A w^3, which bounds short leaps more closely. Chatter is summed:
with a rebound of w relative to the piston, which comes nearer at h, all further impacts take 2 w / (h (1 - e)). That is
done once the motion of the piston away from a parabola in that time, J T^3 / 6, is below `tolerance`, and if the piston
still presses at the end. Then the ball rides until the piston's acceleration is -g.

Every ride forgets its past: without noise the motion may close on itself, as that of no ball does (restitution 0.5,
4750 Hz, 0.5 um: a mean height of 15 um; with a speed of 1e-10 to 1e-6 m/s added to each impact 25 to 26 um, whatever
its size). The means with a trace of noise are the reference.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from feeder_sim.constants import GRAVITY

TOUCH = 1e-16  # [m]
SHORTEST = 1e-15  # [s]
TOLERANCE = 1e-12  # [m], of the summed chatter
NOISE = 1e-8  # [m/s] at an impact
BEGIN = 5e-5  # [m], height at the start


@njit(error_model="numpy")
def _leap(gap: Any, rate: Any, push: Any, accel: Any, jerk: Any) -> Any:
    """A time in which a gap that opens at `rate`, with an acceleration of -push now, cannot close."""
    leap = (rate + math.sqrt(rate * rate + 2.0 * accel * gap)) / accel
    if jerk * leap >= 0.3 * accel:
        return max(leap, SHORTEST)
    closer = math.sqrt(12.0 * max(rate, 0.0) / jerk) + (12.0 * gap / jerk) ** (1.0 / 3.0)
    for _ in range(3):
        bound = max(push, 0.0) + jerk * closer + 1e-300
        root = math.sqrt(rate * rate + 2.0 * bound * gap)
        closer = (rate + root) / bound if rate > 0.0 else 2.0 * gap / max(root - rate, 1e-300)
    return max(leap, closer, SHORTEST)


@njit(error_model="numpy")
def _mean_height(
    f: Any, amplitude: Any, e: Any, duration: Any, rng: Any, noise: Any, tolerance: Any, begin: Any, g: Any
) -> Any:
    """Mean height of the ball's lowest point over the resting piston [m], after `duration` / 10."""
    w = 2.0 * math.pi * f
    period, accel, jerk = 1.0 / f, g + amplitude * w * w, amplitude * w**3
    off = math.asin(min(1.0, g / (amplitude * w * w)))  # phase at which the piston leaves a ball that rides
    t, z, v, spent, total, from_then = rng.random() * period, begin, 0.0, 0.0, 0.0, -1.0
    while spent < duration:
        if from_then < 0.0 and spent > 0.1 * duration:
            from_then, total = spent, 0.0
        over = z - amplitude
        if over > 1e-12:
            leap = (v + math.sqrt(v * v + 2.0 * g * over)) / g
        else:
            speed = amplitude * w * math.cos(w * t)
            push = g - amplitude * w * w * math.sin(w * t)
            gap, rate = z - amplitude * math.sin(w * t), v - speed
            if gap <= TOUCH and rate < 0.0:
                z = max(z, amplitude * math.sin(w * t))
                v = speed - e * rate + noise * abs(rng.standard_normal())
                rate, gap = v - speed, 0.0
                if push > 0.0:
                    chatter = 2.0 * rate / (push * (1.0 - e))
                    later = g - amplitude * w * w * math.sin(w * (t + chatter))
                    if jerk * chatter**3 / 6.0 < tolerance and later > 0.0:
                        ride = chatter + (off - w * (t + chatter)) % (2.0 * math.pi) / w
                        total += (math.cos(w * t) - math.cos(w * (t + ride))) * amplitude / w
                        spent += ride
                        t, z, v = off / w, amplitude * math.sin(off), amplitude * w * math.cos(off)
                        leap = (math.pi - 2.0 * off) / w  # the piston falls faster than the ball until then
                        total += z * leap + 0.5 * v * leap**2 - g * leap**3 / 6.0
                        z, v = z + v * leap - 0.5 * g * leap**2, v - g * leap
                        t, spent = t + leap, spent + leap
                        continue
            leap = _leap(max(gap, 0.0), rate, push, accel, jerk)
        total += z * leap + 0.5 * v * leap**2 - g * leap**3 / 6.0
        z, v = z + v * leap - 0.5 * g * leap**2, v - g * leap
        t, spent = t + leap, spent + leap
        if t > period:
            t -= math.floor(t / period) * period
    return total / (spent - from_then)


@dataclass(frozen=True)
class Heights:
    """Mean heights of seeds [m], shape (seeds,)."""

    seeds: NDArray[np.float64]

    @property
    def mean(self) -> float:
        """[m]"""
        return float(self.seeds.mean())

    @property
    def error(self) -> float:
        """Standard error of the mean [m]."""
        return float(self.seeds.std(ddof=1) / math.sqrt(len(self.seeds)))


def mean_height(
    frequency: float,
    amplitude: float,
    e: float,
    *,
    duration: float = 40.0,
    seeds: int = 8,
    noise: float = NOISE,
    tolerance: float = TOLERANCE,
) -> Heights:
    """Mean heights of a ball's lowest point over the resting piston, at random phases of the start; SI units."""
    arguments = (frequency, amplitude, e, duration)
    rngs = [np.random.default_rng(seed) for seed in range(seeds)]
    return Heights(np.array([_mean_height(*arguments, rng, noise, tolerance, BEGIN, GRAVITY) for rng in rngs]))
