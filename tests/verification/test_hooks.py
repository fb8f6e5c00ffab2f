"""Concave parts meet each other by their pieces, in both engines."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hooks import S_HOOK, U_HOOK, of_boxes, piece_distances, with_parts

from feeder_sim.engines.impulse import parts_engine as impulse
from feeder_sim.engines.mujoco import engine as mujoco
from feeder_sim.engines.protocol import engine_class
from feeder_sim.scenario import Contact, Drive, Heap, HexNut, RigidPlate, Run, Scattered, Scenario
from feeder_sim.scenario.engine_choice import choose_engine
from feeder_sim.scene.scene import Scene, build_scene
from feeder_sim.scene.start import Pose

DEEPEST = 50e-6  # [m] that pieces may be found inside each other at a frame
HOOK = of_boxes(U_HOOK)
ENGINES = ("impulse", "mujoco")
IN_MUJOCO_3 = pytest.mark.xfail(
    reason="in MuJoCo 3.17 hooks meet too rarely, and enter each other by 100 um", strict=True
)


def plate(count: int, engine: str, *, amplitude_um: float = 0.0, contact: dict[str, float]) -> Scene:
    """Hooks over a plate that moves up and down."""
    start = Heap(kind="heap", diameter_mm=30.0) if count > 2 else Scattered(kind="scattered")
    scenario = Scenario(
        plate=RigidPlate(kind="piston", length_mm=50.0, width_mm=50.0, rim=count > 2),
        drive=(Drive(frequency_hz=2000.0, amplitude_um=amplitude_um, ring_up=False),),
        part=(HexNut(size="M5", count=count, start=start),),
        contact=Contact.model_validate(contact),
        run=Run.model_validate({"duration_s": 0.3, "seeds": 1, "engine": engine, "frames_per_second": 500.0}),
    )
    return build_scene(scenario)


def advanced(scene: Scene, n_frames: int, seed: int = 0) -> Any:
    return engine_class(choose_engine(scene.scenario))(scene, np.random.default_rng(seed)).advance(n_frames)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_hook_takes_along_another_that_it_is_hooked_into(engine: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A prong of either is in the gap of the other; on a smooth plate one moves across the prongs at 5 cm/s."""
    scene = plate(2, engine, contact={"friction": 0.0, "restitution": 0.0, "part_friction": 0.0})
    scene = with_parts(scene, HOOK)
    level, turned = np.array([1.0, 0.0, 0.0, 0.0]), np.array([0.0, 0.0, 0.0, 1.0])
    speed, gap, up = 0.05, 1.5e-3, 1.5e-3 + 1e-6
    middle = (1e-3 * np.array([6.0, 6.0, 0.0]) - HOOK.centre) * [1.0, 1.0, 0.0]  # of the U, from its centre of mass
    first, other = np.array([0.0, 0.0, up]) - middle, np.array([5e-3, 4.5e-3, up]) + middle
    poses = [Pose(first, level, np.array([0.0, speed, 0.0])), Pose(other, turned, np.zeros(3))]
    for module in (impulse, mujoco):
        monkeypatch.setattr(module, "start_poses", lambda scene, rng: poses)
    frames = advanced(scene, 100)
    apart = piece_distances(scene, frames)
    assert apart.min() > -DEEPEST
    assert apart[0] == pytest.approx(gap - speed * frames.time[0], abs=1e-6) and apart.min() < 1e-5
    along = frames.velocity[..., 1]
    assert along.sum(axis=1) == pytest.approx(np.full(100, speed), abs=2e-3 * speed)
    assert along[-1, 1] > 0.2 * speed
    assert np.abs(frames.position[0] - np.array([first, other])).max() < 1e-3 * speed * 5
    # The hulls are in each other from the start: they are parted at once, or (in MuJoCo, whose contacts push nothing
    # out) press on each other across the plane in which they lie, and nothing is taken along.
    hulls = with_parts(scene, replace(HOOK, pieces=()))
    frames = advanced(hulls, 50)
    moved = np.abs(frames.position[-1] - np.array([first, other])).max()
    assert moved > 1e-3 if engine == "impulse" else abs(frames.velocity[-1, 1, 1]) < 0.01 * speed


@pytest.mark.parametrize("engine", ["impulse", pytest.param("mujoco", marks=IN_MUJOCO_3)])
@pytest.mark.parametrize("count", [5, pytest.param(10, marks=pytest.mark.slow)])
def test_a_crowd_of_hooks_on_a_shaken_plate_does_not_enter_itself(engine: str, count: int) -> None:
    """U and S hooks thrown about by a plate at 0.3 m/s and 100 g, between walls that keep them close."""
    scene = plate(count, engine, amplitude_um=25.0, contact={})
    for seed, boxes in enumerate((U_HOOK, S_HOOK)):
        crowd = with_parts(scene, of_boxes(boxes))
        frames = advanced(crowd, 150, seed)
        apart = piece_distances(crowd, frames)
        assert apart.min() > -DEEPEST
        assert (apart < 2e-6).sum() > 0.5 * count  # they do meet
