"""Draws hop.svg, the sketch of one hop on the physics page: `python docs/figures/hop.py`.

Left, the stroke of surface points over half a wavelength, from the package's own standing wave at 4750 Hz; strokes are
drawn a few thousand times too long. Right, one hop in time of a part that rides on the antinode until the plate falls
away under it, at a throw number small enough for the hop to fit the picture.
"""

from __future__ import annotations

import math
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from feeder_sim.plate.materials import MATERIALS
from feeder_sim.plate.mode_shapes import standing_wave
from feeder_sim.plate.rectangle import RectangularPlate

PLATE = RectangularPlate(1.0, 1.0, 3e-3, MATERIALS["aluminium"])
FREQUENCY = 4750.0
STROKE_MM = 2.6  # half a stroke at the antinode, as drawn
THROW_NUMBER = 4.6  # of the right half
BLUE, RED, ORANGE, GREY = "#3a60be", "#be3434", "#d68c1e", "#888888"


def main() -> None:
    matplotlib.rcParams["svg.hashsalt"] = "hop"  # the same file every time
    figure = Figure(figsize=(10.0, 3.9), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=[1.15, 1.0])
    draw_strokes(left)
    draw_hop(right)
    figure.savefig(Path(__file__).with_suffix(".svg"), metadata={"Date": None})


def draw_strokes(axes: Axes) -> None:
    """Surface points move on straight lines that lean toward the node."""
    wave = standing_wave(PLATE, FREQUENCY)
    quarter = 0.25e3 * wave.wavelength  # [mm]
    x = np.linspace(-0.25 * quarter, 1.25 * quarter, 300)
    up = STROKE_MM * np.cos(1e-3 * x * wave.wavenumber)
    along = STROKE_MM * 0.5 * PLATE.thickness * wave.rotation * np.sin(1e-3 * x * wave.wavenumber)
    axes.axhline(0.0, color="0.8", linewidth=0.8)
    for sign, style in ((1.0, "-"), (-1.0, "--")):
        axes.plot(x + sign * along, sign * up, style, color=BLUE, linewidth=1.6)
    for place in np.linspace(0.0, quarter, 7):
        w = STROKE_MM * math.cos(1e-3 * place * wave.wavenumber)
        u = STROKE_MM * 0.5 * PLATE.thickness * wave.rotation * math.sin(1e-3 * place * wave.wavenumber)
        arrow = {"arrowstyle": "<->", "color": RED, "shrinkA": 0, "shrinkB": 0, "linewidth": 1.3}
        axes.annotate("", (place + u, w), (place - u, -w), arrowprops=arrow)
    for begin, height in ((4.2, 2.3), (8.0, 1.7), (11.4, 1.1), (14.0, 0.6)):
        hop = np.linspace(0.0, 1.0, 40)
        length = 1.25 * height
        axes.plot(begin + length * hop, 3.2 + 4.0 * height * hop * (1.0 - hop), color=ORANGE, linewidth=1.6)
    axes.text(4.0, 6.1, "hops toward the node", color=ORANGE)
    axes.text(0.0, -4.6, "antinode", ha="center")
    axes.text(quarter, -4.6, "node", ha="center")
    axes.text(9.6, -3.4, "stroke of the surface", color=RED, ha="center")
    axes.set(xlabel="x (mm)", ylabel="displacement, exaggerated", yticks=[], ylim=(-5.4, 7.4))
    axes.set_title("Between antinode and node the stroke leans toward the node", fontsize=10)


def draw_hop(axes: Axes) -> None:
    """A part leaves when the plate falls faster than it can, flies in a parabola, and meets the plate again."""
    leave = math.asin(1.0 / THROW_NUMBER) / (2.0 * math.pi)  # [periods]; A omega^2 sin(omega t) = g
    gravity = (2.0 * math.pi) ** 2 / THROW_NUMBER  # [A / period^2]
    start = math.sin(2.0 * math.pi * leave)
    speed = 2.0 * math.pi * math.cos(2.0 * math.pi * leave)

    def part(t: float) -> float:
        return start + speed * (t - leave) - 0.5 * gravity * (t - leave) ** 2

    t, step = leave + 0.3, 1e-4
    while part(t) > math.sin(2.0 * math.pi * t):
        t += step
    land = t
    times = np.linspace(-0.45, land + 0.85, 600)
    axes.plot(times, np.sin(2.0 * math.pi * times), color=BLUE, linewidth=1.6)
    flight = np.linspace(leave, land, 200)
    axes.plot(flight, [part(t) for t in flight], color=ORANGE, linewidth=1.8)
    for at in (leave, land):
        axes.plot([at], [math.sin(2.0 * math.pi * at)], "o", color=RED, markersize=6)
    top = leave + speed / gravity
    axes.text(top, part(top) + 0.15, "flight: a parabola, in closed form", color=ORANGE, ha="center")
    note = {"arrowstyle": "->", "color": GREY}
    axes.annotate("leaves with\nthe surface's\nvelocity", (leave, start), (-0.5, 1.6), arrowprops=note)
    axes.annotate("impact: restitution\nand friction", (land, part(land)), (land + 0.02, 1.5), arrowprops=note)
    axes.text(0.75, -1.65, "surface under the part", color=BLUE, ha="center")
    axes.set(xlabel="time (periods of the plate)", ylabel="height / amplitude", ylim=(-2.0, part(top) + 0.8))
    axes.set_title("One hop in time", fontsize=10)


if __name__ == "__main__":
    main()
