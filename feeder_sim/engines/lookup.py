"""The engine of a scenario, imported only when it is needed."""

from __future__ import annotations

from feeder_sim.engines.protocol import Engine
from feeder_sim.scenario.engine_choice import Choice


def engine_class(choice: Choice) -> type[Engine]:
    """The class behind an engine choice."""
    if choice.method == "mujoco":
        from feeder_sim.engines.mujoco.engine import MujocoEngine

        return MujocoEngine
    if choice.method == "slide":
        from feeder_sim.engines.slide.engine import SlideEngine

        return SlideEngine
    if choice.method == "exact":
        from feeder_sim.engines.impulse.lone.engine import LoneEngine

        return LoneEngine
    if choice.method == "reaction":
        from feeder_sim.engines.impulse.reaction.engine import ReactingEngine

        return ReactingEngine
    from feeder_sim.engines.impulse.engine import ImpulseEngine

    return ImpulseEngine
