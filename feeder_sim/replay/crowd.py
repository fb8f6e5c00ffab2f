"""Many parts in a replay: poses of all parts, nodal lines of the stage, rings before a pick, counts.

Timelines: `sim_time`, `cycle` (0 before the first one) and `stage` (number over the whole run).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.measures.picking import nearest_neighbours
from feeder_sim.plate.drive import ModalTerms
from feeder_sim.records.recording import PartRecord, PlateRecord, Recording
from feeder_sim.records.seed import Cause, Events
from feeder_sim.records.trajectory import Frames
from feeder_sim.replay.colours import Colours
from feeder_sim.replay.labels import log_stage_texts, plate_box, stage_texts
from feeder_sim.replay.layout import Style, layout, scene_eye, wave_view
from feeder_sim.replay.parts import NUT, drawn_part, radius_of
from feeder_sim.replay.plate import MM, NODE_HEIGHT_MM, SLOW, TIMELINE, drawn_lines, log_wave, nodal_lines_of
from feeder_sim.replay.shadows import log_instances, log_shadows
from feeder_sim.scenario import Scenario, parse_scenario
from feeder_sim.scene.timetable import TimedStage, Timetable

# Rings on the plate that blink around the parts about to be picked.

BLINK_S, BLINK_PERIOD_S = 0.4, 0.1  # [s]; how long, and with which period, rings blink before parts are picked
RING = (0, 140, 60)
RING_SIZE, RING_WIDTH = 1.35, 0.12  # over the radius of the part
RING_POINTS = 33


def log_picks(stream: Any, frames: Frames, removals: Events, parts: Sequence[PartRecord]) -> None:
    """Log a ring around each part about to be picked, as large as the part needs."""
    import rerun as rr

    picked = removals.cause == Cause.PICKED
    radius = np.array([radius_of(part) for part in parts])
    for time in np.unique(removals.time[picked]):
        members = removals.part[picked & (removals.time == time)]
        for row in np.flatnonzero((frames.time > time - BLINK_S) & (frames.time <= time + 1e-9)):
            lit = int((time - frames.time[row]) / (0.5 * BLINK_PERIOD_S)) % 2 == 0
            stream.set_time(TIMELINE, duration=float(frames.time[row]))
            around = members if lit else members[:0]
            rings = [ring(frames.position[row, part, :2] * MM, RING_SIZE * radius[part]) for part in around]
            stream.log("picked", rr.LineStrips3D(rings, radii=RING_WIDTH * radius[around], colors=[RING]))
        stream.set_time(TIMELINE, duration=float(time) + 0.5 * BLINK_PERIOD_S)
        stream.log("picked", rr.Clear(recursive=False))
    stream.reset_time()


def ring(centre: NDArray[np.float64], radius: float) -> NDArray[np.float64]:
    """A circle (n, 3) around a centre (2,) just above the plate, all in one unit of length [mm]."""
    angle = np.linspace(0.0, 2.0 * np.pi, RING_POINTS)
    x, y = centre[0] + radius * np.cos(angle), centre[1] + radius * np.sin(angle)
    return np.column_stack([x, y, np.full(RING_POINTS, 3.0 * NODE_HEIGHT_MM)])


OTHER_SEEDS = (150, 150, 150, 140)
COUNTS = {"picked": (40, 160, 60), "lost": (190, 60, 60), "on_the_plate": (120, 120, 130), "isolated": (40, 90, 190)}


def log_crowd(
    stream: Any,
    recording: Recording,
    scenario: Scenario,
    times: Timetable,
    terms: ModalTerms,
    shown_seed: int,
    colours: Colours,
) -> None:
    """Log the parts of one seed, its stages and its counts.

    Args:
        stream: rerun's recording stream.
        recording: of the run.
        scenario: of the run.
        times: timetable of the shown seed.
        terms: modal coordinates of the shown seed in time.
        shown_seed: index of the seed.
        colours: of the parts.
    """
    import rerun as rr

    frames, removals = recording.records[shown_seed].frames, recording.records[shown_seed].removals
    stages = times.stages
    columns = _time_columns(frames, stages)
    slow_stages = log_wave(stream, recording.plate, terms, stages, float(frames.time[-1]))
    first = 0
    for kind, part in enumerate(scenario.part):
        members = list(range(first, first + part.count))
        # A colour that no part has in a still is logged there, too, or its mesh would stand in the middle of the plate.
        entries = np.unique(colours.index(frames, members)).tolist()
        _log_kind(stream, kind, recording, colours, entries, frames, members, columns)
        for begin, moment in slow_stages:
            row = frames.row_at(moment)
            still = frames[slice(row, row + 1)]
            slow = [rr.TimeColumn(SLOW, duration=[begin])]
            _log_kind(stream, kind, recording, colours, entries, still, members, slow)
        first += part.count
    box, texts = plate_box(recording.plate), stage_texts(recording.plate, times, float(frames.time[-1]))
    slow_texts = [(begin, [text for time, text in texts if time <= moment][-1]) for begin, moment in slow_stages]
    log_stage_texts(stream, box, slow_texts, SLOW)
    _log_stages(stream, recording.plate, stages, float(frames.time[-1]))
    log_picks(stream, frames, removals, recording.parts)
    if scenario.goal is not None:
        _log_mean_x(stream, recording, shown_seed)
    else:
        _log_counts(stream, recording.plate, frames, removals, stages, columns)


def _stage_numbers(time: NDArray[np.float64], stages: Sequence[TimedStage]) -> NDArray[np.int64]:
    """Number of the stage at each time (n,) [s], shape (n,)."""
    ends = np.array([stage.end for stage in stages])
    return np.minimum(np.searchsorted(ends, time - 1e-9), len(stages) - 1)


def _time_columns(frames: Frames, stages: Sequence[TimedStage]) -> list[Any]:
    """Columns of the three timelines, with a row per frame."""
    import rerun as rr

    number = _stage_numbers(frames.time, stages)
    cycle = np.array([stage.cycle for stage in stages])[number]
    return [
        rr.TimeColumn(TIMELINE, duration=frames.time),
        rr.TimeColumn("cycle", sequence=cycle),
        rr.TimeColumn("stage", sequence=number),
    ]


def _log_kind(
    stream: Any,
    kind: int,
    recording: Recording,
    colours: Colours,
    entries: list[int],
    frames: Frames,
    members: list[int],
    times: list[Any],
) -> None:
    """Log all parts of a kind and their shadows, as instances of one mesh for each entry of the legend."""
    part = recording.parts[members[0]]
    is_present, entry = frames.present[:, members], colours.index(frames, members)
    for i in entries:
        entity = f"parts/{kind}/{i}"
        stream.log(entity, drawn_part(part, colours.entries[i].colour), static=True)
        log_instances(stream, entity, frames, members, is_present & (entry == i), times)
    log_shadows(stream, recording.plate, str(kind), part, frames, members, times)


def _log_stages(stream: Any, plate: PlateRecord, stages: Sequence[TimedStage], last: float) -> None:
    """Log nodal lines and name of every stage, from its begin on, up to the time `last` [s]."""
    import rerun as rr

    lines_of_shape = nodal_lines_of(plate)
    for number, stage in enumerate(stages):
        if stage.start > last:
            break
        stream.set_time(TIMELINE, duration=stage.start)
        stream.set_time("cycle", sequence=stage.cycle)
        stream.set_time("stage", sequence=number)
        lines = [line for i in stage.excitations for line in lines_of_shape[plate.drives[i].shape]]
        stream.log("plate/nodal_lines", drawn_lines(lines) if lines else rr.Clear(recursive=False))
        text = f"cycle {stage.cycle}, {stage.name}" if stage.cycle else stage.name
        stream.log("stage", rr.TextLog(text))
    stream.reset_time()


def _log_counts(
    stream: Any,
    plate: PlateRecord,
    frames: Frames,
    removals: Events,
    stages: Sequence[TimedStage],
    times: list[Any],
) -> None:
    """Log the numbers of parts picked, lost and on the plate over time; and isolated, where a pick has a clearance."""
    import rerun as rr

    clearances = [stage.clearance for stage in stages if stage.clearance is not None]
    removed = {
        cause: np.searchsorted(np.sort(removals.time[removals.cause == cause]), frames.time, side="right")
        for cause in Cause
    }
    on_plate = frames.on_plate(plate, -plate.trough)
    values = {
        "picked": removed[Cause.PICKED],
        "lost": removed[Cause.LOST],
        "on_the_plate": on_plate.sum(axis=1),
    }
    if clearances:
        nearest = [nearest_neighbours(p[parts, :2]) for p, parts in zip(frames.position, on_plate, strict=True)]
        values["isolated"] = np.array([(distance > clearances[0]).sum() for distance in nearest])
    for name in values:
        style = rr.SeriesLines(colors=[COUNTS[name]], names=[name.replace("_", " ")], widths=[2.0])
        stream.log(f"counts/{name}", style, static=True)
        stream.send_columns(
            f"counts/{name}", indexes=times, columns=rr.Scalars.columns(scalars=values[name].astype(float))
        )


def _log_mean_x(stream: Any, recording: Recording, shown_seed: int) -> None:
    """Log the mean x of the parts over time, for the shown seed and for all others."""
    import rerun as rr

    for seed, frames in enumerate(recording.seeds):
        is_shown = seed == shown_seed
        name = "counts/shown" if is_shown else f"counts/others/seed_{seed:03d}"
        style = rr.SeriesLines(
            colors=[NUT if is_shown else OTHER_SEEDS],
            widths=[2.0 if is_shown else 1.0],
            names=["mean x of the parts (mm)" if is_shown else f"seed {seed}"],
        )
        stream.log(name, style, static=True)
        place = rr.Scalars.columns(scalars=frames.position[..., 0].mean(axis=1) * MM)
        stream.send_columns(name, indexes=[rr.TimeColumn(TIMELINE, duration=frames.time)], columns=place)


def crowd_blueprint(recording: Recording, shown_seed: int, *, style: Style, entries: int) -> Any:
    """Layout of the viewer: the plate seen obliquely from above; beside it counts, the slow wave and the stages."""
    import rerun as rr
    import rerun.blueprint as rrb

    scenario = parse_scenario(recording.scenario_text, file=recording.path)
    bare = style != "viewer"
    box, goal = plate_box(recording.plate), scenario.goal
    title = "Parts picked, lost, on the plate, isolated"
    if goal is not None:
        title = f"x (mm): shown seed orange, others grey; the goal is {goal.x_mm:g}"
    other_entities = [f"/counts/others/seed_{seed:03d}" for seed in range(len(recording.seeds)) if seed != shown_seed]
    other_lines = rr.SeriesLines.from_fields(names=["other seeds"])
    counts = rrb.TimeSeriesView(
        origin="/counts",
        name=title,
        titlebar=not bare,
        plot_legend=rrb.PlotLegend(visible=bare or goal is None),
        overrides=dict.fromkeys(other_entities, other_lines) if bare and goal is not None else None,
    )
    views, shares = [counts, wave_view(box, style=style)], [1.0, 1.0]
    if style == "slow_motion":
        del views[0], shares[0]
    if style == "viewer":
        views.append(rrb.TextLogView(origin="/stage", name="Stages"))
        shares.append(0.5)
    scene = "Scene (mm), colour = displacement amplitude, lines = nodal lines of the stage"
    return layout(box, scene_eye(box, entries, style), views, shares, title=scene, style=style)
