"""Scenario -> scene: the moving surface, the parts, the timetable and the time step; in SI units."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from feeder_sim.constants import GRAVITY
from feeder_sim.errors import InputError
from feeder_sim.notebook import counted
from feeder_sim.part.rigid_part import RigidPart, outline
from feeder_sim.part.stable_poses import NONE, PoseTable, stable_poses
from feeder_sim.plate.drive import ModalDrive, silent_terms
from feeder_sim.plate.surface import Surface
from feeder_sim.records.trajectory import Frames
from feeder_sim.scenario import GivenState, Scenario, Slide, Start, Tube, check_scenario
from feeder_sim.scene.driven_mode import DrivenMode, free_modes
from feeder_sim.scene.driven_plate import DrivenPlate, assemble_plate, motion_terms
from feeder_sim.scene.fits import check_goal, check_in_tube, check_on_plate, check_picks, check_refill
from feeder_sim.scene.fixture import RigidFixture, build_fixtures
from feeder_sim.scene.outlet import OutletVolume, build_outlets
from feeder_sim.scene.part import build_part, zener_inelasticities
from feeder_sim.scene.timetable import (
    FRAME_AT,
    TimedStage,
    Timetable,
    each_once,
    largest_together,
    of_stages,
    timetable,
)

# Guides, which keep a part over one place of the plate.
#
# A *slide* has no play: the part moves along its axis only and does not turn, which leaves one degree of freedom. With
# the axis at an angle theta to the vertical, and friction mu between part and guide, the part's height z obeys between
# impacts
#
#     z'' = -g cos(theta) (cos(theta) + mu sin(theta))    going up
#     z'' = -g cos(theta) (cos(theta) - mu sin(theta))    going down
#
# (weight and friction along the axis, times cos(theta) for the height). A *tube* has play: the part keeps its six
# degrees of freedom and can touch a round wall.


@dataclass(frozen=True)
class Guide:
    """A guide in SI units; it leans towards +x.

    Attributes:
        slides: True for a slide, False for a tube.
        tilt: theta [rad].
        foot: (x, y) where the axis meets the resting plate [m].
        friction: coefficient between part and guide [1].
        restitution: coefficient between part and wall [1]; None for a slide.
        radius: inner radius [m]; None for a slide.
    """

    slides: bool
    tilt: float
    foot: tuple[float, float]
    friction: float
    restitution: float | None = None
    radius: float | None = None

    @property
    def axis(self) -> NDArray[np.float64]:
        """Unit vector upwards along the guide, shape (3,)."""
        return np.array([math.sin(self.tilt), 0.0, math.cos(self.tilt)])

    def deceleration(self, gravity: float) -> tuple[float, float]:
        """-z'' [m/s^2] of a part on a slide on its way up and on its way down, by the formulas of the module."""
        along, across = math.cos(self.tilt), self.friction * math.sin(self.tilt)
        return gravity * along * (along + across), gravity * along * (along - across)


def build_guide(spec: Slide | Tube, position_mm: tuple[float, float]) -> Guide:
    """Turn the guide of a scenario into SI units."""
    x, y = (1e-3 * c for c in position_mm)
    tilt = math.radians(spec.tilt_deg)
    if isinstance(spec, Slide):
        return Guide(True, tilt, (x, y), spec.friction)
    return Guide(False, tilt, (x, y), spec.friction, spec.restitution, 0.5e-3 * spec.inner_diameter_mm)


FRAME_ROUND_OFF = 1e-9  # of a frame interval, where the duration is a whole number of intervals
LONGEST_STEP = 5e-4  # [s], in which a part at rest falls by a micrometre
# [s]; at 50 Hz conveying speeds of parts in steps were up to half too fast at 500 us, and right within 1 % at 20 us.
LONGEST_TRAY_STEP = 2e-5
ENTERED = 0.25  # of the thinnest part; what a fast part enters the plate in the longest step


T = TypeVar("T")


def once_per_scene(make: Callable[[Scene], T]) -> Callable[[Scene], T]:
    """A function of a scene whose value is kept as long as that, for all its seeds; nobody may write into it."""
    made: WeakKeyDictionary[Scene, T] = WeakKeyDictionary()

    @functools.wraps(make)
    def of(scene: Scene) -> T:
        if scene not in made:
            made[scene] = make(scene)
        return made[scene]

    return of


@dataclass(frozen=True, repr=False, eq=False)
class Scene:
    """Everything an engine needs, in SI units; the top of the resting plate is z = 0.

    Attributes:
        scenario: the one from which the scene was built.
        surface: the moving surface.
        driven: the driven modes, one per excitation of the scenario.
        times: stages, and the intervals in which each excitation acts.
        kinds: the different rigid parts, one per part table of the scenario.
        kind_of: index into `kinds` of every part, shape (parts,).
        parts: all rigid parts, in the order of their tables.
        guides: the guide of each part; None for a free one.
        fixtures: what stands on the plate.
        outlets: where parts leave.
        timestep: solver step [s].
        steps_per_frame: solver steps between two recorded frames.
    """

    scenario: Scenario
    surface: Surface
    driven: tuple[DrivenMode, ...]
    times: Timetable
    kinds: tuple[RigidPart, ...]
    kind_of: NDArray[np.int64]
    parts: tuple[RigidPart, ...]
    guides: tuple[Guide | None, ...]
    fixtures: tuple[RigidFixture, ...]
    outlets: tuple[OutletVolume, ...]
    timestep: float
    steps_per_frame: int

    def __repr__(self) -> str:
        items = [counted(len(self.parts), "part"), counted(len(self.driven), "drive"), f"{self.times.duration:g} s"]
        return f"<Scene: {', '.join(items)}>"

    @property
    def drives(self) -> tuple[ModalDrive, ...]:
        """The modal drives, one per excitation of the scenario."""
        return tuple(mode.drive for mode in self.driven)

    @property
    def all_drives(self) -> tuple[tuple[ModalDrive, ...], ...]:
        """For every excitation its modal drive, and those of the modes that follow it."""
        return tuple(mode.drives for mode in self.driven)

    def stopped(self, stops: Sequence[float]) -> Scene:
        """The same scene, but the drives of the first stages stop at these times [s]."""
        times = self._timetable(stops)
        return replace(self, times=times, surface=self.surface.moved_by(motion_terms(self.driven, times)))

    def up_to_stage(self, n_stages: int) -> Scene:
        """The same scene as it is while the last of its first stages is under way: of later ones nothing is known.

        The motion has what acts or rings from the begin of that stage on, and of every drive the frequencies, so that
        engines take the same steps in all stages.
        """
        stages = self.times.stages[:n_stages]
        times = of_stages(stages)
        ringing = motion_terms(self.driven, times).since(stages[-1].start if stages else 0.0)
        terms = ringing.joined(silent_terms(drive for drives in self.all_drives for drive in drives))
        return replace(self, times=times, surface=self.surface.moved_by(terms))

    @property
    def stage_by_stage(self) -> bool:
        """Whether every stage is computed by itself, as if nothing were known of the next one."""
        schedule = self.scenario.schedule
        return schedule is not None and schedule.sequence is not None

    def stages(self, stops: Sequence[float]) -> tuple[TimedStage, ...]:
        """All stages, when the drives of the first ones stop at these times [s]."""
        return self._timetable(stops).stages

    def _timetable(self, stops: Sequence[float]) -> Timetable:
        return timetable(self.scenario, stops, frame_interval=self.frame_interval)

    @property
    def frame_interval(self) -> float:
        """Time between recorded frames [s]."""
        return self.timestep * self.steps_per_frame

    @property
    def n_frames(self) -> int:
        """Recorded frames of a full-length run, the first at t = 0."""
        return 1 + math.floor(self.times.duration / self.frame_interval + FRAME_ROUND_OFF)

    def frame_at(self, time: float) -> int:
        """Number of the first frame at or after a time [s], or of the last one."""
        return min(self.n_frames - 1, math.ceil(time / self.frame_interval - FRAME_AT))

    def on_plate(self, frames: Frames) -> NDArray[np.bool_]:
        """Which parts are on the plate (n, parts): in the scene, their centres over it and above where it is then."""
        place, trough = frames.position, self.surface.trough
        height = np.full(place.shape[:2], -trough)
        is_near = frames.present & (np.abs(place[..., 2]) <= trough)
        if is_near.any():
            time = np.broadcast_to(frames.time[:, None], is_near.shape)[is_near]
            height[is_near] = self.surface.heights(place[is_near][:, :2], time)
        return frames.on_plate(self.surface, height)

    @property
    def rim(self) -> bool:
        """Whether the four walls of a rectangle that stands stand around the plate; those of others are fixtures."""
        return bool(getattr(self.scenario.plate, "rim", False)) and not self.scenario.rim_of_fixtures

    @cached_property
    def poses(self) -> tuple[PoseTable, ...]:
        """The stable poses of every kind."""
        return tuple(stable_poses(kind) for kind in self.kinds)

    def pose_numbers(self, quaternion: NDArray[np.float64]) -> NDArray[np.int64]:
        """Index of the stable pose that each part lies in, or NONE, (..., parts), at attitudes (..., parts, 4)."""
        number = np.full(quaternion.shape[:-1], NONE)
        for k, table in enumerate(self.poses):
            members = self.kind_of == k
            number[..., members] = table.number(quaternion[..., members, :])
        return number

    def pose_names(self, quaternion: NDArray[np.float64]) -> list[str | None]:
        """Name of the stable pose that each part lies in, or None, at attitudes (parts, 4)."""
        numbers = zip(self.pose_numbers(quaternion), self.kind_of, strict=True)
        return [None if n == NONE else self.poses[kind].names[n] for n, kind in numbers]

    def principal_attitudes(self, quaternion: NDArray[np.float64]) -> NDArray[np.float64]:
        """Attitudes (..., parts, 4) of the parts' principal axes, from those of the parts; w first."""
        return self._by_kind(quaternion, RigidPart.principal_attitude)

    def principal_attitudes_of(
        self, parts: NDArray[np.int64], quaternion: Sequence[NDArray[np.float64]]
    ) -> NDArray[np.float64]:
        """As `principal_attitudes`, (n, 4), of some parts (n,)."""
        all_attitudes = np.tile([1.0, 0.0, 0.0, 0.0], (len(self.parts), 1))
        all_attitudes[parts] = quaternion
        return self.principal_attitudes(all_attitudes)[parts]

    def attitudes(self, principal: NDArray[np.float64]) -> NDArray[np.float64]:
        """Attitudes (..., parts, 4) of the parts, from those of their principal axes; w first."""
        return self._by_kind(principal, RigidPart.attitude)

    def _by_kind(
        self,
        quaternion: NDArray[np.float64],
        rotate: Callable[[RigidPart, NDArray[np.float64]], NDArray[np.float64]],
    ) -> NDArray[np.float64]:
        if not any(kind.is_turned for kind in self.kinds):
            return quaternion
        result = np.array(quaternion, float)
        for k, kind in enumerate(self.kinds):
            members = self.kind_of == k
            result[..., members, :] = rotate(kind, result[..., members, :])
        return result

    @property
    def n_steps(self) -> int:
        """Solver steps of a full-length run."""
        return (self.n_frames - 1) * self.steps_per_frame


def build_scene(scenario: Scenario) -> Scene:
    """Build the scene of a scenario.

    Raises:
        InputError: a mode file or mesh cannot be used, the plate has no mode for a drive, or a start, a goal or a pick
            does not fit the plate, the guide or the duration.
    """
    check_scenario(scenario)
    times = timetable(scenario)
    plate = assemble_plate(scenario, times)
    if scenario.run.reaction:
        free_modes(plate.driven)  # refuses modes that cannot react
    kinds = tuple(build_part(spec, name=f"part_{i}") for i, spec in enumerate(scenario.part))
    if scenario.run.planar and isinstance(scenario.part[0].start, Start):
        kinds = (outline(kinds[0], math.radians(scenario.part[0].start.yaw_deg[0])),)
    for i, (spec, kind) in enumerate(zip(scenario.part, kinds, strict=True)):
        check_on_plate(spec.start, plate.surface, f"part[{i}].start")
        check_in_tube(spec, kind, i)
    check_refill(scenario, plate.surface, kinds)
    check_goal(scenario, plate.surface)
    run = scenario.run
    ringing = [drive.natural_frequency for mode in plate.driven for drive in mode.drives]
    timestep = 1.0 / (max(scenario.highest_frequency_hz, *ringing, 0.0) * run.steps)
    timestep = min(timestep, _longest_step(scenario, plate, each_once(scenario, times), kinds))
    kind_of = np.repeat(np.arange(len(kinds)), [spec.count for spec in scenario.part])
    digits = len(str(len(kind_of) - 1))
    guides = [
        build_guide(spec.guide, spec.start.position_mm) if spec.guide and spec.start.kind == "point" else None
        for spec in scenario.part
    ]
    scene = Scene(
        scenario=scenario,
        surface=plate.surface,
        driven=plate.driven,
        times=times,
        kinds=kinds,
        kind_of=kind_of,
        parts=tuple(replace(kinds[kind], name=f"part_{i:0{digits}d}") for i, kind in enumerate(kind_of)),
        guides=tuple(guides[kind] for kind in kind_of),
        fixtures=build_fixtures(scenario, plate.surface),
        outlets=build_outlets(scenario),
        timestep=timestep,
        steps_per_frame=max(1, round(1.0 / (run.frames_per_second * timestep))),
    )
    if scene.stage_by_stage:
        scene = scene.stopped(())  # now that it is known when frames are
    check_picks(scene)
    if scenario.contact.restitution == "zener":
        zener_inelasticities(scene)  # refuses what has no modulus
    if scene.n_frames < 2:
        raise InputError(
            f"is {times.duration:g}, must be at least one frame, {scene.frame_interval:g} s", key="run.duration_s"
        )
    return scene


def _longest_step(scenario: Scenario, plate: DrivenPlate, times: Timetable, kinds: Sequence[RigidPart]) -> float:
    """Longest step [s] at any frequency: one at rest falls by a micrometre, a fast one enters by a share of itself."""
    shortest = LONGEST_TRAY_STEP if scenario.plate.kind == "tray" else LONGEST_STEP
    plate_speed = largest_together(times, [mode.drives for mode in plate.driven], speeds=True)
    falls = [(spec.start, kind) for spec, kind in zip(scenario.part, kinds, strict=True)]
    falls += [(scenario.refill_start, kind) for kind in kinds] if scenario.refill_start else []
    for start, kind in falls:
        thrown = 1e-3 * math.hypot(*start.velocity_mm_s) if isinstance(start, Start | GivenState) else 0.0
        if isinstance(start, GivenState):
            thrown += kind.size * math.hypot(*start.angular_velocity_rad_s)
        fall = math.sqrt(2.0 * GRAVITY * 1e-3 * start.drop_height_mm[1])
        shortest = min(shortest, ENTERED * kind.thinnest / (plate_speed + thrown + fall + 1e-9))
    return shortest
