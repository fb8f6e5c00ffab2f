"""Many drifts of which no frame is kept: what they cost, and how much of all cores they use.

    python benchmarks/batch.py [--frequencies 25] [--amplitudes 25] [--seeds 16]
    python benchmarks/batch.py --short 100000

Runs the scenario drift_4750hz over a grid of frequencies and amplitudes with `measure_drift`, 10,000 runs in all. Then
`simulate`, which keeps the frames, and `measure_drift` take turns with 64 seeds of both drifts.

`--short`: so many seeds of 0.2 s of drift_8775hz, in the threads of `measure_drift` and in processes as a study runs
them, beside what the engine alone would take on all cores.
"""

from __future__ import annotations

import argparse
import os
import statistics
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import feeder_sim
from feeder_sim import measure_drift
from feeder_sim.engines.protocol import engine_class
from feeder_sim.pool.work import Work
from feeder_sim.scenario import Scenario, with_run
from feeder_sim.scene.start import generator
from feeder_sim.studies.ask import ask
from feeder_sim.studies.sweep.sweep import SweepQuestion

SCENARIOS = Path(__file__).resolve().parent.parent / "scenarios"
FREQUENCY_HZ, AMPLITUDE_UM = (4000.0, 9000.0), (0.5, 4.0)
ENSEMBLE, ROUNDS = 64, 5
SHORT_S, SAMPLE, MOST_SEEDS = 0.2, 1000, 10_000


def driven(scenario: Scenario, frequency: float, amplitude: float, seeds: int) -> Scenario:
    """The scenario at another frequency [Hz] and amplitude [um]; the part starts as near to the antinode."""
    drive = scenario.drive[0].model_copy(update={"frequency_hz": frequency, "amplitude_um": amplitude})
    return scenario.model_copy(update={"drive": (drive,), "run": scenario.run.model_copy(update={"seeds": seeds})})


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frequencies", type=int, default=25)
    parser.add_argument("--amplitudes", type=int, default=25)
    parser.add_argument("--seeds", type=int, default=16)
    parser.add_argument("--short", type=int, metavar="N")
    options = parser.parse_args()
    if options.short:
        time_short(options.short)
        return
    scenario, cores = feeder_sim.load_scenario(SCENARIOS / "drift_4750hz.toml"), len(os.sched_getaffinity(0))
    points = [
        (float(f), float(a))
        for f in np.linspace(*FREQUENCY_HZ, options.frequencies)
        for a in np.geomspace(*AMPLITUDE_UM, options.amplitudes)
    ]
    measure_drift([driven(scenario, *points[0], 2)])  # compiled
    used, began = time.process_time(), time.perf_counter()
    ensembles = measure_drift(driven(scenario, *point, options.seeds) for point in points)
    used, wall = time.process_time() - used, time.perf_counter() - began
    simulated = sum(ensemble.simulated_s for ensemble in ensembles)
    print(f"{len(points) * options.seeds} runs, {simulated:.0f} simulated s in {wall:.1f} s on {cores} cores: ", end="")
    print(f"{used:.1f} s of processor time, {100.0 * used / (cores * wall):.1f} % of all cores")
    for name in ("drift_4750hz", "drift_8775hz"):
        many = feeder_sim.prepare(with_run(feeder_sim.load_scenario(SCENARIOS / f"{name}.toml"), seeds=ENSEMBLE))
        with_frames, without = shares(lambda: feeder_sim.simulate(many), lambda: measure_drift([many]))  # noqa: B023
        print(f"{ENSEMBLE} seeds of {name}: {with_frames:.0%} of all cores, {without:.0%} without frames")


def time_short(seeds: int) -> None:
    """Print what many seeds of 0.2 s take beside their engine."""
    cores = len(os.sched_getaffinity(0))
    scenario = feeder_sim.load_scenario(SCENARIOS / "drift_8775hz.toml")
    scenario = with_run(scenario, seeds=min(seeds, MOST_SEEDS), duration_s=SHORT_S)
    prepared = feeder_sim.prepare(with_run(scenario, seeds=SAMPLE))
    engine = engine_class(prepared.engine)
    engines = [engine(prepared.scene, generator(prepared.scene, seed)) for seed in range(SAMPLE)]
    began = time.perf_counter()
    for each in engines:
        each.advance(prepared.scene.n_frames - 1)
    alone = (time.perf_counter() - began) / SAMPLE / cores
    began = time.perf_counter()
    for _ in range(seeds // scenario.run.seeds):
        measure_drift([scenario])
    threads = (time.perf_counter() - began) / seeds
    began = time.perf_counter()
    amplitudes = AMPLITUDE_UM[0] * (1.0 + 1e-6 * np.arange(seeds // scenario.run.seeds))
    question = SweepQuestion.of(vary=(f"drive[0].amplitude_um={','.join(map(repr, amplitudes.tolist()))}",))
    ask(question, scenario, work=Work())
    processes = (time.perf_counter() - began) / seeds
    print(f"{seeds} seeds of {SHORT_S:g} s on {cores} cores: {1e3 * alone:.2f} ms each of the engine alone, ", end="")
    print(f"{threads / alone:.1f} times that by measure_drift, {processes / alone:.1f} times in processes of a study")


def shares(*runs: Callable[[], object]) -> list[float]:
    """Processor time over wall time and cores, in turn; the median of the rounds."""
    found: list[list[float]] = [[] for _ in runs]
    for _ in range(ROUNDS):
        for run, share in zip(runs, found, strict=True):
            used, began = time.process_time(), time.perf_counter()
            run()
            share.append((time.process_time() - used) / (len(os.sched_getaffinity(0)) * (time.perf_counter() - began)))
    return [statistics.median(share) for share in found]


if __name__ == "__main__":
    main()
