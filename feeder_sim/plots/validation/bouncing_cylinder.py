"""Picture of the cylinder on a standing wave: its way to the node, and speeds by several methods."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from feeder_sim.plots.figure import MM, MS, empty_figure
from feeder_sim.studies.validation.bouncing_cylinder import METHODS, Setting, Speeds

STYLES = {  # colour and marker
    "rules": ("black", "s"),
    "newton": ("#8a8a8a", "v"),
    "engine": ("#3a60be", "o"),
    "cylinder": ("#7fa6e0", "D"),
    "rules_in_plane": ("#be3434", "s"),
    "vertices_in_plane": ("#d98080", "v"),
    "engine_in_plane": ("#e08a1e", "o"),
    "cylinder_in_plane": ("#f2c078", "D"),
}
SHOWN = ("rules", "engine", "rules_in_plane", "engine_in_plane")  # ways


def draw_bouncing_cylinder(found: Sequence[tuple[Setting, dict[str, Speeds]]], path: Path) -> None:
    """Draw the mean way at the first setting with its standard deviation, and the speeds at all settings."""
    figure = empty_figure(10.5, 4.8)
    left, right = figure.subplots(1, 2, width_ratios=[1.0, 1.75])
    setting, speeds = found[0]
    for method in SHOWN:
        way, time = speeds[method].place * MM, speeds[method].time * MS
        mean, spread, colour = way.mean(axis=0), way.std(axis=0), STYLES[method][0]
        left.plot(time, mean, color=colour, label=METHODS[method])
        left.fill_between(time, mean - spread, mean + spread, color=colour, alpha=0.15, linewidth=0)
    left.axhline(0.0, color="0.6", linewidth=0.8)
    left.text(time[-1], 0.01, "node", fontsize=8, color="0.4", ha="right", va="bottom")
    left.set(xlabel="time (ms)", ylabel="from the node (mm)", xlim=(0.0, time[-1]))
    left.set_title(setting.name, fontsize=9)
    left.legend(fontsize=7, loc="lower left", bbox_to_anchor=(0.0, 0.06))
    rows = np.arange(len(found))
    for i, (method, (colour, marker)) in enumerate(STYLES.items()):
        statistics = [each[method].speed_mm_s for _, each in found]
        at = rows + 0.1 * (i - 3.5)
        mean, se = [s.mean for s in statistics], [s.se for s in statistics]
        right.errorbar(mean, at, xerr=se, fmt=marker, color=colour, markersize=4, label=METHODS[method])
    for row, (each, _) in zip(rows, found, strict=True):
        label = "published program" if row == 0 else None
        right.plot([each.speed * MM] * 2, [row - 0.42, row + 0.42], color="#3a8a5a", linewidth=2.0, label=label)
    right.set_yticks(rows, [each.name for each, _ in found], fontsize=8)
    right.invert_yaxis()
    right.set(xlabel="speed (mm/s), negative toward the node")
    right.grid(True, axis="x", alpha=0.3)
    figure.legend(*right.get_legend_handles_labels(), fontsize=7, loc="outside lower center", ncols=4)
    figure.savefig(path, dpi=150)
