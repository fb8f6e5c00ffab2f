"""Picture of a nut that was steered along a letter: the path wanted, the path taken, and nodal lines of its pulses."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from feeder_sim.plots.figure import empty_figure
from feeder_sim.scene.scene import Scene

if TYPE_CHECKING:
    from feeder_sim.studies.closed_loop.letter import Way

SHOWN_MODES = 4  # whose nodal lines are drawn, those that were used most
MARGIN = 0.012  # [m] around the letter


def letter_picture(scene: Scene, way: Way, file: Path) -> None:
    """Draw a way.

    Args:
        scene: of the feeder, with all stages in its schedule.
        way: of the nut.
        file: picture to write.
    """
    schedule = scene.scenario.schedule
    assert schedule is not None
    low, high = way.wanted.min(axis=0) - MARGIN, way.wanted.max(axis=0) + MARGIN
    picture = empty_figure(5.0, 5.0 * float((high - low)[1] / (high - low)[0]))
    axes = picture.add_subplot()
    x, y = (np.linspace(low[k], high[k], 161) for k in (0, 1))
    points = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    shapes = scene.surface.deflections(points)
    firsts = np.concatenate([[0], np.cumsum([len(stage.drive) for stage in schedule.stage])])
    for name, _ in Counter(way.stages).most_common(SHOWN_MODES):
        number = schedule.stage_names.index(name)
        drives = scene.drives[firsts[number] : firsts[number + 1]]
        w = sum(drive.amplitude * np.cos(drive.phase) * shapes[drive.shape] for drive in drives)
        axes.contour(1e3 * x, 1e3 * y, np.reshape(w, (len(x), len(y))).T, levels=[0.0], colors="0.85", linewidths=1.0)
    axes.plot(*(1e3 * way.wanted.T), color="tab:orange", linewidth=5.0, alpha=0.4, solid_joinstyle="round")
    axes.plot(*(1e3 * way.places.T), color="tab:blue", linewidth=1.0, marker=".", markersize=2.5)
    axes.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal")
    axes.set_title(
        f"{way.length_mm:.0f} mm in {way.time:.0f} s and {len(way.stages)} pulses: "
        f"{way.mean_deviation_mm:.2f} mm off, at most {way.largest_deviation_mm:.2f} mm",
        fontsize=9,
    )
    picture.savefig(file, dpi=150)
