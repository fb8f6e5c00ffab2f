"""What the impulses of parts make the driven modes do, on top of the drives: one more term per mode shape.

The top surface moves by u = sum over j of d_j q_j with d_j = (-h/2 beta_x, -h/2 beta_y, w)_j. An impulse J [N s] that
the plate gives a part at a point acts on the plate with -J there, and changes the modal velocities by -J . d_j / m_j,
with the modal mass m_j. The modes are linear, so that all this is a free oscillation of its own, Re[z_j exp(s_j (t -
t_0))]: an impulse that takes the velocity v from the mode at t adds i v / w_d to z_j, and q does not jump. t_0 moves to
the time of every impulse, so that no exponential grows.

The terms are the last of a `SurfaceArrays` that belongs to one engine, in the order of the mode shapes.
"""

from __future__ import annotations

import cmath

import numpy as np
from numpy.typing import NDArray

from feeder_sim.engines.surface_arrays import SurfaceArrays
from feeder_sim.machine_code import uncounted


def with_reaction(surface: SurfaceArrays, rate: NDArray[np.complex128]) -> SurfaceArrays:
    """A surface with the terms of a plate that no part has touched yet; rate: of `FreeModes`."""
    n = len(rate)
    return surface._replace(
        term_shape=np.concatenate([surface.term_shape, np.arange(n)]),
        term_start=np.concatenate([surface.term_start, np.zeros(n)]),
        term_stop=np.concatenate([surface.term_stop, np.full(n, np.inf)]),
        coefficient=np.concatenate([surface.coefficient, np.zeros(n, complex)]),
        rate=np.concatenate([surface.rate, rate]),
    )


def reaction_of(surface: SurfaceArrays) -> NDArray[np.float64]:
    """The reaction in a surface, shape (n_shapes, 3): real and imaginary part of z_j [m], and t_0 [s]; a copy."""
    n = len(surface.table)
    z = surface.coefficient[-n:]
    return np.stack([z.real, z.imag, surface.term_start[-n:]], axis=1)


def set_reaction(surface: SurfaceArrays, reaction: NDArray[np.float64]) -> None:
    """Put a reaction, as of `reaction_of`, into the terms of a surface."""
    n = len(surface.table)
    surface.coefficient[-n:] = reaction[:, 0] + 1j * reaction[:, 1]
    surface.term_start[-n:] = reaction[:, 2]


def reaction_at(reaction: NDArray[np.float64], rate: NDArray[np.complex128], t: float) -> NDArray[np.complex128]:
    """The reaction z_j [m] at time t [s], shape (n_shapes,): its real part is what it adds to q_j."""
    return np.asarray((reaction[:, 0] + 1j * reaction[:, 1]) * np.exp(rate * (t - reaction[:, 2])))


@uncounted
def react(surface, t, velocity_loss, changed):
    """Take velocities (n_shapes,) [m/s] from the modes at time t [s].

    changed: (n_shapes,) complex [m], how much z_j has changed since somebody set it to nothing; it rings down as z_j.
    """
    n = velocity_loss.shape[0]
    first = surface.term_shape.shape[0] - n
    for s in range(n):
        rate = surface.rate[first + s]
        turn = cmath.exp(rate * (t - surface.term_start[first + s]))
        step = complex(0.0, velocity_loss[s] / rate.imag)
        surface.term_start[first + s] = t
        surface.coefficient[first + s] = surface.coefficient[first + s] * turn + step
        changed[s] = changed[s] * turn + step
