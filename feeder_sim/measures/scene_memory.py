"""What is made of a scene once, and asked for by every seed of it."""

from __future__ import annotations

import functools
import weakref
from collections.abc import Callable
from typing import TypeVar

from feeder_sim.scene.scene import Scene

T = TypeVar("T")


def once_for_scene(function: Callable[[Scene], T]) -> Callable[[Scene], T]:
    """The function, which remembers what it gave for the last scene as long as that scene lives.

    Threads may call it; at worst they all compute the same.
    """
    last: list[tuple[weakref.ref[Scene], T]] = []

    @functools.wraps(function)
    def remembered(scene: Scene) -> T:
        for known, value in tuple(last):
            if known() is scene:
                return value
        value = function(scene)
        last[:] = [(weakref.ref(scene, lambda _: last.clear()), value)]
        return value

    return remembered
