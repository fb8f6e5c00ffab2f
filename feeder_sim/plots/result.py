"""Plots of a result into given axes: paths on the plate, ways to the node, counts of stages, bounce intervals."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from feeder_sim.document.figure import MM, MS
from feeder_sim.measures.bounces import BounceFindings
from feeder_sim.measures.separation import SeparationFindings
from feeder_sim.plots.intervals import draw_over_time
from feeder_sim.records.recording import PlateRecord
from feeder_sim.records.trajectory import Frames
from feeder_sim.scene.cell import PASSAGE_FROM, PASSAGE_TO

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PATH_POINTS = 2000  # of a path that are drawn, at most
STAGE_COUNTS = {"on_plate": "on the plate", "on_nodal_line": "on nodal lines", "isolated": "isolated"}


def draw_paths(axes: Axes, plate: PlateRecord, seeds: Sequence[Frames]) -> Axes:
    """The paths of all parts of some seeds, from circles to dots, over nodal lines and the outline of the plate."""
    for nodal_line in plate.nodal_lines:
        axes.plot(*(nodal_line.T * MM), color="0.6", linewidth=1.0, zorder=1)
    x, y = 0.5 * plate.length * MM, 0.5 * plate.width * MM
    rings = plate.outline.rings if plate.outline is not None else [np.array([[x, y], [-x, y], [-x, -y], [x, -y]]) / MM]
    for ring in rings:
        axes.plot(*(np.vstack([ring, ring[:1]]).T * MM), color="black", linewidth=1.0)
    for seed in seeds:
        sampled = seed[slice(None, None, max(1, len(seed) // PATH_POINTS))]
        places = np.where(sampled.present[..., None], sampled.position[..., :2], np.nan) * MM
        for part in range(places.shape[1]):
            (line,) = axes.plot(*places[:, part].T, linewidth=0.8)
            path = places[np.isfinite(places[:, part, 0]), part]
            if len(path):
                axes.plot(*path[0], "o", markersize=3, fillstyle="none", color=line.get_color())
                axes.plot(*path[-1], "o", markersize=3, color=line.get_color())
    axes.set(aspect="equal", xlabel="x (mm)", ylabel="y (mm)")
    return axes


def draw_ways(
    axes: Axes,
    seeds: Sequence[Frames],
    distance: Callable[[Frames], NDArray[np.float64]],
    *,
    counted: Sequence[bool],
) -> Axes:
    """Distance from the nodal line over time, as `draw_over_time` draws it; `distance` has values (n,) of a seed."""
    for level in (PASSAGE_FROM, PASSAGE_TO):
        axes.axhline(level, color="0.6", linewidth=0.8, linestyle="--")
    draw_over_time(axes, seeds, distance, counted=counted)
    axes.set(xlabel="time (s)", ylabel="distance from node over that of antinode", ylim=(0.0, None))
    axes.legend()
    return axes


def draw_stages(axes: Axes, findings: SeparationFindings) -> Axes:
    """Counts at the ends of the stages that were reached, means with standard errors over the seeds."""
    stages = [stage for stage in findings.stages if stage.end_s.n]
    for name, label in STAGE_COUNTS.items():
        counts = [getattr(stage, name) for stage in stages]
        error = [np.nan_to_num(count.se) for count in counts]
        end = [stage.end_s.mean for stage in stages]
        axes.errorbar(end, [count.mean for count in counts], error, marker="o", markersize=3, capsize=2, label=label)
    axes.set(xlabel="end of the stage (s)", ylabel="parts", ylim=(0.0, None))
    axes.legend()
    return axes


def draw_intervals(axes: Axes, intervals: Sequence[NDArray[np.float64]], findings: BounceFindings) -> Axes:
    """Histogram of bounce intervals (n,) [s] of all seeds, with their mean."""
    axes.hist(np.concatenate([*intervals, np.empty(0)]) * MS, bins=40, color="0.6")
    if findings.bounce_interval_ms.n:
        mean = findings.bounce_interval_ms.mean
        axes.axvline(mean, color="black", linewidth=1.0, label=f"mean {mean:.3g} ms")
        axes.legend()
    axes.set(xlabel="bounce interval (ms)", ylabel="bounces")
    return axes
