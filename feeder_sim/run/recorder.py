"""Where the blocks of a run go: the trajectory file."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

from feeder_sim.errors import SimulationDiverged
from feeder_sim.records.seed import LastStates, Seed, save_last_states
from feeder_sim.records.trajectory_writer import TrajectoryWriter

WRITE_S = 0.5  # [s] of wall time between two blocks that are written


class Recorder:
    """Puts blocks into the trajectory file of a run folder; called from several threads.

    Args:
        folder: of the run.
        writer: of its trajectory file.
        wall_s_before: wall time [s] of the ensemble before it was interrupted.
    """

    def __init__(self, folder: Path, writer: TrajectoryWriter, *, wall_s_before: float = 0.0) -> None:
        self._folder, self._writer = folder, writer
        self._waiting: dict[int, list[Seed]] = {}
        self._written: dict[int, float] = {}  # when a seed was last written [s]
        self._single_blocks: dict[int, Seed | None] = {}  # of seeds that were written at once
        self._began = time.perf_counter() - wall_s_before

    def append(self, seed_index: int, block: Seed) -> None:
        """Take a block; short ones are written together."""
        self._waiting.setdefault(seed_index, []).append(block)
        if time.perf_counter() - self._written.setdefault(seed_index, time.perf_counter()) > WRITE_S:
            self._write(seed_index)

    def _write(self, seed_index: int) -> None:
        """Put on disk what waits."""
        if waiting := self._waiting.pop(seed_index, []):
            block = Seed.joined(waiting)
            self._writer.append(seed_index, block)
            self._single_blocks[seed_index] = None if seed_index in self._single_blocks else block
        self._written[seed_index] = time.perf_counter()

    def save_last(self, failure: SimulationDiverged, last: LastStates) -> str:
        """Keep the last states of the seed that diverged; returns the name of the file."""
        self._write(failure.seed)
        return save_last_states(self._folder, failure, last)

    def recorded(self, seed_index: int) -> Seed:
        """Everything appended so far."""
        self._write(seed_index)
        return self._single_blocks.pop(seed_index, None) or self._writer.read_back(seed_index)

    def append_ended(self, seed_index: int, seed: Seed) -> Seed:
        """Put a whole seed on disk, which has ended elsewhere; returns it with the name of its last states."""
        self.append(seed_index, seed)
        if seed.failure and seed.last:
            seed = replace(seed, failure=seed.failure.saved_in(self.save_last(seed.failure, seed.last)))
        self.finish(seed_index, seed)
        self._single_blocks.pop(seed_index, None)
        return seed

    def finish(self, seed_index: int, seed: Seed) -> None:
        """Note how a seed has ended."""
        self._write(seed_index)
        self._writer.finish(seed_index, seed, time.perf_counter() - self._began)
