"""The engine of a scenario, imported only when it is needed."""

from __future__ import annotations

import importlib
from typing import cast

from feeder_sim import extensions
from feeder_sim.engines.protocol import Engine
from feeder_sim.scenario.engine_choice import Choice

CLASSES = {
    "impulse": "impulse.engine:ImpulseEngine",
    "exact": "impulse.lone.engine:LoneEngine",
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
