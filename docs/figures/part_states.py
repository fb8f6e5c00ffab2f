"""Draws part_states.svg, the states of a part in the impulse engine: `python docs/figures/part_states.py`.

Boxes are states, arrows the events between them; docs/contact.md has the words. The frame around three states is what
they have in common: another part may hit a part in any of them.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch

BLUE, RED, ORANGE, GREEN, GREY = "#3a60be", "#be3434", "#d68c1e", "#3d8a55", "#888888"
INK = "#333333"
SIZE = 10.4, 5.3  # inches, which are the units of the drawing
WIDTH, HEIGHT = 2.2, 0.98  # of a state
FLYING, TOUCHING = (1.35, 4.3), (1.35, 1.4)
PRESSED, FOLLOWING, RESTING = (5.3, 2.85), (8.95, 4.3), (8.95, 1.4)
FRAME = (3.95, 0.35, 6.3, 4.75)  # left, bottom, width, height


def main() -> None:
    matplotlib.rcParams["svg.hashsalt"] = "part_states"  # the same file every time
    figure = Figure(figsize=SIZE)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(0.0, SIZE[0]), ylim=(0.0, SIZE[1]))
    axes.axis("off")
    left, bottom, width, height = FRAME
    draw_box(axes, (left + 0.5 * width, bottom + 0.5 * height), width, height, GREY, "#f5f5f5", "--")
    axes.text(left + 0.18, bottom + height - 0.16, "in contact", color=GREY, va="top", fontsize=10, style="italic")
    draw_state(axes, FLYING, "flying", "parabola and free top,\nin closed form", BLUE)
    draw_state(axes, TOUCHING, "touching", "impact of all points\nthat touch, at zero time", RED)
    draw_state(axes, PRESSED, "pressed", "forces of one rule, no\nlonger than T'; may slip", ORANGE)
    draw_state(axes, FOLLOWING, "following", "keeps its place on\nthe moving plate", GREEN)
    draw_state(axes, RESTING, "resting", "lies still on a plate\nthat has died out", GREEN)
    draw_events_in_flight(axes)
    draw_events_in_contact(axes)
    figure.savefig(Path(__file__).with_suffix(".svg"), metadata={"Date": None})


def draw_events_in_flight(axes: Axes) -> None:
    """Flight and impacts, and what begins and ends contact."""
    low, high = TOUCHING[1] + 0.5 * HEIGHT, FLYING[1] - 0.5 * HEIGHT
    draw_event(axes, (1.0, high), (1.0, low), BLUE)
    axes.text(0.9, 2.85, "a point\ntouches", ha="right", va="center", color=BLUE, fontsize=9)
    draw_event(axes, (1.7, low), (1.7, high), RED)
    axes.text(1.8, 2.85, "rebounds", ha="left", va="center", color=RED, fontsize=9)
    bottom = TOUCHING[1] - 0.5 * HEIGHT
    draw_event(axes, (0.95, bottom), (1.75, bottom), RED, bend=1.1)
    axes.text(1.35, 0.28, "again while a point approaches", ha="center", va="center", color=RED, fontsize=9)
    right, in_front = 1.35 + 0.5 * WIDTH, PRESSED[0] - 0.5 * WIDTH
    draw_event(axes, (right, 1.65), (in_front, 2.62), RED)
    axes.text(3.08, 2.36, "chatter\nsummed", ha="center", va="center", color=RED, fontsize=9)
    draw_event(axes, (in_front, 3.08), (right, 4.05), ORANGE)
    axes.text(3.3, 3.86, "lift-off", ha="center", va="center", color=ORANGE, fontsize=9)
    draw_event(axes, (FRAME[0], 1.1), (right, 1.1), GREY, style="--")
    axes.text(3.18, 0.98, "hit by\nanother part", ha="center", va="top", color=GREY, fontsize=9)


def draw_events_in_contact(axes: Axes) -> None:
    """Between being pressed, following and resting."""
    top, end, begin = PRESSED[1] + 0.5 * HEIGHT, PRESSED[0] + 0.5 * WIDTH, FOLLOWING[0] - 0.5 * WIDTH
    draw_event(axes, (5.0, top), (5.6, top), ORANGE, bend=-1.4)
    text = "T' is over, drive switches,\nor a slip ends: forces anew"
    axes.text(5.3, top + 0.5, text, ha="center", va="bottom", color=ORANGE, fontsize=9)
    draw_event(axes, (end, 3.22), (begin, 4.45), ORANGE)
    label(axes, 7.0, 4.03, "does not slip,\nsurely held", ORANGE, fill="#f5f5f5")
    draw_event(axes, (begin + 0.55, FOLLOWING[1] - 0.5 * HEIGHT), (end, 2.96), GREEN)
    text = "window ends, drive switches,\nfriction or balance gives way"
    axes.text(7.62, 3.16, text, ha="left", va="center", color=GREEN, fontsize=9)
    draw_event(axes, (end, 2.48), (begin, 1.25), ORANGE)
    label(axes, 7.0, 1.67, "plate is calm,\npart is still", ORANGE, fill="#f5f5f5")
    draw_event(axes, (begin + 0.55, RESTING[1] + 0.5 * HEIGHT), (end, 2.74), GREEN)
    axes.text(7.62, 2.54, "plate moves again", ha="left", va="center", color=GREEN, fontsize=9)


def draw_box(
    axes: Axes, middle: tuple[float, float], width: float, height: float, colour: str, face: str, style: str = "-"
) -> None:
    shape = FancyBboxPatch(
        (middle[0] - 0.5 * width, middle[1] - 0.5 * height),
        width,
        height,
        boxstyle="round,pad=0,rounding_size=0.14",
        edgecolor=colour,
        facecolor=face,
        linestyle=style,
        linewidth=1.0 if style == "--" else 1.8,
    )
    axes.add_patch(shape)


def draw_state(axes: Axes, middle: tuple[float, float], name: str, what: str, colour: str) -> None:
    draw_box(axes, middle, WIDTH, HEIGHT, colour, "white")
    axes.text(middle[0], middle[1] + 0.27, name, ha="center", va="center", color=colour, fontsize=12, weight="bold")
    axes.text(middle[0], middle[1] - 0.15, what, ha="center", va="center", color=INK, fontsize=9, linespacing=1.3)


def draw_event(
    axes: Axes,
    begin: tuple[float, float],
    end: tuple[float, float],
    colour: str,
    bend: float = 0.0,
    style: str = "-",
) -> None:
    """An arrow; bend: height of its arc over its length, for one that comes back to where it began."""
    shape: dict[str, Any] = {"connectionstyle": f"arc3,rad={bend}"} if bend else {}
    arrow = FancyArrowPatch(
        begin,
        end,
        arrowstyle="-|>",
        mutation_scale=13,
        shrinkA=1,
        shrinkB=1,
        color=colour,
        linestyle=style,
        linewidth=1.5,
        **shape,
    )
    axes.add_patch(arrow)


def label(axes: Axes, x: float, y: float, text: str, colour: str, fill: str = "white") -> None:
    """The name of an event, on its arrow."""
    box = {"facecolor": fill, "edgecolor": "none", "pad": 1.5}
    axes.text(x, y, text, ha="center", va="center", color=colour, fontsize=9, bbox=box)


if __name__ == "__main__":
    main()
