"""Finds states that no part over a vibrating plate can have, which means that its simulation has diverged.

Violations, in the order in which they count where one frame has several:

    a state that is not finite
    a centre below the plate's surface: the part went through the plate between two steps
    more energy than the plate can give
    a corner deeper in the plate than allowed

The states are looked at in state_check.py, which also marks the parts that have left the plate.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.surface_arrays import SurfaceArrays, outline_arrays, surface_arrays
from feeder_sim.errors import Divergence, SimulationDiverged
from feeder_sim.records.seed import Events, parts_arrived
from feeder_sim.records.trajectory import SAME_TIME, Frames
from feeder_sim.run.state_check import (
    ALLOWED,
    CLEAR,
    DEPTH,
    ENERGY,
    FALLEN,
    FINE,
    LOST,
    MOST_ENERGY,
    NOT_FINITE,
    THROUGH_PLATE,
    TOO_DEEP,
    TOO_MUCH_ENERGY,
    VIOLATION,
    Bodies,
    DepthLimit,
    Edge,
    EnergyLimit,
    Limits,
    Motion,
    States,
    check_states,
    new_states,
    no_states,
)
from feeder_sim.scenario import Contact
from feeder_sim.scene.driven_mode import free_modes
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.scene import Scene, once_per_scene

DIVERGENCES = {
    NOT_FINITE: Divergence.NOT_FINITE,
    THROUGH_PLATE: Divergence.THROUGH_PLATE,
    TOO_MUCH_ENERGY: Divergence.TOO_MUCH_ENERGY,
    TOO_DEEP: Divergence.TOO_DEEP,
}
# Limit over what the plate can give. The largest ratio seen is 1.04, in all scenarios, both engines, heaps, elastic
# parts.
ENERGY_FACTOR = 10.0
# Limit of the depth, in steps times speed. The largest depths seen are 0.5 steps of a single part, and 3.3 steps of
# the falling parts where a heap is poured onto nuts at rest. Each is a third of what is allowed there.
# The impulse engine does not find a corner any more that is 200 um deep.
DEPTH_STEPS = 2.0
DEPTH_FRACTION = 0.05  # of the amplitude, added to the limit
HEAP_DEPTH = 1e-4  # [m], added for several parts; 80 um seen at the bottom of a poured heap, whose parts overlap
DEPTH_FLOOR = 1e-5  # [m], smallest limit; twice what a part enters in a flight of the impulse engine at any step


class Guard:
    """Checks one seed, block after block of frames; parts that have been taken out do not count.

    Args:
        prepared: what is simulated.
        first: frames with the state at the start.
    """

    def __init__(self, prepared: Prepared, first: Frames) -> None:
        self._prepared, self._scene = prepared, prepared.scene
        self._parts = [part.name for part in prepared.scene.parts]
        self._first = first[slice(-1, None)]
        self._limits = limits_of(prepared, first)
        self._checked = self._at_start(first[slice(-1, None)])  # the last block
        self._before = self._checked  # its last row is the last frame of the block before

    def _at_start(self, first: Frames) -> States:
        """States of parts that have just been let go, in one frame."""
        states = self._states(first, no_states(1, len(self._parts)))
        states.mark[:, :, FALLEN] = 0
        # One that starts too deep in the plate counts.
        states.mark[:, :, CLEAR] |= states.value[:, :, DEPTH] > 0.0
        return states

    def redrive(self, scene: Scene) -> None:
        """Go on in the same scene, in which drives stop at other times."""
        self._limits = self._limits._replace(surface=_surface(scene, self._limits.surface.tangent))

    def widen(self, prepared: Prepared) -> None:
        """Go on with the same scene, which has got more drives; the limits are made anew."""
        self._prepared, self._scene, fall = prepared, prepared.scene, self._limits.energy.start_speed
        limits = limits_of(prepared, self._first)
        energy = limits.energy._replace(start_speed=max(fall, limits.energy.start_speed))
        self._limits = limits._replace(energy=energy, depth=_depth_limit(prepared, energy))

    def check(self, frames: Frames, seed_index: int) -> tuple[int, SimulationDiverged | None]:
        """Return the number of leading frames that are valid, and the failure of the frame after them if there is one.

        `seed_index` is for the message.
        """
        self._checked = states = new_states(len(frames), self._before)
        valid = check_states(_motion(self._scene, frames), self._limits, states, False)
        if valid == len(frames):
            return valid, None
        last = valid + 1  # row of the states
        violations = states.mark[last, :, VIOLATION]
        violation = int(violations[violations != FINE].min())
        part = int(np.argmax(violations == violation))
        value, detail = states.value[last, part], ""
        if violation == TOO_MUCH_ENERGY:
            energy, most = value[ENERGY], value[MOST_ENERGY]
            detail = f"its energy of {energy:.2g} J exceeds {most:.2g} J, more than this plate can give"
        elif violation == TOO_DEEP:
            depth, allowed = 1e6 * value[DEPTH], 1e6 * value[ALLOWED]
            detail = f"a corner lies {depth:.1f} um below the plate's surface, must be at most {allowed:.1f} um"
        failure = SimulationDiverged(
            DIVERGENCES[violation],
            time_s=float(frames.time[valid]),
            part=self._parts[part],
            seed=seed_index,
            detail=detail,
        )
        return valid, failure

    def lost(self, n: int) -> NDArray[np.bool_]:
        """Which parts are off the plate and below the floor level, in the first n frames of the block checked last."""
        return self._checked.mark[1 : n + 1, :, LOST] != 0

    def remember(self, n: int) -> None:
        """Go on to the next block; n: frames that are kept of the one checked last."""
        self._before = self._checked.first(n + 1)

    def arrive(self, arrivals: Events, now: Frames) -> None:
        """Go on with the parts of refills so far; now: one frame, with those that came last as they were let go."""
        if not len(arrivals):
            return
        fall = max(self._limits.energy.start_speed, fall_speed(float(arrivals.height.max())))
        energy = self._limits.energy._replace(start_speed=fall)
        self._limits = self._limits._replace(energy=energy, depth=_depth_limit(self._prepared, energy))
        parts, started = parts_arrived(arrivals, start=float(now.time[-1]) - SAME_TIME, end=np.inf), self._at_start(now)
        before = States(self._before.value[-1:].copy(), self._before.mark[-1:].copy())
        before.value[0, parts], before.mark[0, parts] = started.value[-1, parts], started.mark[-1, parts]
        self._before = before

    def states(self, frames: Frames) -> States:
        """All that is found about a block of frames, with a first row of the frame before."""
        return self._states(frames, self._before)

    def _states(self, frames: Frames, before: States) -> States:
        states = new_states(len(frames), before)
        check_states(_motion(self._scene, frames), self._limits, states, True)
        return states


def limits_of(prepared: Prepared, first: Frames) -> Limits:
    """What the states of a seed are held against; first: frames with the state at the start, of one seed or of many."""
    scene = prepared.scene
    energy = energy_limit(scene, first, ENERGY_FACTOR)
    tangent = scene.scenario.run.tangent_surface or prepared.engine.name == "mujoco"
    return Limits(
        bodies=_bodies(scene),
        surface=_surface(scene, tangent),
        antinode=scene.surface.extremes[0],
        edge=edge_of(scene, sum(drive.largest for drives in scene.all_drives for drive in drives)),
        energy=energy,
        depth=_depth_limit(prepared, energy),
    )


def _depth_limit(prepared: Prepared, energy: EnergyLimit) -> DepthLimit:
    """How deep a corner may be."""
    scene = prepared.scene
    contact, compliant = scene.scenario.contact, scene.scenario.contact.time_constant_us is not None
    largest, _ = _plate_motion(scene)
    # The surface is the prescribed one. What parts make of it takes the plate's energy, so that its envelope falls and
    # the limit of the energy holds; but the depth is wrong by as much as they move the surface.
    reaction = largest_reaction(scene, largest, energy.start_speed) if scene.scenario.run.reaction else 0.0
    return DepthLimit(
        least=DEPTH_FLOOR + DEPTH_FRACTION * largest + reaction,
        steps=DEPTH_STEPS * scene.timestep,
        heap=HEAP_DEPTH if len(scene.parts) > 1 else 0.0,
        time_constant=1e-6 * (contact.time_constant_us or 0.0),
        damping_ratio=contact.damping_ratio if compliant else 0.0,
    )


def _surface(scene: Scene, tangent: bool) -> SurfaceArrays:
    surface = surface_arrays(scene)
    return surface if surface.tangent == tangent else surface._replace(tangent=tangent)


@once_per_scene
def _bodies(scene: Scene) -> Bodies:
    kinds, of = scene.kinds, scene.kind_of
    ends = np.cumsum([len(kind.corners) for kind in kinds])
    return Bodies(
        mass=np.array([kind.mass for kind in kinds])[of],
        inertia=np.array([kind.inertia for kind in kinds], float)[of],
        size=np.array([kind.size for kind in kinds])[of],
        radius=np.array([kind.corner_radius for kind in kinds], float)[of],
        corner_from=np.array([0, *ends[:-1]], np.int64)[of],
        corner_to=np.array(ends, np.int64)[of],
        corners=np.concatenate([np.asarray(kind.in_principal_axes(kind.corners), float) for kind in kinds]),
    )


def _motion(scene: Scene, frames: Frames) -> Motion:
    """Frames as the pass takes them, with the attitudes of the principal axes."""
    states = (frames.position, scene.principal_attitudes(frames.quaternion), frames.velocity, frames.angular_velocity)
    state = np.ascontiguousarray(np.concatenate(states, axis=-1))
    return Motion(np.ascontiguousarray(frames.time), state, np.ascontiguousarray(frames.present))


# Energy that a vibrating plate can give the parts of a scene at most.


def energy_limit(scene: Scene, first: Frames, factor: float) -> EnergyLimit:
    """Bound the energy of the parts of one seed; first: frames with the state at the start."""
    height = float(np.abs(first.position[..., 2]).max())
    start_speed = float(np.linalg.norm(first.velocity, axis=-1).max()) + fall_speed(height) + _spin_speed(scene, first)
    _, plate_speed = _plate_motion(scene)
    if any(table.moves_itself for table in scene.scenario.fixtures):
        plate_speed = math.inf  # walls that close give energy without a bound
    return EnergyLimit(plate_speed, start_speed, _restitution(scene.scenario.contact), factor)


def _spin_speed(scene: Scene, first: Frames) -> float:
    """Speed [m/s] that has at least the energy of the fastest spin."""
    gyration = np.array([math.sqrt(kind.inertia.max() / kind.mass) for kind in scene.kinds])[scene.kind_of]
    return float((gyration * np.linalg.norm(first.angular_velocity, axis=-1)).max())


def fall_speed(height: float) -> float:
    """Speed [m/s] after a fall from a height [m]."""
    return math.sqrt(2.0 * GRAVITY * height)


@once_per_scene
def _plate_motion(scene: Scene) -> tuple[float, float]:
    """Largest deflection [m] and speed [m/s] of the plate."""
    return largest_at_once(scene), largest_at_once(scene, speeds=True)


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
    a free linear oscillation half a period apart. One that depends on the speed may come to 1 at slow impacts, and a
    law other than Newton's at impacts off the centre.
    """
    if contact.restitution == "zener" or contact.restitution_exponent or contact.law != "newton":
        return 1.0
    if contact.time_constant_us is None:
        return contact.restitution
    ratio = contact.damping_ratio
    return math.exp(-math.pi * ratio / math.sqrt(1.0 - ratio**2)) if ratio < 1.0 else 0.0


def edge_of(scene: Scene, crest: float) -> Edge:
    """The edge of the plate of a scene whose surface rises by up to `crest` [m]."""
    return Edge(
        half_x=0.5 * scene.surface.length,
        half_y=0.5 * scene.surface.width,
        crest=crest,
        floor=1e-3 * scene.scenario.run.floor_mm,
        rim=scene.rim,
        enclosed=scene.rim or any(scene.guides),
        swing=2.0 * max(kind.size for kind in scene.kinds),
        frame_interval=scene.frame_interval,
        outline=outline_arrays(scene.surface.outline),
    )
