"""Impacts of any number of parts at several points at once: contact_problem.py for parts (`PART`)."""

from __future__ import annotations

from feeder_sim.engines.impulse.contact_problem import ARM_FIRST, ARM_SECOND, IMPULSE, MOMENT, WORLD
from feeder_sim.engines.impulse.impact_law import impact_by_law
from feeder_sim.engines.impulse.scratch import UNRESOLVED
from feeder_sim.engines.impulse.state import inverse_inertia
from feeder_sim.engines.impulse.vectors import add_to, cross, times, vector, write_to
from feeder_sim.machine_code import inlined, uncounted


@inlined
def load_body(j, part, kind, bodies):
    """Make a part body j."""
    turns = inverse_inertia(part, kind)
    bodies.inverse_mass[j] = 1.0 / kind.mass
    for c in range(6):
        bodies.inverse_inertia[j, c] = turns[c]
    write_to(bodies.velocity[j], part.velocity)
    write_to(bodies.spin[j], times(turns, vector(part.momentum)))


@uncounted
def resolve_impact(parts, kinds, bodies, n, accuracy, work):
    """Change velocities and momenta of parts for impacts at the first n contacts, which have been gathered.

    bodies: how many there are; work.member: of each, its part. accuracy: `closely` and `near` of `impact`. Returns
    whether every contact obeys its laws.
    """
    for j in range(bodies):
        part = parts[work.member[j]]
        load_body(j, part, kinds.record[part.kind], work.bodies)
    settled = impact_by_law(kinds.record[0], work.bodies, work.contacts, n, accuracy[0], accuracy[1])
    if not settled:
        work.counts[UNRESOLVED] += 1
    for j in range(bodies):
        write_to(parts[work.member[j]].velocity, work.bodies.velocity[j])
    for i in range(n):
        _turn(i, 0, parts, work)
        _turn(i, 1, parts, work)
    return settled


@inlined
def _turn(i, side, parts, work):
    """Change the momentum of the first (0) or second (1) body of contact i, if it can be moved."""
    j, vectors = work.contacts.body[i, side], work.contacts.vector
    if j == WORLD or work.bodies.inverse_mass[j] == 0.0:
        return
    momentum, sign = parts[work.member[j]].momentum, 2.0 * side - 1.0
    add_to(momentum, sign, cross(vectors[ARM_FIRST if side == 0 else ARM_SECOND, i], vectors[IMPULSE, i]))
    add_to(momentum, sign, vector(vectors[MOMENT, i]))
