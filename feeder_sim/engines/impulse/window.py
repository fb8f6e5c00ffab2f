"""What the surface does within a short window of time: the terms that act, and bounds on its motion."""

from __future__ import annotations

import cmath
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.impulse.surroundings import Bounds, Exactness
from feeder_sim.engines.surface_arrays import SurfaceArrays
from feeder_sim.machine_code import compiled, inlined

BEAT = 1e-4  # relative; damping alone shifts the frequency of the transient by a hundredth of this
COVERED = 5e-5  # [m]; what a surface may cover in such a longer step: a corner far below it counts as beside the plate
ALLOWANCE = 1.01  # on envelopes, which are looked at on both ends of the window
MUCH_FASTER = 1.5  # than all that act: from here on longer steps pay
CALM = 3e-3, 1e-6  # [m/s], [m]; a plate that is not driven and moves no faster and no farther lets parts sleep
FAINT = 1e-13  # [m]; what has come down to that has died out
SLOWEST = 1.0  # [rad/s]; the rate of a surface that does not move
SAG = 1e-7  # [m]; how far a surface that is no longer driven may move relative to a part within one step


class Drive(NamedTuple):
    """The surface, the extremes of its shapes as in `Surface`, how exact contacts are; step and length of a window [s].

    The step belongs to the fastest of all terms; what is computed without one takes no note of it.
    """

    surface: SurfaceArrays
    extremes: NDArray[np.float64]
    exact: Exactness
    step: float
    window: float


@compiled
def acting_terms(surface, start, stop, staying=0):
    """The surface with those terms alone that act between two times [s] and have not died out.

    Terms of one shape and rate that act all the time become one: what rings on after many short stages are many terms.
    The last ones stay as they are, as many as are `staying`.
    """
    n, most = 0, surface.term_shape.shape[0]
    shape, begin, end = np.empty(most, np.int64), np.empty(most), np.empty(most)
    coefficient, rate = np.empty(most, np.complex128), np.empty(most, np.complex128)
    for k in range(most):
        stays = k >= most - staying
        if not stays and (surface.term_start[k] >= stop or surface.term_stop[k] < start):
            continue
        if not stays and _size_at(surface, k, max(start, surface.term_start[k])) <= FAINT:
            continue
        own, at = surface.coefficient[k], n
        if not stays and surface.term_start[k] <= start and surface.term_stop[k] >= stop:
            for j in range(n):
                same = shape[j] == surface.term_shape[k] and rate[j] == surface.rate[k]
                if same and begin[j] <= start and end[j] >= stop:
                    at = j
        shape[at], rate[at] = surface.term_shape[k], surface.rate[k]
        if at == n:
            begin[at], end[at], coefficient[at] = surface.term_start[k], surface.term_stop[k], own
            n += 1
            continue
        later = max(begin[at], surface.term_start[k])
        coefficient[at] = coefficient[at] * cmath.exp(rate[at] * (later - begin[at]))
        coefficient[at] += own * cmath.exp(rate[at] * (later - surface.term_start[k]))
        begin[at], end[at] = later, min(end[at], surface.term_stop[k])
    terms = shape[:n].copy(), begin[:n].copy(), end[:n].copy(), coefficient[:n].copy(), rate[:n].copy()
    return SurfaceArrays(*surface[:3], *terms, *surface[8:])  # type: ignore[call-arg]


@inlined
def _size_at(surface, k, t):
    """Modulus of a term at a time [s] [m]."""
    return abs(surface.coefficient[k]) * math.exp(surface.rate[k].real * (t - surface.term_start[k]))


@compiled
def next_change(surface, t, end):
    """When a term that has not died out begins or ends next, up to a time [s]."""
    for k in range(surface.term_shape.shape[0]):
        start, stop = surface.term_start[k], surface.term_stop[k]
        if t < start < end and abs(surface.coefficient[k]) > FAINT:
            end = start
        elif t < stop < end and start < stop and _size_at(surface, k, stop) > FAINT:
            end = stop
    return end


@compiled
def fastest_rate(surface):
    """The fastest of all terms [rad/s], whenever it acts."""
    fastest = 0.0
    for k in range(surface.term_shape.shape[0]):
        fastest = max(fastest, abs(surface.rate[k].imag))
    return fastest


@compiled
def bound_window(acting, drive, start, stop):
    """Bound the surface of a drive between two times [s], of which the acting terms are known.

    While only terms act that are much slower than the fastest of all, steps are as much longer. Terms of one mode and
    one frequency add up as phasors (a ring-up begins at nothing), others as moduli (they beat).

    The rate [rad/s] with which a derivative of the motion bounds the next ones, from the acceleration on, is that of
    the terms where all of a shape are as fast; else sqrt(S / A), S and A the sums of a w^4 and a w^2 over its terms:
    by Cauchy and Schwarz the jerk is no more than A times that.
    """
    now, top, own_step, step = fastest_rate(acting), fastest_rate(drive.surface), drive.step, drive.step
    if now > 0.0 and top > MUCH_FASTER * now:
        step *= top / now
    antinode, steepest, bent = drive.extremes[0], drive.extremes[1], drive.extremes[2]
    n_shapes = antinode.shape[0]
    acceleration, amplitude = np.zeros(n_shapes), np.zeros(n_shapes)
    crest = slope = speed = together = curvature = 0.0
    rate = SLOWEST
    driven = False
    for k in range(acting.term_shape.shape[0]):
        driven = driven or (acting.rate[k].real == 0.0 and acting.coefficient[k] != 0.0)
    for shape in range(n_shapes):
        snap, own, groups = 0.0, 0.0, 0
        for k in range(acting.term_shape.shape[0]):
            if acting.term_shape[k] != shape or _is_repeated(acting, k):
                continue
            own = _fastest_together(acting, k)
            size = max(_modulus(acting, k, start, stop, False), _modulus(acting, k, start, stop, True)) * ALLOWANCE
            amplitude[shape] += size
            acceleration[shape] += size * own * own
            speed += size * own * antinode[shape]
            snap += size * own * own * own * own
            groups += 1
        crest += amplitude[shape] * antinode[shape]
        slope += amplitude[shape] * steepest[shape]
        together += acceleration[shape] * antinode[shape]
        if acceleration[shape] > 0.0:
            rate = max(rate, own if groups == 1 else math.sqrt(snap / acceleration[shape]))
            if antinode[shape] > 0.0:
                curvature = max(curvature, bent[shape] / antinode[shape])  # by the height, of all that act
    if step > own_step and speed * step > COVERED:
        step = max(own_step, COVERED / speed)
    rest_step = step if driven else max(step, math.sqrt(2.0 * SAG / (GRAVITY + together)))
    calm = not driven and speed <= CALM[0] and crest <= CALM[1]
    fastest = max(now, SLOWEST)
    sizes = crest, slope, speed, rest_step, acceleration, amplitude
    return Bounds(stop, *sizes, curvature * crest, rate, fastest, step, calm, drive.exact)


@compiled
def _together(acting, k, j):
    return acting.term_shape[j] == acting.term_shape[k] and abs(
        acting.rate[j].imag - acting.rate[k].imag
    ) <= BEAT * abs(acting.rate[k].imag)


@compiled
def _fastest_together(acting, k):
    """The fastest rate of the terms that add up with term k [rad/s]."""
    fastest = 0.0
    for j in range(acting.term_shape.shape[0]):
        if _together(acting, k, j):
            fastest = max(fastest, abs(acting.rate[j].imag))
    return fastest


@compiled
def _is_repeated(acting, k):
    seen = False
    for j in range(k):
        seen = seen or _together(acting, k, j)
    return seen


@compiled
def _modulus(acting, k, start, stop, late):
    """Modulus of all terms of the mode and frequency of term k, at the begin of the window or `late` at its end.

    What begins or ends within the window is taken as if it had always been there, at its largest.
    """
    real = imaginary = rest = 0.0
    t = stop if late else start
    for j in range(acting.term_shape.shape[0]):
        if not _together(acting, k, j):
            continue
        begins, ends = acting.term_start[j], acting.term_stop[j]
        if begins > start or ends < stop:
            at = max(begins, start)
            rest += abs(acting.coefficient[j]) * math.exp(acting.rate[j].real * (at - begins))
            continue
        age = t - begins
        fade, angle = math.exp(acting.rate[j].real * age), acting.rate[j].imag * age
        c, s = fade * math.cos(angle), fade * math.sin(angle)
        real += acting.coefficient[j].real * c - acting.coefficient[j].imag * s
        imaginary += acting.coefficient[j].real * s + acting.coefficient[j].imag * c
    return math.sqrt(real * real + imaginary * imaginary) + rest
