"""The plan of a run: the resolved scene, its step count, and the time and file size to expect.

The fields of `Plan` and of its parts are the keys that `feeder-sim check --json` prints, with their units.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from concurrent.futures import TimeoutError as FutureTimeoutError
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.protocol import ENDED, Engine, engine_class, new_interrupt
from feeder_sim.measures.catalogue import names_of_measures
from feeder_sim.measures.picking import robot_of
from feeder_sim.measures.protocol import as_json
from feeder_sim.part.rigid_part import RigidPart
from feeder_sim.plate.drive import ModalDrive
from feeder_sim.plate.mode_shapes import RitzShape
from feeder_sim.plate.sound import loudness
from feeder_sim.records.recording import DISPLAY_POINTS
from feeder_sim.replay.plate import PERIODS, PICTURES, POINTS
from feeder_sim.run.compilation import compile_engine
from feeder_sim.run.guard import Guard
from feeder_sim.run.prepare import prepare, recommendations
from feeder_sim.run.work import available_cores
from feeder_sim.scenario import PartSpec, Schedule, input_files
from feeder_sim.scenario.schedule import Stage
from feeder_sim.scene.driven_mode import DrivenMode
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.refill import refill_frames
from feeder_sim.scene.scene import Scene, build_scene
from feeder_sim.scene.under_parts import motion_under_parts

# How long a seed of a run will take, from a trial of its engine.
#
# What a step costs changes with what the parts do: at first they fall and the plate rings up, later they lie together
# on nodal lines, and in a pause they come to rest. So the trial goes through one pass of all stages, each cut to two
# seconds at most; what is cut off counts at the cost of the second half of what was computed of it. A run without
# stages is followed for longer while that costs next to nothing.

LONGEST_STAGE_S = 2.0  # of the drives of a stage, and of a pause
TRIAL_S, LONGEST_TRIAL_S = 2.0, 10.0  # [s] of wall time, and until a piece of it is given up
CHEAP_S = 0.1  # [s] of wall time that a trial may take in any case
PIECES = 8  # of a stretch, so that its second half is known by itself


@dataclass
class Stretch:
    """The drives or the pause of one stage: how long it lasts in the run, and in the trial [s].

    Attributes:
        whole: time in the run, all its cycles together.
        passes: how often it comes in the run.
        computed: simulated time and wall time of the pieces that were computed [s].
    """

    whole: float
    passes: int
    computed: list[tuple[float, float]]

    @property
    def rate(self) -> float:
        """Wall time per simulated second in the second half."""
        half = self.computed[len(self.computed) // 2 :]
        return sum(wall for _, wall in half) / sum(simulated for simulated, _ in half)

    @property
    def seconds(self) -> float:
        """Wall time of all of it in the run [s]."""
        simulated, wall = (sum(column) for column in zip(*self.computed, strict=True))
        return self.passes * wall + max(0.0, self.whole - self.passes * simulated) * self.rate


class _Seed:
    """A seed of the trial: an engine, and what looks at its frames."""

    def __init__(self, prepared: Prepared, number: int, interrupt: NDArray[np.int64]) -> None:
        start, rng = engine_class(prepared.engine), np.random.default_rng(number)
        threads = max(1, available_cores() // prepared.scenario.run.seeds)
        self._engine: Engine = start(prepared.scene, rng, threads=threads, interrupt=interrupt)
        self._guard = Guard(prepared, self._engine.current())

    def advance(self, n_frames: int) -> None:
        frames = self._engine.advance(n_frames)
        self._guard.check(frames, 0)
        self._guard.remember(n_frames)
        frames.as_stored()


def seed_seconds(prepared: Prepared) -> float:
    """Wall time [s] of one seed beside those that run at the same time, after compilation."""
    scene = _cut(prepared.scene)
    prepared, full_scene = replace(prepared, scene=scene), prepared.scene
    compile_engine(prepared)
    interrupt = new_interrupt()
    together = min(scene.scenario.run.seeds, available_cores())
    seeds = [_Seed(prepared, number, interrupt) for number in range(together)]
    stretches: list[Stretch] = []
    started, frame = time.perf_counter(), 0
    with ThreadPoolExecutor(together) as pool:  # this thread hears of Ctrl-C
        try:
            for stretch, end in _stretches(full_scene, scene):
                stretches.append(stretch)
                last = min(round(end / scene.frame_interval), scene.n_frames - 1)
                enough = min(last, frame + round(LONGEST_STAGE_S / scene.frame_interval))
                piece = max(1, (enough - frame) // PIECES)
                while frame < last and time.perf_counter() - started < (TRIAL_S if frame < enough else CHEAP_S):
                    n = min(piece, last - frame) if frame else 1  # of the first frame nothing is known
                    piece_start = time.perf_counter()
                    for future in [pool.submit(seed.advance, n) for seed in seeds]:
                        future.result(timeout=LONGEST_TRIAL_S)
                    stretch.computed.append((n * scene.frame_interval, time.perf_counter() - piece_start))
                    frame += n
        except FutureTimeoutError:  # a frame takes at least that long
            stretches[-1].computed.append((scene.frame_interval, LONGEST_TRIAL_S))
        finally:
            interrupt[ENDED] = 1
    timed = [stretch for stretch in stretches if stretch.computed]
    seconds = sum(stretch.seconds for stretch in timed)
    reached = sum(stretch.whole for stretch in timed)
    return seconds * max(1.0, full_scene.times.duration / reached)  # of the rest nothing better is known


def _cut(scene: Scene) -> Scene:
    """The scene with one pass of its stages, each cut; without a schedule it stays."""
    schedule = scene.scenario.schedule
    if schedule is None:
        return scene

    def cut(stage: Stage) -> Stage:
        least = 2.0 * scene.frame_interval
        length = max(min(stage.duration_s, LONGEST_STAGE_S), least)
        return stage.model_copy(update={"duration_s": length, "pause_s": min(stage.pause_s, LONGEST_STAGE_S)})

    once = Schedule(
        prepare=tuple(map(cut, schedule.prepare)),
        stage=tuple(map(cut, schedule.stage)),
        sequence=schedule.sequence,
    )
    return build_scene(scene.scenario.model_copy(update={"schedule": once}))


def _stretches(scene: Scene, trial: Scene) -> Iterator[tuple[Stretch, float]]:
    """Drives and pauses of the trial in order, as they are in the scene, and their end in the trial [s]."""
    if scene.scenario.schedule is None:
        duration = scene.times.duration
        yield Stretch(duration, 1, []), duration
        return
    cycles = scene.scenario.schedule.cycles
    for long, cut in zip(scene.times.stages, trial.times.stages, strict=False):
        passes = cycles if long.cycle else 1
        yield Stretch(passes * (long.stop - long.start), passes, []), cut.stop
        yield Stretch(passes * (long.end - long.stop), passes, []), cut.end


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
        input_runs, estimated_inputs_wall_s: at draws of uncertain inputs, which come after that; 0 without any.
        estimated_file_size_mb: of the run folder.
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
    input_runs: int
    estimated_inputs_wall_s: float
    estimated_file_size_mb: float
    measures: list[str]
    warnings: list[str]
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
        drawing=getattr(scene.scenario.plate, "drawing_account", None),
        drives=_drive_plans(scene),
        antinode_to_node_mm=1e3 * cell.reach if cell else None,
        parts=list(map(_part_plan, scene.scenario.kind_names, scene.scenario.part, scene.kinds)),
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
        warnings=list(prepared.warnings),
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
