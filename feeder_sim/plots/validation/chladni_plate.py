"""Picture of the plate that steers balls: steps over amplitude, and their length over the distance to the node."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from feeder_sim.plots.figure import MM, UM, empty_figure
from feeder_sim.studies.validation.chladni_plate import Steps
from feeder_sim.studies.validation.chladni_report import BIN_EDGES, profile, together

MAP_POINTS = 161  # per axis
MAGNIFIED = 10.0  # arrows over steps


def save_chladni_plate(shown: Sequence[Steps], every: Sequence[Steps], path: Path) -> None:
    """Draw the steps of some notes over the amplitude, and the profile of all; the suffix of `path` says how."""
    figure = empty_figure(4.3 * len(shown) + 4.4, 4.2)
    panels = figure.subplots(1, len(shown) + 1)
    for axes, steps in zip(panels[:-1], shown, strict=True):
        filled = _draw_steps(axes, steps)
        figure.colorbar(filled, ax=axes, label="amplitude (um)", shrink=0.8)
    _draw_profile(panels[-1], every)
    figure.savefig(path, dpi=110)


def _draw_steps(axes: Any, steps: Steps) -> Any:
    """Arrows from the start points over the amplitude of the plate, with the nodal lines of its larger part."""
    parts = steps.field.parts
    x, y = (np.linspace(-0.5, 0.5, MAP_POINTS) * side for side in (parts.plate.length, parts.plate.width))
    real, imaginary = (parts.evaluate_grid(i, x, y)[0] for i in range(2))
    amplitude = steps.amplitude * np.hypot(real, imaginary)
    filled = axes.contourf(x * MM, y * MM, amplitude.T * UM, levels=12, cmap="Blues")
    axes.contour(x * MM, y * MM, real.T, levels=[0.0], colors="#be3434", linewidths=1.2)
    axes.quiver(
        *(steps.start.T * MM),
        *(steps.step.T * MM * MAGNIFIED),
        angles="xy",
        scale_units="xy",
        scale=1.0,
        width=0.0045,
        color="black",
    )
    axes.set(
        aspect="equal",
        xlabel="x (mm)",
        ylabel="y (mm)",
        title=f"{steps.note:g} Hz: steps x {MAGNIFIED:g}, nodal lines red",
    )
    return filled


def _draw_profile(axes: Any, every: Sequence[Steps]) -> None:
    """Length of the steps, of grad A^2 and of grad A over the distance to the node, of all notes."""
    points = together([profile(steps) for steps in every])
    means = points.binned()
    middle = 0.5 * (BIN_EDGES[:-1] + BIN_EDGES[1:])
    inside = points.distance <= BIN_EDGES[-1]
    axes.plot(points.distance[inside], points.step[inside], ".", color="0.8", markersize=2, label="steps, all notes")
    axes.plot(middle, means["step"], "o-", color="black", label="their mean")
    axes.plot(middle, means["slope"], "^--", color="#3a60be", label="mean of |grad A|")
    axes.plot(middle, means["gradient"], "s--", color="#be3434", label="mean of |grad A$^2$|")
    axes.set(
        xlim=(0.0, BIN_EDGES[-1]),
        ylim=(0.0, 3.0),
        xlabel="distance to the node over a quarter wavelength",
        ylabel="length over its mean on the plate",
        title="Length of the steps",
    )
    axes.legend(fontsize=8, loc="upper left", framealpha=1.0)
