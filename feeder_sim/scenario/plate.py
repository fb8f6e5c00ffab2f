"""Tables of a scenario and of a plate file that describe plates: shape, excitation, measured resonances."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from feeder_sim.scenario.attachments import MOST_ACTUATORS, Actuator, Bar, Mass, Name, check_names
from feeder_sim.scenario.material import MaterialChoice
from feeder_sim.scenario.tables import AngleDeg, Flag, FrequencyHz, LengthMm, NonNegative, PointMm, Positive, Table

MOST_DRIVES = 100  # at once; a plate has about so many modes below 20 kHz


class Strip(Table):
    """One-dimensional standing wave along x with the bending wavelength of the drive; antinode at x = 0."""

    kind: Literal["strip"] = "strip"
    thickness_mm: LengthMm
    length_mm: LengthMm | None = None
    width_mm: LengthMm = 60.0
    material: MaterialChoice = "aluminium"


class Rectangle(Table):
    """A free rectangular plate: from a mode file, or computed from its dimensions.

    A `rim` is a wall around it that no part gets over and that stands still.
    """

    kind: Literal["rectangle"]
    mode_file: Path | None = None
    length_mm: LengthMm | None = None
    width_mm: LengthMm | None = None
    thickness_mm: LengthMm | None = None
    material: MaterialChoice | None = None
    rim: Flag = False

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
    """A plate that moves up and down as one rigid body; `rim` as for `Rectangle`."""

    kind: Literal["piston"]
    thickness_mm: LengthMm = 3.0
    length_mm: LengthMm = 180.0
    width_mm: LengthMm = 180.0
    rim: Flag = False


class ModePlate(Table):
    """A plate of any outline, with holes, all of it from a mode file; parts fall off its edge and through its holes.

    A `rim` is only for a plate that is a whole rectangle; see `Rectangle`.
    """

    kind: Literal["modes"]
    mode_file: Path
    rim: Flag = False


class StillPlate(Table):
    """A plate that nothing moves: no drive and no schedule; `rim` as for `Rectangle`."""

    kind: Literal["still"]
    thickness_mm: LengthMm = 3.0
    length_mm: LengthMm = 180.0
    width_mm: LengthMm = 180.0
    rim: Flag = False


Plate = Annotated[Strip | Rectangle | ModePlate | PistonPlate | StillPlate, Field(discriminator="kind")]


class Excitation(Table):
    """One mode driven at one frequency; see feeder_sim.plate.drive for the response in time.

    The amplitude is the one reached at resonance, at `at_mm` or else at the highest antinode of the mode (of a free
    rectangular plate usually a corner). A drive is at resonance unless `natural_frequency_hz` differs from
    `frequency_hz`. `voltage_vpp` uses the gain measured on the plate, or the actuators in its mode file. `modes` are
    those that move: the driven one, all, or those whose share of the motion is above a number.
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
    actuator: Annotated[tuple[Name, ...], Field(min_length=1, max_length=MOST_DRIVES)] | None = None
    actuator_phase_deg: Annotated[tuple[AngleDeg, ...], Field(max_length=MOST_DRIVES)] | None = None
    modes: Literal["driven", "all"] | Annotated[float, Field(gt=0, lt=1, strict=True)] = "driven"

    @model_validator(mode="after")
    def _actuators_take_a_voltage(self) -> Self:
        if self.actuator is not None and self.voltage_vpp is None:
            raise ValueError("actuator belongs to voltage_vpp, which is missing")
        if self.actuator_phase_deg is not None and len(self.actuator_phase_deg) != len(self.actuator or ()):
            raise ValueError(
                f"actuator_phase_deg has {len(self.actuator_phase_deg)} numbers, allowed are as many as actuators, "
                f"{len(self.actuator or ())}"
            )
        if self.modes != "driven" and self.voltage_vpp is None:
            raise ValueError(f"modes is {self.modes!r}, allowed is 'driven' without voltage_vpp")
        if self.modes != "driven" and not self.ring_up:
            raise ValueError(f"modes is {self.modes!r}, allowed is 'driven' with ring_up = false")
        return self

    @model_validator(mode="after")
    def _one_level(self) -> Self:
        if (self.amplitude_um is None) == (self.voltage_vpp is None):
            raise ValueError("exactly one of amplitude_um and voltage_vpp is needed")
        if self.voltage_vpp is not None and self.at_mm is not None:
            raise ValueError("at_mm belongs to amplitude_um; a voltage acts at the measured driven point")
        return self


class Drive(Excitation):
    """An excitation that starts at a given time and lasts for a given time, or to the end of the run."""

    start_s: NonNegative = 0.0
    duration_s: Positive | None = None


class PlateBody(Table):
    """Dimensions and material of a rectangular plate, and up to which frequency its modes are computed.

    With `uniform_width` only modes that do not vary across the width are computed: the bending of a strip.
    """

    length_mm: LengthMm
    width_mm: LengthMm
    thickness_mm: LengthMm
    material: MaterialChoice = "aluminium"
    highest_frequency_hz: FrequencyHz
    uniform_width: Flag = False


class MeasuredResonance(Table):
    """A resonance measured on the plate; the amplitude is that at `driven_point_mm`, per volt peak to peak."""

    frequency_hz: FrequencyHz
    damping_ratio: Annotated[float, Field(ge=1e-6, lt=1, strict=True)] | None = None
    amplitude_um_per_vpp: Positive | None = None
    driven_point_mm: PointMm = (0.0, 0.0)
    actuator: Annotated[tuple[Name, ...], Field(max_length=MOST_DRIVES)] = ()
    mode: Annotated[int, Field(ge=1, strict=True)] | None = None


class PlateFile(Table):
    """A plate as `feeder-sim modes` reads it."""

    plate: PlateBody
    actuator: Annotated[tuple[Actuator, ...], Field(max_length=MOST_ACTUATORS)] = ()
    bar: Annotated[tuple[Bar, ...], Field(max_length=MOST_ACTUATORS)] = ()
    mass: Annotated[tuple[Mass, ...], Field(max_length=MOST_ACTUATORS)] = ()
    resonance: tuple[MeasuredResonance, ...] = ()

    @model_validator(mode="after")
    def _names(self) -> Self:
        check_names(self.actuator)
        names = [actuator.name for actuator in self.actuator]
        for i, resonance in enumerate(self.resonance):
            for name in resonance.actuator:
                if name not in names:
                    known = ", ".join(names) or "none"
                    raise ValueError(f"resonance[{i}].actuator is {name!r}, allowed are the actuators: {known}")
        if self.plate.uniform_width and (self.actuator or self.bar or self.mass):
            raise ValueError("plate.uniform_width is true, allowed is false with actuators, bars and masses")
        return self
