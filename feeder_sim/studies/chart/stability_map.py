"""Where methods fail: all maps over two settings whose cells are stable, biased, exploding or tunnelling."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path

from feeder_sim.studies.chart.data_files import Row, finite_rows, write_rows
from feeder_sim.studies.chart.engine_maps import ENGINE_MAPS
from feeder_sim.studies.chart.map_cells import MapCell, StabilityMap
from feeder_sim.studies.chart.shares import Show, no_progress, shares
from feeder_sim.studies.chart.walker_maps import WALKER_MAPS, WalkerMap, table_cost

MAPS: tuple[StabilityMap, ...] = (*ENGINE_MAPS, *WALKER_MAPS)


def fill(
    maps: Sequence[StabilityMap] = MAPS,
    *,
    quick: bool,
    note: Callable[[str], None] = lambda _: None,
    progress: Show = no_progress,
) -> list[MapCell]:
    """Compute every cell of the maps.

    Args:
        maps: to compute.
        quick: few seeds and few values of the settings.
        note: called with a line about each finished cell.
        progress: called with the fraction done.
    """
    wanted = [(of, x, y) for of in maps for x, y in of.settings(quick=quick)]
    tables = {of.table for of in maps if isinstance(of, WalkerMap) and of.table}
    costs = [of.cost(x, y, quick=quick) for of, x, y in wanted]
    pieces = shares(progress, [*(table_cost(quick=quick) for _ in tables), *costs])
    for make_table in tables:
        make_table(quick, pieces.pop(0))
    cells: list[MapCell] = []
    for (of, x, y), show in zip(wanted, pieces, strict=True):
        state, deviation, why = of.judge(x, y, quick=quick)
        cells.append(MapCell(of.name, x, y, state, deviation.mean, deviation.se, why))
        show(1.0)
        note(f"{of.title}, {of.x.label} {x:g}, {of.y.label} {y:g}: {state} {why}")
    return cells


def rows_of(cells: Sequence[MapCell]) -> list[Row]:
    """The cells of all maps as JSON takes them."""
    return finite_rows(asdict(cell) for cell in cells)


def count_states(cells: Sequence[MapCell]) -> dict[str, int]:
    """How many cells have which state, by the names of the states."""
    return {state: sum(cell.state == state for cell in cells) for state in sorted({str(cell.state) for cell in cells})}


def write_cells(cells: Sequence[MapCell], folder: Path) -> None:
    """Write the cells of all maps as CSV and as JSON."""
    write_rows(rows_of(cells), folder, "stability")
