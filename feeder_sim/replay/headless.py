"""The rerun viewer without a screen: pictures of a replay, with nothing of the viewer around its content.

The viewer says on notes in its upper right corner what it runs on. They fade while it draws, so it draws until they are
gone: they begin in the bar above the content, which is empty otherwise, and which is cut off afterwards.
"""

from __future__ import annotations

import contextlib
import io
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from feeder_sim.errors import FeederSimError
from feeder_sim.records.recording import Recording
from feeder_sim.replay.colours import Colour
from feeder_sim.replay.layout import Style
from feeder_sim.replay.replay import REPLAY, replay_content
from feeder_sim.replay.scenery import SLOW, TIMELINE
from feeder_sim.whole_files import write_whole

if TYPE_CHECKING:
    from PIL.Image import Image

LOADING_TIMEOUT_S = 60.0
NOTES_TIMEOUT_S = 30.0
SETTLED = 3  # pictures alike, one after the other, by which the first one is known to be complete
BAR, EDGE = 38, 2  # of the viewer's window around its content [points]: above, and at the other sides
POINTS_HIGH = 720  # [points]; height of a picture in which the viewer's text is well legible
ZOOM_STEP, LARGEST_ZOOM = 0.1, 3.0


class Camera:
    """A viewer that shows one replay."""

    def __init__(self, client: Any, size: tuple[int, int], zoom: float, timeline: str) -> None:
        self._client, self._size, self._zoom, self._timeline = client, size, zoom, timeline

    def picture(self, at: float) -> Image:
        """The content at a time [s]."""
        self._client.set_time(self._timeline, duration=at, play_state="paused")
        image = self._screenshot()
        edge, bar = _pixels(EDGE, self._zoom), _pixels(BAR, self._zoom)
        return image.crop((edge, bar, edge + self._size[0], bar + self._size[1]))

    def settle(self, at: float) -> None:
        """Draw until the notes are gone and nothing moves any more."""
        self._client.set_time(self._timeline, duration=at, play_state="paused")
        deadline, alike, previous = time.monotonic() + NOTES_TIMEOUT_S, 0, b""
        while alike < SETTLED and time.monotonic() < deadline:
            image = self._screenshot()
            pixels = image.tobytes()
            alike = alike + 1 if pixels == previous and not self._has_notes(image) else 0
            previous = pixels

    def _screenshot(self) -> Image:
        from PIL import Image

        return Image.open(io.BytesIO(self._client.take_screenshot())).convert("RGB")

    def _has_notes(self, image: Image) -> bool:
        """Whether the bar above the content is not empty in its right half."""
        edge, bar = _pixels(EDGE, self._zoom), _pixels(BAR, self._zoom)
        right_half = np.asarray(image.crop((image.width // 2, 2 * edge, image.width - 6 * edge, bar - edge)))
        return int(np.ptp(right_half, axis=(0, 1)).max()) > 2


@contextlib.contextmanager
def camera(
    recording: Recording,
    *,
    seed: int,
    size: tuple[int, int],
    timeline: str = TIMELINE,
    colour: Colour | None = None,
) -> Iterator[Camera]:
    """A viewer without a screen that shows a timeline of the replay of a seed in pictures of a size [pixels].

    It shows a replay of its own: another layout than that in the file is taken up only with its recording.

    Raises:
        FeederSimError: it did not start (it finds no graphics driver, not even a software one) or draw.
    """
    zoom = min(max(round(size[1] / POINTS_HIGH / ZOOM_STEP) * ZOOM_STEP, ZOOM_STEP * 5), LARGEST_ZOOM)
    window = size[0] + 2 * _pixels(EDGE, zoom), size[1] + _pixels(BAR, zoom) + _pixels(EDGE, zoom)
    with tempfile.TemporaryDirectory() as folder:
        os.environ.setdefault("XDG_RUNTIME_DIR", folder)
        os.environ.setdefault("RUST_LOG", "error")  # the viewer talks a lot on stderr
        replay = Path(folder) / REPLAY
        style: Style = "slow_motion" if timeline == SLOW else "picture"
        write_whole(replay, replay_content(recording, seed, colour=colour, style=style))
        try:
            with _viewer(window) as client:
                _open(client, replay)
                for _ in range(abs(round((zoom - 1.0) / ZOOM_STEP))):
                    client.run_command("ui.zoom_in_ui" if zoom > 1.0 else "ui.zoom_out_ui")
                yield Camera(client, size, zoom, timeline)
        except (RuntimeError, ConnectionError, TimeoutError, ValueError) as error:
            raise FeederSimError(
                f"{recording.path}: the rerun viewer drew no picture; without a GPU it needs a software driver "
                f"(Debian: mesa-vulkan-drivers libvulkan1): {str(error).splitlines()[0]}"
            ) from error


@contextlib.contextmanager
def _viewer(window: tuple[int, int]) -> Iterator[Any]:
    """A viewer with a window of a size that nobody sees, and a client of it."""
    from rerun.experimental import ViewerClient

    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [viewer_program(), "--headless", "--hide-welcome-screen", f"--port={port}", "--bind=127.0.0.1"]
    command += [f"--window-size={window[0]}x{window[1]}"]
    process = subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )
    try:
        deadline = time.monotonic() + LOADING_TIMEOUT_S
        while True:
            try:
                client = ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
                client.get_state()
                break
            except (RuntimeError, ConnectionError):
                if process.poll() is not None or time.monotonic() > deadline:
                    raise RuntimeError("it did not start") from None
                time.sleep(0.05)
        yield client
    finally:
        _end(process)


def _end(process: subprocess.Popen[bytes]) -> None:
    """End the viewer and what it has started."""
    with contextlib.suppress(ProcessLookupError):
        if hasattr(os, "killpg"):
            os.killpg(process.pid, signal.SIGTERM)
        else:
            subprocess.run(["taskkill", "/PID", str(process.pid), "/T", "/F"], capture_output=True, check=False)
    try:
        process.wait(timeout=5.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _open(client: Any, file: Path) -> None:
    """Open a file and wait until it is loaded."""
    client.open(str(file))
    deadline = time.monotonic() + LOADING_TIMEOUT_S
    while client.get_state().loading and time.monotonic() < deadline:
        time.sleep(0.05)


def _pixels(points: float, zoom: float) -> int:
    return int(np.ceil(points * zoom))


def viewer_program() -> str:
    """The viewer that came with rerun-sdk: beside this Python, else on the path."""
    beside = shutil.which("rerun", path=str(Path(sys.executable).parent))
    program = beside or shutil.which("rerun")
    if program is None:
        raise FeederSimError("the rerun viewer is not installed (pip install rerun-sdk)")
    return program
