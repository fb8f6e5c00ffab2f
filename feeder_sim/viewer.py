"""Opening a replay in the rerun viewer, on a screen or as a picture."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from feeder_sim.errors import FeederSimError, InputError
from feeder_sim.replay import build_replay
from feeder_sim.run_folder import REPLAY, TRAJECTORY

WINDOW = "1600x900"
SCREENSHOT_TIMEOUT_S = 120


def replay_file(run: Path, *, seed: int = 0, rebuild: bool = False, at: float | None = None) -> Path:
    """The .rrd of a run, built from its trajectory file when it is missing, stale or another view is wanted.

    Raises:
        InputError: there is no such run, or its trajectory cannot be read.
    """
    trajectory = run if run.suffix == ".h5" else run / TRAJECTORY
    if not trajectory.is_file():
        raise InputError(f"no run here, allowed is a folder that holds {TRAJECTORY}", file=run)
    replay = trajectory.with_name(REPLAY)
    if at is not None:  # a picture of one moment: leave the recorded replay as it is
        replay = Path(tempfile.mkdtemp(prefix="feeder_sim-")) / REPLAY
    if rebuild or at is not None or not replay.is_file():
        build_replay(trajectory, replay, shown_seed=seed, until=at)
    return replay


def open_viewer(replay: Path) -> None:
    """Open the viewer and return at once."""
    subprocess.Popen([_rerun(), str(replay)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def take_screenshot(replay: Path, picture: Path) -> None:
    """Render the opened replay without a screen.

    Raises:
        FeederSimError: the viewer found no graphics driver, not even a software one.
    """
    command = [_rerun(), str(replay), "--headless", "--new", "--window-size", WINDOW, "--screenshot-to", str(picture)]
    picture.unlink(missing_ok=True)
    environment = {"XDG_RUNTIME_DIR": tempfile.gettempdir(), **os.environ}
    try:
        subprocess.run(command, env=environment, capture_output=True, timeout=SCREENSHOT_TIMEOUT_S, check=False)
    except subprocess.TimeoutExpired as error:
        raise FeederSimError(f"the viewer took more than {SCREENSHOT_TIMEOUT_S} s for a screenshot") from error
    if not picture.is_file():
        raise FeederSimError(
            f"{picture}: the viewer wrote no picture; without a GPU it needs a software driver "
            "(Debian: mesa-vulkan-drivers libvulkan1)"
        )


def _rerun() -> str:
    """The viewer that came with rerun-sdk: beside this Python, else on the path."""
    beside = shutil.which("rerun", path=str(Path(sys.executable).parent))
    found = beside or shutil.which("rerun")
    if found is None:
        raise FeederSimError("the rerun viewer is not installed (pip install rerun-sdk)")
    return found
