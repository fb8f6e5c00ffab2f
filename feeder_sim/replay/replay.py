"""Trajectory file -> .rrd for the rerun viewer: plate, nodal lines, part and path in 3D, plots beside them.

The scene is in millimetres. The plate is drawn flat; its colour is the signed displacement amplitude of the surface
(red and blue swing in opposite phase, white is at rest), so nothing is exaggerated. The instantaneous displacement at
kHz would only alias with the frame rate.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from feeder_sim.errors import InputError
from feeder_sim.plate.drive import modal_terms
from feeder_sim.plate.nodal_lines import NodalLines
from feeder_sim.records.own_files import is_own
from feeder_sim.records.trajectory import Frames, Recording
from feeder_sim.records.trajectory_file import read_recording
from feeder_sim.records.whole_file import write_whole
from feeder_sim.replay.crowd import crowd_blueprint, log_crowd
from feeder_sim.replay.parts import NUT, drawn_part
from feeder_sim.replay.plate import MM, TIMELINE, log_plate
from feeder_sim.replay.wave import PERIOD_S, PERIODS, PICTURES, SLOW
from feeder_sim.scenario import Scenario, Start, parse_scenario
from feeder_sim.scene.guide import Guide, build_guide
from feeder_sim.scene.timetable import timed, timetable

REPLAY = "replay.rrd"  # its name in a run folder
LINE_GREY, PATH = (150, 150, 150), (30, 110, 60)
GLASS = (110, 160, 190)
GUIDE_HEIGHT = 18.0  # [mm], as drawn
WINDOW_S = 1.0  # of the plots of a guided part, whose hops are many


RRD = b"RRF"  # begin of a file that rerun has made


def replay_name(seed: int) -> str:
    """Name in a run folder of the replay that shows a seed."""
    return REPLAY if seed == 0 else f"replay_seed_{seed:03d}.rrd"


def remove_replays(folder: Path) -> None:
    """Remove the replays of a run folder, which are built again when they are asked for, and nothing of others."""
    for path in folder.glob("replay*.rrd"):
        if is_own(path.name) and not path.is_symlink() and path.is_file():
            with path.open("rb") as file:
                made_by_rerun = file.read(len(RRD)) == RRD
            if made_by_rerun:
                path.unlink()


def build_replay(trajectory: Path, replay: Path, *, shown_seed: int = 0) -> None:
    """Build an .rrd from a trajectory file; also works on the file of a run that was killed.

    Args:
        trajectory: HDF5 file of a run.
        replay: file to write, replaced when it exists.
        shown_seed: index of the seed shown in 3D; the plots show all of them.

    Raises:
        InputError: the trajectory cannot be read.
        RecordingFailed: the replay cannot be written, as when the disk is full; one that was there stays.
    """
    recording = read_recording(trajectory)
    _check_shown(recording, shown_seed)
    # Not by rerun: on a full disk it goes on without a word, or waits for ever.
    write_whole(replay, _logged(recording, shown_seed))


def _logged(recording: Recording, shown_seed: int) -> bytes:
    """The whole .rrd."""
    import rerun as rr

    stream = rr.RecordingStream("feeder_sim", recording_id=f"{recording.path.parent.name}-{shown_seed}")
    scenario = parse_scenario(recording.scenario_text, file=recording.path)
    times = timetable(scenario, recording.records[shown_seed].stops.tolist())
    terms = modal_terms(timed(recording.plate.drives, times))
    crowd = _is_crowd(scenario)
    held = stream.memory_recording()
    blueprint = crowd_blueprint(recording, scenario) if crowd else _blueprint(recording, shown_seed)
    stream.send_blueprint(blueprint, make_active=False, make_default=True)
    log_plate(stream, recording.plate, terms, max(f.time[-1] for f in recording.seeds if len(f)))
    if crowd:
        log_crowd(stream, recording, scenario, times, terms, shown_seed)
    else:
        _log_guide(stream, _guide(recording))
        _log_parts(stream, recording, recording.seeds[shown_seed])
        _log_plots(stream, recording, shown_seed)
    return bytes(held.drain_as_bytes())


def timeline_ends(recording: Recording, shown_seed: int) -> dict[str, float]:
    """Last time [s] on each timeline of the replay that shows a seed; one part alone has no slow motion.

    Raises:
        InputError: there is no such seed, or nothing of it.
    """
    _check_shown(recording, shown_seed)
    scenario = parse_scenario(recording.scenario_text, file=recording.path)
    last, stops = float(recording.seeds[shown_seed].time[-1]), recording.records[shown_seed].stops.tolist()
    drives = recording.plate.drives
    reached = [stage for stage in timetable(scenario, stops).stages if stage.excitations and stage.start <= last]
    kinds = {frozenset(drives[i] for i in stage.excitations) for stage in reached}
    slow = PERIOD_S * (PERIODS * len(kinds) - 1.0 / PICTURES)
    return {TIMELINE: last} | ({SLOW: slow} if kinds and _is_crowd(scenario) else {})


def _check_shown(recording: Recording, shown_seed: int) -> None:
    if not 0 <= shown_seed < len(recording.seeds):
        raise InputError(
            f"is {shown_seed}, allowed is 0 to {len(recording.seeds) - 1}", file=recording.path, key="--show-seed"
        )
    if not len(recording.seeds[shown_seed]):
        raise InputError(f"seed {shown_seed} has no frames yet", file=recording.path)


def _is_crowd(scenario: Scenario) -> bool:
    return scenario.schedule is not None or scenario.n_parts > 1


def _log_parts(stream: Any, recording: Recording, frames: Frames) -> None:
    """Each part as one static mesh with a moving transform, and the line its centre followed."""
    import rerun as rr

    time = rr.TimeColumn(TIMELINE, duration=frames.time)
    for i, part in enumerate(recording.parts):
        stream.log(f"parts/{part.name}", drawn_part(part), static=True)
        poses = rr.Transform3D.columns(
            translation=frames.position[:, i] * MM, quaternion=frames.quaternion[:, i][:, [1, 2, 3, 0]]
        )
        stream.send_columns(f"parts/{part.name}", indexes=[time], columns=poses)
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
    rest = float(recording.seeds[shown_seed].position[:, 0, 2].min())
    guided = _guide(recording) is not None
    hops = rr.components.AggregationPolicy.Off if guided else rr.components.AggregationPolicy.Max
    for seed, frames in enumerate(recording.seeds):
        shown = seed == shown_seed
        name = "shown" if shown else f"others/seed_{seed:03d}"
        style = rr.SeriesLines(
            colors=[NUT if shown else (*LINE_GREY, 140)],
            widths=[2.0 if shown else 1.0],
            names=[f"seed {seed}"],
            aggregation_policy=hops,  # a plot narrower than the record must not average the hops away
        )
        time = rr.TimeColumn(TIMELINE, duration=frames.time)
        columns = {"height_mm": (frames.position[:, 0, 2] - rest) * MM} if shown else {}
        if shown and guided:
            columns["velocity_mm_s"] = frames.velocity[:, 0, 2] * MM
        if lines.lines:
            columns["distance_mm"] = lines.distance(frames.position[:, 0, :2]) * MM
        for plot, values in columns.items():
            stream.log(f"plots/{plot}/{name}", style, static=True)
            stream.send_columns(f"plots/{plot}/{name}", indexes=[time], columns=rr.Scalars.columns(scalars=values))


def _blueprint(recording: Recording, shown_seed: int) -> Any:
    """Open ready to watch: the 3D scene on the left, the plots on the right, playing along sim_time."""
    import rerun.blueprint as rrb

    plate, guide = recording.plate, _guide(recording)
    antinode = plate.antinode * MM if np.isfinite(plate.antinode).all() else np.zeros(2)
    cell = [NodalLines(plate.nodal_lines).distance(plate.antinode[None])[0] * MM] if plate.nodal_lines else [30.0]
    target, far = [float(antinode[0]) + 0.5 * cell[0], float(antinode[1]), 0.0], 2.0 * cell[0]
    if guide is not None:
        target, far = [*(c * MM for c in guide.foot), 0.4 * GUIDE_HEIGHT], 1.6 * GUIDE_HEIGHT
    eye = rrb.EyeControls3D(
        position=[target[0], target[1] - far, (0.5 if guide else 1.2) * far], look_target=target, eye_up=[0.0, 0.0, 1.0]
    )
    scene = rrb.Spatial3DView(
        origin="/",
        contents=["+ /plate/**", "+ /guide/**", "+ /parts/**", "+ /paths/**"],
        name="Scene (mm), colour = displacement amplitude",
        eye_controls=eye,
        line_grid=False,
        background=[245, 245, 247],
    )
    height = float(np.ptp(recording.seeds[shown_seed].position[:, 0, 2])) * MM
    plots = [_plot("height_mm", "Height above rest (mm), shown seed", height)]
    if guide is not None:
        fastest = float(np.abs(recording.seeds[shown_seed].velocity[:, 0, 2]).max()) * MM
        plots = [
            _plot("velocity_mm_s", "Vertical velocity (mm/s), shown seed", fastest, lowest=-fastest, window=WINDOW_S),
            _plot("height_mm", "Height above rest (mm), shown seed", height, window=WINDOW_S),
        ]
    if plate.nodal_lines:
        plots.insert(0, _plot("distance_mm", "Distance to nodal line (mm): shown seed orange, others grey", cell[0]))
    return rrb.Blueprint(
        rrb.Horizontal(scene, rrb.Vertical(*plots), column_shares=[3, 2]),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="playing", loop_mode="all"),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
    )


def _plot(name: str, title: str, largest: float, *, lowest: float = 0.0, window: float | None = None) -> Any:
    """A time series view from the lowest to a little above the largest value, or of `window` [s] around now."""
    import rerun as rr
    import rerun.blueprint as rrb

    axis = rrb.ScalarAxis(range=(1.05 * lowest, 1.05 * max(largest, 1e-6)))
    legend = rrb.PlotLegend(visible=False)  # one orange line and a bundle of grey ones need none
    around = None
    if window:
        sides = [rr.TimeRangeBoundary.cursor_relative(seconds=side * window / 2.0) for side in (-1.0, 1.0)]
        around = rrb.TimeAxis(view_range=rr.TimeRange(*sides))
    return rrb.TimeSeriesView(origin=f"/plots/{name}", name=title, axis_x=around, axis_y=axis, plot_legend=legend)
