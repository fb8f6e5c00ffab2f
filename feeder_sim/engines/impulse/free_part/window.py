"""What the surface can do at most within a window of time, for the engine of one part."""

from __future__ import annotations

from feeder_sim.engines.impulse.free_part.state import Bounds
from feeder_sim.engines.impulse.window import bound_window, fastest_rate
from feeder_sim.machine_code import compiled

SLOWEST = 1.0  # [rad/s]; the rate of a surface that does not move


@compiled
def bound(acting, extremes, start, stop, exact):
    """Bounds between two times [s] of a surface of which the acting terms are known; extremes: as in `Surface`."""
    found = bound_window(acting, extremes, start, stop, 1.0, 0.0)
    fastest, rate = max(fastest_rate(acting), SLOWEST), max(found.rate, SLOWEST)
    bent = 0.0  # most, of all shapes that act, by the height
    for s in range(found.acceleration.shape[0]):
        if found.acceleration[s] > 0.0 and extremes[0, s] > 0.0:
            bent = max(bent, extremes[2, s] / extremes[0, s])
    curvature = bent * found.crest
    return Bounds(
        stop,
        found.crest,
        found.slope,
        curvature,
        found.acceleration,
        found.amplitude,
        found.speed,
        rate,
        fastest,
        found.calm,
        exact,
    )
