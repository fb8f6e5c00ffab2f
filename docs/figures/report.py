"""Makes the picture of a report: `python docs/figures/report.py PAGE.html [BROWSER]`, for which Chromium is needed."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

HERE = Path(__file__).parent
WIDTH, LONG = 960, 5000  # [pixels] of the window; longer than any page that is looked at
VIEWS = ((0, 1420), (1610, 3030), (3064, 4484))  # from and to [pixels], side by side in the picture
SCALE = 0.6


def main(page: Path, browser: str) -> None:
    """Take a picture of the whole page, and put some parts of it side by side."""
    with tempfile.TemporaryDirectory() as folder:
        shot = Path(folder) / "page.png"
        command = [browser, "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars"]
        command += [f"--window-size={WIDTH},{LONG}", f"--screenshot={shot}", page.resolve().as_uri()]
        subprocess.run(command, check=True, capture_output=True, timeout=120)
        whole = Image.open(shot).convert("RGB")
    views = [whole.crop((0, top, WIDTH, bottom)) for top, bottom in VIEWS]
    joined = Image.new("RGB", (WIDTH * len(views), views[0].height), "white")
    for i, view in enumerate(views):
        joined.paste(view, (WIDTH * i, 0))
    size = round(joined.width * SCALE), round(joined.height * SCALE)
    joined.resize(size, Image.Resampling.LANCZOS).save(HERE / "report.jpg", quality=85)


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2] if len(sys.argv) > 2 else "chromium")
