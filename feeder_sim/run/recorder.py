"""Where the blocks of a run go: the trajectory file, with checkpoints that match it."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import SimulationDiverged
from feeder_sim.records.checkpoint import Checkpoint, CheckpointFolder
from feeder_sim.records.counts import Counts
from feeder_sim.records.last_states import LastStates, save_last_states
from feeder_sim.records.trajectory import Record, Status, WallTime
from feeder_sim.records.trajectory_writer import TrajectoryWriter

WRITE_S = 0.5  # [s] of wall time between two blocks that are written


class RunRecorder:
    """Puts blocks into the trajectory file of a run folder and keeps checkpoints.

    Args:
        folder: of the run.
        writer: of its trajectory file.
        checkpoints: of the run.
        wall_s_before: wall time [s] of the ensemble before it was interrupted.
    """

    def __init__(
        self, folder: Path, writer: TrajectoryWriter, checkpoints: CheckpointFolder, *, wall_s_before: float = 0.0
    ) -> None:
        self._folder, self._writer, self._checkpoints = folder, writer, checkpoints
        self._sizes: dict[int, NDArray[np.int64]] = {}
        self._waiting: dict[int, list[Record]] = {}
        self._written: dict[int, float] = {}  # when a seed was last written [s]
        self._whole: dict[int, Record] = {}  # of seeds that were written at once
        self._began = time.perf_counter() - wall_s_before

    def append(self, seed_index: int, block: Record) -> None:
        """Take a block; short ones are written together."""
        self._waiting.setdefault(seed_index, []).append(block)
        if time.perf_counter() - self._written.setdefault(seed_index, time.perf_counter()) > WRITE_S:
            self.write(seed_index)

    def write(self, seed_index: int) -> None:
        """Put on disk what waits."""
        if waiting := self._waiting.pop(seed_index, []):
            block = Record.joined(waiting)
            self._writer.append(seed_index, block)
            added = np.array(block.sizes)
            if seed_index in self._sizes:
                self._sizes[seed_index] += added
                self._whole.pop(seed_index, None)
            else:
                self._sizes[seed_index], self._whole[seed_index] = added, block
        self._written[seed_index] = time.perf_counter()

    def checkpoint(self, seed_index: int, state: dict[str, NDArray[np.float64]], wall_s: float) -> None:
        self.write(seed_index)
        self._writer.note_wall_time(seed_index, self._wall_time(wall_s))
        self._checkpoints.save(seed_index, Checkpoint(tuple(self._sizes[seed_index].tolist()), state))

    def keep_last(self, failure: SimulationDiverged, last: LastStates) -> str:
        self.write(failure.seed)
        return save_last_states(self._folder, failure, last)

    def finish(self, seed_index: int, status: Status, wall_s: float, counts: Counts) -> None:
        self.write(seed_index)
        self._writer.note_wall_time(seed_index, self._wall_time(wall_s))
        self._writer.finish(seed_index, status, counts)

    def recorded(self, seed_index: int) -> Record:
        self.write(seed_index)
        return self._whole.pop(seed_index, None) or self._writer.read_back(seed_index)

    def _wall_time(self, of_seed: float) -> WallTime:
        return WallTime(of_seed, time.perf_counter() - self._began)
