"""Ways of advancing a scene, behind one protocol, and the choice between them."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError

if TYPE_CHECKING:
    from feeder_sim.impacts import Impacts
    from feeder_sim.scenario import Scenario
    from feeder_sim.scene import Scene
    from feeder_sim.trajectory import Frames


class Engine(Protocol):
    """One running copy of a scene; owns its state and nothing else.

    Attributes:
        name: what the user calls it.
        frames_per_block: frames to ask for at once, so that little time is lost between blocks.
    """

    name: str
    frames_per_block: int

    def __init__(self, scene: Scene, rng: np.random.Generator, *, threads: int = 1) -> None:
        """Start at t = 0 with poses drawn from `rng`; may use so many threads, which must not change the result."""
        ...

    def current(self) -> Frames:
        """The present state as a single frame."""
        ...

    def advance(self, n_frames: int) -> Frames:
        """Step on and return the next `n_frames` frames."""
        ...

    def remove(self, parts: NDArray[np.int64]) -> None:
        """Take parts, by their indices, out of the scene for good."""
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
    guide = scenario.guide
    if guide is not None and guide.kind == "tube" and guide.friction > 0.0 and (asked == "mujoco" or compliant):
        raise InputError(
            f"is {guide.friction:g}, allowed is 0 in MuJoCo: a part that slides along the wall gains speed away from "
            "it in MuJoCo's convex friction cone",
            key="part[0].guide.friction",
        )
    if asked != "auto":
        return Choice(asked, "asked for")
    if compliant:
        return Choice("mujoco", "a compliant contact needs its spring-dampers")
    if _slides(scenario):
        return Choice("impulse", "one degree of freedom, whose impacts it finds exactly")
    return Choice("impulse", "rigid contact, which it covers and is the fastest at")


def engine_class(scenario: Scenario) -> type[Engine]:
    """Look the engine of a scenario up, importing it only now; errors as for `choose_engine`."""
    if choose_engine(scenario).name == "mujoco":
        from feeder_sim.engines.mujoco import MujocoEngine

        return MujocoEngine
    if _slides(scenario):
        from feeder_sim.engines.slide import SlideEngine

        return SlideEngine
    from feeder_sim.engines.impulse import ImpulseEngine

    return ImpulseEngine


def _slides(scenario: Scenario) -> bool:
    guide = scenario.guide
    return guide is not None and guide.kind == "slide"
