"""Engine `impulse` of one part without a time step (`run.tolerance_nm`)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from feeder_sim.engines.impact_log import new_log, room_for, take_impacts
from feeder_sim.engines.impulse.frame_rows import ROW
from feeder_sim.engines.impulse.free_part.loop import FreePart, advance
from feeder_sim.engines.impulse.free_part.notes import Notes
from feeder_sim.engines.impulse.parts_engine import PartsEngine
from feeder_sim.engines.impulse.scratch import new_scratch
from feeder_sim.engines.impulse.state import ABSENT
from feeder_sim.engines.impulse.surroundings import WINDOW, Tube, read_walls
from feeder_sim.engines.noise import new_streams
from feeder_sim.machine_code import lasting
from feeder_sim.records.seed import Counts, Events
from feeder_sim.records.trajectory import Frames
from feeder_sim.scene.scene import Scene
from feeder_sim.scene.start import Pose

SAME_CONTACT = 1.5  # usual steps between two impacts that count as one contact


class FreePartEngine(PartsEngine):
    """One free part whose contacts have no step behind the engine protocol; starts and frames are the general ones'."""

    def __init__(
        self,
        scene: Scene,
        rng: np.random.Generator,
        *,
        threads: int = 1,
        interrupt: NDArray[np.int64] | None = None,
    ) -> None:
        del threads  # one part needs one
        super().__init__(scene, rng, interrupt=interrupt)
        self._scratch = lasting(new_scratch(self._kinds, scene.surface.n_shapes))
        self._parts["draws"][:1] = new_streams(rng, 1)
        self._loads = np.zeros((len(self._scratch.point), 6))
        self._wall = read_walls(scene)
        self._notes = Notes(new_log(1), np.zeros(2), SAME_CONTACT * scene.timestep)

    @property
    def counts(self) -> Counts:
        return Counts(*self._scratch.counts.tolist())

    def advance(self, n_frames: int) -> Frames:
        scene, rows = self._scene, np.empty((n_frames, 1, ROW))
        times = np.asarray((self._frame + 1 + np.arange(n_frames)) * scene.frame_interval, float)
        frames = self._rows_to_fill(times, rows)
        if isinstance(self._wall, Tube):
            room = int(n_frames * scene.frame_interval / self._notes.apart) + 2
            self._notes = self._notes._replace(log=room_for(self._notes.log, room))
        free = FreePart(self._parts[:1], self._loads, self._kinds, self._scratch, self._wall, self._notes)
        advance(free, self._drive(WINDOW), self._clock, frames)
        return self._advanced(rows)

    def remove(self, parts: NDArray[np.int64]) -> None:
        self._begin_window_now()
        self._parts["there"][parts] = ABSENT

    def add(self, parts: NDArray[np.int64], poses: Sequence[Pose]) -> None:
        raise NotImplementedError("nothing is refilled where one part is computed without a step")

    def take_impacts(self, *, end: bool) -> Events:
        log, last, apart = self._notes
        over = self._frame * self._scene.frame_interval - last[0] > apart
        return take_impacts(log, end=end, over=(float(last[0]), float(last[1])) if over else None)
