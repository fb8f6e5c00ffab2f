"""Tables of a scenario that say where parts leave it: outlets, whose parts are counted."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Self

from pydantic import Field, model_validator

from feeder_sim.scenario.tables import CoordinateMm, DrawingUnit, PointMm, Positive, Table

MAX_OUTLETS = 20

PlaceMm = tuple[CoordinateMm, CoordinateMm, CoordinateMm]


class Outlet(Table):
    """What enters it leaves the scene and is counted: every part whose centre of mass is over an outline, or in a box.

    `part` and `up` say which of the parts that go through are right, as those of a pick do; all of them go through.
    """

    name: Annotated[str, Field(min_length=1, max_length=40, pattern=r"^[A-Za-z0-9_-]+$")]
    outline_mm: Annotated[tuple[PointMm, ...], Field(min_length=3, max_length=200)] | None = None
    box_mm: tuple[PlaceMm, PlaceMm] | None = None
    drawing: Path | None = None  # read before all else, and its outlines put here
    drawing_unit: DrawingUnit | None = None
    jam_after_s: Positive | None = None
    up: Annotated[tuple[str, ...], Field(max_length=100)] = ()
    part: str | None = None

    @model_validator(mode="after")
    def _has_an_inside(self) -> Self:
        import shapely

        if (self.outline_mm is None) == (self.box_mm is None):
            raise ValueError("exactly one of outline_mm, box_mm and drawing is needed")
        if self.box_mm is not None and not all(low < high for low, high in zip(*self.box_mm, strict=True)):
            raise ValueError("box_mm has a side without length, must be [[x0, y0, z0], [x1, y1, z1]] with x0 < x1, ...")
        if self.outline_mm is not None and not shapely.Polygon(self.outline_mm).is_valid:
            raise ValueError("outline_mm crosses or touches itself, must be a polygon that does not")
        return self
