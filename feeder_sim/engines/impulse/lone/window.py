"""What the surface can do at most within a window of time, for the engine of one part."""

from __future__ import annotations

import math

from feeder_sim.engines.impulse.lone.state import Bounds
from feeder_sim.engines.impulse.window import bound_window, fastest_rate
from feeder_sim.machine_code import compiled

SHARE = 0.1  # of the touch
SLOWEST = 1.0  # [rad/s]; the rate of a surface that does not move


@compiled
def bound(acting, extremes, start, stop, exact):
    """Bounds between two times [s] of a surface of which the acting terms are known; extremes: as in `Surface`."""
    found = bound_window(acting, extremes, start, stop, 1.0, 0.0)
    fastest = max(fastest_rate(acting), SLOWEST)
    snap = found.speed * fastest * fastest * fastest
    brief = math.sqrt(math.sqrt(24.0 * SHARE * exact.touch / max(snap, SLOWEST)))
    return Bounds(stop, found.crest, found.slope, found.acceleration, found.speed, fastest, brief, found.calm, exact)
