"""Engine `mujoco` over a plate that takes the impulses of the parts (`reaction = true`).

The forces that contacts exert on a patch are those on its three joints. As a mode moves these joints by (w - beta . x,
beta_y, -beta_x), they do work on the mode as on a force of its own; that force times the step, over the modal mass, is
what the modal velocity changes by. It acts from the next step on.

That a patch gives way under the impact itself takes an inertia that is no larger than that of the plate under the part,
1 / sum of w_j^2 / m_j: the lift of the patch has it, while its tilts stay as heavy as they are.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from feeder_sim.engines.mujoco.engine import MujocoEngine, mj_step, place_patches
from feeder_sim.engines.mujoco.free_flight import Flight, leap
from feeder_sim.engines.reaction import crest_of_reaction, react, reaction_of, set_reaction, with_reaction
from feeder_sim.machine_code import compiled, entry_point
from feeder_sim.plate.compiled import modal_motion, surface_modes
from feeder_sim.scene.free_modes import free_modes
from feeder_sim.scene.scene import Scene


class Plate(NamedTuple):
    """What the parts act on, in MuJoCo's units.

    force: of all constraints on the degrees of freedom of the scene (nv,); armature: what is added to their inertia
    (nv,); inertia: of the lift of every patch without that (parts,); inverse_mass: of the modes (n_shapes,); per_metre:
    by how much each raises the crest; taken, changed: room, see `react`.
    """

    force: NDArray[np.float64]
    armature: NDArray[np.float64]
    inertia: NDArray[np.float64]
    inverse_mass: NDArray[np.float64]
    per_metre: NDArray[np.float64]
    taken: NDArray[np.float64]
    changed: NDArray[np.complex128]


@compiled
def _soften(at, surface, plate, modes):
    """Give the lift of every patch the inertia of the plate under its part, where that is less than its own."""
    for part in range(at.part_qpos.shape[0]):
        x, y = at.qpos[at.part_qpos[part]], at.qpos[at.part_qpos[part] + 1]
        surface_modes(x, y, surface.grid_x, surface.grid_y, surface.table, modes)
        yields = 0.0
        for s in range(modes.shape[0]):
            yields += plate.inverse_mass[s] * modes[s, 0] ** 2
        softer = yields * plate.inertia[part] > 1.0
        plate.armature[at.patch_qvel[part]] = 1.0 / yields - plate.inertia[part] if softer else 0.0


@compiled
def _take(at, surface, plate, t, timestep, modes):
    """Take from the modes what the contacts of the step that ended at time t exert on the patches."""
    touched = False
    plate.taken[:] = 0.0
    for part in range(at.part_qpos.shape[0]):
        lift = at.patch_qvel[part]
        up, about_x, about_y = plate.force[lift], plate.force[lift + 1], plate.force[lift + 2]
        if up == 0.0 and about_x == 0.0 and about_y == 0.0:
            continue
        touched = True
        x, y = at.qpos[at.part_qpos[part]], at.qpos[at.part_qpos[part] + 1]
        surface_modes(x, y, surface.grid_x, surface.grid_y, surface.table, modes)
        for s in range(modes.shape[0]):
            w, bx, by = modes[s, 0], modes[s, 1], modes[s, 2]
            force = up * (w - bx * x - by * y) + about_x * by - about_y * bx
            plate.taken[s] -= timestep * force * plate.inverse_mass[s]
    if touched:
        react(surface, t, plate.taken, plate.changed)


@entry_point
def _advance(at, surface, flight, plate, timestep, steps, qpos_out, qvel_out):
    """As that of engine.py, for parts without guides; steps: the first, and how many make a frame."""
    step, steps_per_frame = steps
    n_shapes = surface.table.shape[0]
    q, q_next, rate, unused = np.zeros(n_shapes), np.zeros(n_shapes), np.zeros(n_shapes), np.zeros(n_shapes)
    modes = np.zeros((n_shapes, 3))
    drive = (surface.term_shape, surface.term_start, surface.term_stop, surface.coefficient, surface.rate)
    place, motion = at.qpos[at.part_qpos[0] : at.part_qpos[0] + 7], at.qvel[at.part_qvel[0] : at.part_qvel[0] + 6]
    first = step
    for frame in range(qpos_out.shape[0]):
        last = first + (frame + 1) * steps_per_frame
        while step < last:
            if at.interrupt[0] != 0:
                return step
            crest = flight.crest + crest_of_reaction(surface, plate.per_metre)
            over = Flight(flight.corners, flight.radius, flight.reach, flight.inertia, flight.gravity, crest)
            flown = leap(place, motion, over, timestep, last - step)
            if flown > 0:
                step += flown
                continue
            modal_motion(step * timestep, *drive, q, unused)
            step += 1
            modal_motion(step * timestep, *drive, q_next, unused)
            rate[:] = (q_next - q) / timestep
            place_patches(at, surface, q, rate, modes)
            _soften(at, surface, plate, modes)
            mj_step(at.model, at.data)
            _take(at, surface, plate, step * timestep, timestep, modes)
        qpos_out[frame] = at.qpos
        qvel_out[frame] = at.qvel
        if not np.isfinite(at.qpos.sum()):
            qpos_out[frame:] = np.nan
            qvel_out[frame:] = np.nan
            break
    return step


class ReactingMujocoEngine(MujocoEngine):
    """MuJoCo, whose contacts act on the plate as well; its state also holds `reaction`, see `reaction_of`."""

    def __init__(
        self,
        scene: Scene,
        rng: np.random.Generator,
        *,
        threads: int = 1,
        interrupt: NDArray[np.int64] | None = None,
    ) -> None:
        super().__init__(scene, rng, threads=threads, interrupt=interrupt)
        modes, (antinode, steepest), units = free_modes(scene.driven), scene.surface.extremes, self._units
        self._rate = modes.rate / units.time
        lifts = self.model.dof_bodyid[self._at.patch_qvel]
        self._plate = Plate(
            force=self.data.qfrc_constraint,
            armature=self.model.dof_armature,
            inertia=self.model.body_mass[lifts].copy(),
            inverse_mass=1.0 / (modes.modal_mass * units.mass),
            per_metre=antinode + 2.0 * scene.kinds[0].size * steepest,
            taken=np.zeros(len(modes.rate)),
            changed=np.zeros(len(modes.rate), complex),
        )
        self._surface = with_reaction(self._surface, self._rate)

    def _step_on(self, timestep: float, qpos: NDArray[np.float64], qvel: NDArray[np.float64]) -> int:
        steps = (self._step, self._scene.steps_per_frame)
        done = _advance(self._at, self._surface, self._flight, self._plate, timestep, steps, qpos, qvel)
        return done

    def redrive(self, scene: Scene) -> None:
        reaction = reaction_of(self._surface)
        super().redrive(scene)
        self._surface = with_reaction(self._surface, self._rate)
        set_reaction(self._surface, reaction)

    def state(self) -> dict[str, NDArray[Any]]:
        return super().state() | {"reaction": reaction_of(self._surface)}

    def restore(self, state: dict[str, NDArray[Any]]) -> None:
        super().restore(state)
        set_reaction(self._surface, state["reaction"])
