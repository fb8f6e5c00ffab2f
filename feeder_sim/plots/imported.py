"""A sheet of imported modes: the points as they were given beside the smooth shape that was fitted to them."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from feeder_sim.plate.imported.modes import Imported
from feeder_sim.plots.outline import cut_to_plate

MM = 1e3
GRID = 241
PAIRS = 2  # of panels in a row
COLOURS = {"cmap": "RdBu_r"}
POINTS = {"linewidths": 0.15, "edgecolors": "0.4"}  # so that those near a node show on white


def draw_imported(imported: Imported, path: Path) -> None:
    """Draw every mode twice, as points and as a smooth shape with nodal lines; `path` says the type of file."""
    from matplotlib.figure import Figure

    modes, outline = imported.mode_file.modes, imported.outline
    columns = min(PAIRS, len(modes))
    rows = math.ceil(len(modes) / columns)
    length, width = outline.size
    panel = 2.5
    height = min(max(panel * width / length, 0.8), 3.0 * panel)
    figure = Figure(figsize=(2.0 * panel * columns + 0.9, rows * (height + 0.25) + 0.1), layout="constrained")
    axes = figure.subplots(rows, 2 * columns, squeeze=False)
    shown: Any = None
    for axis in axes.ravel():
        axis.set_axis_off()
    for i in range(len(modes)):
        points, shape = axes[i // columns, 2 * (i % columns) : 2 * (i % columns) + 2]
        shown = _draw_pair(points, shape, imported, i)
    figure.suptitle(f"{length * MM:.4g} x {width * MM:.4g} mm, {len(imported.points)} points", fontsize=9)
    figure.colorbar(shown, ax=axes, label="deflection, antinode = 1", ticks=[-1, 0, 1], shrink=min(1.0, 2.5 / rows))
    figure.savefig(path, dpi=150)


def _draw_pair(points: Any, shape: Any, imported: Imported, i: int) -> Any:
    modes, outline = imported.mode_file.modes, imported.outline
    length, width = outline.size
    x, y = np.linspace(-0.5, 0.5, GRID) * length, np.linspace(-0.5, 0.5, GRID) * width
    w = modes.evaluate_grid(i, x, y)[0]
    dot = 6e3 / max(len(imported.points), 100)
    points.scatter(*(imported.points.T * MM), c=imported.values[i], s=dot, vmin=-1.0, vmax=1.0, **POINTS, **COLOURS)
    filled = shape.contourf(x * MM, y * MM, w.T, levels=np.linspace(-1.0, 1.0, 41), extend="both", **COLOURS)
    lines = shape.contour(x * MM, y * MM, w.T, levels=[0.0], colors="black", linewidths=1.2)
    cut_to_plate(shape, outline, filled, lines)
    cut_to_plate(points, outline)
    quality = imported.quality[i]
    points.set_title(f"mode {i + 1}: {modes.natural_frequency[i]:.0f} Hz, points", fontsize=8)
    shape.set_title(f"fitted, residual {quality.residual:.1g}", fontsize=8)
    for axes in (points, shape):
        margin = 0.02 * max(length, width) * MM
        axes.set(
            aspect="equal",
            xlim=(-0.5 * length * MM - margin, 0.5 * length * MM + margin),
            ylim=(-0.5 * width * MM - margin, 0.5 * width * MM + margin),
        )
    return filled
