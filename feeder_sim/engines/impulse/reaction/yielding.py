"""What impacts take from a plate that gives way."""

from __future__ import annotations

from feeder_sim.engines.impulse.contact_problem import ARM_SECOND, IMPULSE, VELOCITY
from feeder_sim.engines.impulse.scratch import BY_CORRECTION, BY_IMPACTS, FROM_MODES
from feeder_sim.engines.impulse.surface import HEIGHT, SPEED, TURN_X, TURN_Y
from feeder_sim.engines.impulse.vectors import combine, cross, dot, plus, vector
from feeder_sim.engines.reaction import react
from feeder_sim.machine_code import inlined, uncounted


@inlined
def is_compliant(work):
    """Whether the plate takes the impulses of parts."""
    return work.contacts.modes.velocity_loss.shape[0] > 0


@inlined
def note_carried(n, i, surface, work):
    """Write how the surface under corner i, contact n, moves with every mode; work.under is filled for it."""
    carried, under, moves = work.contacts.modes.carried[n], work.under[i], surface.half_thickness * surface.in_plane
    for s in range(carried.shape[0]):
        carried[s, 0], carried[s, 1] = -moves * under[s, TURN_X], -moves * under[s, TURN_Y]
        carried[s, 2] = under[s, HEIGHT]


@uncounted
def give_to_plate(n, n_corners, before, lifted, surface, t, work):
    """Give the plate at time t [s] the opposite of the impulses of n contacts, and note what was done.

    before: velocity and spin of the part before them; lifted: energy by being put back on the surface [J].
    """
    energy, modes = work.yielding.energy_account, work.contacts.modes
    loss = modes.velocity_loss
    for s in range(loss.shape[0]):
        energy[FROM_MODES] += (work.now[SPEED, s] - 0.5 * loss[s]) * loss[s] / modes.inverse_mass[s]
    energy[BY_IMPACTS] += _work(n, before, work)
    energy[BY_CORRECTION] += lifted
    react(surface, t, loss, work.yielding.changed)
    for i in range(n_corners):
        point = work.point[i]
        if point.most_push != 0.0:  # else it is above the crest, and nothing is known under it
            for s in range(loss.shape[0]):
                point.surface_velocity[2] -= work.under[i, s, HEIGHT] * loss[s]


@inlined
def _work(n, before, work):
    """Work of the impulses of n contacts in the frame of the surface [J]: sum of p . (u + u')/2.

    before: velocity and spin of the part before them.
    """
    total, body, modes = 0.0, work.bodies, work.contacts.modes
    for i in range(n):
        arm, push = vector(work.contacts.vector[ARM_SECOND, i]), vector(work.contacts.vector[IMPULSE, i])
        first = plus(before[0], 1.0, cross(before[1], arm))
        last = plus(body.velocity[0], 1.0, cross(body.spin[0], arm))
        mean = plus(combine(0.5, first, 0.5, last, 0.0, last), -1.0, work.contacts.vector[VELOCITY, i])
        for s in range(modes.velocity_loss.shape[0]):
            mean = plus(mean, 0.5 * modes.velocity_loss[s], modes.carried[i, s])
        total += dot(push, mean)
    return total
