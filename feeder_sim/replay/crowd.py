"""Many parts in a replay: poses of all parts, nodal lines of the stage, flashing parts before a pick, counts.

Timelines: `sim_time`, `cycle` (0 before the first one) and `stage` (number over the whole run).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.measures.picking import nearest_neighbours
from feeder_sim.plate.drive import ModalTerms
from feeder_sim.records.removals import Cause, Removals
from feeder_sim.records.trajectory import Frames, PartRecord, PlateRecord, Recording
from feeder_sim.replay.parts import NUT, drawn_part
from feeder_sim.replay.plate import MM, TIMELINE, drawn_lines
from feeder_sim.replay.wave import PERIOD_S, SLOW, log_wave
from feeder_sim.scenario import Scenario
from feeder_sim.scene.timetable import TimedStage, Timetable

FLASH_S, FLASH_PERIOD_S = 0.4, 0.1  # [s]; how long, and with which period, parts flash before they are picked
FLASH = (40, 200, 60, 150)
OTHER_SEEDS = (150, 150, 150, 140)
CLEARANCE = 0.01  # [m]; of isolated parts in a schedule without picks
COUNTS = {"picked": (40, 160, 60), "lost": (190, 60, 60), "on_plate": (120, 120, 130), "isolated": (40, 90, 190)}


def log_crowd(
    stream: Any, recording: Recording, scenario: Scenario, times: Timetable, terms: ModalTerms, shown_seed: int
) -> None:
    """Log the parts of one seed, its stages and its counts.

    Args:
        stream: rerun's recording stream.
        recording: of the run.
        scenario: of the run.
        times: timetable of the shown seed.
        terms: modal coordinates of the shown seed in time.
        shown_seed: index of the seed.
    """
    import rerun as rr

    frames, removals = recording.records[shown_seed].frames, recording.records[shown_seed].removals
    stages = times.stages
    columns = _time_columns(frames, stages)
    slow_stages = log_wave(stream, recording.plate, terms, stages, float(frames.time[-1]))
    first = 0
    for kind, part in enumerate(scenario.part):
        members = list(range(first, first + part.count))
        _log_kind(stream, kind, recording.parts[first], frames, members, columns)
        for begin, moment in slow_stages:
            row = frames.row_at(moment)
            _log_kind(stream, kind, None, frames[slice(row, row + 1)], members, [rr.TimeColumn(SLOW, duration=[begin])])
        first += part.count
    _log_stages(stream, recording.plate, stages, float(frames.time[-1]))
    _log_flashes(stream, frames, removals, recording.parts[0])
    if scenario.goal is not None:
        _log_way(stream, recording, shown_seed)
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
    stream: Any, kind: int, part: PartRecord | None, frames: Frames, members: list[int], times: list[Any]
) -> None:
    """Log all parts of a kind as instances of one mesh; parts that have been taken out get the scale 0."""
    import rerun as rr

    if part is not None:
        stream.log(f"parts/{kind}", drawn_part(part), static=True)
    present = frames.present[:, members].astype(np.float32)
    position = frames.position[:, members] * MM
    poses = rr.InstancePoses3D.columns(
        translations=position.reshape(-1, 3),
        quaternions=frames.quaternion[:, members][..., [1, 2, 3, 0]].reshape(-1, 4),
        scales=np.repeat(present.reshape(-1, 1), 3, axis=1),
    )
    stream.send_columns(f"parts/{kind}", indexes=times, columns=poses.partition(np.full(len(frames), len(members))))


def _log_stages(stream: Any, plate: PlateRecord, stages: Sequence[TimedStage], last: float) -> None:
    """Log nodal lines and name of every stage, from its begin on, up to the time `last` [s]."""
    import rerun as rr
    from contourpy import contour_generator

    lines_of_shape = [
        [np.asarray(line) for line in contour_generator(plate.x, plate.y, shape.T).lines(0.0) if len(line) > 1]
        for shape in plate.mode_shape
    ]
    if plate.outline is not None:
        lines_of_shape = [list(plate.outline.kept(lines)) if lines else [] for lines in lines_of_shape]
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


def _log_flashes(stream: Any, frames: Frames, removals: Removals, part: PartRecord) -> None:
    """Log spheres that flash around the parts about to be picked; `part` gives their size."""
    import rerun as rr

    picked, size = removals.cause == Cause.PICKED, 1.2 * MM * float(np.linalg.norm(part.vertices, axis=1).max())
    for time in np.unique(removals.time[picked]):
        parts = removals.part[picked & (removals.time == time)]
        rows = np.flatnonzero((frames.time > time - FLASH_S) & (frames.time <= time + 1e-9))
        for row in rows:
            lit = int((time - frames.time[row]) / (0.5 * FLASH_PERIOD_S)) % 2 == 0
            stream.set_time(TIMELINE, duration=float(frames.time[row]))
            centres = frames.position[row, parts] * MM if lit else np.empty((0, 3))
            stream.log("picked", rr.Points3D(centres, radii=size, colors=[FLASH]))
        stream.set_time(TIMELINE, duration=float(time) + 0.5 * FLASH_PERIOD_S)
        stream.log("picked", rr.Clear(recursive=False))
    stream.reset_time()


def _log_counts(
    stream: Any,
    plate: PlateRecord,
    frames: Frames,
    removals: Removals,
    stages: Sequence[TimedStage],
    times: list[Any],
) -> None:
    """Log the numbers of parts picked, lost, on the plate and isolated over time."""
    import rerun as rr

    clearances = [stage.clearance for stage in stages if stage.clearance is not None]
    clearance = clearances[0] if clearances else CLEARANCE
    removed = {
        cause: np.searchsorted(np.sort(removals.time[removals.cause == cause]), frames.time, side="right")
        for cause in Cause
    }
    on_plate = frames.on_plate(plate)
    isolated = [
        int((nearest_neighbours(position[parts, :2]) > clearance).sum())
        for position, parts in zip(frames.position, on_plate, strict=True)
    ]
    values = {
        "picked": removed[Cause.PICKED],
        "lost": removed[Cause.LOST],
        "on_plate": on_plate.sum(axis=1),
        "isolated": np.array(isolated),
    }
    for name, colour in COUNTS.items():
        style = rr.SeriesLines(colors=[colour], names=[name], widths=[2.0])
        stream.log(f"counts/{name}", style, static=True)
        stream.send_columns(
            f"counts/{name}", indexes=times, columns=rr.Scalars.columns(scalars=values[name].astype(float))
        )


def _log_way(stream: Any, recording: Recording, shown_seed: int) -> None:
    """Log the mean x of the parts over time, for the shown seed and for all others."""
    import rerun as rr

    for seed, frames in enumerate(recording.seeds):
        shown = seed == shown_seed
        name = "counts/shown" if shown else f"counts/others/seed_{seed:03d}"
        style = rr.SeriesLines(
            colors=[NUT if shown else OTHER_SEEDS], widths=[2.0 if shown else 1.0], names=[f"seed {seed}"]
        )
        stream.log(name, style, static=True)
        place = rr.Scalars.columns(scalars=frames.position[..., 0].mean(axis=1) * MM)
        stream.send_columns(name, indexes=[rr.TimeColumn(TIMELINE, duration=frames.time)], columns=place)


def crowd_blueprint(recording: Recording, scenario: Scenario) -> Any:
    """Layout of the viewer: the plate seen obliquely from above; beside it counts, the slow wave and the stages."""
    import rerun.blueprint as rrb

    plate = recording.plate
    far = 1.05 * MM * max(plate.length, plate.width)
    eye = rrb.EyeControls3D(
        position=[0.0, -0.62 * far, 0.95 * far], look_target=[0.0, 0.0, 0.0], eye_up=[0.0, 0.0, 1.0]
    )
    scene = rrb.Spatial3DView(
        origin="/",
        contents=["+ /plate/**", "+ /parts/**", "+ /picked"],
        name="Scene (mm), colour = displacement amplitude, lines = nodal lines of the stage",
        eye_controls=eye,
        line_grid=False,
        background=[245, 245, 247],
    )
    title = "Parts picked, lost, on the plate, isolated"
    if scenario.goal is not None:
        title = f"x (mm): shown seed orange, others grey; the goal is {scenario.goal.x_mm:g}"
    counts = rrb.TimeSeriesView(origin="/counts", name=title, plot_legend=rrb.PlotLegend(visible=scenario.goal is None))
    wave_eye = rrb.EyeControls3D(position=[0.0, -far, 0.6 * far], look_target=[0.0, 0.0, 0.0], eye_up=[0.0, 0.0, 1.0])
    wave = rrb.Spatial3DView(
        origin="/wave",
        name=f"Surface, magnified; timeline {SLOW}: one period in {PERIOD_S:g} s",
        eye_controls=wave_eye,
        line_grid=False,
        background=[245, 245, 247],
    )
    return rrb.Blueprint(
        rrb.Horizontal(
            scene,
            rrb.Vertical(counts, wave, rrb.TextLogView(origin="/stage", name="Stages"), row_shares=[2, 2, 1]),
            column_shares=[3, 2],
        ),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="playing", loop_mode="all"),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
    )
