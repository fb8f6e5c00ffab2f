"""How a cylinder that rolls on one circle is put back on the surface.

Between two looks its contact point falls into the surface by nanometres. Lifted as a whole, as other parts are, it
gains energy that rolling does not take from it again, up to 8 % per second: of second order in the time between looks.
Lifted as an impulse at the point would do it, which turns it too, it loses energy, of first order. A share of the one
in the other loses more than it gains, so that no cylinder speeds up on a plate at rest.
"""

from __future__ import annotations

from feeder_sim.engines.impulse.vectors import cross, dot, times
from feeder_sim.machine_code import compiled

TURNED = 0.5  # of the lift; with 0.25 coins and rods of 1 to 20 mm lost energy over all, but not at every moment


@compiled
def lift_by_turning(part, kind, inverse_mass, inverse_inertia, arm, depth):
    """Lift a contact point by a share of its depth [m], if it is on a circle; returns what is left to lift.

    arm: from the centre of mass to the point [m]; inverse_inertia: symmetric, in world axes.
    """
    if kind.circle_radius == 0.0 or depth == 0.0:
        return depth
    moment = arm[1], -arm[0], 0.0  # arm x up
    turned = times(inverse_inertia, moment)
    push = TURNED * depth / (inverse_mass + dot(moment, turned))
    part.position[2] += push * inverse_mass
    r, turn = part.attitude, (push * turned[0], push * turned[1], push * turned[2])
    for k in range(3):
        x, y, z = cross(turn, (r[0, k], r[1, k], r[2, k]))
        r[0, k] += x
        r[1, k] += y
        r[2, k] += z
    return (1.0 - TURNED) * depth
