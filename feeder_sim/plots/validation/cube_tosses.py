"""Picture of measured tosses of a cube: computed and measured ends, errors, and error over cost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from feeder_sim.plots.figure import MM, empty_figure
from feeder_sim.studies.validation.cube_tosses import EDGE_MM, TossStudy

DRAWN = 24  # tosses in the plan view
COLOURS = {"impulse": "#c23030", "mujoco": "#1f5fa8", "Bullet": "#6b8e23", "plain MuJoCo": "#5fa4d8"}
OTHERS = "#8b5a2b"
LARGEST_MM = 200.0
COSTS = (1e-3, 1.0)  # [s/s]


def draw_tosses(studies: Mapping[str, TossStudy], points: Sequence[Mapping[str, str]], path: Path) -> None:
    """Draw the tosses of studies by the name of their engine.

    `points`: rows with `engine`, `steps_per_ms`, `median_error_mm` and `processor_s_per_s`.
    """
    figure = empty_figure(13.0, 4.6)
    plan, share, cost = figure.subplots(1, 3, width_ratios=[1.25, 1, 1])
    first = next(iter(studies.values()))
    every = max(1, len(first.start) // DRAWN)
    for start, end in zip(MM * first.start[::every], MM * first.measured[::every], strict=True):
        plan.plot([start[0], end[0]], [start[1], end[1]], color="#bbbbbb", linewidth=0.8, zorder=1)
    measured = MM * first.measured[::every]
    plan.plot(measured[:, 0], measured[:, 1], "o", color="black", markersize=6, fillstyle="none", label="measured")
    for name, study in studies.items():
        colour = COLOURS.get(name, OTHERS)
        computed = MM * study.computed[::every]
        plan.plot(computed[:, 0], computed[:, 1], ".", color=colour, markersize=5, label=name)
        error = np.sort(MM * study.error)
        share.plot(error, np.arange(1, len(error) + 1) / len(error), color=colour, label=name)
    plan.set(xlabel="x (mm)", ylabel="y (mm)", title=f"Ends of every {every}th toss, from above", aspect="equal")
    plan.legend(fontsize=8, loc="upper left")
    share.axvline(EDGE_MM, color="#999999", linewidth=0.8, linestyle=":")
    share.annotate("edge of the cube", (1.02 * EDGE_MM, 0.5), fontsize=8, color="#777777")
    share.set(xlim=(0.0, LARGEST_MM), ylim=(0.0, 1.0), xlabel="error of the last place (mm)", ylabel="share of tosses")
    share.set_title("How far off")
    share.legend(fontsize=8, loc="lower right")
    for name in dict.fromkeys(row["engine"] for row in points):
        rows = [row for row in points if row["engine"] == name]
        x, y = ([float(row[key]) for row in rows] for key in ("processor_s_per_s", "median_error_mm"))
        span = " to ".join(dict.fromkeys(f"{float(row['steps_per_ms']):g}" for row in (rows[0], rows[-1])))
        cost.plot(x, y, "o-", color=COLOURS.get(name, OTHERS), markersize=4, label=f"{name}, {span} steps per ms")
    cost.set(xscale="log", xlabel="processor time per simulated second (s)", ylabel="median error (mm)")
    cost.set_title("Speed against accuracy")
    cost.set(xlim=COSTS)
    cost.set_ylim(0.0, 1.25 * max(float(row["median_error_mm"]) for row in points))
    cost.legend(fontsize=8)
    for axes in (share, cost):
        axes.grid(True, alpha=0.3)
    figure.savefig(path, dpi=130)
