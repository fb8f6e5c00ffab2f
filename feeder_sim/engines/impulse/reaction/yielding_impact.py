"""Impacts on a plate that gives way: as in impact.py, and every impulse changes the velocities of the plate's modes.

An impulse p on the part at contact i takes the velocity d_ij . p / m_j from mode j, where d_ij is how the contact moves
with it. The inverse effective mass of the contact gains sum over j of d_ij d_ij^T / m_j, and what one corner takes from
a mode the others see. The impulses do the work sum p . (u + u') / 2 in the frame of the surface; parts and modes
together lose just that, which is never negative.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from feeder_sim.engines.impulse.impact import (
    ENOUGH,
    FLAT,
    LEAST,
    MAX_SWEEPS,
    SHARE,
    effective_masses,
    project,
    pushed,
)
from feeder_sim.engines.impulse.single_impact import (
    HALVINGS,
    ROUND_OFF,
    added,
    impulse_at_point,
    mobility,
    tangents,
    velocity_of_point,
)
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


class Modes(NamedTuple):
    """The modes of a plate that gives way, and room for one impact.

    inverse_mass: 1 / m_j (n_shapes,) [1/kg]; carried: d_ij (contacts, n_shapes, 3) [1]; taken: velocities that the
    impact takes from the modes (n_shapes,) [m/s].
    """

    inverse_mass: NDArray[np.float64]
    carried: NDArray[np.float64]
    taken: NDArray[np.float64]


@compiled
def resolve_yielding(part, inverse_mass, inverse_inertia, contact, law, n, modes):
    """As `resolve_impact`, on a plate that gives way; fills modes.taken, from modes.carried of the first n contacts.

    Returns whether the velocities have settled, and the work of the impulses in the frame of the surface [J].
    """
    modes.taken[:] = 0.0
    if n == 1:
        solved, work = _resolve_point(part, inverse_mass, inverse_inertia, contact, law, modes)
        if solved:
            return True, work
    start, spin = vector(part.velocity), times(inverse_inertia, vector(part.momentum))
    for i in range(n):
        write_to(contact[BEFORE, i], _relative_velocity(start, spin, contact, i, modes))
    v, w, settled = _solve(start, spin, inverse_mass, inverse_inertia, contact, law, n, modes, 1.0)
    share = 1.0  # of the restitution
    work, least = _work(v, w, contact, n, modes)
    for _ in range(HALVINGS):
        if share == 0.0 or work <= least:
            break
        share = 0.5 * share if share > 0.02 else 0.0
        v, w, settled = _solve(start, spin, inverse_mass, inverse_inertia, contact, law, n, modes, share)
        work, least = _work(v, w, contact, n, modes)
    write_to(part.velocity, v)
    for i in range(n):
        add_to(part.momentum, 1.0, cross(contact[ARM, i], contact[IMPULSE, i]))
    return settled, work


@inlined
def _resolve_point(part, inverse_mass, inverse_inertia, contact, law, modes):
    """A single contact, directly; whether that applies, else nothing is changed, and the work."""
    arm, normal = vector(contact[ARM, 0]), vector(contact[NORMAL, 0])
    u = difference(velocity_of_point(part, inverse_inertia, arm), contact[VELOCITY, 0])
    a, b = tangents(normal)
    k = mobility(inverse_mass, inverse_inertia, arm, a, b, normal)
    for s in range(modes.taken.shape[0]):
        d, share = modes.carried[0, s], modes.inverse_mass[s]
        x, y, z = dot(d, a), dot(d, b), dot(d, normal)
        k = added(k, (share * x * x, share * x * y, share * x * z, share * y * y, share * y * z, share * z * z))
    before = dot(a, u), dot(b, u), dot(normal, u)
    solved, p = impulse_at_point(k, before, law[RESTITUTION, 0], law[FRICTION, 0])
    if not solved:
        return False, 0.0
    push = combine(p[0], a, p[1], b, p[2], normal)
    add_to(part.velocity, inverse_mass, push)
    add_to(part.momentum, 1.0, cross(arm, push))
    _take(push, 0, modes)
    return True, dot(p, before) + 0.5 * dot(p, times(k, p))


@compiled
def _solve(v, w, inverse_mass, inverse_inertia, contact, law, n, modes, share):
    """As in impact.py; leaves in modes.taken what the impulses take."""
    modes.taken[:] = 0.0
    scale = reach = 0.0
    for i in range(n):
        arm, normal = vector(contact[ARM, i]), vector(contact[NORMAL, i])
        along = dot(normal, contact[BEFORE, i])
        scale, reach = max(scale, abs(along)), max(reach, math.sqrt(dot(arm, arm)))
        law[TARGET, i] = -share * law[RESTITUTION, i] * along
        step_normal, step_tangent = effective_masses(inverse_mass, inverse_inertia, arm, normal)
        for s in range(modes.taken.shape[0]):
            d = modes.carried[i, s]
            yields = modes.inverse_mass[s] * dot(d, normal) ** 2
            rest = modes.inverse_mass[s] * dot(d, d) - yields
            step_normal, step_tangent = 1.0 / (1.0 / step_normal + yields), 1.0 / (1.0 / step_tangent + rest)
        law[STEP_NORMAL, i], law[STEP_TANGENT, i] = step_normal, step_tangent
        write_to(contact[IMPULSE, i], (0.0, 0.0, 0.0))
    if n >= FLAT:
        share_of_mass = 1.0 / (inverse_mass * n)
        for i in range(n):
            project(vector(contact[BEFORE, i]), share_of_mass, share_of_mass, contact, law, i)
        for i in range(n):
            v, w = pushed(v, w, inverse_mass, inverse_inertia, contact[ARM, i], contact[IMPULSE, i])
            _take(contact[IMPULSE, i], i, modes)
    tolerance = max(min(ENOUGH, SHARE * scale), LEAST) if n > 1 else ROUND_OFF * scale
    for _ in range(MAX_SWEEPS):
        last_v, last_w = v, w
        for i in range(n):
            u = _relative_velocity(v, w, contact, i, modes)
            change = project(u, law[STEP_NORMAL, i], law[STEP_TANGENT, i], contact, law, i)
            v, w = pushed(v, w, inverse_mass, inverse_inertia, contact[ARM, i], change)
            _take(change, i, modes)
        shifted, turned = difference(v, last_v), difference(w, last_w)
        if math.sqrt(dot(shifted, shifted)) + reach * math.sqrt(dot(turned, turned)) < tolerance:
            return v, w, True
    return v, w, False


@inlined
def _take(impulse, i, modes):
    """What an impulse at contact i takes from the modes."""
    for s in range(modes.taken.shape[0]):
        modes.taken[s] += modes.inverse_mass[s] * dot(modes.carried[i, s], impulse)


@inlined
def _relative_velocity(v, w, contact, i, modes):
    """Velocity of contact i of the part relative to the surface, which has lost what was taken from its modes."""
    u = difference(plus(v, 1.0, cross(w, contact[ARM, i])), contact[VELOCITY, i])
    for s in range(modes.taken.shape[0]):
        u = plus(u, modes.taken[s], modes.carried[i, s])
    return u


@compiled
def _work(v, w, contact, n, modes):
    """Work of all impulses in the frame of the surface [J], the energy the impact creates; what is as good as none."""
    total = size = 0.0
    for i in range(n):
        impulse, before, after = contact[IMPULSE, i], contact[BEFORE, i], _relative_velocity(v, w, contact, i, modes)
        for k in range(3):
            size += abs(impulse[k] * before[k])
        total += 0.5 * (dot(impulse, before) + dot(impulse, after))
    return total, ROUND_OFF * size
