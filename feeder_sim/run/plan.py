"""The plan of a run: the resolved scene, its step count, and the time and file size to expect.

The fields of `Plan` and of its parts are the keys that `feeder-sim check --json` prints, with their units.
"""

from __future__ import annotations

import math
import threading
import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.protocol import ENDED, Engine, engine_class, new_interrupt
from feeder_sim.measures.catalogue import names_of_measures
from feeder_sim.measures.picking import robot_of
from feeder_sim.measures.protocol import as_json
from feeder_sim.part.rigid_part import RigidPart
from feeder_sim.plate.drive import ModalDrive
from feeder_sim.plate.mode_shapes import RitzShape
from feeder_sim.plate.sound import loudness
from feeder_sim.pool.work import available_cores
from feeder_sim.records.recording import DISPLAY_POINTS
from feeder_sim.run.compilation import compile_engine
from feeder_sim.run.prepare import recommendations
from feeder_sim.scenario import PartSpec, input_files
from feeder_sim.scene.driven_mode import DrivenMode
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.refill import refill_frames
from feeder_sim.scene.scene import Scene
from feeder_sim.scene.under_parts import motion_under_parts

TRIAL_S = 2.0  # simulated, and of wall time at most
CHEAP_S = 0.2  # of wall time that is spent in any case: where parts come to rest, steps cost more than at first


def seed_seconds(prepared: Prepared, seeds: int) -> float:
    """Wall time [s] of one of so many seeds, after compilation: that of its first seconds, scaled to all of it."""
    compile_engine(prepared)
    scene, interrupt = prepared.scene, new_interrupt()
    threads = max(1, available_cores() // seeds)
    engine: Engine = engine_class(prepared.engine)(
        scene, np.random.default_rng(0), threads=threads, interrupt=interrupt
    )
    whole = max(1, scene.n_frames - 1)
    enough, frame = min(whole, round(TRIAL_S / scene.frame_interval)), 0
    end = threading.Timer(TRIAL_S, lambda: interrupt.__setitem__(ENDED, 1))
    end.start()
    started = time.perf_counter()
    try:
        while not interrupt[ENDED] and (frame < enough or (frame < whole and time.perf_counter() - started < CHEAP_S)):
            frame += max(1, len(engine.advance(min(engine.frames_per_block, whole - frame))))
    finally:
        end.cancel()
    return (time.perf_counter() - started) * scene.times.duration / (frame * scene.frame_interval)


BYTES_PER_FRAME_AND_PART = 73  # of the file of a seed
BYTES_PER_SEED = 12_000  # of that file without frames
BYTES_PER_SURFACE_POINT = 8  # of a shape, before it is compressed
BYTES_FIXED = 40_000  # meshes and texts


@dataclass(frozen=True)
class UnderPartPlan:
    """Amplitude of the plate where the parts of a table start: smallest, median and largest; peak of the median."""

    part: str
    amplitude_um: list[float]
    peak_acceleration_g: float


@dataclass(frozen=True)
class DrivePlan:
    """One drive and the motion of the plate that it causes; without ring-up `ring_up_s` is 0.

    `antinode_bounds_um` are the least and largest amplitude that a voltage may reach where glue, ceramic or damping are
    not known. `following_modes` move, too; `left_out_um` is what other modes would move, None where it is not known.
    `sound_dba_at_1_m` is an upper bound (feeder_sim.plate.sound); None of a plate without modes.
    """

    mode: str
    frequency_hz: float
    antinode_amplitude_um: float
    antinode_bounds_um: list[float]
    peak_acceleration_g: float
    ring_up_s: float
    under_parts: list[UnderPartPlan]
    following_modes: int
    left_out_um: float | None
    sound_dba_at_1_m: float | None


@dataclass(frozen=True)
class PartPlan:
    """One part table, by its name or else its shape, as results call it.

    `centre_mm` is the centre of mass in the part's file, `inertia_g_mm2` the principal moments of inertia, and
    `principal_axes` the attitude of their axes in the file, a quaternion with w first. The hull of its `corners` lies
    up to `corner_error_um` below that of the mesh; parts meet each other with `pieces` convex pieces.
    """

    name: str
    shape: str
    count: int
    guide: str | None
    mass_g: float
    centre_mm: list[float]
    inertia_g_mm2: list[float]
    principal_axes: list[float]
    corners: int
    corner_error_um: float
    pieces: int


@dataclass(frozen=True)
class Plan:
    """A run before it is started.

    Attributes:
        title: of the scenario.
        engine, engine_because: name of the engine, and the reason for the choice.
        plate_mm: length, width and thickness.
        drawing: what was taken of a drawing, and what was ignored; None without one.
        drives: one per excitation of the scenario.
        antinode_to_node_mm: length of the transport cell; None without one.
        parts: one per part table of the scenario.
        timestep_us: solver step.
        parts_at_once: on the plate at the start, and after a refill at most.
        refills_at_most: in a seed.
        simulated_s, looks_s: duration of the schedule of a seed at most, and what its pictures take besides; a pick
            takes `robot.pick_s` more.
        steps_per_seed, seeds, frames_per_seed: numbers.
        estimated_wall_s: on this machine, with all cores.
        estimated_file_size_mb: of the run folder, without replays.
        measures: names of what it will measure, such as --maximise and --measure take; those of the whole run first.
        warnings, recommended: lines of feeder_sim.run.prepare.
        estimates_are_upper_bounds: whether the run may end before its full duration.
    """

    title: str
    engine: str
    engine_because: str
    plate_mm: list[float]
    drawing: str | None
    drives: list[DrivePlan]
    antinode_to_node_mm: float | None
    parts: list[PartPlan]
    parts_at_once: int
    refills_at_most: int
    simulated_s: float
    looks_s: float
    timestep_us: float
    steps_per_seed: int
    seeds: int
    frames_per_seed: int
    estimated_wall_s: float
    estimated_file_size_mb: float
    measures: list[str]
    warnings: list[str]
    recommended: list[str]
    estimates_are_upper_bounds: bool


def plan_run(prepared: Prepared) -> dict[str, Any]:
    """The plan of a run as JSON takes it; see `make_plan`."""
    plan: dict[str, Any] = as_json(make_plan(prepared))
    return plan


def make_plan(prepared: Prepared) -> Plan:
    """Describe a run; a short trial of its engine says how long it takes."""
    scene, cell, engine = prepared.scene, prepared.cell, prepared.engine
    run, surface = scene.scenario.run, scene.surface
    accounts = getattr(scene.scenario.plate, "drawing_account", None), scene.scenario.drawing_account
    return Plan(
        title=scene.scenario.title,
        engine=engine.name,
        engine_because=engine.reason,
        plate_mm=[round(1e3 * d, 3) for d in (surface.length, surface.width, surface.thickness)],
        drawing="; ".join(filter(None, accounts)) or None,
        drives=_drive_plans(scene),
        antinode_to_node_mm=1e3 * cell.reach if cell else None,
        parts=list(map(_part_plan, scene.scenario.kind_names, scene.scenario.part, scene.kinds)),
        parts_at_once=scene.scenario.parts_at_once,
        refills_at_most=len(refill_frames(scene)),
        simulated_s=scene.times.duration,
        looks_s=robot_of(scene).camera_s * sum(bool(stage.picks) for stage in scene.times.stages),
        timestep_us=1e6 * scene.timestep,
        steps_per_seed=scene.n_steps,
        seeds=run.seeds,
        frames_per_seed=scene.n_frames,
        estimated_wall_s=_wall_seconds(prepared, run.seeds),
        estimated_file_size_mb=1e-6 * _file_size(scene),
        measures=sorted(names_of_measures(prepared), key=lambda name: "[" in name),
        warnings=list(prepared.warnings),
        recommended=recommendations(scene),
        estimates_are_upper_bounds=run.stop != "time" or any(stage.until for stage in scene.times.stages),
    )


def _wall_seconds(prepared: Prepared, seeds: int) -> float:
    """Wall time of so many seeds on all cores [s]."""
    return seed_seconds(prepared, seeds) * math.ceil(seeds / available_cores())


def _drive_plans(scene: Scene) -> list[DrivePlan]:
    """The driven modes of a scene, with the motion under its parts."""
    under: list[list[UnderPartPlan]] = [[] for _ in scene.driven]
    for motion in motion_under_parts(scene):
        amplitudes = [1e6 * motion.least, 1e6 * motion.median, 1e6 * motion.largest]
        part = UnderPartPlan(scene.scenario.kind_names[motion.part], amplitudes, motion.acceleration)
        under[motion.excitation].append(part)
    return [_drive_plan(mode, parts) for mode, parts in zip(scene.driven, under, strict=True)]


def _drive_plan(mode: DrivenMode, under_parts: list[UnderPartPlan]) -> DrivePlan:
    """A driven mode in the units of the plan."""
    drive = mode.drive
    return DrivePlan(
        mode=mode.label,
        frequency_hz=drive.drive_frequency,
        antinode_amplitude_um=1e6 * drive.steady_amplitude,
        antinode_bounds_um=[1e6 * drive.steady_amplitude * bound for bound in mode.bounds],
        peak_acceleration_g=_throw_number(drive),
        ring_up_s=drive.ring_up_time,
        under_parts=under_parts,
        following_modes=len(mode.followers),
        left_out_um=None if mode.left_out is None else 1e6 * mode.left_out,
        sound_dba_at_1_m=_loudness(mode),
    )


def _loudness(mode: DrivenMode) -> float | None:
    """How loud the plate is under one drive, at 1 m [dB(A)]."""
    if not isinstance(mode.shape, RitzShape):
        return None
    moving = [(mode.shape, mode.drive), *((follower.shape, follower.drive) for follower in mode.followers)]
    motion = {shape.index: drive.steady for shape, drive in moving if isinstance(shape, RitzShape)}
    level = loudness(mode.shape.modes, motion, mode.drive.drive_frequency)
    return level if math.isfinite(level) else None


def _part_plan(name: str, spec: PartSpec, kind: RigidPart) -> PartPlan:
    """A part table by its name, and the rigid part built from it, in the units of the plan."""
    return PartPlan(
        name=name,
        shape=spec.shape,
        count=spec.count,
        guide=spec.guide.kind if spec.guide else None,
        mass_g=1e3 * kind.mass,
        centre_mm=[1e3 * c for c in kind.centre.tolist()],
        inertia_g_mm2=[1e9 * moment for moment in kind.inertia],
        principal_axes=kind.principal_axes.tolist(),
        corners=len(kind.corners),
        corner_error_um=1e6 * kind.corner_error,
        pieces=max(1, len(kind.pieces)),
    )


def _throw_number(drive: ModalDrive) -> float:
    """Peak acceleration of the antinode over gravity [1]."""
    return drive.steady_amplitude * (2.0 * math.pi * drive.drive_frequency) ** 2 / GRAVITY


def _file_size(scene: Scene) -> int:
    """Size of the folder of a run of full length [byte], without its replays."""
    surface, seeds = scene.surface, scene.scenario.run.seeds
    points = min(len(surface.x), DISPLAY_POINTS) * min(len(surface.y), DISPLAY_POINTS)
    size = seeds * (scene.n_frames * len(scene.parts) * BYTES_PER_FRAME_AND_PART + BYTES_PER_SEED)
    copies = sum(path.stat().st_size for path in set(input_files(scene.scenario).values()))
    return size + points * surface.n_shapes * BYTES_PER_SURFACE_POINT + copies + BYTES_FIXED
