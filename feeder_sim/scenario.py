"""Scenario files: TOML -> frozen, validated values. Keys carry their units; nothing here computes anything.

A scenario is a plate, the drives that excite it, the part on it, contact parameters and how to run:

    Scenario(plate=Strip(thickness_mm=3), drive=[Drive(frequency_hz=4750, amplitude_um=1)], part=[HexNut(size="M2.5")])
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, Discriminator, Field, Tag, model_validator

from feeder_sim.materials import MATERIALS, Material
from feeder_sim.tables import (
    AngleDeg,
    AngleRange,
    DropHeightRange,
    Flag,
    FrequencyHz,
    LengthMm,
    NonNegative,
    PointMm,
    Positive,
    Table,
    parse,
    read_text,
    validated,
)

# Below this the plate moves by a large part of its amplitude within one step (README, design notes).
MIN_STEPS_PER_PERIOD = 20
# A compliant contact (solref = "T zeta") shorter than this many steps is unstable.
MIN_STEPS_PER_TIME_CONSTANT = 5.0

# From the vertical; a guide is meant to stand on the plate.
GuideTiltDeg = Annotated[float, Field(ge=0, le=60, strict=True)]


class CustomMaterial(Table):
    """A material that is not in the list."""

    density_kg_m3: Annotated[float, Field(ge=1, le=1e5, strict=True)]
    youngs_modulus_gpa: Annotated[float, Field(ge=1e-4, le=1e4, strict=True)]
    poisson_ratio: Annotated[float, Field(ge=0, lt=0.5, strict=True)]


def _known_material(value: str) -> str:
    if value not in MATERIALS:
        names = ", ".join(sorted(MATERIALS))
        raise ValueError(f"allowed is one of {names}, or a table of density_kg_m3, youngs_modulus_gpa, poisson_ratio")
    return value


MaterialChoice = Annotated[
    Annotated[str, AfterValidator(_known_material), Tag("name")] | Annotated[CustomMaterial, Tag("table")],
    Discriminator(lambda value: "name" if isinstance(value, str) else "table"),
]


def resolve_material(choice: MaterialChoice) -> Material:
    """Look a material up by name, or convert a custom one to SI."""
    if isinstance(choice, str):
        return MATERIALS[choice]
    return Material(choice.density_kg_m3, choice.youngs_modulus_gpa * 1e9, choice.poisson_ratio)


class Strip(Table):
    """One-dimensional standing wave along x with the bending wavelength of the drive; antinode at x = 0."""

    kind: Literal["strip"] = "strip"
    thickness_mm: LengthMm
    length_mm: LengthMm | None = None
    width_mm: LengthMm = 60.0
    material: MaterialChoice = "aluminium"


class Rectangle(Table):
    """A free rectangular plate: from a mode file, or computed from its dimensions."""

    kind: Literal["rectangle"]
    mode_file: Path | None = None
    length_mm: LengthMm | None = None
    width_mm: LengthMm | None = None
    thickness_mm: LengthMm | None = None
    material: MaterialChoice | None = None

    @model_validator(mode="after")
    def _file_or_dimensions(self) -> Self:
        dimensions = {"length_mm": self.length_mm, "width_mm": self.width_mm, "thickness_mm": self.thickness_mm}
        if self.mode_file is None:
            missing = [name for name, value in dimensions.items() if value is None]
            if missing:
                raise ValueError(f"{missing[0]} is missing, allowed is a number above 0 (or give mode_file)")
        elif any(value is not None for value in (*dimensions.values(), self.material)):
            raise ValueError("mode_file already holds dimensions and material, give one or the other")
        return self


class PistonPlate(Table):
    """A plate that moves up and down as one rigid body."""

    kind: Literal["piston"]
    thickness_mm: LengthMm = 3.0
    length_mm: LengthMm = 180.0
    width_mm: LengthMm = 180.0


Plate = Annotated[Strip | Rectangle | PistonPlate, Field(discriminator="kind")]


class Drive(Table):
    """One mode driven at one frequency; see feeder_sim.plate.drive for the response in time.

    The amplitude is the one reached at resonance, at `at_mm` or else at the highest antinode of the mode (of a free
    rectangular plate usually a corner). A drive is at resonance unless
    `natural_frequency_hz` says otherwise. `voltage_vpp` uses the gain measured on the plate (mode file).
    """

    frequency_hz: FrequencyHz
    amplitude_um: NonNegative | None = None
    voltage_vpp: NonNegative | None = None
    at_mm: PointMm | None = None
    mode: Annotated[int, Field(ge=1, strict=True)] | None = None
    natural_frequency_hz: FrequencyHz | None = None
    damping_ratio: Annotated[float, Field(ge=1e-6, lt=1, strict=True)] | None = None
    ring_up: Flag = True
    phase_deg: AngleDeg = 0.0
    start_s: NonNegative = 0.0
    duration_s: Positive | None = None

    @model_validator(mode="after")
    def _one_level(self) -> Self:
        if (self.amplitude_um is None) == (self.voltage_vpp is None):
            raise ValueError("exactly one of amplitude_um and voltage_vpp is needed")
        if self.voltage_vpp is not None and self.at_mm is not None:
            raise ValueError("at_mm belongs to amplitude_um; a voltage acts at the measured driven point")
        return self


class Start(Table):
    """Where a part is released: ranges are drawn per seed; its lowest point is the drop height above the resting plate.

    `position_mm` of a part in a guide is where the guide's axis meets the plate. Without `tilt_deg` a free part starts
    0 to 3 degrees off the vertical, a guided one along the axis of its guide.
    """

    position_mm: PointMm = (0.0, 0.0)
    drop_height_mm: DropHeightRange = (0.2, 0.5)
    yaw_deg: AngleRange = (0.0, 360.0)
    tilt_deg: AngleRange | None = None


class Slide(Table):
    """A guide without play: the part moves along its axis and does not turn; friction is with the part's own weight."""

    kind: Literal["slide"]
    tilt_deg: GuideTiltDeg = 0.0
    friction: NonNegative = 0.0


class Tube(Table):
    """A round guide with play: the part moves freely in it and meets its wall; restitution of steel on acrylic."""

    kind: Literal["tube"]
    inner_diameter_mm: LengthMm
    tilt_deg: GuideTiltDeg = 0.0
    restitution: Annotated[float, Field(ge=0, le=1, strict=True)] = 0.4
    friction: NonNegative = 0.0


Guide = Annotated[Slide | Tube, Field(discriminator="kind")]


class _Part(Table):
    material: MaterialChoice = "steel"
    start: Start = Start()
    guide: Guide | None = None


class HexNut(_Part):
    """Hexagon nut, by metric size (ISO 4032) or by dimensions."""

    shape: Literal["hex_nut"] = "hex_nut"
    size: Literal["M2", "M2.5", "M3", "M4", "M5"] | None = None
    across_flats_mm: LengthMm | None = None
    height_mm: LengthMm | None = None
    bore_mm: Annotated[float, Field(ge=0, le=1e5, strict=True)] | None = None

    @model_validator(mode="after")
    def _size_or_dimensions(self) -> Self:
        given = [d is not None for d in (self.across_flats_mm, self.height_mm, self.bore_mm)]
        if any(given) if self.size is not None else not all(given):
            raise ValueError("give either size or all of across_flats_mm, height_mm, bore_mm")
        if self.bore_mm is not None and self.across_flats_mm is not None and self.bore_mm >= self.across_flats_mm:
            raise ValueError(f"bore_mm is {self.bore_mm}, allowed is less than across_flats_mm")
        return self


class Ball(_Part):
    """Solid sphere."""

    shape: Literal["ball"]
    diameter_mm: LengthMm


class Cylinder(_Part):
    """Solid circular cylinder, axis upright at the start."""

    shape: Literal["cylinder"]
    diameter_mm: LengthMm
    height_mm: LengthMm


class MeshPart(_Part):
    """A closed triangle mesh; contact is with its convex hull, mass and inertia are those of the solid."""

    shape: Literal["mesh"]
    file: Path
    file_unit_mm: Annotated[float, Field(ge=1e-6, le=1e6, strict=True)] = 1.0


PartSpec = Annotated[HexNut | Ball | Cylinder | MeshPart, Field(discriminator="shape")]


class Contact(Table):
    """Contact between part and plate.

    `model = "restitution"` reverses the normal velocity within one step (Newton); "compliant" is MuJoCo's
    spring-damper contact with a time constant, and has no coefficient of restitution.
    """

    model: Literal["restitution", "compliant"] = "restitution"
    restitution: Annotated[float, Field(ge=0, le=1, strict=True)] = 0.2
    friction: NonNegative = 0.3
    time_constant_us: Positive | None = None
    damping_ratio: Positive = 1.0

    @model_validator(mode="after")
    def _time_constant(self) -> Self:
        if (self.model == "compliant") != (self.time_constant_us is not None):
            raise ValueError('time_constant_us belongs to model = "compliant", which needs it')
        return self


class Run(Table):
    """How long, how often, how fine, and with which simplifications.

    `in_plane_velocity = false` holds the horizontal motion of the surface still; `tangent_surface = true` makes the
    impulse engine take the surface under a part for a plane, as the MuJoCo engine always does.
    """

    engine: Literal["auto", "impulse", "mujoco"] = "auto"
    duration_s: Annotated[float, Field(gt=0, le=1e5, strict=True)]
    stop: Literal["time", "passage"] = "time"
    seeds: Annotated[int, Field(ge=1, le=10_000, strict=True)] = 12
    seed: Annotated[int, Field(ge=0, lt=2**63, strict=True)] = 0
    steps_per_period: Annotated[int, Field(ge=MIN_STEPS_PER_PERIOD, le=10_000, strict=True)] = 40
    frames_per_second: Annotated[float, Field(ge=1, le=1e6, strict=True)] = 500.0
    in_plane_velocity: Flag = True
    tangent_surface: Flag = False


class Scenario(Table):
    """One experiment on one plate."""

    title: str = ""
    plate: Plate
    drive: Annotated[tuple[Drive, ...], Field(min_length=1)]
    part: Annotated[tuple[PartSpec, ...], Field(min_length=1, max_length=1)]
    contact: Contact = Contact()
    run: Run

    @property
    def guide(self) -> Slide | Tube | None:
        """The guide of the one part."""
        return self.part[0].guide

    @property
    def highest_frequency_hz(self) -> float:
        """The fastest motion of the plate: forced at the drive frequency, ringing at the natural one."""
        return max(max(d.frequency_hz, d.natural_frequency_hz or 0.0) for d in self.drive)

    @model_validator(mode="after")
    def _guide_stands_on_a_piston(self) -> Self:
        for i, part in enumerate(self.part):
            if part.guide is None:
                continue
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
    def _time_constant_spans_steps(self) -> Self:
        if self.contact.time_constant_us is not None:
            shortest = 1.0 / self.highest_frequency_hz
            step = 1e6 * shortest / self.run.steps_per_period
            least = MIN_STEPS_PER_TIME_CONSTANT * step
            if self.contact.time_constant_us < least:
                needed = int(-(-MIN_STEPS_PER_TIME_CONSTANT * 1e6 * shortest // self.contact.time_constant_us))
                raise ValueError(
                    f"run.steps_per_period is {self.run.steps_per_period}, allowed is at least {needed} for "
                    f"contact.time_constant_us = {self.contact.time_constant_us:g}"
                )
        return self


class PlateBody(Table):
    """Dimensions and material of a rectangular plate, and how far its modes are wanted."""

    length_mm: LengthMm
    width_mm: LengthMm
    thickness_mm: LengthMm
    material: MaterialChoice = "aluminium"
    highest_frequency_hz: FrequencyHz


class MeasuredResonance(Table):
    """A resonance measured on the plate; the amplitude is that at `driven_point_mm`, per volt peak to peak."""

    frequency_hz: FrequencyHz
    damping_ratio: Annotated[float, Field(ge=1e-6, lt=1, strict=True)] | None = None
    amplitude_um_per_vpp: Positive | None = None
    driven_point_mm: PointMm = (0.0, 0.0)


class PlateFile(Table):
    """A plate as `feeder-sim modes` reads it."""

    plate: PlateBody
    resonance: tuple[MeasuredResonance, ...] = ()


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
