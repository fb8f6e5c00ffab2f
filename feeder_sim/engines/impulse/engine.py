"""Engine `impulse`: rigid contact by impulses; parts fly in closed form and leap to the earliest possible contact.

Time is cut into windows. In each window

    window      which terms of the plate's motion act, and bounds on what it can do (window.py)
    pairs       which parts can meet at all, from a grid; the islands that such pairs make (pairs/neighbours.py)
    islands     each advances by itself, event by event (island.py): looks at parts over the plate (plate_contact.py)
                and at pairs (pairs/), impacts (impact.py), how long parts may fly (flight_time.py), and their
                flights (free_flight.py)
    components  what touches and lies still at the end of a window sleeps (components.py)

(Conservative advancement: Mirtich, PhD thesis, Berkeley 1996.) The step is what ends the infinite rattling of a part at
rest: corners may enter the surface by what they cover in one step, and are put back on it at the impact. Islands are
shared out over threads, which changes nothing in the result.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from feeder_sim.engines.impulse.alone import Alone, advance_alone
from feeder_sim.engines.impulse.crowd import Window, WindowResult
from feeder_sim.engines.impulse.frame_rows import ROW, FrameRows
from feeder_sim.engines.impulse.island import Tools, advance_islands
from feeder_sim.engines.impulse.pairs.due import PAIR
from feeder_sim.engines.impulse.pairs.hulls import HullLibrary
from feeder_sim.engines.impulse.pairs.separating_axis import new_meeting
from feeder_sim.engines.impulse.parts_engine import PartsEngine
from feeder_sim.engines.impulse.scratch import UNRESOLVED, new_scratch
from feeder_sim.engines.impulse.state import ABSENT, ALONE, ASLEEP, AWAKE, copied, new_parts
from feeder_sim.engines.impulse.window import Drive
from feeder_sim.engines.protocol import ENDED, WHOLE, new_interrupt
from feeder_sim.machine_code import lasting
from feeder_sim.records.seed import Counts, Events, impacts_of
from feeder_sim.records.trajectory import Frames
from feeder_sim.scene.scene import Scene
from feeder_sim.scene.start import Pose

WINDOW = 1e-3  # [s], where parts can meet: shorter ones find the pairs too often, longer ones find too many
WINDOW_ALONE = 1e-2  # [s], of a single part: for bounds on the plate that follow its ring-up
WIDER = 1.5  # times the distance of the farthest part: its reach when a window is computed again


class ImpulseEngine(PartsEngine):
    """Rigid impulses behind the engine protocol.

    The state goes from window to window of a grid of its own, which only what acts on the parts (`remove`, `redrive`)
    begins anew. Of many parts a whole window is computed at once, with the frames in it: `_opened` are the parts at its
    begin, from which it can be computed again up to any time in it.
    """

    _single_apart = True  # a lone part has a loop of its own
    _yields = False  # the plate takes impulses
    _window = WINDOW

    def __init__(
        self,
        scene: Scene,
        rng: np.random.Generator,
        *,
        threads: int = 1,
        interrupt: NDArray[np.int64] | None = None,
    ) -> None:
        super().__init__(scene, rng, interrupt=interrupt)
        kinds = self._kinds
        self._threads = max(1, threads)
        self._alone = self._single_apart and self._n == 1 and not scene.rim and scene.scenario.refill is None
        size = kinds, scene.surface.n_shapes, scene.surface.n_shapes * self._yields
        self._work = [new_scratch(*size) for _ in range(self._threads)]
        corners = np.split(kinds.corners, kinds.piece["corner_from"][1:])
        radii = [*kinds.record["radius"], *np.zeros(len(corners) - len(kinds.record))]  # only a hull is a ball
        self._libraries = [HullLibrary(corners, radii) for _ in range(0 if self._alone else self._threads)]
        self._tools = [
            lasting(Tools(library.hulls(), work, new_meeting(kinds)))
            for library, work in zip(self._libraries, self._work, strict=False)
        ]
        self._pool = ThreadPoolExecutor(self._threads) if self._threads > 1 else None
        self._window_drive: Drive | None = None
        self._unresolved = 0
        self._opened = self._parts.copy()
        self._span = np.zeros(2)  # the window of many parts: its begin and end [s]
        self._pairs = self._pairs_before = np.empty(0, PAIR)

    def advance(self, n_frames: int) -> Frames:
        scene, rows = self._scene, np.empty((n_frames, self._n, ROW))
        times = np.asarray((self._frame + 1 + np.arange(n_frames)) * scene.frame_interval, float)
        if self._alone:
            drive = self._drive(WINDOW_ALONE)
            frames = self._rows_to_fill(times, rows)
            advance_alone(Alone(self._parts, self._kinds, self._work[0]), drive, self._clock, frames)
        else:
            self._interrupt[WHOLE] = 0
            self._advance_crowd(times, rows)
        return self._advanced(rows)

    def _advance_crowd(self, times: NDArray[np.float64], rows: NDArray[np.float64]) -> None:
        """Compute the windows that the frames lie in, or end with; the one under way may hold some of them."""
        in_order = times.tolist()
        done = bisect_right(in_order, self._span[1])
        if done:
            self._compute_window(self._span[1], FrameRows(times[:done], rows[:done], self._interrupt))
            self._interrupt[WHOLE] = 0 if self._interrupt[ENDED] else done
        while done < len(times):  # at least once, so that an engine that is ended at once has been compiled
            start = self._span[1]
            self._span[:] = start, self._window_end(start)
            self._keep_begin_of_window()
            last = bisect_right(in_order, self._span[1])
            self._compute_window(self._span[1], FrameRows(times[done:last], rows[done:last], self._interrupt))
            if self._interrupt[ENDED]:
                break
            self._interrupt[WHOLE] = done = last

    def _window_end(self, start: float) -> float:
        """When a window that begins at a time ends [s]."""
        return start + self._window

    def _compute_window(self, until: float, frames: FrameRows | None = None) -> None:
        """Compute the window under way from its begin until a time in it [s].

        Without frames to write it is not interrupted: what it comes to is kept.
        """
        if frames is None:
            frames = FrameRows(np.empty(0), np.empty((0, self._n, ROW)), new_interrupt())
        absent = np.flatnonzero(self._opened["there"][: self._n] == ABSENT)
        if len(absent):
            frames.row[:, absent] = self._row[absent]
        self._place_at_begin()
        self._pairs = self._pairs_before[:0]
        (start, end), reach = self._span, 0.0
        while len(absent) < self._n:
            window = Window(self._opened, self._pairs_before, start, end, until, reach, thread=0, threads=1)
            results = self._advance_shares(window, frames)
            self._pairs = results[0].pairs
            for result in results[1:]:
                self._pairs[result.own] = result.pairs[result.own]
            distances = [result.distance for result in results]
            if not any(distances) or frames.interrupt[ENDED] or not all(map(math.isfinite, distances)):
                break  # what is not finite is for the guard to see
            reach = float(WIDER * max(results[0].reach, *distances))
            self._place_at_begin()

    def _place_at_begin(self) -> None:
        """Put the parts, and what changes with them, where the window under way begins."""
        self._forget_unresolved()
        self._parts = copied(self._opened)

    def _advance_shares(self, window: Window, frames: FrameRows) -> list[WindowResult]:
        """Advance all islands, in parallel where there are threads."""
        if self._pool is None:
            return [self._advance_share(window, frames)]
        shares = [window._replace(thread=i, threads=self._threads) for i in range(self._threads)]
        tasks = [self._pool.submit(self._advance_share, share, frames) for share in shares]
        return [task.result() for task in tasks]

    def _advance_share(self, window: Window, frames: FrameRows) -> WindowResult:
        """Advance the islands of a thread."""
        if self._window_drive is None:
            self._window_drive = lasting(self._drive(self._window))
        tools = self._tools[window.thread]
        return advance_islands(window, self._parts, self._n, self._kinds, self._window_drive, tools, frames)

    def redrive(self, scene: Scene) -> None:
        super().redrive(scene)
        self._window_drive = None

    def _begin_window_now(self) -> None:
        """End the window under way at the last frame: what happens there acts on the parts from then on."""
        if self._alone:
            super()._begin_window_now()
            return
        now = self._frame * self._scene.frame_interval
        if now < self._span[1]:
            self._compute_window(now)
        self._span[:] = now, now
        self._keep_begin_of_window()

    def _keep_begin_of_window(self) -> None:
        self._opened, self._pairs_before = copied(self._parts), self._pairs
        self._keep_unresolved()

    def _keep_unresolved(self) -> None:
        """Add the impacts of the window that is over to those before."""
        self._unresolved = self.counts.unresolved_impacts
        self._forget_unresolved()

    def _forget_unresolved(self) -> None:
        """Count the impacts of the window under way anew."""
        for work in self._work:
            work.counts[UNRESOLVED] = 0

    def remove(self, parts: NDArray[np.int64]) -> None:
        self._begin_window_now()
        for state in (self._parts, self._opened):
            component = np.unique(state["asleep_with"][parts])
            rest_on_it = np.isin(state["asleep_with"], component[component != ALONE]) & (state["there"] == ASLEEP)
            state["there"][rest_on_it], state["clock"][rest_on_it] = AWAKE, self._frame * self._scene.frame_interval
            state["there"][parts] = ABSENT

    def add(self, parts: NDArray[np.int64], poses: Sequence[Pose]) -> None:
        from scipy.spatial.transform import Rotation

        self._begin_window_now()
        principal = self._scene.principal_attitudes_of(parts, [pose.quaternion for pose in poses])
        added = new_parts(
            [pose.position for pose in poses],
            Rotation.from_quat(principal, scalar_first=True).as_matrix(),
            self._scene.kind_of[parts],
            [pose.velocity for pose in poses],
        )
        added["clock"] = self._frame * self._scene.frame_interval
        self._parts[parts] = self._opened[parts] = added
        self._row[parts] = self._first_row(added)
        known = self._pairs_before  # of another part in the same place nothing is known
        self._pairs = self._pairs_before = known[~np.isin(known["a"], parts) & ~np.isin(known["b"], parts)]

    @property
    def counts(self) -> Counts:
        return Counts(self._unresolved + sum(int(work.counts[UNRESOLVED]) for work in self._work))

    def take_impacts(self, *, end: bool) -> Events:
        return impacts_of(np.empty((0, 4)))
