"""Takes the picture of the page of `feeder-sim app`: `python docs/figures/app.py`. It needs Chromium and playwright."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parents[1] / "tests/browser"))
from browsing import PIXEL, browser_page  # noqa: E402
from PIL import Image  # noqa: E402


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        words = [sys.executable, "-m", "feeder_sim", "app", "separation_l", "--no-show", "--folder", f"{folder}/mine"]
        server = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
        assert server.stdout is not None
        try:
            with browser_page(width=1360, height=700) as (page, _):
                page.goto(server.stdout.readline().strip())
                page.wait_for_function("window.feederPlate && window.feederPlate.field", timeout=60_000)
                page.get_by_role("tab", name="Modes").click()
                page.get_by_role("button", name="drift").click()
                page.mouse.move(*page.evaluate(PIXEL, [0, -70]))
                time.sleep(4.0)
                page.screenshot(path=f"{folder}/app.png")
            with Image.open(f"{folder}/app.png") as taken:
                taken.convert("RGB").save(HERE / "app.jpg", quality=85)
        finally:
            server.terminate()
            server.communicate(timeout=30)


if __name__ == "__main__":
    main()
