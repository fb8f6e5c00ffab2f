"""One seed of a run -> its scenery: plate, parts, paths, lines and texts, whole for the viewer or coarse for a page."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from feeder_sim.plate.nodal_lines import NodalLines
from feeder_sim.records.trajectory import Frames
from feeder_sim.replay.curves import crowd_plot, part_plots
from feeder_sim.replay.labels import label_entries, plate_box, stage_label
from feeder_sim.replay.layout import OBLIQUE
from feeder_sim.replay.parts import (
    GUIDE_HEIGHT,
    blinking_rings,
    guide_entries,
    part_entries,
    path_entries,
    steady_rings,
)
from feeder_sim.replay.plate import (
    coarse_plate_entries,
    fixture_entries,
    outlet_entries,
    plate_entries,
    stage_entries,
    wave_entries,
)
from feeder_sim.replay.scenery import MM, SLOW, TIMELINE, Box, Entry, Scenery, Times
from feeder_sim.replay.seed_view import SeedView, radius_of

FRAMES_PER_S, MOST_FRAMES = 25.0, 500  # of a page
GUIDE_DIRECTION = (0.0, -1.0, 0.5)
GUIDE_AROUND = 6.0  # [mm], shown on each side of a guide
LARGE = 30.0  # side of a plate over the radius of a part, from which on only a cell of the plate is shown
CELL = 1.15  # of the way from antinode to nodal line, shown around antinode and way
NEARLY_ALL = 0.6  # of a side of the plate, from which on all of it is shown


def scenery_of(view: SeedView, *, coarse: bool = False) -> Scenery:
    """All that is shown of a seed; coarse, only its scene, in fewer frames, triangles and colours."""
    box = scene_box(view)
    direction = OBLIQUE if view.guide is None else GUIDE_DIRECTION
    title = "Scene (mm), colour = displacement amplitude"
    if view.crowd:
        title += ", lines = nodal lines of the stage"
    entries = _coarse(view, box) if coarse else _whole(view, box)
    plots = [] if coarse else [crowd_plot(view, frame_times(view))] if view.crowd else part_plots(view)
    return Scenery(tuple(entries), box, direction, title, len(view.colours.entries), plots, wave=view.crowd)


def _whole(view: SeedView, box: Box) -> Iterator[Entry]:
    frames, times = view.record.frames, frame_times(view)
    yield from plate_entries(view)
    yield from fixture_entries(view)
    yield from outlet_entries(view)
    yield from label_entries(box, view.colours.entries)
    yield from stage_label(view, box)
    moments = [(frames, times)]
    if view.crowd:
        yield from wave_entries(view)
        yield from stage_entries(view)
        yield from blinking_rings(view)
        rows = [(frames.row_at(view.slow_times(stage)[-1]), begin) for begin, stage in view.slow_stages]
        moments += [(frames[slice(row, row + 1)], {SLOW: [begin]}) for row, begin in rows]
    else:
        yield from guide_entries(view)
        yield from path_entries(view)
    yield from part_entries(view, moments)


def _coarse(view: SeedView, box: Box) -> Iterator[Entry]:
    frames = _thinned(view.record.frames)
    if not view.crowd:
        yield from path_entries(view)
    yield from coarse_plate_entries(view)
    yield from fixture_entries(view)
    yield from outlet_entries(view)
    yield from stage_entries(view)
    yield from stage_label(view, box)
    yield from steady_rings(view, frames)
    yield from part_entries(view, [(frames, {TIMELINE: frames.time})])


def frame_times(view: SeedView) -> Times:
    """Times of the frames: `sim_time`; of many parts `cycle` (0 before the first) and `stage` (of the whole run)."""
    time, stages = view.record.frames.time, view.times.stages
    if not view.crowd:
        return {TIMELINE: time}
    number = np.minimum(np.searchsorted([stage.end for stage in stages], time - 1e-9), len(stages) - 1)
    return {TIMELINE: time, "cycle": np.array([stage.cycle for stage in stages])[number], "stage": number}


def scene_box(view: SeedView) -> Box:
    """What the scene shows: the guide, or the plate; of a plate that is large beside one part, the cell it is in."""
    plate, box, radius = view.plate, plate_box(view.plate), radius_of(view.recording.parts[0])
    if view.guide is not None:
        foot = np.array([*view.guide.foot, 0.0]) * MM
        around = np.array([GUIDE_AROUND, GUIDE_AROUND, 0.0])
        return Box(foot - around, foot + around + [0.0, 0.0, GUIDE_HEIGHT])
    if view.crowd or not plate.nodal_lines or (box.high - box.low).max() < LARGE * radius:
        return box
    cell = NodalLines(plate.nodal_lines).distance(plate.antinode[None])[0] * MM
    path = view.record.frames.position[:, 0, :2] * MM
    antinode = plate.antinode * MM
    side = np.maximum(CELL * cell, 4.0 * radius)
    low, high = box.low.copy(), box.high.copy()
    low[:2] = np.maximum(np.minimum(np.nanmin(path, axis=0), antinode) - side, low[:2])
    high[:2] = np.minimum(np.maximum(np.nanmax(path, axis=0), antinode) + side, high[:2])
    is_nearly_all = high - low > NEARLY_ALL * (box.high - box.low)
    return Box(np.where(is_nearly_all, box.low, low), np.where(is_nearly_all, box.high, high))


def _thinned(frames: Frames) -> Frames:
    """Frames at even times, not more than a page needs."""
    last = float(frames.time[-1])
    count = int(min(MOST_FRAMES, FRAMES_PER_S * last + 1, len(frames)))
    rows = np.searchsorted(frames.time, np.linspace(0.0, last, max(count, 2)) - 1e-9)
    return frames[np.unique(rows.clip(0, len(frames) - 1))]
