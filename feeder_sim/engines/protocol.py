"""What every way of advancing a scene offers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from feeder_sim.records.counts import Counts
    from feeder_sim.records.impacts import Impacts
    from feeder_sim.records.trajectory import Frames
    from feeder_sim.scene.scene import Scene
    from feeder_sim.scene.start import Pose


class Engine(Protocol):
    """One running copy of a scene; owns its state and nothing else.

    Attributes:
        name: what the user calls it.
        frames_per_block: frames to ask for at once, so that little time is lost between blocks.
    """

    name: str
    frames_per_block: int

    @property
    def counts(self) -> Counts:
        """What was counted since t = 0."""
        ...

    def __init__(
        self,
        scene: Scene,
        rng: np.random.Generator,
        *,
        threads: int = 1,
        interrupt: NDArray[np.int64] | None = None,
    ) -> None:
        """Start at t = 0 with poses drawn from `rng`.

        Args:
            scene: what is advanced.
            rng: draws the start.
            threads: that may be used, which must not change the result.
            interrupt: (1,); as soon as another thread makes it other than 0, `advance` returns without a result, and
                the engine goes on from a state that is restored.
        """
        ...

    def current(self) -> Frames:
        """The present state as a single frame."""
        ...

    def advance(self, n_frames: int) -> Frames:
        """Step on and return the next `n_frames` frames."""
        ...

    def remove(self, parts: NDArray[np.int64]) -> None:
        """Take parts, by their indices, out of the scene."""
        ...

    def add(self, parts: NDArray[np.int64], poses: Sequence[Pose]) -> None:
        """Put parts, by their indices, that are not in the scene into it, after the last frame."""
        ...

    def redrive(self, scene: Scene) -> None:
        """Go on in the same scene with other times at which drives stop from now on."""
        ...

    def state(self) -> dict[str, NDArray[np.float64]]:
        """All that the engine goes on from; copies."""
        ...

    def restore(self, state: dict[str, NDArray[np.float64]]) -> None:
        """Go on from a state of the same scene, bit by bit as if there had been no break."""
        ...

    def take_impacts(self, *, end: bool) -> Impacts:
        """Contacts of a guided part with the plate since the last call; at the `end` also the one under way."""
        ...
