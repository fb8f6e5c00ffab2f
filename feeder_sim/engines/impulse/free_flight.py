"""Torque-free flight of a rigid body in closed form.

The centre of mass follows a parabola. The angular momentum L stays; with principal moments I and body axes R (columns):

*Symmetric top* (moments It, It, Ia; axis a): precession about L and spin about the axis, both uniform,

    R(t) = Rot(L, |L| t / It) R(0) Rot(a, w_a (1 - Ia/It) t),    w_a = L.a / Ia

*General top*: the body components of the angular velocity are Jacobi elliptic functions (Landau and Lifshitz,
Mechanics, section 37); the angle of precession about L is the integral of

    |L| (I1 w1^2 + I2 w2^2) / (I1^2 w1^2 + I2^2 w2^2),

by Gauss-Legendre quadrature. The attitude is built from L and these components, so that angular momentum and energy
are constant to round-off whatever the length of the flight.
"""

from __future__ import annotations

import math

import numpy as np

from feeder_sim.machine_code import compiled, inlined

SYMMETRY_TOLERANCE = 1e-6  # moments closer than this, relative to the largest, count as equal
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)
_PANEL = 0.5  # of the elliptic argument: 8 nodes resolve it to round-off
AGM_STEPS = 12
SMALL_ANGLE = 0.05  # [rad]


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
def turn(axis, angle, vector, out):
    """Rotate a vector (3,) about a unit axis (3,) by an angle [rad] (Rodrigues)."""
    c, s = math.cos(angle), math.sin(angle)
    along = (axis[0] * vector[0] + axis[1] * vector[1] + axis[2] * vector[2]) * (1.0 - c)
    x = c * vector[0] + s * (axis[1] * vector[2] - axis[2] * vector[1]) + along * axis[0]
    y = c * vector[1] + s * (axis[2] * vector[0] - axis[0] * vector[2]) + along * axis[1]
    z = c * vector[2] + s * (axis[0] * vector[1] - axis[1] * vector[0]) + along * axis[2]
    out[0], out[1], out[2] = x, y, z


@compiled
def rotate_freely(attitude, momentum, inertia, axis, duration):
    """Advance the attitude (3, 3) in place over a duration [s] at constant angular momentum (3,) [kg m^2/s]."""
    size = math.sqrt(momentum[0] ** 2 + momentum[1] ** 2 + momentum[2] ** 2)
    if size == 0.0:
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
    if size == 0.0:
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

    Written out component by component: array operators would take far longer to compile than to run.
    """
    order, body = np.empty(3, np.int64), np.empty(3)
    twice_energy = 0.0
    for axis in range(3):
        rank = 0
        for other in range(3):
            if inertia[other] < inertia[axis] or (inertia[other] == inertia[axis] and other < axis):
                rank += 1
        order[rank] = axis
        body[axis] = 0.0
        for k in range(3):
            body[axis] += attitude[k, axis] * momentum[k]
        twice_energy += body[axis] * body[axis] / inertia[axis]
    if size * size < twice_energy * inertia[order[1]]:
        order[0], order[2] = order[2], order[0]
    i1, i2, i3 = inertia[order[0]], inertia[order[1]], inertia[order[2]]
    handed = 1.0 if (order[1] - order[0]) % 3 == 1 else -1.0  # an odd permutation mirrors axis 2
    m1, m2, m3 = body[order[0]], handed * body[order[1]], body[order[2]]
    side = 1.0 if m3 >= 0.0 else -1.0
    sense = side if i3 > i2 else -side  # Euler's equation of axis 1 fixes the sign of component 2
    high, low = twice_energy * i3 - size**2, size**2 - twice_energy * i1
    a1 = math.sqrt(max(high / (i1 * (i3 - i1)), 0.0))
    a2 = math.sqrt(max(high / (i2 * (i3 - i2)), 0.0))
    a3 = math.sqrt(max(low / (i3 * (i3 - i1)), 0.0))
    rate = math.sqrt((i3 - i2) * low / (i1 * i2 * i3))
    modulus = min(max((i2 - i1) * high / ((i3 - i2) * low), 0.0), 1.0)
    phase = math.atan2(sense * m2 / i2 * a1, m1 / i1 * a2)
    start = elliptic_f(phase, modulus)
    panels = int(abs(rate * duration) / _PANEL) + 1
    precession = 0.0
    for panel in range(panels):
        for node in range(len(_NODES)):
            at = duration * (panel + 0.5 + 0.5 * _NODES[node]) / panels
            sn, cn, _ = jacobi(start + rate * at, modulus)
            w1, w2 = (a1 * cn) ** 2, (a2 * sn) ** 2
            below = i1 * i1 * w1 + i2 * i2 * w2
            speed = (i1 * w1 + i2 * w2) / below if below > 0.0 else 1.0 / i3
            precession += 0.5 * duration / panels * _WEIGHTS[node] * size * speed
    sn, cn, dn = jacobi(start + rate * duration, modulus)
    after = np.empty(3)
    after[order[0]], after[order[1]], after[order[2]] = i1 * a1 * cn, handed * i2 * sense * a2 * sn, i3 * side * a3 * dn
    direction = np.empty(3)
    _normalise(body, body)
    _normalise(after, after)
    _normalise(momentum, direction)
    _align(attitude, direction, body, after, order[2], precession)


@compiled
def _align(attitude, direction, before, after, polar, precession):
    """Turn the body so that its momentum direction goes from `before` to `after` (body axes) and precesses by an angle.

    The frame (L, polar axis) precesses: its basis in the body is known before and after, and its turn.
    """
    first, second, space = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    across = np.empty(3)
    _momentum_frame(before, polar, first)
    _momentum_frame(after, polar, second)
    for i in range(3):  # the axis across the momentum, in space
        across[i] = attitude[i, 0] * first[0, 0] + attitude[i, 1] * first[0, 1] + attitude[i, 2] * first[0, 2]
    turn(direction, precession, across, across)
    _complete(direction, across, space)
    for i in range(3):
        for j in range(3):
            attitude[i, j] = space[0, i] * second[0, j] + space[1, i] * second[1, j] + space[2, i] * second[2, j]


@compiled
def _momentum_frame(direction, polar, frame):
    """Orthonormal rows in body axes: polar axis made perpendicular to `direction`, cross product, `direction`."""
    across = np.empty(3)
    for k in range(3):
        across[k] = -direction[polar] * direction[k]
    across[polar] += 1.0
    if across[0] ** 2 + across[1] ** 2 + across[2] ** 2 < 1e-24:
        # Spinning about the polar axis: any perpendicular will do, it stays in the body.
        for k in range(3):
            across[k] = 1.0 if k == (polar + 1) % 3 else 0.0
    _normalise(across, across)
    _complete(direction, across, frame)


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


@compiled
def jacobi(u, m):
    """Jacobi elliptic sn, cn, dn of argument u and parameter m = k^2 in [0, 1] (Abramowitz and Stegun 16.4, AGM)."""
    if m < 1e-16:
        return math.sin(u), math.cos(u), 1.0
    if m > 1.0 - 1e-16:
        return math.tanh(u), 1.0 / math.cosh(u), 1.0 / math.cosh(u)
    a, b = np.empty(AGM_STEPS + 1), math.sqrt(1.0 - m)
    c = np.empty(AGM_STEPS + 1)
    a[0], c[0] = 1.0, math.sqrt(m)
    n = 0
    while n < AGM_STEPS and abs(c[n]) > 1e-16:
        a[n + 1] = 0.5 * (a[n] + b)
        c[n + 1] = 0.5 * (a[n] - b)
        b = math.sqrt(a[n] * b)
        n += 1
    phi = 2.0**n * a[n] * u
    for i in range(n, 0, -1):
        phi = 0.5 * (phi + math.asin(min(max(c[i] * math.sin(phi) / a[i], -1.0), 1.0)))
    sn = math.sin(phi)
    return sn, math.cos(phi), math.sqrt(1.0 - m * sn * sn)


@compiled
def elliptic_f(phi, m):
    """Incomplete elliptic integral of the first kind for |phi| <= pi, through Carlson's R_F."""
    turns = math.floor(phi / math.pi + 0.5)
    rest = phi - turns * math.pi
    s, c = math.sin(rest), math.cos(rest)
    value = s * _carlson_rf(c * c, 1.0 - m * s * s, 1.0)
    if turns != 0.0:
        value += 2.0 * turns * _carlson_rf(0.0, 1.0 - m, 1.0)
    return value


@compiled
def _carlson_rf(x, y, z):
    """Carlson's symmetric integral R_F by duplication (Carlson, Numer. Algorithms 10 (1995) 13)."""
    for _ in range(60):
        mean = (x + y + z) / 3.0
        if max(abs(x - mean), abs(y - mean), abs(z - mean)) < 1e-4 * abs(mean):
            break
        shift = math.sqrt(x * y) + math.sqrt(y * z) + math.sqrt(z * x)
        x, y, z = 0.25 * (x + shift), 0.25 * (y + shift), 0.25 * (z + shift)
    mean = (x + y + z) / 3.0
    dx, dy = 1.0 - x / mean, 1.0 - y / mean
    dz = -dx - dy
    e2, e3 = dx * dy - dz * dz, dx * dy * dz
    return (1.0 - e2 / 10.0 + e3 / 14.0 + e2 * e2 / 24.0 - 3.0 * e2 * e3 / 44.0) / math.sqrt(mean)
