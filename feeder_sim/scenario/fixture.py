"""Tables of a scenario that describe fixed things on the plate: walls, fences, wipers, ramps."""

from __future__ import annotations

import itertools
import math
from abc import abstractmethod
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from feeder_sim.scenario.tables import (
    AngleDeg,
    CoordinateMm,
    DrawingUnit,
    LengthMm,
    NonNegative,
    PointMm,
    Positive,
    Table,
)

MAX_FIXTURES = 100
CONVEX = 1e-9  # of the area of an outline, by which its hull may be larger
SIDES = 64  # of the prism that stands for a cylinder

Unit = Annotated[float, Field(ge=0, le=1, strict=True)]
Number = Annotated[float, Field(ge=-1e9, le=1e9, allow_inf_nan=False, strict=True)]
ShiftMm = tuple[CoordinateMm, CoordinateMm, CoordinateMm]
Corners = tuple[tuple[float, float, float], ...]  # of a convex body, in mm


class PathPoint(Table):
    """Where a fixture is at a time, from where it stands; between two points it goes straight on."""

    at_s: NonNegative
    by_mm: ShiftMm = (0.0, 0.0, 0.0)
    turn_deg: Number = 0.0


class Opening(Table):
    """Stages in which a gate is open: it goes by a way as they begin, and comes back as they end."""

    stages: Annotated[tuple[str, ...], Field(min_length=1, max_length=100)]
    by_mm: ShiftMm = (0.0, 0.0, 10.0)
    within_s: Positive = 0.1


class FixtureTable(Table):
    """Keys that fixtures of every shape have.

    `position_mm` is where the origin of the shape stands; a third number is how high its lower end is above the plate,
    as of a wiper. `restitution` and `friction` are those between parts and it; by default those of parts and plate.
    With `moves = "plate"` it goes with a tray; over a plate that bends it stands, on feet, and does not load it. One
    that has a path, turns or opens moves by itself: a tray does not take it along. It turns about `axis` through its
    origin, or about a level one through the middle of its box.
    """

    sizes: ClassVar[str] = ""
    if TYPE_CHECKING:

        @property
        def shape(self) -> str:
            """Key that names the shape, a `Literal` of one text."""

    name: Annotated[str, Field(min_length=1, max_length=40, pattern=r"^[A-Za-z0-9_-]+$")] | None = None
    position_mm: Annotated[tuple[CoordinateMm, ...], Field(min_length=2, max_length=3)] = (0.0, 0.0)
    turn_deg: AngleDeg = 0.0
    restitution: Unit | None = None
    friction: NonNegative | None = None
    moves: Literal["plate", "stands"] = "plate"
    path: Annotated[tuple[PathPoint, ...], Field(min_length=1, max_length=1000)] | None = None
    opens: Opening | None = None
    turns_per_minute: Number = 0.0
    axis: Literal["x", "y", "z"] = "z"

    @model_validator(mode="after")
    def _over_the_plate(self) -> Self:
        if self.foot_mm[2] < 0.0:
            raise ValueError(f"position_mm[2] is {self.foot_mm[2]:g}, must be at least 0: how high its lower end is")
        return self

    @model_validator(mode="after")
    def _one_motion(self) -> Self:
        if self.path is not None and self.opens is not None:
            raise ValueError("path and opens are given, must be one of them")
        times = [point.at_s for point in self.path or ()]
        if any(late <= early for early, late in itertools.pairwise(times)):
            raise ValueError("path has times that do not rise, must be times in order")
        if times and times[0] == 0.0 and (any(self.path[0].by_mm) or self.path[0].turn_deg):  # type: ignore[index]
            raise ValueError("path does not begin where it stands, must have by_mm = [0, 0, 0] at at_s = 0")
        return self

    @property
    def moves_itself(self) -> bool:
        """Whether it has a motion of its own."""
        return self.path is not None or self.opens is not None or self.turns_per_minute != 0.0

    def label(self, number: int) -> str:
        """Its name, or its shape and number in the scenario."""
        return self.name or f"{self.shape}_{number}"

    @property
    def files(self) -> dict[str, Path]:
        """The files that it is made of, by their keys."""
        return {}

    @abstractmethod
    def bodies(self) -> tuple[Corners, ...]:
        """Corners of the convex bodies that it is made of, in its own axes [mm]; its lower end is at z = 0."""

    def footprints(self) -> list[list[tuple[float, float]]]:
        """Outlines of its bodies, seen from above [mm]."""
        import shapely

        angle, (x, y, _) = math.radians(self.turn_deg), self.foot_mm
        c, s = math.cos(angle), math.sin(angle)
        turned = ([(x + c * u - s * v, y + s * u + c * v) for u, v, _ in body] for body in self.bodies())
        return [list(shapely.MultiPoint(body).convex_hull.exterior.coords)[:-1] for body in turned]

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
    """An outline, seen from above, that is extruded upwards; a `drawing` in place of the points is read before."""

    sizes: ClassVar[str] = "points_mm or drawing, height_mm"
    shape: Literal["extrusion"]
    points_mm: Annotated[tuple[PointMm, ...], Field(min_length=3, max_length=200)] | None = None
    height_mm: LengthMm
    drawing: Path | None = None
    drawing_unit: DrawingUnit | None = None

    @model_validator(mode="after")
    def _simple(self) -> Self:
        import shapely

        if self.points_mm is None:
            raise ValueError("points_mm is missing, must be the corners of an outline (or give drawing in a scenario)")
        outline = shapely.Polygon(self.points_mm)
        if not outline.is_valid or outline.area == 0.0:
            raise ValueError("points_mm crosses itself or has no area, must be the corners of an outline in order")
        return self

    def bodies(self) -> tuple[Corners, ...]:
        return tuple(_prism(outline, self.height_mm) for outline in convex_parts(self.points_mm or ()))


class MeshFixture(FixtureTable):
    """A closed mesh, in x and y as in its file; a concave one by the convex pieces that it has been cut into."""

    sizes: ClassVar[str] = "any closed mesh file"
    shape: Literal["mesh"]
    file: Path
    file_unit_mm: Annotated[float, Field(ge=1e-6, le=1e6, allow_inf_nan=False, strict=True)] = 1.0
    pieces: Path | None = None

    @property
    def files(self) -> dict[str, Path]:
        return {"file": self.file} | ({"pieces": self.pieces} if self.pieces else {})

    def bodies(self) -> tuple[Corners, ...]:
        from feeder_sim.part.mesh_part import mesh_bodies

        bodies = mesh_bodies(self.file, self.file_unit_mm, pieces=self.pieces, key="fixture.file")
        lowest = min(body[:, 2].min() for body in bodies)
        return tuple(tuple((x, y, z) for x, y, z in (1e3 * (body - [0.0, 0.0, lowest])).tolist()) for body in bodies)


Fixture = Annotated[
    BoxFixture | CylinderFixture | RampFixture | ExtrusionFixture | MeshFixture,
    Field(discriminator="shape"),
]


def convex_parts(outline: Sequence[tuple[float, float]]) -> list[list[tuple[float, float]]]:
    """Convex outlines that make up one that does not cross itself, none of them with corners that it has not."""
    import shapely

    parts = [shapely.Polygon(outline)]
    if parts[0].convex_hull.area > (1.0 + CONVEX) * parts[0].area:
        parts = list(shapely.constrained_delaunay_triangles(parts[0]).geoms)
    joined = True
    while joined:  # parts that are convex together become one (Hertel and Mehlhorn, 1983)
        joined = False
        for a, b in itertools.combinations(parts, 2):
            both = shapely.union(a, b)
            if both.geom_type == "Polygon" and both.convex_hull.area <= (1.0 + CONVEX) * both.area:
                parts = [*(part for part in parts if part is not a and part is not b), both]
                joined = True
                break
    return [list(part.convex_hull.exterior.coords)[:-1] for part in parts]


def _prism(outline: Sequence[tuple[float, float]], height: float) -> Corners:
    return tuple((x, y, z) for z in (0.0, height) for x, y in outline)


def _wedge(length: float, half: float, rise: float) -> list[tuple[float, tuple[float, float]]]:
    """Height and place of the corners of a wedge."""
    foot = [(0.0, (x, y)) for x in (0.0, length) for y in (-half, half)]
    return [*foot, (rise, (length, -half)), (rise, (length, half))]
