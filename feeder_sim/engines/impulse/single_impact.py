"""Impact at a single point, by far the most frequent case, solved directly: it sticks, or it slips.

The impulse p changes the relative velocity u by K p, with the inverse effective mass K in a frame (a, b, normal). That
which ends all slip is tried first. Where it lies outside the friction cone the point slips, in a direction that is
found by Newton's method: it has to be opposite to the friction that it causes.
"""

from __future__ import annotations

import math

from feeder_sim.engines.impulse.vectors import add_to, combine, cross, difference, dot, times, vector
from feeder_sim.machine_code import compiled, inlined

HALVINGS = 12  # of the restitution, until an impact creates no energy
ROUND_OFF = 1e-12  # of the work of an impact
MAX_NEWTONS = 30
SECTORS, BISECTIONS = 48, 60
ANGLE_TOLERANCE = 1e-10  # of the slip direction [rad]


@compiled
def resolve_free(part, inverse_mass, inverse_inertia, arm, normal, surface_velocity, e, mu):
    """Impact of a part (`PART`) at one point of a surface; changes velocity and angular momentum in place.

    inverse_inertia: symmetric, in world axes [1/(kg m^2)]; arm: from the centre of mass to the point [m]. Same laws as
    `resolve_impact`. Returns False, with nothing changed, where the direct solution does not apply.
    """
    u = difference(velocity_of_point(part, inverse_inertia, arm), surface_velocity)
    a, b = tangents(normal)
    k = mobility(inverse_mass, inverse_inertia, arm, a, b, normal)
    solved, p = impulse_at_point(k, (dot(a, u), dot(b, u), dot(normal, u)), e, mu)
    if solved:
        push = combine(p[0], a, p[1], b, p[2], normal)
        add_to(part.velocity, inverse_mass, push)
        add_to(part.momentum, 1.0, cross(arm, push))
    return solved


@compiled
def resolve_single(a, b, inverse_mass, inverse_inertia, arms, normal, e, mu):
    """Impact of two free parts (`PART`) at one point; changes velocities and angular momenta in place.

    inverse_mass [1/kg] and inverse_inertia, symmetric and in world axes, of a and b; arms go from either centre of mass
    to the contact point [m]; normal points from a to b. Same laws as `resolve_impact`. Returns False, with nothing
    changed, where the parts do not approach each other.
    """
    velocity_a = velocity_of_point(a, inverse_inertia[0], arms[0])
    u = difference(velocity_of_point(b, inverse_inertia[1], arms[1]), velocity_a)
    if dot(normal, u) >= 0.0:
        return False
    s, t = tangents(normal)
    k = added(
        mobility(inverse_mass[0], inverse_inertia[0], arms[0], s, t, normal),
        mobility(inverse_mass[1], inverse_inertia[1], arms[1], s, t, normal),
    )
    _, p = impulse_at_point(k, (dot(s, u), dot(t, u), dot(normal, u)), e, mu)
    push = combine(p[0], s, p[1], t, p[2], normal)
    add_to(a.velocity, -inverse_mass[0], push)
    add_to(a.momentum, -1.0, cross(arms[0], push))
    if inverse_mass[1] > 0.0:
        add_to(b.velocity, inverse_mass[1], push)
        add_to(b.momentum, 1.0, cross(arms[1], push))
    return True


@inlined
def velocity_of_point(part, inverse_inertia, arm):
    """Velocity of a point of a part [m/s]."""
    turning = cross(times(inverse_inertia, vector(part.momentum)), arm)
    return part.velocity[0] + turning[0], part.velocity[1] + turning[1], part.velocity[2] + turning[2]


@inlined
def tangents(normal):
    """Two unit vectors that make an orthonormal frame with the normal as its third."""
    size = math.sqrt(normal[0] * normal[0] + normal[2] * normal[2])
    if size > 0.1:
        a = (normal[2] / size, 0.0, -normal[0] / size)
    else:
        size = math.sqrt(normal[0] * normal[0] + normal[1] * normal[1])
        a = (-normal[1] / size, normal[0] / size, 0.0)
    return a, cross(normal, a)


@inlined
def mobility(inverse_mass, inverse_inertia, arm, a, b, normal):
    """Inverse effective mass 1/m - [arm] I^-1 [arm] in the frame (a, b, normal), a symmetric matrix [1/kg]."""
    r, s, t = cross(arm, a), cross(arm, b), cross(arm, normal)
    turned_r, turned_s, turned_t = times(inverse_inertia, r), times(inverse_inertia, s), times(inverse_inertia, t)
    return (
        inverse_mass + dot(r, turned_r),
        dot(r, turned_s),
        dot(r, turned_t),
        inverse_mass + dot(s, turned_s),
        dot(s, turned_t),
        inverse_mass + dot(t, turned_t),
    )


@inlined
def added(m, n):
    return m[0] + n[0], m[1] + n[1], m[2] + n[2], m[3] + n[3], m[4] + n[4], m[5] + n[5]


@compiled
def impulse_at_point(k, u, e, mu):
    """Whether the direct solution applies, and the impulse of a point that approaches; without friction where not.

    k: inverse effective mass, u: relative velocity, both in the frame of the contact, as the impulse.
    """
    share = 1.0  # of the restitution
    solved, p = False, (0.0, 0.0, 0.0)
    for _ in range(HALVINGS + 1):
        solved, p = impulse_to(k, u, -share * e * u[2], mu)
        change = times(k, p)
        # Sum of p . (u + u') / 2, with u' = u + k p; what is as good as none counts as none.
        work = p[0] * (u[0] + 0.5 * change[0]) + p[1] * (u[1] + 0.5 * change[1]) + p[2] * (u[2] + 0.5 * change[2])
        if work <= -ROUND_OFF * u[2] * p[2] or share == 0.0:
            break
        share = 0.5 * share if share > 0.02 else 0.0
    return solved, p


@inlined
def impulse_to(k, u, target, mu):
    """As `impulse_at_point`, of a point that shall have a normal velocity [m/s], whatever the energy."""
    solved, p = _stick(k, u, target, mu)
    if not solved:
        solved, p = _slip(k, u, target, mu, p)
        if not solved:
            p = (0.0, 0.0, (target - u[2]) / k[5])
    return solved, p


@inlined
def _stick(k, u, target, mu):
    """Whether the impulse that ends all slip lies in the friction cone, and that impulse."""
    r0, r1, r2 = -u[0], -u[1], target - u[2]
    c00, c01, c02 = k[3] * k[5] - k[4] * k[4], k[4] * k[2] - k[1] * k[5], k[1] * k[4] - k[3] * k[2]
    c11, c12, c22 = k[0] * k[5] - k[2] * k[2], k[1] * k[2] - k[0] * k[4], k[0] * k[3] - k[1] * k[1]
    share = 1.0 / (k[0] * c00 + k[1] * c01 + k[2] * c02)
    p0 = (c00 * r0 + c01 * r1 + c02 * r2) * share
    p1 = (c01 * r0 + c11 * r1 + c12 * r2) * share
    p2 = (c02 * r0 + c12 * r1 + c22 * r2) * share
    return p2 >= 0.0 and p0 * p0 + p1 * p1 <= (mu * p2) ** 2, (p0, p1, p2)


@inlined
def _slip(k, u, target, mu, p):
    """Whether there is an impulse on the cone's edge opposite to the slip it leaves, and that impulse.

    p: the one that would end all slip, whose opposite is the first guess of the direction of slip (c, s).
    """
    size = math.sqrt(p[0] * p[0] + p[1] * p[1])
    if size == 0.0:
        return False, p
    c, s = -p[0] / size, -p[1] / size
    for _ in range(MAX_NEWTONS):
        stiffness = k[5] - mu * (k[2] * c + k[4] * s)
        if stiffness <= 0.0:
            break
        p2 = (target - u[2]) / stiffness
        p0, p1 = -mu * p2 * c, -mu * p2 * s
        x = u[0] + k[0] * p0 + k[1] * p1 + k[2] * p2
        y = u[1] + k[1] * p0 + k[3] * p1 + k[4] * p2
        across, along = c * y - s * x, c * x + s * y
        if abs(across) <= ANGLE_TOLERANCE * along:
            return True, (p0, p1, p2)
        # The same for a small turn of the direction.
        d2 = p2 * mu * (k[4] * c - k[2] * s) / stiffness
        d0, d1 = -mu * (d2 * c - p2 * s), -mu * (d2 * s + p2 * c)
        dx = k[0] * d0 + k[1] * d1 + k[2] * d2
        dy = k[1] * d0 + k[3] * d1 + k[4] * d2
        slope = c * dy - s * dx - along
        if along <= 0.0 or slope >= 0.0:
            break
        turn = min(max(-across / slope, -1.0), 1.0)
        c, s = c - turn * s, s + turn * c
        size = math.sqrt(c * c + s * s)
        c, s = c / size, s / size
    return _slip_by_bisection(k, u, target, mu)


@compiled
def _slip_by_bisection(k, u, target, mu):
    """As `_slip`, where Newton's method fails: look all around for where the direction's error changes its sign."""
    p = (0.0, 0.0, 0.0)
    for i in range(SECTORS):
        low, high = 2.0 * math.pi * i / SECTORS, 2.0 * math.pi * (i + 1) / SECTORS
        at_low, at_high = _slip_error(k, u, target, mu, low)[0], _slip_error(k, u, target, mu, high)[0]
        if not at_low * at_high <= 0.0:
            continue
        error = math.nan
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            error, p = _slip_error(k, u, target, mu, middle)
            if at_low * error > 0.0:
                low, at_low = middle, error
            else:
                high = middle
        if abs(error) < 1e-6:  # else it wraps around from pi to -pi there
            return True, p
    return False, p


@compiled
def _slip_error(k, u, target, mu, angle):
    """Angle from an assumed slip direction to the one that results [rad], NaN if the point would not be pressed.

    The second value is the impulse.
    """
    c, s = math.cos(angle), math.sin(angle)
    stiffness = k[5] - mu * (k[2] * c + k[4] * s)
    if stiffness <= 0.0:
        return math.nan, (0.0, 0.0, 0.0)
    p2 = (target - u[2]) / stiffness
    p0, p1 = -mu * p2 * c, -mu * p2 * s
    x = u[0] + k[0] * p0 + k[1] * p1 + k[2] * p2
    y = u[1] + k[1] * p0 + k[3] * p1 + k[4] * p2
    return math.atan2(c * y - s * x, c * x + s * y), (p0, p1, p2)
