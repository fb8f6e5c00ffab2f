"""Impacts of a part at a fixture, the second of a pair: as collision.py, against the world as it moves there."""

from __future__ import annotations

import numpy as np

from feeder_sim.engines.impulse.contact_problem import RESTITUTION
from feeder_sim.engines.impulse.fixed import place_at_fixture, velocity_at
from feeder_sim.engines.impulse.impact import resolve_impact
from feeder_sim.engines.impulse.impact_law import BETWEEN_PARTS, restitution_at
from feeder_sim.engines.impulse.pairs.collision import LAID_IN, LEFT, LITTLE, check_pair
from feeder_sim.engines.impulse.single_impact import velocity_of_point
from feeder_sim.engines.impulse.state import inverse_inertia
from feeder_sim.engines.impulse.vectors import add_to, difference, dot, plus, vector
from feeder_sim.machine_code import inlined, uncounted

REACHED = 2e-9  # [m]; a gap that is none
NEARLY = 1.0 - 1e-6  # of the way there, on which a part turns


@uncounted
def meet_fixture(pair, parts, kinds, slow, tools):
    """As `meet` of collision.py; a part that is still apart is looked at again after a wait [s], which comes third."""
    a, b = parts[pair.a], parts[pair.b]
    kind_a, kind_b = kinds.record[a.kind], kinds.record[b.kind]
    gap, n, _ = check_pair(pair, a, kind_a, b, kind_b, kinds, tools)
    approach = -parting_from_fixture(pair, parts, kinds, n, tools)
    if gap < -LAID_IN:
        add_to(a.position, -LITTLE, vector(pair.axis))
    if n == 0 or approach <= LEFT:
        return gap < -LAID_IN, n, 0.0
    if gap > REACHED and approach > slow:
        return False, n, NEARLY * gap / approach
    e = restitution_at(kind_b, BETWEEN_PARTS, approach)
    e = 0.0 if e * approach < slow * (1.0 - e) else e  # all bounces from there on are summed
    contacts, tools.work.member[0] = tools.work.contacts, pair.a
    for i in range(n):
        place_at_fixture(i, vector(tools.meeting.point[i]), vector(pair.axis), a, b, kind_b, 0, contacts)
        contacts.number[RESTITUTION, i] = e
    resolve_impact(parts, kinds, 1, n, (0.0, 0.0), tools.work)
    return True, n, 0.0


@inlined
def parting_from_fixture(pair, parts, kinds, n, tools):
    """The least speed [m/s] at which one of n points of a part moves away from a fixture."""
    a, b = parts[pair.a], parts[pair.b]
    inverse, from_b, least = inverse_inertia(a, kinds.record[a.kind]), difference(a.position, b.position), np.inf
    for i in range(n):
        of_a = velocity_of_point(a, inverse, tools.meeting.point[i])
        of_b = velocity_at(b, plus(from_b, 1.0, tools.meeting.point[i]))
        least = min(least, dot(vector(pair.axis), difference(of_b, of_a)))
    return least
