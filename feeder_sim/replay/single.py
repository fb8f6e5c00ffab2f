"""One part in a replay: its pose, its path, its guide, and plots of its distance to the nodal line and its height."""

from __future__ import annotations

from typing import Any

import numpy as np

from feeder_sim.plate.nodal_lines import NodalLines
from feeder_sim.records.recording import Recording
from feeder_sim.records.trajectory import Frames
from feeder_sim.replay.labels import Box, plate_box
from feeder_sim.replay.layout import OBLIQUE, Style, layout, scene_eye
from feeder_sim.replay.parts import NUT, drawn_part, radius_of
from feeder_sim.replay.plate import MM, TIMELINE
from feeder_sim.replay.shadows import log_shadows
from feeder_sim.scenario import Start, parse_scenario
from feeder_sim.scene.scene import Guide, build_guide

LINE_GREY, PATH = (150, 150, 150), (30, 110, 60)
GLASS = (110, 160, 190)
GUIDE_HEIGHT = 18.0  # [mm], as drawn
GUIDE_AROUND = 6.0  # [mm], shown on each side of a guide
GUIDE_DIRECTION = (0.0, -1.0, 0.5)  # from a guide to the eye
WINDOW_S = 1.0  # of the plots of a guided part, whose hops are many
LARGE = 30.0  # side of a plate over the radius of a part, from which on only a cell of the plate is shown
CELL = 1.15  # of the way from antinode to nodal line, shown around antinode and way
NEARLY_ALL = 0.6  # of a side of the plate, from which on all of it is shown
PLOTS = {
    "distance_mm": "distance to the nodal line (mm)",
    "velocity_mm_s": "vertical velocity (mm/s)",
    "height_mm": "height above rest (mm)",
}


def log_single(stream: Any, recording: Recording, shown_seed: int) -> None:
    """Log the part of one seed, its guide, and the plots over all seeds."""
    _log_guide(stream, _guide(recording))
    _log_parts(stream, recording, recording.seeds[shown_seed])
    _log_plots(stream, recording, shown_seed)


def single_box(recording: Recording, shown_seed: int) -> Box:
    """What the scene shows: the guide, or the plate; of a plate that is large beside the part, the cell it is in."""
    plate, guide, part = recording.plate, _guide(recording), recording.parts[0]
    if guide is not None:
        foot = np.array([*guide.foot, 0.0]) * MM
        around = np.array([GUIDE_AROUND, GUIDE_AROUND, 0.0])
        return Box(foot - around, foot + around + [0.0, 0.0, GUIDE_HEIGHT])
    box = plate_box(plate)
    if not plate.nodal_lines or (box.high - box.low).max() < LARGE * radius_of(part):
        return box
    cell = NodalLines(plate.nodal_lines).distance(plate.antinode[None])[0] * MM
    path = recording.seeds[shown_seed].position[:, 0, :2] * MM
    antinode = plate.antinode * MM
    side = np.maximum(CELL * cell, 4.0 * radius_of(part))
    low, high = box.low.copy(), box.high.copy()
    low[:2] = np.maximum(np.minimum(np.nanmin(path, axis=0), antinode) - side, low[:2])
    high[:2] = np.minimum(np.maximum(np.nanmax(path, axis=0), antinode) + side, high[:2])
    is_nearly_all = high - low > NEARLY_ALL * (box.high - box.low)
    return Box(np.where(is_nearly_all, box.low, low), np.where(is_nearly_all, box.high, high))


def _log_parts(stream: Any, recording: Recording, frames: Frames) -> None:
    """Each part as one static mesh with a moving transform, its shadow, and the line its centre followed."""
    import rerun as rr

    time = rr.TimeColumn(TIMELINE, duration=frames.time)
    for i, part in enumerate(recording.parts):
        stream.log(f"parts/{part.name}", drawn_part(part), static=True)
        poses = rr.Transform3D.columns(
            translation=frames.position[:, i] * MM, quaternion=frames.quaternion[:, i][:, [1, 2, 3, 0]]
        )
        stream.send_columns(f"parts/{part.name}", indexes=[time], columns=poses)
        log_shadows(stream, recording.plate, part.name, part, frames, [i], [time])
        path = rr.LineStrips3D([frames.position[:, i] * MM], colors=[PATH], radii=[0.06])
        stream.log(f"paths/{part.name}", path, static=True)


def _guide(recording: Recording) -> Guide | None:
    """The guide of the recorded part."""
    part = parse_scenario(recording.scenario_text, file=recording.path).part[0]
    return build_guide(part.guide, part.start.position_mm) if part.guide and isinstance(part.start, Start) else None


def _log_guide(stream: Any, guide: Guide | None) -> None:
    """The axis of a slide, or the rings of a tube and its outline."""
    import rerun as rr

    if guide is None:
        return
    foot, up = np.array([*guide.foot, 0.0]) * MM, guide.axis
    lines = [np.array([foot, foot + GUIDE_HEIGHT * up])]
    if guide.radius is not None:
        angle = np.linspace(0.0, 2.0 * np.pi, 49)
        across = np.cross([0.0, 1.0, 0.0], up)
        ring = guide.radius * MM * (np.cos(angle)[:, None] * across + np.sin(angle)[:, None] * [0.0, 1.0, 0.0])
        lines = [foot + ring + height * up for height in np.linspace(0.0, GUIDE_HEIGHT, 9)]
        lines += [np.array([foot + side, foot + side + GUIDE_HEIGHT * up]) for side in ring[::12]]
    stream.log("guide", rr.LineStrips3D(lines, colors=[GLASS], radii=[0.03]), static=True)


def _log_plots(stream: Any, recording: Recording, shown_seed: int) -> None:
    """Of the first part over time: distance to the nearest nodal line, the shown seed and all others; height of the
    shown one, and its vertical velocity in a guide.
    """
    import rerun as rr

    lines = NodalLines(recording.plate.nodal_lines)
    rest_height = float(recording.seeds[shown_seed].position[:, 0, 2].min())
    guided = _guide(recording) is not None
    hops = rr.components.AggregationPolicy.Off if guided else rr.components.AggregationPolicy.Max
    for seed, frames in enumerate(recording.seeds):
        is_shown = seed == shown_seed
        name = "shown" if is_shown else _other(seed)
        time = rr.TimeColumn(TIMELINE, duration=frames.time)
        columns = {"height_mm": (frames.position[:, 0, 2] - rest_height) * MM} if is_shown else {}
        if is_shown and guided:
            columns["velocity_mm_s"] = frames.velocity[:, 0, 2] * MM
        if lines.lines:
            columns["distance_mm"] = lines.distance(frames.position[:, 0, :2]) * MM
        for plot, values in columns.items():
            style = rr.SeriesLines(
                colors=[NUT if is_shown else (*LINE_GREY, 140)],
                widths=[2.0 if is_shown else 1.0],
                names=[PLOTS[plot] if is_shown else f"seed {seed}"],
                aggregation_policy=hops,  # a plot narrower than the record must not average the hops away
            )
            stream.log(f"plots/{plot}/{name}", style, static=True)
            stream.send_columns(f"plots/{plot}/{name}", indexes=[time], columns=rr.Scalars.columns(scalars=values))


def single_blueprint(recording: Recording, shown_seed: int, *, style: Style) -> Any:
    """Open ready to watch: the 3D scene and the plots, playing along sim_time."""
    frames, largest = recording.seeds[shown_seed], {}
    if recording.plate.nodal_lines:
        lines = NodalLines(recording.plate.nodal_lines)
        largest["distance_mm"] = lines.distance(recording.plate.antinode[None])[0] * MM
    guided = _guide(recording) is not None
    if guided:
        largest["velocity_mm_s"] = float(np.abs(frames.velocity[:, 0, 2]).max()) * MM
    largest["height_mm"] = float(np.ptp(frames.position[:, 0, 2])) * MM
    other_seeds = [seed for seed in range(len(recording.seeds)) if seed != shown_seed]
    plots = [
        _plot(name, value, other_seeds, window=WINDOW_S if guided else None, bare=style != "viewer")
        for name, value in largest.items()
    ]
    title = "Scene (mm), colour = displacement amplitude"
    box, direction = single_box(recording, shown_seed), GUIDE_DIRECTION if guided else OBLIQUE
    return layout(box, scene_eye(box, 1, style, direction), plots, [1.0] * len(plots), title=title, style=style)


def _plot(name: str, largest: float, other_seeds: list[int], *, window: float | None, bare: bool) -> Any:
    """A time series view up to a little above the largest value, or of `window` [s] around now.

    Bare, it has a legend in place of its title, in which the other seeds are left out.
    """
    import rerun as rr
    import rerun.blueprint as rrb

    lowest = -largest if name == "velocity_mm_s" else 0.0
    around = None
    if window:
        sides = [rr.TimeRangeBoundary.cursor_relative(seconds=side * window / 2.0) for side in (-1.0, 1.0)]
        around = rrb.TimeAxis(view_range=rr.TimeRange(*sides))
    other_lines = rr.SeriesLines.from_fields(names=["other seeds"])
    return rrb.TimeSeriesView(
        origin=f"/plots/{name}",
        name=f"{PLOTS[name].capitalize()}: shown seed orange, others grey",
        titlebar=not bare,
        axis_x=around,
        axis_y=rrb.ScalarAxis(range=(1.05 * lowest, 1.05 * max(largest, 1e-6))),
        plot_legend=rrb.PlotLegend(visible=bare),  # one orange line and a bundle of grey ones need none beside a title
        overrides={f"/plots/{name}/{_other(seed)}": other_lines for seed in other_seeds} if bare else None,
    )


def _other(seed: int) -> str:
    return f"others/seed_{seed:03d}"
