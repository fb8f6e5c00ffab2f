"""Makes the pictures of replays: `python docs/figures/replays.py [NAME ...]`, of all scenarios below or some of them.

It runs each scenario, for as long as its pictures need, and takes them without a screen. `animation` is a name, too: it
makes the moving picture at the top of README.
"""

from __future__ import annotations

import contextlib
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from PIL import Image
from tutorial import join

from feeder_sim.replay.video import film_of, make_film
from feeder_sim.replay.viewer import take_screenshot
from feeder_sim.run.run_folder import record_run
from feeder_sim.scenario import load_scenario
from feeder_sim.scenario.tables import validated

ROOT = Path(__file__).resolve().parents[2]
SCENE, WHOLE = (0, 90, 1150, 1000), (0, 0, 1920, 1080)  # of a screenshot of 1920 x 1080: the plate, everything


@dataclass(frozen=True)
class Shot:
    """Pictures side by side.

    Attributes:
        scenario: its name.
        at: times [s].
        file: to write, from the root of the repository.
        cycles: of the schedule that are run; None for all, or where there is none.
        box: what is kept of each picture.
        height: of the file [pixels].
    """

    scenario: str
    at: tuple[float, ...]
    file: str
    cycles: int | None = None
    box: tuple[int, int, int, int] = WHOLE
    height: int = 676


SHOTS = (
    Shot("separation_100", (1.98, 2.48), "scenarios/separation_100.jpg", 1, SCENE, 490),
    Shot("drift_2797hz_plate", (3.0,), "scenarios/drift_2797hz_plate.jpg"),
    Shot("transport_strip", (12.0,), "scenarios/transport_strip.jpg"),
    Shot("wave_gather", (20.0,), "scenarios/wave_gather.jpg"),
    Shot("brackets", (2.98,), "docs/figures/brackets.jpg", 3),
    Shot("screws", (2.98,), "docs/figures/screws.jpg", 3),
    Shot("mixture", (2.98,), "docs/figures/mixture.jpg", 3),
    Shot("separation_l", (1.98, 2.48), "docs/figures/separation_l.jpg", 1, SCENE, 490),
    Shot("platform", (0.0, 1.18, 2.28), "docs/figures/platform.jpg", 1, SCENE, 380),
    Shot("tangle", (0.98,), "docs/figures/tangle.jpg", None, (420, 240, 760, 620), 400),
)


@dataclass(frozen=True)
class Scene:
    """A piece of an animation: from when to when [s], and how many times as fast as it was."""

    begin: float
    end: float
    speed: float


ANIMATED, ANIMATION = "separation_100", "scenarios/separation_100.webp"
SCENES = (Scene(0.0, 2.0, 1.0), Scene(2.0, 2.3, 0.2), Scene(2.3, 2.48, 0.4))  # gather, throw apart, pick
FPS, FILMED, KEPT, WIDTH = 12.5, (1280, 720), (0, 50, 765, 650), 640  # the plate, without the plots beside it
HELD_MS = 1600  # the last picture, with its rings


def main(names: list[str]) -> None:
    for shot in SHOTS:
        if not names or shot.scenario in names:
            take(shot)
            print(shot.file, flush=True)
    if not names or "animation" in names:
        animate()
        print(ANIMATION, flush=True)


def take(shot: Shot) -> None:
    with recorded(shot.scenario, shot.cycles) as run:
        pictures = [run.parent / f"{at}.png" for at in shot.at]
        for at, picture in zip(shot.at, pictures, strict=True):
            take_screenshot(run, picture, at=at)
        join(pictures, ROOT / shot.file, height=shot.height, box=shot.box)


def animate() -> None:
    """One cycle of the separation as an animated WebP, each scene at its own speed."""
    with recorded(ANIMATED, 1) as run:
        pictures = [picture for scene in SCENES for picture in filmed(run, scene)]
    durations = [round(1000.0 / FPS)] * len(pictures)
    durations[-1] = HELD_MS
    pictures[0].save(
        ROOT / ANIMATION, save_all=True, append_images=pictures[1:], duration=durations, loop=0, quality=75, method=6
    )


def filmed(run: Path, scene: Scene) -> Iterator[Image.Image]:
    from imageio_ffmpeg import read_frames

    file = run.parent / "film.mp4"
    make_film(run, file, film_of(run, scene.begin, scene.end, speed=scene.speed, fps=FPS, size=FILMED))
    frames = read_frames(file)
    next(frames)  # says what the film is
    left, top, right, bottom = KEPT
    for frame in frames:
        picture = Image.frombytes("RGB", FILMED, frame).crop(KEPT)
        yield picture.resize((WIDTH, round((bottom - top) * WIDTH / (right - left))), Image.Resampling.LANCZOS)


@contextlib.contextmanager
def recorded(name: str, cycles: int | None) -> Iterator[Path]:
    """The folder of a run of a scenario with one seed, and so many cycles; it is gone afterwards."""
    path = ROOT / "scenarios" / f"{name}.toml"
    raw = load_scenario(path).model_dump(exclude_none=True)
    raw["run"]["seeds"] = 1
    if cycles is not None:
        raw["schedule"]["cycles"] = cycles
    with tempfile.TemporaryDirectory() as folder:
        run = Path(folder) / "run"
        record_run(validated(raw, type(load_scenario(path)), path), run, replay=False)
        yield run


if __name__ == "__main__":
    main(sys.argv[1:])
