"""The plan of a run: the resolved scene, its step count, and the time and file size to expect.

The fields of `Plan` and of its parts are the keys that `feeder-sim check --json` prints, with their units.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from feeder_sim.constants import GRAVITY
from feeder_sim.measures.picks import robot_of
from feeder_sim.measures.protocol import as_json
from feeder_sim.measures.values import names_of_measures
from feeder_sim.part.rigid_part import RigidPart
from feeder_sim.plate.drive import ModalDrive
from feeder_sim.replay.wave import PERIODS, PICTURES, POINTS
from feeder_sim.run.advice import recommendations
from feeder_sim.run.prepare import prepare
from feeder_sim.run.run_folder import DISPLAY_POINTS
from feeder_sim.run.simulation import available_cores
from feeder_sim.run.trial import seed_seconds
from feeder_sim.scenario import PartSpec, input_files
from feeder_sim.scene.driven_mode import DrivenMode
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.refill import refill_frames
from feeder_sim.scene.scene import Scene
from feeder_sim.scene.under_parts import motion_under_parts

BYTES_PER_FRAME_AND_PART = 68  # of trajectory.h5, compressed
BYTES_REPLAY = 80  # per frame, part and seed in the .rrd: a part and its shadow
BYTES_FIXED = 150_000  # empty files, blueprint, meshes
BYTES_PER_SLOW_POINT = 16  # place and colour of a point of the surface in slow motion, in the .rrd
BYTES_PER_SURFACE_POINT = 60  # shape, mesh and colours of the plate, in both files


@dataclass(frozen=True)
class UnderPartPlan:
    """Amplitude of the plate where the parts of a table start: smallest, median and largest; peak of the median."""

    part: str
    amplitude_um: list[float]
    peak_acceleration_g: float


@dataclass(frozen=True)
class DrivePlan:
    """One drive and the motion of the plate that it causes; without ring-up `ring_up_s` is 0.

    `following_modes` move, too; `left_out_um` is what other modes would move, None where it is not known.
    """

    mode: str
    frequency_hz: float
    antinode_amplitude_um: float
    peak_acceleration_g: float
    ring_up_s: float
    under_parts: list[UnderPartPlan]
    following_modes: int
    left_out_um: float | None


@dataclass(frozen=True)
class PartPlan:
    """One part table.

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
        input_runs, estimated_inputs_wall_s: at draws of uncertain inputs, which come after that; 0 without any.
        estimated_file_size_mb: of the run folder.
        measures: names of what it will measure, such as --maximise and --measure take; those of the whole run first.
        cautions, recommended: lines of feeder_sim.run.advice.
        estimates_are_upper_bounds: whether the run may end before its full duration.
    """

    title: str
    engine: str
    engine_because: str
    plate_mm: list[float]
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
    input_runs: int
    estimated_inputs_wall_s: float
    estimated_file_size_mb: float
    measures: list[str]
    cautions: list[str]
    recommended: list[str]
    estimates_are_upper_bounds: bool


def plan_run(prepared: Prepared, input_runs: int = 0) -> dict[str, Any]:
    """The plan of a run as JSON takes it; see `make_plan`."""
    plan: dict[str, Any] = as_json(make_plan(prepared, input_runs))
    return plan


def make_plan(prepared: Prepared, input_runs: int = 0) -> Plan:
    """Describe a run; a short trial of its engine says how long it takes.

    Args:
        prepared: what is to be run.
        input_runs: of one seed each, at draws of uncertain inputs; counted where there are such inputs.
    """
    scene, cell, engine = prepared.scene, prepared.cell, prepared.engine
    run, surface = scene.scenario.run, scene.surface
    seconds = seed_seconds(prepared)
    input_runs = input_runs if scene.scenario.uncertain else 0
    return Plan(
        title=scene.scenario.title,
        engine=engine.name,
        engine_because=engine.reason,
        plate_mm=[round(1e3 * d, 3) for d in (surface.length, surface.width, surface.thickness)],
        drives=_drive_plans(scene),
        antinode_to_node_mm=1e3 * cell.reach if cell else None,
        parts=[_part_plan(spec, kind) for spec, kind in zip(scene.scenario.part, scene.kinds, strict=True)],
        parts_at_once=scene.scenario.parts_at_once,
        refills_at_most=len(refill_frames(scene)),
        simulated_s=scene.times.duration,
        looks_s=robot_of(scene).look_s * sum(bool(stage.picks) for stage in scene.times.stages),
        timestep_us=1e6 * scene.timestep,
        steps_per_seed=scene.n_steps,
        seeds=run.seeds,
        frames_per_seed=scene.n_frames,
        estimated_wall_s=seconds * math.ceil(run.seeds / available_cores()),
        input_runs=input_runs,
        estimated_inputs_wall_s=_inputs_seconds(prepared, seconds, input_runs),
        estimated_file_size_mb=1e-6 * _file_size(scene),
        measures=sorted(names_of_measures(prepared), key=lambda name: "[" in name),
        cautions=list(prepared.cautions),
        recommended=recommendations(scene),
        estimates_are_upper_bounds=run.stop != "time" or any(stage.until for stage in scene.times.stages),
    )


def _inputs_seconds(prepared: Prepared, of_seed: float, runs: int) -> float:
    """Wall time of so many runs of one thread each [s]; `of_seed` is that of a seed of the run."""
    if runs > prepared.scenario.run.seeds < available_cores():  # the seeds of the run have several threads each
        run = prepared.scenario.run.model_copy(update={"seeds": runs})
        of_seed = seed_seconds(prepare(prepared.scenario.model_copy(update={"run": run})))
    return of_seed * math.ceil(runs / available_cores())


def _drive_plans(scene: Scene) -> list[DrivePlan]:
    """The driven modes of a scene, with the motion under its parts."""
    under: list[list[UnderPartPlan]] = [[] for _ in scene.driven]
    for motion in motion_under_parts(scene):
        amplitudes = [1e6 * motion.least, 1e6 * motion.median, 1e6 * motion.largest]
        part = UnderPartPlan(f"part_{motion.part}", amplitudes, motion.acceleration)
        under[motion.excitation].append(part)
    return [_drive_plan(mode, parts) for mode, parts in zip(scene.driven, under, strict=True)]


def _drive_plan(mode: DrivenMode, under_parts: list[UnderPartPlan]) -> DrivePlan:
    """A driven mode in the units of the plan."""
    drive = mode.drive
    return DrivePlan(
        mode=mode.label,
        frequency_hz=drive.drive_frequency,
        antinode_amplitude_um=1e6 * drive.amplitude,
        peak_acceleration_g=_throw_number(drive),
        ring_up_s=drive.ring_up_time,
        under_parts=under_parts,
        following_modes=len(mode.followers),
        left_out_um=None if mode.left_out is None else 1e6 * mode.left_out,
    )


def _part_plan(spec: PartSpec, kind: RigidPart) -> PartPlan:
    """A part table, and the rigid part built from it, in the units of the plan."""
    return PartPlan(
        name=kind.name,
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
    return drive.amplitude * (2.0 * math.pi * drive.drive_frequency) ** 2 / GRAVITY


def _file_size(scene: Scene) -> int:
    """Size of the recording and the replay of a run of full length [byte]."""
    surface = scene.surface
    frames = scene.n_frames * len(scene.parts) * scene.scenario.run.seeds
    points = min(len(surface.x), DISPLAY_POINTS) * min(len(surface.y), DISPLAY_POINTS)
    size = frames * (BYTES_PER_FRAME_AND_PART + BYTES_REPLAY)
    size += points * surface.n_shapes * BYTES_PER_SURFACE_POINT + BYTES_FIXED
    size += sum(path.stat().st_size for path in set(input_files(scene.scenario).values()))  # their copies
    return size + _slow_pictures(scene) * min(points, POINTS**2) * BYTES_PER_SLOW_POINT


def _slow_pictures(scene: Scene) -> int:
    """Number of pictures of the surface in slow motion: for every different stage, if the replay shows stages."""
    if scene.scenario.schedule is None and len(scene.parts) == 1:
        return 0
    different = {frozenset(scene.drives[i] for i in stage.excitations) for stage in scene.times.stages}
    return len(different - {frozenset()}) * PERIODS * PICTURES
