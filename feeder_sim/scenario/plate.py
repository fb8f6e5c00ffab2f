"""Tables of a scenario and of a plate file that describe plates: shape, excitation, measured resonances."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Discriminator, Field, Tag, ValidationError, ValidationInfo, model_validator

from feeder_sim.plate.materials import CERAMICS, Ceramic, Material
from feeder_sim.scenario.drawing import with_drawing
from feeder_sim.scenario.material import CeramicName, MaterialChoice
from feeder_sim.scenario.tables import (
    AngleDeg,
    CoordinateMm,
    DrawingUnit,
    Flag,
    FrequencyHz,
    LengthMm,
    NonNegative,
    PointMm,
    Positive,
    Table,
    folder_of,
    parse,
    read_text,
)

# Tables of a plate file for what is fixed to the plate: piezo actuators, bars, masses.

MOST_LAYERS = 10_000  # of ceramic in one patch
MOST_ACTUATORS = 100
Side = Literal["below", "above"]
SizeMm = tuple[LengthMm, LengthMm]
DampingRatio = Annotated[float, Field(ge=1e-6, lt=1, strict=True)]
Name = Annotated[str, Field(min_length=1, max_length=60, pattern=r"^[^\x00-\x1f]+$")]


class BondedLayer(Table):
    """A rectangle bonded to the plate; `size_mm` is along its own axes, the first of them turned by `angle_deg`."""

    at_mm: PointMm
    size_mm: SizeMm
    angle_deg: AngleDeg = 0.0
    thickness_mm: LengthMm
    side: Side = "below"


class Actuator(BondedLayer):
    """A piezo patch. Its bending moment is the calibrated one, or else that of its ceramic and its glue.

    Constants that are given replace those of the ceramic.
    """

    name: Name
    ceramic: CeramicName = "NCE46"
    density_kg_m3: Annotated[float, Field(ge=1, le=1e5, strict=True)] | None = None
    s11_um2_per_n: Annotated[float, Field(ge=1e-3, le=1e6, strict=True)] | None = None
    poisson_ratio: Annotated[float, Field(ge=0, lt=0.5, strict=True)] | None = None
    d31_pm_per_v: Annotated[float, Field(gt=0, le=1e5, strict=True)] | None = None
    layers: Annotated[int, Field(ge=1, le=MOST_LAYERS, strict=True)] = 1
    relative_permittivity: Annotated[float, Field(ge=1, le=1e6, strict=True)] | None = None
    loss_tangent: Annotated[float, Field(ge=0, le=1, strict=True)] | None = None
    glue_thickness_um: Annotated[float, Field(ge=0, le=1e4, strict=True)] | None = None
    glue_shear_modulus_gpa: Annotated[float, Field(ge=1e-4, le=1e3, strict=True)] = 1.0
    moment_per_volt_n: Positive | None = None
    loads: Flag = True

    @property
    def properties(self) -> Ceramic:
        """Constants of the ceramic in SI units, with those that are given in place of those of its name."""
        ceramic = CERAMICS[self.ceramic]

        def si_value(value: float | None, default: float, unit: float = 1.0) -> float:
            return default if value is None else unit * value

        modulus = ceramic.solid.youngs_modulus if self.s11_um2_per_n is None else 1e12 / self.s11_um2_per_n
        density, poisson = (
            si_value(self.density_kg_m3, ceramic.solid.density),
            si_value(self.poisson_ratio, ceramic.solid.poisson_ratio),
        )
        return Ceramic(
            Material(density, modulus, poisson),
            si_value(self.d31_pm_per_v, ceramic.d31, 1e-12),
            si_value(self.relative_permittivity, ceramic.relative_permittivity),
            si_value(self.loss_tangent, ceramic.loss_tangent),
        )

    @model_validator(mode="after")
    def _acts(self) -> Self:
        if self.moment_per_volt_n is not None and self.glue_thickness_um is not None:
            raise ValueError("moment_per_volt_n is calibrated, must be that or glue_thickness_um, which it contains")
        return self


class ActuatorFile(Table):
    """Actuators of a plate whose modes are imported, in the coordinates of its modes."""

    actuator: Annotated[tuple[Actuator, ...], Field(min_length=1, max_length=MOST_ACTUATORS)]

    @model_validator(mode="after")
    def _names_are_unique(self) -> Self:
        check_names(self.actuator)
        return self


def check_names(actuators: Sequence[Actuator]) -> None:
    """Refuse two actuators of one name.

    Raises:
        ValueError: there are.
    """
    names = [actuator.name for actuator in actuators]
    for i, name in enumerate(names):
        if name in names[:i]:
            raise ValueError(f"actuator[{i}].name is {name!r}, must be a name of its own")


class Bar(BondedLayer):
    """A bar bonded to the plate."""

    material: MaterialChoice = "aluminium"


class Mass(Table):
    """A mass fixed to the plate at a point, such as a bolt or a magnet."""

    at_mm: PointMm
    mass_g: Positive
    offset_mm: CoordinateMm = 0.0


# Tables of an outline file: the outer edge of a plate and its holes.

MOST_CORNERS, MOST_HOLES = 20_000, 1000


class Ring(Table):
    """A closed line: a polygon by its corners, a circle or an upright rectangle around a centre."""

    points_mm: Annotated[tuple[PointMm, ...], Field(min_length=3, max_length=MOST_CORNERS)] | None = None
    centre_mm: PointMm = (0.0, 0.0)
    diameter_mm: LengthMm | None = None
    size_mm: tuple[LengthMm, LengthMm] | None = None

    @model_validator(mode="after")
    def _one_shape(self) -> Self:
        keys = [name for name in ("points_mm", "diameter_mm", "size_mm") if getattr(self, name) is not None]
        if len(keys) != 1:
            raise ValueError(f"gives {' and '.join(keys) or 'no shape'}, must be points_mm, diameter_mm or size_mm")
        if self.points_mm is not None and self.centre_mm != (0.0, 0.0):
            raise ValueError("centre_mm belongs to diameter_mm or size_mm, points_mm says where it is by itself")
        return self


class OutlineFile(Table):
    """The outline of a plate, in the coordinates of the file whose modes are imported with it."""

    exterior: Ring
    hole: Annotated[tuple[Ring, ...], Field(max_length=MOST_HOLES)] = ()


BEYOND_MEASURED = 1.05  # of a measured resonance, up to where its mode is looked for
MOST_TILT_DEG = 30.0
MOST_TURN_MRAD = 100.0  # as an angle, which is taken for small
MOST_DRIVES = 100  # at once; a plate has about so many modes below 20 kHz


class Strip(Table):
    """One-dimensional standing wave along x with the bending wavelength of the drive; antinode at x = 0."""

    kind: Literal["strip"] = "strip"
    thickness_mm: LengthMm
    length_mm: LengthMm | None = None
    width_mm: LengthMm = 60.0
    material: MaterialChoice = "aluminium"


class RigidPlate(Table):
    """A plate that does not bend: a tray that moves in any direction, a piston up and down, or one that stands still.

    A `rim` is a wall around it that no part gets over and that stands still.
    """

    kind: Literal["piston", "still", "tray"]
    thickness_mm: LengthMm = 3.0
    length_mm: LengthMm = 180.0
    width_mm: LengthMm = 180.0
    tilt_deg: Annotated[float, Field(ge=-MOST_TILT_DEG, le=MOST_TILT_DEG, strict=True)] = 0.0
    rim: Flag = False

    @model_validator(mode="after")
    def _a_tray_tilts(self) -> Self:
        if self.tilt_deg and self.kind != "tray":
            raise ValueError(f'tilt_deg is {self.tilt_deg:g}, must be 0 with kind = "{self.kind}"')
        return self

    @property
    def size(self) -> tuple[float, float, float]:
        """Length, width and thickness [m]."""
        return 1e-3 * self.length_mm, 1e-3 * self.width_mm, 1e-3 * self.thickness_mm


class ModePlate(Table):
    """A plate of any outline, with holes, all of it from a mode file; parts fall off its edge and through its holes.

    A `rim` is only for a plate that is a whole rectangle; see `RigidPlate`.
    """

    kind: Literal["modes"]
    mode_file: Path
    rim: Flag = False


PLATE_LEVELS = ("amplitude_um", "voltage_vpp")
TRAY_LEVELS = ("stroke_um", "turn_mrad", "motion_file", "psd_file")


class Oscillation(Table):
    """A motion at one frequency, which swings up and out like an oscillator; see feeder_sim.plate.drive."""

    frequency_hz: FrequencyHz
    natural_frequency_hz: FrequencyHz | None = None
    damping_ratio: DampingRatio | None = None
    ring_up: Flag = True
    phase_deg: AngleDeg = 0.0

    @model_validator(mode="before")
    @classmethod
    def _without_empty_keys(cls, data: Any) -> Any:
        """Leave out what has no value: it may be of another kind of drive, where a scenario is changed."""
        return {key: value for key, value in data.items() if value is not None} if isinstance(data, dict) else data


class Excitation(Oscillation):
    """One mode driven at one frequency.

    `amplitude_um` is the one reached at resonance, at `at_mm` or else at the highest antinode of the mode (of a free
    rectangular plate usually a corner); the drive is at resonance unless `natural_frequency_hz` says otherwise.
    `voltage_vpp` uses the gain measured on the plate, or the actuators in its mode file, and acts at its distance from
    the resonance. `modes` are those that move: the driven one, all, or those whose share of its amplitude is above a
    number.
    """

    amplitude_um: NonNegative | None = None
    voltage_vpp: NonNegative | None = None
    at_mm: PointMm | None = None
    mode: Annotated[int, Field(ge=1, strict=True)] | None = None
    actuator: Annotated[tuple[Name, ...], Field(min_length=1, max_length=MOST_DRIVES)] | None = None
    actuator_phase_deg: Annotated[tuple[AngleDeg, ...], Field(max_length=MOST_DRIVES)] | None = None
    modes: Literal["driven", "all"] | Annotated[float, Field(gt=0, lt=1, strict=True)] | None = None

    @model_validator(mode="after")
    def _actuators_take_a_voltage(self) -> Self:
        if self.actuator is not None and self.voltage_vpp is None:
            raise ValueError("actuator belongs to voltage_vpp, which is missing")
        if self.actuator_phase_deg is not None and len(self.actuator_phase_deg) != len(self.actuator or ()):
            raise ValueError(
                f"actuator_phase_deg has {len(self.actuator_phase_deg)} numbers, must be as many as actuators, "
                f"{len(self.actuator or ())}"
            )
        if self.modes not in (None, "driven") and self.voltage_vpp is None:
            raise ValueError(f"modes is {self.modes!r}, must be 'driven' without voltage_vpp")
        return self

    @model_validator(mode="after")
    def _one_level(self) -> Self:
        if (self.amplitude_um is None) == (self.voltage_vpp is None):
            raise ValueError(f"exactly one of {_either(PLATE_LEVELS)} is needed (of a tray, {_either(TRAY_LEVELS)})")
        if self.voltage_vpp is not None and self.at_mm is not None:
            raise ValueError("at_mm belongs to amplitude_um; a voltage acts at the measured driven point")
        return self


class TrayExcitation(Oscillation):
    """One motion of a tray at one frequency.

    `stroke_um` is its amplitude along a line, `turn_mrad` about an axis through its middle; `motion_file` is one period
    of all six, or without `periodic` a record of them; `psd_file` is a spectrum. Of the last two `frequency_hz` is the
    limit of the band.
    """

    stroke_um: NonNegative | None = None
    angle_deg: AngleDeg = 0.0
    direction_deg: AngleDeg = 0.0
    turn_mrad: Annotated[float, Field(ge=0, le=MOST_TURN_MRAD, strict=True)] | None = None
    axis: Literal["x", "y", "z"] | None = None
    motion_file: Path | None = None
    periodic: Flag = True
    psd_file: Path | None = None
    psd_seed: Annotated[int, Field(ge=0, strict=True)] = 0

    @model_validator(mode="after")
    def _one_motion(self) -> Self:
        if sum(getattr(self, name) is not None for name in TRAY_LEVELS) != 1:
            raise ValueError(f"exactly one of {_either(TRAY_LEVELS)} is needed")
        if (self.turn_mrad is None) != (self.axis is None):
            raise ValueError('turn_mrad and axis = "x", "y" or "z" belong together, one is missing')
        if self.stroke_um is None and (self.angle_deg or self.direction_deg):
            raise ValueError("angle_deg and direction_deg belong to stroke_um, which is missing")
        if self.motion_file is not None and self.natural_frequency_hz is not None:
            raise ValueError("natural_frequency_hz does not go with motion_file, whose harmonics are as the table says")
        if not self.periodic and self.motion_file is None:
            raise ValueError("periodic is false, must be true without motion_file")
        if self.psd_seed and self.psd_file is None:
            raise ValueError(f"psd_seed is {self.psd_seed}, must be 0 without psd_file")
        for key in ("natural_frequency_hz", "damping_ratio", "phase_deg") if self.is_record else ():
            if getattr(self, key):
                kind = "psd_file" if self.psd_file else "periodic = false"
                raise ValueError(f"{key} is {getattr(self, key):g}, must be none with {kind}")
        return self

    @property
    def is_record(self) -> bool:
        """Whether it moves the tray without a period."""
        return self.psd_file is not None or not self.periodic


def _either(names: Sequence[str]) -> str:
    return f"{', '.join(names[:-1])} and {names[-1]}"


class Interval(Table):
    """When something acts: from a given time on, for a given time or to the end of the run."""

    start_s: NonNegative = 0.0
    duration_s: Positive | None = None


class Drive(Interval, Excitation):
    """An excitation that starts at a given time and lasts for a given time, or to the end of the run."""


class TrayDrive(Interval, TrayExcitation):
    """A motion of a tray that starts at a given time and lasts for a given time, or to the end of the run."""


def _moves_a_tray(value: Any) -> bool:
    """Whether a drive, checked or not, is one of a tray: it says how far that moves."""
    if isinstance(value, dict):
        return any(value.get(name) is not None for name in TRAY_LEVELS)
    return isinstance(value, TrayExcitation)


AnyExcitation = Annotated[
    Annotated[Excitation, Tag("Excitation")] | Annotated[TrayExcitation, Tag("TrayExcitation")],
    Discriminator(lambda value: "TrayExcitation" if _moves_a_tray(value) else "Excitation"),
]
AnyDrive = Annotated[
    Annotated[Drive, Tag("Drive")] | Annotated[TrayDrive, Tag("TrayDrive")],
    Discriminator(lambda value: "TrayDrive" if _moves_a_tray(value) else "Drive"),
]


class Support(Table):
    """What carries the plate: at a point, along a line to another one, or on an area around it.

    A spring carries the deflection, shared out evenly; `hinged` holds it, `clamped` holds all of the motion.
    """

    hold: Literal["spring", "hinged", "clamped"] = "spring"
    at_mm: PointMm
    to_mm: PointMm | None = None
    diameter_mm: LengthMm | None = None
    size_mm: SizeMm | None = None
    stiffness_n_per_mm: Positive | None = None
    loss_factor: Annotated[float, Field(ge=0, le=2, strict=True)] | None = None

    @model_validator(mode="after")
    def _holds(self) -> Self:
        if (self.hold == "spring") != (self.stiffness_n_per_mm is not None):
            allowed = "a number above 0 with" if self.hold == "spring" else "none but with"
            raise ValueError(f'stiffness_n_per_mm: must be {allowed} hold = "spring"')
        if self.loss_factor is not None and self.hold != "spring":
            raise ValueError(f'loss_factor is {self.loss_factor:g}, must be none with hold = "{self.hold}"')
        if sum(place is not None for place in (self.to_mm, self.diameter_mm, self.size_mm)) > 1:
            raise ValueError("must be one of to_mm, diameter_mm and size_mm")
        if self.to_mm == self.at_mm:
            raise ValueError("to_mm is at_mm, must be another point")
        return self


class MeasuredResonance(Table):
    """A resonance measured on the plate; the amplitude is that at `driven_point_mm`, per volt peak to peak."""

    frequency_hz: FrequencyHz
    damping_ratio: DampingRatio | None = None
    amplitude_um_per_vpp: Positive | None = None
    driven_point_mm: PointMm = (0.0, 0.0)
    actuator: Annotated[tuple[Name, ...], Field(max_length=MOST_DRIVES)] = ()
    mode: Annotated[int, Field(ge=1, strict=True)] | None = None


class PlateShape(Table):
    """Shape, material and damping of a plate.

    It is a rectangle, or has an `outline`, in coordinates of its own that all places on the plate are in.
    """

    length_mm: LengthMm | None = None
    width_mm: LengthMm | None = None
    outline: Ring | None = None
    drawing: Path | None = None  # read before all else, and its tables put here
    drawing_unit: DrawingUnit | None = None
    drawing_account: str | None = None
    thickness_mm: LengthMm
    material: MaterialChoice = "aluminium"
    damping_ratio: DampingRatio | None = None

    @model_validator(mode="after")
    def _one_shape(self) -> Self:
        sides = {"length_mm": self.length_mm, "width_mm": self.width_mm}
        side_keys = [name for name, side in sides.items() if side is not None]
        if self.outline is not None and side_keys:
            raise ValueError(f"{side_keys[0]} is {sides[side_keys[0]]:g}, must be none with an outline")
        if self.outline is None and len(side_keys) < len(sides):
            missing = next(name for name in sides if name not in side_keys)
            raise ValueError(f"{missing} is missing, must be a number above 0 (or give outline)")
        return self

    @property
    def ring(self) -> Ring:
        """The outer edge."""
        if self.outline is not None:
            return self.outline
        assert self.length_mm is not None and self.width_mm is not None  # the table's own check
        return Ring(size_mm=(self.length_mm, self.width_mm))


class PlateBody(PlateShape):
    """Shape and material of a plate, and up to which frequency its modes are computed.

    With `uniform_width` only modes that do not vary across the width are computed: the bending of a strip.
    """

    highest_frequency_hz: FrequencyHz
    uniform_width: Flag = False


class OnPlate(Table):
    """What is fixed to a plate, carries it, and was measured on it."""

    actuator: Annotated[tuple[Actuator, ...], Field(max_length=MOST_ACTUATORS)] = ()
    bar: Annotated[tuple[Bar, ...], Field(max_length=MOST_ACTUATORS)] = ()
    mass: Annotated[tuple[Mass, ...], Field(max_length=MOST_ACTUATORS)] = ()
    hole: Annotated[tuple[Ring, ...], Field(max_length=MOST_HOLES)] = ()
    support: Annotated[tuple[Support, ...], Field(max_length=MOST_ACTUATORS)] = ()
    resonance: tuple[MeasuredResonance, ...] = ()

    @model_validator(mode="after")
    def _names(self) -> Self:
        check_names(self.actuator)
        names = [actuator.name for actuator in self.actuator]
        for i, resonance in enumerate(self.resonance):
            for name in resonance.actuator:
                if name not in names:
                    allowed = ", ".join(names) or "none"
                    raise ValueError(f"resonance[{i}].actuator is {name!r}, must be the actuators: {allowed}")
        return self


class PlateFile(OnPlate):
    """A plate as `feeder-sim modes` reads it."""

    plate: PlateBody

    @model_validator(mode="before")
    @classmethod
    def _from_drawing(cls, data: Any, info: ValidationInfo) -> Any:
        """Put outline, holes and places of a drawing in."""
        body = data.get("plate") if isinstance(data, dict) else None
        if not isinstance(body, dict) or body.get("drawing") is None:
            return data
        on_plate = {key: value for key, value in data.items() if key != "plate"}
        merged = with_drawing(body | on_plate, folder_of(info))
        tables = {key: merged.pop(key) for key in OnPlate.model_fields if key in merged}
        return {"plate": merged} | tables

    @model_validator(mode="after")
    def _go_together(self) -> Self:
        if self.plate.uniform_width and (self.actuator or self.bar or self.mass or self.by_elements):
            raise ValueError("plate.uniform_width is true, must be false but with a plain rectangle")
        if self.plate.damping_ratio is None and any(support.loss_factor is not None for support in self.support):
            raise ValueError("plate.damping_ratio is missing, allowed with a loss_factor is a number: both add up")
        return self

    @property
    def by_elements(self) -> bool:
        """Whether its modes take finite elements: it is no whole rectangle with free edges."""
        return self.plate.outline is not None or bool(self.hole or self.support)


class BendingPlate(PlateShape, OnPlate):
    """A plate that is described here, or in a plate file whose keys may be given anew; its modes are computed.

    Modes are wanted up to `highest_frequency_hz`, or as far as they can be moved by the drives. A `rim` is only for a
    rectangle; see `RigidPlate`.
    """

    kind: Literal["plate"]
    file: Path | None = None  # read before all else, and its keys put here
    highest_frequency_hz: FrequencyHz | None = None
    rim: Flag = False

    @model_validator(mode="before")
    @classmethod
    def _from_file(cls, data: Any, info: ValidationInfo) -> Any:
        """Put the keys of `file` before those that are given; relative to the folder of the scenario."""
        if isinstance(data, dict) and data.get("drawing") is not None:
            data = with_drawing(data, folder_of(info))
        if not isinstance(data, dict) or data.get("file") is None:
            return data
        path = folder_of(info) / str(data["file"])
        file = parse(read_text(path), PlateFile, path).model_dump(exclude_unset=True)
        body = {key: value for key, value in file.pop("plate").items() if key != "uniform_width"}
        if data.get("outline") is not None:
            body = {key: value for key, value in body.items() if key not in ("length_mm", "width_mm")}
        return body | file | {key: value for key, value in data.items() if key != "file"}

    @model_validator(mode="after")
    def _complete(self) -> Self:
        self.as_file(1.0)
        return self

    def as_file(self, highest_frequency_hz: float) -> PlateFile:
        """The same plate, with modes up to a frequency at least.

        Raises:
            ValueError: tables that do not go together.
        """
        shape = {key: getattr(self, key) for key in PlateShape.model_fields}
        measured = (BEYOND_MEASURED * resonance.frequency_hz for resonance in self.resonance)
        highest = max(highest_frequency_hz, self.highest_frequency_hz or 0.0, *measured)
        try:
            body = PlateBody(**shape, highest_frequency_hz=highest)
            return PlateFile(plate=body, **{key: getattr(self, key) for key in OnPlate.model_fields})
        except ValidationError as error:
            raise ValueError(error.errors()[0]["msg"].removeprefix("Value error, ")) from None


Plate = Annotated[Strip | ModePlate | RigidPlate | BendingPlate, Field(discriminator="kind")]
