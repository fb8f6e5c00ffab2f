"""Plots of a result. Every method returns matplotlib axes; what becomes of them is the caller's business."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from feeder_sim.errors import InputError
from feeder_sim.measures.bounces import Bounces
from feeder_sim.measures.protocol import SeedReader
from feeder_sim.notebook import axes_for
from feeder_sim.plots.result import draw_intervals, draw_paths, draw_stages, draw_ways

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from feeder_sim.api.result import Result
    from feeder_sim.records.trajectory import Frames


class Plots:
    """The plots of a result; `ax` draws into given axes, without it a new figure is made."""

    def __init__(self, result: Result) -> None:
        self._result = result

    def path(self, seed: int | None = None, *, ax: Axes | None = None) -> Axes:
        """The paths of the parts on the plate, with its nodal lines.

        Args:
            seed: index of a seed. Default: all seeds of a single part, the first one of many parts.
            ax: axes to draw into.

        Raises:
            InputError: no frames were kept, or there is no such seed.
        """
        many = len(self._result.part_names) > 1
        chosen = self._frames([0] if seed is None and many else None if seed is None else [seed])
        return draw_paths(axes_for(ax), self._result.plate, chosen)

    def drift(self, *, ax: Axes | None = None) -> Axes:
        """The way of the part from antinode to node over time, a curve per seed.

        Raises:
            InputError: no frames were kept, or no transport is measured.
        """
        cell = self._result.prepared.cell
        if cell is None:
            raise InputError("has no transport to draw: one free part in a cell of a mode, no schedule", key="drift")
        frames = self._frames(None)
        return draw_ways(axes_for(ax), [(seed.time, cell.way(seed)) for seed in frames])

    def separation(self, *, ax: Axes | None = None) -> Axes:
        """How many parts are on the plate, on nodal lines and isolated at the end of every stage, mean and SE.

        Raises:
            InputError: a single part without a schedule.
        """
        return draw_stages(axes_for(ax), self._result.separation)

    def bounces(self, *, ax: Axes | None = None) -> Axes:
        """Histogram of the bounce intervals of all seeds.

        Raises:
            InputError: the part is in no guide.
        """
        found, read = self._result.bounces, SeedReader(Bounces(), self._result.prepared)
        readings = [reading for seed in self._result.seeds if (reading := read(seed)) is not None]
        return draw_intervals(axes_for(ax), [seed.flights.interval for seed in readings], found)

    def _frames(self, seeds: Iterable[int] | None) -> list[Frames]:
        from feeder_sim.api.tables import kept_frames

        frames = kept_frames(self._result)
        if seeds is None:
            return frames
        for seed in seeds:
            if not 0 <= seed < len(frames):
                raise InputError(f"is {seed}, allowed is 0 to {len(frames) - 1}", key="seed")
        return [frames[seed] for seed in seeds]

    def __repr__(self) -> str:
        return "<plots: path(), drift(), separation(), bounces()>"
