"""Opening a replay in the rerun viewer, on a screen or as a picture."""

from __future__ import annotations

import contextlib
import os
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from feeder_sim.errors import FeederSimError, InputError
from feeder_sim.records.own_files import check_no_links, locked
from feeder_sim.records.trajectory_file import read_recording, trajectory_of
from feeder_sim.replay.plate import TIMELINE
from feeder_sim.replay.replay import build_replay, replay_name, timeline_ends
from feeder_sim.replay.wave import SLOW

DEFAULT_TIME = 1.0  # [s], of a screenshot
LOADING_TIMEOUT_S = 60.0
STARTING_S = 2.0
SETTLING_S = 6.0  # the viewer's start-up messages fade and its views finish drawing


def replay_file(run: Path, *, seed: int = 0, rebuild: bool = False) -> Path:
    """The .rrd of a run, built from its trajectory file when it is missing or older than that.

    Where it cannot be kept beside the trajectory, because the run is still under way or nobody may write there, it is
    built in a temporary folder.

    Raises:
        InputError: there is no such run, or its trajectory cannot be read.
        RecordingFailed: the disk is full.
    """
    trajectory = trajectory_of(run)
    folder, name = trajectory.parent, replay_name(seed)
    check_no_links(folder)
    replay = folder / name
    if not rebuild and replay.is_file() and replay.stat().st_mtime_ns >= trajectory.stat().st_mtime_ns:
        return replay
    with contextlib.ExitStack() as held:
        try:
            if not os.access(folder, os.W_OK):
                raise InputError("cannot be written to", file=folder)
            held.enter_context(locked(folder))
        except FeederSimError:
            replay = Path(tempfile.mkdtemp(prefix="feeder_sim_")) / name
        build_replay(trajectory, replay, shown_seed=seed)
    return replay


def time_shown(run: Path, at: float | None, *, seed: int = 0, slow: bool = False) -> float:
    """The time [s] to show of a run: `at`, or without it 1 s or the end of a record that is shorter.

    Raises:
        InputError: the record ends before, or has no slow motion.
    """
    ends = timeline_ends(read_recording(trajectory_of(run)), seed)
    if slow and SLOW not in ends:
        raise InputError("is not allowed here, the record of one part has none", file=run, key="--slow-motion")
    end = ends[SLOW if slow else TIMELINE]
    if at is None:
        return min(DEFAULT_TIME, end)
    if not at <= end:
        slowed = f", {ends[SLOW]:g} s in slow motion" if SLOW in ends else ""
        raise InputError(
            f"is {at:g}, allowed is 0 to {end:g}: seed {seed} is recorded for {ends[TIMELINE]:g} s{slowed}",
            file=run,
            key="--at",
        )
    return at


def open_viewer(replay: Path) -> None:
    """Open the viewer and return once it stands.

    Raises:
        FeederSimError: it did not start, as on a machine without a screen.
    """
    viewer = subprocess.Popen([_rerun(), str(replay)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        code = viewer.wait(timeout=STARTING_S)
    except subprocess.TimeoutExpired:
        return
    if code:
        raise FeederSimError(f"{replay}: the rerun viewer did not open (no screen? --screenshot needs none)")


def take_screenshot(replay: Path, picture: Path, *, at: float, timeline: str = TIMELINE) -> None:
    """Render the opened replay at a time [s] of a timeline, without a screen.

    Raises:
        FeederSimError: the viewer did not start (it finds no graphics driver, not even a software one) or draw.
    """
    with tempfile.TemporaryDirectory() as runtime_folder:
        os.environ.setdefault("XDG_RUNTIME_DIR", runtime_folder)
        os.environ.setdefault("RUST_LOG", "error")  # the viewer talks a lot on stderr
        try:
            _draw(replay.resolve(), picture.resolve(), at, timeline)
        except (RuntimeError, ConnectionError, TimeoutError, ValueError) as error:
            raise FeederSimError(
                f"{picture}: the rerun viewer wrote no picture; without a GPU it needs a software driver "
                f"(Debian: mesa-vulkan-drivers libvulkan1): {str(error).splitlines()[0]}"
            ) from error


def _draw(replay: Path, picture: Path, at: float, timeline: str) -> None:
    from rerun.experimental import ViewerClient

    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    with ViewerClient.spawn(headless=True, port=port, hide_welcome_screen=True, executable_path=_rerun()) as viewer:
        viewer.open(str(replay))
        deadline = time.monotonic() + LOADING_TIMEOUT_S
        while viewer.get_state().loading and time.monotonic() < deadline:
            time.sleep(0.2)
        viewer.set_time(timeline, duration=at, play_state="paused")
        time.sleep(SETTLING_S)
        viewer.save_screenshot(str(picture))


def _rerun() -> str:
    """The viewer that came with rerun-sdk: beside this Python, else on the path."""
    beside = shutil.which("rerun", path=str(Path(sys.executable).parent))
    found = beside or shutil.which("rerun")
    if found is None:
        raise FeederSimError("the rerun viewer is not installed (pip install rerun-sdk)")
    return found
