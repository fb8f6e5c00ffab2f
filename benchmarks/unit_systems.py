"""Does the unit system of the MJCF change the drift? The same scene in SI and in mm-g-ms, and why they differ.

    python benchmarks/unit_systems.py --seeds 24

Two solver tolerances: MuJoCo's default, and the one the package sets (that default scaled back from the trace of the
whole inertia matrix, heavy patches included, to the trace of the part).
"""

from __future__ import annotations

import dataclasses
import math
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Annotated, Any
from unittest import mock

import numpy as np
import typer

import feeder_sim.engines.mujoco as engine_module
import feeder_sim.mjcf as mjcf_module
from feeder_sim.measures import PASSAGE_TO, Cell, Statistic, transport_cell, transport_speed
from feeder_sim.mjcf import build_mjcf
from feeder_sim.plate.drive import ModalTerms
from feeder_sim.scenario import load_scenario
from feeder_sim.scene import GRAVITY, Scene, build_scene
from feeder_sim.start import start_poses
from feeder_sim.trajectory import BLOCK_FRAMES, Frames

SCENARIO = Path(__file__).parents[1] / "scenarios/drift_4750hz.toml"
UNITS = {"SI": (1.0, 1.0, 1.0), "mm-g-ms": (1e3, 1e3, 1e3)}  # length, mass, time of SI in these units
MUJOCO_DEFAULT_TOLERANCE = 1e-8


def converted(scene: Scene, length: float, mass: float, time: float) -> Scene:
    """The scene with every quantity the engine sees expressed in other units."""
    s, t = scene.surface, scene.surface.terms
    terms = ModalTerms(t.shape, t.start * time, t.stop * time, t.coefficient * length, t.rate / time)
    surface = dataclasses.replace(
        s,
        length=s.length * length,
        width=s.width * length,
        thickness=s.thickness * length,
        x=s.x * length,
        y=s.y * length,
        table=s.table * [1.0, 1.0 / length, 1.0 / length],
        terms=terms,
    )
    parts = tuple(
        dataclasses.replace(
            p,
            mass=p.mass * mass,
            inertia=p.inertia * mass * length**2,
            corners=p.corners * length,
            vertices=p.vertices * length,
        )
        for p in scene.parts
    )
    return dataclasses.replace(scene, surface=surface, parts=parts, timestep=scene.timestep * time)


def speed(scene: Scene, cell: Cell, seed: np.random.SeedSequence, units: tuple[float, float, float]) -> float:
    """Transport speed [m/s] of one seed stepped in the given units."""
    length, _, time = units
    engine = engine_module.MujocoEngine(converted(scene, *units), np.random.default_rng(0))
    (pose,) = start_poses(scene, np.random.default_rng(seed))
    engine.data.qpos[3:6], engine.data.qpos[6:10] = pose.position * length, pose.quaternion
    blocks: list[Frames] = []
    while sum(map(len, blocks)) < scene.n_frames:
        block = engine.advance(BLOCK_FRAMES)
        blocks.append(dataclasses.replace(block, time=block.time / time, position=block.position / length))
        if (cell.way(blocks[-1]) <= PASSAGE_TO).any():
            break
    return transport_speed(Frames.joined(blocks), cell)


def main(seeds: Annotated[int, typer.Option()] = 24) -> None:
    scene = build_scene(load_scenario(SCENARIO))
    cell = transport_cell(scene)
    assert cell is not None
    print(f"{scene.scenario.title}, {seeds} seeds\ntolerance        units    speed (mm/s)")
    for tolerance in ("MuJoCo's default", "scaled to the part"):
        for name, units in UNITS.items():

            def spec(scaled: Scene, default: bool = tolerance.startswith("MuJoCo")) -> Any:
                built = build_mjcf(scaled)
                if default:
                    built.option.tolerance = MUJOCO_DEFAULT_TOLERANCE
                return built

            length, _, time = units
            gravity = GRAVITY * length / time**2
            with (
                mock.patch.object(engine_module, "build_mjcf", spec),
                mock.patch.object(mjcf_module, "GRAVITY", gravity),
                mock.patch.object(mjcf_module, "CORNER_RADIUS", mjcf_module.CORNER_RADIUS * length),
                ThreadPoolExecutor() as pool,
            ):
                roots = np.random.SeedSequence(0).spawn(seeds)
                found = Statistic.of(
                    1e3 * v for v in pool.map(lambda s, u=units: speed(scene, cell, s, u), roots) if math.isfinite(v)
                )
            print(f"{tolerance:<18} {name:<8} {found.mean:.3f} +- {found.se:.3f}", flush=True)


if __name__ == "__main__":
    typer.run(main)
