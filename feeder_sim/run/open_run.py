"""One seed whose stages are chosen while it runs, and whose parts are picked and filled in from outside."""

from __future__ import annotations

import threading
import time
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from feeder_sim.measures.stage_lines import stage_lines
from feeder_sim.records.seed import Cause, Events, Seed, Status, removed
from feeder_sim.records.trajectory import Frames
from feeder_sim.run.seed_run import SeedRun, arrived
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.refill import fill_in
from feeder_sim.scene.scene import Scene
from feeder_sim.scene.start import generator, next_parts


class OpenRun(SeedRun):
    """The loop of a seed, stage by stage: the state of parts and plate goes on from each to the next.

    Args:
        prepared: a scene whose schedule has every stage that may come, and a sequence; when they come is not in it.
        threads: as for `SeedRun`.

    Attributes:
        status: UNFINISHED while it can go on.
    """

    def __init__(self, prepared: Prepared, *, threads: int = 1) -> None:
        super().__init__(replace(prepared, scene=prepared.scene.up_to_stage(0)), 0, threads=threads)
        self._prepared, self._stages_started = prepared, 0
        self._never = threading.Event()
        self._wall_s, self._refills = 0.0, 0
        self.status = Status.UNFINISHED
        self._open()

    def widen(self, prepared: Prepared) -> None:
        """Let more stages be chosen, whose drives move no other modes, and none faster."""
        self._prepared = prepared
        self._guard.widen(prepared)

    def run_stages(self, scene: Scene) -> None:
        """Compute those stages of a scene that have not begun, or up to when no part is left.

        Args:
            scene: has the stages that there were, with the times at which they have ended, and new ones.

        Raises:
            SimulationDiverged: a state is not valid; what was before it is kept.
        """
        started = time.perf_counter()
        waits = [stage.until.for_s for stage in scene.times.stages[self._stages_started :] if stage.until]
        if waits:
            self._lines, self._history.history_s = stage_lines(scene), max(waits)
        self._full_scene = scene
        try:
            while self._stages_started < len(scene.times.stages) and self.status == Status.UNFINISHED:
                self._begin_stage()
                while self._history.n_frames < self._scene.n_frames and self.status == Status.UNFINISHED:
                    block = self._advance(self._never)
                    assert block is not None  # nobody stops it
                    self.status = block.status
                    if block.failure is not None:
                        raise block.failure
        finally:
            self._wall_s += time.perf_counter() - started

    def _is_over(self, n_frames: int) -> bool:
        return False

    def current(self) -> Frames:
        """The present state as a single frame."""
        return self._engine.current()

    @property
    def removals(self) -> Events:
        """All parts taken out so far."""
        return self._history.removals

    @property
    def stops(self) -> NDArray[np.float64]:
        """When the drives of the first stages have stopped [s]."""
        return self._history.stops

    def pick(self, parts: NDArray[np.int64]) -> None:
        """Pick parts by their indices."""
        now = self.current()
        self._engine.remove(parts)
        self._history.append(Seed(now[slice(0, 0)], removals=removed(parts, float(now.time[0]), Cause.PICKED)))
        if len(self.removals) == len(self._full_scene.parts) and self._full_scene.scenario.refill is None:
            self.status = Status.DONE

    def refill(self, number: int) -> NDArray[np.int64]:
        """Fill in parts where the refill of the scenario says; returns the indices of those that there was room for."""
        scene, now = self._prepared.scene, self.current()
        self._refills += 1
        rng = generator(scene, 0, self._refills)
        parts, poses = fill_in(scene, now, next_parts(scene, ~now.present[0], number, rng), rng)
        if len(parts):
            self._engine.add(parts, poses)
            arrivals = arrived(float(now.time[0]), parts, self._refills, poses)
            self._guard.arrive(arrivals, self.current())
            self._history.append(Seed(now[slice(0, 0)], arrivals=arrivals))
        return parts

    def forget(self) -> None:
        """Keep no more of the past in memory than the next stages need; `ended` cannot be asked for."""
        self._history.retains_all = False

    def ended(self) -> Seed:
        """All that was recorded, as of a seed that ends now."""
        status = Status.DONE if self.status == Status.UNFINISHED else self.status
        return replace(self._history.to_seed(), status=status, wall_s=self._wall_s, counts=self._engine.counts)
