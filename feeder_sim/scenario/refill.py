"""Tables of a scenario for what happens around the plate: new parts from a hopper, and the time of robot and camera."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Self

from pydantic import Discriminator, Field, Tag, model_validator

from feeder_sim.scenario.part import MAX_PARTS, Heap, Placed, Scattered, start_kind
from feeder_sim.scenario.tables import NonNegative, Table

if TYPE_CHECKING:
    from feeder_sim.scenario.scenario import Scenario

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


def refused_around_plate(scenario: Scenario) -> Iterator[str]:
    """What does not go with the rest of a scenario: key, value and what is allowed, one line each."""
    schedule, refill = scenario.schedule, scenario.refill
    stages = (*schedule.prepare, *schedule.stage) if schedule else ()
    by_hand = schedule is not None and schedule.by_hand
    if scenario.robot is not None and not by_hand and not any(stage.picks for stage in stages):
        yield "robot belongs to a [schedule] with a pick"
    if refill is None:
        return
    if schedule is None:
        yield "refill belongs to a [schedule], at the end of whose cycles parts are filled in"
    for key, number in (("to", refill.to), ("below", refill.below)):
        if number is not None and number > scenario.n_parts:
            yield f"refill.{key} is {number}, allowed is up to {scenario.n_parts}, the parts of all tables together"
    if scenario.parts_at_once < scenario.n_parts and any(isinstance(part.start, Placed) for part in scenario.part):
        yield f"refill.to is {refill.to}, allowed is {scenario.n_parts}, all parts, where some are placed one by one"
    if scenario.guide is not None:
        yield "part[0].guide is given, allowed is none with [refill]"
    if scenario.run.planar:
        yield "run.planar is true, allowed is false with [refill]"
    if scenario.goal is not None:
        yield "goal is given, allowed is none with [refill]"
    if scenario.pour is None:
        yield 'refill.start is missing, allowed is a table with kind "scattered" or "heap": part[0] starts at one place'
