"""Picture of a dimer in its drift mode: both balls over the plate, and its speed over the aspect ratio."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from feeder_sim.plots.figure import MM, MS, empty_figure
from feeder_sim.studies.validation.bouncing_dimer import FREQUENCY, DimerDrift, turning_point

SHOWN = 4  # periods
TYPICAL = 5.0  # aspect ratio of the dimer whose balls are shown, at least
COLOURS = ("#be3434", "#3a60be", "#e08a1e", "#3a8a5a")


def draw_bouncing_dimer(found: Sequence[DimerDrift], path: Path) -> None:
    """Draw the balls of the first dimer that drifts, and the speeds of all, a line for each friction."""
    figure = empty_figure(9.6, 3.9)
    left, right = figure.subplots(1, 2, width_ratios=[1.0, 1.4])
    drift, bounce = next((d, b) for d in found if d.aspect_ratio >= TYPICAL for b in d.bounces if b.drifts)
    n = int(SHOWN / FREQUENCY / (bounce.time[1] - bounce.time[0])) + 1
    time = MS * (bounce.time[:n] - bounce.time[0])
    left.plot(time, bounce.high[:n] * MM, color=COLOURS[0], label="ball that bounces")
    left.plot(time, bounce.low[:n] * MM, color=COLOURS[1], label="ball on the plate")
    left.set(xlabel="time (ms)", ylabel="over the plate (mm)", xlim=(0.0, time[-1]))
    left.set_ylim(-0.15, 1.35 * MM * bounce.height)
    left.set_title(f"aspect ratio {drift.aspect_ratio:g}, friction {drift.friction:g}", fontsize=9)
    left.legend(fontsize=8, loc="upper right")
    for colour, friction in zip(COLOURS, sorted({d.friction for d in found}), strict=False):
        own = [d for d in found if d.friction == friction]
        ratio = np.array([d.aspect_ratio for d in own])
        right.plot(ratio, [d.speed_mm_s.mean for d in own], "o-", color=colour, label=f"friction {friction:g}")
        right.axvline(turning_point(friction), color=colour, linestyle="--", linewidth=0.9)
    right.axhline(0.0, color="0.5", linewidth=0.8)
    right.set_yscale("symlog", linthresh=0.1)
    right.set_yticks([-10, -1, -0.1, 0, 0.1, 1], ["-10", "-1", "-0.1", "0", "0.1", "1"])
    right.set(xlabel="length over ball diameter", ylabel="speed (mm/s)", xlim=(ratio[0] - 0.5, ratio[-1] + 0.5))
    right.set_title("positive: toward the ball that bounces; dashed: 1 + 1 / friction", fontsize=9)
    right.legend(fontsize=8, loc="lower right", framealpha=1.0)
    right.grid(True, alpha=0.3)
    figure.savefig(path, dpi=150)
