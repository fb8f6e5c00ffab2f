"""Scenario files: TOML -> frozen, validated values. Keys carry their units; nothing here computes anything.

A scenario is a plate, the drives that excite it or a schedule of them, the parts, their contact and how to run:

    Scenario(plate=Strip(thickness_mm=3), drive=[Drive(frequency_hz=4750, amplitude_um=1)], part=[HexNut(size="M2.5")],
             run=Run(duration_s=1))
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from feeder_sim.part_tables import (
    MAX_PARTS,
    Ball,
    Cylinder,
    Heap,
    HexNut,
    MeshPart,
    PartSpec,
    Scattered,
    Slide,
    Start,
    Tube,
)
from feeder_sim.plate_tables import (
    CustomMaterial,
    Drive,
    Excitation,
    MeasuredResonance,
    PistonPlate,
    Plate,
    PlateBody,
    PlateFile,
    Rectangle,
    Strip,
    resolve_material,
)
from feeder_sim.run_tables import Contact, MujocoSettings, Run
from feeder_sim.tables import LengthMm, NonNegative, Positive, Table, parse, read_text, validated

__all__ = [
    "Ball",
    "Contact",
    "CustomMaterial",
    "Cylinder",
    "Drive",
    "Excitation",
    "Goal",
    "Heap",
    "HexNut",
    "MeasuredResonance",
    "MeshPart",
    "MujocoSettings",
    "PartSpec",
    "Pick",
    "PistonPlate",
    "PlateBody",
    "PlateFile",
    "Rectangle",
    "Run",
    "Scattered",
    "Scenario",
    "Schedule",
    "Settled",
    "Slide",
    "Stage",
    "Start",
    "Strip",
    "Tube",
    "load_plate_file",
    "load_scenario",
    "parse_scenario",
    "resolve_material",
    "with_run",
]

# Fewer are biased, and with a weak surface unstable (benchmarks/stability.py).
MIN_STEPS_PER_PERIOD = 20
# A compliant contact (solref = "T zeta") shorter than this many steps is unstable.
MIN_STEPS_PER_TIME_CONSTANT = 5.0


class Pick(Table):
    """Take every part out whose centre is farther than the clearance from the centres of all others (in plan view)."""

    clearance_mm: LengthMm


class Settled(Table):
    """All parts have been this near to a nodal line of every mode of the stage for so long without a break."""

    within_mm: LengthMm = 1.0
    for_s: Positive = 0.5


class Stage(Table):
    """Drive these modes together for a while; then a pause with the drives off, then perhaps a pick.

    With `until` the drives stop as soon as the parts have settled; `duration_s` is then the longest they act. What the
    plate still does when a drive stops is its own ring-down, and goes on into the stages after it.
    """

    name: str = ""
    drive: tuple[Excitation, ...] = ()
    duration_s: Positive
    until: Settled | None = None
    pause_s: NonNegative = 0.0
    pick: Pick | None = None

    @model_validator(mode="after")
    def _settles_over_a_drive(self) -> Self:
        if self.until is not None and not self.drive:
            raise ValueError("until belongs to a stage with a drive, whose nodal lines the parts settle on")
        return self


class Schedule(Table):
    """Stages to prepare the parts once, and a cycle of stages that is repeated."""

    cycles: Annotated[int, Field(ge=1, le=10_000, strict=True)] = 1
    prepare: tuple[Stage, ...] = ()
    stage: Annotated[tuple[Stage, ...], Field(min_length=1)]


class Goal(Table):
    """Where a schedule is to carry the parts: to the line x = `x_mm`, or to a point of it."""

    x_mm: Annotated[float, Field(allow_inf_nan=False, strict=True)]
    y_mm: Annotated[float, Field(allow_inf_nan=False, strict=True)] | None = None
    within_mm: LengthMm = 2.0


class Scenario(Table):
    """One experiment on one plate."""

    title: str = ""
    plate: Plate
    drive: tuple[Drive, ...] = ()
    schedule: Schedule | None = None
    part: Annotated[tuple[PartSpec, ...], Field(min_length=1, max_length=100)]
    contact: Contact = Contact()
    mujoco: MujocoSettings = MujocoSettings()
    goal: Goal | None = None
    run: Run

    @property
    def n_parts(self) -> int:
        """Parts in the scene."""
        return sum(part.count for part in self.part)

    @property
    def guide(self) -> Slide | Tube | None:
        """The guide of the one part of a guided scene."""
        return self.part[0].guide

    @property
    def excitations(self) -> tuple[tuple[str, Excitation], ...]:
        """Every excitation once, with its key in the file: the drives, or those of the schedule's stages."""
        if self.schedule is None:
            return tuple((f"drive[{i}]", drive) for i, drive in enumerate(self.drive))
        return tuple(
            (f"schedule.{group}[{i}].drive[{j}]", drive)
            for group in ("prepare", "stage")
            for i, stage in enumerate(getattr(self.schedule, group))
            for j, drive in enumerate(stage.drive)
        )

    @property
    def highest_frequency_hz(self) -> float:
        """The fastest motion of the plate: forced at the drive frequency, ringing at the natural one."""
        return max(max(d.frequency_hz, d.natural_frequency_hz or 0.0) for _, d in self.excitations)

    @property
    def known_failures(self) -> tuple[str, ...]:
        """Settings that do not simulate what was asked for: key, value, what is allowed and why, one line each."""
        run, contact, mujoco = self.run, self.contact, self.mujoco
        found = []
        if run.steps_per_period < MIN_STEPS_PER_PERIOD:
            found.append(
                f"run.steps_per_period is {run.steps_per_period}, allowed is at least {MIN_STEPS_PER_PERIOD}: the "
                "plate would move by a third of its amplitude within a step, and speeds come out wrong"
            )
        if contact.time_constant_us is not None:
            shortest = 1e6 / self.highest_frequency_hz
            if contact.time_constant_us < MIN_STEPS_PER_TIME_CONSTANT * shortest / run.steps_per_period:
                needed = int(-(-MIN_STEPS_PER_TIME_CONSTANT * shortest // contact.time_constant_us))
                found.append(
                    f"run.steps_per_period is {run.steps_per_period}, allowed is at least {needed} for "
                    f"contact.time_constant_us = {contact.time_constant_us:g}: a shorter contact throws parts"
                )
        elif mujoco.integrator == "discrete":
            found.append(
                'mujoco.integrator is "discrete", allowed is "euler" or "implicitfast" with contact.model = '
                '"restitution": it takes the rebound out'
            )
        if mujoco.plate == "mocap":
            found.append('mujoco.plate is "mocap", allowed is "patch": a mocap body has no velocity in contact')
        return tuple(found)

    @model_validator(mode="after")
    def _drives_or_schedule(self) -> Self:
        if (len(self.drive) == 0) == (self.schedule is None):
            raise ValueError("exactly one of [[drive]] and [schedule] is needed")
        if self.schedule is not None and not self.excitations:
            raise ValueError("schedule.stage has no drive, allowed is at least one in all stages together")
        if (self.run.duration_s is None) == (self.schedule is None):
            said = "is missing, allowed is a number above 0" if self.schedule is None else "is that of the schedule"
            raise ValueError(f"run.duration_s {said}")
        stages = (*self.schedule.prepare, *self.schedule.stage) if self.schedule else ()
        if self.plate.kind == "piston" and any(stage.until for stage in stages):
            raise ValueError('plate.kind is "piston", which has no nodal lines that parts could settle on')
        if self.goal is not None and self.schedule is None:
            raise ValueError("goal belongs to a [schedule]")
        if self.schedule is not None and self.run.stop != "time":
            raise ValueError(f'run.stop is "{self.run.stop}", allowed is "time" with a schedule')
        if self.n_parts > MAX_PARTS:
            raise ValueError(f"part.count adds up to {self.n_parts}, allowed is up to {MAX_PARTS}")
        if self.n_parts > 1 and self.run.stop != "time":
            raise ValueError(f'run.stop is "{self.run.stop}", allowed is "time" with more than one part')
        return self

    @model_validator(mode="after")
    def _guide_stands_on_a_piston(self) -> Self:
        for i, part in enumerate(self.part):
            if part.guide is None:
                continue
            if self.n_parts > 1:
                raise ValueError(f"part[{i}].guide needs to be the only part, there are {self.n_parts}")
            if self.plate.kind != "piston":
                raise ValueError(f'plate.kind is "{self.plate.kind}", allowed is "piston" with part[{i}].guide')
            tilt = math.radians(part.guide.tilt_deg)
            if math.cos(tilt) <= part.guide.friction * math.sin(tilt):
                most = 1.0 / math.tan(tilt)
                raise ValueError(
                    f"part[{i}].guide.friction is {part.guide.friction:g}, allowed is below {most:.3g} at tilt_deg = "
                    f"{part.guide.tilt_deg:g}: the part would never come down"
                )
        return self

    @model_validator(mode="after")
    def _stays_in_a_plane(self) -> Self:
        if not self.run.planar:
            return self
        part = self.part[0]
        if self.run.engine == "mujoco" or self.contact.model == "compliant":
            raise ValueError("run.planar is true, allowed is false in MuJoCo")
        if self.plate.kind == "rectangle":
            raise ValueError('plate.kind is "rectangle", allowed is "strip" or "piston" with run.planar = true')
        if self.n_parts > 1 or part.guide is not None or not isinstance(part.start, Start):
            raise ValueError("run.planar is true, allowed is false for many parts and for a part in a guide")
        if part.start.yaw_deg[0] != part.start.yaw_deg[1]:
            low, high = part.start.yaw_deg
            raise ValueError(
                f"part[0].start.yaw_deg is [{low:g}, {high:g}], allowed is one angle with run.planar = true"
            )
        if part.start.position_mm[1] or part.start.velocity_mm_s[1]:
            raise ValueError("part[0].start has a position or velocity along y, allowed is 0 with run.planar = true")
        return self

    @model_validator(mode="after")
    def _settings_belong_to_mujoco(self) -> Self:
        changed = [name for name, value in self.mujoco if value != getattr(MujocoSettings(), name)]
        if changed and self.guide is not None:
            raise ValueError(f"mujoco.{changed[0]} belongs to parts without a guide")
        if changed and self.run.engine != "mujoco" and self.contact.model != "compliant":
            raise ValueError(f'run.engine is "{self.run.engine}", allowed is "mujoco" with mujoco.{changed[0]}')
        return self

    @model_validator(mode="after")
    def _no_known_failure(self) -> Self:
        if not self.run.allow_unstable:
            for found in self.known_failures:
                raise ValueError(f"{found}; run.allow_unstable = true runs it all the same")
        return self


def load_scenario(path: str | Path) -> Scenario:
    """Read and check a scenario file; paths in it are relative to the file.

    Raises:
        InputError: unreadable file, TOML syntax, or any key or value that is not allowed.
    """
    path = Path(path)
    return parse_scenario(read_text(path), file=path)


def parse_scenario(text: str, *, file: Path) -> Scenario:
    """Check the text of a scenario; `file` names it in messages and anchors relative paths."""
    return _anchor_paths(parse(text, Scenario, file), file.resolve().parent)


def with_run(scenario: Scenario, *, file: Path = Path("scenario"), **changes: Any) -> Scenario:
    """The scenario with some values of its [run] table replaced, checked like the rest; `file` names it in messages.

    Raises:
        InputError: a value that is not allowed.
    """
    return validated(scenario.model_dump() | {"run": scenario.run.model_dump() | changes}, Scenario, file)


def load_plate_file(path: Path) -> PlateFile:
    """Read and check a plate file; errors as for `load_scenario`."""
    return parse(read_text(path), PlateFile, path)


def _anchor_paths(scenario: Scenario, folder: Path) -> Scenario:
    """Make the file names in a scenario absolute."""
    plate, parts = scenario.plate, list(scenario.part)
    if isinstance(plate, Rectangle) and plate.mode_file is not None:
        plate = plate.model_copy(update={"mode_file": folder / plate.mode_file})
    for i, part in enumerate(parts):
        if isinstance(part, MeshPart):
            parts[i] = part.model_copy(update={"file": folder / part.file})
    return scenario.model_copy(update={"plate": plate, "part": tuple(parts)})
