"""Opening a replay in the rerun viewer, on a screen or as a picture."""

from __future__ import annotations

import contextlib
import io
import os
import subprocess
import tempfile
from pathlib import Path

from feeder_sim.errors import FeederSimError, InputError
from feeder_sim.records.files import check_no_links, locked
from feeder_sim.records.trajectory_file import last_change, read_recording, recorded_file
from feeder_sim.replay.colours import Colour
from feeder_sim.replay.headless import camera, viewer_program
from feeder_sim.replay.replay import build_replay, replay_name, timeline_ends
from feeder_sim.replay.scenery import SLOW, TIMELINE
from feeder_sim.whole_files import write_whole

DEFAULT_TIME = 1.0  # [s], of a screenshot
STARTING_S = 2.0
SIZE = 1920, 1080  # [pixels], of a screenshot
FORMATS = {".png": "PNG", ".jpg": "JPEG"}  # of a screenshot


def replay_file(run: Path, *, seed: int = 0, colour: Colour | None = None, rebuild: bool = False) -> Path:
    """The .rrd of a run, built from what is recorded when it is missing or older than that.

    Where it cannot be kept in the folder, because the run is still under way or nobody may write there, it is built in
    a temporary folder.

    Raises:
        InputError: there is no such run, or what is recorded cannot be read.
        RecordingFailed: the disk is full.
    """
    folder, name = recorded_file(run).parent, replay_name(seed, colour)
    check_no_links(folder)
    replay = folder / name
    if not rebuild and replay.is_file() and replay.stat().st_mtime_ns >= last_change(run):
        return replay
    with contextlib.ExitStack() as stack:
        try:
            if not os.access(folder, os.W_OK):
                raise InputError("cannot be written to", file=folder)
            stack.enter_context(locked(folder))
        except FeederSimError:
            replay = Path(tempfile.mkdtemp(prefix="feeder_sim_")) / name
        build_replay(run, replay, seed=seed, colour=colour)
    return replay


def displayed_time(run: Path, at: float | None, *, seed: int = 0, slow: bool = False) -> float:
    """The time [s] to show of a run: `at`, or without it 1 s or the end of a record that is shorter.

    Raises:
        InputError: the record ends before, or has no slow motion.
    """
    ends = replay_ends(run, seed, slow=slow)
    end = ends[SLOW if slow else TIMELINE]
    if at is None:
        return min(DEFAULT_TIME, end)
    if not at <= end:
        slowed = f", {ends[SLOW]:g} s in slow motion" if SLOW in ends else ""
        raise InputError(
            f"is {at:g}, must be 0 to {end:g}: seed {seed} is recorded for {ends[TIMELINE]:g} s{slowed}",
            file=run,
            key="--at",
        )
    return at


def replay_ends(run: Path, seed: int, *, slow: bool) -> dict[str, float]:
    """Last time [s] on each timeline of the replay of a run.

    Raises:
        InputError: there is no such run or seed, or slow motion is asked for and there is none.
    """
    ends = timeline_ends(read_recording(run), seed)
    if slow and SLOW not in ends:
        raise InputError("is not allowed here, the record of one part has none", file=run, key="--slow-motion")
    return ends


def open_viewer(replay: Path) -> None:
    """Open the viewer and return once it stands.

    Raises:
        FeederSimError: it did not start, as on a machine without a screen.
    """
    viewer = subprocess.Popen([viewer_program(), str(replay)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        code = viewer.wait(timeout=STARTING_S)
    except subprocess.TimeoutExpired:
        return
    if code:
        raise FeederSimError(f"{replay}: the rerun viewer did not open (no screen? --screenshot needs none)")


def take_screenshot(
    run: Path,
    picture: Path,
    *,
    at: float,
    timeline: str = TIMELINE,
    seed: int = 0,
    colour: Colour | None = None,
) -> None:
    """Draw the replay of a run at a time [s] of a timeline, without a screen.

    Raises:
        InputError: there is no such run, or what is recorded cannot be read.
        FeederSimError: the viewer did not start (it finds no graphics driver, not even a software one) or draw.
        RecordingFailed: the picture cannot be written.
    """
    recording = read_recording(run)
    with camera(recording, seed=seed, size=SIZE, timeline=timeline, colour=colour) as viewer:
        viewer.settle(at)
        drawn = viewer.picture(at)
    content = io.BytesIO()
    drawn.save(content, format=FORMATS[picture.suffix.lower()])
    write_whole(picture, content.getvalue())
