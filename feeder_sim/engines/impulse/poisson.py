"""Poisson's restitution: an impulse of compression, of which every contact gets a share e once more.

Two phases, each at zero time (Pfeiffer and Glocker, Multibody Dynamics with Unilateral Contacts, Wiley 1996, ch. 8), in
the terms of contact_problem.py:

    compression   u' = u + W p     by the laws there without restitution
    restitution   u" = u' + W q    q.n = e p.n,   |q_t| <= mu q.n,   q_t opposite to u"_t where it slips

Where restitution brings a contact to approach, it is stopped without restitution of its own. With normal impulses that
are given, Coulomb's friction is what leaves the least energy, of all that its limits allow. Among that is e p_t; so the
energy changes by -(1 - e^2) p.W p / 2 or less where all contacts have one e. Where they have not, the restitution of
all is lowered until no energy is created. Friction is of the slip at the end of a phase; where slip reverses within
one, the integral over the course of the impact (Routh 1860; Wang and Mason, J. Appl. Mech. 59 (1992) 635) has less.
"""

from __future__ import annotations

import math

from feeder_sim.engines.impulse.contact_equations import (
    COUNT,
    EARLIER,
    FORCES,
    IMPULSES,
    NOW,
    RATE,
    START,
    N,
    accuracy,
    begin,
    copy,
    coupling,
    make_motion,
    place_of,
    push_along,
    relative,
)
from feeder_sim.engines.impulse.contact_problem import (
    FRICTION,
    RESTITUTION,
    ROLLING,
    find_impulses,
    lay_out,
    push_alone,
    seen_alone,
    work_of,
    write_out,
)
from feeder_sim.engines.impulse.single_impact import HALVINGS, ROUND_OFF, impulse_to
from feeder_sim.engines.impulse.vectors import plus, times
from feeder_sim.machine_code import compiled, inlined, uncounted

STEPS = 50  # of Newton's, for the friction of one contact
SWEEPS = 300  # at most; each leaves less energy than the one before, wherever they end
EXACT = 1e-14  # of a limit of friction


@compiled
def poisson_impulse(k, u, e, mu):
    """As `impulse_at_point` of single_impact.py, by Poisson's law."""
    solved, p = impulse_to(k, u, 0.0, mu)
    if not solved:
        return False, (0.0, 0.0, (1.0 + e) * p[2])
    q = e * p[2]
    after = plus(u, 1.0, times(k, (p[0], p[1], p[2] + q)))
    x, y = least_energy((k[0], k[1], k[3]), (after[0], after[1]), mu * q)
    p = (p[0] + x, p[1] + y, p[2] + q)
    after = plus(u, 1.0, times(k, p))
    if after[2] < ROUND_OFF * u[2]:
        solved, q = impulse_to(k, after, 0.0, mu)
        p = plus(p, 1.0, q)
    return solved, p


@inlined
def least_energy(k, u, limit):
    """The tangential impulse of no more than a limit [N s] that leaves least energy of a contact that moves with u.

    k: inverse effective mass along the two tangents (first, mixed, second). Where the limit counts it is
    -(k + damping)^-1 u, with the damping at which it has the size of the limit (More and Sorensen, SIAM J. Sci. Stat.
    Comput. 4 (1983) 553).
    """
    x = y = damping = 0.0
    for _ in range(STEPS):
        a, b = k[0] + damping, k[2] + damping
        determinant = a * b - k[1] * k[1]
        x, y = (k[1] * u[1] - b * u[0]) / determinant, (k[1] * u[0] - a * u[1]) / determinant
        size = math.sqrt(x * x + y * y)
        if size <= limit * (1.0 + EXACT) or limit <= 0.0:
            break
        slope = (b * x * x - 2.0 * k[1] * x * y + a * y * y) / (determinant * size)
        damping += (size / limit - 1.0) * size / slope
    size = math.sqrt(x * x + y * y)
    share = max(limit, 0.0) / size if size > limit else 1.0
    return share * x, share * y


@uncounted
def poisson_impact(bodies, contacts, n, closely=0.0, near=0.0):
    """As `impact` of contact_problem.py, by Poisson's law. Leaves TARGET as it is."""
    number = contacts.number
    if n == 1 and number[ROLLING, 0] <= 0.0:
        frame, k, u = seen_alone(0, bodies, contacts)
        solved, p = True, (0.0, 0.0, 0.0)
        if u[2] < 0.0:
            solved, p = poisson_impulse(k, u, number[RESTITUTION, 0], number[FRICTION, 0])
        if solved:
            push_alone(0, bodies, contacts, frame, p)
            return True
    size = lay_out(bodies, contacts, n)
    settled = find_impulses(contacts, n, size, closely, near, 0.0)
    if settled:
        _restore(contacts, n, size, closely)
        settled = _stop(contacts, n, size, closely, near)
    write_out(bodies, contacts, n)
    return settled


@uncounted
def _restore(contacts, n, size, closely):
    """Add the impulses of restitution to those of compression, and keep those."""
    room, share = contacts.room, 1.0
    copy(room, IMPULSES, EARLIER, n)
    for _ in range(HALVINGS + 1):
        for i in range(n):
            for c in range(place_of(room, i, COUNT)):
                gain = 1.0 + share * contacts.number[RESTITUTION, i]
                room.value[IMPULSES, i, c] = gain * room.value[EARLIER, i, c]
        make_motion(room, n, size)
        _slide(contacts, n, closely, share)
        work, _, trace = work_of(room, n, closely)
        if work <= trace or share == 0.0:
            break
        share = 0.5 * share if share > 0.02 else 0.0


@uncounted
def _slide(contacts, n, closely, share):
    """Friction of restitution, from e times that of compression: sweeps that lower the energy contact by contact."""
    room, enough = contacts.room, accuracy(contacts.room, n, closely)[0]
    for _ in range(SWEEPS):
        most = 0.0
        for i in range(n):
            p, earlier, rate = room.value[IMPULSES, i], room.value[EARLIER, i], room.value[RATE, i]
            pressed = share * contacts.number[RESTITUTION, i] * earlier[N]
            for c in range(0, place_of(room, i, COUNT), FORCES):
                k = rate[c], coupling(room, i, c, c + 1), rate[c + 1]
                x, y = p[c] - earlier[c], p[c + 1] - earlier[c + 1]
                u = relative(room, i, c) - k[0] * x - k[1] * y, relative(room, i, c + 1) - k[1] * x - k[2] * y
                new_x, new_y = least_energy(k, u, room.limit[i, c // FORCES] * pressed)
                push_along(room, i, c, new_x - x, NOW)
                push_along(room, i, c + 1, new_y - y, NOW)
                p[c], p[c + 1] = earlier[c] + new_x, earlier[c + 1] + new_y
                change = max(abs(new_x - x) * math.sqrt(k[0]), abs(new_y - y) * math.sqrt(k[2]))
                most = max(most, change * math.sqrt(rate[N]))
        if most <= enough:
            return


@uncounted
def _stop(contacts, n, size, closely, near):
    """Stop what restitution has brought to approach; returns whether every contact obeys its laws."""
    room, lowest = contacts.room, 0.0
    enough = accuracy(room, n, closely)[0]
    for i in range(n):
        lowest = min(lowest, relative(room, i, N))
    if lowest >= -max(enough, near):
        return True
    copy(room, IMPULSES, EARLIER, n)
    for x in range(size):
        room.motion[START, x] = room.motion[NOW, x]
    begin(room, n, size)
    settled = find_impulses(contacts, n, size, closely, near, 0.0)
    for i in range(n):
        for c in range(place_of(room, i, COUNT)):
            room.value[IMPULSES, i, c] += room.value[EARLIER, i, c]
    return settled
