"""Who presses whom: the members of a component, the points at which they touch, and those as contacts."""

from __future__ import annotations

from feeder_sim.engines.impulse.contact_problem import (
    ARM_FIRST,
    ARM_SECOND,
    FRICTION,
    IMPULSE,
    MOMENT,
    NORMAL,
    RESTITUTION,
    ROLLING,
    TARGET,
    VELOCITY,
)
from feeder_sim.engines.impulse.fixed import place_at_fixture
from feeder_sim.engines.impulse.pairs.collision import check_pair
from feeder_sim.engines.impulse.pairs.due import SLACK
from feeder_sim.engines.impulse.scratch import UNRESOLVED
from feeder_sim.engines.impulse.vectors import cross, difference, dot, plus, vector, write_to
from feeder_sim.machine_code import inlined, uncounted

NOTHING = (0.0, 0.0, 0.0)


@uncounted
def members_of(i, crowd, together):
    """Find the members of the component of part i, and the pairs that press; returns their numbers."""
    islands, pairs, member = crowd.islands, crowd.pairs, together.work.member
    n, m, k = 1, 0, 0
    member[0], together.body[i] = i, 0
    while k < n:
        j = member[k]
        for x in range(islands.first_touching[j], islands.first_touching[j + 1]):
            pair = pairs[islands.pair[islands.touching[x]]]
            if pair.pressing == 0:
                continue
            other = pair.b if pair.a == j else pair.a
            if not is_fixture(other, crowd) and together.body[other] < 0:  # which joins nobody
                together.body[other] = n
                member[n] = other
                n += 1
            if pair.a == j and m < together.pair.shape[0]:
                together.pair[m] = islands.touching[x]
                m += 1
            elif pair.a == j:
                together.work.counts[UNRESOLVED] += 1
        k += 1
    return n, m


@uncounted
def evaluate_pairs(m, crowd, tools):
    """Find the points at which pairs touch; a pair that is apart presses no more."""
    together, parts, kinds, points = tools.together, crowd.parts, crowd.kinds, 0
    for x in range(m):
        together.first_point[x] = points
        pair = crowd.pairs[crowd.islands.pair[together.pair[x]]]
        a, b = parts[pair.a], parts[pair.b]
        gap, count, origin = check_pair(pair, a, kinds.record[a.kind], b, kinds.record[b.kind], kinds, tools)
        together.gap[x], together.origin[x] = gap, origin
        for end in range(2):
            write_to(together.along[x, end], vector(tools.meeting.along[end]))
        if gap > SLACK:
            pair.pressing = count = 0
        for y in range(count):
            write_to(together.point[points], tools.meeting.point[y])
            points += 1
    together.first_point[m] = points


@inlined
def is_fixture(i, crowd):
    """Whether part i of a crowd is a fixture; those come behind the free parts."""
    return i >= crowd.loads.shape[0]


@inlined
def gather_pair(c, x, y, crowd, together):
    """Make point y of pair x contact c; returns the speed at which its parts approach there [m/s].

    With a fixture the part is the second body, and the normal leads to it.
    """
    pair, contacts, bodies = (
        crowd.pairs[crowd.islands.pair[together.pair[x]]],
        together.work.contacts,
        together.work.bodies,
    )
    a, b = crowd.parts[pair.a], crowd.parts[pair.b]
    first, second = together.body[pair.a], together.body[pair.b]
    arm, normal = vector(together.point[y]), vector(pair.axis)
    if is_fixture(pair.b, crowd):
        at_fixture = place_at_fixture(c, arm, normal, a, b, crowd.kinds.record[b.kind], first, contacts)
        u = plus(bodies.velocity[first], 1.0, cross(bodies.spin[first], arm))
        return dot(difference(u, at_fixture), normal)
    other = plus(difference(a.position, b.position), 1.0, arm)
    contacts.body[c, 0], contacts.body[c, 1] = first, second
    write_to(contacts.vector[ARM_FIRST, c], arm)
    write_to(contacts.vector[ARM_SECOND, c], other)
    write_to(contacts.vector[NORMAL, c], normal)
    for k in (VELOCITY, IMPULSE, MOMENT):
        write_to(contacts.vector[k, c], NOTHING)
    contacts.number[RESTITUTION, c] = contacts.number[ROLLING, c] = contacts.number[TARGET, c] = 0.0
    contacts.number[FRICTION, c] = crowd.kinds.record[a.kind].friction[1]
    u = plus(bodies.velocity[second], 1.0, cross(bodies.spin[second], other))
    u = difference(u, plus(bodies.velocity[first], 1.0, cross(bodies.spin[first], arm)))
    return -dot(u, normal)
