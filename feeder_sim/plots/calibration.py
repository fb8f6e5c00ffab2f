"""Prior and posterior of every constant on the diagonal, pairs of constants below."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from feeder_sim.document.figure import Figure
from feeder_sim.plots.intervals import COLOURS

if TYPE_CHECKING:
    from feeder_sim.studies.calibration.calibrate import Calibration

BINS, HEIGHT = 24, 2.4
PRIOR_DRAWS = 400


def calibration_figure(study: Calibration) -> Figure:
    """The corner plot."""
    caption = "Equally likely draws of the constants: blue is what the measurements leave, grey the prior."
    return Figure(lambda figure: draw_corner(figure, study), HEIGHT * len(study.keys), "Posterior", caption)


def draw_corner(figure: Any, study: Calibration) -> None:
    """Histograms and pairs of the posterior."""
    keys, posterior = study.keys, study.posterior
    grid = figure.subplots(len(keys), len(keys), squeeze=False)
    for i, row in enumerate(keys):
        prior = study.question.prior[row]
        for j, column in enumerate(keys):
            axes = grid[i, j]
            if j > i:
                axes.set_axis_off()
            elif i == j:
                shares = [(k + 0.5) / PRIOR_DRAWS for k in range(PRIOR_DRAWS)]
                values = [prior.at(share) for share in shares]
                axes.hist(values, bins=BINS, density=True, color="0.8")
                axes.hist(posterior[row], bins=BINS, density=True, color=COLOURS[0], alpha=0.7)
                axes.set_yticks([])
            else:
                axes.plot(posterior[column], posterior[row], ".", color=COLOURS[0], markersize=2, alpha=0.4)
                axes.set_ylim(prior.ends)
                axes.set_xlim(study.question.prior[column].ends)
            if i == len(keys) - 1:
                axes.set_xlabel(column)
            if j == 0 and i > 0:
                axes.set_ylabel(row)
