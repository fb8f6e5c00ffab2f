"""How fast the page of `feeder-sim app` answers, and what it holds: in a browser without a screen.

    python benchmarks/app_response.py [--drags 50] [--minutes 1]

It drags a patch of a plate of 200 x 140 mm and takes the time from the move of the mouse to the new field on the
canvas, then works on the page for some minutes, and takes the memory of the server and of the page.
"""

from __future__ import annotations

import argparse
import math
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import psutil  # type: ignore[import-untyped]

sys.path.insert(0, str(Path(__file__).parents[1] / "tests/browser"))
from browsing import browser_page

PIXEL = """([x, y]) => {
  const plate = window.feederPlate, [u, v] = plate.at(x, y), box = plate.$el.getBoundingClientRect();
  return [box.left + u * box.width / plate.$el.width, box.top + v * box.height / plate.$el.height];
}"""
MB = 1e6


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--drags", type=int, default=50)
    parser.add_argument("--minutes", type=float, default=1.0)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        words = [sys.executable, "-m", "feeder_sim", "app", "--no-show", "--folder", f"{folder}/mine"]
        server = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
        assert server.stdout is not None
        try:
            with browser_page(width=1500, height=900) as (page, _):
                page.goto(server.stdout.readline().strip())
                page.wait_for_function("window.feederPlate && window.feederPlate.field")
                time.sleep(3.0)
                milliseconds = dragged(page, asked.drags)
                median, worst = statistics.median(milliseconds), max(milliseconds)
                print(f"drag to field: median {median:.0f} ms, worst {worst:.0f} ms of {len(milliseconds)}", flush=True)
                watch(page, psutil.Process(server.pid), asked.minutes)
        finally:
            server.terminate()
            server.communicate(timeout=30)


def dragged(page: Any, n: int) -> list[float]:
    """Times of so many moves of a patch that is dragged around [ms]."""
    page.evaluate("window.feederPlate.latencies.length = 0")
    patch = page.evaluate("(({x, y}) => [x, y])(window.feederPlate.scene.things[0])")
    page.mouse.move(*page.evaluate(PIXEL, patch))
    page.mouse.down()
    begin = time.monotonic()
    while len(found := page.evaluate("window.feederPlate.latencies")) < n:
        if time.monotonic() - begin > 15.0:
            raise SystemExit(f"only {len(found)} of {n} fields came")
        turn = 2.0 * math.pi * len(found) / n
        page.mouse.move(*page.evaluate(PIXEL, [30 * math.cos(turn) + math.sin(40 * turn), 20 + 25 * math.sin(turn)]))
        time.sleep(0.1)
    page.mouse.up()
    return list(found)


def watch(page: Any, server: psutil.Process, minutes: float) -> None:
    """Drag, tune and undo for some minutes, and print the memory at ten times."""
    begin, told = time.monotonic(), 0
    while (spent := (time.monotonic() - begin) / 60.0) < minutes or told < 10:
        before = page.evaluate("window.feederPlate.scene.things[0].y")
        dragged(page, 10)
        page.wait_for_function("(y) => window.feederPlate.scene.things[0].y !== y", arg=before)
        page.get_by_label("Undo").click()
        page.wait_for_function("(y) => window.feederPlate.scene.things[0].y === y", arg=before)
        if spent >= minutes * told / 9.0:
            told += 1
            heap = page.evaluate("performance.memory ? performance.memory.usedJSHeapSize : 0")
            print(
                f"{spent:5.1f} min: server {server.memory_info().rss / MB:.0f} MB, page {heap / MB:.0f} MB", flush=True
            )


if __name__ == "__main__":
    main()
