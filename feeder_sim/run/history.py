"""What one seed has recorded so far, as far as the rest of the run needs it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from feeder_sim.records.impacts import Impacts
from feeder_sim.records.removals import Removals
from feeder_sim.records.trajectory import Frames, Record


class History:
    """Blocks of one seed in order of time.

    With a recorder, which has them on disk, only the latest blocks stay in memory.

    Args:
        look_back: time before the last frame [s] over which frames are asked for.
        keep_all: keep all blocks.
    """

    def __init__(self, look_back: float, *, keep_all: bool) -> None:
        self._look_back, self._keep_all = look_back, keep_all
        self._blocks: list[Record] = []
        self.n_frames = 0
        self.removals = Removals.none()
        self.stops: NDArray[np.float64] = np.empty(0)

    def append(self, block: Record) -> None:
        self._blocks.append(block)
        self.n_frames += len(block.frames)
        if len(block.removals):
            self.removals = Removals.joined([self.removals, block.removals])
        if len(block.stops):
            self.stops = np.concatenate([self.stops, block.stops])
        if not self._keep_all and len(block.frames):
            since = block.frames.time[-1] - self._look_back
            while len(self._blocks) > 1 and _begins_by(self._blocks[1].frames, since):
                self._blocks.pop(0)

    def recent(self, since: float, latest: Frames) -> Frames:
        """The latest frames, which are not in here yet, after those from a time [s] on or a little before it."""
        frames = [latest]
        for block in reversed(self._blocks):
            if _begins_by(frames[0], since):
                break
            frames.insert(0, block.frames)
        return Frames.joined(frames)

    def record(self) -> Record:
        """Everything; only with `keep_all`."""
        return Record.joined(self._blocks)

    @staticmethod
    def first(frames: Frames) -> Record:
        """The first block: the state before anything has happened."""
        return Record(frames, Impacts.none(), Removals.none(), np.empty(0))


def _begins_by(frames: Frames, time: float) -> bool:
    return len(frames) > 0 and bool(frames.time[0] <= time)
