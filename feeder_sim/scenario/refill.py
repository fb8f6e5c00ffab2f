"""Tables of a scenario for what happens around the plate: new parts from a hopper, and the time of robot and camera."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Discriminator, Field, Tag, model_validator

from feeder_sim.scenario.part import MAX_PARTS, Heap, Scattered, start_kind
from feeder_sim.scenario.tables import NonNegative, Table

PourSpec = Annotated[Annotated[Scattered, Tag("scattered")] | Annotated[Heap, Tag("heap")], Discriminator(start_kind)]
Number = Annotated[int, Field(ge=1, le=MAX_PARTS, strict=True)]


class Refill(Table):
    """New parts at the end of a cycle, after its last pick, when fewer than `below` are on the plate.

    The part tables say how many of each kind may be on the plate at once; of which kinds the new ones are is drawn in
    proportion to these numbers.
    """

    to: Number | None = None
    below: Number | None = None
    start: PourSpec | None = None

    @model_validator(mode="after")
    def _below_what_it_refills_to(self) -> Self:
        if self.to is not None and self.below is not None and self.below > self.to:
            raise ValueError(f"below is {self.below}, allowed is up to {self.to}, which is what is refilled to")
        return self


class Robot(Table):
    """Time of robot and camera, during which the plate rests and nothing is simulated; it counts for the rate."""

    pick_s: NonNegative = 0.0
    look_s: NonNegative = 0.0
