"""The replay as a person sees it, in pictures and in films."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import check_refused, feeder_sim
from conftest import strip_scenario

from feeder_sim.errors import FeederSimError, InputError
from feeder_sim.replay import video, viewer
from feeder_sim.replay.video import check_library, film_of, make_film
from feeder_sim.replay.viewer import take_screenshot
from feeder_sim.run.run_folder import record_run

DRIVERS = Path("/usr/share/vulkan/icd.d")


drawn = pytest.mark.skipif(not any(DRIVERS.glob("*.json")), reason="no graphics driver, not even a software one")


@drawn
def test_replay_opens_with_a_coloured_plate_and_its_plots(tmp_path: Path) -> None:
    from matplotlib.image import imread

    record_run(strip_scenario(seeds=2, duration_s=0.5), tmp_path / "run")
    take_screenshot(tmp_path / "run", tmp_path / "shot.png", at=0.4)
    rgb = imread(tmp_path / "shot.png")[..., :3]
    scene, plots = rgb[:, : rgb.shape[1] * 3 // 5], rgb[:, rgb.shape[1] * 3 // 5 :]
    red, green, blue = np.moveaxis(scene, -1, 0)
    assert ((red > 0.5) & (blue < 0.5 * red) & (green < 0.5 * red)).mean() > 0.03  # the antinode under the part
    assert ((blue > 0.5) & (red < 0.6 * blue)).mean() > 0.03  # its neighbour in opposite phase
    orange = np.abs(plots - np.array([214, 140, 30]) / 255).max(axis=-1) < 0.15
    assert orange.sum() > 100
    assert rgb.shape[:2] == (1080, 1920)
    strips = rgb[:12, :1000], rgb[-30:-12, :1000]  # where the viewer's bars were; the eye leaves room there
    assert all(np.ptp(strip, axis=(0, 1)).max() < 0.02 for strip in strips)


@drawn
def test_film_has_its_frames_and_nothing_else_is_left(tmp_path: Path) -> None:
    imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg")

    record_run(strip_scenario(duration_s=0.5), tmp_path / "run")
    done: list[float] = []
    film = film_of(tmp_path / "run", 0.1, 0.3, fps=20.0, size=(640, 360))
    make_film(tmp_path / "run", tmp_path / "film.mp4", film, progress=done.append)
    decode = [imageio_ffmpeg.get_ffmpeg_exe(), "-loglevel", "error", "-i", str(tmp_path / "film.mp4")]
    raw = subprocess.run([*decode, "-f", "rawvideo", "-pix_fmt", "rgb24", "-"], capture_output=True, check=True).stdout
    frames = np.frombuffer(raw, np.uint8).reshape(-1, 360, 640, 3).astype(int)
    assert len(frames) == len(film.times) == 5
    first, last = frames[0], frames[-1]
    assert np.abs(first - last)[:, 400:].max() > 60  # the cursor of the plots has moved on
    assert done == pytest.approx([0.2, 0.4, 0.6, 0.8, 1.0])
    assert sorted(path.name for path in tmp_path.iterdir()) == ["film.mp4", "run"]


OF_PICTURE = {"seed": 0, "timeline": "sim_time", "size_pixels": [1920, 1080]}
OF_FILM = OF_PICTURE | {"video": "film.mp4", "size_pixels": [1280, 720]}
OF_FILM |= {"from_s": 0.005, "to_s": 0.015, "speed": 0.1, "fps": 50.0, "frames": 6}


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ("", {"replay": "run/replay.rrd", "seed": 0}),
        ("--screenshot shot.png", OF_PICTURE | {"screenshot": "shot.png", "time_s": pytest.approx(0.02, abs=0.001)}),
        ("--video film.mp4 --from 0.005 --to 0.015 --fps 50 --speed 0.1", OF_FILM),
    ],
)
def test_json_says_what_was_made(
    options: str, told: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without a screen and a graphics driver: what draws is left out."""
    monkeypatch.setattr(viewer, "open_viewer", lambda replay: None)
    monkeypatch.setattr(viewer, "take_screenshot", lambda *_, **__: None)
    monkeypatch.setattr(video, "make_film", lambda *_, **__: None)
    monkeypatch.setattr(video, "check_library", lambda: None)
    record_run(strip_scenario(duration_s=0.02), tmp_path / "run")
    monkeypatch.chdir(tmp_path)
    done = feeder_sim("replay", "run", "--json", *options.split())
    assert done.returncode == 0 and json.loads(done.stdout) == told
    assert feeder_sim("replay", "run", *options.split()).stdout == ""


class _NoMore(Exception):
    pass


@drawn
@pytest.mark.slow
def test_film_that_fails_half_way_leaves_no_file(tmp_path: Path) -> None:
    pytest.importorskip("imageio_ffmpeg")
    record_run(strip_scenario(duration_s=0.2), tmp_path / "run")

    def stops(fraction: float) -> None:
        raise _NoMore

    with pytest.raises(_NoMore):
        make_film(tmp_path / "run", tmp_path / "film.mp4", film_of(tmp_path / "run", None, None), progress=stops)
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


@drawn
@pytest.mark.slow
def test_film_on_a_full_disk_is_one_line_and_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg")
    record_run(strip_scenario(duration_s=0.2), tmp_path / "run")
    full = tmp_path / "ffmpeg"
    full.write_text("#!/bin/sh\ntouch film.mp4.partial\necho 'film.mp4.partial: No space left on device' >&2\nexit 1\n")
    full.chmod(0o755)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(imageio_ffmpeg, "get_ffmpeg_exe", lambda: str(full))
    with pytest.raises(FeederSimError, match=r"^film.mp4: ffmpeg has not written it: .*: No space left on device$"):
        make_film(tmp_path / "run", Path("film.mp4"), film_of(tmp_path / "run", None, None))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["ffmpeg", "run"]


def test_film_without_its_library_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(InputError, match=r"--video: needs .* pip install 'feeder_sim\[video\]'"):
        check_library()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("--video film.avi", "film.avi: --video: is '.avi', must be .mp4"),
        ("--screenshot shot.gif", "shot.gif: --screenshot: is '.gif', must be .png, .jpg"),
        ("--video there.mp4", "there.mp4: exists already, must be a new file"),
        ("--video film.mp4 --size big", "--size: is 'big', must be WIDTHxHEIGHT"),
        ("--video film.mp4 --to 9", "--from, --to: are 0 and 9, must be"),
        ("--fps 10", "--fps: belongs to --video"),
        ("--at 0.1 --video film.mp4", "--at: belongs to --screenshot"),
        ("--screenshot shot.png --video film.mp4", "--video: is not allowed together with --screenshot"),
    ],
)
def test_wrong_options_are_refused_in_one_line(options: str, message: str, tmp_path: Path) -> None:
    record_run(strip_scenario(duration_s=0.02), tmp_path / "run", replay=False)
    (tmp_path / "there.mp4").touch()
    check_refused(feeder_sim("replay", "run", *options.split(), cwd=tmp_path), message)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run", "there.mp4"]
