"""The result of a run as a user of Python holds it: findings by name, tables, plots, and what a notebook shows."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from feeder_sim.api.tables import Table, frame_of, saved_frames
from feeder_sim.errors import FeederSimError, InputError, path_of_user
from feeder_sim.measures.bounces import Bounces
from feeder_sim.measures.protocol import SeedReader
from feeder_sim.notebook import axes_for, block
from feeder_sim.plots.result import draw_intervals, draw_paths, draw_stages, draw_ways
from feeder_sim.records.recording import PlateRecord
from feeder_sim.records.seed import Status
from feeder_sim.run import simulation

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.axes import Axes

    from feeder_sim.records.trajectory import Frames


# Plots of a result. Every method returns matplotlib axes; what becomes of them is the caller's business.


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
        """The way of the part from antinode to node over time, the mean of the seeds with its 95 % interval.

        Raises:
            InputError: no frames were kept, or no transport is measured.
        """
        cell = self._result.prepared.cell
        if cell is None:
            raise InputError("has no transport to draw: one free part in a cell of a mode, no schedule", key="drift")
        pairs = zip(self._frames(None), self._result.seeds, strict=True)
        drawn = [(frames, seed.status == Status.DONE) for frames, seed in pairs if len(frames) > 1]
        return draw_ways(
            axes_for(ax), [frames for frames, _ in drawn], cell.distance_to_node, counted=[ended for _, ended in drawn]
        )

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
        findings, read = self._result.bounces, SeedReader(Bounces(), self._result.prepared)
        readings = [reading for seed in self._result.seeds if (reading := read(seed)) is not None]
        return draw_intervals(axes_for(ax), [seed.flights.interval for seed in readings], findings)

    def _frames(self, seeds: Iterable[int] | None) -> list[Frames]:
        frames = saved_frames(self._result)
        if seeds is None:
            return frames
        for seed in seeds:
            if not 0 <= seed < len(frames):
                raise InputError(f"is {seed}, must be 0 to {len(frames) - 1}", key="seed")
        return [frames[seed] for seed in seeds]

    def __repr__(self) -> str:
        return "<plots: path(), drift(), separation(), bounces()>"


class Result(simulation.Result):
    """An ensemble: what `simulate`, `record_run` and `open` return.

    Findings have a property each. One that does not apply to the scenario is an `InputError` that names those that do,
    and `hasattr` says False.

    Attributes:
        prepared: what was simulated.
        seeds: one `Seed` per seed, in order; of a run that was interrupted, the seeds that had begun.
        wall_s: elapsed wall time of the ensemble [s], that before a break included.
    """

    @staticmethod
    def of(result: simulation.Result) -> Result:
        """The same result, as a user holds it."""
        return Result(result.prepared, result.seeds, result.wall_s)

    @property
    def plot(self) -> Plots:
        """Plots, such as `result.plot.path()`, each of which returns matplotlib axes."""
        return Plots(self)

    @cached_property
    def plate(self) -> PlateRecord:
        """The plate, thinned for display."""
        from feeder_sim.run.run_folder import plate_record

        return plate_record(self.prepared)

    @property
    def part_names(self) -> tuple[str, ...]:
        """The name of every part."""
        return tuple(part.name for part in self.scene.parts)

    @property
    def part_kinds(self) -> tuple[str, ...]:
        """The name of the kind of every part."""
        kinds = zip(self.scenario.part, self.scenario.kind_names, strict=True)
        return tuple(name for part, name in kinds for _ in range(part.count))

    def to_frame(self, of: Table = "measures") -> pandas.DataFrame:
        """A tidy table as a pandas DataFrame; the extra `data` brings pandas.

        Args:
            of: "measures": a row per seed and measure, NaN where a seed has no value; "frames": a row per seed, time
                and part; "impacts": a row per impact of a guided part; "picks": as in picks.csv of a run folder;
                "removals": a row per part that was picked, lost or went through an outlet. Columns have their units in
                their names.

        Raises:
            InputError: pandas is missing, there is no such table, or its rows were not kept.
        """
        return frame_of(self, of)

    def to_xarray(self) -> xarray.Dataset:
        """The frames as an xarray Dataset with dimensions seed, time, part and axis; the extra `data` brings xarray.

        Units are attributes. `present` says which parts are there; where one is not, or a seed has ended before others,
        the values are NaN.

        Raises:
            InputError: xarray is missing, or no frames were kept.
        """
        from feeder_sim.api.tables import dataset_of

        return dataset_of(self)

    def to_hdf5(self, path: str | Path) -> None:
        """Write all that is recorded into one HDF5 file, for other programs; `feeder-sim export` does so with a folder.

        Its layout is in the docs (Run folders). `feeder_sim.open` reads it, too.

        Raises:
            InputError: not all frames were kept.
            RecordingFailed: it cannot be written, as when the disk is full.
        """
        from feeder_sim.records.trajectory_file import export_recording
        from feeder_sim.run.run_folder import recording_of

        saved_frames(self)
        target = path_of_user(path, "path")
        export_recording(recording_of(self.prepared, self.seeds, target, wall_s=self.wall_s), target)

    def _repr_html_(self) -> str:
        try:
            lines = [*self.lines(), *(f"warning: {warning}" for warning in self.warnings)]
        except FeederSimError as error:
            lines = [str(error)]
        return block(repr(self)[1:-1], lines)
