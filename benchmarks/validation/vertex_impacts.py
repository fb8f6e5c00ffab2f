"""A rectangle that bounces on a standing wave in a plane, one vertex or two at a time: a small program of its own.

Shares no code with the engines. It follows the rules of the published program `vibrating-plate-simulator` (V. Sariola,
2016, MIT licence), which goes with Zhou, Sariola, Latifi and Liimatainen, Nature Communications 7 (2016) 12764:

- fixed steps; a vertex that is below the surface after a step collides, and is not put back;
- of several such vertices the mean is taken, as one point of contact;
- the surface there moves up and down only, its normal is that of the wave;
- the impulse is Routh's: friction acts while the point is pressed in and while it springs back, and restitution is
  Poisson's, impulse of restitution over impulse of compression (Wang and Mason, J. Appl. Mech. 59 (1992) 635).

What can be changed here, to see what it does: Newton's restitution in place of Poisson's, with the tangential impulse
that ends all slip or the largest that friction allows, as the engines have it; an impulse at each vertex that is below,
one after the other; and the in-plane velocity of a plate.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from feeder_sim.constants import GRAVITY
from feeder_sim.machine_code import compiled, entry_point, inlined


class Wave(NamedTuple):
    """w = amplitude sin(wavenumber x) sin(omega t), in SI units.

    lean: of the stroke of the surface, in-plane over vertical velocity at a node; 0 for a surface that moves up and
    down.
    """

    amplitude: float
    wavenumber: float
    omega: float
    lean: float


class Body(NamedTuple):
    """Half the width and half the height of the rectangle [m], and its moment of inertia over its mass [m^2]."""

    half_width: float
    half_height: float
    inertia: float


class Law(NamedTuple):
    """Friction and restitution; whether that is Poisson's or Newton's, and whether vertices are joined to one point."""

    friction: float
    restitution: float
    poisson: bool
    joined: bool


class Times(NamedTuple):
    """Step [s], how many steps there are from one frame to the next, and how many frames."""

    step: float
    per_frame: int
    frames: int


@entry_point
def bounce(body, wave, law, times, starts):
    """Places (starts, frames) of rectangles [m] along x; the first frame is the start.

    starts: x [m] at time 0, shape (starts,). They lie flat on the level surface, at rest.
    """
    places = np.empty((len(starts), times.frames))
    for k in range(len(starts)):
        _bounce_one(body, wave, law, times, starts[k], places[k])
    return places


@compiled
def _bounce_one(body, wave, law, times, start, places):
    """Fill the places (frames,) of one rectangle."""
    x, z, turn = start, body.half_height, 0.0
    velocity = 0.0, 0.0, 0.0  # along x and z [m/s], and of the turn [rad/s]
    places[0] = x
    step = times.step
    for i in range(1, times.per_frame * (times.frames - 1) + 1):
        t = i * step
        x, turn = x + velocity[0] * step, turn + velocity[2] * step
        z += velocity[1] * step - 0.5 * GRAVITY * step * step
        velocity = velocity[0], velocity[1] - GRAVITY * step, velocity[2]
        n, below_x, below_z = 0, 0.0, 0.0
        for vertex in range(4):
            px, pz = _vertex(vertex, body, x, z, turn)
            if wave.amplitude * math.sin(wave.wavenumber * px) * math.sin(wave.omega * t) > pz:
                n, below_x, below_z = n + 1, below_x + px, below_z + pz
                if not law.joined:
                    velocity = _collide(body, wave, law, t, (px, pz), (x - px, z - pz), velocity)
        if law.joined and n > 0:
            px, pz = below_x / n, below_z / n
            velocity = _collide(body, wave, law, t, (px, pz), (x - px, z - pz), velocity)
        if i % times.per_frame == 0:
            places[i // times.per_frame] = x


@inlined
def _vertex(number, body, x, z, turn):
    """Place of a vertex."""
    c, s = math.cos(turn), math.sin(turn)
    a = body.half_width if number % 2 else -body.half_width
    b = body.half_height if number > 1 else -body.half_height
    return x + c * a - s * b, z + s * a + c * b


@compiled
def _collide(body, wave, law, t, point, arm, velocity):
    """Velocities after an impact at a point (x, z), if it approaches the surface; arm: from there to the centre."""
    phase, rate = wave.wavenumber * point[0], wave.amplitude * wave.omega * math.cos(wave.omega * t)
    slope = wave.amplitude * wave.wavenumber * math.cos(phase) * math.sin(wave.omega * t)
    size = math.sqrt(1.0 + slope * slope)
    c, s = 1.0 / size, slope / size  # along the surface; the normal is (-s, c)
    ux = velocity[0] + velocity[2] * arm[1] + wave.lean * rate * math.cos(phase)
    uz = velocity[1] - velocity[2] * arm[0] - rate * math.sin(phase)
    approach = c * uz - s * ux
    if approach > 0.0:
        return velocity
    along, across = c * arm[0] + s * arm[1], c * arm[1] - s * arm[0]
    # Inverse masses: along the surface, along the normal, and what couples them.
    m = 1.0 + across**2 / body.inertia, 1.0 + along**2 / body.inertia, along * across / body.inertia
    tangential, normal = _impulse(c * ux + s * uz, approach, m, law)
    return (
        velocity[0] + tangential * c - normal * s,
        velocity[1] + tangential * s + normal * c,
        velocity[2] + (tangential * across - normal * along) / body.inertia,
    )


@inlined
def _impulse(slip, approach, m, law):
    """Tangential and normal impulse over mass [m/s], from the velocity of the point along the surface and normal."""
    if law.poisson:
        return poisson_impulse(slip, approach, m, law.friction, law.restitution)
    return newton_impulse(slip, approach, m, law.friction, law.restitution)


@compiled
def poisson_impulse(slip, approach, m, mu, e):
    """Routh's construction: the impulse grows along the limit of friction until the slip ends, then sticks or reverses.

    m: what the velocities gain: slip' = slip + m[0] p_t - m[2] p_n, approach' = approach - m[2] p_t + m[1] p_n.
    """
    sense = -1.0 if slip < 0.0 else 1.0
    slows, slipping = -sense * (mu * m[0] + sense * m[2]), m[1] + sense * mu * m[2]  # gains per normal impulse
    ends = -slip / slows if sense * slows < 0.0 else math.inf  # normal impulse at which the slip ends
    compressed = -approach / slipping if slipping > 0.0 else math.inf
    if (1.0 + e) * compressed <= ends:
        normal = (1.0 + e) * compressed
        return -sense * mu * normal, normal
    then = m[2] / m[0] if mu > abs(m[2] / m[0]) else sense * mu  # tangential per normal impulse: sticks, or reverses
    if compressed > ends:
        compressed = ends - (approach + slipping * ends) / (m[1] - m[2] * then)
    normal = (1.0 + e) * compressed
    return -sense * mu * ends + then * (normal - ends), normal


@compiled
def newton_impulse(slip, approach, m, mu, e):
    """The normal velocity is reversed and multiplied by e; friction ends the slip, or is at its limit."""
    target, determinant = -(1.0 + e) * approach, m[0] * m[1] - m[2] * m[2]
    tangential, normal = (m[2] * target - m[1] * slip) / determinant, (m[0] * target - m[2] * slip) / determinant
    if normal >= 0.0 and abs(tangential) <= mu * normal:
        return tangential, normal
    sense = -1.0 if tangential > 0.0 else 1.0
    normal = target / (m[1] + sense * mu * m[2])
    return -sense * mu * normal, normal


def mean_slope(time: NDArray[np.float64], place: NDArray[np.float64]) -> NDArray[np.float64]:
    """Slope [m/s] of the straight line through the places (n, times) [m] at times (times,) [s], shape (n,)."""
    return np.asarray(np.polyfit(time, place.T, 1)[0])
