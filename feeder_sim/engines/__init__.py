"""Ways of advancing a scene, behind one protocol, and the choice between them."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from feeder_sim.errors import InputError

if TYPE_CHECKING:
    from feeder_sim.scenario import Scenario
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


class Choice(NamedTuple):
    """An engine by name, and why it is the one."""

    name: str
    reason: str


def choose_engine(scenario: Scenario) -> Choice:
    """Pick the engine of a scenario: the one it asks for, else the fastest that covers it.

    Raises:
        InputError: the engine asked for does not cover the scenario.
    """
    asked, compliant = scenario.run.engine, scenario.contact.model == "compliant"
    if asked == "impulse" and compliant:
        raise InputError(
            'is "impulse", allowed is "mujoco" with contact.model = "compliant": impulses have no stiffness',
            key="run.engine",
        )
    if asked != "auto":
        return Choice(asked, "asked for")
    if compliant:
        return Choice("mujoco", "a compliant contact needs its spring-dampers")
    return Choice("impulse", "rigid contact of one part, which it covers and is the fastest at")


def engine_class(name: str) -> type[Engine]:
    """Look an engine up by name, importing it only now."""
    if name == "mujoco":
        from feeder_sim.engines.mujoco import MujocoEngine

        return MujocoEngine
    if name == "impulse":
        from feeder_sim.engines.impulse import ImpulseEngine

        return ImpulseEngine
    raise KeyError(name)
