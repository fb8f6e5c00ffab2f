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

from feeder_sim.engines.impulse.single_impact import HALVINGS, ROUND_OFF, resolve_free
from feeder_sim.engines.impulse.state import (
    ARM,
    BEFORE,
    FRICTION,
    IMPULSE,
    NORMAL,
    RESTITUTION,
    STEP_NORMAL,
    STEP_TANGENT,
    TARGET,
    VELOCITY,
)
from feeder_sim.engines.impulse.vectors import add_to, combine, cross, difference, dot, plus, times, vector, write_to
from feeder_sim.machine_code import compiled, inlined

MAX_SWEEPS = 400
# Sweeps end when one of them changes the motion of no point by more than ENOUGH [m/s], or a SHARE of the approach, or
# round-off. What the corners of a flat part hand on to each other meanwhile, over hundreds of sweeps, does not count.
ENOUGH, SHARE, LEAST = 3e-6, 3e-4, 1e-8
FLAT = 4  # corners at least, of a landing that is taken for flat


@compiled
def resolve_impact(part, inverse_mass, inverse_inertia, contact, law, n):
    """Change velocity and angular momentum of a part (`PART`) in place for impacts at the first n corners.

    inverse_inertia: symmetric, in world axes [1/(kg m^2)]. contact (5, corners, 3) holds in ARM the ways from the
    centre of mass to the contact points [m], in NORMAL those of the surface and in VELOCITY how it moves there [m/s];
    law (5, corners) RESTITUTION and FRICTION. The other rows are overwritten. Returns whether the velocities have
    settled within MAX_SWEEPS.
    """
    if n == 1 and resolve_free(
        part,
        inverse_mass,
        inverse_inertia,
        vector(contact[ARM, 0]),
        vector(contact[NORMAL, 0]),
        vector(contact[VELOCITY, 0]),
        law[RESTITUTION, 0],
        law[FRICTION, 0],
    ):
        return True
    start, spin = vector(part.velocity), times(inverse_inertia, vector(part.momentum))
    for i in range(n):
        write_to(contact[BEFORE, i], _relative_velocity(start, spin, contact, i))
    v, w, settled = _solve(start, spin, inverse_mass, inverse_inertia, contact, law, n, 1.0)
    share = 1.0  # of the restitution
    for _ in range(HALVINGS):
        work, least = _work(v, w, contact, n)
        if share == 0.0 or work <= least:
            break
        share = 0.5 * share if share > 0.02 else 0.0
        v, w, settled = _solve(start, spin, inverse_mass, inverse_inertia, contact, law, n, share)
    write_to(part.velocity, v)
    for i in range(n):
        add_to(part.momentum, 1.0, cross(contact[ARM, i], contact[IMPULSE, i]))
    return settled


@compiled
def _solve(v, w, inverse_mass, inverse_inertia, contact, law, n, share):
    """Sweep over the corners until the motion stops changing; share is that of the restitution.

    Returns velocity and angular velocity, and whether they have stopped changing within MAX_SWEEPS.
    """
    scale = reach = 0.0
    for i in range(n):
        arm, normal = vector(contact[ARM, i]), vector(contact[NORMAL, i])
        along = dot(normal, contact[BEFORE, i])
        scale, reach = max(scale, abs(along)), max(reach, math.sqrt(dot(arm, arm)))
        law[TARGET, i] = -share * law[RESTITUTION, i] * along
        law[STEP_NORMAL, i], law[STEP_TANGENT, i] = effective_masses(inverse_mass, inverse_inertia, arm, normal)
        write_to(contact[IMPULSE, i], (0.0, 0.0, 0.0))
    if n >= FLAT:  # a flat landing is nearly a shift: begin with what would stop it, shared out
        share_of_mass = 1.0 / (inverse_mass * n)
        for i in range(n):
            project(vector(contact[BEFORE, i]), share_of_mass, share_of_mass, contact, law, i)
        for i in range(n):
            v, w = pushed(v, w, inverse_mass, inverse_inertia, contact[ARM, i], contact[IMPULSE, i])
    tolerance = max(min(ENOUGH, SHARE * scale), LEAST) if n > 1 else ROUND_OFF * scale
    for _ in range(MAX_SWEEPS):
        last_v, last_w = v, w
        for i in range(n):
            u = _relative_velocity(v, w, contact, i)
            change = project(u, law[STEP_NORMAL, i], law[STEP_TANGENT, i], contact, law, i)
            v, w = pushed(v, w, inverse_mass, inverse_inertia, contact[ARM, i], change)
        shifted, turned = difference(v, last_v), difference(w, last_w)
        if math.sqrt(dot(shifted, shifted)) + reach * math.sqrt(dot(turned, turned)) < tolerance:
            return v, w, True
    return v, w, False


@inlined
def project(u, step_normal, step_tangent, contact, law, i):
    """One Gauss-Seidel step of corner i, which moves at u: its impulse, changed freely, projected onto Coulomb's cone.

    Returns the change.
    """
    normal, impulse = vector(contact[NORMAL, i]), vector(contact[IMPULSE, i])
    along, pressed = dot(normal, u), dot(normal, impulse)
    normal_new = max(0.0, pressed - step_normal * (along - law[TARGET, i]))
    # The tangential part is what is left without the normal one.
    tangent = combine(1.0, impulse, -step_tangent, u, step_tangent * along - pressed, normal)
    size, limit = math.sqrt(dot(tangent, tangent)), law[FRICTION, i] * normal_new
    shrink = limit / size if size > limit else 1.0
    change = combine(normal_new, normal, shrink, tangent, -1.0, impulse)
    add_to(contact[IMPULSE, i], 1.0, change)
    return change


@compiled
def effective_masses(inverse_mass, inverse_inertia, arm, normal):
    """Effective mass along the normal, and a tangential one small enough for the projection to converge.

    K = 1/m - [arm] I^-1 [arm] is the inverse effective mass; what its trace leaves beside the normal bounds the rest.
    """
    trace = 3.0 * inverse_mass
    trace += _quadratic(inverse_inertia, (0.0, arm[2], -arm[1]))  # arm x e_k
    trace += _quadratic(inverse_inertia, (-arm[2], 0.0, arm[0]))
    trace += _quadratic(inverse_inertia, (arm[1], -arm[0], 0.0))
    along = inverse_mass + _quadratic(inverse_inertia, cross(arm, normal))
    return 1.0 / along, 1.0 / (trace - along)


@inlined
def _quadratic(matrix, a):
    """The scalar a . matrix a."""
    return dot(a, times(matrix, a))


@inlined
def pushed(v, w, inverse_mass, inverse_inertia, arm, impulse):
    """Velocity and angular velocity after an impulse at the end of an arm."""
    turned = times(inverse_inertia, cross(arm, impulse))
    return plus(v, inverse_mass, impulse), plus(w, 1.0, turned)


@inlined
def _relative_velocity(v, w, contact, i):
    """Velocity of corner i relative to the surface."""
    return difference(plus(v, 1.0, cross(w, contact[ARM, i])), contact[VELOCITY, i])


@compiled
def _work(v, w, contact, n):
    """Work of all impulses in the frame of the surface, the energy the impact creates; and what is as good as none."""
    total = size = 0.0
    for i in range(n):
        impulse, before, after = contact[IMPULSE, i], contact[BEFORE, i], _relative_velocity(v, w, contact, i)
        for k in range(3):
            size += abs(impulse[k] * before[k])
        total += 0.5 * (dot(impulse, before) + dot(impulse, after))
    return total, ROUND_OFF * size
