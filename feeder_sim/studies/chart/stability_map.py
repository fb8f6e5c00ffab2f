"""Where methods fail: all maps over two settings whose cells are stable, biased, exploding or tunnelling."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path

from feeder_sim.studies.chart.data_files import write_rows
from feeder_sim.studies.chart.engine_maps import ENGINE_MAPS
from feeder_sim.studies.chart.map_cells import MapCell, StabilityMap
from feeder_sim.studies.chart.walker_maps import WALKER_MAPS

MAPS: tuple[StabilityMap, ...] = (*ENGINE_MAPS, *WALKER_MAPS)


def fill(
    maps: Sequence[StabilityMap] = MAPS, *, quick: bool, note: Callable[[str], None] = lambda _: None
) -> list[MapCell]:
    """Compute every cell of the maps.

    Args:
        maps: to compute.
        quick: few seeds and few values of the settings.
        note: called with a line about each finished cell.
    """
    cells: list[MapCell] = []
    for stability_map in maps:
        for y in stability_map.y.quick if quick else stability_map.y.values:
            for x in stability_map.x.quick if quick else stability_map.x.values:
                state, deviation, why = stability_map.judge(x, y, quick=quick)
                cells.append(MapCell(stability_map.name, x, y, state, deviation.mean, deviation.se, why))
                note(
                    f"{stability_map.title}, {stability_map.x.label} {x:g}, "
                    f"{stability_map.y.label} {y:g}: {state} {why}"
                )
    return cells


def write_cells(cells: Sequence[MapCell], folder: Path) -> None:
    """Write the cells of all maps as CSV and as JSON."""
    write_rows([asdict(cell) for cell in cells], folder, "stability")
