"""Joins the pictures that the tutorial's commands have made: `python docs/figures/tutorial.py my_feeder`."""

from __future__ import annotations

import sys
from pathlib import Path

from PIL import Image

HERE = Path(__file__).parent
SCENE = (0, 90, 1150, 1000)  # of a screenshot, 1920 x 1080: the plate
WHOLE = (0, 0, 1920, 1080)


def main(folder: Path) -> None:
    join([folder / "mode_8.png", folder / "mode_9.png"], HERE / "tutorial_modes.jpg", height=480)
    join([folder / "drift.png"], HERE / "tutorial_drift.jpg", height=640, box=WHOLE)
    join([folder / "gathered.png", folder / "picked.png"], HERE / "tutorial_separation.jpg", height=400, box=SCENE)


def join(pictures: list[Path], path: Path, *, height: int, box: tuple[int, int, int, int] | None = None) -> None:
    """Put pictures side by side."""
    opened = [Image.open(picture).convert("RGB").crop(box) for picture in pictures]
    scaled = [image.resize((round(image.width * height / image.height), height)) for image in opened]
    joined = Image.new("RGB", (sum(image.width for image in scaled), height))
    left = 0
    for image in scaled:
        joined.paste(image, (left, 0))
        left += image.width
    joined.save(path, quality=85)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
