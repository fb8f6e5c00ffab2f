"""A refill: new parts over those that are on the plate, at the end of a cycle or every so often."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from feeder_sim.records.trajectory import Frames
from feeder_sim.scenario import Heap, Scattered
from feeder_sim.scene.scene import Scene, once_per_scene
from feeder_sim.scene.start import Pose, Spheres, column, free_place, height_and_attitude, next_parts

MAX_TRIES_OF_REFILL = 20_000  # places drawn for all parts of one refill before the plate counts as full


@once_per_scene
def refill_frames(scene: Scene) -> dict[int, int]:
    """Frames at whose end parts are filled in, and the number of the cycle or check; none at the end of a run."""
    if scene.scenario.refill is None:
        return {}
    if every := scene.scenario.refill.every_s:
        checks = [(scene.frame_at(k * every), k) for k in range(1, math.floor(scene.times.duration / every) + 1)]
        return {frame: number for frame, number in checks if frame < scene.n_frames - 1}
    ends = {stage.cycle: stage.end for stage in scene.times.stages if stage.cycle}
    last = scene.times.stages[-1].cycle
    return {scene.frame_at(end): cycle for cycle, end in ends.items() if cycle < last}


def refill_count(scene: Scene, on_plate: int) -> int:
    """How many parts are to come when so many are on the plate."""
    refill = scene.scenario.refill
    if refill is None:
        return 0
    full = scene.scenario.parts_at_once
    return full - on_plate if on_plate < (refill.below or full) else 0


def refill(scene: Scene, now: Frames, rng: np.random.Generator) -> tuple[NDArray[np.int64], list[Pose]]:
    """Parts, by their indices, that come onto the plate, and their poses; fewer than wanted where there is no room.

    Args:
        scene: has the refill.
        now: one frame, after picks.
        rng: as of `hopper.generator`.
    """
    number = refill_count(scene, int(scene.on_plate(now).sum()))
    return fill_in(scene, now, next_parts(scene, ~now.present[0], number, rng), rng)


def fill_in(
    scene: Scene, now: Frames, parts: NDArray[np.int64], rng: np.random.Generator
) -> tuple[NDArray[np.int64], list[Pose]]:
    """As `refill`, of parts (n,) that are chosen."""
    start = scene.scenario.refill_start
    if start is None or not len(parts):
        return np.empty(0, np.int64), []
    poses = (_heap if isinstance(start, Heap) else _scatter)(scene, start, parts, now, rng)  # type: ignore[arg-type]
    return parts[: len(poses)], poses


def _heap(
    scene: Scene,
    start: Heap,
    parts: NDArray[np.int64],
    now: Frames,
    rng: np.random.Generator,
) -> list[Pose]:
    """Poses in a column over the highest part under it, or over the plate; arguments as for `_scatter`."""
    position, is_present = now.position[0], now.present[0]
    sizes = np.array([kind.size for kind in scene.kinds])[scene.kind_of]
    size = float(sizes[parts].max())
    distance = np.hypot(*(position[is_present, :2] - 1e-3 * np.array(start.centre_mm)).T)
    is_under = distance < np.maximum(0.5e-3 * start.diameter_mm, size) + sizes[is_present]
    plate = float(_heights(scene, 1e-3 * np.array([start.centre_mm]), now)[0])
    top = max([0.0, plate, *(position[is_present, 2] + sizes[is_present])[is_under].tolist()])
    lift = np.array([0.0, 0.0, top + 1e-3 * start.drop_height_mm[0]])
    centres = column(start, size, len(parts), key="refill.start") + lift
    attitudes = [height_and_attitude(start, scene.kinds[scene.kind_of[part]], rng)[1] for part in parts]
    return [Pose(centre, attitude, np.zeros(3)) for centre, attitude in zip(centres, attitudes, strict=True)]


def _scatter(
    scene: Scene,
    start: Scattered,
    parts: NDArray[np.int64],
    now: Frames,
    rng: np.random.Generator,
) -> list[Pose]:
    """Poses at random places away from all parts, up to the first part for which there is none.

    Args:
        scene: has the parts and the plate.
        start: where they are to come.
        parts: that are to come (n,).
        now: one frame of all parts.
        rng: draws.
    """
    placed = Spheres(max(kind.size for kind in scene.kinds))
    present = np.flatnonzero(now.present[0])
    for part, height in zip(present, _heights(scene, now.position[0, present], now), strict=True):
        placed.add(now.position[0, part] - [0.0, 0.0, height], scene.parts[part].size)
    poses: list[Pose] = []
    tries = [MAX_TRIES_OF_REFILL]
    for part in parts:
        kind = scene.kinds[scene.kind_of[part]]
        height, quaternion = height_and_attitude(start, kind, rng)
        place = free_place(scene, start, kind, height, placed, rng, tries)
        if place is None:
            break
        placed.add(np.array([*place, height]), kind.size)
        lift = max(0.0, float(_heights(scene, place[None, :], now)[0]))
        poses.append(Pose(np.array([*place, height + lift]), quaternion, np.zeros(3)))
    return poses


def _heights(scene: Scene, places: NDArray[np.float64], now: Frames) -> NDArray[np.float64]:
    """Height of the plate (n,) [m] under places (n, 2 or 3) [m] at the time of one frame: a tray may be anywhere."""
    return scene.surface.heights(places[:, :2], np.repeat(now.time, len(places)))
