"""Picture of the oblique impact of a sphere, by theory and by the engines."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from feeder_sim.plots.figure import empty_figure
from feeder_sim.studies.validation.oblique_spheres import Rebound, sliding_angle, theory

MARKS = {"impulse": ("o", "#be3434"), "mujoco": ("x", "#3a60be")}


def draw_oblique_spheres(angle: NDArray[np.float64], methods: Mapping[str, Rebound], path: Path) -> None:
    """Draw tangential restitution and angular velocity over the angle of incidence [deg]."""
    figure = empty_figure(9.0, 3.6)
    left, right = figure.subplots(1, 2)
    fine = np.linspace(1.0, 89.5, 400)
    exact = theory(fine)
    left.plot(fine, exact.tangential, color="black", linewidth=1.0, label="theory")
    right.plot(fine, exact.spin, color="black", linewidth=1.0, label="theory")
    for name, (mark, colour) in MARKS.items():
        left.plot(angle, methods[name].tangential, mark, color=colour, markersize=5, fillstyle="none", label=name)
        right.plot(angle, methods[name].spin, mark, color=colour, markersize=5, fillstyle="none", label=name)
    left.set(ylabel="tangential restitution of the centre (1)")
    right.set(ylabel="angular velocity after (rad/s)")
    for axes in (left, right):
        axes.axvline(sliding_angle(), color="gray", linewidth=0.8, linestyle="--")
        axes.set(xlabel="angle of incidence to the normal (degrees)", xlim=(0.0, 90.0))
        axes.grid(True, alpha=0.3)
        axes.legend(fontsize=8)
    figure.savefig(path, dpi=110)
