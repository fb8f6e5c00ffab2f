"""Pictures of a drift map: what its tables have in common, and where it begins to be wrong."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from feeder_sim.plots.figure import empty_figure
from feeder_sim.scene.scene import GRAVITY
from feeder_sim.studies.drift_map.borders import BorderPoint
from feeder_sim.studies.drift_map.drift_map import DriftMap

MIDDLE = slice(8, 20)  # of 24 bins: 30 to 75 degrees from the antinode
NEAR_ANTINODE = slice(0, 6)
COLOURS = ("#3a60be", "#3a8a5a", "#e08a1e", "#be3434", "#7a4aa0", "#555555")


def draw_laws(drift_map: DriftMap, path: Path, *, title: str) -> None:
    """Draw drift and diffusion without units over the velocity amplitude, a curve for each frequency."""
    angle = (np.arange(drift_map.drift.shape[2]) + 0.5) * 0.5 * math.pi / drift_map.drift.shape[2]
    share = drift_map.drift[..., MIDDLE] / np.sin(angle[MIDDLE])
    error = np.sqrt((drift_map.drift_se[..., MIDDLE] ** 2).sum(axis=2)) / share.shape[2]
    spread = 0.5 * (drift_map.along + drift_map.across)[..., NEAR_ANTINODE].mean(axis=2)
    figure = empty_figure(9.0, 4.0)
    left, right = figure.subplots(1, 2)
    for i, frequency in enumerate(drift_map.frequency):
        throws = 2.0 * math.pi * frequency * drift_map.speed / GRAVITY > 1.0
        how = {"color": COLOURS[i % len(COLOURS)], "marker": "o", "markersize": 3, "label": f"{frequency:g} Hz"}
        speed = drift_map.speed[throws]
        left.errorbar(speed, share[i].mean(axis=1)[throws], 2.0 * error[i][throws], capsize=2, **how)
        right.plot(speed, spread[i][throws], **how)
    left.set(xscale="log", ylim=(0.0, 2.0), ylabel="drift / (omega s h/2), 30 to 75 degrees from the antinode")
    right.set(xscale="log", yscale="log", ylabel="diffusion D g / V^3, near the antinode")
    for axes in (left, right):
        axes.set(xlabel="velocity amplitude V of the antinode (m/s)")
        axes.grid(True, alpha=0.3)
    left.legend(fontsize=8)
    figure.suptitle(title)
    figure.savefig(path, dpi=150)


def draw_borders(
    strip: Sequence[BorderPoint], plate: Sequence[BorderPoint], crowd: Sequence[BorderPoint], path: Path
) -> None:
    """Draw the error over the velocity amplitude, and the gathering over time by full runs and by the map."""
    figure = empty_figure(12.0, 4.0)
    error, alone, many = figure.subplots(1, 3)
    for points, label, colour in ((strip, "transport speed, strip", "#3a60be"), (plate, "gathered, plate", "#be3434")):
        speeds = [p.setting for p in points]
        off, se = ([getattr(p.agreement, name) for p in points] for name in ("error_percent", "error_se_percent"))
        error.errorbar(speeds, off, 2.0 * np.array(se), fmt="o-", color=colour, capsize=3, label=label)
    error.axhline(0.0, color="0.6", linewidth=0.8)
    error.set(
        xscale="log", xlabel="velocity amplitude of the highest antinode (m/s)", ylabel="map over full runs - 1 (%)"
    )
    error.set_ylim(-60, 60)
    error.legend(fontsize=8)
    for axes, points, text in ((alone, plate, "{:.2f} m/s"), (many, crowd, "{:.0f} parts")):
        for i, p in enumerate(points):
            if p.gathering is not None:
                colour = COLOURS[i % len(COLOURS)]
                axes.plot(p.gathering.time, p.gathering.full, color=colour, label=text.format(p.setting))
                axes.plot(p.gathering.time, p.gathering.walked, color=colour, linestyle="--")
        axes.set(xlabel="time (s)", ylabel="share within 5 mm of nodal lines", ylim=(0.0, 1.0))
        axes.legend(fontsize=7)
        axes.grid(True, alpha=0.3)
    alone.set_title("one part at a time; dashed: map", fontsize=9)
    many.set_title("many parts at once; dashed: map", fontsize=9)
    figure.savefig(path, dpi=150)
