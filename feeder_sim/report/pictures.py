"""Figures as embedded pictures of modest size, in one style."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

from feeder_sim.plots.figure import empty_figure
from feeder_sim.report.page import Picture

WIDTH = 7.6  # [in] of a figure, that of the page
PIXELS_PER_INCH = 180  # in the file: sharp in print, and on screens with small pixels
SHOWN_PER_INCH = 112  # on the page
WIDEST_SCREENSHOT = 1280  # [pixels]
STYLE: dict[str, Any] = {
    "font.size": 9.0,
    "axes.titlesize": 9.0,
    "axes.titlelocation": "left",
    "axes.labelsize": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#5b6875",
    "axes.linewidth": 0.8,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "legend.fontsize": 8.0,
    "legend.frameon": False,
    "text.color": "#1d2733",
    "axes.labelcolor": "#1d2733",
}


def picture_of(draw: Callable[[Any], None], *, height: float, alt: str, caption: str, width: float = WIDTH) -> Picture:
    """Draw on an empty figure of a size [in]; it becomes a PNG of at most 256 colours, a quarter of the size."""
    import matplotlib
    from PIL import Image

    with matplotlib.rc_context(cast("Any", STYLE)):
        figure = empty_figure(width, height)
        draw(figure)
        drawn = io.BytesIO()
        figure.savefig(drawn, format="png", dpi=PIXELS_PER_INCH, bbox_inches="tight", pad_inches=0.04)
    with Image.open(drawn) as image:
        few = image.convert("RGB").quantize(256, dither=Image.Dither.NONE)
        scale = SHOWN_PER_INCH / PIXELS_PER_INCH
        size = round(image.width * scale), round(image.height * scale)
    content = io.BytesIO()
    few.save(content, format="PNG", optimize=True)
    return Picture(content.getvalue(), size, alt, caption)


def picture_from(file: Path, *, alt: str, caption: str) -> Picture:
    """A picture in a file as a JPEG that is not wider than the page needs."""
    from PIL import Image

    with Image.open(file) as image:
        image.thumbnail((WIDEST_SCREENSHOT, WIDEST_SCREENSHOT))
        content = io.BytesIO()
        image.convert("RGB").save(content, format="JPEG", quality=85, optimize=True)
        width, height = image.size
    scale = WIDTH * SHOWN_PER_INCH / width
    return Picture(content.getvalue(), (round(width * scale), round(height * scale)), alt, caption)
