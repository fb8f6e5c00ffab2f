"""Impact at a single point, by far the most frequent case, solved directly: it sticks, or it slips.

The impulse p changes the relative velocity u by K p, with the inverse effective mass K in a frame (a, b, normal). That
which ends all slip is tried first. Where it lies outside the friction cone the point slips, in a direction that is
found by the secant method: it has to be opposite to the friction that it causes.
"""

from __future__ import annotations

import math

import numpy as np

from feeder_sim.engines.impulse.state import dot, relative_velocity
from feeder_sim.machine_code import compiled

HALVINGS = 12  # of the restitution, until an impact creates no energy
ROUND_OFF = 1e-12  # of the work of an impact
MAX_SECANTS = 30
SECTORS, BISECTIONS = 48, 60
ANGLE_TOLERANCE = 1e-10  # of the slip direction [rad]


@compiled
def solve_single(inverse_mass, inverse_inertia, arm, normal, before, impulse, target, mu):
    """Impulse of a single corner; False, with the impulse untouched, where the direct solution does not apply.

    Works in a frame (a, b, normal); k is the inverse effective mass there: after = before + k impulse.
    """
    frame, k, u = np.empty((3, 3)), np.zeros((3, 3)), np.empty(3)
    _contact_frame(normal, frame)
    _add_mobility(inverse_mass, inverse_inertia, arm, frame, k)
    for i in range(3):
        u[i] = dot(frame[i], before)
    p = np.empty(3)
    if not _stick(k, u, target, mu, p) and not _slip(k, u, target, mu, p):
        return False
    for j in range(3):
        impulse[j] = p[0] * frame[0, j] + p[1] * frame[1, j] + p[2] * frame[2, j]
    return True


@compiled
def _add_mobility(inverse_mass, inverse_inertia, arm, frame, k):
    """Add 1/m - [arm] I^-1 [arm], in the contact frame, to the inverse effective mass k (3, 3)."""
    moment, turned = np.empty((3, 3)), np.empty(3)
    for i in range(3):
        for j in range(3):
            moment[i, j] = arm[(j + 1) % 3] * frame[i, (j + 2) % 3] - arm[(j + 2) % 3] * frame[i, (j + 1) % 3]
    for i in range(3):
        for j in range(3):
            turned[j] = dot(inverse_inertia[j], moment[i])
        for j in range(3):
            k[i, j] += dot(moment[j], turned)
        k[i, i] += inverse_mass


@compiled
def resolve_single(a, b, inverse_mass, inverse_inertia, arms, normal, e, mu):
    """Impact of two free parts (`PART`) at one point; changes velocities and angular momenta in place.

    inverse_mass (2,) [1/kg] and inverse_inertia (2, 3, 3), in world axes, of a and b; arms (2, 3) go from either centre
    of mass to the contact point [m]; normal (3,) points from a to b. Same laws as `resolve_impact`. Returns False, with
    nothing changed, where the parts do not approach each other.
    """
    frame, k, u, before = np.empty((3, 3)), np.zeros((3, 3)), np.empty(3), np.empty(3)
    spin_a, spin_b, moving = np.empty(3), np.empty(3), np.empty(3)
    for i in range(3):
        spin_a[i], spin_b[i] = dot(inverse_inertia[0, i], a.momentum), dot(inverse_inertia[1, i], b.momentum)
    relative_velocity(a.velocity, spin_a, arms[0], np.zeros(3), moving)
    relative_velocity(b.velocity, spin_b, arms[1], moving, before)
    approach = dot(normal, before)
    if approach >= 0.0:
        return False
    _contact_frame(normal, frame)
    _add_mobility(inverse_mass[0], inverse_inertia[0], arms[0], frame, k)
    _add_mobility(inverse_mass[1], inverse_inertia[1], arms[1], frame, k)
    for i in range(3):
        u[i] = dot(frame[i], before)
    p, share = np.empty(3), 1.0
    for _ in range(HALVINGS):
        target = -share * e * approach
        if not _stick(k, u, target, mu, p) and not _slip(k, u, target, mu, p):
            p[0] = p[1] = 0.0
            p[2] = (target - u[2]) / k[2, 2]
        work = 0.0  # sum of p . (u + u') / 2, with u' = u + k p
        for i in range(3):
            work += p[i] * (u[i] + 0.5 * dot(k[i], p))
        if work <= ROUND_OFF * -approach * p[2] or share == 0.0:
            break
        share = 0.5 * share if share > 0.02 else 0.0
    for i in range(3):
        push = p[0] * frame[0, i] + p[1] * frame[1, i] + p[2] * frame[2, i]
        moving[i] = push
        a.velocity[i] -= inverse_mass[0] * push
        b.velocity[i] += inverse_mass[1] * push
    for i in range(3):
        j, n = (i + 1) % 3, (i + 2) % 3
        a.momentum[i] -= arms[0, j] * moving[n] - arms[0, n] * moving[j]
        if inverse_mass[1] > 0.0:
            b.momentum[i] += arms[1, j] * moving[n] - arms[1, n] * moving[j]
    return True


@compiled
def _stick(k, u, target, mu, p):
    """Impulse that ends all slip; True if it lies in the friction cone."""
    r0, r1, r2 = -u[0], -u[1], target - u[2]
    c00 = k[1, 1] * k[2, 2] - k[1, 2] * k[2, 1]
    c01 = k[1, 2] * k[2, 0] - k[1, 0] * k[2, 2]
    c02 = k[1, 0] * k[2, 1] - k[1, 1] * k[2, 0]
    determinant = k[0, 0] * c00 + k[0, 1] * c01 + k[0, 2] * c02
    c11, c22 = k[0, 0] * k[2, 2] - k[0, 2] * k[2, 0], k[0, 0] * k[1, 1] - k[0, 1] * k[1, 0]
    c12 = k[0, 1] * k[2, 0] - k[0, 0] * k[2, 1]
    p[0] = (c00 * r0 + c01 * r1 + c02 * r2) / determinant
    p[1] = (c01 * r0 + c11 * r1 + c12 * r2) / determinant
    p[2] = (c02 * r0 + c12 * r1 + c22 * r2) / determinant
    return p[2] >= 0.0 and p[0] * p[0] + p[1] * p[1] <= (mu * p[2]) ** 2


@compiled
def _slip(k, u, target, mu, p):
    """Impulse on the cone's edge, opposite to the slip it leaves; True if the secant method finds it."""
    angle = math.atan2(u[1], u[0])
    error = _slip_error(k, u, target, mu, angle, p)
    previous, previous_error = angle, error
    angle += error
    for _ in range(MAX_SECANTS):
        error = _slip_error(k, u, target, mu, angle, p)
        if math.isnan(error):
            return False
        if abs(error) < ANGLE_TOLERANCE:
            return True
        slope = (error - previous_error) / (angle - previous) if angle != previous else -1.0
        previous, previous_error = angle, error
        step = -error / slope if slope < -0.1 else error
        angle += min(max(step, -1.0), 1.0)
    return _slip_by_bisection(k, u, target, mu, p)


@compiled
def _slip_by_bisection(k, u, target, mu, p):
    """As `_slip`, where the error is too steep for the secant method: look all around for where it changes its sign."""
    for i in range(SECTORS):
        low, high = 2.0 * math.pi * i / SECTORS, 2.0 * math.pi * (i + 1) / SECTORS
        at_low, at_high = _slip_error(k, u, target, mu, low, p), _slip_error(k, u, target, mu, high, p)
        if not at_low * at_high <= 0.0:
            continue
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            error = _slip_error(k, u, target, mu, middle, p)
            if at_low * error > 0.0:
                low, at_low = middle, error
            else:
                high = middle
        if abs(error) < 1e-6:  # else it wraps around from pi to -pi there
            return True
    return False


@compiled
def _slip_error(k, u, target, mu, angle, p):
    """Angle from the assumed slip direction to the one that results [rad]; NaN if the corner would not be pressed."""
    dx, dy = math.cos(angle), math.sin(angle)
    stiffness = k[2, 2] - mu * (k[2, 0] * dx + k[2, 1] * dy)
    if stiffness <= 0.0:
        return math.nan
    p[2] = (target - u[2]) / stiffness
    p[0], p[1] = -mu * p[2] * dx, -mu * p[2] * dy
    x = u[0] + k[0, 0] * p[0] + k[0, 1] * p[1] + k[0, 2] * p[2]
    y = u[1] + k[1, 0] * p[0] + k[1, 1] * p[1] + k[1, 2] * p[2]
    return math.atan2(dx * y - dy * x, dx * x + dy * y)


@compiled
def _contact_frame(normal, frame):
    """Orthonormal rows: two tangents and the normal."""
    size = math.sqrt(normal[0] * normal[0] + normal[2] * normal[2])
    if size > 0.1:
        frame[0, 0], frame[0, 1], frame[0, 2] = normal[2] / size, 0.0, -normal[0] / size
    else:
        size = math.sqrt(normal[0] * normal[0] + normal[1] * normal[1])
        frame[0, 0], frame[0, 1], frame[0, 2] = -normal[1] / size, normal[0] / size, 0.0
    for j in range(3):
        frame[2, j] = normal[j]
        a, b = (j + 1) % 3, (j + 2) % 3
        frame[1, j] = normal[a] * frame[0, b] - normal[b] * frame[0, a]
