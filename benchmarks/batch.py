"""Many drifts without frames: how much of the time is spent in the kernel, and what recording every seed would cost.

    python benchmarks/batch.py [--frequencies 25] [--amplitudes 25] [--seeds 16]

Runs the scenario drift_4750hz over a grid of frequencies and amplitudes with `measure_drift`, 10,000 runs in all. Then
`simulate`, which keeps the frames, and `measure_drift` take turns at points of the same grid, and with 64 seeds of both
drifts.
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
from feeder_sim.run.batch import measure_drift
from feeder_sim.scenario import Scenario, with_run

SCENARIOS = Path(__file__).resolve().parent.parent / "scenarios"
FREQUENCY_HZ, AMPLITUDE_UM = (4000.0, 9000.0), (0.5, 4.0)
IN_TURN = 9  # points at which both are timed
ENSEMBLE, ROUNDS = 64, 5


def driven(scenario: Scenario, frequency: float, amplitude: float, seeds: int) -> Scenario:
    """The scenario at another frequency [Hz] and amplitude [um]; the part starts as near to the antinode."""
    drive = scenario.drive[0].model_copy(update={"frequency_hz": frequency, "amplitude_um": amplitude})
    return scenario.model_copy(update={"drive": (drive,), "run": scenario.run.model_copy(update={"seeds": seeds})})


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frequencies", type=int, default=25)
    parser.add_argument("--amplitudes", type=int, default=25)
    parser.add_argument("--seeds", type=int, default=16)
    options = parser.parse_args()
    scenario, cores = feeder_sim.load_scenario(SCENARIOS / "drift_4750hz.toml"), len(os.sched_getaffinity(0))
    points = [
        (float(f), float(a))
        for f in np.linspace(*FREQUENCY_HZ, options.frequencies)
        for a in np.geomspace(*AMPLITUDE_UM, options.amplitudes)
    ]
    measure_drift([driven(scenario, *points[0], 2)])  # compiled
    feeder_sim.simulate(driven(scenario, *points[0], 1))
    used, began = time.process_time(), time.perf_counter()
    ensembles = measure_drift(driven(scenario, *point, options.seeds) for point in points)
    used, wall = time.process_time() - used, time.perf_counter() - began
    kernel, simulated = sum(e.kernel_s for e in ensembles), sum(e.simulated_s for e in ensembles)
    print(f"{len(points) * options.seeds} runs, {simulated:.0f} simulated s in {wall:.1f} s on {cores} cores")
    print(f"in the kernel: {100.0 * kernel / used:.1f} % of the processor time, ", end="")
    print(f"{100.0 * kernel / (cores * wall):.1f} % of all cores")
    ratios = []
    for point in points[:: max(1, len(points) // IN_TURN)]:
        changed = driven(scenario, *point, options.seeds)
        began = time.perf_counter()
        kept = feeder_sim.simulate(changed)
        middle = time.perf_counter()
        (ensemble,) = measure_drift([changed])
        ratios.append((middle - began) / (time.perf_counter() - middle))
        speed = ensemble.findings.transport_speed_mm_s
        same = kept.measures()["transport_speed_mm_s"]
        assert same["n"] == speed.n and (not speed.n or abs(same["mean"] / speed.mean - 1.0) < 1e-9)
        print(f"{point[0]:7.0f} Hz {point[1]:5.2f} um: {speed.mean:6.3f} +- {speed.se:.3f} mm/s, n = {speed.n}")
    print(f"wall time of simulate over that of measure_drift: {statistics.median(ratios):.2f} in the median")
    for name in ("drift_4750hz", "drift_8775hz"):
        many = feeder_sim.prepare(with_run(feeder_sim.load_scenario(SCENARIOS / f"{name}.toml"), seeds=ENSEMBLE))
        with_frames, without = shares(lambda: feeder_sim.simulate(many), lambda: measure_drift([many]))  # noqa: B023
        print(f"{ENSEMBLE} seeds of {name}: {with_frames:.0%} of all cores, {without:.0%} without frames")


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
