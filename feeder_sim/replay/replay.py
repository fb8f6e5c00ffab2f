"""Trajectory file -> .rrd for the rerun viewer: plate, nodal lines, part and path in 3D, plots beside them.

The scene is in millimetres. The plate is drawn flat; its colour is the signed displacement amplitude of the surface
(red and blue swing in opposite phase, white is at rest), so nothing is exaggerated. The instantaneous displacement at
kHz would only alias with the frame rate.
"""

from __future__ import annotations

import re
from pathlib import Path

from feeder_sim.errors import InputError, path_of_user
from feeder_sim.plate.drive import modal_terms
from feeder_sim.records.files import write_whole
from feeder_sim.records.recording import Recording
from feeder_sim.records.trajectory_file import read_recording
from feeder_sim.replay.colours import Colour, colours_of
from feeder_sim.replay.crowd import crowd_blueprint, log_crowd
from feeder_sim.replay.labels import log_labels, log_stage_texts, plate_box, stage_texts
from feeder_sim.replay.layout import Style
from feeder_sim.replay.plate import PERIOD_S, PERIODS, PICTURES, SLOW, TIMELINE, log_plate
from feeder_sim.replay.shadows import log_shadow_plane
from feeder_sim.replay.single import log_single, single_blueprint, single_box
from feeder_sim.scenario import Scenario, parse_scenario
from feeder_sim.scene.timetable import Timetable, timed, timetable

REPLAY = "replay.rrd"  # its name in a run folder
REPLAY_NAMES = re.compile(r"replay(_seed_\d+)?\.rrd")
RRD = b"RRF"  # begin of a file that rerun has made


def replay_name(seed: int, colour: Colour | None = None) -> str:
    """Name in a run folder of the replay that shows a seed, with colours that are not the default ones."""
    if seed == 0 and colour is None:
        return REPLAY
    return f"replay_seed_{seed:03d}{f'_{colour}' if colour else ''}.rrd"


def remove_replays(folder: Path) -> None:
    """Remove the replays of a run folder, which are built again when they are asked for, and nothing of others."""
    for path in folder.glob("replay*.rrd"):
        if REPLAY_NAMES.fullmatch(path.name) and not path.is_symlink() and path.is_file():
            with path.open("rb") as file:
                is_rerun_file = file.read(len(RRD)) == RRD
            if is_rerun_file:
                path.unlink()


def build_replay(
    trajectory: str | Path, replay: str | Path, *, shown_seed: int = 0, colour: Colour | None = None
) -> None:
    """Build an .rrd from a trajectory file; also works on the file of a run that was killed.

    Args:
        trajectory: HDF5 file of a run.
        replay: file to write, replaced when it exists.
        shown_seed: index of the seed shown in 3D; the plots show all of them.
        colour: what the colours of parts stand for; see `default_colour`.

    Raises:
        InputError: the trajectory cannot be read.
        RecordingFailed: the replay cannot be written, as when the disk is full; one that was there stays.
    """
    recording = read_recording(path_of_user(trajectory, "trajectory"))
    replay = path_of_user(replay, "replay")
    # Not by rerun: on a full disk it goes on without a word, or waits for ever.
    write_whole(replay, replay_content(recording, shown_seed, colour=colour))


def replay_content(
    recording: Recording, shown_seed: int, *, colour: Colour | None = None, style: Style = "viewer"
) -> bytes:
    """The whole .rrd, with the layout for the viewer or for pictures.

    Raises:
        InputError: there is no such seed, or nothing of it.
    """
    import rerun as rr

    check_seed(recording, shown_seed)
    stream = rr.RecordingStream("feeder_sim", recording_id=f"{recording.path.parent.name}-{shown_seed}")
    scenario = parse_scenario(recording.scenario_text, file=recording.path)
    times = times_of(recording, scenario, shown_seed)
    terms = modal_terms(timed(recording.plate.drives, times))
    crowd = is_crowd(scenario)
    colours = colours_of(scenario, colour, recording.parts)
    box = plate_box(recording.plate) if crowd else single_box(recording, shown_seed)
    memory = stream.memory_recording()
    if crowd:
        blueprint = crowd_blueprint(recording, shown_seed, style=style, entries=len(colours.entries))
    else:
        blueprint = single_blueprint(recording, shown_seed, style=style)
    stream.send_blueprint(blueprint, make_active=False, make_default=True)
    log_plate(stream, recording.plate, terms, max(f.time[-1] for f in recording.seeds if len(f)))
    log_labels(stream, box, colours.entries)
    texts = stage_texts(recording.plate, times, float(recording.seeds[shown_seed].time[-1]))
    log_stage_texts(stream, box, texts)
    log_shadow_plane(stream)
    if crowd:
        log_crowd(stream, recording, scenario, times, terms, shown_seed, colours)
    else:
        log_single(stream, recording, shown_seed)
    return bytes(memory.drain_as_bytes())


def timeline_ends(recording: Recording, shown_seed: int) -> dict[str, float]:
    """Last time [s] on each timeline of the replay that shows a seed; one part alone has no slow motion.

    Raises:
        InputError: there is no such seed, or nothing of it.
    """
    check_seed(recording, shown_seed)
    scenario = parse_scenario(recording.scenario_text, file=recording.path)
    last, times = float(recording.seeds[shown_seed].time[-1]), times_of(recording, scenario, shown_seed)
    drives = recording.plate.drives
    reached = [stage for stage in times.stages if stage.excitations and stage.start <= last]
    kinds = {frozenset(drives[i] for i in stage.excitations) for stage in reached}
    slow = PERIOD_S * (PERIODS * len(kinds) - 1.0 / PICTURES)
    return {TIMELINE: last} | ({SLOW: slow} if kinds and is_crowd(scenario) else {})


def times_of(recording: Recording, scenario: Scenario, shown_seed: int) -> Timetable:
    """When the stages of a seed were."""
    record = recording.records[shown_seed]
    interval = float(record.frames.time[1]) if len(record.frames) > 1 else None
    return timetable(scenario, record.stops.tolist(), frame_interval=interval)


def check_seed(recording: Recording, shown_seed: int) -> None:
    """Refuse a seed that there is not, or nothing of it."""
    if not 0 <= shown_seed < len(recording.seeds):
        raise InputError(
            f"is {shown_seed}, must be 0 to {len(recording.seeds) - 1}", file=recording.path, key="--show-seed"
        )
    if not len(recording.seeds[shown_seed]):
        raise InputError(f"seed {shown_seed} has no frames yet", file=recording.path)


def is_crowd(scenario: Scenario) -> bool:
    """Whether all parts and stages are shown, not the way of one part."""
    return scenario.schedule is not None or scenario.n_parts > 1
