"""Simultaneous impacts of one rigid body on a surface: Newton restitution, Coulomb friction, no stiffness.

At every touching corner i with surface normal n, relative velocity u before and u' after the impact and impulse p,

    u'.n >= -e u.n,   p.n >= 0,   complementary             (Newton restitution, simultaneous corners)
    |p_t| <= mu p.n,  p_t opposite to u'_t where it slips   (Coulomb's exact cone)

solved by projected Gauss-Seidel over the corners (Moreau, in: Nonsmooth Mechanics, 1988; Jean, CMAME 177 (1999) 235).
A single corner, by far the most frequent case, is solved directly: it sticks, or it slips in a direction found by the
secant method.
Newton's law with friction can create energy (Kane and Levinson 1985); where the work sum p.(u + u')/2 would be
positive, the restitution of that impact is lowered until it is not. With e = 0 the work is never positive.
"""

from __future__ import annotations

import math

import numpy as np

from feeder_sim.machine_code import compiled, inlined

MAX_SWEEPS = 400
# Sweeps end when no corner's velocity changes by more than ENOUGH [m/s], or a SHARE of the approach, or round-off: the
# corners of a flat part hand their loads on to each other in such changes over hundreds of sweeps.
ENOUGH, SHARE, LEAST = 3e-6, 2e-3, 1e-8
FLAT = 4  # corners at least, of a landing that is taken for flat
ROUND_OFF = 1e-12  # of the work of an impact
HALVINGS = 12  # of the restitution, until an impact creates no energy
MAX_SECANTS = 30
SECTORS, BISECTIONS = 48, 60
ANGLE_TOLERANCE = 1e-10  # of the slip direction [rad]


@compiled
def resolve_impact(velocity, momentum, inverse_mass, inverse_inertia, arm, normal, surface_velocity, n, e, mu):
    """Change velocity and angular momentum (3,) in place for impacts at the first n corners.

    inverse_inertia (3, 3) is in world axes; arm (corners, 3) goes from the centre of mass to the contact points [m];
    normal and surface_velocity have shape (corners, 3); e and mu, restitution and friction, (corners,). Returns whether
    the velocities have settled within MAX_SWEEPS.
    """
    before = np.empty((n, 3))
    spin = np.empty(3)
    for k in range(3):
        spin[k] = _dot(inverse_inertia[k], momentum)
    for i in range(n):
        relative_velocity(velocity, spin, arm[i], surface_velocity[i], before[i])
    impulse, v, w = np.zeros((n, 3)), np.empty(3), np.empty(3)
    for k in range(3):
        v[k], w[k] = velocity[k], spin[k]
    settled = _solve(v, w, inverse_mass, inverse_inertia, arm, normal, surface_velocity, before, impulse, 1.0, e, mu)
    share = 1.0  # of the restitution
    for _ in range(HALVINGS):
        if share == 0.0 or _work(v, w, arm, surface_velocity, before, impulse) <= _round_off(before, impulse):
            break
        share = 0.5 * share if share > 0.02 else 0.0
        for k in range(3):
            v[k], w[k] = velocity[k], spin[k]
        impulse[:] = 0.0
        settled = _solve(
            v, w, inverse_mass, inverse_inertia, arm, normal, surface_velocity, before, impulse, share, e, mu
        )
    for k in range(3):
        velocity[k] = v[k]
    for i in range(n):
        momentum[0] += arm[i, 1] * impulse[i, 2] - arm[i, 2] * impulse[i, 1]
        momentum[1] += arm[i, 2] * impulse[i, 0] - arm[i, 0] * impulse[i, 2]
        momentum[2] += arm[i, 0] * impulse[i, 1] - arm[i, 1] * impulse[i, 0]
    return settled


@inlined
def relative_velocity(v, w, arm, surface_velocity, out):
    """Velocity of a body point relative to the surface: v + w x arm - surface_velocity."""
    out[0] = v[0] + w[1] * arm[2] - w[2] * arm[1] - surface_velocity[0]
    out[1] = v[1] + w[2] * arm[0] - w[0] * arm[2] - surface_velocity[1]
    out[2] = v[2] + w[0] * arm[1] - w[1] * arm[0] - surface_velocity[2]


@compiled
def _solve(v, w, inverse_mass, inverse_inertia, arm, normal, surface_velocity, before, impulse, share, e, mu):
    """Sweep over the corners until the velocities stop changing; v, w, impulse are updated in place.

    Returns whether they have stopped within MAX_SWEEPS.
    """
    n = before.shape[0]
    if n == 1:
        target = -share * e[0] * _dot(normal[0], before[0])
        if _solve_single(inverse_mass, inverse_inertia, arm[0], normal[0], before[0], impulse[0], target, mu[0]):
            _apply(v, w, inverse_mass, inverse_inertia, arm[0], impulse[0])
            return True
    step_normal, step_tangent, targets = np.empty(n), np.empty(n), np.empty(n)
    scale = 0.0
    for i in range(n):
        along = _dot(normal[i], before[i])
        targets[i] = -share * e[i] * along
        scale = max(scale, abs(along))
        step_normal[i], step_tangent[i] = _steps(inverse_mass, inverse_inertia, arm[i], normal[i])
    tolerance = max(min(ENOUGH, SHARE * scale), LEAST) if n > 1 else ROUND_OFF * scale
    u, change = np.empty(3), np.empty(3)
    if n >= FLAT:  # a flat landing is nearly a shift: begin with what would stop it, shared out
        share_of_mass = 1.0 / (inverse_mass * n)
        for i in range(n):
            _project(before[i], normal[i], impulse[i], share_of_mass, share_of_mass, targets[i], mu[i], change)
        for i in range(n):
            _apply(v, w, inverse_mass, inverse_inertia, arm[i], impulse[i])
    for _ in range(MAX_SWEEPS):
        largest = 0.0
        for i in range(n):
            relative_velocity(v, w, arm[i], surface_velocity[i], u)
            _project(u, normal[i], impulse[i], step_normal[i], step_tangent[i], targets[i], mu[i], change)
            largest = max(largest, _dot(change, change) * (1.0 / step_normal[i]) ** 2)
            _apply(v, w, inverse_mass, inverse_inertia, arm[i], change)
        if largest < tolerance * tolerance:
            return True
    return False


@compiled
def _solve_single(inverse_mass, inverse_inertia, arm, normal, before, impulse, target, mu):
    """Impulse of a single corner; False, with the impulse untouched, where the direct solution does not apply.

    Works in a frame (a, b, normal); k is the inverse effective mass there: after = before + k impulse.
    """
    frame, k, u = np.empty((3, 3)), np.zeros((3, 3)), np.empty(3)
    _contact_frame(normal, frame)
    _add_mobility(inverse_mass, inverse_inertia, arm, frame, k)
    for i in range(3):
        u[i] = _dot(frame[i], before)
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
            turned[j] = _dot(inverse_inertia[j], moment[i])
        for j in range(3):
            k[i, j] += _dot(moment[j], turned)
        k[i, i] += inverse_mass


@compiled
def resolve_single(
    velocity_a,
    momentum_a,
    inverse_mass_a,
    inverse_inertia_a,
    velocity_b,
    momentum_b,
    inverse_mass_b,
    inverse_inertia_b,
    arms,
    normal,
    e,
    mu,
):
    """Impact of two free bodies at one point; changes velocities and angular momenta (3,) in place.

    inverse_inertia_a, _b (3, 3) are in world axes; arms (2, 3) go from either centre of mass to the contact point [m];
    normal (3,) points from a to b. Same laws as `resolve_impact`. Returns False, with nothing changed, where the bodies
    do not approach each other.
    """
    frame, k, u, before = np.empty((3, 3)), np.zeros((3, 3)), np.empty(3), np.empty(3)
    spin_a, spin_b, moving = np.empty(3), np.empty(3), np.empty(3)
    for i in range(3):
        spin_a[i], spin_b[i] = _dot(inverse_inertia_a[i], momentum_a), _dot(inverse_inertia_b[i], momentum_b)
    relative_velocity(velocity_a, spin_a, arms[0], np.zeros(3), moving)
    relative_velocity(velocity_b, spin_b, arms[1], moving, before)
    approach = _dot(normal, before)
    if approach >= 0.0:
        return False
    _contact_frame(normal, frame)
    _add_mobility(inverse_mass_a, inverse_inertia_a, arms[0], frame, k)
    _add_mobility(inverse_mass_b, inverse_inertia_b, arms[1], frame, k)
    for i in range(3):
        u[i] = _dot(frame[i], before)
    p, share = np.empty(3), 1.0
    for _ in range(HALVINGS):
        target = -share * e * approach
        if not _stick(k, u, target, mu, p) and not _slip(k, u, target, mu, p):
            p[0] = p[1] = 0.0
            p[2] = (target - u[2]) / k[2, 2]
        work = 0.0  # sum of p . (u + u') / 2, with u' = u + k p
        for i in range(3):
            work += p[i] * (u[i] + 0.5 * _dot(k[i], p))
        if work <= ROUND_OFF * -approach * p[2] or share == 0.0:
            break
        share = 0.5 * share if share > 0.02 else 0.0
    for i in range(3):
        push = p[0] * frame[0, i] + p[1] * frame[1, i] + p[2] * frame[2, i]
        moving[i] = push
        velocity_a[i] -= inverse_mass_a * push
        velocity_b[i] += inverse_mass_b * push
    for i in range(3):
        j, n = (i + 1) % 3, (i + 2) % 3
        momentum_a[i] -= arms[0, j] * moving[n] - arms[0, n] * moving[j]
        if inverse_mass_b > 0.0:
            momentum_b[i] += arms[1, j] * moving[n] - arms[1, n] * moving[j]
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
        # Where the error wraps around from pi to -pi there is no root.
        if not at_low * at_high <= 0.0 or abs(at_low - at_high) > math.pi:
            continue
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            error = _slip_error(k, u, target, mu, middle, p)
            if at_low * error > 0.0:
                low, at_low = middle, error
            else:
                high = middle
        return abs(error) < 1e-6
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


@inlined
def _project(u, normal, impulse, step_normal, step_tangent, target, mu, change):
    """One Gauss-Seidel step of one corner: unconstrained change of its impulse, projected onto the Coulomb cone."""
    along, pressed = _dot(normal, u), _dot(normal, impulse)
    normal_new = max(0.0, pressed - step_normal * (along - target))
    size = 0.0
    for k in range(3):  # the tangential part is what is left without the normal one
        change[k] = impulse[k] - pressed * normal[k] - step_tangent * (u[k] - along * normal[k])
        size += change[k] * change[k]
    limit, size = mu * normal_new, math.sqrt(size)
    shrink = limit / size if size > limit else 1.0
    for k in range(3):
        change[k] = normal_new * normal[k] + shrink * change[k] - impulse[k]
        impulse[k] += change[k]


@compiled
def _steps(inverse_mass, inverse_inertia, arm, normal):
    """Effective mass along the normal, and a tangential one small enough for the projection to converge.

    K = 1/m - [arm] I^-1 [arm] is the inverse effective mass; what its trace leaves beside the normal bounds the rest.
    """
    trace = 3.0 * inverse_mass
    trace += _quadratic(inverse_inertia, 0.0, arm[2], -arm[1])  # arm x e_k
    trace += _quadratic(inverse_inertia, -arm[2], 0.0, arm[0])
    trace += _quadratic(inverse_inertia, arm[1], -arm[0], 0.0)
    x = arm[1] * normal[2] - arm[2] * normal[1]
    y = arm[2] * normal[0] - arm[0] * normal[2]
    z = arm[0] * normal[1] - arm[1] * normal[0]
    along = inverse_mass + _quadratic(inverse_inertia, x, y, z)
    return 1.0 / along, 1.0 / (trace - along)


@compiled
def _quadratic(matrix, x, y, z):
    """(x, y, z) . matrix (x, y, z)."""
    return (
        x * (matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2] * z)
        + y * (matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2] * z)
        + z * (matrix[2, 0] * x + matrix[2, 1] * y + matrix[2, 2] * z)
    )


@inlined
def _apply(v, w, inverse_mass, inverse_inertia, arm, impulse):
    """Change linear and angular velocity by an impulse at the end of an arm."""
    x = arm[1] * impulse[2] - arm[2] * impulse[1]
    y = arm[2] * impulse[0] - arm[0] * impulse[2]
    z = arm[0] * impulse[1] - arm[1] * impulse[0]
    for k in range(3):
        v[k] += inverse_mass * impulse[k]
        w[k] += inverse_inertia[k, 0] * x + inverse_inertia[k, 1] * y + inverse_inertia[k, 2] * z


@compiled
def _work(v, w, arm, surface_velocity, before, impulse):
    """Work of all impulses, in the frame of the surface: the energy the impact creates."""
    total, after = 0.0, np.empty(3)
    for i in range(before.shape[0]):
        relative_velocity(v, w, arm[i], surface_velocity[i], after)
        for k in range(3):
            total += 0.5 * impulse[i, k] * (before[i, k] + after[k])
    return total


@compiled
def _round_off(before, impulse):
    """Work [J] that is as good as none."""
    total = 0.0
    for i in range(before.shape[0]):
        for k in range(3):
            total += abs(impulse[i, k] * before[i, k])
    return ROUND_OFF * total


@inlined
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
