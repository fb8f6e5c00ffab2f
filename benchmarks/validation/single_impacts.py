"""Many impacts of one body at a single point of a surface at rest, one by one, for comparison with measurements."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from feeder_sim.engines.impulse.impact_law import hit_plate
from feeder_sim.engines.impulse.state import POISSON_FIELDS, kind_type, new_parts
from feeder_sim.engines.impulse.vectors import vector
from feeder_sim.machine_code import entry_point


def after_impacts(
    velocity: NDArray[np.float64],
    spin: NDArray[np.float64],
    arm: NDArray[np.float64],
    normal: NDArray[np.float64],
    inverse_inertia: float,
    restitution: NDArray[np.float64],
    friction: float,
    *,
    poisson: bool = False,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Velocities and angular velocities (n, 3) of a body after n impacts, by the law of the engine.

    velocity: (n, 3) [m/s]; spin: angular velocities (n, 3) [rad/s]; arm: ways from the centre of mass to the point
    (n, 3) [m]; normal: of the surface (3,); inverse_inertia: mass over moment of inertia, which is the same about every
    axis [1/m^2]; restitution: (n,) [1]; friction: [1]; poisson: by Poisson's law in place of Newton's.

    Raises:
        ArithmeticError: an impact that the direct solution does not cover.
    """
    n = len(velocity)
    parts = new_parts(np.zeros((n, 3)), np.eye(3), np.zeros(n, np.int64), velocity)  # of unit mass
    parts["momentum"] = spin / inverse_inertia
    arm, normal, restitution = (np.ascontiguousarray(array, dtype=float) for array in (arm, normal, restitution))
    kind = np.zeros(1, kind_type(POISSON_FIELDS if poisson else ()))
    if not _resolve_each(parts, kind, inverse_inertia, arm, normal, restitution, float(friction)):
        raise ArithmeticError("an impact has no direct solution")
    return parts["velocity"], parts["momentum"] * inverse_inertia


@entry_point
def _resolve_each(parts, kind, inverse_inertia, arm, normal, restitution, friction):
    """Impact of every part, of unit mass, on a surface at rest; returns whether all of them are solved."""
    turns, still = (inverse_inertia, 0.0, 0.0, inverse_inertia, 0.0, inverse_inertia), (0.0, 0.0, 0.0)
    for i in range(parts.shape[0]):
        law = restitution[i], friction
        if not hit_plate(parts[i], kind[0], 1.0, turns, vector(arm[i]), vector(normal), still, law):
            return False
    return True
