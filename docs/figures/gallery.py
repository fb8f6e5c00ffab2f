"""Makes the small pictures of the gallery: `python docs/figures/gallery.py [NAME ...]`, of all examples or of some.

Each example runs with one seed, for as long as its picture needs; takes some minutes.
"""

from __future__ import annotations

import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from PIL import Image

from feeder_sim.replay.viewer import take_screenshot
from feeder_sim.run.run_folder import record_run
from feeder_sim.scenario import load_scenario
from feeder_sim.scenario.tables import validated

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "docs" / "figures" / "gallery"
SIZE, QUALITY = (320, 240), 85  # of the small pictures [pixels]
Box = tuple[int, int, int, int]
VIEW: Box = (0, 90, 1146, 950)  # of a screenshot of 1920 x 1080: what is seen of the scene in 3D


@dataclass(frozen=True)
class View:
    """What a picture shows.

    Attributes:
        at: time [s].
        duration_s: of the run, or of each stage that is longer.
        box: what is kept of the screenshot.
    """

    at: float
    duration_s: float
    box: Box = VIEW


VIEWS = {
    "ball_50hz": View(0.5, 0.6),
    "ball_500hz": View(0.05, 0.1),
    "ball_558hz": View(0.5, 0.6),
    "bowl_track": View(2.0, 2.1, (115, 170, 515, 470)),
    "brackets": View(0.98, 1.0),
    "chladni_plate": View(0.45, 0.5),
    "cube_toss": View(0.35, 0.704),
    "cylinder_2797hz": View(0.5, 0.6),
    "cylinder_558hz": View(0.5, 0.6),
    "cylinder_6199hz": View(0.5, 0.6),
    "dimer": View(1.0, 1.1, (713, 62, 1213, 437)),
    "drift_2797hz_plate": View(3.0, 3.1),
    "drift_4750hz": View(3.0, 30.0),
    "drift_8775hz": View(1.5, 15.0),
    "wiper": View(3.0, 3.1, (1000, 100, 1500, 475)),
    "linear_feeder": View(2.0, 2.1, (250, 160, 650, 460)),
    "mixture": View(1.0, 1.0),
    "patch_place": View(1.0, 1.1),
    "plate_with_hole": View(6.0, 6.1),
    "platform": View(1.18, 1.0),
    "refill_nuts": View(1.28, 1.0),
    "rigid_plate": View(0.3, 1.0),
    "screws": View(1.0, 1.0),
    "separation_100": View(1.98, 2.0),
    "separation_heap": View(0.48, 1.0),
    "separation_l": View(1.98, 2.0),
    "separation_piezos": View(2.15, 2.0),
    "separation_third_mode": View(3.4, 1.0),
    "separation_uncertain": View(2.48, 2.0),
    "tangle": View(0.98, 1.0, (420, 255, 760, 510)),
    "transport_rectangle": View(4.0, 60.0),
    "transport_strip": View(12.0, 60.0),
    "wave_circulation": View(6.0, 6.1),
    "wave_gather": View(10.0, 10.1),
    "wave_nine_traces": View(6.0, 6.1),
    "wave_split": View(5.0, 5.1),
}


def main(names: list[str]) -> None:
    for name in names or VIEWS:
        take(name, VIEWS[name])
        print(name, flush=True)


def take(name: str, view: View) -> None:
    path = ROOT / "scenarios" / f"{name}.toml"
    scenario = load_scenario(path)
    raw = shortened(scenario.model_dump(exclude_none=True), view.duration_s)
    with tempfile.TemporaryDirectory() as folder:
        run, picture = Path(folder) / "run", Path(folder) / "picture.png"
        record_run(validated(raw, type(scenario), path), run, replay=False)
        take_screenshot(run, picture, at=view.at)
        kept = Image.open(picture).convert("RGB").crop(view.box)
    kept.resize(SIZE, Image.Resampling.LANCZOS).save(FOLDER / f"{name}.jpg", quality=QUALITY, optimize=True)


def shortened(raw: dict[str, Any], duration_s: float) -> dict[str, Any]:
    """A scenario with one seed and one cycle, no part of which lasts longer."""
    raw["run"]["seeds"] = 1
    if "schedule" in raw:
        raw["schedule"]["cycles"] = 1
    for timed in [raw["run"], *raw.get("schedule", {}).get("stage", ())]:
        if "duration_s" in timed:
            timed["duration_s"] = min(timed["duration_s"], duration_s)
    return raw


if __name__ == "__main__":
    main(sys.argv[1:])
