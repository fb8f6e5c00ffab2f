"""Tables of an outline file: the outer edge of a plate and its holes."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from feeder_sim.scenario.tables import LengthMm, PointMm, Table

MOST_CORNERS, MOST_HOLES = 20_000, 1000


class Ring(Table):
    """A closed line: a polygon by its corners, a circle or an upright rectangle around a centre."""

    points_mm: Annotated[tuple[PointMm, ...], Field(min_length=3, max_length=MOST_CORNERS)] | None = None
    centre_mm: PointMm = (0.0, 0.0)
    diameter_mm: LengthMm | None = None
    size_mm: tuple[LengthMm, LengthMm] | None = None

    @model_validator(mode="after")
    def _one_shape(self) -> Self:
        given = [name for name in ("points_mm", "diameter_mm", "size_mm") if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError(f"gives {' and '.join(given) or 'no shape'}, allowed is points_mm, diameter_mm or size_mm")
        if self.points_mm is not None and "centre_mm" in self.model_fields_set:
            raise ValueError("centre_mm belongs to diameter_mm or size_mm, points_mm says where it is by itself")
        return self


class OutlineFile(Table):
    """The outline of a plate, in the coordinates of the file whose modes are imported with it."""

    exterior: Ring
    hole: Annotated[tuple[Ring, ...], Field(max_length=MOST_HOLES)] = ()
