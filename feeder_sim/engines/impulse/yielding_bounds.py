"""Bounds on a plate that takes the impulses of parts, and when they are made anew.

How long a part may fly is forecast from the surface as it moves at that time, and with bounds on it. An impact changes
the surface. That is let pass while it is small: bounds have a margin, and a part may enter the surface by as little. As
soon as the surface has changed by more than the margin since the bounds were made, they are made anew, and every part
is looked at again; so none flies on into a surface that it has not been told of.
"""

from __future__ import annotations

from numba.core import types
from numba.extending import overload

from feeder_sim.engines.impulse.crowd import reach_of
from feeder_sim.engines.impulse.state import Bounds, Plate, orthonormalise_parts, wake
from feeder_sim.engines.impulse.window import acting_terms, bound_window
from feeder_sim.machine_code import compiled, entry_point

MARGIN = 0.05  # of crest and acceleration
LEAST_MARGIN = 2e-8  # [m]


@entry_point
def open_yielding_window(parts, n_free, kinds, surface, span, yielding, exact):
    """As `open_window`; the last terms of the surface are the reaction, and stay."""
    start, end = span
    acting = acting_terms(surface, start, end, yielding.margin.shape[0])
    bounds = _bounds(acting, start, end, yielding, exact)
    if not bounds.calm:
        for i in range(n_free):
            wake(parts[i])
    orthonormalise_parts(parts, n_free)
    return acting, bounds, reach_of(parts, n_free, kinds, bounds, end - start)


@compiled
def _bounds(acting, start, end, yielding, exact):
    """Bounds of the surface from `start` to `end` [s], for as long as its reaction changes by no more than the margin.

    Whether parts may sleep goes by the motion as it is.
    """
    margin, antinode, steepest = yielding.margin, yielding.extremes[0], yielding.extremes[1]
    now = bound_window(acting, yielding.extremes, start, end, exact)
    n = margin.shape[0]
    first = acting.term_shape.shape[0] - n
    together = 0.0
    for s in range(n):
        together += now.acceleration[s] * antinode[s]
    crest, slope, speed = now.crest, now.slope, now.speed
    for s in range(n):
        fast = acting.rate[first + s].imag
        margin[s] = max(MARGIN / n * min(now.crest, together / (fast * fast)), LEAST_MARGIN) / antinode[s]
        crest += margin[s] * antinode[s]
        slope += margin[s] * steepest[s]
        speed += margin[s] * fast * antinode[s]
        now.acceleration[s] += margin[s] * fast * fast
    return Bounds(end, crest, slope, now.acceleration, speed, now.fastest, now.calm, exact)


def has_changed(yielding):
    """Whether the reaction has changed by more than the margin of a shape since the bounds were made."""
    raise NotImplementedError("for compiled code only")


def renewed(plate, t, yielding):
    """The plate with bounds from time t on, in the arrays of the old ones."""
    raise NotImplementedError("for compiled code only")


@overload(has_changed)
def _has_changed_by_kind(yielding):
    if isinstance(yielding, types.NoneType):
        return lambda yielding: False
    return lambda yielding: _has_changed(yielding.changed, yielding.margin)


@overload(renewed)
def _renewed_by_kind(plate, t, yielding):
    if isinstance(yielding, types.NoneType):
        return lambda plate, t, yielding: plate
    return lambda plate, t, yielding: _renewed(plate, t, yielding)


@compiled
def _has_changed(changed, margin):
    found = False
    for s in range(margin.shape[0]):
        found = found or changed[s].real ** 2 + changed[s].imag ** 2 > margin[s] ** 2
    return found


@compiled
def _renewed(plate, t, yielding):
    yielding.changed[:] = 0.0
    acceleration = plate.bounds.acceleration
    new = _bounds(plate.surface, t, plate.bounds.end, yielding, plate.bounds.exact)
    for s in range(acceleration.shape[0]):
        acceleration[s] = new.acceleration[s]
    bounds = Bounds(new.end, new.crest, new.slope, acceleration, new.speed, new.fastest, new.calm, new.exact)
    return Plate(plate.surface, bounds)
