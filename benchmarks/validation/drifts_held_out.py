"""Each of the two measured drifts from the other one: what `feeder-sim calibrate` predicts, beside what was measured.

    python benchmarks/validation/drifts_held_out.py [--points 32] [--seeds 8]

Restitution, friction and the amplitude at 8775 Hz, which was not measured, have the priors of
docs/examples/drifts.toml.
Intervals hold 90 % of the means of six runs: over the posterior, with the scatter of runs that was measured.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from feeder_sim.pool.work import Work
from feeder_sim.scenario.tables import validated
from feeder_sim.studies.ask import ask, folder_of
from feeder_sim.studies.calibration.calibrate import CalibrateQuestion, Calibration
from feeder_sim.studies.calibration.experiments import read_experiments

FILE = Path(__file__).parents[2] / "docs/examples/drifts.toml"


def calibrated(
    known: dict[str, Any], other: dict[str, Any], prior: dict[str, Any], points: int, seeds: int
) -> Calibration:
    """On one drift; the other one is what it is for."""
    answer = {name: other[name] for name in ("name", "scenario", "measure")}
    raw = {"experiment": [known], "answer": answer, "prior": prior, "points": points, "seeds": seeds}
    question = validated(raw, CalibrateQuestion, FILE)
    with tempfile.TemporaryDirectory() as place:
        scenario = question.experiment[0].scenario
        folder = folder_of(question, scenario, Path(place) / "study", name="held_out")
        study = ask(question, scenario, folder, file=FILE, work=Work())
    assert isinstance(study, Calibration)
    return study


def main(
    points: Annotated[int, typer.Option("--points", help="of each of two rounds")] = 32,
    seeds: Annotated[int, typer.Option("--seeds", help="of every point")] = 8,
) -> None:
    raw = read_experiments(FILE)
    rng = np.random.default_rng(0)
    for known, other in (raw["experiment"], raw["experiment"][::-1]):
        means = calibrated(known, other, raw["prior"], points, seeds).answers[:, 0]
        runs = means + other["sd"] / np.sqrt(other["n"]) * rng.standard_t(other["n"] - 1, len(means))
        low, median, high = np.quantile(runs, (0.05, 0.5, 0.95)).tolist()
        interval = f"{median:.2f} mm/s, 90 % {low:.2f} to {high:.2f}"
        print(f"{other['name']} from {known['name']}: {interval}; measured {other['mean']:g}")


if __name__ == "__main__":
    typer.run(main)
