"""The one time loop: an engine, what to record, a guard, picks, when a stage ends and when to stop."""

from __future__ import annotations

import math
import threading
import time
from dataclasses import dataclass, fields
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from feeder_sim.engines import Engine, engine_class
from feeder_sim.errors import SimulationDiverged
from feeder_sim.guard import Guard
from feeder_sim.impacts import Impacts
from feeder_sim.measures import PASSAGE_TO, Cell
from feeder_sim.picking import pickable
from feeder_sim.removals import Cause, Removals
from feeder_sim.scene import Scene
from feeder_sim.stage_lines import settled, stage_lines
from feeder_sim.trajectory import Frames, Record, Status

BLOCK_STEPS = 500_000  # solver steps and parts between two looks at guard, stop rule and stop event, about
LEAST_BLOCK = 20  # frames: shorter blocks would cost more to write than to compute
LOOK_S = 0.1  # [s] between two looks whether the parts have settled
CHECKPOINT_S = 5.0  # [s] of wall time between two checkpoints, at least
LAST_FRAMES = 100  # kept of a block that failed, at most: half of them before the first one that is not valid


@dataclass(frozen=True)
class LastStates:
    """What is kept of a block in which a seed diverged, to look at and to run again.

    In the scene `stopped` at `stops`, an engine that has restored `state` gives `frames` again, bit by bit, as the last
    ones of `advance(skipped + len(frames))`.

    Attributes:
        state: of the engine before the block.
        stops: when the drives of stages had stopped before the block [s].
        skipped: frames of the block before `frames`.
        frames: up to LAST_FRAMES of the block.
        valid: number of `frames` before the first one that is not valid.
    """

    state: dict[str, NDArray[np.float64]]
    stops: NDArray[np.float64]
    skipped: int
    frames: Frames
    valid: int

    @staticmethod
    def of(block: Frames, valid: int, state: dict[str, NDArray[np.float64]], stops: NDArray[np.float64]) -> LastStates:
        """Cut the frames around the failure out of a block of which the first `valid` frames are valid."""
        skipped = max(0, min(valid - LAST_FRAMES // 2, len(block) - LAST_FRAMES))
        kept = block[slice(skipped, skipped + LAST_FRAMES)]
        copied = Frames(
            *(getattr(kept, field.name).copy() for field in fields(Frames))
        )  # `present` is still written to
        return LastStates(state, stops, skipped, copied, valid - skipped)


class Recorder(Protocol):
    """Where blocks go while a run is under way; called from several threads."""

    def append(self, seed_index: int, block: Record) -> None: ...

    def checkpoint(self, seed_index: int, state: dict[str, NDArray[np.float64]]) -> None:
        """Keep what the run can go on from after everything appended so far."""
        ...

    def keep_last(self, failure: SimulationDiverged, last: LastStates) -> str:
        """Keep the last states of the seed that diverged; returns the name of the file."""
        ...

    def finish(self, seed_index: int, status: Status) -> None: ...


@dataclass(frozen=True)
class Begun(Record):
    """What there is of a seed that is to be continued: what was recorded, and the engine's state at its end."""

    state: dict[str, NDArray[np.float64]]
    status: Status


@dataclass(frozen=True)
class SeedResult(Record):
    """One seed of an ensemble.

    Attributes:
        status: how it ended; UNFINISHED when it was interrupted.
        wall_s: wall time spent in its loop [s].
        failure: why it diverged, None otherwise.
        last: its last states if it diverged, None otherwise.
    """

    status: Status
    wall_s: float
    failure: SimulationDiverged | None = None
    last: LastStates | None = None


@dataclass
class SeedRun:
    """One seed on its way, block by block.

    Attributes:
        scene: what is run, with the times at which stages ended so far.
        index, cell: number of the seed, and where its transport is measured.
        recorder: takes the blocks.
        done: fraction done, one entry per seed, for the progress bar.
        stop: ends the run after the block under way.
        begun: what there is already.
        threads: that one seed may use.
    """

    scene: Scene
    index: int
    cell: Cell | None
    recorder: Recorder | None
    done: NDArray[np.float64]
    stop: threading.Event
    begun: Begun | None = None
    threads: int = 1

    def run(self, rng: np.random.Generator) -> SeedResult:
        """Advance until time is up, the stop rule holds, no part is left, or the state is not valid."""
        started = time.perf_counter()
        if self.begun and self.begun.status != Status.UNFINISHED:
            self.done[self.index] = 1.0
            return SeedResult(**_fields(self.begun), status=self.begun.status, wall_s=0.0)
        engine: Engine = engine_class(self.scene.scenario)(self.scene, rng, threads=self.threads)
        first = engine.current()
        guard = Guard(self.scene, first)
        self._lines = stage_lines(self.scene) if any(s.until for s in self.scene.times.stages) else None
        self._blocks: list[Record] = []
        self._last: LastStates | None = None
        if self.begun and len(self.begun.frames):
            engine.restore(self.begun.state)
            guard.remember(self.begun.frames)
            self._blocks.append(self.begun)
            self._stop_stages(engine, guard, self.begun.stops)
        else:
            self._append(Record(first.as_stored(), Impacts.none(), Removals.none(), np.empty(0)))
        status, failure = Status.UNFINISHED, None
        saved = time.perf_counter()
        while status == Status.UNFINISHED and not self.stop.is_set():
            status, failure = self._advance(engine, guard)
            if self.recorder and time.perf_counter() - saved > CHECKPOINT_S:
                self.recorder.checkpoint(self.index, engine.state())
                saved = time.perf_counter()
        if self.recorder and status == Status.UNFINISHED:
            self.recorder.checkpoint(self.index, engine.state())
        self.done[self.index] = 1.0
        if self.recorder:
            if failure and self._last:
                failure = failure.kept_in(self.recorder.keep_last(failure, self._last))
            self.recorder.finish(self.index, status)
        wall, record = time.perf_counter() - started, _fields(Record.joined(self._blocks))
        return SeedResult(**record, status=status, wall_s=wall, failure=failure, last=self._last)

    def _advance(self, engine: Engine, guard: Guard) -> tuple[Status, SimulationDiverged | None]:
        """One block: compute, check, take parts out, record; returns the status after it."""
        n_done = sum(len(block.frames) for block in self._blocks)
        if n_done >= self.scene.n_frames:
            return Status.DONE, None
        size = self._block_size(engine, n_done)
        before = engine.state()
        block = engine.advance(size)
        valid, failure = guard.check(block, self.index)
        if failure:
            self._last = LastStates.of(block, valid, before, self._stops())
        block = block[slice(valid)]
        removed = self._take_lost(engine, guard, block)
        if not failure:
            removed.append(self._take_picked(engine, guard, block, n_done + size - 1))
        removals = Removals.joined(removed)
        guard.remember(block)
        status = self._status(block, n_done + valid, failure, removals)
        hits = engine.take_impacts(end=status != Status.UNFINISHED)
        if valid < size:
            hits = hits[hits.time <= (block.time[-1] if valid else 0.0)]
        block = block.as_stored()
        stops = self._stops_of_settled(block) if status == Status.UNFINISHED else np.empty(0)
        self._append(Record(block, hits, removals, stops))
        self._stop_stages(engine, guard, stops)
        self.done[self.index] = (n_done + valid) / self.scene.n_frames
        return status, failure

    def _append(self, block: Record) -> None:
        self._blocks.append(block)
        if self.recorder and len(block.frames):
            self.recorder.append(self.index, block)

    def _stops_of_settled(self, block: Frames) -> NDArray[np.float64]:
        """If the stage under way is over because all parts have settled: when it and those before it stopped."""
        now = float(block.time[-1])
        stages = self.scene.times.stages
        under_way = ((i, s, s.until) for i, s in enumerate(stages) if s.until and s.start <= now < s.stop)
        number, _, until = next(under_way, (0, None, None))
        if self._lines is None or until is None:
            return np.empty(0)
        recent = [block]
        for held in reversed(self._blocks):
            if recent[0].time[0] <= now - until.for_s:
                break
            recent.insert(0, held.frames)
        if not settled(self.scene, self._lines, number, Frames.joined(recent)):
            return np.empty(0)
        noted = sum(len(held.stops) for held in self._blocks)
        return np.array([*(stage.stop for stage in stages[noted:number]), now])

    def _stop_stages(self, engine: Engine, guard: Guard, stops: NDArray[np.float64]) -> None:
        """Let the drives of the next stages have stopped at these times, and the rest follow."""
        if len(stops):
            self.scene = self.scene.stopped(self._stops().tolist())
            engine.redrive(self.scene)
            guard.redrive(self.scene)

    def _stops(self) -> NDArray[np.float64]:
        """When the drives of stages have stopped so far [s]."""
        return np.concatenate([block.stops for block in self._blocks])

    def _block_size(self, engine: Engine, n_done: int) -> int:
        """Frames of the next block; a pick or a look whether parts have settled is always at the end of one."""
        scene = self.scene
        least = LEAST_BLOCK if len(scene.parts) > 1 else 2
        longest = max(least, BLOCK_STEPS // (scene.steps_per_frame * len(scene.parts)))
        ahead = [frame - n_done + 1 for frame in pick_frames(scene) if frame >= n_done]
        if self._lines is not None:
            look = max(1, round(LOOK_S / scene.frame_interval))
            ahead.append(look - (n_done - 1) % look)
        return min(engine.frames_per_block, longest, scene.n_frames - n_done, *ahead)

    def _take_lost(self, engine: Engine, guard: Guard, block: Frames) -> list[Removals]:
        """Take out what has reached the floor; it is gone from the frames after that."""
        if not len(block):
            return []
        lost = guard.lost(block)
        parts = np.flatnonzero(lost.any(axis=0))
        rows = lost[:, parts].argmax(axis=0)
        for part, row in zip(parts, rows, strict=True):
            block.present[row + 1 :, part] = False
        if len(parts):
            engine.remove(parts)
        order = np.argsort(rows, kind="stable")
        return [Removals.of(float(block.time[rows[k]]), parts[k : k + 1], Cause.LOST) for k in order]

    def _take_picked(self, engine: Engine, guard: Guard, block: Frames, frame: int) -> Removals:
        """Pick at the last frame of the block, if it is time to."""
        clearance = pick_frames(self.scene).get(frame)
        if clearance is None:
            return Removals.none()
        position = block.position[-1]
        # What is on its way down to the floor is neither picked nor in the way.
        there = block.present[-1] & guard.over(position) & ~guard.fallen(block)[-1]
        picked = pickable(position, there, clearance)
        if len(picked):
            engine.remove(picked)
        return Removals.of(float(block.time[-1]), picked, Cause.PICKED)

    def _status(self, block: Frames, n_done: int, failure: SimulationDiverged | None, removals: Removals) -> Status:
        if failure:
            return Status.DIVERGED
        out = Removals.joined([*(held.removals for held in self._blocks), removals])
        if len(out) == len(self.scene.parts):
            return Status.LEFT_PLATE if (out.cause == Cause.LOST).all() else Status.DONE
        if n_done >= self.scene.n_frames or _passed(self.scene, self.cell, block):
            return Status.DONE
        return Status.UNFINISHED


def _fields(record: Record) -> dict[str, Any]:
    return {field.name: getattr(record, field.name) for field in fields(Record)}


def pick_frames(scene: Scene) -> dict[int, float]:
    """Frame and clearance [m] of every pick: the first frame at or after the end of its stage, or the last one."""
    last = scene.n_frames - 1
    return {
        min(last, math.ceil(stage.end / scene.frame_interval - 1e-6)): stage.clearance
        for stage in scene.times.stages
        if stage.clearance is not None
    }


def _passed(scene: Scene, cell: Cell | None, block: Frames) -> bool:
    """True once the first part has reached the end of the measured way."""
    if scene.scenario.run.stop != "passage" or cell is None or not len(block):
        return False
    return bool((cell.way(block) <= PASSAGE_TO).any())
