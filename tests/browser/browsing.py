"""A browser without a screen, for tests of pages; where there is none, they are skipped."""

from __future__ import annotations

import io
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
SOFTWARE_3D = ("--no-sandbox", "--use-gl=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist")
PIXEL = """([x, y]) => {
  const plate = window.feederPlate, [u, v] = plate.at(x, y), box = plate.$el.getBoundingClientRect();
  return [box.left + u * box.width / plate.$el.width, box.top + v * box.height / plate.$el.height];
}"""  # of a place on the plate of the app [mm]
PATIENCE_MS = 600_000  # for what a page is to show: that of a slow machine, below that of pytest for a test
browsing = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium")


@contextmanager
def browser_page(*, width: int = 1000, height: int = 700) -> Iterator[tuple[Any, list[str]]]:
    """An empty page and a list that every request of it will be in, with those of pages within it."""
    from playwright.sync_api import sync_playwright

    asked: list[str] = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=list(SOFTWARE_3D))
        page = browser.new_context(viewport={"width": width, "height": height}).new_page()
        page.context.set_default_timeout(PATIENCE_MS)
        page.on("request", lambda request: asked.append(request.url))
        page.on("websocket", lambda socket: asked.append(socket.url))
        yield page, asked
        browser.close()


def elsewhere(asked: list[str], allowed: str) -> list[str]:
    """The requests to other places than those that begin with `allowed`."""
    return [url for url in asked if not url.startswith(("data:", "blob:", "about:", allowed))]


def pixels(page: Any, within: str) -> NDArray[np.int64]:
    """What is seen of an element, shape (height, width, 3)."""
    from PIL import Image

    with Image.open(io.BytesIO(page.locator(within).screenshot())) as image:
        return np.asarray(image.convert("RGB"), np.int64)


def wait_until(condition: Callable[[], bool]) -> None:
    """Ask again and again; an assertion fails where it takes longer than a page may."""
    end = time.monotonic() + PATIENCE_MS / 1e3
    while not condition():
        assert time.monotonic() < end, "the page never showed it"


def wait_for_change(page: Any, within: str, share: float = 1e-3) -> None:
    """Wait until a share of the pixels of an element is another one, as while it plays."""
    first = pixels(page, within)
    wait_until(lambda: (np.abs(pixels(page, within) - first).max(axis=-1) > 30).mean() >= share)
