"""Tables of a scenario that describe its course in time: stages, their order, picks, and the goal of the parts."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import Discriminator, Field, Tag, model_validator

from feeder_sim.errors import nearest
from feeder_sim.scenario.part import MAX_PARTS, Heap, Scattered, start_kind
from feeder_sim.scenario.plate import MOST_DRIVES, AnyExcitation
from feeder_sim.scenario.tables import DurationS, Flag, LengthMm, NonNegative, Positive, Table

# Tables of a scenario for what happens around the plate: new parts from a hopper, and the time of robot and camera.

PourSpec = Annotated[Annotated[Scattered, Tag("scattered")] | Annotated[Heap, Tag("heap")], Discriminator(start_kind)]
Number = Annotated[int, Field(ge=1, le=MAX_PARTS, strict=True)]
EverySeconds = Annotated[float, Field(ge=0.01, le=1e5, strict=True)]


class Refill(Table):
    """New parts when fewer than `below` are on the plate, at the end of a cycle, after its last pick.

    Without a schedule they come at the first frame at or after each multiple of `every_s`.
    The part tables say how many of each kind may be on the plate at once; of which kinds the new ones are is drawn in
    proportion to these numbers.
    """

    every_s: EverySeconds | None = None
    to: Number | None = None
    below: Number | None = None
    start: PourSpec | None = None

    @model_validator(mode="after")
    def _below_what_it_refills_to(self) -> Self:
        if self.to is not None and self.below is not None and self.below > self.to:
            raise ValueError(f"below is {self.below}, must be up to {self.to}, which is what is refilled to")
        return self


class Robot(Table):
    """Time of robot and camera, during which the plate rests and nothing is simulated; it counts for the rate."""

    pick_s: NonNegative = 0.0
    camera_s: NonNegative = 0.0


MOST_STAGES = 100_000  # of all cycles together


class Pick(Table):
    """Take out every part with room around it: of one kind or all, with some sides up or all.

    There is room where the centre of the part is farther than `clearance_mm` from the centres of all others in plan
    view, and where the fingers of a gripper, `shape`, meet no other part.
    """

    clearance_mm: LengthMm | None = None
    shape: Path | None = None
    up: Annotated[tuple[str, ...], Field(max_length=100)] = ()
    part: str | None = None

    @model_validator(mode="after")
    def _needs_room(self) -> Self:
        if self.clearance_mm is None and self.shape is None:
            raise ValueError("exactly what room is needed is missing, must be clearance_mm, shape or both")
        return self


def _how_many(value: Any) -> str:
    """One pick or several, for pydantic's choice."""
    return "list" if isinstance(value, list | tuple) else "table"


PickChoice = Annotated[
    Annotated[Pick, Tag("table")] | Annotated[tuple[Pick, ...], Field(max_length=100), Tag("list")],
    Discriminator(_how_many),
]


class Settled(Table):
    """All parts have been within `within_mm` of a nodal line of every mode of the stage for `for_s` without a break."""

    within_mm: LengthMm = 1.0
    for_s: Positive = 0.5


class Stage(Table):
    """Modes that are driven together, then a pause without drives, then a pick, or several as a list.

    With `until` the drives stop as soon as the parts have settled, and after `duration_s` at the latest. After a drive
    has stopped the plate rings down, also during the stages that follow.
    """

    name: str = ""
    drive: Annotated[tuple[AnyExcitation, ...], Field(max_length=MOST_DRIVES)] = ()
    duration_s: DurationS
    until: Settled | None = None
    pause_s: NonNegative = 0.0
    pick: PickChoice | None = None

    @property
    def picks(self) -> tuple[Pick, ...]:
        """The picks at the end, none, one or several."""
        return (self.pick,) if isinstance(self.pick, Pick) else self.pick or ()

    @model_validator(mode="after")
    def _settles_over_a_drive(self) -> Self:
        if self.until is not None and not self.drive:
            raise ValueError("until belongs to a stage with a drive, whose nodal lines the parts settle on")
        return self


class Schedule(Table):
    """Stages to prepare the parts once, and a cycle of stages that is repeated.

    With `sequence` a cycle has the stages of these names in this order. Each is then computed by itself, from a frame
    to a frame, as if nothing were known of the next one: so a closed loop (`feeder_sim.Feeder`) is recorded, and runs
    again with the same result. `by_hand` says that parts were also picked and filled in by a program, which a run of
    the scenario does not do.
    """

    cycles: Annotated[int, Field(ge=1, le=10_000, strict=True)] = 1
    prepare: Annotated[tuple[Stage, ...], Field(max_length=1000)] = ()
    stage: Annotated[tuple[Stage, ...], Field(min_length=1, max_length=1000)]
    sequence: Annotated[tuple[str, ...], Field(min_length=1, max_length=MOST_STAGES)] | None = None
    by_hand: Flag = False

    @property
    def stage_names(self) -> tuple[str, ...]:
        """What the stages of a cycle are called: their names, or else ones made of their numbers."""
        return tuple(stage.name or f"stage {i + 1}" for i, stage in enumerate(self.stage))

    @property
    def order(self) -> tuple[int, ...]:
        """Numbers of the stages of a cycle, in the order in which they come."""
        names = self.stage_names
        return tuple(range(len(names))) if self.sequence is None else tuple(map(names.index, self.sequence))

    @property
    def picks(self) -> tuple[tuple[str, Pick], ...]:
        """Every pick of all stages once, with its key in the file."""
        return tuple(
            (f"schedule.{group}[{i}].pick" + ("" if isinstance(stage.pick, Pick) else f"[{j}]"), pick)
            for group in ("prepare", "stage")
            for i, stage in enumerate(getattr(self, group))
            for j, pick in enumerate(stage.picks)
        )

    @model_validator(mode="after")
    def _names_in_sequence(self) -> Self:
        names = self.stage_names
        for i, name in enumerate(self.sequence or ()):
            if name not in names:
                allowed = ", ".join(names)
                raise ValueError(f'sequence[{i}] is "{name}"{nearest(name, names)}, must be the stages {allowed}')
        for i, name in enumerate(names if self.sequence else ()):
            if name in names[:i]:
                raise ValueError(f'stage[{i}].name is "{name}", must be a name of its own with sequence')
        return self

    @model_validator(mode="after")
    def _not_too_many(self) -> Self:
        total = len(self.prepare) + self.cycles * len(self.sequence or self.stage)
        if total > MOST_STAGES:
            raise ValueError(f"cycles times stages makes {total} stages, must be up to {MOST_STAGES}")
        return self


class Goal(Table):
    """Where a schedule is to carry the parts: to the line x = `x_mm`, or with `y_mm` to a point."""

    x_mm: Annotated[float, Field(allow_inf_nan=False, strict=True)]
    y_mm: Annotated[float, Field(allow_inf_nan=False, strict=True)] | None = None
    within_mm: LengthMm = 2.0
