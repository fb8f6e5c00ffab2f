"""What a run will do and cost, before it is started."""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np

from feeder_sim.engines.lookup import engine_class
from feeder_sim.replay.wave import PERIODS, PICTURES, POINTS
from feeder_sim.run.advice import recommendations
from feeder_sim.run.run_folder import DISPLAY_POINTS
from feeder_sim.run.simulation import available_cores
from feeder_sim.scenario import Schedule
from feeder_sim.scenario.engine_choice import Choice
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.scene import GRAVITY, Scene, build_scene

TRIAL_STEPS = 20_000
BYTES_PER_FRAME_AND_PART = 68  # recorded, compressed
BYTES_REPLAY = 40  # per frame, part and seed in the .rrd
BYTES_FIXED = 150_000  # empty files, blueprint, meshes
BYTES_PER_SLOW_POINT = 16  # place and colour, in the .rrd
BYTES_PER_SURFACE_POINT = 60  # shape, mesh and colours of the plate, in both files


def plan_run(prepared: Prepared) -> dict[str, Any]:
    """Describe the resolved scene, its step count, and the time and file size to expect; runs a short trial."""
    scene, cell, engine = prepared.scene, prepared.cell, prepared.engine
    run, surface = scene.scenario.run, scene.surface
    frames = scene.n_frames * len(scene.parts) * run.seeds
    cost = _trial_cost(scene, engine)
    points = min(len(surface.x), DISPLAY_POINTS) * min(len(surface.y), DISPLAY_POINTS)
    file_size = frames * (BYTES_PER_FRAME_AND_PART + BYTES_REPLAY)
    file_size += points * surface.n_shapes * BYTES_PER_SURFACE_POINT + BYTES_FIXED
    file_size += _slow_pictures(scene) * min(points, POINTS**2) * BYTES_PER_SLOW_POINT
    return {
        "title": scene.scenario.title,
        "engine": engine.name,
        "engine_because": engine.reason,
        "plate_mm": [round(1e3 * d, 3) for d in (surface.length, surface.width, surface.thickness)],
        "drives": [
            {
                "mode": mode.label,
                "frequency_hz": mode.drive.drive_frequency,
                "antinode_amplitude_um": 1e6 * mode.drive.amplitude,
                "peak_acceleration_g": _throw_number(mode.drive.drive_frequency, mode.drive.amplitude),
                "ring_up_s": _ring_up(mode.drive.damping_ratio, mode.drive.natural_frequency),
            }
            for mode in scene.driven
        ],
        "antinode_to_node_mm": 1e3 * cell.reach if cell else None,
        "parts": [
            {
                "name": part.name,
                "shape": spec.shape,
                "count": spec.count,
                "guide": spec.guide.kind if spec.guide else None,
                "mass_g": 1e3 * part.mass,
                "inertia_g_mm2": [1e9 * moment for moment in part.inertia],
                "corners": len(part.corners),
            }
            for spec, part in zip(scene.scenario.part, scene.kinds, strict=True)
        ],
        "timestep_us": 1e6 * scene.timestep,
        "steps_per_seed": scene.n_steps,
        "seeds": run.seeds,
        "frames_per_seed": scene.n_frames,
        "estimated_wall_s": cost * scene.n_steps * math.ceil(run.seeds / available_cores()),
        "estimated_file_size_mb": 1e-6 * file_size,
        "cautions": list(prepared.cautions),
        "recommended": recommendations(scene),
        "estimates_are_upper_bounds": run.stop != "time" or any(stage.until for stage in scene.times.stages),
    }


def _slow_pictures(scene: Scene) -> int:
    """Pictures of the surface in slow motion: of every different stage of a schedule, or of a scene of many parts."""
    if scene.scenario.schedule is None and len(scene.parts) == 1:
        return 0
    different = {frozenset(scene.drives[i] for i in stage.excitations) for stage in scene.times.stages}
    return len(different - {frozenset()}) * PERIODS * PICTURES


def _busiest(scene: Scene) -> Scene:
    """The scene as it is in its stage of the highest frequency, whose steps are the shortest."""
    schedule = scene.scenario.schedule
    if schedule is None:
        return scene
    driven = [stage for stage in (*schedule.prepare, *schedule.stage) if stage.drive]
    stage = max(driven, key=lambda s: max(max(d.frequency_hz, d.natural_frequency_hz or 0.0) for d in s.drive))
    return build_scene(scene.scenario.model_copy(update={"schedule": Schedule(stage=(stage,))}))


def _trial_cost(scene: Scene, choice: Choice) -> float:
    """Wall time per step [s] of one part-seed on one core, after compilation."""
    scene = _busiest(scene)
    engine = engine_class(choice)(scene, np.random.default_rng(0))
    engine.advance(1)
    frames = min(scene.n_frames, max(1, TRIAL_STEPS // scene.steps_per_frame))
    started = time.perf_counter()
    engine.advance(frames)
    return (time.perf_counter() - started) / (frames * scene.steps_per_frame)


def _throw_number(frequency: float, amplitude: float) -> float:
    return amplitude * (2.0 * math.pi * frequency) ** 2 / GRAVITY


def _ring_up(damping_ratio: float | None, frequency: float) -> float:
    """Time constant 1/(zeta omega_n) of the envelope [s]; 0 without ring-up."""
    return 0.0 if damping_ratio is None else 1.0 / (damping_ratio * 2.0 * math.pi * frequency)
