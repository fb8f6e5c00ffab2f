"""Simultaneous impacts of one rigid body on a surface: Newton restitution, Coulomb friction, no stiffness.

At every touching corner i with surface normal n, relative velocity u before and u' after the impact and impulse p,

    u'.n >= -e u.n,   p.n >= 0,   complementary             (Newton restitution, simultaneous corners)
    |p_t| <= mu p.n,  p_t opposite to u'_t where it slips   (Coulomb's exact cone)

solved by projected Gauss-Seidel over the corners (Moreau, in: Nonsmooth Mechanics, 1988; Jean, CMAME 177 (1999) 235).
A single corner is solved directly (single_impact.py).
Newton's law with friction can create energy (Kane and Levinson 1985); where the work sum p.(u + u')/2 would be
positive, the restitution of that impact is lowered until it is not. With e = 0 the work is never positive.
"""

from __future__ import annotations

import math

import numpy as np

from feeder_sim.engines.impulse.single_impact import HALVINGS, ROUND_OFF, solve_single
from feeder_sim.engines.impulse.state import (
    ARM,
    FRICTION,
    NORMAL,
    RESTITUTION,
    VELOCITY,
    dot,
    relative_velocity,
)
from feeder_sim.machine_code import compiled, inlined

MAX_SWEEPS = 400
# Sweeps end when no corner's velocity changes by more than ENOUGH [m/s], or a SHARE of the approach, or round-off: the
# corners of a flat part hand their loads on to each other in such changes over hundreds of sweeps.
ENOUGH, SHARE, LEAST = 3e-6, 2e-3, 1e-8
FLAT = 4  # corners at least, of a landing that is taken for flat


@compiled
def resolve_impact(part, inverse_mass, inverse_inertia, contact, law, n):
    """Change velocity and angular momentum of a part (`PART`) in place for impacts at the first n corners.

    inverse_inertia (3, 3) is in world axes [1/(kg m^2)]. contact (3, corners, 3) holds in ARM the ways from the centre
    of mass to the contact points [m], in NORMAL those of the surface and in VELOCITY how it moves there [m/s]; law
    (2, corners) RESTITUTION and FRICTION. Returns whether the velocities have settled within MAX_SWEEPS.
    """
    arm, surface_velocity = contact[ARM], contact[VELOCITY]
    before, start = np.empty((n, 3)), np.empty((2, 3))
    for k in range(3):
        start[0, k], start[1, k] = part.velocity[k], dot(inverse_inertia[k], part.momentum)
    for i in range(n):
        relative_velocity(start[0], start[1], arm[i], surface_velocity[i], before[i])
    impulse, motion = np.zeros((n, 3)), start.copy()
    settled = _solve(motion, inverse_mass, inverse_inertia, contact, law, before, impulse, 1.0)
    share = 1.0  # of the restitution
    for _ in range(HALVINGS):
        if share == 0.0 or _work(motion, arm, surface_velocity, before, impulse) <= _round_off(before, impulse):
            break
        share = 0.5 * share if share > 0.02 else 0.0
        for k in range(3):  # numba compiles the error message of a slice for seconds
            motion[0, k], motion[1, k] = start[0, k], start[1, k]
        impulse[:] = 0.0
        settled = _solve(motion, inverse_mass, inverse_inertia, contact, law, before, impulse, share)
    for k in range(3):
        part.velocity[k] = motion[0, k]
    for i in range(n):
        part.momentum[0] += arm[i, 1] * impulse[i, 2] - arm[i, 2] * impulse[i, 1]
        part.momentum[1] += arm[i, 2] * impulse[i, 0] - arm[i, 0] * impulse[i, 2]
        part.momentum[2] += arm[i, 0] * impulse[i, 1] - arm[i, 1] * impulse[i, 0]
    return settled


@compiled
def _solve(motion, inverse_mass, inverse_inertia, contact, law, before, impulse, share):
    """Sweep over the corners until the velocities stop changing; motion (2, 3) and impulse are updated in place.

    motion holds velocity and angular velocity; share is that of the restitution. Returns whether the velocities have
    stopped changing within MAX_SWEEPS.
    """
    n = before.shape[0]
    arm, normal, surface_velocity, e, mu = (
        contact[ARM],
        contact[NORMAL],
        contact[VELOCITY],
        law[RESTITUTION],
        law[FRICTION],
    )
    v, w = motion[0], motion[1]
    if n == 1:
        target = -share * e[0] * dot(normal[0], before[0])
        if solve_single(inverse_mass, inverse_inertia, arm[0], normal[0], before[0], impulse[0], target, mu[0]):
            _apply(v, w, inverse_mass, inverse_inertia, arm[0], impulse[0])
            return True
    step_normal, step_tangent, targets = np.empty(n), np.empty(n), np.empty(n)
    scale = 0.0
    for i in range(n):
        along = dot(normal[i], before[i])
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
            largest = max(largest, dot(change, change) * (1.0 / step_normal[i]) ** 2)
            _apply(v, w, inverse_mass, inverse_inertia, arm[i], change)
        if largest < tolerance * tolerance:
            return True
    return False


@inlined
def _project(u, normal, impulse, step_normal, step_tangent, target, mu, change):
    """One Gauss-Seidel step of one corner: unconstrained change of its impulse, projected onto the Coulomb cone."""
    along, pressed = dot(normal, u), dot(normal, impulse)
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
def _work(motion, arm, surface_velocity, before, impulse):
    """Work of all impulses, in the frame of the surface: the energy the impact creates."""
    total, after = 0.0, np.empty(3)
    for i in range(before.shape[0]):
        relative_velocity(motion[0], motion[1], arm[i], surface_velocity[i], after)
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
