"""Figures of documents: drawn by matplotlib in one style when they are needed, to a picture or a file."""

from __future__ import annotations

import base64
import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, cast

MOST_TICKS = 12  # of a logarithmic axis
MM, UM, MS = 1e3, 1e6, 1e3  # per m, per m, per s
WIDTH = 7.6  # [in] of a figure, that of the page
PIXELS_PER_INCH = 180  # in the file: sharp in print, and on screens with small pixels
PAGE_PIXELS_PER_INCH = 112  # on the page
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


@dataclass(frozen=True)
class Picture:
    """An embedded picture: PNG or JPEG, its size [pixels], what it shows for who cannot see it, and its legend."""

    kind: ClassVar[str] = "picture"
    content: bytes
    size: tuple[int, int]
    alt: str
    caption: str

    @property
    def source(self) -> str:
        """The picture as an address that holds it."""
        of_type = "png" if self.content.startswith(b"\x89PNG") else "jpeg"
        return f"data:image/{of_type};base64,{base64.b64encode(self.content).decode()}"


@dataclass(frozen=True)
class Figure:
    """What is drawn on an empty figure of matplotlib of a size [in], what it shows, and its legend."""

    kind: ClassVar[str] = "picture"
    draw: Callable[[Any], None]
    height: float
    alt: str
    caption: str
    width: float = WIDTH

    @property
    def source(self) -> str:
        return self.picture.source

    @property
    def size(self) -> tuple[int, int]:
        return self.picture.size

    @cached_property
    def picture(self) -> Picture:
        """A PNG of at most 256 colours, a quarter of the size."""
        from PIL import Image

        with Image.open(io.BytesIO(_png([self]))) as image:
            quantized = image.convert("RGB").quantize(256, dither=Image.Dither.NONE)
            scale = PAGE_PIXELS_PER_INCH / PIXELS_PER_INCH
            size = round(image.width * scale), round(image.height * scale)
        content = io.BytesIO()
        quantized.save(content, format="PNG", optimize=True)
        return Picture(content.getvalue(), size, self.alt, self.caption)


def save_figures(figures: Sequence[Figure], path: Path) -> None:
    """Write figures beside each other into a PNG."""
    path.write_bytes(_png(figures))


def _png(figures: Sequence[Figure]) -> bytes:
    import matplotlib

    with matplotlib.rc_context(cast("Any", STYLE)):
        sheet = empty_figure(sum(f.width for f in figures), max(f.height for f in figures))
        parts = sheet.subfigures(1, len(figures), squeeze=False)[0] if len(figures) > 1 else [sheet]
        for part, figure in zip(parts, figures, strict=True):
            figure.draw(part)
        content = io.BytesIO()
        sheet.savefig(content, format="png", dpi=PIXELS_PER_INCH, bbox_inches="tight", pad_inches=0.04)
    return content.getvalue()


def picture_from(file: Path, *, alt: str, caption: str) -> Picture:
    """A picture in a file as a JPEG that is not wider than the page needs."""
    from PIL import Image

    with Image.open(file) as image:
        image.thumbnail((WIDEST_SCREENSHOT, WIDEST_SCREENSHOT))
        content = io.BytesIO()
        image.convert("RGB").save(content, format="JPEG", quality=85, optimize=True)
        width, height = image.size
    scale = WIDTH * PAGE_PIXELS_PER_INCH / width
    return Picture(content.getvalue(), (round(width * scale), round(height * scale)), alt, caption)


def empty_figure(width: float, height: float) -> Any:
    """An empty figure of a size in inches; matplotlib is imported only where something is drawn."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def make_logarithmic(axis: Any) -> None:
    """Make an axis logarithmic, with ticks at 1, 2 and 5 in plain numbers; sweeps seldom go over many decades."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    (axis.axes.set_xscale if axis.axis_name == "x" else axis.axes.set_yscale)("log")
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=MOST_TICKS))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())
