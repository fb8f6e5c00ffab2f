"""Engine `impulse` of many parts without a time step (`run.tolerance_nm`)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from feeder_sim.engines.impact_log import new_log
from feeder_sim.engines.impulse.crowd import Window, WindowResult
from feeder_sim.engines.impulse.engine import ImpulseEngine
from feeder_sim.engines.impulse.frame_rows import FrameRows
from feeder_sim.engines.impulse.free_part.notes import Notes
from feeder_sim.engines.impulse.joint.loop import advance_together, open_plate
from feeder_sim.engines.impulse.joint.moved_fixtures import MovedFixtures
from feeder_sim.engines.impulse.joint.room import Tools, new_together
from feeder_sim.engines.impulse.state import copied
from feeder_sim.engines.impulse.surroundings import WINDOW, Plate, read_walls
from feeder_sim.engines.noise import new_streams
from feeder_sim.machine_code import lasting
from feeder_sim.records.seed import Counts
from feeder_sim.scene.scene import Scene
from feeder_sim.scene.start import Pose

IMPACTS, COARSE = 300.0, 1e-9  # [1/s]: of a tolerance, how closely impacts of several are solved; [m], from where on


class JointEngine(ImpulseEngine):
    """Parts whose contacts have no step; windows, threads, removal and refill are the general engine's."""

    _single_apart = False

    def __init__(
        self,
        scene: Scene,
        rng: np.random.Generator,
        *,
        threads: int = 1,
        interrupt: NDArray[np.int64] | None = None,
    ) -> None:
        threads = 1 if scene.fixtures else threads  # a fixture is at one time only
        super().__init__(scene, rng, threads=threads, interrupt=interrupt)
        self._fixtures = MovedFixtures(scene)
        self._wall, tolerance = read_walls(scene), self._exact.tolerance
        if tolerance > COARSE:
            impacts = IMPACTS * tolerance
            self._exact = self._exact._replace(impacts=impacts, approach=3.0 * impacts)
        self._parts = self._parts[: self._n + len(scene.fixtures)].copy()  # a rim is around each of them
        self._parts["draws"][: self._n] = new_streams(rng, self._n)
        self._opened = copied(self._parts)
        n_shapes = scene.surface.n_shapes
        notes = Notes(new_log(1), np.zeros(2), 0.0)
        self._joint_tools = [
            lasting(
                Tools(
                    of.hulls,
                    of.work,
                    of.meeting,
                    new_together(self._kinds, self._n, n_shapes),
                    notes,
                    self._parts[:1].copy(),
                )
            )
            for of in self._tools
        ]
        rows = self._joint_tools[0].work.point.shape[0]
        self._loads = np.zeros((self._n, rows, 6))
        self._loads_opened = self._loads.copy()
        self._plate_span = np.array([-2.0, -1.0])

    def _open_plate(self) -> None:
        """Terms and bounds of the window of the plate that the window under way lies in."""
        start, end = self._span
        if start < self._plate_span[0] or end > self._plate_span[1] + 1e-9:
            self._plate_span[:] = start, start + WINDOW
            # Bounds outlast the window: nothing is due at its very end.
            terms, bounds = open_plate(self._drive(WINDOW), start, start + WINDOW + 1e-5)
            bounds = bounds._replace(calm=bounds.calm and not self._fixtures.move_within(*self._plate_span))
            self._plate = lasting(Plate(terms, bounds, self._wall))

    def _place_at_begin(self) -> None:
        super()._place_at_begin()
        self._loads = self._loads_opened.copy()
        self._open_plate()

    def _advance_share(self, window: Window, frames: FrameRows) -> WindowResult:
        opens, tools = window.start == self._plate_span[0], self._joint_tools[window.thread]
        return advance_together(window, opens, self._parts, self._loads, self._kinds, self._plate, tools, frames)

    def _keep_begin_of_window(self) -> None:
        super()._keep_begin_of_window()
        self._loads_opened = self._loads
        if self._fixtures.any:
            self._fixtures.place(self._opened, float(self._span[0]))

    def _window_end(self, start: float) -> float:
        end = super()._window_end(start)
        return min(end, self._fixtures.next_change(start)) if self._fixtures.any else end

    def redrive(self, scene: Scene) -> None:
        super().redrive(scene)
        self._fixtures = MovedFixtures(scene)

    def _keep_unresolved(self) -> None:
        """They are counted where they come up."""

    def _forget_unresolved(self) -> None:
        """Keep all counts: those of a window that is computed again, which is rare, count twice."""

    def _begin_window_now(self) -> None:
        super()._begin_window_now()
        self._plate_span[:] = -2.0, -1.0
        now = self._frame * self._scene.frame_interval
        for state in (self._parts, self._opened):
            state["due"] = now

    def remove(self, parts: NDArray[np.int64]) -> None:
        super().remove(parts)
        for pairs in (self._pairs, self._pairs_before):
            pairs["pressing"][np.isin(pairs["a"], parts) | np.isin(pairs["b"], parts)] = 0

    def add(self, parts: NDArray[np.int64], poses: Sequence[Pose]) -> None:
        draws = self._parts["draws"][parts].copy()
        super().add(parts, poses)
        now = self._frame * self._scene.frame_interval
        for state in (self._parts, self._opened):
            state["draws"][parts], state["due"][parts] = draws, now

    @property
    def counts(self) -> Counts:
        counts = [tools.work.counts + tools.together.work.counts for tools in self._joint_tools]
        return Counts(*np.sum(counts, axis=0).tolist())
