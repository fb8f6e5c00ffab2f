"""Engine `mujoco`: MuJoCo's own time stepping over tangent patches that a compiled loop puts on the moving surface.

At each step from t to t + dt the patch of a part at (x, y) gets

    position  tangent plane of the surface at t:   z(x, y) = w q(t),  tilt -beta q(t)
    velocity  mean over the step at that point:    (q(t + dt) - q(t)) / dt  times the same shapes

so that a part resting on the surface follows it without drift; the hinges make the horizontal velocity -h/2 beta q'.
A lone part in the air is stepped without MuJoCo (free_flight.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from feeder_sim.engines.impact_log import begin_contact, end_contact, in_contact, new_log, room_for, take_impacts
from feeder_sim.engines.mujoco.free_flight import flight_of, leap
from feeder_sim.engines.mujoco.mjcf import build_mjcf
from feeder_sim.engines.mujoco_library import load_mujoco_symbols, silence_mujoco
from feeder_sim.engines.protocol import ENDED, WHOLE, new_interrupt
from feeder_sim.engines.surface_arrays import surface_arrays
from feeder_sim.machine_code import compiled, entry_point, external
from feeder_sim.plate.compiled import modal_motion, surface_modes
from feeder_sim.records.seed import Counts, Events
from feeder_sim.records.trajectory import BLOCK_FRAMES, Frames
from feeder_sim.scene.scene import Scene
from feeder_sim.scene.start import Pose, start_poses

silence_mujoco()
load_mujoco_symbols()
PARKED = -100.0  # [m]; height of the first part taken out
mj_step = external("mj_step", "void", "voidptr", "voidptr")


class Addresses(NamedTuple):
    """Where things are in MuJoCo: pointers, state vectors, and the first index of each part's joints in them.

    guided: the part is in a guide over a piston; vertical: index (after its first) and factor that make its vertical
    velocity of qvel; touch: the force between part and plate. mocap: patches are mocap bodies, of these poses, whose
    own places lie this far below the surface (depth).
    """

    model: int
    data: int
    qpos: NDArray[np.float64]
    qvel: NDArray[np.float64]
    part_qpos: NDArray[np.int64]
    part_qvel: NDArray[np.int64]
    patch_qpos: NDArray[np.int64]
    patch_qvel: NDArray[np.int64]
    guided: bool
    vertical: int
    factor: float
    touch: NDArray[np.float64]
    interrupt: NDArray[np.int64]
    mocap: bool
    mocap_pos: NDArray[np.float64]
    mocap_quat: NDArray[np.float64]
    depth: float


@compiled
def place_patches(at, surface, q, rate, modes):
    """Put every patch on the tangent plane under its part; rate is dq/dt."""
    for part in range(at.part_qpos.shape[0]):
        x, y = at.qpos[at.part_qpos[part]], at.qpos[at.part_qpos[part] + 1]
        surface_modes(x, y, surface.grid_x, surface.grid_y, surface.table, modes)
        w = bx = by = w_rate = bx_rate = by_rate = 0.0
        for s in range(q.shape[0]):
            w += modes[s, 0] * q[s]
            bx += modes[s, 1] * q[s]
            by += modes[s, 2] * q[s]
            w_rate += modes[s, 0] * rate[s]
            bx_rate += modes[s, 1] * rate[s]
            by_rate += modes[s, 2] * rate[s]
        if at.mocap:
            at.mocap_pos[part, 2] = w - bx * x - by * y - at.depth
            at.mocap_quat[part, 1], at.mocap_quat[part, 2] = 0.5 * by, -0.5 * bx
            continue
        position, velocity = at.patch_qpos[part], at.patch_qvel[part]
        # Hinges through the plate's centre: tilt (by, -bx), and the lift that makes the plane pass through z(x, y).
        at.qpos[position] = w - bx * x - by * y
        at.qpos[position + 1] = by
        at.qpos[position + 2] = -bx
        at.qvel[velocity] = w_rate - bx_rate * x - by_rate * y
        at.qvel[velocity + 1] = by_rate
        at.qvel[velocity + 2] = -bx_rate


@compiled
def _place_piston(at, surface, q, rate):
    """Put the plate under a guided part at its height; a piston is the same everywhere."""
    at.qpos[at.patch_qpos[0]] = at.qvel[at.patch_qvel[0]] = 0.0
    for s in range(q.shape[0]):
        at.qpos[at.patch_qpos[0]] += surface.table[s, 0, 0, 0] * q[s]
        at.qvel[at.patch_qvel[0]] += surface.table[s, 0, 0, 0] * rate[s]


@compiled
def _step_guided(at, log, t):
    """Step a scene with a guided part, and note its contacts with the plate."""
    before = at.factor * at.qvel[at.part_qvel[0] + at.vertical]
    plate = at.qvel[at.patch_qvel[0]]
    mj_step(at.model, at.data)
    if at.touch[0] > 0.0:
        if not in_contact(log):
            begin_contact(log, t, max(plate - before, 0.0))
    elif in_contact(log):
        end_contact(log, t, before)


@entry_point
def _advance(at, surface, flight, log, timestep, first_step, steps_per_frame, qpos_out, qvel_out):
    """Step the scene; after every `steps_per_frame` steps copy the state into a row of qpos_out and qvel_out."""
    n_shapes = surface.table.shape[0]
    q, q_next, rate, unused = np.zeros(n_shapes), np.zeros(n_shapes), np.zeros(n_shapes), np.zeros(n_shapes)
    modes = np.zeros((n_shapes, 3))
    drive = (surface.term_shape, surface.term_start, surface.term_stop, surface.coefficient, surface.rate)
    place, motion = at.qpos[at.part_qpos[0] : at.part_qpos[0] + 7], at.qvel[at.part_qvel[0] : at.part_qvel[0] + 6]
    step, known = first_step, -1  # the step for which q_next is known
    for frame in range(qpos_out.shape[0]):
        last = first_step + (frame + 1) * steps_per_frame
        while step < last:
            if at.interrupt[ENDED] != 0:
                return step
            flown = leap(place, motion, flight, timestep, last - step)
            if flown > 0:
                step += flown
                continue
            if known != step:
                modal_motion(step * timestep, *drive, q_next, unused)
            step += 1
            known = step
            q[:] = q_next
            modal_motion(step * timestep, *drive, q_next, unused)
            rate[:] = (q_next - q) / timestep
            if at.guided:
                _place_piston(at, surface, q, rate)
                _step_guided(at, log, (step - 1) * timestep)
            else:
                place_patches(at, surface, q, rate, modes)
                mj_step(at.model, at.data)
        qpos_out[frame] = at.qpos
        qvel_out[frame] = at.qvel
        at.interrupt[WHOLE] = frame + 1
        if not np.isfinite(at.qpos.sum()):
            # MuJoCo's solver is slow on NaN and nothing comes after it.
            qpos_out[frame:] = np.nan
            qvel_out[frame:] = np.nan
            at.interrupt[WHOLE] = qpos_out.shape[0]
            break
    return step


class MujocoEngine:
    """MuJoCo behind the engine protocol.

    Attributes:
        model, data: MuJoCo's own, for inspection.
    """

    name = "mujoco"
    frames_per_block = BLOCK_FRAMES // 3

    def __init__(
        self,
        scene: Scene,
        rng: np.random.Generator,
        *,
        threads: int = 1,
        interrupt: NDArray[np.int64] | None = None,
    ) -> None:
        del threads  # it steps a scene on one
        self.model = build_mjcf(scene).compile()
        self.data = mujoco.MjData(self.model)
        self._scene = scene
        parts = [self.model.joint(part.name) for part in scene.parts]
        guide = scene.guides[0]
        self._slide = guide if guide and guide.slides else None
        mocap = scene.scenario.mujoco.plate == "mocap"
        patches = [] if mocap else [self.model.joint(f"lift_{part.name}") for part in scene.parts]
        self._part_qpos = np.array([joint.qposadr[0] for joint in parts])
        self._part_qvel = np.array([joint.dofadr[0] for joint in parts])
        self._at = Addresses(
            model=self.model._address,
            data=self.data._address,
            qpos=self.data.qpos,
            qvel=self.data.qvel,
            part_qpos=self._part_qpos,
            part_qvel=self._part_qvel,
            patch_qpos=np.array([joint.qposadr[0] for joint in patches], np.int64),
            patch_qvel=np.array([joint.dofadr[0] for joint in patches], np.int64),
            guided=guide is not None,
            vertical=0 if self._slide else 2,
            factor=float(self._slide.axis[2]) if self._slide else 1.0,
            touch=self.data.sensordata,
            interrupt=new_interrupt() if interrupt is None else interrupt,
            mocap=mocap,
            mocap_pos=self.data.mocap_pos,
            mocap_quat=self.data.mocap_quat,
            depth=-float(self.model.body(f"plate_{scene.parts[0].name}").pos[2]),
        )
        self._surface = surface_arrays(scene)
        self._flight = flight_of(scene)
        self._log = new_log(1)
        self._there = np.ones(len(scene.parts), bool)
        self._last_pose = np.zeros((len(scene.parts), 7))
        self._poses = start_poses(scene, rng)
        self.put_at_start()

    def put_at_start(self) -> None:
        """Go to t = 0, with all parts where they start."""
        scene = self._scene
        mujoco.mj_resetData(self.model, self.data)
        self._step, self._there[:] = 0, True
        attitudes = scene.principal_attitudes(np.array([pose.quaternion for pose in self._poses]))
        for start, pose, attitude, part in zip(self._part_qpos, self._poses, attitudes, scene.parts, strict=True):
            if self._slide:
                self._turn_on_slide(part.name, attitude)
                self.data.qpos[start] = (pose.position - self.model.body(part.name).pos) @ self._slide.axis
            else:
                self.data.qpos[start : start + 3] = pose.position
                self.data.qpos[start + 3 : start + 7] = attitude
        if self._slide is None:
            from scipy.spatial.transform import Rotation

            for start, pose, attitude in zip(self._part_qvel, self._poses, attitudes, strict=True):
                self.data.qvel[start : start + 3] = pose.velocity
                if pose.angular_velocity.any():  # in the body's own axes
                    turned = Rotation.from_quat(attitude, scalar_first=True)
                    self.data.qvel[start + 3 : start + 6] = turned.inv().apply(pose.angular_velocity)
        self.remove(np.array([part for part, pose in enumerate(self._poses) if not pose.present], np.int64))

    def _turn_on_slide(self, name: str, quaternion: NDArray[np.float64]) -> None:
        """Give the part on the slide its attitude for good; the joint's axis is in the part's own frame."""
        from scipy.spatial.transform import Rotation

        assert self._slide is not None
        turned = Rotation.from_quat(quaternion, scalar_first=True)
        self.model.body(name).quat[:] = quaternion
        self.model.joint(name).axis[:] = turned.inv().apply(self._slide.axis)

    @property
    def counts(self) -> Counts:
        return Counts()

    def current(self) -> Frames:
        return self._frames(self.data.qpos[None].copy(), self.data.qvel[None].copy(), self._step)

    def advance(self, n_frames: int) -> Frames:
        scene = self._scene
        qpos, qvel = np.empty((n_frames, self.model.nq)), np.empty((n_frames, self.model.nv))
        if self._at.guided:  # a contact takes a step, and the flight after it another one
            self._log = room_for(self._log, n_frames * scene.steps_per_frame // 2 + 1)
        first, self._at.interrupt[WHOLE] = self._step, 0
        timestep = scene.timestep
        self._step = self._step_on(timestep, qpos, qvel)
        self.data.time = self._step * timestep
        whole = slice(self._at.interrupt[WHOLE])
        if whole.stop == 0:
            return self.current()[whole]
        return self._frames(qpos[whole], qvel[whole], first + scene.steps_per_frame)

    def _step_on(self, timestep: float, qpos: NDArray[np.float64], qvel: NDArray[np.float64]) -> int:
        """Step, and write the states at the frames into the rows of qpos and qvel; returns the step then."""
        arguments = (self._at, self._surface, self._flight, self._log, timestep)
        return _advance(*arguments, self._step, self._scene.steps_per_frame, qpos, qvel)

    def remove(self, parts: NDArray[np.int64]) -> None:
        for part in parts:
            start, speed = self._part_qpos[part], self._part_qvel[part]
            self._last_pose[part] = self.data.qpos[start : start + 7]
            self.data.qpos[start + 2] = PARKED - part  # where it falls on without meeting anything
            self.data.qvel[speed : speed + 6] = 0.0
        self._there[parts] = False

    def add(self, parts: NDArray[np.int64], poses: Sequence[Pose]) -> None:
        attitudes = self._scene.principal_attitudes_of(parts, [pose.quaternion for pose in poses])
        for part, pose, attitude in zip(parts, poses, attitudes, strict=True):
            start, speed = self._part_qpos[part], self._part_qvel[part]
            self.data.qpos[start : start + 3] = pose.position
            self.data.qpos[start + 3 : start + 7] = attitude
            self.data.qvel[speed : speed + 6] = 0.0
            self.data.qvel[speed : speed + 3] = pose.velocity
            self.data.qacc_warmstart[speed : speed + 6] = 0.0
        self._there[parts] = True

    def redrive(self, scene: Scene) -> None:
        self._scene = scene
        self._surface = surface_arrays(scene)
        self._flight = flight_of(scene)

    def take_impacts(self, *, end: bool) -> Events:
        return take_impacts(self._log, end=end)

    def _frames(self, qpos: NDArray[np.float64], qvel: NDArray[np.float64], first_step: int) -> Frames:
        """Cut the parts out of MuJoCo's state vectors; rotate the body-frame angular velocity to the world."""
        from scipy.spatial.transform import Rotation

        if self._slide:
            return self._sliding(qpos, qvel, first_step)
        columns, speeds = self._part_qpos[:, None] + np.arange(7), self._part_qvel[:, None] + np.arange(6)
        pose, motion = qpos[:, columns], qvel[:, speeds]
        pose[:, ~self._there], motion[:, ~self._there] = self._last_pose[~self._there], 0.0
        quaternion, spin = pose[..., 3:], motion[..., 3:]
        valid = np.isfinite(quaternion).all(axis=-1) & (np.abs(quaternion).max(axis=-1) > 0)
        upright = np.where(valid[..., None], quaternion, [1.0, 0.0, 0.0, 0.0])
        turned = Rotation.from_quat(upright.reshape(-1, 4), scalar_first=True).apply(spin.reshape(-1, 3))
        return Frames(
            time=self._times(len(qpos), first_step),
            position=pose[..., :3],
            quaternion=self._scene.attitudes(quaternion),
            velocity=motion[..., :3],
            angular_velocity=turned.reshape(spin.shape),
            present=np.tile(self._there, (len(qpos), 1)),
        )

    def _sliding(self, qpos: NDArray[np.float64], qvel: NDArray[np.float64], first_step: int) -> Frames:
        """Frames of a part on a slide: one coordinate along its axis."""
        assert self._slide is not None
        n, axis = len(qpos), self._slide.axis
        rest = self.model.body(self._scene.parts[0].name).pos
        return Frames(
            time=self._times(n, first_step),
            position=(rest + qpos[:, self._part_qpos] * axis)[:, None],
            quaternion=np.tile(self._poses[0].quaternion, (n, 1, 1)),
            velocity=(qvel[:, self._part_qvel] * axis)[:, None],
            angular_velocity=np.zeros((n, 1, 3)),
            present=np.ones((n, 1), bool),
        )

    def _times(self, n: int, first_step: int) -> NDArray[np.float64]:
        steps = first_step + self._scene.steps_per_frame * np.arange(n)
        return np.asarray(steps * self._scene.timestep, float)
