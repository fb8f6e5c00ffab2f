"""The colours of parts in a replay, and what they mean.

All instances of a mesh have one colour, so a part changes its colour by changing to another mesh. `Colours` therefore
says which entry of the legend a part belongs to, part by part and frame by frame.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from feeder_sim.part.stable_poses import NONE
from feeder_sim.records.recording import PartRecord
from feeder_sim.records.trajectory import Frames
from feeder_sim.scenario import PartSpec, Scenario

Colour = Literal["kind", "pose"]  # what colours stand for
NUT = (214, 140, 30)
IN_NO_POSE = (150, 150, 150)
# Okabe and Ito's colours, which people with any colour vision tell apart, without black and with their blue last: it is
# near to that of the plate.
PALETTE = (
    (230, 159, 0),
    (0, 158, 115),
    (204, 121, 167),
    (240, 228, 66),
    (86, 180, 233),
    (213, 94, 0),
    (0, 114, 178),
)


@dataclass(frozen=True)
class LegendEntry:
    """An entry of the legend: its text and its colour."""

    name: str
    colour: tuple[int, int, int]


@dataclass(frozen=True)
class Colours:
    """What colour parts have.

    Attributes:
        entries: of the legend; a single one is not worth a legend.
        index: makes of frames and the indices of parts (m,) the entry of each part in each frame, shape (n, m).
    """

    entries: tuple[LegendEntry, ...]
    index: Callable[[Frames, Sequence[int]], NDArray[np.int64]]


def default_colour(scenario: Scenario) -> Colour:
    """Poses where a pick asks for the side up, else kinds."""
    stages = (*scenario.schedule.prepare, *scenario.schedule.stage) if scenario.schedule else ()
    return "pose" if any(pick.up for stage in stages for pick in stage.picks) else "kind"


def colours_of(scenario: Scenario, colour: Colour | None, parts: Sequence[PartRecord]) -> Colours:
    """Colours of all parts of a scenario, as recorded; parts of one table are of one kind.

    Without a colour it is that of `default_colour`.
    """
    if (colour or default_colour(scenario)) == "pose":
        return _by_pose(parts)
    kind_of_part = np.repeat(np.arange(len(scenario.part)), [part.count for part in scenario.part])
    names = kind_names(scenario.part)
    palette = PALETTE if len(names) > 1 else (NUT,)
    entries = tuple(LegendEntry(name, palette[i % len(palette)]) for i, name in enumerate(names))

    def index(frames: Frames, members: Sequence[int]) -> NDArray[np.int64]:
        return np.tile(kind_of_part[np.asarray(members)], (len(frames), 1))

    return Colours(entries, index)


def _by_pose(parts: Sequence[PartRecord]) -> Colours:
    """An entry for every letter that names a stable pose, whatever the kind, and one for parts in no pose."""
    names = max((part.poses.names for part in parts), key=len, default=())
    entries = [LegendEntry(name, PALETTE[i % len(PALETTE)]) for i, name in enumerate(names)]

    def index(frames: Frames, members: Sequence[int]) -> NDArray[np.int64]:
        rows = [parts[m].poses.number(frames.quaternion[:, m]) for m in members]
        number = np.stack(rows, axis=1) if rows else np.empty((len(frames), 0), np.int64)
        return np.where(number == NONE, len(names), number)

    return Colours((*entries, LegendEntry("in no pose", IN_NO_POSE)), index)


def kind_names(parts: Sequence[PartSpec]) -> list[str]:
    """Names of the kinds of parts; kinds of the same name have their numbers added."""
    names = [part.label for part in parts]
    return [f"{name} ({i + 1})" if names.count(name) > 1 else name for i, name in enumerate(names)]
