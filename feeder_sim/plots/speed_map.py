"""The map of the transport speed over frequency and amplitude: colours, contours, lines of equal throw number."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from feeder_sim.constants import GRAVITY
from feeder_sim.document.figure import Figure, make_logarithmic

if TYPE_CHECKING:
    from feeder_sim.studies.speed_map import MapPoint, SpeedMap

HATCHED = 0.5  # share of the seeds that arrive, below which a mean is that of the fast ones alone
SPEEDS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)  # [mm/s] of contours
RED = "#be3434"
THROWS = (1.0, 10.0, 100.0, 1000.0)  # throw numbers of lines


def map_figure(speed_map: SpeedMap) -> Figure:
    """A map of the transport speed."""

    def draw(figure: Any) -> None:
        draw_points(figure.subplots(), speed_map.points, title=speed_map.heading, marks=speed_map.question.marks)

    label = "Transport speed over drive frequency and amplitude"
    caption = f"{label}: white where no seed arrives, hatched where less than half of them do."
    return Figure(draw, 5.4, f"{label}, {speed_map.size}.", caption)


def draw_points(
    axes: Any, points: Sequence[MapPoint], *, title: str, marks: Sequence[tuple[float, float, float]] = ()
) -> None:
    """Draw a map into axes.

    Args:
        axes: of matplotlib.
        points: in any order; pairs of a frequency and an amplitude that are missing stay white, and those where less
            than `HATCHED` of the seeds arrive are hatched.
        title: over it.
        marks: measured points: frequency [Hz], amplitude [um], speed [mm/s]; in the colour of their speed.
    """
    from matplotlib.colors import LogNorm
    from matplotlib.patheffects import withStroke

    frequencies = np.array(sorted({p.frequency_hz for p in points}))
    amplitudes = np.array(sorted({p.amplitude_um for p in points}))
    speed = np.full((len(amplitudes), len(frequencies)), math.nan)
    share = np.full(speed.shape, math.nan)
    for p in points:
        at = np.searchsorted(amplitudes, p.amplitude_um), np.searchsorted(frequencies, p.frequency_hz)
        speed[at], share[at] = p.mean, p.n / p.seeds
    speeds = speed[np.isfinite(speed)]
    low, high = (speeds.min(), speeds.max()) if speeds.size else (0.1, 1.0)
    norm = LogNorm(low, max(high, 1.001 * low))
    x, y = _edges(frequencies, log=False), _edges(amplitudes, log=True)
    mesh = axes.pcolormesh(x, y, np.ma.masked_invalid(speed), norm=norm, cmap="viridis", rasterized=True)
    if np.isfinite(share).any() and min(speed.shape) > 1:
        levels = [level for level in SPEEDS if low < level < high]
        if levels:
            lines = axes.contour(frequencies, amplitudes, speed, levels=levels, colors="white", linewidths=1.0)
            axes.clabel(lines, fmt="%g mm/s", fontsize=7)
        if (share < HATCHED).any():
            axes.contourf(frequencies, amplitudes, share < HATCHED, levels=[0.5, 1.5], colors="none", hatches=["///"])
    fine, halo = np.linspace(x[0], x[-1], 400), [withStroke(linewidth=2.5, foreground="white")]  # on every colour
    for throw in THROWS:
        amplitude = 1e6 * throw * GRAVITY / (2.0 * math.pi * fine) ** 2
        inside = (amplitude > y[0]) & (amplitude < y[-1])
        if inside.any():
            width = 1.6 if throw == 1.0 else 0.8
            axes.plot(fine[inside], amplitude[inside], color=RED, linewidth=width, path_effects=halo)
            axes.annotate(
                f"throw number {throw:g}",
                (fine[inside][0], amplitude[inside][0]),
                xytext=(3, -9 if amplitude[inside][0] > 0.8 * y[-1] else 2),
                textcoords="offset points",
                color=RED,
                path_effects=halo,
                fontsize=7,
            )
    for frequency, amplitude_um, measured in marks:
        axes.scatter([frequency], [amplitude_um], c=[measured], norm=norm, cmap="viridis", s=90, edgecolors="white")
        axes.annotate(
            f"measured {measured:g} mm/s",
            (frequency, amplitude_um),
            xytext=(0, -14),
            textcoords="offset points",
            ha="right" if frequency > 0.5 * (x[0] + x[-1]) else "left",
            color="white",
            fontsize=8,
        )
    make_logarithmic(axes.yaxis)
    axes.set(xlim=(x[0], x[-1]), ylim=(y[0], y[-1]))
    axes.set(xlabel="drive frequency (Hz)", ylabel="amplitude of the antinode (µm)", title=title)
    colours = axes.figure.colorbar(mesh, ax=axes, label="transport speed (mm/s)")
    make_logarithmic(colours.ax.yaxis)


def _edges(centres: np.ndarray, *, log: bool) -> np.ndarray:
    """Edges of cells around sorted centres (n,), shape (n + 1,)."""
    values = np.log(centres) if log else centres
    middle = 0.5 * (values[1:] + values[:-1])
    first, last = (
        (values[1] - values[0], values[-1] - values[-2]) if len(values) > 1 else (0.1 * abs(values[0]) + 0.1,) * 2
    )
    edges = np.concatenate([[values[0] - 0.5 * first], middle, [values[-1] + 0.5 * last]])
    return np.exp(edges) if log else edges
