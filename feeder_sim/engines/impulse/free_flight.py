"""Torque-free flight of a rigid body in closed form.

The centre of mass follows a parabola. The angular momentum L stays; with principal moments I and body axes R (columns):

*Symmetric top* (moments It, It, Ia; axis a): precession about L and spin about the axis, both uniform,

    R(t) = Rot(L, |L| t / It) R(0) Rot(a, w_a (1 - Ia/It) t),    w_a = L.a / Ia

*General top*: the body components of the angular velocity are Jacobi elliptic functions (Landau and Lifshitz,
Mechanics, section 37); the angle of precession about L is the integral of

    |L| (I1 w1^2 + I2 w2^2) / (I1^2 w1^2 + I2^2 w2^2),

by Gauss-Legendre quadrature. What these functions are at the begin the state itself says, and how they go on their
addition theorem with series of small arguments. The attitude is built from L and these components, so that angular
momentum and energy are constant to round-off whatever the length of the flight.
"""

from __future__ import annotations

import math

import numpy as np

from feeder_sim.engines.impulse.vectors import cross, dot, plus
from feeder_sim.machine_code import compiled, inlined

SYMMETRY_TOLERANCE = 1e-6  # moments closer than this, relative to the largest, count as equal
SMALL_ANGLE = 0.05  # [rad]
SMALL_ARGUMENT = 0.03  # of elliptic functions: five terms of the series are exact to round-off
# [rad] that a body turns by at most: three nodes of a Gauss-Legendre rule are exact to round-off; six in a panel.
SHORT, PANEL = 0.02, 0.25
MOST_PANELS = 1_000_000
NO_MOMENTUM = 1e-140  # [kg m^2/s] by which no body turns; its square would soon have no digits left


def _rule(n: int) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Nodes and weights of n points on [0, 1], filled up with zeros to six."""
    nodes, weights = np.polynomial.legendre.leggauss(n)
    none = (0.0,) * (6 - n)
    return (*(0.5 + 0.5 * nodes).tolist(), *none), (*(0.5 * weights).tolist(), *none)


_FEW, _FEW_WEIGHTS = _rule(3)
_MANY, _MANY_WEIGHTS = _rule(6)


def symmetry_axis(inertia: np.ndarray) -> int:
    """Index of the axis whose two other moments are equal, or -1 for a general top; inertia (3,) [kg m^2]."""
    if not np.isfinite(inertia).all():
        return -1  # what stands still has none
    for axis in (2, 0, 1):
        a, b = inertia[(axis + 1) % 3], inertia[(axis + 2) % 3]
        if abs(a - b) <= SYMMETRY_TOLERANCE * inertia.max():
            return axis
    return -1


@compiled
def rotate_freely(attitude, momentum, inertia, axis, duration):
    """Advance the attitude (3, 3) in place over a duration [s] at constant angular momentum (3,) [kg m^2/s]."""
    size = math.sqrt(momentum[0] ** 2 + momentum[1] ** 2 + momentum[2] ** 2)
    if size < NO_MOMENTUM:
        return
    if axis >= 0:
        rotate_symmetric(attitude, momentum, inertia, axis, duration)
    else:
        _rotate_general(attitude, momentum, size, inertia, duration)


@inlined
def _turned(angle):
    """Cosine and sine of an angle [rad]; of a small one, as most are, by their series to round-off."""
    if abs(angle) > SMALL_ANGLE:
        return math.cos(angle), math.sin(angle)
    x = angle * angle
    return (
        1.0 - x * (0.5 - x * (1.0 / 24.0 - x * (1.0 / 720.0 - x / 40320.0))),
        angle * (1.0 - x * (1.0 / 6.0 - x * (1.0 / 120.0 - x * (1.0 / 5040.0 - x / 362880.0)))),
    )


@compiled
def rotate_symmetric(attitude, momentum, inertia, axis, duration):
    """As `rotate_freely`, for a body whose moments about the two other axes than `axis` are equal."""
    size = math.sqrt(momentum[0] ** 2 + momentum[1] ** 2 + momentum[2] ** 2)
    if size < NO_MOMENTUM:
        return
    a, b = (axis + 1) % 3, (axis + 2) % 3
    transverse = 0.5 * (inertia[a] + inertia[b])
    along = momentum[0] * attitude[0, axis] + momentum[1] * attitude[1, axis] + momentum[2] * attitude[2, axis]
    spin = along / inertia[axis] * (1.0 - inertia[axis] / transverse) * duration
    c, s = _turned(spin)
    for i in range(3):  # attitude Rot(axis, spin): turns the two transverse columns
        u, v = attitude[i, a], attitude[i, b]
        attitude[i, a] = c * u + s * v
        attitude[i, b] = c * v - s * u
    x, y, z = momentum[0] / size, momentum[1] / size, momentum[2] / size
    precession = size / transverse * duration
    c, s = _turned(precession)
    for column in range(3):  # Rot(L, precession) attitude, by Rodrigues
        p, q, r = attitude[0, column], attitude[1, column], attitude[2, column]
        along = (x * p + y * q + z * r) * (1.0 - c)
        attitude[0, column] = c * p + s * (y * r - z * q) + along * x
        attitude[1, column] = c * q + s * (z * p - x * r) + along * y
        attitude[2, column] = c * r + s * (x * q - y * p) + along * z


@compiled
def _rotate_general(attitude, momentum, size, inertia, duration):
    """Landau-Lifshitz solution; axes sorted so that axis 3 is the one the body momentum circles around.

    Everything is a number or a tuple: no array is made. Products and differences of the moments are taken where
    nothing cancels, so that a spin about nearly a principal axis is as exact as any other.
    """
    x, y, z = _sorted_axes(inertia)
    along = _along(attitude, momentum, 0), _along(attitude, momentum, 1), _along(attitude, momentum, 2)
    m1, m3 = along[x], along[z]
    if m3 * m3 / inertia[z] * (inertia[z] - inertia[y]) < m1 * m1 / inertia[x] * (inertia[y] - inertia[x]):
        x, z = z, x
    i1, i2, i3 = inertia[x], inertia[y], inertia[z]
    handed = 1.0 if (y - x) % 3 == 1 else -1.0  # an odd permutation mirrors axis 2
    w1, w2, w3 = along[x] / i1, handed * along[y] / i2, along[z] / i3
    high = i1 * (i3 - i1) * w1 * w1 + i2 * (i3 - i2) * w2 * w2  # 2 T I3 - L^2
    low = i2 * (i2 - i1) * w2 * w2 + i3 * (i3 - i1) * w3 * w3  # L^2 - 2 T I1
    side = 1.0 if w3 >= 0.0 else -1.0
    sense = side if i3 > i2 else -side  # Euler's equation of axis 1 fixes the sign of component 2
    a1, a2 = math.sqrt(high / (i1 * (i3 - i1))), math.sqrt(high / (i2 * (i3 - i2)))
    a3 = math.sqrt(low / (i3 * (i3 - i1)))
    rate = math.sqrt((i3 - i2) * low / (i1 * i2 * i3))
    modulus = min((i2 - i1) * high / ((i3 - i2) * low), 1.0)
    about_axis_3 = w1 == 0.0 and w2 == 0.0
    now = (0.0, 1.0, 1.0) if about_axis_3 else (sense * w2 / a2, w1 / a1, abs(w3) / a3)
    then, precession = _precession(now, (i1, i2, i3), modulus, rate * duration, size / min(i1, i2, i3) * duration)
    precession = size / i3 * duration if about_axis_3 else size * duration * precession
    after = i1 * a1 * then[1], handed * i2 * sense * a2 * then[0], i3 * side * a3 * then[2]
    _align(attitude, momentum, (x, y, z), handed, (along[x], along[y], along[z]), after, precession)


@inlined
def _sorted_axes(inertia):
    """The axes from the smallest to the largest moment."""
    x, y, z = 0, 1, 2
    if inertia[y] < inertia[x]:
        x, y = y, x
    if inertia[z] < inertia[y]:
        y, z = z, y
    if inertia[y] < inertia[x]:
        x, y = y, x
    return x, y, z


@inlined
def _along(attitude, momentum, axis):
    """Component of the momentum along a body axis."""
    return attitude[0, axis] * momentum[0] + attitude[1, axis] * momentum[1] + attitude[2, axis] * momentum[2]


@compiled
def _precession(now, moments, m, argument, turned):
    """Elliptic functions after an argument has been covered, and the mean of the precession over it, by |L| [1/I].

    now: sn, cn, dn at the begin. In between they follow by the addition theorem, panel by panel; `turned` bounds the
    angle that the body turns by meanwhile [rad], on which the width of the panels goes.
    """
    panels = int(min(turned / PANEL, MOST_PANELS)) + 1
    nodes, weights = (_FEW, _FEW_WEIGHTS) if turned < SHORT else (_MANY, _MANY_WEIGHTS)
    i1, i2, i3 = moments
    p, q = i3 - i2, i3 - i1
    total = 0.0
    width = argument / panels
    for _ in range(panels):
        for k in range(6):
            if weights[k] == 0.0:
                break
            s, c, _ = _added(now, _from_zero(width * nodes[k], m), m)
            total += weights[k] * (p * c * c + q * s * s) / (i1 * p * c * c + i2 * q * s * s)
        s, c, d = _added(now, _from_zero(width, m), m)
        size = math.sqrt(s * s + c * c)
        s, c = s / size, c / size
        now = s, c, math.sqrt(1.0 - m * s * s) if d > 0.1 else d  # which takes out the round-off of many panels
    return now, total / panels


@inlined
def _added(a, b, m):
    """sn, cn, dn of the sum of two arguments (Abramowitz and Stegun 16.17)."""
    share = 1.0 / (1.0 - m * a[0] * a[0] * b[0] * b[0])
    return (
        (a[0] * b[1] * b[2] + b[0] * a[1] * a[2]) * share,
        (a[1] * b[1] - a[0] * a[2] * b[0] * b[2]) * share,
        (a[2] * b[2] - m * a[0] * a[1] * b[0] * b[1]) * share,
    )


@inlined
def _from_zero(u, m):
    """sn, cn, dn of an argument: their series for a small one (Abramowitz and Stegun 16.22), else by doubling."""
    doublings = 0
    while abs(u) > SMALL_ARGUMENT:
        u *= 0.5
        doublings += 1
    x = u * u
    s = 1.0 + m * (1228.0 + m * (5478.0 + m * (1228.0 + m)))
    s = (1.0 + m * (135.0 + m * (135.0 + m))) / 5040.0 - x * s / 362880.0
    s = (1.0 + m * (14.0 + m)) / 120.0 - x * s
    s = u * (1.0 - x * ((1.0 + m) / 6.0 - x * s))
    functions = s, math.sqrt(1.0 - s * s), math.sqrt(1.0 - m * s * s)
    for _ in range(doublings):
        functions = _added(functions, functions, m)
    return functions


@inlined
def _align(attitude, momentum, axes, handed, before, after, precession):
    """Turn the body so that its momentum goes from `before` to `after` (sorted body axes) and precesses by an angle.

    The frame (L, polar axis) precesses: its basis in the body is known before and after, and its turn.
    """
    x, y, z = axes
    first, _, _ = _momentum_frame(before, handed)
    across, beside, along = _momentum_frame(after, handed)
    direction = _unit((momentum[0], momentum[1], momentum[2]))
    u = (  # the axis across the momentum, in space
        attitude[0, x] * first[0] + attitude[0, y] * first[1] + attitude[0, z] * first[2],
        attitude[1, x] * first[0] + attitude[1, y] * first[1] + attitude[1, z] * first[2],
        attitude[2, x] * first[0] + attitude[2, y] * first[1] + attitude[2, z] * first[2],
    )
    u = _unit(plus(u, -dot(u, direction), direction))
    v = cross(direction, u)
    c, s = _turned(precession)
    for i in range(3):
        p, q = c * u[i] + s * v[i], c * v[i] - s * u[i]
        attitude[i, x] = p * across[0] + q * beside[0] + direction[i] * along[0]
        attitude[i, y] = p * across[1] + q * beside[1] + direction[i] * along[1]
        attitude[i, z] = p * across[2] + q * beside[2] + direction[i] * along[2]


@inlined
def _momentum_frame(momentum, handed):
    """Orthonormal vectors in body axes: the third axis made perpendicular to the momentum, cross product, momentum."""
    d = _unit(momentum)
    side = d[0] * d[0] + d[1] * d[1]
    # Of a spin about that axis any perpendicular will do, it stays in the body.
    across = _unit((-d[2] * d[0], -d[2] * d[1], side)) if side > 0.0 else (1.0, 0.0, 0.0)
    beside = cross(d, across)
    return across, (handed * beside[0], handed * beside[1], handed * beside[2]), d


@inlined
def _unit(a):
    size = math.sqrt(dot(a, a))
    return a[0] / size, a[1] / size, a[2] / size


@compiled
def _normalise(vector, out):
    size = math.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)
    for k in range(3):
        out[k] = vector[k] / size


@compiled
def _complete(direction, across, frame):
    """Orthonormal rows from a unit vector, which becomes the third, and one nearly perpendicular to it."""
    along = across[0] * direction[0] + across[1] * direction[1] + across[2] * direction[2]
    for k in range(3):
        frame[2, k] = direction[k]
        frame[0, k] = across[k] - along * direction[k]
    size = math.sqrt(frame[0, 0] ** 2 + frame[0, 1] ** 2 + frame[0, 2] ** 2)
    for k in range(3):
        frame[0, k] /= size
    for k in range(3):
        a, b = (k + 1) % 3, (k + 2) % 3
        frame[1, k] = frame[2, a] * frame[0, b] - frame[2, b] * frame[0, a]


@compiled
def orthonormalise(attitude):
    """Take the round-off of many flights out of a rotation matrix (3, 3), in place."""
    axis, across, frame = np.empty(3), np.empty(3), np.empty((3, 3))
    for k in range(3):
        axis[k], across[k] = attitude[k, 2], attitude[k, 0]
    _normalise(axis, axis)
    _complete(axis, across, frame)
    for i in range(3):
        for j in range(3):
            attitude[i, j] = frame[j, i]
