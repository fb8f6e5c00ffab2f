"""Simulation-based calibration of `feeder-sim calibrate` (Talts et al., 2018): is the truth where it says?

    python benchmarks/calibration_ranks.py [--sets 200] [--points 64] [--tracks]
    python benchmarks/calibration_ranks.py --example docs/examples/tracks.csv

Constants are drawn from the priors, one from each of as many equal shares as there are sets; six runs of each of two
drifts are made with them, and calibrated on. If posteriors are right, the rank of the truth among their draws is
uniform, and 90 % intervals hold it in 90 % of the sets. With `--tracks` a camera of 30 frames per second has seen the
runs, with 0.1 mm of noise in every place and a degree in every angle; what is left of the standard deviation of the
prior stands beside that of the speeds alone of the same tracks.
`--example` writes such tracks of six runs at 8775 Hz with the constants of the scenario.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray
from scipy.stats import kstest, qmc

from feeder_sim.jobs.ledger import Ledger
from feeder_sim.jobs.runner import Runner
from feeder_sim.measures.catalogue import values_of_seed
from feeder_sim.measures.statistic import Statistic
from feeder_sim.measures.wander import headings
from feeder_sim.pool.work import Work
from feeder_sim.pool.workers import workers_of
from feeder_sim.records.seed import Seed
from feeder_sim.records.tracks import Camera
from feeder_sim.run.simulation import simulate
from feeder_sim.run.tracked import tracked
from feeder_sim.scenario import load_scenario
from feeder_sim.studies.calibration.calibrate import CalibrateQuestion, observed
from feeder_sim.studies.calibration.experiments import Experiment, Prior
from feeder_sim.studies.calibration.posterior import Observed, Posterior

SCENARIOS = Path(__file__).parents[1] / "scenarios"
SEEN, RUNS = ("transport_speed_mm_s", "wander_mm", "turning_deg"), 6
RATE, NOISE_MM, NOISE_DEG = 30.0, 0.1, 1.0  # of the camera
PRIOR = {key: Prior(uniform=(0.05, 0.7)) for key in ("contact.restitution", "contact.friction")}
COVERED = 0.9


@dataclass(frozen=True)
class Ranks:
    """Shares of posterior draws below the truth, and what is left of the prior's standard deviation, (sets, constants).

    speeds_left: the same, of speeds alone.
    """

    shares: NDArray[np.float64]
    left: NDArray[np.float64]
    speeds_left: NDArray[np.float64]

    @property
    def coverage(self) -> NDArray[np.float64]:
        """Of each constant."""
        half = 0.5 * (1.0 - COVERED)
        return np.asarray(((self.shares > half) & (self.shares < 1.0 - half)).mean(axis=0))

    @property
    def p_values(self) -> list[float]:
        """That uniform ranks are as far from uniform (Kolmogorov and Smirnov), of each constant."""
        return [float(kstest(column, "uniform").pvalue) for column in self.shares.T]


def question(points: int, tracks: bool) -> CalibrateQuestion:
    """Both drifts; what was measured does not matter, only its emulators are used."""
    changes = {"run.frames_per_second": RATE} if tracks else {}
    experiments = tuple(
        Experiment(
            name=name,
            scenario=load_scenario(SCENARIOS / f"{name}.toml").changed(changes),
            values=dict.fromkeys(SEEN if tracks else SEEN[:1], (1.0,)),
        )
        for name in ("drift_4750hz", "drift_8775hz")
    )
    return CalibrateQuestion(experiment=experiments, prior=PRIOR, points=points)


def emulators(problem: CalibrateQuestion, work: Work) -> list[Observed]:
    """From the first round alone: a second one would be somewhere else for every set."""
    plan = problem.plan(problem.experiment[0].scenario, Path("ranks"))
    with workers_of(work) as workers:
        plan.rounds[0][1].run(Runner(workers, work, Ledger()))
    return observed(problem, plan.rounds)


def measured(
    problem: CalibrateQuestion, of: Observed, place: int, shares: NDArray[np.float64], seed: int, folder: Path | None
) -> Observed:
    """Six runs of an experiment with the constants at shares of their priors; with a folder as a camera sees them."""
    experiment = problem.experiment[place]
    changes = problem.changes(experiment, shares) | {"run.seeds": RUNS, "run.seed": seed}
    result = simulate(experiment.scenario.changed(changes))
    prepared, seeds = result.prepared, list(result.seeds)
    if folder is not None:
        file = folder / "tracks.csv"
        write_tracks(file, seeds, np.random.default_rng(seed))
        prepared, seeds = tracked(experiment.scenario, file, Camera())
    values = [values_of_seed(prepared, each) for each in seeds]
    statistics = {name: Statistic.of(each[name] for each in values) for name in of.measured}
    return replace(of, measured=statistics)


def write_tracks(file: Path, seeds: Sequence[Seed], rng: np.random.Generator) -> None:
    """Write what a camera sees of runs of one part, all of them in one table."""
    rows: list[tuple[float, ...]] = []
    for number, seed in enumerate(seeds):
        frames = seed.frames
        place = 1e3 * frames.position[:, 0, :2] + NOISE_MM * rng.normal(size=(len(frames), 2))
        angle = np.degrees(headings(frames.quaternion)[:, 0]) + NOISE_DEG * rng.normal(size=len(frames))
        columns = [frames.time, np.full(len(frames), number), place, angle]
        rows += [tuple(row) for row in np.column_stack(columns).tolist()]
    lines = [f"{t:.6f},{number:.0f},{x:.4f},{y:.4f},{angle:.3f}" for t, number, x, y, angle in sorted(rows)]
    file.write_text("\n".join(["t_s,part,x_mm,y_mm,angle_deg", *lines]) + "\n", encoding="utf-8")


def of_measures(of: Observed, names: Sequence[str]) -> Observed:
    """The same runs, of which some measures alone are known."""
    rows = [list(of.measured).index(name) for name in names]
    measured, emulators = {name: of.measured[name] for name in names}, tuple(of.emulators[row] for row in rows)
    return replace(of, measured=measured, emulators=emulators, correlation=of.correlation[np.ix_(rows, rows)])


def ranks(sets: int, points: int, work: Work, *, tracks: bool = False) -> Ranks:
    problem = question(points, tracks)
    fitted, truths = emulators(problem, work), qmc.LatinHypercube(len(PRIOR), rng=1).random(sets)
    shares, left, speeds_left = [], [], []
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) if tracks else None
        for k, truth in enumerate(truths):
            data = [measured(problem, of, i, truth, 1_000_000 + 2 * k + i, folder) for i, of in enumerate(fitted)]
            posterior = Posterior.of(data, len(PRIOR), k)
            shares.append((posterior.shares < truth).mean(axis=0))
            left.append(posterior.left)
            speeds_left.append(Posterior.of([of_measures(of, SEEN[:1]) for of in data], len(PRIOR), k).left)
    return Ranks(np.array(shares), np.array(left), np.array(speeds_left))


def main(
    sets: Annotated[int, typer.Option("--sets", help="of data")] = 200,
    points: Annotated[int, typer.Option("--points", help="of the emulators")] = 64,
    tracks: Annotated[bool, typer.Option("--tracks", help="as a camera sees the runs")] = False,
    example: Annotated[Path | None, typer.Option("--example", help="file to write tracks into")] = None,
) -> None:
    if example is not None:
        scenario = load_scenario(SCENARIOS / "drift_8775hz.toml")
        result_of_runs = simulate(scenario.changed({"run.frames_per_second": RATE, "run.seeds": RUNS}))
        write_tracks(example, list(result_of_runs.seeds), np.random.default_rng(0))
        return
    result = ranks(sets, points, Work(), tracks=tracks)
    for k, key in enumerate(PRIOR):
        covered, error = result.coverage[k], math.sqrt(COVERED * (1.0 - COVERED) / sets)
        text = f"90 % intervals hold the truth in {100.0 * covered:.1f} % (expected 90 ± {100.0 * error:.1f})"
        left, alone = (float(np.mean(each[:, k])) for each in (result.left, result.speeds_left))
        width = f"{100.0 * left:.0f} % of the prior left"
        if tracks:
            width += f", {100.0 * alone:.0f} % by speeds alone"
        print(f"{key}: {text}; ranks uniform with p = {result.p_values[k]:.2f}; {width}")


if __name__ == "__main__":
    typer.run(main)
