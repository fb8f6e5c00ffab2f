"""Poisson's restitution: an impulse of compression, of which every contact gets a share e once more.

At one point Coulomb's friction is integrated over the course of the impact: the normal impulse grows in small pieces,
each of which ends no later than the slip (Routh 1860; Keller, J. Appl. Mech. 53 (1986) 1; in a plane that is exact,
Wang and Mason, J. Appl. Mech. 59 (1992) 635). Several at once have no such course, since nothing says how fast one
impulse grows beside another. They have two phases (Pfeiffer and Glocker, Multibody Dynamics with Unilateral Contacts,
Wiley 1996, ch. 8), in the terms of contact_problem.py:

    compression   u' = u + W p     by the laws there without restitution
    restitution   u" = u' + W q    q.n = e p.n,   |q_t| <= mu q.n,   q_t opposite to u"_t where it slips

Where restitution brings a contact to approach, it is stopped without restitution of its own. With normal impulses that
are given, Coulomb's friction is what leaves the least energy, of all that its limits allow. Among that is e p_t; so the
energy changes by -(1 - e^2) p.W p / 2 or less where all contacts have one e. Where they have not, the restitution of
all is lowered until no energy is created.
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
from feeder_sim.engines.impulse.vectors import dot, plus, times
from feeder_sim.machine_code import compiled, inlined, uncounted

STEPS = 50  # of Newton's, for the friction of one contact
PIECES, MOST_PIECES = 32, 500  # of the normal impulse of one point
STOPPED = 1e-12  # of its speed: slip that has ended
SWEEPS = 300  # at most; each leaves less energy than the one before, wherever they end
EXACT = 1e-14  # of a limit of friction


@compiled
def poisson_impulse(k, u, e, mu):
    """As `impulse_at_point` of single_impact.py, by Poisson's law."""
    solved, compression = _compression(k, u, mu)
    if not solved:
        return False, (0.0, 0.0, -(1.0 + e) * u[2] / k[5])
    share, p = 1.0, compression
    for _ in range(HALVINGS + 1):
        p = _with_restitution(k, u, compression, share * e * compression[2], mu)
        change = times(k, p)
        if dot(p, plus(u, 0.5, change)) <= -ROUND_OFF * u[2] * p[2] or share == 0.0:
            break
        share = 0.5 * share if share > 0.02 else 0.0
    after = plus(u, 1.0, times(k, p))
    if after[2] < ROUND_OFF * u[2]:
        solved, rest = impulse_to(k, after, 0.0, mu)
        p = plus(p, 1.0, rest)
    return solved, p


@compiled
def _compression(k, u, mu):
    """Whether an impulse ends the approach, and that impulse."""
    p, v, solved = (0.0, 0.0, 0.0), u, False
    for i in range(MOST_PIECES):
        solved, rest = impulse_to(k, v, 0.0, mu)
        piece = min(-u[2] / k[5] / PIECES, _end_of_slip(k, v, mu))
        if solved and (rest[2] <= piece or i == MOST_PIECES - 1):
            return True, plus(p, 1.0, rest)
        p = plus(p, 1.0, _piece(k, v, piece, mu))
        v = plus(u, 1.0, times(k, p))
    return solved, p


@compiled
def _with_restitution(k, u, p, left, mu):
    """An impulse p with a further normal impulse, and the friction of that."""
    most = left / PIECES
    for i in range(MOST_PIECES):
        v = plus(u, 1.0, times(k, p))
        piece = min(most, left, _end_of_slip(k, v, mu))
        if i == MOST_PIECES - 1:
            piece = left
        p = plus(p, 1.0, _piece(k, v, piece, mu))
        left -= piece
        if left <= 0.0:
            break
    return p


@inlined
def _piece(k, v, normal, mu):
    """A normal impulse with its friction, at a point that moves with v."""
    x, y = least_energy((k[0], k[1], k[3]), (v[0] + k[2] * normal, v[1] + k[4] * normal), mu * normal)
    return x, y, normal


@inlined
def _end_of_slip(k, v, mu):
    """The normal impulse after which slip in one direction would end, or is least; infinite where it grows."""
    size = math.sqrt(v[0] * v[0] + v[1] * v[1])
    if size <= STOPPED * (size + abs(v[2])):
        return math.inf
    c, s = v[0] / size, v[1] / size
    x, y = k[2] - mu * (k[0] * c + k[1] * s), k[4] - mu * (k[1] * c + k[3] * s)
    slows = -(c * x + s * y)
    return size * slows / (x * x + y * y) if slows > 0.0 else math.inf


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
