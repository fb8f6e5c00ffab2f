"""`feeder-sim calibrate` beside other methods: two constants from two drifts, all against a grid of many seeds.

    python benchmarks/calibration_methods.py --reference grid.npz [--seed 0] [--most 200] [--only ours --only emcee]

Restitution and friction, uniform from 0.05 to 0.7, from docs/examples/drifts.toml without its amplitude and candidates.
The reference is computed where the file is not there: `--blocks` of 16 seeds of both drifts at 11 x 13 points, 140 s of
processor time each. A polynomial goes through their means, and the posterior is summed; what less of the grid gives
stands below it.
*Off* is the largest distance of medians and ends of 90 % intervals from the reference, in its standard deviations, *D*
that of distribution functions (Kolmogorov and Smirnov), over both constants.

Methods that are not installed are left out. They need

    pip install emcee pyvbmc scikit-learn && pip install --no-deps grainlearning

as GrainLearning asks for numpy below 2, and runs with 2 as well.
"""

from __future__ import annotations

import functools
import io
import math
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import redirect_stdout
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from numpy.polynomial.chebyshev import chebvander
from numpy.typing import NDArray
from scipy.interpolate import RectBivariateSpline
from scipy.stats import t as student

from feeder_sim.jobs.ledger import Ledger
from feeder_sim.jobs.runner import Runner
from feeder_sim.measures.catalogue import values_of_seed
from feeder_sim.pool.work import Work
from feeder_sim.pool.workers import workers_of
from feeder_sim.run.simulation import simulate
from feeder_sim.studies.calibration.calibrate import CalibrateQuestion, calibration_of, observed
from feeder_sim.studies.calibration.posterior import Posterior

Floats = NDArray[np.float64]
FILE = Path(__file__).parents[1] / "docs" / "examples" / "drifts.toml"
MEASURE = "transport_speed_mm_s"
ROWS, COLUMNS, BLOCK = 11, 13, 16  # points along restitution and friction, seeds of a block
HIGHEST = (
    10.0 / 12.0
)  # share of the prior of restitution; nuts fly at 8775 Hz above, and no part of the posterior is there
DEGREE = 4  # of the polynomial along each constant
FINE = 400  # points along each constant that the posterior is summed at
SEEDS = 8  # of every point of a method
POINTS = 64  # of a method, as many as both rounds of ours have
LEVELS = (0.5, 0.05, 0.95)
WALKERS, STEPS, DISCARDED = 128, 400, 100  # of emcee
ITERATIONS = 4  # of GrainLearning


@dataclass
class Runs:
    """Runs of all experiments at shares of the priors, with seeds of their own every time.

    Attributes:
        question: what is asked.
        seed: of the next runs.
        count: of the runs until now.
    """

    question: CalibrateQuestion
    seed: int
    count: int = 0

    def speeds(self, shares: Floats, seeds: int = SEEDS) -> Floats:
        """Transport speeds (experiments, seeds) [mm/s]; NaN where a run has none."""
        rows = []
        for each in self.question.experiment:
            changes = self.question.changes(each, shares) | {"run.seeds": seeds, "run.seed": self.seed}
            result = simulate(each.scenario.changed(changes))
            rows.append([values_of_seed(result.prepared, seed)[MEASURE] for seed in result.seeds])
            self.count += seeds
        self.seed += 1
        return np.array(rows)

    @functools.cached_property
    def measured(self) -> Floats:
        """Mean [mm/s], standard error [mm/s] and number of measured runs, (3, experiments)."""
        statistics = [each.statistics[MEASURE] for each in self.question.experiment]
        return np.array([(each.mean, each.se, each.n) for each in statistics]).T


@dataclass(frozen=True)
class Draws:
    """Shares of the priors (n, constants) with their weights (n,)."""

    shares: Floats
    weights: Floats

    @staticmethod
    def equal(shares: Floats) -> Draws:
        return Draws(shares, np.full(len(shares), 1.0 / len(shares)))

    def quantiles(self, levels: Sequence[float]) -> Floats:
        """Of every constant, (constants, levels)."""
        rows = []
        for column in self.shares.T:
            order = np.argsort(column)
            below = np.cumsum(self.weights[order]) - 0.5 * self.weights[order]
            rows.append(np.interp(levels, below, column[order]))
        return np.array(rows)

    @property
    def sd(self) -> Floats:
        """Of every constant, (constants,)."""
        return np.asarray(np.sqrt(self.weights @ (self.shares - self.weights @ self.shares) ** 2))

    def below(self, places: Floats) -> Floats:
        """Distribution function of every constant at places (m,), (constants, m)."""
        return np.array([(self.weights[:, None] * (column[:, None] <= places)).sum(axis=0) for column in self.shares.T])

    def off(self, reference: Draws) -> tuple[float, float]:
        """Largest distances of quantiles, in standard deviations of the reference, and of distribution functions."""
        quantiles = np.abs(self.quantiles(LEVELS) - reference.quantiles(LEVELS)) / reference.sd[:, None]
        places = np.linspace(0.0, 1.0, 101)
        return float(quantiles.max()), float(np.abs(self.below(places) - reference.below(places)).max())


def question_of(seed: int) -> CalibrateQuestion:
    """The example without what belongs to single experiments, with other seeds of the runs."""
    example = calibration_of(FILE)
    prior = {key: each for key, each in example.prior.items() if not each.only}
    experiments = tuple(
        each.model_copy(update={"scenario": each.scenario.changed({"run.seed": seed})}) for each in example.experiment
    )
    return example.model_copy(
        update={"experiment": experiments, "prior": prior, "candidate": (), "answer": None, "points": POINTS // 2}
    )


def grid() -> Floats:
    """Shares of the priors, (points, 2)."""
    sides = np.linspace(0.0, HIGHEST, ROWS), np.linspace(0.0, 1.0, COLUMNS)
    return np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1).reshape(-1, 2)


def reference_speeds(question: CalibrateQuestion, file: Path, blocks: int) -> Floats:
    """Speeds (rows, columns, experiments, seeds) [mm/s] of the grid; the file is written after every block."""
    done = [np.load(file)["speeds"]] if file.exists() else []
    for block in range(sum(each.shape[2] for each in done) // BLOCK, blocks):
        runs = Runs(question, 100_000 + 1000 * block)
        done.append(np.array([runs.speeds(row, BLOCK) for row in grid()]))
        np.savez_compressed(file, speeds=np.concatenate(done, axis=2))
    return np.concatenate(done, axis=2)[..., : BLOCK * blocks].reshape(ROWS, COLUMNS, -1, BLOCK * blocks)


def log_likelihood(measured: Floats, means: Floats) -> Floats:
    """Of means (n, experiments) [mm/s] that are known exactly, (n,)."""
    mean, error, n = measured
    return np.asarray(student.logpdf((mean - means) / error, n - 1).sum(axis=1))


def surface(values: Floats, fine: Floats, degree: int) -> Floats:
    """Values (rows, columns) of the grid at all pairs of places (fine,), -1 to 1, by a polynomial; 0 is linear."""
    sides = [np.linspace(-1.0, 1.0, count) for count in values.shape]
    if not degree:
        return np.asarray(RectBivariateSpline(*sides, values, kx=1, ky=1)(fine, fine))
    waves = chebvander(fine, degree)
    left, right = (waves @ np.linalg.pinv(chebvander(side, degree)) for side in sides)
    return np.asarray(left @ values @ right.T)


def summed(measured: Floats, speeds: Floats, degree: int = DEGREE) -> Draws:
    """The posterior by summation, of speeds on the grid (rows, columns, experiments, seeds)."""
    means, fine = np.nanmean(speeds, axis=3), (np.arange(FINE) + 0.5) / FINE
    between = [surface(means[..., k], 2.0 * fine - 1.0, degree).ravel() for k in range(means.shape[2])]
    logs = log_likelihood(measured, np.stack(between, axis=1))
    weights = np.exp(logs - logs.max())
    shares = np.stack(np.meshgrid(HIGHEST * fine, fine, indexing="ij"), axis=-1).reshape(-1, 2)
    return Draws(shares, weights / weights.sum())


def less_of_reference(measured: Floats, speeds: Floats) -> dict[str, Draws]:
    """What less of the grid, and other surfaces give."""
    half = speeds.shape[3] // 2
    return {
        "first half of its seeds": summed(measured, speeds[..., :half]),
        "second half of its seeds": summed(measured, speeds[..., half:]),
        "every second point each way": summed(measured, speeds[::2, ::2]),
        f"degree {DEGREE + 1}": summed(measured, speeds, DEGREE + 1),
        "straight lines between points": summed(measured, speeds, 0),
    }


@dataclass
class Methods:
    """Every method on the same question.

    Attributes:
        runs: what they run.
        most: calls of the target of the longer PyVBMC.
    """

    runs: Runs
    most: int

    @functools.cached_property
    def _emulated(self) -> Any:
        question = self.runs.question
        plan = question.plan(question.experiment[0].scenario, FILE)
        with ThreadPoolExecutor(1) as executor:  # whose processor time is that of this process
            work = Work(executor=executor)
            with workers_of(work) as workers:
                plan.run(Runner(workers, work, Ledger()))
        self.runs.count += POINTS * SEEDS * len(question.experiment)
        return observed(question, plan.rounds)

    def ours(self) -> Draws:
        return Draws.equal(Posterior.of(self._emulated, len(self.runs.question.prior), 0).shares)

    def emcee(self) -> Draws:
        """Walkers on our emulators (Foreman-Mackey et al., 2013)."""
        emcee = import_module("emcee")

        def logs(shares: Floats) -> Floats:
            inside = ((shares >= 0.0) & (shares <= 1.0)).all(axis=1)
            values = sum(each.log_likelihood(np.clip(shares, 0.0, 1.0)) for each in self._emulated)
            return np.where(inside, values, -np.inf)

        np.random.seed(self.runs.seed)  # noqa: NPY002 - emcee draws from it
        start = np.random.default_rng(self.runs.seed).uniform(0.2, 0.8, (WALKERS, 2))
        sampler = emcee.EnsembleSampler(WALKERS, 2, logs, vectorize=True)
        sampler.run_mcmc(start, STEPS)
        return Draws.equal(sampler.get_chain(discard=DISCARDED, flat=True))

    def pyvbmc(self, most: int) -> Draws:
        """Variational Bayesian Monte Carlo with a noisy target (Acerbi, 2020)."""
        vbmc = import_module("pyvbmc").VBMC
        np.random.seed(self.runs.seed)  # noqa: NPY002 - PyVBMC draws from it
        low, high = np.zeros((1, 2)), np.ones((1, 2))
        options = {"specify_target_noise": True, "max_fun_evals": most, "display": "off"}
        method = vbmc(self._noisy, 0.5 * high, low, high, low + 0.1, high - 0.1, options=options)
        posterior, _ = method.optimize()
        return Draws.equal(posterior.sample(10_000)[0])

    def _noisy(self, shares: Floats) -> tuple[float, float]:
        """Log-likelihood of the means of some seeds, and its standard deviation, to second order in their error."""
        speeds = self.runs.speeds(np.ravel(shares))
        means = np.nanmean(speeds, axis=1)
        variance = np.nanvar(speeds, axis=1, ddof=1) / np.isfinite(speeds).sum(axis=1)
        mean, error, n = self.runs.measured
        z, nu = (mean - means) / error, n - 1
        first = (nu + 1) * z / (nu + z**2) / error
        second = (nu + 1) * (nu - z**2) / (nu + z**2) ** 2 / error**2
        noise = math.sqrt(float((first**2 * variance + 0.5 * second**2 * variance**2).sum()))
        return float(log_likelihood(self.runs.measured, means[None])[0]), max(noise, 1e-3)

    def grainlearning(self, iterations: int) -> Draws:
        """The iterative Bayesian filter (Cheng et al., 2019).

        Several iterations choose their own error, with which 0.3 of the samples count, and resample by a mixture of two
        Gaussians; a single one takes the measured standard errors.
        """
        grain = import_module("grainlearning")
        mean, error, _ = self.runs.measured
        weights = (error / mean) ** 2

        def runs_of(calibration: Any) -> None:
            rows = [np.nanmean(self.runs.speeds(row), axis=1) for row in calibration.system.param_data]
            calibration.system.set_sim_data(np.array(rows)[..., None])

        system = {
            "param_names": ["restitution", "friction"],
            "param_min": [0.0, 0.0],
            "param_max": [1.0, 1.0],
            "num_samples": POINTS // iterations,
            "obs_data": mean[:, None],
            "inv_obs_weight": weights.tolist(),
            "sigma_max": 1.0,
            "sigma_tol": 1e-6,
        }
        mixture = {"max_num_components": 2, "covariance_type": "full", "n_init": 1, "random_state": 0}
        inference = {"Bayes_filter": {"ess_target": 0.3}, "sampling": mixture}
        calibration = grain.BayesianCalibration.from_dict(
            {"num_iter": iterations, "callback": runs_of, "system": system, "inference": inference}
        )
        if iterations > 1:
            with redirect_stdout(io.StringIO()):
                calibration.run()
            return Draws(calibration.system.param_data, calibration.inference.posterior)
        calibration.inference.initialize(calibration.system)
        calibration.system.param_data = calibration.inference.param_data_list[0]
        calibration.run_callback()
        of_filter = calibration.inference.Bayes_filter
        of_filter.data_assimilation_loop(math.sqrt(float(weights.prod())), calibration.system)
        return Draws(calibration.system.param_data, of_filter.get_posterior_at_time())

    def named(self) -> dict[str, Callable[[], Draws]]:
        """All of them; our emulators come with the first one that takes them."""
        return {
            "ours": self.ours,
            "emcee, our emulators": self.emcee,
            f"pyvbmc, {POINTS} calls": lambda: self.pyvbmc(POINTS),
            f"pyvbmc, {self.most} calls": lambda: self.pyvbmc(self.most),
            f"grainlearning, {ITERATIONS} iterations": lambda: self.grainlearning(ITERATIONS),
            "grainlearning, measured errors": lambda: self.grainlearning(1),
        }


def row(name: str, draws: Draws, reference: Draws, question: CalibrateQuestion, cost: str) -> str:
    """A line of the table."""
    texts = []
    for quantiles, prior in zip(draws.quantiles(LEVELS), question.prior.values(), strict=True):
        median, low, high = (float(prior.at(float(share))) for share in quantiles)
        texts.append(f"{median:.3f} ({low:.3f} to {high:.3f})")
    off, distance = draws.off(reference)
    return f"| {name} | {cost} | {texts[0]} | {texts[1]} | {off:.2f} | {distance:.3f} |"


def main(
    reference: Annotated[Path, typer.Option("--reference", help="file of the grid, made where it is not there")],
    blocks: Annotated[int, typer.Option("--blocks", help="of 16 seeds each")] = 4,
    seed: Annotated[int, typer.Option("--seed", help="of all runs of the methods")] = 0,
    most: Annotated[int, typer.Option("--most", help="calls of the longer PyVBMC")] = 200,
    only: Annotated[list[str] | None, typer.Option("--only", help="methods by the begin of their names")] = None,
) -> None:
    question = question_of(seed)
    runs = Runs(question, 10_000 * (seed + 1))
    speeds = reference_speeds(question, reference, blocks)
    exact = summed(runs.measured, speeds)
    print("| method | runs | wall (s) | processor (s) | restitution | friction | off (sd) | D |")
    print("|---|---|---|---|---|---|---|---|")
    print(row("grid", exact, exact, question, f"{speeds.size} | |"))
    for name, part in less_of_reference(runs.measured, speeds).items():
        print(row(name, part, exact, question, "| |"))
    for name, method in Methods(runs, most).named().items():
        if only and not name.startswith(tuple(only)):
            continue
        before, wall, processor = runs.count, time.perf_counter(), time.process_time()
        try:
            draws = method()
        except ModuleNotFoundError as error:
            print(f"{name}: {error.name} is not installed")
            continue
        seconds = f"{time.perf_counter() - wall:.0f} | {time.process_time() - processor:.0f}"
        cost = f"{runs.count - before} | {seconds}"
        print(row(name, draws, exact, question, cost), flush=True)


if __name__ == "__main__":
    typer.run(main)
