"""Simulation-based calibration of `feeder-sim calibrate` (Talts et al., 2018): is the truth where it says?

    python benchmarks/calibration_ranks.py [--sets 200] [--points 64]

Constants are drawn from the priors, six runs of each of two drifts are made with them, and calibrated on. If posteriors
are right, the rank of the truth among their draws is uniform, and 90 % intervals hold it in 90 % of the sets.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray
from scipy.stats import kstest

from feeder_sim.jobs.ledger import Ledger
from feeder_sim.jobs.runner import Runner
from feeder_sim.measures.catalogue import values_of_seed
from feeder_sim.measures.statistic import Statistic
from feeder_sim.pool.work import Work
from feeder_sim.pool.workers import workers_of
from feeder_sim.run.simulation import simulate
from feeder_sim.scenario import load_scenario
from feeder_sim.studies.calibration.calibrate import CalibrateQuestion, observed
from feeder_sim.studies.calibration.experiments import Experiment, Prior
from feeder_sim.studies.calibration.posterior import Observed, Posterior

SCENARIOS = Path(__file__).parents[1] / "scenarios"
MEASURE, RUNS = "transport_speed_mm_s", 6
PRIOR = {key: Prior(uniform=(0.05, 0.7)) for key in ("contact.restitution", "contact.friction")}
COVERED = 0.9


@dataclass(frozen=True)
class Ranks:
    """Shares of posterior draws below the truth, (sets, constants), and whether 90 % intervals hold it."""

    shares: NDArray[np.float64]

    @property
    def coverage(self) -> NDArray[np.float64]:
        """Of each constant."""
        half = 0.5 * (1.0 - COVERED)
        return np.asarray(((self.shares > half) & (self.shares < 1.0 - half)).mean(axis=0))

    @property
    def p_values(self) -> list[float]:
        """That uniform ranks are as far from uniform (Kolmogorov and Smirnov), of each constant."""
        return [float(kstest(column, "uniform").pvalue) for column in self.shares.T]


def question(points: int) -> CalibrateQuestion:
    """Both drifts; what was measured does not matter, only its emulators are used."""
    experiments = tuple(
        Experiment(name=name, scenario=load_scenario(SCENARIOS / f"{name}.toml"), measure=MEASURE, mean=1, sd=1, n=RUNS)
        for name in ("drift_4750hz", "drift_8775hz")
    )
    return CalibrateQuestion(experiment=experiments, prior=PRIOR, points=points)


def emulators(problem: CalibrateQuestion, work: Work) -> list[Observed]:
    """From the first round alone: a second one would be somewhere else for every set."""
    plan = problem.plan(problem.experiment[0].scenario, Path("ranks"))
    with workers_of(work) as workers:
        plan.rounds[0][1].run(Runner(workers, work, Ledger()))
    return observed(problem, plan.rounds)


def measured(problem: CalibrateQuestion, of: Observed, place: int, shares: NDArray[np.float64], seed: int) -> Observed:
    """Six runs of an experiment with the constants at shares of their priors."""
    experiment = problem.experiment[place]
    changes = problem.changes(experiment, shares) | {"run.seeds": RUNS, "run.seed": seed}
    result = simulate(experiment.scenario.changed(changes))
    speeds = Statistic.of(values_of_seed(result.prepared, each)[MEASURE] for each in result.seeds)
    return Observed(speeds.mean, speeds.sd, speeds.n, of.emulator, of.constants)


def ranks(sets: int, points: int, work: Work) -> Ranks:
    problem = question(points)
    fitted, rng = emulators(problem, work), np.random.default_rng(1)
    shares = []
    for k in range(sets):
        truth = rng.random(len(PRIOR))
        data = [measured(problem, of, i, truth, 1_000_000 + 2 * k + i) for i, of in enumerate(fitted)]
        posterior = Posterior.of(data, len(PRIOR), k)
        shares.append((posterior.shares < truth).mean(axis=0))
    return Ranks(np.array(shares))


def main(
    sets: Annotated[int, typer.Option("--sets", help="of data")] = 200,
    points: Annotated[int, typer.Option("--points", help="of the emulators")] = 64,
) -> None:
    result = ranks(sets, points, Work())
    for k, key in enumerate(PRIOR):
        covered, error = result.coverage[k], math.sqrt(COVERED * (1.0 - COVERED) / sets)
        text = f"90 % intervals hold the truth in {100.0 * covered:.1f} % (expected 90 ± {100.0 * error:.1f})"
        print(f"{key}: {text}; ranks uniform with p = {result.p_values[k]:.2f}")


if __name__ == "__main__":
    typer.run(main)
