"""A film of a replay: pictures of the viewer without a screen, one after the other, and ffmpeg."""

from __future__ import annotations

import contextlib
import math
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import FeederSimError, InputError, not_written, printable
from feeder_sim.records.trajectory_file import read_recording
from feeder_sim.replay.colours import Colour
from feeder_sim.replay.headless import camera
from feeder_sim.replay.scenery import SLOW, TIMELINE
from feeder_sim.replay.viewer import replay_ends
from feeder_sim.whole_files import partial_of

FPS, SIZE = 25.0, (1280, 720)
LONGEST_S = 20.0  # of a film whose speed is not given
MOST_FRAMES = 100_000
SMALLEST, LARGEST = 320, 3840  # [pixels], of either side
QUALITY = 18  # of x264's scale from 0 (best) to 51; lines and text stay sharp


@dataclass(frozen=True)
class Film:
    """What is filmed.

    Attributes:
        timeline: of the replay.
        begin, end: [s] on that timeline.
        speed: seconds of the timeline per second of film.
        fps: frames per second of film.
        size: width and height [pixels].
    """

    timeline: str
    begin: float
    end: float
    speed: float
    fps: float
    size: tuple[int, int]

    @property
    def times(self) -> NDArray[np.float64]:
        """Of the frames on the timeline [s], from begin on and not beyond end."""
        step = self.speed / self.fps
        steps = np.arange(math.floor((self.end - self.begin) / step * (1.0 + 1e-12)) + 1)
        return np.asarray(np.minimum(self.begin + step * steps, self.end), float)

    def as_json_object(self) -> dict[str, Any]:
        """As JSON takes it."""
        return {
            "timeline": self.timeline,
            "from_s": self.begin,
            "to_s": self.end,
            "speed": self.speed,
            "fps": self.fps,
            "frames": len(self.times),
            "size_pixels": list(self.size),
        }


def check_library() -> None:
    """Refuse to make a film without the extra `video`.

    Raises:
        InputError: imageio-ffmpeg is not there.
    """
    try:
        import imageio_ffmpeg  # noqa: F401
    except ImportError:
        raise InputError("needs the library imageio-ffmpeg: pip install 'feeder_sim[video]'", key="--video") from None


def film_of(
    run: Path,
    begin: float | None,
    end: float | None,
    *,
    speed: float | None = None,
    fps: float | None = None,
    size: tuple[int, int] | None = None,
    seed: int = 0,
    slow: bool = False,
) -> Film:
    """What to film of a run; without a speed, its true speed, or one that makes a film of 20 s.

    Raises:
        InputError: there is no such run, or a value is not allowed.
    """
    fps, size = FPS if fps is None else fps, size or SIZE
    ends = replay_ends(run, seed, slow=slow)
    last = ends[SLOW if slow else TIMELINE]
    begin, end = 0.0 if begin is None else begin, last if end is None else end
    if not 0.0 <= begin < end <= last:
        problem = (
            f"are {begin:g} and {end:g}, must be 0 <= --from < --to <= {last:g}, which seed {seed} is recorded for"
        )
        raise InputError(problem, file=run, key="--from, --to")
    if speed is None:
        speed = max(1.0, (end - begin) / LONGEST_S)
    if not 1e-6 <= speed <= 1e6:
        raise InputError(f"is {speed:g}, must be 1e-6 to 1e6", key="--speed")
    if not 1.0 <= fps <= 240.0:
        raise InputError(f"is {fps:g}, must be 1 to 240", key="--fps")
    if not all(SMALLEST <= side <= LARGEST and side % 2 == 0 for side in size):
        problem = f"is {size[0]}x{size[1]}, must be even numbers from {SMALLEST} to {LARGEST}"
        raise InputError(problem, key="--size")
    frames = (end - begin) / speed * fps
    if frames > MOST_FRAMES:
        raise InputError(f"makes a film of {frames:.0f} frames, must be up to {MOST_FRAMES}", key="--speed, --fps")
    return Film(SLOW if slow else TIMELINE, begin, end, speed, fps, size)


def make_film(
    run: Path,
    file: Path,
    film: Film,
    *,
    seed: int = 0,
    colour: Colour | None = None,
    progress: Callable[[float], None] = lambda _: None,
) -> None:
    """Film a run; the file is there as a whole or not at all.

    Args:
        run: its folder.
        file: to write (.mp4).
        film: what is filmed.
        seed: index of the seed.
        colour: what the colours of parts stand for; see `default_colour`.
        progress: is told the fraction that is done.

    Raises:
        InputError: there is no such run, or what is recorded cannot be read.
        FeederSimError: the viewer or ffmpeg failed.
        RecordingFailed: the film cannot be written.
    """
    recording, times = read_recording(run), film.times
    context = camera(recording, seed=seed, size=film.size, timeline=film.timeline, colour=colour)
    with context as viewer, _written(file, film) as write:
        viewer.settle(float(times[0]))
        for i, time in enumerate(times):
            write(viewer.picture(float(time)).tobytes())
            progress((i + 1) / len(times))


@contextlib.contextmanager
def _written(file: Path, film: Film) -> Iterator[Callable[[bytes], Any]]:
    """Takes the frames of a film (RGB, row by row); the file gets its name at the end."""
    partial = partial_of(file)
    with tempfile.TemporaryFile() as log:
        try:
            ffmpeg = subprocess.Popen(_command(film, partial), stdin=subprocess.PIPE, stdout=log, stderr=log)
            assert ffmpeg.stdin is not None
            try:
                with contextlib.suppress(BrokenPipeError), ffmpeg.stdin:  # ffmpeg itself says why it ended
                    yield ffmpeg.stdin.write
            except BaseException:
                ffmpeg.kill()
                raise
            finally:
                ffmpeg.wait()
            if ffmpeg.returncode:
                log.seek(0)
                lines = log.read().decode(errors="replace").splitlines() or ["it gave no reason"]
                raise FeederSimError(f"{file}: ffmpeg has not written it: {printable(lines[-1])}")
            partial.replace(file)
        except OSError as error:
            raise not_written(file, error) from error
        finally:
            partial.unlink(missing_ok=True)


def _command(film: Film, file: Path) -> list[str]:
    """What makes of raw frames a film that common players play."""
    from imageio_ffmpeg import get_ffmpeg_exe

    width, height = film.size
    frames = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", f"{film.fps:g}", "-i", "-"]
    coded = ["-c:v", "libx264", "-pix_fmt", "yuv420p", "-crf", str(QUALITY), "-movflags", "+faststart"]
    return [get_ffmpeg_exe(), "-y", "-loglevel", "error", *frames, *coded, "-f", "mp4", str(file.resolve())]
