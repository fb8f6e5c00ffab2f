"""The one time loop: an engine, what to record, a guard, picks, when a stage ends and when to stop."""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.engines.lookup import engine_class
from feeder_sim.engines.protocol import Engine
from feeder_sim.errors import Divergence, SimulationDiverged
from feeder_sim.measures.picking import pickable
from feeder_sim.measures.stage_lines import StageLines, settled, stage_lines
from feeder_sim.records.arrivals import Arrivals
from feeder_sim.records.last_states import LastStates
from feeder_sim.records.removals import Cause, Removals
from feeder_sim.records.trajectory import Frames, Record, Status
from feeder_sim.run.guard import Guard
from feeder_sim.run.history import History
from feeder_sim.run.seed_record import Begun, Recorder, SeedResult
from feeder_sim.run.watchdog import STALL_AFTER_S, Watchdog
from feeder_sim.scenario import Pick
from feeder_sim.scene.cell import PASSAGE_TO
from feeder_sim.scene.hopper import generator
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.refill import refill, refill_frames
from feeder_sim.scene.scene import Scene

BLOCK_STEPS = 500_000  # solver steps and parts between two looks at guard, stop rule and stop event, about
LEAST_BLOCK = 20  # frames: shorter blocks would cost more to write than to compute
PASSAGE_LOOK = 10  # frames from one look whether the part has passed to the next
LOOK_S = 0.1  # [s] between two looks whether the parts have settled
FIRST_PIECE = 2  # frames, before it is known how long one takes
GROWTH = 8.0  # of pieces, at most
PIECE_S = 0.3  # [s] of wall time between two looks whether to stop, about
CHECKPOINT_S = 5.0  # [s] of wall time between two checkpoints, at least


@dataclass
class Block:
    """Frames under way: computed, then checked, then recorded.

    Attributes:
        frames: those that are valid.
        computed: how many were computed.
        state: of the engine before them.
        removals: parts taken out in them.
        arrivals: parts that come in after them.
        failure: what is wrong with the frame after the last one, None for nothing.
        status: of the seed after them.
    """

    frames: Frames
    computed: int
    state: dict[str, NDArray[np.float64]]
    removals: list[Removals] = field(default_factory=list)
    arrivals: Arrivals = field(default_factory=Arrivals.none)
    failure: SimulationDiverged | None = None
    status: Status = Status.UNFINISHED


class SeedRun:
    """One seed on its way, block by block.

    Args:
        prepared: what is run.
        index: number of the seed.
        recorder: takes the blocks; without one they stay in memory.
        begun: what there is already.
        threads: that one seed may use.
        interrupt: as for `Engine`, of this seed alone.
        stall_after: wall time [s] after which a seed that has not advanced by a frame ends as failed.
    """

    def __init__(
        self,
        prepared: Prepared,
        index: int,
        *,
        recorder: Recorder | None = None,
        begun: Begun | None = None,
        threads: int = 1,
        interrupt: NDArray[np.int64] | None = None,
        stall_after: float = STALL_AFTER_S,
    ) -> None:
        self._prepared, self._index, self._recorder = prepared, index, recorder
        self._begun, self._threads = begun, threads
        self._interrupt = np.zeros(1, np.int64) if interrupt is None else interrupt
        self._watchdog = Watchdog(self._interrupt, stall_after)
        self._whole: Scene = prepared.scene  # with the times at which stages have ended so far
        self._stages_begun = 1  # of those that are computed one by one
        self._scene: Scene = self._as_begun()  # without the stages that nothing is known of yet
        waits = [stage.until.for_s for stage in self._whole.times.stages if stage.until]
        self._lines: StageLines | None = stage_lines(self._whole) if waits else None
        self._history = History(max(waits, default=0.0), keep_all=recorder is None)
        self._last: LastStates | None = None
        self._piece = FIRST_PIECE

    def run(self, rng: np.random.Generator, done: NDArray[np.float64], stop: threading.Event) -> SeedResult:
        """Advance until time is up, the stop rule holds, no part is left, or the state is not valid.

        Args:
            rng: draws the start.
            done: fraction done, one entry per seed, for the progress bar.
            stop: ends the run after the block under way.
        """
        begun, before = self._begun, self._begun.wall_s if self._begun else 0.0
        if begun and begun.status != Status.UNFINISHED:
            done[self._index] = 1.0
            return SeedResult(**fields_of(begun), status=begun.status, wall_s=before, counts=begun.counts)
        started = saved = time.perf_counter()
        self._open(rng)
        status, failure = Status.UNFINISHED, None
        with self._watchdog:
            while status == Status.UNFINISHED and not stop.is_set():
                if self._history.n_frames >= self._whole.n_frames:
                    status = Status.DONE  # it was interrupted just before it would have said so
                    break
                block = self._advance(done, stop)
                if block is None:
                    break
                status, failure = block.status, block.failure
                done[self._index] = self._history.n_frames / self._whole.n_frames
                if self._recorder and time.perf_counter() - saved > CHECKPOINT_S:
                    self._save(before + time.perf_counter() - started)
                    saved = time.perf_counter()
        done[self._index] = 1.0
        return self._close(status, failure, before + time.perf_counter() - started)

    def _open(self, rng: np.random.Generator) -> None:
        """Start the engine, at t = 0 or where the seed was left."""
        begun = self._begun if self._begun is not None and len(self._begun.frames) else None
        if begun is not None:
            self._whole = self._whole.stopped(begun.stops.tolist()) if len(begun.stops) else self._whole
            self._scene = self._as_begun()
            while self._scene.n_frames < len(begun.frames):
                self._stages_begun += 1
                self._scene = self._as_begun()
        start = engine_class(self._prepared.engine)
        engine: Engine = start(self._scene, rng, threads=self._threads, interrupt=self._interrupt)
        first = engine.current()
        self._engine, self._guard = engine, Guard(self._prepared, first)
        if begun is None:
            self._keep(History.first(first.as_stored()))
            return
        engine.restore(begun.state)
        self._guard.redrive(self._scene)
        self._guard.catch_up(begun.frames)
        self._guard.arrive(begun.arrivals, engine.current())
        self._history.append(begun)

    def _close(self, status: Status, failure: SimulationDiverged | None, wall_s: float) -> SeedResult:
        """Record how it ended; returns everything."""
        counts = self._engine.counts
        if self._recorder is None:
            kept = fields_of(self._history.record())
            return SeedResult(**kept, status=status, wall_s=wall_s, failure=failure, last=self._last, counts=counts)
        if status == Status.UNFINISHED:
            self._save(wall_s)
        if failure and self._last:
            failure = failure.kept_in(self._recorder.keep_last(failure, self._last))
        self._recorder.finish(self._index, status, wall_s, counts)
        record = self._recorder.recorded(self._index)
        return SeedResult(
            **fields_of(record),
            status=status,
            wall_s=wall_s,
            failure=failure,
            last=self._last,
            counts=counts,
        )

    def _save(self, wall_s: float) -> None:
        if self._recorder:
            self._recorder.checkpoint(self._index, self._engine.state(), wall_s)

    def _advance(self, done: NDArray[np.float64], stop: threading.Event) -> Block | None:
        """One block, step by step; None, and nothing has happened, if it was stopped."""
        if self._history.n_frames >= self._scene.n_frames:
            self._begin_stage()
        block = self._compute(done, stop)
        if block is None:
            return None
        self._check(block)
        self._take_lost(block)
        self._take_picked(block)
        self._fill_in(block)
        self._judge(block)
        self._record(block)
        return block

    def _as_begun(self) -> Scene:
        """The scene, or of one that is computed stage by stage as much as is known by now."""
        return self._whole.begun(self._stages_begun) if self._whole.stage_by_stage else self._whole

    def _begin_stage(self) -> None:
        """Go on with the next stage, in a window of its own."""
        self._stages_begun += 1
        self._scene = self._as_begun()
        self._engine.redrive(self._scene)
        self._guard.redrive(self._scene)

    def _compute(self, done: NDArray[np.float64], stop: threading.Event) -> Block | None:
        """Compute a block in pieces that take about `PIECE_S` each, so that slow ones show progress and can be stopped.

        Pieces change nothing: what acts on the parts does so between blocks. One that takes too long is computed again
        frame by frame, up to the frame that does not come.
        """
        size, state = self._block_size(), self._engine.state()
        pieces: list[Frames] = []
        computed, piece = 0, min(size, self._piece)
        took, stalled = 0.0, False
        while computed < size:
            if took > 0.3 * PIECE_S and stop.is_set():  # a short block is soon over
                self._engine.restore(state)
                self._engine.take_impacts(end=False)  # of the frames that are dropped
                return None
            started = time.perf_counter()
            self._watchdog.begin()
            frames = self._engine.advance(piece)
            if self._watchdog.end():
                if stalled or piece == 1:
                    return self._stalled(pieces, computed, state)
                self._engine.restore(state)
                self._engine.take_impacts(end=False)
                pieces, computed, piece, stalled = [], 0, 1, True
                continue
            pieces.append(frames)
            if self._interrupt[0]:
                self._engine.restore(state)
                self._engine.take_impacts(end=False)
                return None
            computed += piece
            took = time.perf_counter() - started
            done[self._index] = (self._history.n_frames + computed) / self._whole.n_frames
            self._piece = max(1, int(piece * min(GROWTH, PIECE_S / max(took, 1e-9))))
            piece = 1 if stalled else min(size - computed, self._piece)
        return Block(Frames.joined(pieces) if len(pieces) > 1 else pieces[0], size, state)

    def _stalled(self, pieces: list[Frames], computed: int, state: dict[str, NDArray[np.float64]]) -> Block:
        """The block as far as it has come, where the next frame takes too long; the fastest part is taken for why."""
        now = self._engine.current()
        speed = np.linalg.norm(now.velocity[0], axis=1)
        part = int(np.argmax(np.where(now.present[0], speed, -1.0)))
        place = ", ".join(f"{1e3 * x:.3f}" for x in now.position[0, part])
        failure = SimulationDiverged(
            Divergence.STALLED,
            time_s=float(now.time[0]),
            part=self._scene.parts[part].name,
            seed=self._index,
            detail=f"its next frame takes more than {self._watchdog.patience:g} s; it is at ({place}) mm, moves at "
            f"{1e3 * speed[part]:.3g} mm/s and turns at {np.linalg.norm(now.angular_velocity[0, part]):.3g} rad/s",
        )
        return Block(Frames.joined([now[slice(0, 0)], *pieces]), computed, state, failure=failure)

    def _check(self, block: Block) -> None:
        """Keep the frames before the first one that is not valid."""
        valid, failure = self._guard.check(block.frames, self._index)
        block.failure = failure or block.failure
        if block.failure:
            self._last = LastStates.of(block.frames, valid, block.state, self._history.stops)
        block.frames = block.frames[slice(valid)]

    def _take_lost(self, block: Block) -> None:
        """Take out what has reached the floor; it is gone from the frames after that."""
        frames, lost = block.frames, self._guard.lost(len(block.frames))
        if not lost.any():
            return
        parts = np.flatnonzero(lost.any(axis=0))
        rows = lost[:, parts].argmax(axis=0)
        for part, row in zip(parts, rows, strict=True):
            frames.present[row + 1 :, part] = False
        self._engine.remove(parts)
        for k in np.argsort(rows, kind="stable"):
            block.removals.append(Removals.of(float(frames.time[rows[k]]), parts[k : k + 1], Cause.LOST))

    def _take_picked(self, block: Block) -> None:
        """Pick at the last frame of the block, if it is time to."""
        last_frame = self._history.n_frames + block.computed - 1
        picks = pick_frames(self._scene).get(last_frame)
        if block.failure or picks is None:
            return
        last = block.frames[slice(-1, None)]
        picked = pickable(self._scene, picks, last)
        if len(picked):
            self._engine.remove(picked)
        block.removals.append(Removals.of(float(last.time[0]), picked, Cause.PICKED))

    def _fill_in(self, block: Block) -> None:
        """Refill after the last frame of the block, if a cycle ends there and parts are missing."""
        cycle = refill_frames(self._whole).get(self._history.n_frames + block.computed - 1)
        if block.failure or cycle is None:
            return
        rng = generator(self._scene, self._index, cycle)
        parts, poses = refill(self._scene, self._engine.current(), rng)
        if len(parts):
            self._engine.add(parts, poses)
            heights = np.array([pose.position[2] for pose in poses])
            block.arrivals = Arrivals.of(float(block.frames.time[-1]), parts, cycle, heights)

    def _judge(self, block: Block) -> None:
        """How the seed stands after the block."""
        removals = Removals.joined([self._history.removals, *block.removals])
        if block.failure:
            block.status = Status.DIVERGED
        elif self._has_passed(block.frames):
            block.status = Status.DONE  # whatever it did after that
        elif len(removals) == len(self._scene.parts) and self._scene.scenario.refill is None:
            block.status = Status.LEFT_PLATE if (removals.cause == Cause.LOST).all() else Status.DONE
        elif self._is_over(self._history.n_frames + len(block.frames)):
            block.status = Status.DONE

    def _is_over(self, n_frames: int) -> bool:
        """Whether time is up after so many frames."""
        return n_frames >= self._whole.n_frames

    def _has_passed(self, frames: Frames) -> bool:
        """Whether the part has reached the end of the measured way, where the run is to stop there."""
        cell = self._prepared.cell
        if self._prepared.scenario.run.stop != "passage" or cell is None or not len(frames):
            return False
        looked_at = frames[slice(None, None, -PASSAGE_LOOK)]  # the last frame among them
        return bool((cell.way(looked_at) <= PASSAGE_TO).any())

    def _record(self, block: Block) -> None:
        """Record the block; the stage under way ends with it where its parts have settled."""
        impacts = self._engine.take_impacts(end=block.status != Status.UNFINISHED)
        if len(block.frames) < block.computed:
            impacts = impacts[impacts.time <= (block.frames.time[-1] if len(block.frames) else 0.0)]
        self._guard.remember(len(block.frames))
        self._guard.arrive(block.arrivals, self._engine.current())
        frames = block.frames.as_stored()
        stops = self._stops_of_settled(frames) if block.status == Status.UNFINISHED else np.empty(0)
        self._keep(Record(frames, impacts, Removals.joined(block.removals), stops, arrivals=block.arrivals))
        self._follow_stops(stops)

    def _keep(self, block: Record) -> None:
        self._history.append(block)
        if self._recorder and len(block.frames):
            self._recorder.append(self._index, block)

    def _stops_of_settled(self, frames: Frames) -> NDArray[np.float64]:
        """If the stage under way is over because all parts have settled: when it and those before it stopped."""
        now = float(frames.time[-1])
        stages = self._scene.times.stages
        under_way = ((i, s, s.until) for i, s in enumerate(stages) if s.until and s.start <= now < s.stop)
        number, _, until = next(under_way, (0, None, None))
        if self._lines is None or until is None:
            return np.empty(0)
        recent = self._history.recent(now - until.for_s, frames)
        if not settled(self._scene, self._lines, number, recent):
            return np.empty(0)
        return np.array([*(stage.stop for stage in stages[len(self._history.stops) : number]), now])

    def _follow_stops(self, stops: NDArray[np.float64]) -> None:
        """Go on in a scene in which the drives of stages have stopped at these times, and the rest follow."""
        if len(stops):
            self._whole = self._whole.stopped(self._history.stops.tolist())
            self._scene = self._as_begun()
            self._engine.redrive(self._scene)
            self._guard.redrive(self._scene)

    def _block_size(self) -> int:
        """Frames of the next block; a pick or a look whether parts have settled is always at the end of one."""
        scene, n_done = self._scene, self._history.n_frames
        least = LEAST_BLOCK if len(scene.parts) > 1 else 2
        longest = max(least, BLOCK_STEPS // (scene.steps_per_frame * len(scene.parts)))
        ahead = [frame - n_done + 1 for frame in (*pick_frames(scene), *refill_frames(self._whole)) if frame >= n_done]
        if self._lines is not None:
            look = max(1, round(LOOK_S / scene.frame_interval))
            ahead.append(look - (n_done - 1) % look)
        return min(self._engine.frames_per_block, longest, scene.n_frames - n_done, *ahead)


def fields_of(record: Record) -> dict[str, Any]:
    """The fields of a record by name."""
    return {entry.name: getattr(record, entry.name) for entry in fields(Record)}


def pick_frames(scene: Scene) -> dict[int, tuple[Pick, ...]]:
    """What is picked at which frame: the first at or after the end of the stage, or the last one."""
    return {scene.frame_at(stage.end): stage.picks for stage in scene.times.stages if stage.picks}
