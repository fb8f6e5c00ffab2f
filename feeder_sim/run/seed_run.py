"""The one time loop: an engine, what to record, a guard, picks, when a stage ends and when to stop."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from feeder_sim.engines.protocol import ENDED, Engine, engine_class, new_interrupt
from feeder_sim.errors import Divergence, SimulationDiverged
from feeder_sim.measures.picking import pickable
from feeder_sim.measures.stage_lines import StageLines, settled, stage_lines
from feeder_sim.pool.work import STALL_AFTER_S, silent
from feeder_sim.records.seed import (
    ARRIVALS,
    REMOVALS,
    Cause,
    Events,
    LastStates,
    Seed,
    Status,
    events,
    joined,
    no_events,
    removed,
)
from feeder_sim.records.trajectory import Frames
from feeder_sim.run.guard import Guard
from feeder_sim.run.watchdog import Watchdog
from feeder_sim.scenario import Pick
from feeder_sim.scene.cell import PASSAGE_TO
from feeder_sim.scene.outlet import NO_OUTLET, outlet_numbers
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.refill import refill, refill_frames
from feeder_sim.scene.scene import Scene
from feeder_sim.scene.start import Pose, generator

# The blocks that one seed has recorded so far, as many of them as the rest of its run needs.


class History:
    """Blocks of one seed in order of time.

    Args:
        history_s: longest time before the last frame [s] for which `recent` is called.

    Attributes:
        history_s: as above; it may be changed.
        retains_all: whether all blocks stay in memory, which `to_seed` needs; it may be changed.
        n_frames: number of frames so far, those included that are no longer in memory.
        removals: all removals so far.
        stops: times at which the drives of the first stages have stopped [s], shape (n,).
    """

    def __init__(self, history_s: float) -> None:
        self.history_s, self.retains_all = history_s, True
        self._blocks: list[Seed] = []
        self.n_frames = 0
        self.removals = no_events(REMOVALS)
        self.stops: NDArray[np.float64] = np.empty(0)

    def append(self, block: Seed) -> None:
        """Add the next block; drop those from memory that are no longer needed."""
        self._blocks.append(block)
        self.n_frames += len(block.frames)
        if len(block.removals):
            self.removals = joined([self.removals, block.removals])
        if len(block.stops):
            self.stops = np.concatenate([self.stops, block.stops])
        if not self.retains_all and len(block.frames):
            since = block.frames.time[-1] - self.history_s
            while len(self._blocks) > 1 and _begins_by(self._blocks[1].frames, since):
                self._blocks.pop(0)

    def recent(self, since: float, latest: Frames) -> Frames:
        """Frames from a time [s] on, and a few before it, joined with the latest ones.

        Args:
            since: begin of the time that is asked for [s].
            latest: frames that have not been appended yet.
        """
        frames = [latest]
        for block in reversed(self._blocks):
            if _begins_by(frames[0], since):
                break
            frames.insert(0, block.frames)
        return Frames.joined(frames)

    def to_seed(self) -> Seed:
        """All blocks as one, which are then no longer kept; only with `retains_all`."""
        blocks, self._blocks = self._blocks, []
        return Seed.joined(blocks)


def _begins_by(frames: Frames, time: float) -> bool:
    """Whether there are frames and the first one is not after a time [s]."""
    return len(frames) > 0 and bool(frames.time[0] <= time)


BLOCK_STEPS = 500_000  # solver steps and parts between two looks at guard, stop rule and stop event, about
LEAST_BLOCK = 20  # frames: shorter blocks would cost more to write than to compute
PASSAGE_CHECK = 10  # frames from one look whether the part has passed to the next
SETTLED_CHECK_S = 0.1  # [s] between two looks whether the parts have settled
FIRST_PIECE = 2  # frames, before it is known how long one takes
GROWTH = 8.0  # of pieces, at most
PIECE_S = 0.3  # [s] of wall time between two looks whether to stop, about


class SeedRun:
    """One seed on its way, block by block.

    Args:
        prepared: what is run.
        index: number of the seed.
        threads: that one seed may use.
        progress: called with the fraction that is done.
        interrupt: as for `Engine`, of this seed alone.
        stall_after: wall time [s] after which a seed that has not advanced by a frame ends as failed.
    """

    def __init__(
        self,
        prepared: Prepared,
        index: int,
        *,
        threads: int = 1,
        progress: Callable[[float], None] = silent,
        interrupt: NDArray[np.int64] | None = None,
        stall_after: float = STALL_AFTER_S,
    ) -> None:
        self._prepared, self._index, self._threads, self._progress = prepared, index, threads, progress
        self._interrupt = new_interrupt() if interrupt is None else interrupt
        self._watchdog = Watchdog(self._interrupt, stall_after)
        self._full_scene: Scene = prepared.scene  # with the times at which stages have ended so far
        self._stages_started = 1  # of those that are computed one by one
        self._scene: Scene = self._started_scene()  # without the stages that nothing is known of yet
        waits = [stage.until.for_s for stage in self._full_scene.times.stages if stage.until]
        self._lines: StageLines | None = stage_lines(self._full_scene) if waits else None
        self._history = History(max(waits, default=0.0))
        self._last: LastStates | None = None
        self._piece = FIRST_PIECE

    def run(self, stop: threading.Event) -> Seed:
        """Advance until time is up, the stop rule holds, no part is left, or the state is not valid.

        Args:
            stop: ends the run after the block under way.
        """
        started = time.perf_counter()
        self._open()
        status, failure = Status.UNFINISHED, None
        with self._watchdog:
            while status == Status.UNFINISHED and not stop.is_set():
                block = self._advance(stop)
                if block is None:
                    break
                status, failure = block.status, block.failure
                self._progress(self._history.n_frames / self._full_scene.n_frames)
        return self._close(status, failure, time.perf_counter() - started)

    def _open(self) -> None:
        """Start the engine at t = 0."""
        rng = generator(self._scene, self._index)
        start = engine_class(self._prepared.engine)
        self._engine: Engine = start(self._scene, rng, threads=self._threads, interrupt=self._interrupt)
        self._first = self._engine.current()
        self._guard = Guard(self._prepared, self._first)
        removals = joined([no_events(REMOVALS), *self._remove_through(self._first)])
        self._history.append(Seed(self._first.as_stored(), removals=removals))

    def _close(self, status: Status, failure: SimulationDiverged | None, wall_s: float) -> Seed:
        """Everything, with how it ended."""
        seed, counts = self._history.to_seed(), self._engine.counts
        return replace(seed, status=status, wall_s=wall_s, failure=failure, last=self._last, counts=counts)

    def _advance(self, stop: threading.Event) -> Seed | None:
        """One block, step by step; None if it was stopped, and then there is no other."""
        if self._history.n_frames >= self._scene.n_frames:
            self._begin_stage()
        computed = self._compute(stop)
        if computed is None:
            return None
        frames, failure = self._valid(*computed)
        last_frame = self._history.n_frames + len(frames) - 1
        removals = self._remove_lost(frames)
        if not failure:
            removals += [*self._remove_through(frames), *self._remove_picked(last_frame)]
        arrivals = no_events(ARRIVALS) if failure else self._fill_in(frames, last_frame)
        removals = joined([no_events(REMOVALS), *removals])
        status = self._judged(frames, removals, failure)
        return self._record(Seed(frames, removals=removals, arrivals=arrivals, status=status, failure=failure))

    def _started_scene(self) -> Scene:
        """The scene, or of one that is computed stage by stage as much as is known by now."""
        return (
            self._full_scene.up_to_stage(self._stages_started) if self._full_scene.stage_by_stage else self._full_scene
        )

    def _begin_stage(self) -> None:
        """Go on with the next stage, in a window of its own."""
        self._stages_started += 1
        self._scene = self._started_scene()
        self._engine.redrive(self._scene)
        self._guard.redrive(self._scene)

    def _compute(self, stop: threading.Event) -> tuple[Frames, SimulationDiverged | None] | None:
        """Compute a block in pieces that take about `PIECE_S` each, so that slow ones show progress and can be stopped.

        Pieces change nothing: what acts on the parts does so between blocks. Returns the frames: fewer where a part
        enters an outlet, or the next one does not come, and then why; None where it was stopped.
        """
        size, pieces, computed = self._block_size(), [], 0
        piece, elapsed = min(size, self._piece), 0.0
        while computed < size:
            if elapsed > 0.3 * PIECE_S and stop.is_set():  # a short block is soon over
                return None
            started = time.perf_counter()
            pieces.append(self._advance_engine(piece))
            stalled = self._watchdog.end()
            if self._entered(pieces[-1]).any():
                break
            if len(pieces[-1]) < piece:
                return (Frames.joined(pieces), self._stalled()) if stalled else None
            if self._interrupt[ENDED]:
                return None
            computed += piece
            elapsed = time.perf_counter() - started
            self._progress((self._history.n_frames + computed) / self._full_scene.n_frames)
            self._piece = max(1, int(piece * min(GROWTH, PIECE_S / max(elapsed, 1e-9))))
            piece = min(size - computed, self._piece)
        return (Frames.joined(pieces) if len(pieces) > 1 else pieces[0]), None

    def _advance_engine(self, n_frames: int) -> Frames:
        """The next frames of the engine; with outlets one by one, up to the first in which a part has entered one."""
        step, pieces = 1 if self._scene.outlets else n_frames, []
        for _ in range(0, n_frames, step):
            self._watchdog.begin()
            pieces.append(self._engine.advance(step))
            if len(pieces[-1]) < step or self._entered(pieces[-1]).any():
                break
        return Frames.joined(pieces) if len(pieces) > 1 else pieces[0]

    def _entered(self, frames: Frames) -> NDArray[np.bool_]:
        """Which parts are in an outlet in the last of some frames, (parts,)."""
        return outlet_numbers(self._scene.outlets, frames) != NO_OUTLET

    def _stalled(self) -> SimulationDiverged:
        """Why there is no next frame; the fastest part is taken for the cause."""
        now = self._engine.current()
        speed = np.linalg.norm(now.velocity[0], axis=1)
        part = int(np.argmax(np.where(now.present[0], speed, -1.0)))
        place = ", ".join(f"{1e3 * x:.3f}" for x in now.position[0, part])
        return SimulationDiverged(
            Divergence.STALLED,
            time_s=float(now.time[0]),
            part=self._scene.parts[part].name,
            seed=self._index,
            detail=f"its next frame takes more than {self._watchdog.stall_after:g} s; it is at ({place}) mm, moves at "
            f"{1e3 * speed[part]:.3g} mm/s and turns at {np.linalg.norm(now.angular_velocity[0, part]):.3g} rad/s",
        )

    def _valid(self, frames: Frames, failure: SimulationDiverged | None) -> tuple[Frames, SimulationDiverged | None]:
        """The frames before the first one that is not valid, and why there are no more."""
        valid, divergence = self._guard.check(frames, self._index)
        failure = divergence or failure
        if failure:
            self._last = LastStates.of(frames, valid)
        return frames[slice(valid)], failure

    def _remove_lost(self, frames: Frames) -> list[Events]:
        """Take out what has reached the floor; it is gone from the frames after that."""
        lost = self._guard.lost(len(frames))
        lost[-1:, self._entered(frames)] = False
        if not lost.any():
            return []
        parts = np.flatnonzero(lost.any(axis=0))
        rows = lost[:, parts].argmax(axis=0)
        for part, row in zip(parts, rows, strict=True):
            frames.present[row + 1 :, part] = False
        self._engine.remove(parts)
        order = np.argsort(rows, kind="stable")
        return [removed(parts[k : k + 1], float(frames.time[rows[k]]), Cause.LOST) for k in order]

    def _remove_through(self, frames: Frames) -> list[Events]:
        """Take out what is in an outlet in the last frame of the block; none was in an earlier one."""
        number = outlet_numbers(self._scene.outlets, frames)
        parts = np.flatnonzero(number != NO_OUTLET)
        if not len(parts):
            return []
        self._engine.remove(parts)
        return [removed(parts, float(frames.time[-1]), Cause.OUTLET, number[parts])]

    def _remove_picked(self, last_frame: int) -> list[Events]:
        """Pick at the last frame of the block, if it is time to."""
        picks = pick_frames(self._scene).get(last_frame)
        if picks is None:
            return []
        last = self._engine.current()
        picked = pickable(self._scene, picks, last)
        if len(picked):
            self._engine.remove(picked)
        return [removed(picked, float(last.time[0]), Cause.PICKED)]

    def _fill_in(self, frames: Frames, last_frame: int) -> Events:
        """Refill after the last frame of the block, if a cycle ends there and parts are missing."""
        cycle = refill_frames(self._full_scene).get(last_frame)
        if cycle is None:
            return no_events(ARRIVALS)
        rng = generator(self._scene, self._index, cycle)
        parts, poses = refill(self._scene, self._engine.current(), rng)
        if len(parts):
            self._engine.add(parts, poses)
        return arrived(float(frames.time[-1]), parts, cycle, poses)

    def _judged(self, frames: Frames, removals: Events, failure: SimulationDiverged | None) -> Status:
        """How the seed stands after a block."""
        removals = joined([self._history.removals, removals])
        if failure:
            return Status.DIVERGED
        if self._has_passed(frames):
            return Status.DONE  # whatever it did after that
        if len(removals) == len(self._scene.parts) and self._scene.scenario.refill is None:
            return Status.LEFT_PLATE if (removals.cause == Cause.LOST).all() else Status.DONE
        return Status.DONE if self._is_over(self._history.n_frames + len(frames)) else Status.UNFINISHED

    def _is_over(self, n_frames: int) -> bool:
        """Whether time is up after so many frames."""
        return n_frames >= self._full_scene.n_frames

    def _has_passed(self, frames: Frames) -> bool:
        """Whether the part has reached the end of the measured way, where the run is to stop there."""
        cell = self._prepared.cell
        if self._prepared.scenario.run.stop != "passage" or cell is None or not len(frames):
            return False
        looked_at = frames[slice(None, None, -PASSAGE_CHECK)]  # the last frame among them
        may = cell.may_pass(looked_at, PASSAGE_TO, self._first)
        return len(may) > 0 and bool((cell.distance_to_node(looked_at[may]) <= PASSAGE_TO).any())

    def _record(self, block: Seed) -> Seed:
        """Record the block; the stage under way ends with it where its parts have settled."""
        impacts = self._engine.take_impacts(end=block.status != Status.UNFINISHED)
        if block.failure:
            impacts = impacts[impacts.time <= (block.frames.time[-1] if len(block.frames) else 0.0)]
        self._guard.remember(len(block.frames))
        self._guard.arrive(block.arrivals, self._engine.current())
        frames = block.frames.as_stored()
        stops = self._stops_of_settled(frames) if block.status == Status.UNFINISHED else np.empty(0)
        self._history.append(replace(block, frames=frames, impacts=impacts, stops=stops))
        self._follow_stops(stops)
        return block

    def _stops_of_settled(self, frames: Frames) -> NDArray[np.float64]:
        """If the stage under way is over because all parts have settled: when it and those before it stopped."""
        now = float(frames.time[-1])
        stages = self._scene.times.stages
        running = ((i, s, s.until) for i, s in enumerate(stages) if s.until and s.start <= now < s.stop)
        number, _, until = next(running, (0, None, None))
        if self._lines is None or until is None:
            return np.empty(0)
        recent = self._history.recent(now - until.for_s, frames)
        if not settled(self._scene, self._lines, number, recent):
            return np.empty(0)
        return np.array([*(stage.stop for stage in stages[len(self._history.stops) : number]), now])

    def _follow_stops(self, stops: NDArray[np.float64]) -> None:
        """Go on in a scene in which the drives of stages have stopped at these times, and the rest follow."""
        if len(stops):
            self._full_scene = self._full_scene.stopped(self._history.stops.tolist())
            self._scene = self._started_scene()
            self._engine.redrive(self._scene)
            self._guard.redrive(self._scene)

    def _block_size(self) -> int:
        """Frames of the next block; a pick or a look whether parts have settled is always at the end of one."""
        scene, n = self._scene, self._history.n_frames
        least = LEAST_BLOCK if len(scene.parts) > 1 else 2
        longest = max(least, BLOCK_STEPS // (scene.steps_per_frame * len(scene.parts)))
        ahead = [frame - n + 1 for frame in (*pick_frames(scene), *refill_frames(self._full_scene)) if frame >= n]
        if self._lines is not None:
            interval = max(1, round(SETTLED_CHECK_S / scene.frame_interval))
            ahead.append(interval - (n - 1) % interval)
        return min(self._engine.frames_per_block, longest, scene.n_frames - n, *ahead)


def arrived(time: float, parts: NDArray[np.int64], cycle: int, poses: Sequence[Pose]) -> Events:
    """Arrivals of parts, by their indices, at a time [s]."""
    return events(ARRIVALS, time=time, part=parts, cycle=cycle, height=[pose.position[2] for pose in poses])


def pick_frames(scene: Scene) -> dict[int, tuple[Pick, ...]]:
    """What is picked at which frame: the first at or after the end of the stage, or the last one."""
    return {scene.frame_at(stage.end): stage.picks for stage in scene.times.stages if stage.picks}
