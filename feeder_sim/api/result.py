"""The result of a run as a user of Python holds it: findings by name, tables, plots, and what a notebook shows."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

from feeder_sim.api.plots import Plots
from feeder_sim.api.tables import Table, frame_of
from feeder_sim.errors import FeederSimError
from feeder_sim.notebook import block
from feeder_sim.records.recording import PlateRecord
from feeder_sim.run import simulation

if TYPE_CHECKING:
    import pandas
    import xarray


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
    def of(found: simulation.Result) -> Result:
        """The same result, as a user holds it."""
        return Result(found.prepared, found.seeds, found.wall_s)

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
                "removals": a row per part that was picked or lost. Columns have their units in their names.

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

    def _repr_html_(self) -> str:
        try:
            lines = [*self.lines(), *(f"caution: {caution}" for caution in self.cautions)]
        except FeederSimError as error:
            lines = [str(error)]
        return block(repr(self)[1:-1], lines)
