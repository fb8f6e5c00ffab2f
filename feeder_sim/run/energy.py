"""Energy of the parts of a scene, and the largest energy that its vibrating plate can give them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from feeder_sim.constants import GRAVITY
from feeder_sim.machine_code import inlined
from feeder_sim.records.trajectory import Frames
from feeder_sim.scenario import Contact
from feeder_sim.scene.free_modes import free_modes
from feeder_sim.scene.scene import Scene


class EnergyLimit(NamedTuple):
    """What bounds the energy of a part.

    plate_speed: largest of the surface [m/s]; start_speed: largest of a part that falls from where it starts [m/s];
    restitution [1]; factor: allowed over what the plate can give.
    """

    plate_speed: float
    start_speed: float
    restitution: float
    factor: float


def energy_limit(scene: Scene, first: Frames, factor: float) -> EnergyLimit:
    """Bound the energy of the parts of one seed; first: frames with the state at the start."""
    height = float(np.abs(first.position[..., 2]).max())
    start_speed = float(np.linalg.norm(first.velocity, axis=-1).max()) + fall_speed(height) + _spin_speed(scene, first)
    plate_speed = largest_at_once(scene, speeds=True)
    return EnergyLimit(plate_speed, start_speed, _restitution(scene.scenario.contact), factor)


def _spin_speed(scene: Scene, first: Frames) -> float:
    """Speed [m/s] that has at least the energy of the fastest spin."""
    gyration = np.array([math.sqrt(kind.inertia.max() / kind.mass) for kind in scene.kinds])[scene.kind_of]
    return float((gyration * np.linalg.norm(first.angular_velocity, axis=-1)).max())


def fall_speed(height: float) -> float:
    """Speed [m/s] after a fall from a height [m]."""
    return math.sqrt(2.0 * GRAVITY * height)


@inlined
def energy_of(mass, inertia, height, velocity, spin, turned):
    """Kinetic energy of translation and spin, and potential energy over the resting plate [J], of one part.

    turned: its rotation matrix, row by row; spin in world axes.
    """
    energy = 0.5 * mass * (velocity[0] ** 2 + velocity[1] ** 2 + velocity[2] ** 2) + mass * GRAVITY * height
    for axis in range(3):
        about = 0.0
        for k in range(3):
            about += turned[k][axis] * spin[k]
        energy += 0.5 * inertia[axis] * about * about
    return energy


@inlined
def largest_energy(mass, t, limit):
    """Largest energy [J] that a part may have at time t [s], of its start and of the plate.

    A part that meets a plate of speed u at its fastest at every impact has v = e v + (1 + e) u in the end, which is
    v = u (1 + e) / (1 - e). For e -> 1 that is without limit, but takes time: the mean force between plate and part
    is the weight, so that the plate gives m g u t until the time t, and m u v for the momentum that the part still
    has. With the energy m v^2 / 2 this makes v^2 = 2 u (v + g t). The smaller of both speeds counts.
    """
    speed, e = limit.plate_speed, limit.restitution
    from_plate = speed + math.sqrt(speed * speed + 2.0 * GRAVITY * speed * t)
    if e < 1.0:
        from_plate = min(from_plate, speed * (1.0 + e) / (1.0 - e))
    return limit.factor * 0.5 * mass * (from_plate + limit.start_speed) ** 2


def largest_at_once(scene: Scene, *, speeds: bool = False) -> float:
    """Largest sum of amplitudes [m], or speeds [m/s], over the drives that act or still ring at the same time.

    A mode that is driven again while it rings gets the larger of both amounts.
    """
    decay = np.full(scene.surface.n_shapes, 1e9)  # [1/s]; without a damping ratio the motion stops at once
    for drive in (drive for drives in scene.all_drives for drive in drives):
        rate = (drive.damping_ratio or math.inf) * 2.0 * math.pi * drive.natural_frequency
        decay[drive.shape] = min(decay[drive.shape], rate)
    largest, level = 0.0, np.zeros(len(decay))
    for stage in scene.times.stages:
        driven = np.zeros(len(decay))
        for drive in (drive for i in stage.excitations for drive in scene.all_drives[i]):
            driven[drive.shape] += drive.largest_speed if speeds else drive.largest
        largest = max(largest, float(np.maximum(level, driven).sum()))
        duration = 0.0 if stage.until else stage.stop - stage.start  # a stage with a condition may stop at once
        level = np.maximum(level * np.exp(-decay * duration), driven) * np.exp(-decay * (stage.end - stage.stop))
    return largest


def largest_reaction(scene: Scene, amplitude: float, start_speed: float) -> float:
    """How far parts that act on the plate may move its surface away from where the drives alone would have it [m].

    An estimate for a limit. Parts that take all energy from modes of an amplitude, or turn their phase, move it by
    twice that. Of their own energy, M v^2 / 2 at the start, a mode of the mass m gets an amplitude of
    v sqrt(M / m) / w_n at most. What parts carry from one mode to a slower one is left out.
    """
    modes = free_modes(scene.driven)
    mass = float(sum(part.mass for part in scene.parts))
    own = start_speed * np.sqrt(mass / modes.modal_mass) / np.abs(modes.rate)
    return 2.0 * amplitude + float(own.sum())


def _restitution(contact: Contact) -> float:
    """Coefficient of restitution [1].

    For a spring-damper with the damping ratio zeta it is exp(-pi zeta / sqrt(1 - zeta^2)): the ratio of the speeds of
    a free linear oscillation half a period apart. One that depends on the speed may come to 1 at slow impacts.
    """
    if contact.restitution == "zener" or contact.restitution_exponent:
        return 1.0
    if contact.time_constant_us is None:
        return contact.restitution
    ratio = contact.damping_ratio
    return math.exp(-math.pi * ratio / math.sqrt(1.0 - ratio**2)) if ratio < 1.0 else 0.0
