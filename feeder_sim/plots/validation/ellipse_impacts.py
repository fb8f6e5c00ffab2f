"""Picture of measured impacts of an ellipse beside what laws of impact predict."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from feeder_sim.plots.figure import empty_figure
from feeder_sim.studies.validation.ellipse_impacts import (
    FRICTION,
    INVERSE_INERTIA,
    RESTITUTION,
    Comparison,
    EllipseImpacts,
    error_shares,
    newton,
)

COLOURS = ("#be3434", "#3a60be", "#e08a1e", "#3a8a5a")


def draw_ellipse_impacts(impacts: EllipseImpacts, laws: Sequence[Comparison], path: Path) -> None:
    """Draw predicted over measured changes of velocity, and the share of impacts over the error by each law."""
    figure = empty_figure(9.0, 4.2)
    left, right = figure.subplots(1, 2)
    weight = np.array([1.0, 1.0, INVERSE_INERTIA**-0.5])
    predicted = newton(impacts, RESTITUTION, FRICTION)
    measured = (impacts.after - impacts.before) * weight
    for k, name in enumerate(("along the surface", "normal to it", "spin, times radius of gyration")):
        left.plot(measured[:, k], predicted[:, k] * weight[k], ".", color=COLOURS[k], markersize=2.5, label=name)
    ends = np.array([measured.min(), measured.max()])
    left.plot(ends, ends, color="black", linewidth=0.8)
    left.set(xlabel="measured change of velocity (m/s)", ylabel="predicted (m/s)")
    left.set_title(f"Newton and Coulomb, e {RESTITUTION:g}, mu {FRICTION:g}", fontsize=10)
    held_out, share = impacts[1::2], (np.arange(len(impacts.theta[1::2])) + 1.0) / len(impacts.theta[1::2])
    for law, colour in zip(laws, COLOURS, strict=True):
        errors = np.sort(error_shares(held_out, law.law.predict(held_out, *law.constants.values())))
        right.plot(100.0 * errors, 100.0 * share, color=colour, label=f"{law.law.name}, {len(law.constants)} constants")
    right.set(
        xlabel="error over measured change (%)", ylabel="share of impacts (%)", xlim=(0.0, 25.0), ylim=(0.0, 100.0)
    )
    right.set_title("constants from one half, errors of the other", fontsize=10)
    for axes in (left, right):
        axes.grid(True, alpha=0.3)
        axes.legend(fontsize=8)
    figure.savefig(path, dpi=110)
