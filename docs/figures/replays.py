"""Makes the pictures of replays: `python docs/figures/replays.py [NAME ...]`, of all scenarios below or some of them.

It runs each scenario, for as long as its pictures need, and takes them without a screen.
"""

from __future__ import annotations

import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from tutorial import join

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


def main(names: list[str]) -> None:
    for shot in SHOTS:
        if not names or shot.scenario in names:
            take(shot)
            print(shot.file, flush=True)


def take(shot: Shot) -> None:
    path = ROOT / "scenarios" / f"{shot.scenario}.toml"
    raw = load_scenario(path).model_dump(exclude_none=True)
    raw["run"]["seeds"] = 1
    if shot.cycles is not None:
        raw["schedule"]["cycles"] = shot.cycles
    with tempfile.TemporaryDirectory() as folder:
        run, pictures = Path(folder) / "run", [Path(folder) / f"{at}.png" for at in shot.at]
        record_run(validated(raw, type(load_scenario(path)), path), run, replay=False)
        for at, picture in zip(shot.at, pictures, strict=True):
            take_screenshot(run, picture, at=at)
        join(pictures, ROOT / shot.file, height=shot.height, box=shot.box)


if __name__ == "__main__":
    main(sys.argv[1:])
