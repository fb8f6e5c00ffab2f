"""When two parts can meet at the earliest, of which each may be pressed, ride the plate, or fly."""

from __future__ import annotations

import math

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.impulse.fixed import move_fixture, own_speed
from feeder_sim.engines.impulse.free_part.ride import move_to
from feeder_sim.engines.impulse.joint.members import is_fixture
from feeder_sim.engines.impulse.pairs.due import SLACK, bound_of_hulls, bound_of_spheres
from feeder_sim.engines.impulse.state import FIXED, FOLLOWING, FREE, PRESSED, flies
from feeder_sim.engines.impulse.vectors import dot
from feeder_sim.machine_code import inlined, uncounted

ENTERED = 0.2 * SLACK
CARRIED = 3.0  # times the fastest speed of the plate: what rides it may be thrown to while nobody looks


@uncounted
def pair_bound(pair, t, crowd, plate):
    """As `meeting_bound`."""
    parts, kinds = crowd.parts, crowd.kinds
    a, b = parts[pair.a], parts[pair.b]
    pushed_a, thrown_a = _forced(a, kinds.record[a.kind], plate.bounds)
    fixed = is_fixture(pair.b, crowd)
    if fixed:
        pushed_b, thrown_b = 0.0, _fixture_speed(b, kinds.record[b.kind], plate.bounds)
    else:
        pushed_b, thrown_b = _forced(b, kinds.record[b.kind], plate.bounds)
    forced = pushed_a, pushed_b, thrown_a, thrown_b, ENTERED
    due = bound_of_spheres(pair, parts, kinds, t, plate.bounds, forced)
    if due > t:
        return due, False
    move_to(a, kinds.record[a.kind], t, plate.surface)
    if fixed:
        move_fixture(b, t, plate.surface)
    else:
        move_to(b, kinds.record[b.kind], t, plate.surface)
    return bound_of_hulls(pair, parts, kinds, t, plate.bounds, forced)


@inlined
def _forced(part, kind, bounds):
    """Largest acceleration of any of its points that forces cause [m/s^2], and change of speed [m/s]."""
    if part.phase == FREE or not flies(part, kind):
        return 0.0, 0.0
    if part.phase == FOLLOWING:
        return GRAVITY, CARRIED * bounds.speed
    lasts = 2.0 * abs(part.lead)
    force = math.sqrt(dot(part.force, part.force)) / kind.mass + lasts * math.sqrt(dot(part.jerk, part.jerk))
    moment = math.sqrt(dot(part.moment, part.moment)) + lasts * math.sqrt(dot(part.twist, part.twist))
    return force + kind.reach * moment / min(kind.inertia[0], kind.inertia[1], kind.inertia[2]), 0.0


@inlined
def _fixture_speed(part, kind, bounds):
    """No point of a fixture is faster [m/s]."""
    return CARRIED * bounds.speed if part.phase == FIXED else own_speed(part, kind)


@inlined
def release(part):
    """Forces on a part end; that it has been pressed is still known."""
    if part.phase == FREE:
        return
    part.phase, part.lead, part.supported = PRESSED, 0.0, 0
    for k in range(3):
        part.force[k] = part.moment[k] = part.jerk[k] = part.twist[k] = 0.0
