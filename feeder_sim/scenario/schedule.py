"""Tables of a scenario that say what happens when: stages, their order, picks, and where the parts are to go."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from feeder_sim.scenario.plate import Excitation
from feeder_sim.scenario.tables import LengthMm, NonNegative, Positive, Table


class Pick(Table):
    """Take every part out whose centre is farther than the clearance from the centres of all others (in plan view)."""

    clearance_mm: LengthMm


class Settled(Table):
    """All parts have been this near to a nodal line of every mode of the stage for so long without a break."""

    within_mm: LengthMm = 1.0
    for_s: Positive = 0.5


class Stage(Table):
    """Drive these modes together for a while; then a pause with the drives off, then perhaps a pick.

    With `until` the drives stop as soon as the parts have settled; `duration_s` is then the longest they act. What the
    plate still does when a drive stops is its own ring-down, and goes on into the stages after it.
    """

    name: str = ""
    drive: tuple[Excitation, ...] = ()
    duration_s: Positive
    until: Settled | None = None
    pause_s: NonNegative = 0.0
    pick: Pick | None = None

    @model_validator(mode="after")
    def _settles_over_a_drive(self) -> Self:
        if self.until is not None and not self.drive:
            raise ValueError("until belongs to a stage with a drive, whose nodal lines the parts settle on")
        return self


class Schedule(Table):
    """Stages to prepare the parts once, and a cycle of stages that is repeated."""

    cycles: Annotated[int, Field(ge=1, le=10_000, strict=True)] = 1
    prepare: tuple[Stage, ...] = ()
    stage: Annotated[tuple[Stage, ...], Field(min_length=1)]


class Goal(Table):
    """Where a schedule is to carry the parts: to the line x = `x_mm`, or to a point of it."""

    x_mm: Annotated[float, Field(allow_inf_nan=False, strict=True)]
    y_mm: Annotated[float, Field(allow_inf_nan=False, strict=True)] | None = None
    within_mm: LengthMm = 2.0
