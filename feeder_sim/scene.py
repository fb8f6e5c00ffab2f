"""Scenario -> scene: the moving surface, the parts, where they start, and the time step; in SI units."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError
from feeder_sim.guide import Guide, build_guide
from feeder_sim.parts import RigidPart, build_part
from feeder_sim.plate.assembly import DrivenMode, assemble_plate
from feeder_sim.plate.surface import Surface
from feeder_sim.scenario import PartSpec, Scenario, Start, Tube

GRAVITY = 9.81  # [m/s^2]
ROUND_OFF = 1e-9
FREE_TILT, UPRIGHT = (0.0, 3.0), (0.0, 0.0)  # [deg] at the start, where the scenario does not say


@dataclass(frozen=True)
class Scene:
    """Everything an engine needs, in SI units; the top of the resting plate is z = 0.

    Attributes:
        scenario: what it was made from.
        surface: the moving surface.
        driven: the driven modes, one per drive.
        parts: the rigid parts.
        guides: the guide of each part, None for a free one.
        timestep: [s].
        steps_per_frame: solver steps between two recorded frames.
    """

    scenario: Scenario
    surface: Surface
    driven: tuple[DrivenMode, ...]
    parts: tuple[RigidPart, ...]
    guides: tuple[Guide | None, ...]
    timestep: float
    steps_per_frame: int

    @property
    def frame_interval(self) -> float:
        """Time between recorded frames [s]."""
        return self.timestep * self.steps_per_frame

    @property
    def n_frames(self) -> int:
        """Recorded frames of a full-length run, the first at t = 0."""
        return 1 + math.floor(self.scenario.run.duration_s / self.frame_interval + 1e-9)

    @property
    def n_steps(self) -> int:
        """Solver steps of a full-length run."""
        return (self.n_frames - 1) * self.steps_per_frame


@dataclass(frozen=True)
class Pose:
    """Where a part starts, at rest.

    Attributes:
        position: of the centre of mass, shape (3,) [m].
        quaternion: shape (4,), w first.
    """

    position: NDArray[np.float64]
    quaternion: NDArray[np.float64]


def build_scene(scenario: Scenario) -> Scene:
    """Resolve a scenario.

    Raises:
        InputError: the plate, a drive, a part or a start cannot be had.
    """
    plate = assemble_plate(scenario)
    parts = tuple(build_part(spec, name=f"part_{i}") for i, spec in enumerate(scenario.part))
    for i, spec in enumerate(scenario.part):
        _check_on_plate(spec.start, plate.surface, f"part[{i}].start.position_mm")
    run = scenario.run
    timestep = 1.0 / (scenario.highest_frequency_hz * run.steps_per_period)
    steps_per_frame = max(1, round(1.0 / (run.frames_per_second * timestep)))
    for i, (spec, part) in enumerate(zip(scenario.part, parts, strict=True)):
        _check_in_tube(spec, part, i)
    guides = tuple(build_guide(spec.guide, spec.start.position_mm) if spec.guide else None for spec in scenario.part)
    scene = Scene(scenario, plate.surface, plate.driven, parts, guides, timestep, steps_per_frame)
    if scene.n_frames < 2:
        raise InputError(
            f"is {run.duration_s:g}, allowed is at least one frame, {scene.frame_interval:g} s", key="run.duration_s"
        )
    return scene


def _check_on_plate(start: Start, surface: Surface, key: str) -> None:
    x, y = start.position_mm
    half = (0.5e3 * surface.length, 0.5e3 * surface.width)
    if abs(x) > half[0] or abs(y) > half[1]:
        raise InputError(f"is [{x:g}, {y:g}], allowed is +-{half[0]:.1f}, +-{half[1]:.1f} (on the plate)", key=key)


def _check_in_tube(spec: PartSpec, part: RigidPart, i: int) -> None:
    """Refuse a part that starts in the wall of its tube, or would if it were tilted another way."""
    if not isinstance(spec.guide, Tube):
        return
    tilt = math.radians(max(abs(angle) for angle in spec.start.tilt_deg or UPRIGHT))
    reach = np.hypot(*part.corners[:, :2].T) * math.cos(tilt) + np.abs(part.corners[:, 2]) * math.sin(tilt)
    needed = 2e3 * float(reach.max() + part.corner_radius)
    if needed > spec.guide.inner_diameter_mm * (1.0 + ROUND_OFF):
        raise InputError(
            f"is {spec.guide.inner_diameter_mm:g}, allowed is at least {needed:.4g}, which the part takes at its start",
            key=f"part[{i}].guide.inner_diameter_mm",
        )


def start_poses(scene: Scene, rng: np.random.Generator) -> list[Pose]:
    """Draw the start of every part: tilt about a random horizontal axis after a yaw, lowest point at drop height.

    A part in a guide starts on the guide's axis, turned with it.
    """
    from scipy.spatial.transform import Rotation

    poses = []
    for spec, part, guide in zip(scene.scenario.part, scene.parts, scene.guides, strict=True):
        start = spec.start
        yaw = np.radians(rng.uniform(*start.yaw_deg))
        tilt = np.radians(rng.uniform(*(start.tilt_deg or (UPRIGHT if guide else FREE_TILT))))
        direction = rng.uniform(0.0, 2.0 * np.pi)
        drop = 1e-3 * rng.uniform(*start.drop_height_mm)
        lean = tilt * np.array([np.cos(direction), np.sin(direction), 0.0])
        turned = Rotation.from_rotvec(lean) * Rotation.from_rotvec([0.0, 0.0, yaw])
        if guide:
            turned = Rotation.from_rotvec([0.0, guide.tilt, 0.0]) * turned
        quaternion = np.asarray(turned.as_quat(scalar_first=True))
        height = drop - part.lowest(quaternion)
        position = np.array([*(1e-3 * c for c in start.position_mm), height])
        if guide:
            position[:2] += guide.axis[:2] / guide.axis[2] * height
        poses.append(Pose(position, quaternion))
    return poses
