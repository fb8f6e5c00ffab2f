"""Tables of a scenario that describe parts of any shape: material, number, start, guide."""

from __future__ import annotations

import math
from abc import abstractmethod
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self

from pydantic import Discriminator, Field, Tag, model_validator

from feeder_sim.scenario.material import MaterialChoice
from feeder_sim.scenario.tables import (
    AngleDeg,
    AngleRange,
    CoordinateMm,
    DropHeightRange,
    LengthMm,
    NonNegative,
    PointMm,
    Positive,
    SpinRadS,
    Table,
    VelocityMmS,
)

if TYPE_CHECKING:
    from feeder_sim.part.rigid_part import RigidPart

MAX_PARTS = 5000
# From the vertical. A guide that is nearly horizontal would not stand on the plate.
GuideTiltDeg = Annotated[float, Field(ge=0, le=60, strict=True)]


class _Turned(Table):
    """Height and attitude of a part at its start: ranges from which each seed draws."""

    drop_height_mm: DropHeightRange = (0.2, 0.5)
    yaw_deg: AngleRange = (0.0, 360.0)
    tilt_deg: AngleRange | None = None


class Start(_Turned):
    """Where one part is released: ranges are drawn per seed; its lowest point is at drop height over the resting plate.

    `position_mm` of a part in a guide is where the guide's axis meets the plate. Without `tilt_deg` a free part starts
    0 to 3 degrees off the vertical, a guided one along the axis of its guide.
    """

    kind: Literal["point"] = "point"
    position_mm: PointMm = (0.0, 0.0)
    velocity_mm_s: VelocityMmS = (0.0, 0.0, 0.0)


class Scattered(_Turned):
    """Parts dropped at random places of a rectangle without touching: the plate, or `size_mm` around `centre_mm`."""

    kind: Literal["scattered"]
    centre_mm: PointMm = (0.0, 0.0)
    size_mm: tuple[LengthMm, LengthMm] | None = None


class Heap(_Turned):
    """Parts poured from a column of a diameter, layer above layer; by default with random attitudes."""

    kind: Literal["heap"]
    centre_mm: PointMm = (0.0, 0.0)
    diameter_mm: LengthMm
    tilt_deg: AngleRange | None = (0.0, 180.0)


class Placed(Table):
    """Parts laid down one by one: x, y and yaw of each. One may reach into another where their shapes do not meet.

    Without `tilt_deg` they lie as drawn.
    """

    kind: Literal["placed"]
    places_mm_deg: Annotated[tuple[tuple[CoordinateMm, CoordinateMm, AngleDeg], ...], Field(min_length=1)]
    drop_height_mm: DropHeightRange = (0.01, 0.01)
    tilt_deg: AngleRange = (0.0, 0.0)


UNIT_ERROR = 1e-3  # of the length of a quaternion, which has to be 1
QuaternionNumber = Annotated[float, Field(ge=-1 - UNIT_ERROR, le=1 + UNIT_ERROR, strict=True)]


class GivenState(Table):
    """One part with its whole state; nothing of it is drawn.

    The position is that of the centre of mass over the resting plate. The quaternion (w first) turns the part from the
    axes that it was drawn in; the angular velocity is in the axes of the plate.
    """

    kind: Literal["state"]
    position_mm: tuple[CoordinateMm, CoordinateMm, CoordinateMm]
    quaternion: tuple[QuaternionNumber, QuaternionNumber, QuaternionNumber, QuaternionNumber] = (1.0, 0.0, 0.0, 0.0)
    velocity_mm_s: VelocityMmS = (0.0, 0.0, 0.0)
    angular_velocity_rad_s: tuple[SpinRadS, SpinRadS, SpinRadS] = (0.0, 0.0, 0.0)

    @model_validator(mode="after")
    def _unit_quaternion(self) -> Self:
        length = math.hypot(*self.quaternion)
        if abs(length - 1.0) > UNIT_ERROR:
            raise ValueError(f"quaternion has length {length:.6g}, must be 1")
        return self

    @property
    def drop_height_mm(self) -> tuple[float, float]:
        """Between these lies the height of its lowest point."""
        return (0.0, max(0.0, self.position_mm[2]))


def start_kind(value: Any) -> Any:
    """Kind of a start for pydantic's choice of its table; "point" where a scenario names none."""
    return value.get("kind", "point") if isinstance(value, dict) else getattr(value, "kind", None)


StartSpec = Annotated[
    Annotated[Start, Tag("point")]
    | Annotated[Scattered, Tag("scattered")]
    | Annotated[Heap, Tag("heap")]
    | Annotated[Placed, Tag("placed")]
    | Annotated[GivenState, Tag("state")],
    Discriminator(start_kind),
]


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


GuideSpec = Annotated[Slide | Tube, Field(discriminator="kind")]


class PartTable(Table):
    """Keys that parts of every shape have; a shape adds its own, and says what solid they make.

    `mass_g` and `inertia_g_mm2` are for parts that have been weighed; without them both are those of a solid of its
    material, and with the mass alone the moments of inertia follow it.

    Attributes:
        sizes: what says how large it is, for lists of shapes.
        in_steps: whether its contacts can be found in steps alone.
        lonely: whether it can meet neither other parts nor walls.
    """

    sizes: ClassVar[str] = ""
    in_steps: ClassVar[bool] = False
    lonely: ClassVar[bool] = False

    if TYPE_CHECKING:

        @property
        def shape(self) -> str:
            """Key that names the shape, a `Literal` of one text."""

    name: Annotated[str, Field(min_length=1, max_length=40, pattern=r"^[A-Za-z0-9_-]+$")] | None = None
    material: MaterialChoice = "steel"
    mass_g: Positive | None = None
    inertia_g_mm2: tuple[Positive, Positive, Positive] | None = None
    count: Annotated[int, Field(ge=1, le=MAX_PARTS, strict=True)] = 1
    start: StartSpec = Start()
    guide: GuideSpec | None = None

    @abstractmethod
    def solid(self, density: float, name: str) -> RigidPart:
        """The body in SI units, in the axes it is drawn in; density [kg/m^3].

        Raises:
            InputError: it is read from a file, which is missing or holds no closed mesh.
        """

    @property
    def label(self) -> str:
        """What a legend calls it."""
        return self.shape

    @property
    def files(self) -> dict[str, Path]:
        """The files that it is read from, by key."""
        return {name: value for name in type(self).model_fields if isinstance(value := getattr(self, name), Path)}

    @model_validator(mode="before")
    @classmethod
    def _as_many_as_places(cls, value: Any) -> Any:
        start = value.get("start") if isinstance(value, dict) else None
        places = start.get("places_mm_deg") if isinstance(start, dict) else getattr(start, "places_mm_deg", None)
        if isinstance(places, list | tuple) and "count" not in value:
            return value | {"count": len(places)}
        return value

    @model_validator(mode="after")
    def _room_for_all(self) -> Self:
        if isinstance(self.start, Placed) and len(self.start.places_mm_deg) != self.count:
            raise ValueError(f"count is {self.count}, must be {len(self.start.places_mm_deg)}, as many as places")
        if self.count > 1 and isinstance(self.start, Start | GivenState):
            kinds = '"scattered", "heap" or "placed"'
            raise ValueError(f'start.kind is "{self.start.kind}", must be {kinds} with count = {self.count}')
        if self.guide is not None and not isinstance(self.start, Start):
            raise ValueError(f'start.kind is "{self.start.kind}", must be "point" for a part in a guide')
        if self.guide is not None and isinstance(self.start, Start) and any(self.start.velocity_mm_s):
            raise ValueError("start.velocity_mm_s is not 0, which a part in a guide is released with")
        return self

    @model_validator(mode="after")
    def _moments_of_a_body(self) -> Self:
        if self.inertia_g_mm2 is not None and 2.0 * max(self.inertia_g_mm2) > sum(self.inertia_g_mm2) * (1 + 1e-9):
            raise ValueError("inertia_g_mm2 has a moment above the sum of the other two, which no body has")
        return self
