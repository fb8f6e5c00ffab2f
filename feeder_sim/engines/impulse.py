"""Engine `impulse`: rigid contact by impulses; a part flies in closed form and leaps to the earliest possible contact.

One pass of the loop:

    proximity   height of every corner above the surface, and how fast it approaches
    impact      corners that touch and approach get impulses, together (impact.py)
    leap        the longest flight during which no corner can touch: with gap g, approach speed -u and a bound a on the
                relative acceleration, no contact before t = (u + sqrt(u^2 + 2 a g)) / a; never shorter than the step
    flight      parabola and torque-free rotation over that time (free_flight.py)

(Conservative advancement: Mirtich, PhD thesis, Berkeley 1996.) The step is what ends the infinite rattling of a part at
rest: corners may enter the surface by what they cover in one step, and are put back on it at the impact.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from feeder_sim.engines.free_flight import orthonormalise, rotate_freely
from feeder_sim.engines.impact import resolve_impact
from feeder_sim.engines.impact_log import begin_contact, end_contact, in_contact, new_log, room_for, take_impacts
from feeder_sim.engines.impulse_state import (
    ARM,
    FRICTION,
    GAP,
    NORMAL,
    RATE,
    RESTITUTION,
    SURFACE_ACCELERATION,
    SURFACE_RATE,
    VELOCITY,
    Motion,
    bound_surface,
    new_scratch,
    point,
    read_body,
    read_wall,
)
from feeder_sim.engines.surface_arrays import surface_arrays
from feeder_sim.engines.tube import approach_wall, gather_wall, leap_to_wall, meeting_time
from feeder_sim.impacts import Impacts
from feeder_sim.plate.kernels import modal_motion, surface_modes, surface_normal
from feeder_sim.scene import GRAVITY, Scene, start_poses
from feeder_sim.trajectory import BLOCK_FRAMES, Frames

TOUCH = 1e-9  # [m]; corners this close count as touching, so that a flat landing is one impact and not six
SAME_CONTACT = 1.5  # steps between two impacts that count as one contact


@njit(cache=True, nogil=True, error_model="numpy")
def _fly(motion, body, duration):
    """Free flight over a duration [s], in place."""
    for k in range(3):
        motion.position[k] += motion.velocity[k] * duration
    motion.position[2] -= 0.5 * GRAVITY * duration * duration
    motion.velocity[2] -= GRAVITY * duration
    rotate_freely(motion.attitude, motion.momentum, body.inertia, body.axis, duration)


@njit(cache=True, nogil=True, error_model="numpy")
def _proximity(motion, body, surface, bounds, t, work):
    """Fill gap and surface part of every corner.

    Above the crest the gap is to the crest and the surface counts as still; below it, to the surface itself. A corner
    beyond the edge of the plate has nothing under it.
    """
    moved = False
    for i in range(body.corners.shape[0]):
        height = motion.position[2] - body.radius
        for axis in range(3):
            height += motion.attitude[2, axis] * body.corners[i, axis]
        work.corner[i, GAP] = height - bounds.crest
        work.corner[i, SURFACE_RATE] = work.corner[i, SURFACE_ACCELERATION] = 0.0
        if work.corner[i, GAP] > 2.0 * TOUCH:  # a gap to the crest must never pass for a touch
            continue
        if not moved:
            _move_surface(surface, t, work)
            moved = True
        _measure_gap(motion, body, surface, bounds, height, i, work)


@njit(cache=True, nogil=True, error_model="numpy")
def _approach(motion, body, work):
    """Fill the vertical rate of every corner relative to the surface; returns how many touch and approach."""
    # (w x r)_z = r . (z x w), taken in body axes once instead of for every corner.
    wx = wy = 0.0
    for axis in range(3):
        along = 0.0
        for k in range(3):
            along += motion.attitude[k, axis] * motion.momentum[k]
        along /= body.inertia[axis]
        wx += motion.attitude[0, axis] * along
        wy += motion.attitude[1, axis] * along
    x = wx * motion.attitude[1, 0] - wy * motion.attitude[0, 0]
    y = wx * motion.attitude[1, 1] - wy * motion.attitude[0, 1]
    z = wx * motion.attitude[1, 2] - wy * motion.attitude[0, 2]
    touching = 0
    for i in range(body.corners.shape[0]):
        turning = x * body.corners[i, 0] + y * body.corners[i, 1] + z * body.corners[i, 2]
        work.corner[i, RATE] = motion.velocity[2] + turning - work.corner[i, SURFACE_RATE]
        if work.corner[i, GAP] <= TOUCH and work.corner[i, RATE] < 0.0:
            touching += 1
    return touching


@njit(cache=True, nogil=True, error_model="numpy")
def _move_surface(surface, t, work):
    """Modal coordinates and their rates at time t."""
    modal_motion(
        t,
        surface.term_shape,
        surface.term_start,
        surface.term_stop,
        surface.coefficient,
        surface.rate,
        work.modal[0],
        work.modal[1],
    )


@njit(cache=True, nogil=True, error_model="numpy")
def _measure_gap(motion, body, surface, bounds, height, i, work):
    """Gap of one corner to the surface under it, the surface's rate, and a bound on its acceleration."""
    x, y = point(motion, body, i, 0), point(motion, body, i, 1)
    if abs(x) > surface.grid_x[-1] or abs(y) > surface.grid_y[-1]:
        work.corner[i, GAP] = np.inf
        return
    _modes_at(motion, surface, x, y, work)
    work.corner[i, GAP] = height
    for s in range(work.modal.shape[1]):
        work.corner[i, GAP] -= work.modes[s, 0] * work.modal[0, s]
        work.corner[i, SURFACE_RATE] += work.modes[s, 0] * work.modal[1, s]
        work.corner[i, SURFACE_ACCELERATION] += abs(work.modes[s, 0]) * bounds.acceleration[s]


@njit(cache=True, nogil=True, error_model="numpy")
def _modes_at(motion, surface, x, y, work):
    """Mode shapes at a point; on a tangent surface, those under the centre, continued along their slopes."""
    if not surface.tangent:
        surface_modes(x, y, surface.grid_x, surface.grid_y, surface.table, work.weight[0], work.weight[1], work.modes)
        return
    cx, cy = motion.position[0], motion.position[1]
    surface_modes(cx, cy, surface.grid_x, surface.grid_y, surface.table, work.weight[0], work.weight[1], work.modes)
    for s in range(work.modes.shape[0]):
        work.modes[s, 0] += work.modes[s, 1] * (x - cx) + work.modes[s, 2] * (y - cy)


@njit(cache=True, nogil=True, error_model="numpy")
def _gather_plate(motion, body, surface, work):
    """Collect the corners that touch the plate and approach it; returns their number and the deepest penetration."""
    n, depth = 0, 0.0
    for i in range(body.corners.shape[0]):
        if work.corner[i, GAP] > TOUCH or work.corner[i, RATE] >= 0.0:
            continue
        depth = max(depth, -work.corner[i, GAP])
        x, y = point(motion, body, i, 0), point(motion, body, i, 1)
        _modes_at(motion, surface, x, y, work)
        work.contact[VELOCITY, n] = 0.0
        for s in range(work.modal.shape[1]):
            for k in range(2):
                slide = surface.half_thickness * work.modes[s, 1 + k] * work.modal[1, s] * surface.in_plane
                work.contact[VELOCITY, n, k] -= slide
            work.contact[VELOCITY, n, 2] += work.modes[s, 0] * work.modal[1, s]
        if surface.tangent:
            x, y = motion.position[0], motion.position[1]
        surface_normal(
            x,
            y,
            surface.grid_x,
            surface.grid_y,
            surface.table,
            work.modal[0],
            work.weight[0],
            work.weight[1],
            work.contact[NORMAL, n],
        )
        for k in range(3):
            work.contact[ARM, n, k] = (
                point(motion, body, i, k) - motion.position[k] - body.radius * work.contact[NORMAL, n, k]
            )
        work.law[RESTITUTION, n], work.law[FRICTION, n] = body.restitution, body.friction
        n += 1
    return n, depth


@njit(cache=True, nogil=True, error_model="numpy")
def _impact(motion, body, wall, surface, work):
    """Put the deepest corner back on the surface and give impulses to all corners that touch and approach.

    What a corner covered inside the surface within one step would otherwise add up, and a resting part would sink.
    """
    n, depth = _gather_plate(motion, body, surface, work)
    if wall.radius < np.inf:
        n = gather_wall(motion, body, wall, TOUCH, n, work)
    motion.position[2] += depth
    for i in range(body.corners.shape[0]):
        work.corner[i, GAP] += depth
    inverse_inertia = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            inverse_inertia[i, j] = 0.0
            for k in range(3):
                inverse_inertia[i, j] += motion.attitude[i, k] * motion.attitude[j, k] / body.inertia[k]
    resolve_impact(
        motion.velocity,
        motion.momentum,
        1.0 / body.mass,
        inverse_inertia,
        work.contact[ARM],
        work.contact[NORMAL],
        work.contact[VELOCITY],
        n,
        work.law[RESTITUTION],
        work.law[FRICTION],
    )


@njit(cache=True, nogil=True, error_model="numpy")
def _leap(motion, body, work):
    """Longest flight [s] during which no corner can touch."""
    # |dw/dt| <= |w| |L| / I_min for a torque-free body, so a corner accelerates by at most 2 reach (L / I_min)^2.
    least = min(body.inertia[0], body.inertia[1], body.inertia[2])
    squared = motion.momentum[0] ** 2 + motion.momentum[1] ** 2 + motion.momentum[2] ** 2
    own = GRAVITY + 2.0 * body.reach * squared / (least * least)
    shortest = np.inf
    for i in range(work.corner.shape[0]):
        gap, rate, a = max(work.corner[i, GAP], 0.0), work.corner[i, RATE], own + work.corner[i, SURFACE_ACCELERATION]
        if gap < np.inf:
            shortest = min(shortest, (rate + math.sqrt(rate * rate + 2.0 * a * gap)) / a)
    return shortest


@njit(cache=True, nogil=True, error_model="numpy")
def _note_contact(motion, work, log, last, t, step):
    """Note an impact on the plate of a part in a guide; what follows within a step is the same contact.

    last: end of the contact under way, and the part's vertical velocity then.
    """
    if in_contact(log) and t - last[0] > SAME_CONTACT * step:
        end_contact(log, last[0], last[1])
    if not in_contact(log):
        plate = 0.0
        for i in range(work.corner.shape[0]):
            if work.corner[i, GAP] <= TOUCH:
                plate = work.corner[i, SURFACE_RATE]
        begin_contact(log, t, max(plate - motion.velocity[2], 0.0))
    last[0] = t


@njit(cache=True, nogil=True, error_model="numpy")
def _advance(motion, body, wall, surface, bounds, work, log, last, step, frame_interval, first_frame, out):
    """Advance frame by frame; after each, write position, velocity, attitude, momentum into a row of out (n, 18)."""
    guided = wall.radius < np.inf
    for row in range(out.shape[0]):
        t, end = (first_frame + row) * frame_interval, (first_frame + row + 1) * frame_interval
        while t < end:
            _proximity(motion, body, surface, bounds, t, work)
            on_plate = _approach(motion, body, work)
            on_wall = approach_wall(motion, body, wall, TOUCH, work) if guided else 0
            if on_plate + on_wall > 0:
                if guided and on_plate > 0:
                    _note_contact(motion, work, log, last, t, step)
                _impact(motion, body, wall, surface, work)
                if on_plate > 0:
                    last[1] = motion.velocity[2]
                _approach(motion, body, work)
                if guided:
                    approach_wall(motion, body, wall, TOUCH, work)
            leap = _leap(motion, body, work)
            if guided:
                leap = max(min(leap, leap_to_wall(motion, body, wall, work)), meeting_time(work, step))
            else:
                leap = max(leap, step)
            if t + leap >= end:
                _fly(motion, body, end - t)
                break
            _fly(motion, body, leap)
            t += leap
        orthonormalise(motion.attitude)
        out[row, 0:3], out[row, 3:6] = motion.position, motion.velocity
        out[row, 6:15], out[row, 15:18] = motion.attitude.copy().ravel(), motion.momentum


class ImpulseEngine:
    """Rigid impulses behind the engine protocol; geometry, mass and contact constants from the compiled MJCF."""

    name = "impulse"
    frames_per_block = BLOCK_FRAMES

    def __init__(self, scene: Scene, rng: np.random.Generator) -> None:
        from scipy.spatial.transform import Rotation

        self._scene = scene
        self._body = read_body(scene)
        self._wall = read_wall(scene.guides[0])
        self._log, self._last_contact = new_log(1), np.zeros(2)
        self._surface = surface_arrays(scene.surface, scene.scenario.run)
        self._bounds = bound_surface(scene)
        self._scratch = new_scratch(len(self._body.corners), scene.surface.n_shapes)
        (pose,) = start_poses(scene, rng)
        attitude = np.ascontiguousarray(Rotation.from_quat(pose.quaternion, scalar_first=True).as_matrix())
        self._motion = Motion(pose.position.copy(), np.zeros(3), attitude, np.zeros(3))
        self._frame = 0

    def current(self) -> Frames:
        m = self._motion
        return self._frames(np.concatenate([m.position, m.velocity, m.attitude.ravel(), m.momentum])[None], self._frame)

    def advance(self, n_frames: int) -> Frames:
        out = np.empty((n_frames, 18))
        interval = self._scene.frame_interval
        if np.isfinite(self._wall.radius):  # each contact takes a step at least
            self._log = room_for(self._log, n_frames * (self._scene.steps_per_frame + 1) + 1)
        arguments = (self._motion, self._body, self._wall, self._surface, self._bounds, self._scratch)
        times = (self._scene.timestep, interval, self._frame)
        _advance(*arguments, self._log, self._last_contact, *times, out)
        self._frame += n_frames
        return self._frames(out, self._frame - n_frames + 1)

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
        attitude = rows[:, 6:15].reshape(n, 3, 3)
        body_momentum = np.einsum("nij,ni->nj", attitude, rows[:, 15:18])
        spin = np.einsum("nij,nj->ni", attitude, body_momentum / self._body.inertia)
        finite = np.asarray(np.isfinite(attitude).all(axis=(1, 2)))
        turned = Rotation.from_matrix(np.where(finite[:, None, None], attitude, np.eye(3)))
        return Frames(
            time=np.asarray((first + np.arange(n)) * self._scene.frame_interval, float),
            position=rows[:, None, 0:3],
            quaternion=np.asarray(turned.as_quat(scalar_first=True))[:, None],
            velocity=rows[:, None, 3:6],
            angular_velocity=spin[:, None],
        )
