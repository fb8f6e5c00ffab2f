"""The report of a sweep: what was varied, every measure over it with intervals, all values, and what limits them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from feeder_sim.document.document import Block, Folded, Section, Table, Text, Tile
from feeder_sim.document.words import (
    key_label,
    measure_label,
    number,
    point_text,
    split_unit,
    value_text,
    with_error,
)
from feeder_sim.plots.intervals import FEWEST
from feeder_sim.plots.sweep import count_of, half_width, values_of
from feeder_sim.report.content import Content
from feeder_sim.report.measure_tables import TELLING, TILES, in_order, statistic_cells
from feeder_sim.studies.sweep.sweep import CSV, Sweep
from feeder_sim.studies.sweep.table import Row

MOST_PICTURES = 8
MOST_ROWS = 3000  # of all tables of values together; more would make the page too large to mail
MOST_VALUES = 12  # of a key that are listed one by one


def sweep_content(sweep: Sweep, _: Path) -> Content:
    """What the page of a sweep has of its own."""
    ordered = in_order(sweep.measures, sweep.question.measure or "")
    varying = [measure for measure in ordered if _varies(sweep.valued(measure))]
    pictures: list[Block] = [figure for measure in varying[:MOST_PICTURES] for figure in sweep.figures(measure)]
    if more := len(varying) - MOST_PICTURES if len(varying) > MOST_PICTURES else 0:
        pictures.append(Text(f"{more} more measures that change over the sweep are in the tables only.", "note"))
    n = len(sweep.points)
    keys = " and ".join(sweep.keys) if len(sweep.keys) < 3 else f"{len(sweep.keys)} keys"
    return Content(
        subtitle=f"{n} point{'s' if n != 1 else ''} over {keys}; at each of them a mean over several seeds.",
        sections=(
            Section("Results", tuple(pictures)),
            Section("All measures", (_extremes(sweep, ordered), *_values(sweep, ordered))),
        ),
        question=(_keys_table(sweep),),
        tiles=tuple(_tiles(sweep, ordered)),
    )


def _varies(rows: Sequence[Row]) -> bool:
    return len({row.statistic.mean for row in rows}) > 1


def _tiles(sweep: Sweep, ordered: Sequence[str]) -> Iterator[Tile]:
    """Where the most telling measures are largest."""
    telling = [name for name in ordered if name in (sweep.question.measure, *TELLING) and _varies(sweep.valued(name))]
    for measure in telling[:TILES]:
        row = max(sweep.valued(measure), key=lambda row: row.statistic.mean)
        label, unit = split_unit(measure)
        mean, half = with_error(row.statistic.mean, half_width(row))
        sure = count_of(row) >= FEWEST and half
        spread = f"± {half} (95 %), " if sure else ""
        yield Tile(
            f"largest {label}",
            mean if sure else number(row.statistic.mean),
            unit,
            f"{spread}at {point_text(row.point)}",
        )


def _keys_table(sweep: Sweep) -> Table:
    """Every varied key with its values."""
    rows = []
    for key in sweep.keys:
        values = values_of(sweep.rows, key)
        numbers = [value for value in values if isinstance(value, float)]
        listed = ", ".join(value_text(value, 4) for value in values[:MOST_VALUES])
        if len(values) > MOST_VALUES:
            listed = f"{value_text(min(numbers), 4)} to {value_text(max(numbers), 4)}" if numbers else f"{listed}, ..."
        rows.append((key, split_unit(key)[1], str(len(values)), listed))
    return Table("", ("varied key", "unit", "values", "which"), tuple(rows))


def _extremes(sweep: Sweep, ordered: Sequence[str]) -> Table:
    """Smallest and largest mean of every measure."""
    rows: list[tuple[str, ...]] = []
    for measure in ordered:
        valued_rows = sweep.valued(measure)
        if not valued_rows:
            rows.append((measure_label(measure), "no value", "", "", "", "0"))
            continue
        low, high = (pick(valued_rows, key=lambda row: row.statistic.mean) for pick in (min, max))
        ends = [(_with_se(row), point_text(row.point)) for row in ((low, high) if _varies(valued_rows) else (low,))]
        cells = [text for end in ends for text in end]
        if len(ends) == 1:
            cells = [cells[0], "everywhere", "", ""]
        rows.append((measure_label(measure), *cells, str(len(valued_rows))))
    return Table("", ("measure", "smallest mean ± SE", "at", "largest mean ± SE", "at", "points"), tuple(rows))


def _with_se(row: Row) -> str:
    mean, se = with_error(row.statistic.mean, row.statistic.se)
    return f"{mean} ± {se}" if se not in ("", "0") else mean


def _values(sweep: Sweep, ordered: Sequence[str]) -> Iterator[Block]:
    """All values, a folded table for each measure, as far as a page should hold them."""
    remaining = MOST_ROWS
    inputs = ("90 % over inputs", "SD of inputs", "SD of seeds") if sweep.uncertain else ()
    head = (*(key_label(key) for key in sweep.keys), "mean", "SE", "95 % interval", *inputs, "n", "seeds", "failed")
    for place, measure in enumerate(ordered):
        rows = sweep.of(measure)
        remaining -= len(rows)
        if remaining < 0:
            yield Text(
                f"The values of {len(ordered) - place} more measures are not listed here; {CSV} has them.", "note"
            )
            return
        cells = tuple(
            (*(value_text(value) for value in row.point.values()), *_cells(row), str(row.seeds), str(row.failed))
            for row in rows
        )
        table = Table("", head, cells, len(sweep.keys))
        yield Folded(f"{measure_label(measure)}: all {len(rows)} points", (table,))


def _cells(row: Row) -> tuple[str, ...]:
    mean, se, interval, _ = statistic_cells(row.statistic.as_dict() | {"n": count_of(row)})
    n = str(row.statistic.n)
    if row.spread is None:
        return mean, se, interval, n
    spread = row.spread
    over = spread.separation_reason
    if spread.is_separated:
        over = f"{number(spread.inputs_low)} to {number(spread.inputs_high)}"
    return mean, se, interval, over, number(spread.sd_inputs, 2), number(spread.sd_seeds, 2), n
