"""Picture of the restitution of balls by Zener's theory over their size."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from feeder_sim.plate.materials import Material
from feeder_sim.plate.rectangle import RectangularPlate
from feeder_sim.plots.figure import empty_figure
from feeder_sim.studies.validation.zener_prediction import restitution_over_size

COLOURS = ("#3a60be", "#3a8a5a", "#be3434")


def draw_zener(ball: Material, plate: RectangularPlate, speeds: Sequence[float], marked: float, path: Path) -> None:
    """Draw restitution over diameter / thickness at up to three speeds [m/s], one ratio marked."""
    figure = empty_figure(5.2, 3.4)
    axes = figure.subplots()
    ratios = np.geomspace(0.1, 8.0, 60)
    for speed, colour in zip(speeds, COLOURS, strict=False):
        axes.semilogx(ratios, restitution_over_size(ball, plate, ratios, speed), color=colour, label=f"{speed:g} m/s")
    axes.axvline(marked, color="gray", linewidth=0.8, linestyle="--")
    axes.set(xlabel="diameter of the ball / thickness of the plate", ylabel="restitution", ylim=(0.0, 1.0))
    axes.grid(True, alpha=0.3, which="both")
    axes.legend(fontsize=8)
    figure.savefig(path, dpi=110)
