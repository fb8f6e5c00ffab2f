"""Recording -> .rrd for the rerun viewer: plate, nodal lines, part and path in 3D, plots beside them.

The scene is in millimetres. The plate is drawn flat; its colour is the signed displacement amplitude of the surface
(red and blue swing in opposite phase, white is at rest), so nothing is exaggerated. The instantaneous displacement at
kHz would only alias with the frame rate.
"""

from __future__ import annotations

import re
from pathlib import Path

from feeder_sim.errors import path_of_user
from feeder_sim.records.recording import Recording
from feeder_sim.records.trajectory_file import read_recording
from feeder_sim.replay.build import scenery_of
from feeder_sim.replay.colours import Colour
from feeder_sim.replay.layout import Style
from feeder_sim.replay.scenery import SLOW, TIMELINE
from feeder_sim.replay.seed_view import PERIOD_S, PERIODS, PICTURES, SeedView
from feeder_sim.whole_files import write_whole

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


def build_replay(run: str | Path, replay: str | Path, *, seed: int = 0, colour: Colour | None = None) -> None:
    """Build an .rrd of a run; also works on one that was killed.

    Args:
        run: its folder, or a file that `feeder-sim export` made of it.
        replay: file to write, replaced when it exists.
        seed: index of the seed shown in 3D; the plots show all of them.
        colour: what the colours of parts stand for; see `default_colour`.

    Raises:
        InputError: what is recorded cannot be read.
        RecordingFailed: the replay cannot be written, as when the disk is full; one that was there stays.
    """
    recording = read_recording(path_of_user(run, "run"))
    replay = path_of_user(replay, "replay")
    # Not by rerun: on a full disk it goes on without a word, or waits for ever.
    write_whole(replay, replay_content(recording, seed, colour=colour))


def replay_content(recording: Recording, seed: int, *, colour: Colour | None = None, style: Style = "viewer") -> bytes:
    """The whole .rrd, with the layout for the viewer or for pictures.

    Raises:
        InputError: there is no such seed, or nothing of it.
    """
    from feeder_sim.replay.rerun_file import rerun_content

    scenery = scenery_of(SeedView(recording, seed, colour))
    return rerun_content(scenery, f"{recording.path.parent.name}-{seed}", style)


def timeline_ends(recording: Recording, seed: int) -> dict[str, float]:
    """Last time [s] on each timeline of the replay that shows a seed; one part alone has no slow motion.

    Raises:
        InputError: there is no such seed, or nothing of it.
    """
    view = SeedView(recording, seed)
    slow = PERIOD_S * (PERIODS * len(view.slow_stages) - 1.0 / PICTURES)
    return {TIMELINE: view.last} | ({SLOW: slow} if view.slow_stages else {})
