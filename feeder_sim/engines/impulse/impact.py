"""Impacts of one part at several points of plate and wall at once: contact_problem.py for a part (`PART`)."""

from __future__ import annotations

from feeder_sim.engines.impulse.contact_problem import ARM_SECOND, IMPULSE, MOMENT, impact
from feeder_sim.engines.impulse.state import inverse_inertia
from feeder_sim.engines.impulse.vectors import add_to, cross, times, vector, write_to
from feeder_sim.machine_code import inlined, uncounted

CLOSELY = 3e-6  # [m/s]; what an impact may be off, where steps are coarser


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
def resolve_impact(part, kind, n, work):
    """Change velocity and angular momentum of a part for impacts at the first n contacts, which have been gathered.

    Returns whether every contact obeys its laws.
    """
    load_body(0, part, kind, work.bodies)
    settled = impact(work.bodies, work.contacts, n, CLOSELY)
    write_to(part.velocity, work.bodies.velocity[0])
    for i in range(n):
        add_to(part.momentum, 1.0, cross(work.contacts.vector[ARM_SECOND, i], work.contacts.vector[IMPULSE, i]))
        add_to(part.momentum, 1.0, vector(work.contacts.vector[MOMENT, i]))
    return settled
