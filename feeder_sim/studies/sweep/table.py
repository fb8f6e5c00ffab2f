"""What a sweep has come to: every measure at every point, as a tidy table.

One row per point and measure. Its columns are the varied keys, then

    measure   name of the measure, with its unit
    mean      over all seeds that have a value
    se        standard error of the mean
    n         seeds that have a value
    seeds     that were run, those that failed too
    failed    seeds that ended without any value

and where inputs are uncertain

    low, high   90 % interval of the mean over the inputs, the scatter of the seeds taken out; empty where the inputs
                are not told apart from the seeds
    sd_inputs   standard deviation of the mean over the inputs; 0 where they are not told apart
    sd_seeds    standard deviation over the seeds at the same inputs
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from feeder_sim.jobs.task import SeedValues
from feeder_sim.measures.statistic import Statistic
from feeder_sim.scenario.changes import labels
from feeder_sim.studies.sweep.design import Point
from feeder_sim.studies.uncertainty.spread import Spread, spread_of

COLUMNS = ("measure", "mean", "se", "n", "seeds", "failed")
UNCERTAIN_COLUMNS = ("low", "high", "sd_inputs", "sd_seeds")
# What a sweep is most often asked for, in this order, where it is measured.
MAIN = (
    *("transport_speed_mm_s", "picks_per_minute", "arrival_time_s", "picked", "bounce_interval_ms"),
    *("circulation_mm_s", "drift_velocity_x_mm_s"),
)


@dataclass(frozen=True)
class Row:
    """A measure at a point; see the module.

    Attributes:
        point: value of each varied key.
        spread: apart over inputs and over seeds; None where no input is uncertain.
    """

    point: Point
    measure: str
    statistic: Statistic
    seeds: int
    failed: int
    spread: Spread | None = None

    def as_dict(self) -> dict[str, Any]:
        """The row by column; None where there is no value."""
        statistic = self.statistic.as_dict()
        row = labels(self.point) | {"measure": self.measure, "mean": statistic["mean"], "se": statistic["se"]}
        row |= {"n": statistic["n"], "seeds": self.seeds, "failed": self.failed}
        return row | (self.spread.as_dict() if self.spread else {})

    @property
    def without_value(self) -> int:
        """Seeds that have run to the end and have no value all the same."""
        return self.seeds - self.failed - self.statistic.n


def rows_of(point: Point, draws: Sequence[Sequence[SeedValues]], *, uncertain: bool) -> list[Row]:
    """All measures of a point, from the seeds of each draw of its inputs; without uncertain inputs that is one."""
    seeds = [seed for draw in draws for seed in draw]
    measures = list(dict.fromkeys(name for seed in seeds for name in seed.values))
    failed = sum(bool(seed.failure) for seed in seeds)
    rows = []
    for measure in measures:
        values = [[seed.values.get(measure, math.nan) for seed in draw] for draw in draws]
        spread = spread_of(values) if uncertain else None
        statistic = Statistic.of(value for draw in values for value in draw)
        if spread is not None:  # seeds of the same inputs are not independent draws of them
            statistic = Statistic(statistic.mean, statistic.sd, spread.se, statistic.n)
        rows.append(Row(point, measure, statistic, len(seeds), failed, spread))
    return rows or [empty_row(point, len(seeds), failed)] if failed else rows


def empty_row(point: Point, seeds: int, failed: int) -> Row:
    """Of a point without any value."""
    return Row(point, "", Statistic.of([]), seeds, failed)


def means_of_some(rows: Sequence[Row]) -> str:
    """A line where seeds at points have no value of a measure, whose rows these are; else ""."""
    some = [row for row in rows if row.without_value]
    if not some:
        return ""
    missing, seeds = sum(row.without_value for row in some), sum(row.seeds for row in some)
    where = f"at {len(some)} of {len(rows)} points " if len(rows) > 1 else ""
    why = "as where a part does not come so far in time"
    return f"{where}{missing} of {seeds} seeds have no value, {why}; means are of the others"


def main_measure(measures: Sequence[str], rows: Sequence[Row]) -> str:
    """The measure to show where none is asked for: the first usual one that has a value anywhere."""
    valued = {row.measure for row in rows if row.statistic.n}
    usual = [name for name in MAIN if name in valued]
    return next(iter(usual or [name for name in measures if name in valued] or measures), "")


def as_parquet(columns: Sequence[str], entries: Sequence[Mapping[str, Any]]) -> bytes:
    """The table as Parquet, by pyarrow, which rerun brings."""
    import pyarrow
    import pyarrow.parquet

    table = pyarrow.table({name: _column([entry.get(name) for entry in entries], name) for name in columns})
    sink = pyarrow.BufferOutputStream()
    pyarrow.parquet.write_table(table, sink)
    return bytes(sink.getvalue().to_pybytes())


def _column(values: list[Any], name: str) -> list[Any]:
    """Values of one type: whole numbers of counts, numbers, or else texts."""
    entries = [value for value in values if value is not None]
    if name in ("n", "seeds", "failed") or all(isinstance(value, bool) for value in entries):
        return values
    if all(isinstance(value, int | float) and not isinstance(value, bool) for value in entries):
        return [None if value is None else float(value) for value in values]
    return [None if value is None else str(value) for value in values]
