"""Ways of advancing a scene, behind one protocol."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

if TYPE_CHECKING:
    from feeder_sim.scene import Scene
    from feeder_sim.trajectory import Frames


class Engine(Protocol):
    """One running copy of a scene; owns its state and nothing else."""

    name: str

    def __init__(self, scene: Scene, rng: np.random.Generator) -> None:
        """Start at t = 0 with poses drawn from `rng`."""
        ...

    def current(self) -> Frames:
        """The present state as a single frame."""
        ...

    def advance(self, n_frames: int) -> Frames:
        """Step on and return the next `n_frames` frames."""
        ...


def engine_class(name: str) -> type[Engine]:
    """Look an engine up by name, importing it only now."""
    if name == "mujoco":
        from feeder_sim.engines.mujoco import MujocoEngine

        return MujocoEngine
    if name == "impulse":
        from feeder_sim.engines.impulse import ImpulseEngine

        return ImpulseEngine
    raise KeyError(name)
