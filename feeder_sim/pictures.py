"""Pictures of mode shapes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from feeder_sim.plate.modes import PlateModes

MM = 1e3


def draw_mode(modes: PlateModes, index: int, path: Path) -> None:
    """Draw the deflection of one mode (0-based index) with its nodal lines; the file type follows the suffix."""
    from matplotlib.figure import Figure

    plate = modes.plate
    x = np.linspace(-0.5, 0.5, 241) * plate.length
    y = np.linspace(-0.5, 0.5, 241) * plate.width
    w = modes.evaluate_grid(index, x, y)[0]
    figure = Figure(figsize=(5.6, 4.8), layout="constrained")
    axes = figure.add_subplot()
    levels = np.linspace(-1.0, 1.0, 41)
    filled = axes.contourf(x * MM, y * MM, w.T, levels=levels, cmap="RdBu_r", extend="both")
    axes.contour(x * MM, y * MM, w.T, levels=[0.0], colors="black", linewidths=1.4)
    figure.colorbar(filled, ax=axes, label="deflection, antinode = 1", ticks=[-1, -0.5, 0, 0.5, 1])
    axes.set(
        aspect="equal",
        xlabel="x (mm)",
        ylabel="y (mm)",
        title=f"Mode {index + 1}: {modes.natural_frequency[index]:.1f} Hz, nodal lines in black",
    )
    figure.savefig(path, dpi=150)
