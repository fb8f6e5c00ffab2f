"""Friction and restitution from one half of the tosses of a cube, the last places of the other half predicted.

    python benchmarks/validation/toss_calibration.py [--data FILE] [--seed 1] [--ends FILE] [--json] [--picture FILE]

Even tosses are the first, third, ... row of the table, odd ones those between (the numbers in the data are all even). A
cube lies on a face, so a last place is x and y of its centre. Its error is isotropic in the plane and a Student's t of
two dimensions, whose width and degrees of freedom are learnt with the constants: a toss that comes to lie on another
face is in its tail. What tracking, board and engine leave is all in this law; the tracked start is taken as it is.

A likelihood of tosses is rough over the constants, and `effective` points of the design few: widths of their posteriors
are rough, too. Predictions hardly depend on that, since the scatter is far wider than what the constants leave open.

`half_width_mm`: median over the tosses of half the 90 % interval; `coverage`: share of the measured last places within
the interval of x, of y, and within the circle about the median that holds 90 % of the draws.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from arguments import new_file, whole
from cube_tosses import DATA, FRICTION, RESTITUTION, Toss, compute_tosses, read_tosses
from numpy.typing import NDArray
from scipy.special import gammaln
from scipy.stats import qmc

from feeder_sim.document.figure import MM, empty_figure
from feeder_sim.errors import InputError
from feeder_sim.pool.work import available_cores
from feeder_sim.studies.calibration.posterior import interval, resampled

Floats = NDArray[np.float64]
Ends = Callable[[Floats], Floats]  # of constants (points, 2) the last places (points, tosses, 2) [m]

NAMES = ("friction", "restitution")
LOW, HIGH = np.array([0.05, 0.02]), np.array([0.5, 0.5])  # of the uniform priors
WIDTHS = np.geomspace(5e-3, 0.2, 60)  # [m] of the scatter, equally likely
FREEDOMS = np.array([1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 10.0, 30.0])  # degrees of freedom of the scatter, equally likely
# Rounds of the design: points (a power of two), and the box that they fill, each around the peak of the likelihood of
# both halves in the round before. A design does not tilt the posterior: weights undo the density of its points.
ROUNDS = (
    (128, LOW, HIGH),
    (128, np.array([0.14, 0.02]), np.array([0.22, 0.3])),
    (64, np.array([0.177, 0.02]), np.array([0.191, 0.24])),
)
DRAWS = 4000
COVERED = 0.9


@dataclass(frozen=True)
class Design:
    """Constants, with the last places that they give.

    Attributes:
        constants: friction and restitution, (points, 2).
        density: of the points of all rounds together, over that of the priors, (points,).
        ends: last places, (points, tosses, 2) [m].
    """

    constants: Floats
    density: Floats
    ends: Floats


@dataclass(frozen=True)
class Calibration:
    """Equally likely draws of the posterior.

    Attributes:
        point: of the design, (draws,).
        constants: friction and restitution, (draws, 2).
        width, freedom: of the scatter, (draws,) [m], [1].
        effective: how many points of the design their weights amount to.
    """

    point: NDArray[np.intp]
    constants: Floats
    width: Floats
    freedom: Floats
    effective: float

    def ends(self, design: Design, tosses: slice, rng: np.random.Generator) -> Floats:
        """Last places with their scatter, (draws, tosses, 2) [m]."""
        ends = design.ends[self.point, tosses]
        return ends + scattered(self.width, self.freedom, ends.shape, rng)


@dataclass(frozen=True)
class Prediction:
    """Draws of last places against the measured ones: (draws, tosses, 2) and (tosses, 2) [m]."""

    ends: Floats
    measured: Floats

    @property
    def median(self) -> Floats:
        """Of every toss and axis, (tosses, 2) [m]."""
        return np.asarray(np.median(self.ends, axis=0))

    @property
    def error(self) -> Floats:
        """Distance of the median from the measured last place, (tosses,) [m]."""
        return np.asarray(np.linalg.norm(self.measured - self.median, axis=1))

    @property
    def bounds(self) -> tuple[Floats, Floats]:
        """Of the interval of every toss and axis, each (tosses, 2) [m]."""
        half = 0.5 * (1.0 - COVERED)
        low, high = np.quantile(self.ends, (half, 1.0 - half), axis=0)
        return low, high

    @property
    def within(self) -> NDArray[np.bool_]:
        """Whether the interval of x, that of y, and the circle hold the measured place, (tosses, 3)."""
        low, high = self.bounds
        radius = np.quantile(np.linalg.norm(self.ends - self.median, axis=2), COVERED, axis=0)
        axes = (low <= self.measured) & (self.measured <= high)
        return np.column_stack([axes, self.error <= radius])

    def summary(self) -> dict[str, float]:
        """The figures by name, as JSON takes them."""
        low, high = self.bounds
        coverage = self.within.mean(axis=0)
        error = np.sqrt(coverage * (1.0 - coverage) / len(self.measured))
        return {
            "n": len(self.measured),
            "median_error_mm": MM * float(np.median(self.error)),
            "half_width_mm": MM * float(np.median(0.5 * (high - low))),
            **{f"coverage_{name}": float(c) for name, c in zip(("x", "y", "circle"), coverage, strict=True)},
            **{f"coverage_{name}_se": float(e) for name, e in zip(("x", "y", "circle"), error, strict=True)},
        }


def log_scatter(distance: Floats, width: Floats, freedom: Floats) -> Floats:
    """Log of the density [1/m^2] of a Student's t of two dimensions at distances from its centre [m]."""
    norm = gammaln(0.5 * freedom + 1.0) - gammaln(0.5 * freedom) - np.log(np.pi * freedom * width**2)
    return np.asarray(norm - (0.5 * freedom + 1.0) * np.log1p((distance / width) ** 2 / freedom))


def scattered(width: Floats, freedom: Floats, shape: tuple[int, ...], rng: np.random.Generator) -> Floats:
    """Errors of last places, (draws, tosses, 2) [m], with widths [m] and degrees of freedom (draws,)."""
    normal = rng.normal(size=shape)
    stretch = np.sqrt(freedom[:, None] / rng.chisquare(freedom[:, None], shape[:2]))
    return np.asarray(width[:, None, None] * stretch[:, :, None] * normal)


def log_likelihood(ends: Floats, measured: Floats) -> Floats:
    """Of last places (points, tosses, 2) with every scatter, (points, widths, freedoms)."""
    distance = np.linalg.norm(ends - measured, axis=2)
    return np.array([[log_scatter(distance, s, f).sum(axis=1) for f in FREEDOMS] for s in WIDTHS]).transpose(2, 0, 1)


def designed(ends: Ends, seed: int = 1) -> Design:
    """Sobol's points in the boxes of all rounds, with their last places."""
    constants = np.vstack([qmc.scale(qmc.Sobol(2, rng=seed).random(n), low, high) for n, low, high in ROUNDS])
    total = sum(n for n, _, _ in ROUNDS)
    density = np.zeros(total)
    for n, low, high in ROUNDS:
        inside = ((constants >= low) & (constants <= high)).all(axis=1)
        density += n / total * inside / np.prod((high - low) / (HIGH - LOW))
    return Design(constants, density, ends(constants))


def calibrated(design: Design, measured: Floats, tosses: slice, seed: int = 1) -> Calibration:
    """The posterior of constants and scatter by some of the tosses."""
    logs = log_likelihood(design.ends[:, tosses], measured[tosses])
    weights = np.exp(logs - logs.max()) / design.density[:, None, None]
    weights /= weights.sum()
    effective = 1.0 / float((weights.sum(axis=(1, 2)) ** 2).sum())
    rows = resampled(weights.ravel(), DRAWS, np.random.default_rng(seed))
    point, width, freedom = np.unravel_index(rows, weights.shape)
    return Calibration(point, design.constants[point], WIDTHS[width], FREEDOMS[freedom], effective)


@dataclass
class Computer:
    """Computes last places by the impulse engine, in as many processes as there are cores.

    Attributes:
        tosses: measured.
        file: takes what has been computed, point by point, and gives it back to a later call; None for none.
    """

    tosses: Sequence[Toss]
    file: Path | None = None

    def __post_init__(self) -> None:
        self._known: dict[tuple[float, ...], Floats] = {}
        if self.file and self.file.exists():
            with np.load(self.file) as kept:
                if kept["ends"].shape[1] != len(self.tosses):
                    raise InputError(f"is of {kept['ends'].shape[1]} tosses, not {len(self.tosses)}", file=self.file)
                self._known = dict(zip(map(_key, kept["constants"]), kept["ends"], strict=True))

    def __call__(self, constants: Floats) -> Floats:
        """Last places, (points, tosses, 2) [m]."""
        new = [each for each in constants if _key(each) not in self._known]
        if new:
            with ProcessPoolExecutor(min(available_cores(), len(new))) as pool:
                for each, ends in zip(new, pool.map(partial(ends_of, self.tosses), new), strict=True):
                    self._known[_key(each)] = ends
                    if self.file:
                        part = self.file.with_name(f"{self.file.name}.part.npz")
                        np.savez(part, constants=list(self._known), ends=list(self._known.values()))
                        part.replace(self.file)
        return np.array([self._known[_key(each)] for each in constants])


def _key(constants: Floats) -> tuple[float, ...]:
    return tuple(constants.round(12).tolist())


def ends_of(tosses: Sequence[Toss], constants: Floats) -> Floats:
    """Last places with one friction and restitution, (tosses, 2) [m]."""
    friction, restitution = constants.tolist()
    return compute_tosses(tosses, friction=friction, restitution=restitution).computed[:, :2]


EVEN, ODD = slice(0, None, 2), slice(1, None, 2)


def study(ends: Computer, seed: int) -> tuple[dict[str, Calibration], dict[str, Prediction]]:
    """Posteriors by the half that they are calibrated on, and predictions by what they are made with."""
    measured = np.array([toss.end_position[:2] for toss in ends.tosses])
    design = designed(ends, seed)
    given = np.array([[FRICTION, RESTITUTION]])
    authors = Design(given, np.ones(1), ends(given))
    rng = np.random.default_rng(seed)
    even, odd = (calibrated(design, measured, half, seed) for half in (EVEN, ODD))
    scatter = calibrated(authors, measured, EVEN, seed)
    return {"even": even, "odd": odd}, {
        "posterior of the even": Prediction(even.ends(design, ODD, rng), measured[ODD]),
        "authors' constants, scatter of the even": Prediction(scatter.ends(authors, ODD, rng), measured[ODD]),
        "prior, no scatter": Prediction(design.ends[: ROUNDS[0][0], ODD], measured[ODD]),
        "swapped: the even by the posterior of the odd": Prediction(odd.ends(design, EVEN, rng), measured[EVEN]),
    }


def draw_calibration(calibrations: dict[str, Calibration], prediction: Prediction, path: Path) -> None:
    """Draw both posteriors beside the authors' constants, and where measured places lie in their intervals."""
    figure = empty_figure(9.6, 4.2)
    constants, shares = figure.subplots(1, 2)
    for (name, each), colour in zip(calibrations.items(), ("#c23030", "#1f5fa8"), strict=True):
        point, count = np.unique(each.constants, axis=0, return_counts=True)
        constants.scatter(*point.T, s=1500.0 * count / DRAWS, color=colour, alpha=0.5, label=f"{name} tosses")
    constants.plot(FRICTION, RESTITUTION, "k+", markersize=12, label="authors of the data")
    constants.set(xlabel="friction", ylabel="restitution", title="Posterior: area is probability")
    legend = constants.legend(fontsize=8)
    for handle in legend.legend_handles[: len(calibrations)]:
        handle.set_sizes([40.0])
    nominal = np.linspace(0.0, 1.0, 101)
    for axis, colour in zip((0, 1), ("#6b8e23", "#8b5a2b"), strict=True):
        rank = (prediction.ends[:, :, axis] < prediction.measured[:, axis]).mean(axis=0)
        covered = (np.abs(2.0 * rank - 1.0)[:, None] <= nominal).mean(axis=0)
        shares.plot(nominal, covered, color=colour, label="xy"[axis])
    shares.plot(nominal, nominal, color="#999999", linewidth=0.8, linestyle=":")
    shares.set(xlabel="interval", ylabel="share of the odd tosses within", title="Coverage, calibrated on the even")
    shares.legend(fontsize=8, loc="upper left")
    for axes in (constants, shares):
        axes.grid(True, alpha=0.3)
    figure.savefig(path, dpi=130)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=DATA, help="table of tosses [that beside this script]")
    parser.add_argument("--seed", type=whole(0, 2**31), default=1, help="of the design and of the draws [1]")
    parser.add_argument(
        "--ends", type=new_file, help="computed last places (.npz): read if it exists, and added to [not kept]"
    )
    parser.add_argument("--json", action="store_true", help="print the figures as JSON")
    parser.add_argument("--picture", type=new_file, help="draw the posteriors and the coverage [not drawn]")
    options = parser.parse_args()
    calibrations, predictions = study(Computer(read_tosses(options.data), options.ends), options.seed)
    posteriors = {
        name: {
            **{key: interval(each.constants[:, k]) for k, key in enumerate(NAMES)},
            "width_mm": interval(MM * each.width),
            "freedom": interval(each.freedom),
            "effective": each.effective,
        }
        for name, each in calibrations.items()
    }
    summaries = {name: each.summary() for name, each in predictions.items()}
    fitted, given, *_ = predictions.values()
    nearer = float((fitted.error < given.error).mean())
    if options.json:
        print(json.dumps({"posteriors": posteriors, "predictions": summaries, "nearer": nearer}))
    else:
        for name, each in posteriors.items():
            bounds = ", ".join(
                f"{k} {v['median']:.3g} ({v['low']:.3g} to {v['high']:.3g})"
                for k, v in each.items()
                if isinstance(v, dict)
            )
            print(f"{name}: {bounds}; {each['effective']:.1f} effective points")
        for name, of in summaries.items():
            coverage = ", ".join(
                f"{key} {of[f'coverage_{key}']:.3f} +- {of[f'coverage_{key}_se']:.3f}" for key in ("x", "y", "circle")
            )
            print(
                f"{name}: median error {of['median_error_mm']:.1f} mm, half-width {of['half_width_mm']:.1f} mm, "
                f"coverage {coverage}, {of['n']} tosses"
            )
        print(f"nearer by the posterior than by the authors' constants: {nearer:.3f} of the odd tosses")
    if options.picture:
        draw_calibration(calibrations, predictions["posterior of the even"], options.picture)
    return 0


if __name__ == "__main__":
    sys.exit(main())
