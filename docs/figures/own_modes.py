"""Joins the pictures that the commands of docs/own_modes.md have made: `python docs/figures/own_modes.py FOLDER`."""

from __future__ import annotations

import sys
from pathlib import Path

from tutorial import HERE, join

SCENE = (0, 130, 1150, 950)  # of a screenshot, 1920 x 1080: the plate


def main(folder: Path) -> None:
    join([folder / "my_modes.png"], HERE / "own_modes_sheet.jpg", height=900)
    join([folder / "hole.png"], HERE / "own_modes_hole.jpg", height=520, box=SCENE)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
