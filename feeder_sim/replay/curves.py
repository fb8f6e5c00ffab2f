"""The plots in a replay: distance, height and velocity of one part; of many their numbers, or their mean x."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from feeder_sim.measures.picking import nearest_neighbours
from feeder_sim.plate.nodal_lines import NodalLines
from feeder_sim.records.seed import Cause
from feeder_sim.records.trajectory import Frames
from feeder_sim.replay.colours import NUT
from feeder_sim.replay.scenery import MM, TIMELINE, Curve, Plot, Times
from feeder_sim.replay.seed_view import SeedView

OTHER_SEEDS = (150, 150, 150, 140)
COUNTS = {
    "picked": (40, 160, 60),
    "through_outlets": (179, 89, 0),
    "lost": (190, 60, 60),
    "on_the_plate": (120, 120, 130),
    "isolated": (40, 90, 190),
}
WINDOW_S = 1.0  # of the plots of a guided part, whose hops are many


def part_plots(view: SeedView) -> list[Plot]:
    """Of one part: its distance to the nearest nodal line in all seeds, its height, and its velocity in a guide."""
    lines, guided, frames = NodalLines(view.plate.nodal_lines), view.guide is not None, view.record.frames
    height, velocity = frames.position[:, 0, 2], frames.velocity[:, 0, 2]

    def plot(name: str, title: str, largest: float, values: Callable[[Frames], NDArray[np.float64]]) -> Plot:
        # A plot narrower than the record must not average the hops away.
        curves = _of_seeds(view, title, values, every=guided, alone=name != "distance_mm")
        caption, signed = f"{title.capitalize()}: shown seed orange, others grey", name == "velocity_mm_s"
        return Plot(f"plots/{name}", caption, curves, largest, signed, WINDOW_S if guided else None)

    def distance(seed: Frames) -> NDArray[np.float64]:
        return lines.distance(seed.position[:, 0, :2]) * MM

    plots = []
    if lines.lines:
        farthest = float(lines.distance(view.plate.antinode[None])[0]) * MM
        plots.append(plot("distance_mm", "distance to the nodal line (mm)", farthest, distance))
    if guided:
        fastest = float(np.abs(velocity).max()) * MM
        plots.append(plot("velocity_mm_s", "vertical velocity (mm/s)", fastest, lambda _: velocity * MM))
    highest = float(np.ptp(height)) * MM
    plots.append(plot("height_mm", "height above rest (mm)", highest, lambda _: (height - height.min()) * MM))
    return plots


def crowd_plot(view: SeedView, times: Times) -> Plot:
    """Of many parts: their mean x in all seeds where there is a goal, else their numbers."""
    if view.scenario.goal is not None:
        curves = _of_seeds(view, "mean x of the parts (mm)", lambda seed: seed.position[..., 0].mean(axis=1) * MM)
        title = f"x (mm): shown seed orange, others grey; the goal is {view.scenario.goal.x_mm:g}"
        return Plot("counts", title, curves)
    curves = [
        Curve(name, name.replace("_", " "), COUNTS[name], 2.0, values.astype(float), times)
        for name, values in _numbers(view).items()
    ]
    return Plot("counts", "Parts picked, through outlets, lost, on the plate, isolated", curves, legend=True)


def _of_seeds(
    view: SeedView,
    name: str,
    values: Callable[[Frames], NDArray[np.float64]],
    *,
    every: bool | None = None,
    alone: bool = False,
) -> list[Curve]:
    """A curve of the seed, and one of each other seed unless it is alone."""
    curves = []
    for seed, frames in enumerate(view.recording.seeds):
        times = {TIMELINE: frames.time}
        if seed == view.seed:
            curves.append(Curve("shown", name, NUT, 2.0, values(frames), times, every))
        elif not alone:
            path = f"others/seed_{seed:03d}"
            curves.append(Curve(path, f"seed {seed}", OTHER_SEEDS, 1.0, values(frames), times, every))
    return curves


def _numbers(view: SeedView) -> dict[str, NDArray[np.int64]]:
    """Parts picked, lost and on the plate, each (frames,); through outlets, and isolated, where the scenario says."""
    frames, removals = view.record.frames, view.record.removals
    picked, lost, through = (
        np.searchsorted(np.sort(removals.time[removals.cause == cause]), frames.time, side="right")
        for cause in (Cause.PICKED, Cause.LOST, Cause.OUTLET)
    )
    on_plate = frames.on_plate(view.plate, -view.plate.trough)
    numbers = {"picked": picked, "lost": lost, "on_the_plate": on_plate.sum(axis=1)}
    numbers |= {"through_outlets": through} if view.plate.outlets else {}
    clearance = next((stage.clearance for stage in view.times.stages if stage.clearance is not None), None)
    if clearance is not None:
        nearest = [nearest_neighbours(p[parts, :2]) for p, parts in zip(frames.position, on_plate, strict=True)]
        numbers["isolated"] = np.array([(distance > clearance).sum() for distance in nearest])
    return numbers
