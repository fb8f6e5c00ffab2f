"""Energy of the parts of a scene, and the largest energy that its vibrating plate can give them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from feeder_sim.records.trajectory import Frames
from feeder_sim.scenario import Contact
from feeder_sim.scene.scene import GRAVITY, Scene

Floats = NDArray[np.float64]


class Energy:
    """Energies of the parts of one seed.

    Args:
        scene: has the parts and the drives.
        first: frames with the state at the start.

    Attributes:
        plate_speed: largest speed of the surface [m/s].
    """

    def __init__(self, scene: Scene, first: Frames) -> None:
        speed = [2 * np.pi * max(d.drive_frequency, d.natural_frequency) * d.amplitude for d in scene.drives]
        self.plate_speed = largest_at_once(scene, np.array(speed))
        height = float(np.abs(first.position[..., 2]).max())
        self._start_speed = float(np.linalg.norm(first.velocity, axis=-1).max()) + math.sqrt(2.0 * GRAVITY * height)
        self._restitution = _restitution(scene.scenario.contact)
        self._mass = np.array([kind.mass for kind in scene.kinds])[scene.kind_of]
        self._inertia = np.array([kind.inertia for kind in scene.kinds])[scene.kind_of]

    def of(self, frames: Frames, rotation: Floats) -> Floats:
        """Kinetic energy of translation and spin, and potential energy over the resting plate [J], shape (n, parts).

        `rotation` has the rotation matrices of the parts, shape (n, parts, 3, 3).
        """
        spin = np.einsum("npij,npi->npj", rotation, frames.angular_velocity)  # in the principal axes
        squared_speed = (frames.velocity**2).sum(axis=-1)
        spin_term = (self._inertia * spin**2).sum(axis=-1)
        kinetic = 0.5 * (self._mass * squared_speed + spin_term)
        return np.asarray(kinetic + self._mass * GRAVITY * frames.position[..., 2])

    def limit(self, time: Floats) -> Floats:
        """Largest energy [J] that a part can have of its start and of the plate at times (n,) [s], shape (n, parts).

        A part that meets a plate of speed u at its fastest at every impact has v = e v + (1 + e) u in the end, which is
        v = u (1 + e) / (1 - e). For e -> 1 that is without limit, but takes time: the mean force between plate and part
        is the weight, so that the plate gives m g u t until the time t, and m u v for the momentum that the part still
        has. With the energy m v^2 / 2 this makes v^2 = 2 u (v + g t). The smaller of both speeds counts.
        """
        speed, e = self.plate_speed, self._restitution
        from_plate = speed + np.sqrt(speed**2 + 2.0 * GRAVITY * speed * time)
        if e < 1.0:
            from_plate = np.minimum(from_plate, speed * (1.0 + e) / (1.0 - e))
        return np.asarray(0.5 * self._mass * (from_plate + self._start_speed)[:, None] ** 2)


def largest_at_once(scene: Scene, amounts: Floats) -> float:
    """Largest sum of an amount per drive (amplitude or speed) over the drives that act or still ring at the same time.

    A mode that is driven again while it rings gets the larger of both amounts.
    """
    decay = np.full(scene.surface.n_shapes, 1e9)  # [1/s]; without a damping ratio the motion stops at once
    for drive in scene.drives:
        rate = (drive.damping_ratio or math.inf) * 2.0 * math.pi * drive.natural_frequency
        decay[drive.shape] = min(decay[drive.shape], rate)
    largest, level = 0.0, np.zeros(len(decay))
    for stage in scene.times.stages:
        driven = np.zeros(len(decay))
        for i in stage.excitations:
            driven[scene.drives[i].shape] += amounts[i]
        largest = max(largest, float(np.maximum(level, driven).sum()))
        duration = 0.0 if stage.until else stage.stop - stage.start  # a stage with a condition may stop at once
        level = np.maximum(level * np.exp(-decay * duration), driven) * np.exp(-decay * (stage.end - stage.stop))
    return largest


def _restitution(contact: Contact) -> float:
    """Coefficient of restitution [1].

    For a spring-damper with the damping ratio zeta it is exp(-pi zeta / sqrt(1 - zeta^2)): the ratio of the speeds of
    a free linear oscillation half a period apart.
    """
    if contact.time_constant_us is None:
        return contact.restitution
    ratio = contact.damping_ratio
    return math.exp(-math.pi * ratio / math.sqrt(1.0 - ratio**2)) if ratio < 1.0 else 0.0
