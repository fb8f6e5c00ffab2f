"""Tables of a scenario that describe fixed things on the plate: walls, fences, wipers, ramps."""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from pydantic import Field

from feeder_sim.scenario.tables import AngleDeg, CoordinateMm, LengthMm, NonNegative, PointMm, Table

MAX_FIXTURES = 100
SIDES = 64  # of the prism that stands for a cylinder

Unit = Annotated[float, Field(ge=0, le=1, strict=True)]
Corners = tuple[tuple[float, float, float], ...]  # of a convex body, in mm


class FixtureTable(Table):
    """Keys that fixtures of every shape have.

    `position_mm` is where the origin of the shape stands; a third number is how high its lower end is above the plate,
    as of a wiper. `restitution` and `friction` are those between parts and it; by default those of parts and plate.
    With `moves = "plate"` it goes with a tray; over a plate that bends it stands, on feet, and does not load it.
    """

    sizes: ClassVar[str] = ""
    if TYPE_CHECKING:

        @property
        def shape(self) -> str:
            """Key that names the shape, a `Literal` of one text."""

    name: Annotated[str, Field(min_length=1, max_length=40, pattern=r"^[A-Za-z0-9_-]+$")] | None = None
    position_mm: PointMm | tuple[CoordinateMm, CoordinateMm, NonNegative] = (0.0, 0.0)
    turn_deg: AngleDeg = 0.0
    restitution: Unit | None = None
    friction: NonNegative | None = None
    moves: Literal["plate", "stands"] = "plate"

    @abstractmethod
    def bodies(self) -> tuple[Corners, ...]:
        """Corners of the convex bodies that it is made of, in its own axes [mm]; its lower end is at z = 0."""

    @property
    def foot_mm(self) -> tuple[float, float, float]:
        """Where its origin is over the resting plate."""
        x, y, *z = self.position_mm
        return x, y, z[0] if z else 0.0


class BoxFixture(FixtureTable):
    """A wall, a fence, a block; its origin is in the middle of its foot."""

    sizes: ClassVar[str] = "size_mm"
    shape: Literal["box"]
    size_mm: tuple[LengthMm, LengthMm, LengthMm]

    def bodies(self) -> tuple[Corners, ...]:
        x, y, z = self.size_mm
        return (tuple((sx * x, sy * y, sz * z) for sx in (-0.5, 0.5) for sy in (-0.5, 0.5) for sz in (0.0, 1.0)),)


class CylinderFixture(FixtureTable):
    """An upright post; as parts touch it, a prism of many sides around the circle."""

    sizes: ClassVar[str] = "diameter_mm, height_mm"
    shape: Literal["cylinder"]
    diameter_mm: LengthMm
    height_mm: LengthMm

    def bodies(self) -> tuple[Corners, ...]:
        radius = 0.5 * self.diameter_mm
        angles = [2.0 * math.pi * k / SIDES for k in range(SIDES)]
        return (_prism([(radius * math.cos(a), radius * math.sin(a)) for a in angles], self.height_mm),)


class RampFixture(FixtureTable):
    """A wedge that rises along its x, from nothing to `size_mm[2]`; its origin is in the middle of its lower edge."""

    sizes: ClassVar[str] = "size_mm"
    shape: Literal["ramp"]
    size_mm: tuple[LengthMm, LengthMm, LengthMm]

    def bodies(self) -> tuple[Corners, ...]:
        x, y, z = self.size_mm
        return (tuple((*corner, h) for h, corner in _wedge(x, 0.5 * y, z)),)


class ExtrusionFixture(FixtureTable):
    """A convex outline, seen from above, that is extruded upwards."""

    sizes: ClassVar[str] = "points_mm, height_mm"
    shape: Literal["extrusion"]
    points_mm: Annotated[tuple[PointMm, ...], Field(min_length=3, max_length=200)]
    height_mm: LengthMm

    def bodies(self) -> tuple[Corners, ...]:
        return (_prism(list(self.points_mm), self.height_mm),)


Fixture = Annotated[
    BoxFixture | CylinderFixture | RampFixture | ExtrusionFixture,
    Field(discriminator="shape"),
]


def _prism(outline: list[tuple[float, float]], height: float) -> Corners:
    return tuple((x, y, z) for z in (0.0, height) for x, y in outline)


def _wedge(length: float, half: float, rise: float) -> list[tuple[float, tuple[float, float]]]:
    """Height and place of the corners of a wedge."""
    foot = [(0.0, (x, y)) for x in (0.0, length) for y in (-half, half)]
    return [*foot, (rise, (length, -half)), (rise, (length, half))]
