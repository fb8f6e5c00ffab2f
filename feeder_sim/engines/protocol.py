"""What every way of advancing a scene offers."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol, cast

import numpy as np
from numpy.typing import NDArray

from feeder_sim import extensions
from feeder_sim.scenario.engine_choice import Choice

if TYPE_CHECKING:
    from feeder_sim.records.seed import Counts, Events
    from feeder_sim.records.trajectory import Frames
    from feeder_sim.scene.scene import Scene
    from feeder_sim.scene.start import Pose


# The engine of a scenario, imported only when it is needed.

CLASSES = {
    "impulse": "impulse.engine:ImpulseEngine",
    "exact": "impulse.free_part.engine:FreePartEngine",
    "joint": "impulse.joint.engine:JointEngine",
    "reaction": "impulse.reaction.engine:ReactingEngine",
    "slide": "slide.engine:SlideEngine",
    "mujoco": "mujoco.engine:MujocoEngine",
}


def engine_class(choice: Choice) -> type[Engine]:
    """The class behind an engine choice.

    Raises:
        InputError: it is of another package, and cannot be imported.
    """
    if choice.method not in CLASSES:
        return cast("type[Engine]", extensions.find("engines", choice.name))
    module, _, name = CLASSES[choice.method].partition(":")
    return cast("type[Engine]", getattr(importlib.import_module(f"feeder_sim.engines.{module}"), name))


ENDED, WHOLE = range(2)  # of an interrupt


def new_interrupt() -> NDArray[np.int64]:
    """What ends the computation of frames from another thread, and shows it how far they are, shape (2,).

    ENDED: not 0 as soon as the computation is to end where it is; WHOLE: frames that are whole of those under way.
    """
    return np.zeros(2, np.int64)


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
            interrupt: see `new_interrupt`; without one nobody ends `advance` before its time.
        """
        ...

    def current(self) -> Frames:
        """The present state as a single frame."""
        ...

    def advance(self, n_frames: int) -> Frames:
        """Return the next `n_frames` frames; where it is interrupted those that are whole, and then no more."""
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

    def take_impacts(self, *, end: bool) -> Events:
        """Contacts of a guided part with the plate since the last call; at the `end` also the one under way."""
        ...
