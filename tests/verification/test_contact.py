"""Contact against closed forms, on a plate at rest."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from conftest import piston_scenario

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.mujoco.engine import MujocoEngine
from feeder_sim.records.trajectory import Frames
from feeder_sim.run.simulation import simulate
from feeder_sim.scenario import Ball, Contact, Cylinder, HexNut, MeshPart, Start
from feeder_sim.scene.scene import build_scene

FLAT = Start(drop_height_mm=(1.0, 1.0), tilt_deg=(0.0, 0.0), yaw_deg=(17.0, 17.0))


def dropped(engine: str, part: object, restitution: float, duration_s: float = 0.03) -> Frames:
    scenario = piston_scenario(
        engine=engine,
        part=part,
        frequency_hz=1000.0,
        contact=Contact(restitution=restitution),
        duration_s=duration_s,
        steps_per_period=1000,
        frames_per_second=200_000.0,
    )
    return simulate(scenario).trajectories[0]


PARTS = {
    "hex_nut": HexNut(size="M2.5", start=FLAT),
    "ball": Ball(shape="ball", diameter_mm=3.0, start=FLAT),
    "cylinder": Cylinder(shape="cylinder", diameter_mm=3.0, height_mm=2.0, start=FLAT),
}


ENGINES = ["impulse", "mujoco"]


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("name", PARTS)
@pytest.mark.parametrize("restitution", [0.2, 0.6])
def test_flat_drop_rebounds_with_e_and_without_spin(engine: str, name: str, restitution: float) -> None:
    frames = dropped(engine, PARTS[name], restitution)
    impact = np.sqrt(2 * GRAVITY * 1e-3)
    upward = frames.velocity[:, 0, 2].max()
    assert upward == pytest.approx(restitution * impact, rel=4e-3)
    assert np.abs(frames.velocity[:, 0, :2]).max() < 1e-6 * impact
    assert np.abs(frames.angular_velocity).max() < 1e-4


def test_sliding_part_stops_after_v_over_mu_g() -> None:
    """On average: MuJoCo's convex cone makes a sliding part hop, which leaves its mean normal force at m g."""
    mu, speed = 0.3, 0.6
    resting = Start(drop_height_mm=(0.0, 0.0), tilt_deg=(0.0, 0.0))
    scenario = piston_scenario(
        part=Cylinder(shape="cylinder", diameter_mm=8.0, height_mm=1.0, start=resting),
        frequency_hz=1000.0,
        contact=Contact(restitution=0.0, friction=mu),
        steps_per_period=100,
        frames_per_second=1000.0,
    )
    engine = MujocoEngine(build_scene(scenario), np.random.default_rng(0))
    engine.advance(5)
    engine.data.qvel[3] = speed
    frames = engine.advance(300)
    moving = np.linalg.norm(frames.velocity[:, 0, :2], axis=1) > 1e-3
    assert 1e-3 * moving.sum() == pytest.approx(speed / (mu * GRAVITY), rel=0.05)


@pytest.mark.parametrize("engine", ENGINES)
def test_part_rests_where_it_was_put(engine: str) -> None:
    resting = Start(drop_height_mm=(0.0, 0.0), tilt_deg=(0.0, 0.0))
    frames = simulate(piston_scenario(start=resting, duration_s=0.2, engine=engine)).trajectories[0]
    assert np.abs(frames.position[-1] - frames.position[0]).max() < 2e-6


@pytest.mark.parametrize("engine", ENGINES)
def test_part_that_rests_on_a_slowly_moving_plate_follows_it(engine: str) -> None:
    """Below 1 g of peak acceleration the nut stays on the plate."""
    resting = Start(drop_height_mm=(0.0, 0.0), tilt_deg=(0.0, 0.0))
    scenario = piston_scenario(
        frequency_hz=20.0,
        amplitude_um=100.0,
        start=resting,
        contact=Contact(restitution=0.0),
        duration_s=0.5,
        steps_per_period=1000,
        engine=engine,
    )
    scene = build_scene(scenario)
    frames = simulate(scenario).trajectories[0]
    plate = scene.surface.terms.phasor(frames.time, 1)[:, 0].real
    height = frames.position[:, 0, 2] - frames.position[0, 0, 2]
    assert np.abs(height - plate).max() < 2e-6


@pytest.mark.parametrize("engine", ENGINES)
def test_any_hull_tumbles_to_rest_on_one_of_its_faces(engine: str, tmp_path: Path) -> None:
    """A brick, no symmetry axis, dropped on an edge."""
    trimesh.creation.box(extents=[2.0, 3.0, 5.0]).export(tmp_path / "brick.stl")
    start = Start(drop_height_mm=(2.0, 2.0), tilt_deg=(20.0, 60.0))
    scenario = piston_scenario(
        part=MeshPart(shape="mesh", file=tmp_path / "brick.stl", start=start),
        frequency_hz=1000.0,
        duration_s=1.0,
        seeds=3,
        engine=engine,
    )
    for frames in simulate(scenario).trajectories:
        height = 1e3 * frames.position[-1, 0, 2]
        assert min(abs(height - h) for h in (1.0, 1.5, 2.5)) < 0.01
        assert np.abs(frames.velocity[-1]).max() < 2e-3
        assert np.abs(frames.angular_velocity[-1]).max() < 1.0
