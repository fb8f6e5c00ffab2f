"""The pictures of a run: its plate, where its parts were, and the replay."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from feeder_sim.document.document import Block, Text
from feeder_sim.document.figure import UM, WIDTH, Figure, picture_from
from feeder_sim.document.player import Player
from feeder_sim.document.words import number
from feeder_sim.errors import FeederSimError
from feeder_sim.measures.outlets import first_jam
from feeder_sim.plots.plate_top import (
    close_up,
    draw_parts,
    draw_paths,
    draw_shape,
    frame_plate,
    has_shape,
)
from feeder_sim.records.recording import PlateRecord
from feeder_sim.records.seed import Cause, parts_removed
from feeder_sim.records.trajectory import Frames
from feeder_sim.replay.colours import colours_of, default_colour
from feeder_sim.replay.page import replay_page
from feeder_sim.replay.viewer import take_screenshot
from feeder_sim.run.recorded_run import RecordedRun
from feeder_sim.scene.timetable import TimedStage

MOST_SHAPES, MOST_MOMENTS = 6, 4
PALE = 0.45  # colours of a plate under parts
ROOM = 0.4  # parts of a close-up's distance from antinode to nodal line, around the paths
TITLE = 0.45  # [in] of a panel above and below what is drawn


def plate_picture(run: RecordedRun) -> Figure | None:
    """Mode shapes that are driven, with their nodal lines; None for a plate that moves as a whole."""
    plate = run.recording.plate
    driven: dict[tuple[int, float], list[float]] = {}
    for drive in plate.drives:
        if has_shape(plate, drive.shape):
            driven.setdefault((drive.shape, round(drive.drive_frequency, 3)), []).append(drive.steady_amplitude)
    shapes = list(driven.items())[:MOST_SHAPES]
    if not shapes:
        return None
    columns = min(len(shapes), 2 if len(shapes) in (2, 4) else 3)
    height = _height(plate, len(shapes), columns)

    def draw(figure: Any) -> None:
        grid = figure.subplots(math.ceil(len(shapes) / columns), columns, squeeze=False)
        for axes in grid.ravel()[len(shapes) :]:
            axes.set_axis_off()
        for axes, ((shape, frequency), amplitudes) in zip(grid.ravel(), shapes, strict=False):
            filled = draw_shape(axes, plate, shape)
            low, high = min(amplitudes) * UM, max(amplitudes) * UM
            amplitude = number(high, 3) if math.isclose(low, high) else f"{number(low, 3)} to {number(high, 3)}"
            axes.set_title(f"{frequency:g} Hz, {amplitude} µm")
            _label(axes, grid, len(shapes))
        figure.colorbar(filled, ax=grid, label="deflection, antinode = 1", ticks=[-1, 0, 1], shrink=0.8, aspect=30)

    more = len(driven) - len(shapes)
    remark = f" {more} more are not shown." if more else ""
    frequencies = ", ".join(f"{frequency:g} Hz" for (_, frequency), _ in shapes)
    return Figure(
        draw,
        height=height,
        alt=f"Mode shapes of the plate, driven at {frequencies}, seen from above, with nodal lines.",
        caption="What the plate does: mode shapes as driven, with their amplitudes at the antinode. Red and blue swing "
        f"in opposite phase; black lines are nodal lines, which stay at rest.{remark}",
    )


def parts_picture(run: RecordedRun) -> Figure | None:
    """Where parts were: paths of a single one in all seeds, or many parts of the first seed at several moments."""
    scene, recording = run.result.scene, run.recording
    if scene.guides[0] is not None or not any(len(frames) > 1 for frames in recording.seeds):
        return None
    if len(recording.parts) == 1:
        return _paths(run)
    return _moments(run)


def player(run: RecordedRun) -> Player | None:
    """The replay of the first seed, which plays in the page; None where nothing is recorded."""
    if not len(run.recording.seeds[0]):
        return None
    return Player(
        lambda: replay_page(run.recording),
        title="Replay",
        caption="The replay of the first seed: turn it with the mouse; time line and speed are below it. Colour is "
        "the amplitude of the surface, red and blue swing in opposite phase; black lines are nodal lines.",
    )


def _paths(run: RecordedRun) -> Figure:
    """Paths of a part in all seeds; of a small part on a large plate, in the cell of the plate that it is in."""
    plate, cell = run.recording.plate, run.result.prepared.cell
    seeds = [frames for frames in run.recording.seeds if len(frames) > 1]
    points = np.concatenate([frames.position[:, 0, :2] for frames in seeds])
    is_close_up = cell is not None and np.ptp(points, axis=0).max() < 0.6 * max(plate.length, plate.width)

    def draw(figure: Any) -> None:
        axes = figure.add_subplot()
        _ground(axes, plate, plate.drives[0].shape if run.result.scene.scenario.schedule is None else None)
        if (goal := run.result.scene.scenario.goal) is not None:
            axes.axvspan(
                goal.x_mm - goal.within_mm, goal.x_mm + goal.within_mm, color="#2a8a5f", alpha=0.25, linewidth=0
            )
        draw_paths(axes, seeds)
        if is_close_up and cell is not None:
            close_up(axes, plate, np.vstack([points, cell.antinode]), ROOM * cell.reach)
        axes.set(xlabel="x (mm)", ylabel="y (mm)")

    around = " Only the part of the plate around the paths is shown." if is_close_up else ""
    return Figure(
        draw,
        height=4.2,
        alt=f"Paths of the part on the plate in {len(seeds)} seeds, seen from above.",
        caption=f"Paths of the part from above, one colour per seed: a ring where it starts, a dot where it "
        f"ends.{around}",
    )


def _moments(run: RecordedRun) -> Figure:
    """Parts of the first seed that was recorded, at its start, its first jam, and the ends of some stages."""
    scenario, recording = run.result.scene.scenario, run.recording
    seed = next(i for i, frames in enumerate(recording.seeds) if len(frames) > 1)
    record = recording.records[seed]
    frames, plate = record.frames, recording.plate
    moments = _selected_moments(run.result.scene.stages(record.stops.tolist()), frames, run.result.scene.frame_interval)
    if (jam := first_jam(run.result.scene, record)) is not None:
        moments.append((f"jam of {jam[1]}, {jam[0]:.4g} s", frames.row_at(jam[0]), None))
        moments.sort(key=lambda moment: moment[1])
    colours = colours_of(scenario, None, recording.parts)
    all_parts = list(range(len(recording.parts)))
    columns = 2
    height = _height(plate, len(moments), columns)

    def draw(figure: Any) -> None:
        from matplotlib.patches import Patch

        grid = figure.subplots(math.ceil(len(moments) / columns), columns, squeeze=False)
        for axes in grid.ravel()[len(moments) :]:
            axes.set_axis_off()
        for axes, (title, row, stage) in zip(grid.ravel(), moments, strict=False):
            shapes = [plate.drives[i].shape for i in stage.excitations] if stage else []
            _ground(axes, plate, shapes[0] if len(set(shapes)) == 1 else None)
            entry = colours.index(frames[slice(row, row + 1)], all_parts)[0]
            filled = ["#{:02x}{:02x}{:02x}".format(*colours.entries[i].colour) for i in entry]
            picked: list[int] = []
            if stage is not None:
                end = float(frames.time[row])
                picked = parts_removed(record.removals, Cause.PICKED, start=stage.start, end=end).tolist()
            draw_parts(axes, recording.parts, frames, row, colours=filled, picked=picked)
            axes.set_title(title)
            _label(axes, grid, len(moments))
        if len(colours.entries) > 1:
            handles = [
                Patch(color="#{:02x}{:02x}{:02x}".format(*entry.colour), label=entry.name) for entry in colours.entries
            ]
            figure.legend(handles=handles, loc="outside lower center", ncols=min(len(handles), 6))

    by_pose = default_colour(scenario) == "pose"
    meaning = f" Colours are {'the stable poses in which they lie' if by_pose else 'the kinds'}."
    legend = meaning if len(colours.entries) > 1 else ""
    has_picks = (record.removals.cause == Cause.PICKED).any()
    picks = " Green rings are around parts that are picked at that moment." if has_picks else ""
    return Figure(
        draw,
        height=height,
        alt=f"Places of the parts of seed {seed} on the plate, seen from above, at {len(moments)} moments.",
        caption=f"Where the parts lie, in seed {seed}.{legend}{picks}",
    )


def _selected_moments(
    stages: list[TimedStage] | tuple[TimedStage, ...], frames: Frames, frame_interval: float
) -> list[tuple[str, int, TimedStage | None]]:
    """Title, row and stage of some moments: the start, the ends of the first stages, and the end of the record."""
    reached = float(frames.time[-1]) + frame_interval
    ended = [stage for stage in stages if stage.name and stage.end <= reached]
    first = ended[: MOST_MOMENTS - 2]
    moments: list[tuple[str, int, TimedStage | None]] = [("start", 0, None)]
    for stage in first + ([ended[-1]] if len(ended) > len(first) else []):
        cycle = f"cycle {stage.cycle}, " if stage.cycle and stages[-1].cycle > 1 else ""
        moments.append((f"{cycle}{stage.name}: end, {stage.end:.4g} s", frames.row_at(stage.end), stage))
    if not ended or ended[-1].end < float(frames.time[-1]) - frame_interval:
        moments.append((f"end of the record, {frames.time[-1]:.4g} s", len(frames) - 1, None))
    return moments


def _ground(axes: Any, plate: PlateRecord, shape: int | None) -> None:
    """Draw the plate under parts: a mode shape in pale colours, or only its outline."""
    if shape is not None and has_shape(plate, shape):
        draw_shape(axes, plate, shape, pale=PALE)
        return
    frame_plate(axes, plate)
    from feeder_sim.plots.plate_top import cut_to_plate

    cut_to_plate(axes, plate.outline)


def _label(axes: Any, grid: Any, panels: int) -> None:
    """Label the axes of a panel at the edges of a grid of which the first panels are drawn."""
    number_of, columns = grid.ravel().tolist().index(axes), grid.shape[1]
    if number_of + columns >= panels:
        axes.set_xlabel("x (mm)")
    if number_of % columns == 0:
        axes.set_ylabel("y (mm)")


def _height(plate: PlateRecord, panels: int, columns: int) -> float:
    """Height of a figure [in] of panels that show the plate."""
    aspect = min(max(plate.width / plate.length, 0.25), 1.3)
    return math.ceil(panels / columns) * (0.9 * WIDTH / columns * aspect + TITLE) + 0.2


def screenshot(run: RecordedRun, notify: Callable[[str], None] | None) -> Block:
    """A picture of the replay; a note where it cannot be drawn, as without a graphics driver."""
    seed = next((i for i, frames in enumerate(run.recording.seeds) if len(frames) > 1), None)
    if seed is None:
        return Text("No picture of the replay: nothing was recorded.", "note")
    try:
        at = _telling_time(run, seed)
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "replay.png"
            take_screenshot(run.recording.path, file, at=at, seed=seed)
            return picture_from(
                file,
                alt=f"Picture of the replay of seed {seed} at {at:g} s: the plate and its parts in perspective.",
                caption=f"The replay of seed {seed} at {at:g} s. feeder-sim replay shows it moving.",
            )
    except FeederSimError as error:
        if notify:
            notify(f"no picture of the replay: {error}")
        return Text(f"No picture of the replay could be drawn: {error}", "note")


def _telling_time(run: RecordedRun, seed: int) -> float:
    """A time at which a picture of a seed tells something [s]: late in the first stage, or half of its record."""
    record, last = run.recording.records[seed], float(run.recording.seeds[seed].time[-1])
    first = run.result.scene.stages(record.stops.tolist())[0]
    return first.stop - 2.0 * run.result.scene.frame_interval if first.name and first.stop < last else 0.5 * last
