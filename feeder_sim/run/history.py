"""The blocks that one seed has recorded so far, as many of them as the rest of its run needs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from feeder_sim.records.events import REMOVALS, joined, no_events
from feeder_sim.records.seed import Seed
from feeder_sim.records.trajectory import Frames


class History:
    """Blocks of one seed in order of time.

    A recorder writes all blocks to disk. Then only the latest ones have to stay in memory.

    Args:
        look_back: longest time before the last frame [s] for which `recent` is called.
        keep_all: keep all blocks in memory, which `whole` needs.

    Attributes:
        look_back, keep_all: as above; they may be changed.
        n_frames: number of frames so far, those included that are no longer in memory.
        removals: all removals so far.
        stops: times at which the drives of the first stages have stopped [s], shape (n,).
    """

    def __init__(self, look_back: float, *, keep_all: bool) -> None:
        self.look_back, self.keep_all = look_back, keep_all
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
        if not self.keep_all and len(block.frames):
            since = block.frames.time[-1] - self.look_back
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

    def whole(self) -> Seed:
        """All blocks as one; only with `keep_all`."""
        return Seed.joined(self._blocks)


def _begins_by(frames: Frames, time: float) -> bool:
    """Whether there are frames and the first one is not after a time [s]."""
    return len(frames) > 0 and bool(frames.time[0] <= time)
