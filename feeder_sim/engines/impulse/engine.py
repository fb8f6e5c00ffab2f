"""Engine `impulse`: rigid contact by impulses; parts fly in closed form and leap to the earliest possible contact.

Time is cut into windows. In each window

    window      which terms of the plate's motion act, and bounds on what it can do (window.py)
    pairs       which parts can meet at all, from a grid; the islands that such pairs make (neighbours.py)
    islands     each advances by itself, event by event (island.py): looks at parts over the plate (plate_contact.py)
                and at pairs (pair_contact.py), impacts (impact.py), flights between them (free_flight.py)

(Conservative advancement: Mirtich, PhD thesis, Berkeley 1996.) The step is what ends the infinite rattling of a part at
rest: corners may enter the surface by what they cover in one step, and are put back on it at the impact. Islands are
shared out over threads, which changes nothing in the result.
"""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from feeder_sim.engines.impact_log import begin_contact, end_contact, in_contact, new_log, room_for, take_impacts
from feeder_sim.engines.impulse.borrow import borrow
from feeder_sim.engines.impulse.free_flight import orthonormalise
from feeder_sim.engines.impulse.hulls import HullLibrary
from feeder_sim.engines.impulse.island import advance_islands
from feeder_sim.engines.impulse.neighbours import find_islands, find_pairs
from feeder_sim.engines.impulse.pair_contact import PAIR
from feeder_sim.engines.impulse.plate_contact import TOUCH, meet_plate
from feeder_sim.engines.impulse.rest import wake
from feeder_sim.engines.impulse.state import (
    ABSENT,
    GAP,
    SURFACE_RATE,
    fly_to,
    new_parts,
    new_scratch,
    read_kinds,
    read_wall,
    rim_walls,
)
from feeder_sim.engines.impulse.window import acting_terms, bound_window, fastest_rate
from feeder_sim.engines.surface_arrays import surface_arrays
from feeder_sim.machine_code import compiled
from feeder_sim.records.impacts import Impacts
from feeder_sim.records.trajectory import BLOCK_FRAMES, Frames
from feeder_sim.scene.scene import GRAVITY, Scene
from feeder_sim.scene.start import start_poses

SAME_CONTACT = 1.5  # steps between two impacts that count as one contact
WINDOW = 1e-3  # [s], at most, where parts can meet: shorter ones find the pairs too often, longer ones find too many
STATE = ("position", "velocity", "attitude", "momentum", "clock", "there")
ROW = 18  # numbers per part and frame: position, velocity, attitude, momentum


@compiled
def _range(parts, n_free, bounds, e, duration):
    """How far any part can come within a window [m]: the plate adds (1 + e) times its own speed to the fastest."""
    fastest = 0.0
    for i in range(n_free):
        if parts[i].there:
            v = parts[i].velocity
            fastest = max(fastest, v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    return (math.sqrt(fastest) + (1.0 + e) * bounds.speed + GRAVITY * duration) * duration


@compiled
def _open_window(parts, n_free, kinds, surface, antinode, pairs, start, end, step):
    """Everything that is the same for all islands of a window; wakes all parts unless the plate is calm."""
    acting = acting_terms(surface, start, end)
    bounds = bound_window(acting, antinode, start, end, step, fastest_rate(surface))
    half_x, half_y = surface.grid_x[-1], surface.grid_y[-1]
    reach = _range(parts, n_free, bounds, kinds.record[0].restitution[0], end - start)
    if not bounds.calm:
        for i in range(n_free):
            wake(parts[i])
    pairs = find_pairs(parts, kinds, n_free, half_x, half_y, reach, pairs)
    return acting, bounds, pairs, find_islands(parts, n_free, pairs)


@compiled
def _close_frame(parts, n_free, row):
    for i in range(n_free):
        part = parts[i]
        if part.there:
            orthonormalise(part.attitude)
        for k in range(3):
            row[i, k], row[i, 3 + k], row[i, 15 + k] = part.position[k], part.velocity[k], part.momentum[k]
            for axis in range(3):
                row[i, 6 + 3 * k + axis] = part.attitude[k, axis]


@compiled
def _share_out(islands, n_threads):
    """Thread of every island: the largest first, each to the thread that has the least to do."""
    count = islands.first_part.shape[0] - 1
    size = (islands.first_part[1:] - islands.first_part[:-1]) + 2 * (islands.first_pair[1:] - islands.first_pair[:-1])
    order = np.argsort(-size, kind="mergesort")
    load, owner = np.zeros(n_threads, np.int64), np.empty(count, np.int64)
    for island in order:
        owner[island] = np.argmin(load)
        load[owner[island]] += size[island]
    return owner


@compiled
def _note_contact(part, before, work, n_corners, log, last, t, step):
    """Note an impact on the plate of a part in a guide; what follows within a step is the same contact.

    before: its vertical velocity before it. last: end of the contact under way, and the part's vertical velocity then.
    """
    if in_contact(log) and t - last[0] > SAME_CONTACT * step:
        end_contact(log, last[0], last[1])
    if not in_contact(log):
        plate = 0.0
        for i in range(n_corners):
            if work.corner[i, GAP] <= TOUCH:
                plate = work.corner[i, SURFACE_RATE]
        begin_contact(log, t, max(plate - before, 0.0))
    last[0], last[1] = t, part.velocity[2]


@compiled
def _advance_one(parts, kinds, wall, surface, antinode, log, last, work, step, interval, first_frame, out):
    """Advance the one part of a scene; after each frame write its state into a row of out (frames, 1, ROW)."""
    kinds, wall, work = borrow(kinds), borrow(wall), borrow(work)
    part, kind = parts[0], kinds.record[0]
    guided = wall.radius < np.inf
    # In a guide, contacts are told apart by the usual step.
    top = 0.0 if guided else fastest_rate(surface)
    for row in range(out.shape[0]):
        t, end = (first_frame + row) * interval, (first_frame + row + 1) * interval
        acting = acting_terms(surface, t, end)
        bounds = bound_window(acting, antinode, t, end, step, top)
        while t < end:
            fly_to(part, kind, t)
            before = part.velocity[2]
            leap, hit = meet_plate(part, kinds, wall, acting, bounds, t, work)
            if hit and guided:
                _note_contact(part, before, work, kind.corner_to - kind.corner_from, log, last, t, step)
            t += leap
        fly_to(part, kind, end)
        _close_frame(parts, 1, out[row])


class ImpulseEngine:
    """Rigid impulses behind the engine protocol."""

    name = "impulse"
    frames_per_block = BLOCK_FRAMES

    def __init__(self, scene: Scene, rng: np.random.Generator, *, threads: int = 1) -> None:
        self._scene = scene
        self._kinds = kinds = read_kinds(scene)
        self._n = len(scene.parts)
        self._wall = read_wall(scene.guides[0])
        self._log, self._last_contact = new_log(1), np.zeros(2)
        self._surface = surface_arrays(scene.surface, scene.scenario.run)
        self._antinode = np.abs(scene.surface.table[..., 0]).max(axis=(1, 2))
        self._threads = max(1, threads)
        self._alone = self._n == 1 and not scene.rim
        corners = [] if self._alone else np.split(kinds.corners, kinds.record["corner_from"][1:])
        self._libraries = [
            HullLibrary(corners, list(kinds.record["radius"][: len(corners)])) for _ in range(self._threads)
        ]
        self._hulls = [library.hulls() for library in self._libraries]
        self._scratch = [new_scratch(kinds, scene.surface.n_shapes) for _ in range(self._threads)]
        self._pool = ThreadPoolExecutor(self._threads) if self._threads > 1 else None
        self._n_windows = math.ceil(scene.frame_interval / WINDOW - 1e-9)
        self._parts = self._start(rng)
        self._frame = 0

    def _start(self, rng: np.random.Generator) -> NDArray[np.void]:
        """Parts at rest in their poses, then the walls of a rim."""
        from scipy.spatial.transform import Rotation

        poses = start_poses(self._scene, rng)
        centres, attitudes = rim_walls(self._scene)
        turned = Rotation.from_quat([pose.quaternion for pose in poses], scalar_first=True).as_matrix()
        velocity = np.concatenate([[pose.velocity for pose in poses], np.zeros_like(centres)])
        return new_parts(
            np.concatenate([[pose.position for pose in poses], centres]),
            np.concatenate([turned, attitudes]),
            np.concatenate([self._scene.kind_of, np.full(len(centres), len(self._scene.kinds))]),
            velocity,
        )

    def current(self) -> Frames:
        out = np.empty((1, self._n, ROW))
        _close_frame(self._parts, self._n, out[0])
        return self._frames(out, self._frame)

    def advance(self, n_frames: int) -> Frames:
        out = np.empty((n_frames, self._n, ROW))
        if self._alone:
            scene = self._scene
            if np.isfinite(self._wall.radius):  # each contact takes a step at least
                self._log = room_for(self._log, n_frames * (scene.steps_per_frame + 1) + 1)
            place = (self._kinds, self._wall, self._surface, self._antinode, self._log, self._last_contact)
            times = (scene.timestep, scene.frame_interval, self._frame)
            _advance_one(self._parts, *place, self._scratch[0], *times, out)
        else:
            for row in range(n_frames):
                self._advance_frame(self._frame + row)
                _close_frame(self._parts, self._n, out[row])
        self._frame += n_frames
        return self._frames(out, self._frame - n_frames + 1)

    def _advance_frame(self, frame: int) -> None:
        """Advance all parts to the next frame, window by window; nothing is kept between frames but their records."""
        pairs, interval, n = np.empty(0, PAIR), self._scene.frame_interval, self._n_windows
        for window in range(n):
            start, end = (frame + window / n) * interval, (frame + (window + 1) / n) * interval
            plate = (self._kinds, self._surface, self._antinode)
            opened = _open_window(self._parts, self._n, *plate, pairs, start, end, self._scene.timestep)
            acting, bounds, pairs, islands = opened
            owner = _share_out(islands, self._threads)
            common = (islands, pairs, self._parts, self._kinds, self._wall, acting, bounds)
            if self._pool is None:
                advance_islands(owner, 0, *common, self._hulls[0], start, end, self._scratch[0])
                continue
            tasks = [
                self._pool.submit(advance_islands, owner, i, *common, hulls, start, end, work)
                for i, (hulls, work) in enumerate(zip(self._hulls, self._scratch, strict=True))
            ]
            for task in tasks:
                task.result()

    def remove(self, parts: NDArray[np.int64]) -> None:
        self._parts["there"][parts] = ABSENT

    def redrive(self, scene: Scene) -> None:
        self._scene = scene
        self._surface = surface_arrays(scene.surface, scene.scenario.run)

    def state(self) -> dict[str, NDArray[np.float64]]:
        held = {name: self._parts[name].copy() for name in STATE}
        contact = np.array([*self._log.current, *self._last_contact])
        return held | {"contact": contact, "frame": np.array(self._frame)}

    def restore(self, state: dict[str, NDArray[np.float64]]) -> None:
        for name in STATE:
            self._parts[name] = state[name]
        self._log.current[:], self._last_contact[:] = state["contact"][:2], state["contact"][2:]
        self._frame = int(state["frame"])

    def take_impacts(self, *, end: bool) -> Impacts:
        last, velocity = self._last_contact
        if (
            in_contact(self._log)
            and self._frame * self._scene.frame_interval - last > SAME_CONTACT * self._scene.timestep
        ):
            end_contact(self._log, last, velocity)
        return take_impacts(self._log, end=end)

    def _frames(self, rows: NDArray[np.float64], first: int) -> Frames:
        from scipy.spatial.transform import Rotation

        n = len(rows)
        attitude = rows[..., 6:15].reshape(n, self._n, 3, 3)
        body_momentum = np.einsum("npij,npi->npj", attitude, rows[..., 15:18])
        inertia = self._kinds.record["inertia"][self._parts["kind"][: self._n]]
        spin = np.einsum("npij,npj->npi", attitude, body_momentum / inertia)
        finite = np.asarray(np.isfinite(attitude).all(axis=(2, 3)))
        turned = Rotation.from_matrix(np.where(finite[..., None, None], attitude, np.eye(3)).reshape(-1, 3, 3))
        return Frames(
            time=np.asarray((first + np.arange(n)) * self._scene.frame_interval, float),
            position=rows[..., 0:3],
            quaternion=np.asarray(turned.as_quat(scalar_first=True)).reshape(n, self._n, 4),
            velocity=rows[..., 3:6],
            angular_velocity=spin,
            present=np.tile(self._parts["there"][: self._n] != ABSENT, (n, 1)),
        )
