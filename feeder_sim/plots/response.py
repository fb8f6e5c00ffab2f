"""Pictures of a plate's response: amplitude, current and power over the frequency; all mode shapes on one sheet."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from feeder_sim.document.figure import MM, UM, empty_figure
from feeder_sim.plate.mode_file import ModeFile
from feeder_sim.plate.response import Response

MOST_LABELS = 12  # peaks of a response that get one, the highest
SHEET_POINTS = 81  # per axis of a small mode shape
SHEET_COLUMNS = 8


def draw_response(response: Response, path: Path, *, title: str, point: tuple[float, float] | None) -> None:
    """Draw amplitude, current and power over the frequency, with the highest peaks named."""
    figure = empty_figure(9.0, 6.4)
    top, middle, bottom = figure.subplots(3, 1, sharex=True, height_ratios=[3, 1, 1])
    top.semilogy(response.frequency, response.amplitude * UM, color="#3a60be", linewidth=1.0)
    resonant = [peak for peak in response.peaks if not math.isnan(peak.damping_ratio)]
    width = response.frequency[-1] - response.frequency[0]
    for peak in sorted(resonant, key=lambda peak: -peak.amplitude)[:MOST_LABELS]:
        at_end = peak.frequency > response.frequency[-1] - 0.1 * width
        top.plot(peak.frequency, peak.amplitude * UM, "o", color="#be3434", markersize=3)
        top.annotate(
            f"{peak.mode + 1}: {peak.frequency:.0f} Hz\n{peak.amplitude * UM:.3g} um",
            (peak.frequency, peak.amplitude * UM),
            xytext=(-3 if at_end else 3, 3),
            textcoords="offset points",
            fontsize=7,
            rotation=25,
            ha="right" if at_end else "left",
        )
    where = "largest on the plate" if point is None else f"at ({point[0] * MM:g}, {point[1] * MM:g}) mm"
    top.set(ylabel=f"amplitude (um), {where}", title=title)
    top.set_ylim(None, 6.0 * response.amplitude.max() * UM)
    middle.semilogy(response.frequency, np.abs(response.current.sum(axis=1)) * 1e3, color="#e08a1e", linewidth=1.0)
    middle.set(ylabel="current (mA)")
    bottom.semilogy(response.frequency, response.power, color="#3a8a5a", linewidth=1.0)
    bottom.set(ylabel="power (W)", xlabel="frequency (Hz)")
    for axes in (top, middle, bottom):
        axes.grid(True, alpha=0.3)
        axes.set_xlim(response.frequency[0], response.frequency[-1])
    figure.savefig(path, dpi=150)


def draw_gallery(held: ModeFile, path: Path) -> None:
    """Draw all mode shapes of a plate on one sheet, with nodal lines, actuators and measured frequencies."""
    modes = held.modes
    plate = modes.plate
    columns = min(SHEET_COLUMNS, len(modes))
    rows = math.ceil(len(modes) / columns)
    aspect = plate.width / plate.length
    figure = empty_figure(1.6 * columns, (1.6 * aspect + 0.35) * rows)
    grid = figure.subplots(rows, columns, squeeze=False).ravel()
    x, y = (np.linspace(-0.5, 0.5, SHEET_POINTS) * side for side in (plate.length, plate.width))
    measured = {resonance.mode: resonance.frequency for resonance in held.resonances}
    for index, axes in enumerate(grid):
        axes.set_axis_off()
        if index >= len(modes):
            continue
        w = modes.evaluate_grid(index, x, y)[0]
        axes.contourf(x * MM, y * MM, w.T, levels=np.linspace(-1.0, 1.0, 21), cmap="RdBu_r", extend="both")
        axes.contour(x * MM, y * MM, w.T, levels=[0.0], colors="black", linewidths=0.8)
        for actuator in held.actuators:
            _outline(axes, actuator.layer.corners() * MM)
        title = f"{index + 1}: {modes.natural_frequency[index]:.0f} Hz"
        if index in measured:
            title += f"\nmeasured {measured[index]:g}"
        axes.set_title(title, fontsize=6, color="#be3434" if index in measured else "black")
        axes.set_aspect("equal")
    figure.savefig(path, dpi=150)


def _outline(axes: Any, corners: Any) -> None:
    closed = np.vstack([corners, corners[:1]])
    axes.plot(closed[:, 0], closed[:, 1], color="#e08a1e", linewidth=1.0)
